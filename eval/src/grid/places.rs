//! Where scenes are: the project's own folder, and the folder of scenes that are not part of it.

use std::path::{Path, PathBuf};

/// What `$GRIDLIGHT_SCENES` in a scene file stands for: the given folder, else the master's choice.
pub fn shared_scenes(given: Option<&Path>) -> PathBuf {
    given.map_or_else(master::scene_path::scenes_dir, Path::to_owned)
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
