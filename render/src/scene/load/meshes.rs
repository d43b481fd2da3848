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
    /// Whether the capitals of the name differ.
    is_other_case: bool,
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
            let file = MeshFile::find(scene, entry, options)?;
            // Two names may lead to one file.
            let identity = std::fs::canonicalize(&file.path).unwrap_or_else(|_| file.path.clone());
            let index = *known.entry(identity).or_insert(meshes.files.len());
            if index == meshes.files.len() {
                notes.extend(file.note());
                meshes.files.push(file);
            }
            meshes.file_of.push(index);
        }
        Ok(meshes)
    }
}

impl<'a> MeshFile<'a> {
    fn find(scene: &Path, entry: &'a MeshEntry, options: &LoadOptions) -> Result<Self, SceneError> {
        let Some(named_at) = &entry.named_at else {
            return Ok(Self {
                entry,
                path: scene.to_owned(),
                is_other_case: false,
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
        Ok(Self {
            entry,
            is_other_case: matches!(found, Found::OtherCase(_)),
            path: found.path().clone(),
            remedy,
        })
    }

    /// What to say about the name.
    fn note(&self) -> Option<Note> {
        let named_at = self.entry.named_at.clone()?;
        let path = self.path.clone();
        self.is_other_case.then_some(Note::OtherCase { named_at, path })
    }

    /// The bytes of the file.
    pub(super) fn read(&self) -> Result<ObjBytes, SceneError> {
        let named_at = self.entry.named_at.as_ref();
        ObjBytes::read(&self.entry.path, &self.path, named_at, &self.remedy)
    }
}

/// What follows a leading `$GRIDLIGHT_SCENES/`; `None` for a path without a variable.
fn strip_variable<'p>(path: &'p str, place: &Place) -> Result<Option<&'p str>, SceneError> {
    let separators = ['/', '\\'];
    let mut leading = None;
    for (index, component) in path.split(separators).enumerate() {
        let Some(name) = component.strip_prefix('$') else {
            continue;
        };
        let name = name
            .strip_prefix('{')
            .and_then(|n| n.strip_suffix('}'))
            .unwrap_or(name);
        if index > 0 || name != SCENES_VARIABLE {
            return Err(SceneError::UnknownVariable {
                place: place.clone(),
                variable: component.to_owned(),
            });
        }
        leading = Some(path[component.len()..].trim_start_matches(separators));
    }
    Ok(leading)
}
