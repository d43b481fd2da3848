//! Where scenes are when the command line does not say.

use std::{
    env,
    path::{Path, PathBuf},
};

const CORNELL_BOX: &str = "scenes/cornell-box/cornell-box.toml";
/// The folder of scenes as data, seen from the project's root.
const SHARED_SCENES: &str = "../shared/scenes";
/// Names the folder of scenes as data.
pub const VARIABLE: &str = "GRIDLIGHT_SCENES";

/// The Cornell box: in the current folder, in the project that this program was built in, or
/// installed beside the program. The first of them if there is none, so that the error names it.
pub fn default_scene() -> PathBuf {
    let places = roots().map(|root| root.join(CORNELL_BOX));
    places
        .into_iter()
        .find(|path| path.is_file())
        .unwrap_or_else(|| PathBuf::from(CORNELL_BOX))
}

/// The folder that `$GRIDLIGHT_SCENES` in a scene file stands for.
pub fn scenes_dir() -> PathBuf {
    if let Some(folder) = env::var_os(VARIABLE).filter(|folder| !folder.is_empty()) {
        return folder.into();
    }
    let places = roots().map(|root| root.join(SHARED_SCENES));
    places
        .into_iter()
        .find(|path| path.is_dir())
        .unwrap_or_else(|| built_in().join(SHARED_SCENES))
}

fn roots() -> [PathBuf; 3] {
    let beside_program = env::current_exe()
        .ok()
        .and_then(|program| Some(program.parent()?.join("../share/gridlight")))
        .unwrap_or_default();
    [PathBuf::new(), built_in().to_owned(), beside_program]
}

/// The project's root when this program was built.
fn built_in() -> &'static Path {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package)
}
