//! Where scenes are: the project's own folder, and the folder of scenes that are not part of it.

use std::{
    env,
    path::{Path, PathBuf},
};

/// Names the folder of scenes that are not in this repository.
const VARIABLE: &str = "GRIDLIGHT_SCENES";
/// That folder if the variable is not set, seen from the project's root.
const SHARED_SCENES: &str = "../shared/scenes";

/// What `$GRIDLIGHT_SCENES` in a scene file stands for.
pub fn shared_scenes(given: Option<&Path>) -> PathBuf {
    let from_environment = || env::var_os(VARIABLE).filter(|folder| !folder.is_empty());
    match (given, from_environment()) {
        (Some(folder), _) => folder.to_owned(),
        (None, Some(folder)) => folder.into(),
        (None, None) => project_root().join(SHARED_SCENES),
    }
}

/// A scene file of the project.
pub fn scene_file(name: &str) -> PathBuf {
    project_root().join("scenes").join(name)
}

/// The project's root: the current folder if it has scenes, else where this program was built.
pub fn project_root() -> PathBuf {
    let here = PathBuf::new();
    if here.join("scenes/cornell-box").is_dir() {
        return here;
    }
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package).to_owned()
}
