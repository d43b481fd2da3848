//! Where the scenes are, and small ones that are written for one test.

use std::{
    env, fs,
    path::{Path, PathBuf},
};

use tempfile::TempDir;

use crate::programs::root;

/// A scene of this repository.
pub fn scene(name: &str) -> PathBuf {
    root().join("scenes").join(name).join(name).with_extension("toml")
}

/// The scene file of the paper's cathedral, if its model is on this machine.
pub fn sibenik() -> Option<PathBuf> {
    let folder =
        env::var_os("GRIDLIGHT_SCENES").map_or_else(|| root().join("../shared/scenes"), PathBuf::from);
    let model = folder.join("sibenik/sibenik.obj");
    model.is_file().then(|| root().join("scenes/sibenik.toml"))
}

/// A triangle, as OBJ.
pub const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// What comes before it in the file of a mesh that has a material.
pub const TRIANGLE_HEAD: &str = "mtllib a.mtl\nusemtl a\n";

/// Its material, as MTL.
pub const MATERIAL: &str = "newmtl a\nKd 0.8 0.6 0.4\n";

/// A scene with `a.obj` and a light beside the camera, as TOML.
pub const LIT_TRIANGLE: &str = "\
[camera]
eye = [0.3, 0.3, 3]
look_at = [0.3, 0.3, 0]
[[mesh]]
path = \"a.obj\"
[[light.quad]]
corner = [2, 0, 2]
edge_u = [0, 1, 0]
edge_v = [1, 0, 0]
radiance = [9, 9, 9]
";

/// A folder with the files of a scene.
#[derive(Debug)]
pub struct SceneFolder(TempDir);

impl SceneFolder {
    /// A folder with `a.toml`, `a.obj` and `a.mtl`: a lit triangle that is as it should be.
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
            .with("a.toml", LIT_TRIANGLE)
            .with("a.obj", format!("{TRIANGLE_HEAD}{TRIANGLE}"))
            .with("a.mtl", MATERIAL)
    }

    /// A copy of all files of a scene of this repository.
    pub fn copy_of(name: &str) -> Self {
        let copy = Self(tempfile::tempdir().expect("a temporary folder"));
        let files = fs::read_dir(root().join("scenes").join(name)).expect("the scene's folder");
        for file in files.flatten().filter(|file| file.path().is_file()) {
            fs::copy(file.path(), copy.path(&file.file_name().to_string_lossy())).expect("a copy");
        }
        copy
    }

    /// Puts a file there, in place of what has the name.
    #[must_use]
    pub fn with(self, name: &str, contents: impl AsRef<[u8]>) -> Self {
        fs::write(self.path(name), contents).expect("a file in a temporary folder");
        self
    }

    /// Replaces a text that occurs in a file.
    #[must_use]
    #[track_caller]
    pub fn replacing(self, name: &str, old: &str, new: &str) -> Self {
        let text = fs::read_to_string(self.path(name)).expect("a text file");
        assert!(text.contains(old), "{name} does not have {old:?}");
        self.with(name, text.replace(old, new))
    }

    /// Takes a file away.
    #[must_use]
    pub fn without(self, name: &str) -> Self {
        fs::remove_file(self.path(name)).expect("a file to remove");
        self
    }

    /// A file there.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        self.0.path()
    }
}

impl Default for SceneFolder {
    fn default() -> Self {
        Self::new()
    }
}
