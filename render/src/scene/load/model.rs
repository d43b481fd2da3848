//! An OBJ file with its materials and the names of its textures: everything but the triangles.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::{Place, SceneError};
use super::files::{self, Found};
use super::limits::{MTL_BYTES_MAX, OBJ_BYTES_MAX};
use super::mtl::{self, Appearance};
use super::note::{Note, Simplification};
use super::obj::text::{self, ObjText};

/// The bytes of an OBJ file.
#[derive(Debug)]
pub(super) struct ObjBytes {
    /// Relative to the scene file, as written in it.
    pub(super) name: String,
    pub(super) file: Arc<Path>,
    bytes: Vec<u8>,
    pub(super) hash: blake3::Hash,
}

impl ObjBytes {
    /// Reads the file; `named_at` and `remedy` complete the error.
    pub(super) fn read(
        name: &str,
        path: &Path,
        named_at: Option<&Place>,
        remedy: &str,
    ) -> Result<Self, SceneError> {
        let bytes = files::read(path, OBJ_BYTES_MAX, named_at, remedy)?;
        Ok(Self {
            name: name.to_owned(),
            file: path.into(),
            hash: blake3::hash(&bytes),
            bytes,
        })
    }
}

/// An OBJ file that was looked through, and the materials it uses.
#[derive(Debug)]
pub(super) struct Model<'a> {
    pub(super) file: &'a Arc<Path>,
    pub(super) text: ObjText<'a>,
    /// The materials that have faces, in order of first use.
    pub(super) materials: Vec<ModelMaterial>,
    pub(super) libraries: Vec<LibraryFile>,
    pub(super) notes: Vec<Note>,
}

/// A material as far as it could be found.
#[derive(Debug)]
pub(super) struct ModelMaterial {
    pub(super) name: String,
    /// `None`: no MTL file has it.
    pub(super) appearance: Option<Appearance>,
    /// The albedo map, if there is one and it was found.
    pub(super) texture: Option<TextureUse>,
}

/// A texture file that a material names.
#[derive(Debug)]
pub(super) struct TextureUse {
    /// Relative to the scene file.
    pub(super) name: String,
    pub(super) path: PathBuf,
    pub(super) named_at: Place,
    /// Whether the file is there.
    pub(super) is_there: bool,
}

/// An MTL file that the OBJ file names.
#[derive(Debug)]
pub(super) struct LibraryFile {
    /// Relative to the scene file.
    pub(super) name: String,
    pub(super) path: PathBuf,
    /// `None`: the file is missing.
    pub(super) hash: Option<blake3::Hash>,
}

impl<'a> Model<'a> {
    /// Looks through the file, and reads the MTL files it names.
    pub(super) fn open(obj: &'a ObjBytes) -> Result<Self, SceneError> {
        let text = text::check(&obj.file, &obj.bytes)?;
        let mut model = Self {
            file: &obj.file,
            text,
            materials: Vec::new(),
            libraries: Vec::new(),
            notes: Vec::new(),
        };
        model.note_oddities();
        let known = model.read_libraries(&obj.name)?;
        model.find_materials(&known);
        model.find_textures(&obj.name);
        model.note_simplifications();
        Ok(model)
    }

    fn note_oddities(&mut self) {
        let survey = &self.text.survey;
        if let Some((count, line)) = survey.not_finite {
            self.notes.push(Note::NotFinite {
                place: Place::line(self.file, line),
                count,
            });
        }
        if let Some((count, keyword, line)) = &survey.unknown {
            self.notes.push(Note::StatementsUnknown {
                place: Place::line(self.file, *line),
                keyword: keyword.clone(),
                count: *count,
            });
        }
        if survey.triangles_without_material > 0 {
            self.notes.push(Note::NoMaterial {
                path: self.file.to_path_buf(),
                triangles: survey.triangles_without_material,
            });
        }
    }

    fn read_libraries(&mut self, obj_name: &str) -> Result<BTreeMap<String, Appearance>, SceneError> {
        let mut known = BTreeMap::new();
        for (written, line) in self.text.survey.libraries.clone() {
            for written in self.library_names(&written) {
                let found = files::find(files::folder_of(self.file), &written);
                // Some programs name the library before every part.
                if self.libraries.iter().any(|l| &l.path == found.path()) {
                    continue;
                }
                let named_at = Place::line(self.file, line);
                let missing = |named_at, path| Note::MtlMissing { named_at, path };
                let (path, is_there) = self.found(&found, &named_at, missing);
                let mut hash = None;
                if is_there {
                    let remedy = "check the permissions of the MTL file";
                    let bytes = files::read(&path, MTL_BYTES_MAX, Some(&named_at), remedy)?;
                    known.extend(mtl::read(&path.as_path().into(), &bytes)?);
                    hash = Some(blake3::hash(&bytes));
                }
                let name = relative_name(obj_name, &written);
                self.libraries.push(LibraryFile { name, path, hash });
            }
        }
        Ok(known)
    }

