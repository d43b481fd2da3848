//! Where the OBJ files of a scene are: each is read once, however many `[[mesh]]` name it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::LoadOptions;
use super::description::MeshEntry;
use super::error::{Place, SceneError};
use super::files::{self, Found};
use super::model::ObjBytes;
use super::note::Note;

/// The variable that a path in a scene file may begin with.
const SCENES_VARIABLE: &str = "GRIDLIGHT_SCENES";

/// The OBJ files of a scene.
pub(super) struct Meshes<'a> {
    /// Each file once, in order of first mention.
    pub(super) files: Vec<MeshFile<'a>>,
    /// For each `[[mesh]]` the index of its file.
    pub(super) file_of: Vec<usize>,
}

/// An OBJ file to be read.
pub(super) struct MeshFile<'a> {
    /// The first mention.
    entry: &'a MeshEntry,
    path: PathBuf,
    remedy: String,
}

impl<'a> Meshes<'a> {
    /// Looks for the file of every entry.
    pub(super) fn find(
        scene: &Path,
        entries: &'a [MeshEntry],
        options: &LoadOptions,
        notes: &mut Vec<Note>,
    ) -> Result<Self, SceneError> {
        let mut meshes = Self {
            files: Vec::new(),
            file_of: Vec::new(),
        };
        let mut known = HashMap::new();
        for entry in entries {
            let file = MeshFile::find(scene, entry, options, notes)?;
            // Two names may lead to one file.
            let identity = std::fs::canonicalize(&file.path).unwrap_or_else(|_| file.path.clone());
            let index = *known.entry(identity).or_insert(meshes.files.len());
            if index == meshes.files.len() {
                meshes.files.push(file);
            }
            meshes.file_of.push(index);
        }
        Ok(meshes)
    }
}

impl<'a> MeshFile<'a> {
    fn find(
        scene: &Path,
        entry: &'a MeshEntry,
        options: &LoadOptions,
        notes: &mut Vec<Note>,
    ) -> Result<Self, SceneError> {
        let Some(named_at) = &entry.named_at else {
            return Ok(Self {
                entry,
                path: scene.to_owned(),
                remedy: "check the path".into(),
            });
        };
        let relative_to_scenes = strip_variable(&entry.path, named_at)?;
        let (found, remedy) = match relative_to_scenes {
            Some(rest) => (
                files::find(&options.scenes_dir, rest),
                format!(
                    "${SCENES_VARIABLE} stands for {} here: set this environment variable to the folder that has the file",
                    options.scenes_dir.display()
                ),
            ),
            None => (
                files::find(files::folder_of(scene), &entry.path),
                "check the path, which is relative to the folder of the scene file".into(),
            ),
        };
        let path = match found {
            Found::Exactly(path) | Found::Missing(path) => path,
            Found::OtherCase(path) => {
                notes.push(Note::OtherCase {
                    named_at: named_at.clone(),
                    path: path.clone(),
                });
                path
            }
        };
        Ok(Self { entry, path, remedy })
    }

    /// The bytes of the file.
    pub(super) fn read(&self) -> Result<ObjBytes, SceneError> {
        let named_at = self.entry.named_at.as_ref();
        ObjBytes::read(&self.entry.path, &self.path, named_at, &self.remedy)
    }
}

/// What follows a leading `$GRIDLIGHT_SCENES/`; `None` for a path without a variable.
fn strip_variable<'p>(path: &'p str, place: &Place) -> Result<Option<&'p str>, SceneError> {
    let mut components = path.split(['/', '\\']).enumerate();
    let is_known = |(index, component): (usize, &str)| {
        let name = component.trim_start_matches(['$', '{']).trim_end_matches('}');
        index == 0 && name == SCENES_VARIABLE
    };
    let variables = components.by_ref().filter(|(_, c)| c.starts_with('$'));
    let mut leading = None;
    for variable in variables {
        if !is_known(variable) {
            return Err(SceneError::UnknownVariable {
                place: place.clone(),
                variable: variable.1.to_owned(),
            });
        }
        leading = Some(path[variable.1.len()..].trim_start_matches(['/', '\\']));
    }
    Ok(leading)
}
