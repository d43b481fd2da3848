//! Key files, made as people make them.

use std::{
    fs::{self, Permissions},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    process::Command,
};

use protocol::{Key, Keys};
use tempfile::TempDir;

use crate::programs::program;

/// A new key, in a file of a folder of its own.
#[derive(Debug)]
pub struct KeyFile {
    _folder: TempDir,
    path: PathBuf,
    keys: Keys,
}

impl KeyFile {
    /// Makes one by `master keygen`.
    pub fn make() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("grid.key");
        let made = Command::new(program("master"))
            .args(["keygen", "--out"])
            .arg(&path)
            .output()
            .expect("the program starts");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        Self::read(folder, path)
    }

    /// Puts keys into a file, as people do with an editor.
    pub fn of(keys: &[&Key]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("grid.key");
        let lines: Vec<String> = keys.iter().map(|key| key.to_line()).collect();
        let written = fs::write(&path, lines.join("\n"));
        let private = written.and_then(|()| fs::set_permissions(&path, Permissions::from_mode(0o600)));
        private.expect("a file can be written");
        Self::read(folder, path)
    }

    fn read(folder: TempDir, path: PathBuf) -> Self {
        let text = fs::read_to_string(&path).expect("the key is text");
        let keys = Keys::parse(&text).expect("a key file holds keys");
        Self {
            _folder: folder,
            path,
            keys,
        }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its key.
    pub fn key(&self) -> &Key {
        self.keys.iter().next().expect("there is a key in it")
    }
}