    /// `mtllib` may name several files, and a file name may hold spaces.
    fn library_names(&self, written: &str) -> Vec<String> {
        let is_there =
            |name: &str| !matches!(files::find(files::folder_of(self.file), name), Found::Missing(_));
        let words = written.split_ascii_whitespace();
        if !is_there(written) && words.clone().any(is_there) {
            words.map(str::to_owned).collect()
        } else {
            vec![written.to_owned()]
        }
    }

    /// The path, and whether the file is there; with a note if that is not quite what was named.
    fn found(
        &mut self,
        found: &Found,
        named_at: &Place,
        missing: impl FnOnce(Place, PathBuf) -> Note,
    ) -> (PathBuf, bool) {
        let path = found.path().clone();
        let named_at = named_at.clone();
        let note = match found {
            Found::Exactly(_) => return (path, true),
            Found::OtherCase(path) => Note::OtherCase {
                named_at,
                path: path.clone(),
            },
            Found::Missing(path) => missing(named_at, path.clone()),
        };
        self.notes.push(note);
        (path, !matches!(found, Found::Missing(_)))
    }

    fn find_materials(&mut self, known: &BTreeMap<String, Appearance>) {
        let used = &self.text.survey.materials;
        self.materials = used
            .iter()
            .map(|(name, _)| ModelMaterial {
                name: name.clone(),
                appearance: known.get(name).cloned(),
                texture: None,
            })
            .collect();
        let unknown: Vec<_> = used
            .iter()
            .filter(|(name, _)| !known.contains_key(name))
            .collect();
        // A missing MTL file was noted already, and explains them.
        let none_missing = self.libraries.iter().all(|library| library.hash.is_some());
        if let Some((_, line)) = unknown.first()
            && none_missing
        {
            self.notes.push(Note::MaterialsUnknown {
                named_at: Place::line(self.file, *line),
                materials: unknown.iter().map(|(name, _)| name.clone()).collect(),
            });
        }
    }

    fn find_textures(&mut self, obj_name: &str) {
        for index in 0..self.materials.len() {
            let material = &self.materials[index];
            let Some(appearance) = &material.appearance else {
                continue;
            };
            let Some(map) = &appearance.kd_map else {
                continue;
            };
            let named_at = appearance.place.clone();
            let material = material.name.clone();
            // Relative to the MTL file.
            let folder = files::folder_of(&named_at.file).to_owned();
            let library = self.libraries.iter().find(|l| *l.path == *named_at.file);
            let library = library.map_or(obj_name, |library| &library.name);
            let name = relative_name(library, &map.file);
            let missing = |named_at, path| Note::TextureMissing {
                named_at,
                path,
                material,
            };
            let (path, is_there) = self.found(&files::find(&folder, &map.file), &named_at, missing);
            self.materials[index].texture = Some(TextureUse {
                name,
                path,
                named_at,
                is_there,
            });
        }
    }

    /// One note for each MTL file and simplification.
    fn note_simplifications(&mut self) {
        let mut groups: BTreeMap<(&Path, Simplification), Vec<String>> = BTreeMap::new();
        for material in &self.materials {
            let Some(appearance) = &material.appearance else {
                continue;
            };
            for &simplification in &appearance.simplifications {
                let key = (&*appearance.place.file, simplification);
                groups.entry(key).or_default().push(material.name.clone());
            }
        }
        let notes = groups
            .into_iter()
            .map(|((path, simplification), materials)| Note::Simplified {
                path: path.to_owned(),
                simplification,
                materials,
            });
        self.notes.extend(notes.collect::<Vec<_>>());
    }
}

/// A name that is relative to a file, made relative to what that file's name is relative to.
fn relative_name(file_name: &str, written: &str) -> String {
    let written = written.replace('\\', "/");
    match file_name.rsplit_once('/') {
        Some((folder, _)) => format!("{folder}/{written}"),
        None => written,
    }
}
