//! The files of a scene: found, read within limits, and remembered for the digest.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Component, Path, PathBuf};

use super::error::{Place, SceneError};

/// All files of a scene, in a fixed order.
#[derive(Debug, Default)]
pub(super) struct FileList {
    records: Vec<FileRecord>,
    known: HashSet<PathBuf>,
}

/// One file of a scene.
#[derive(Debug)]
struct FileRecord {
    /// Relative to the scene file, as written in it.
    name: String,
    path: PathBuf,
    /// BLAKE3 of the bytes; `None` when the file is missing.
    hash: Option<blake3::Hash>,
}

impl FileList {
    /// Adds a file unless it is in the list.
    pub(super) fn add(&mut self, name: &str, path: &Path, hash: Option<blake3::Hash>) {
        if self.known.insert(path.to_owned()) {
            self.records.push(FileRecord {
                name: name.to_owned(),
                path: path.to_owned(),
                hash,
            });
        }
    }

    /// BLAKE3 over name and contents of all files; files that are missing count by their names.
    pub(super) fn digest(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        for record in &self.records {
            hasher.update(&(record.name.len() as u64).to_le_bytes());
            hasher.update(record.name.as_bytes());
            match &record.hash {
                Some(hash) => hasher.update(&[1]).update(hash.as_bytes()),
                None => hasher.update(&[0]),
            };
        }
        hasher.finalize().into()
    }

    /// The files that were read.
    pub(super) fn into_paths(self) -> Vec<PathBuf> {
        let read = self.records.into_iter().filter(|record| record.hash.is_some());
        read.map(|record| record.path).collect()
    }
}

/// Reads a whole file of at most `bytes_max`; `remedy` completes the error when it cannot be read.
pub(super) fn read(
    path: &Path,
    bytes_max: u64,
    named_at: Option<&Place>,
    remedy: &str,
) -> Result<Vec<u8>, SceneError> {
    let unreadable = |source| SceneError::Unreadable {
        named_at: named_at.cloned(),
        path: path.to_owned(),
        source,
        remedy: remedy.to_owned(),
    };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        // A pipe or a device would never end.
        return Err(unreadable(io::Error::other("it is not a regular file")));
    }
    let too_large = |count| SceneError::Limit {
        path: path.to_owned(),
        what: "bytes",
        count,
        limit: bytes_max,
    };
    if metadata.len() > bytes_max {
        return Err(too_large(metadata.len()));
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize + 1);
    File::open(path)
        .and_then(|file| file.take(bytes_max + 1).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    if bytes.len() as u64 > bytes_max {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

/// What came of looking for a file.
#[derive(Debug, PartialEq)]
pub(super) enum Found {
    /// Under exactly this name.
    Exactly(PathBuf),
    /// Under a name with other capitals.
    OtherCase(PathBuf),
    /// Not at all; it should have been here.
    Missing(PathBuf),
}

impl Found {
    /// Where the file is, or should be.
    pub(super) fn path(&self) -> &PathBuf {
        let (Self::Exactly(path) | Self::OtherCase(path) | Self::Missing(path)) = self;
        path
    }
}

/// Looks for a file as another file names it: relative to `folder`, with `/` or `\` between folders,
/// and if need be with other capitals (files made on other systems).
pub(super) fn find(folder: &Path, written: &str) -> Found {
    let written = written.replace('\\', "/");
    let exact = folder.join(&written);
    if exact.exists() {
        return Found::Exactly(exact);
    }
    let mut path = if Path::new(&written).is_absolute() {
        PathBuf::new()
    } else {
        folder.to_owned()
    };
    for component in Path::new(&written).components() {
        match component {
            Component::Normal(name) if !path.join(name).exists() => {
                match other_case(&path, &name.to_string_lossy()) {
                    Some(name) => path.push(name),
                    None => return Found::Missing(exact),
                }
            }
            other => path.push(other),
        }
    }
    Found::OtherCase(path)
}

/// The first entry of a folder that differs from `name` in capitals only.
fn other_case(folder: &Path, name: &str) -> Option<String> {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let name = name.to_lowercase();
    std::fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|entry| entry.to_lowercase() == name)
        .min()
}

/// The folder that the names in a file are relative to.
pub(super) fn folder_of(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_found_with_backslashes_and_other_capitals() {
        let folder = tempfile::tempdir().expect("a folder");
        let textures = folder.path().join("Textures");
        std::fs::create_dir(&textures).expect("written");
        std::fs::write(textures.join("Stone.PNG"), b"").expect("written");
        let find = |written| find(folder.path(), written);
        let stone = textures.join("Stone.PNG");
        assert_eq!(find("Textures\\Stone.PNG"), Found::Exactly(stone.clone()));
        assert_eq!(find("textures/stone.png"), Found::OtherCase(stone));
        let missing = folder.path().join("textures/wood.png");
        assert_eq!(find("textures\\wood.png"), Found::Missing(missing));
        assert!(matches!(find("a\0b.png"), Found::Missing(_)));
    }

    #[test]
    fn a_file_over_the_limit_is_not_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.obj");
        std::fs::write(&path, b"12345").expect("written");
        assert_eq!(read(&path, 5, None, "").expect("within"), b"12345");
        let error = read(&path, 4, None, "").expect_err("beyond").to_string();
        assert!(error.contains("a.obj: 5 bytes"), "{error}");
        assert!(error.contains("limit of 4"), "{error}");
    }

    #[test]
    fn a_folder_is_not_a_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let error = read(folder.path(), 5, None, "name a file").expect_err("refused");
        assert!(error.to_string().contains("not a regular file; name a file"));
    }

    #[test]
    fn the_digest_tells_names_contents_and_missing_files_apart() {
        let digest = |files: &[(&str, Option<&[u8]>)]| {
            let mut list = FileList::default();
            for &(name, bytes) in files {
                list.add(name, Path::new(name), bytes.map(blake3::hash));
            }
            list.digest()
        };
        let one = digest(&[("a", Some(b"x")), ("b", Some(b"y"))]);
        assert_eq!(one, digest(&[("a", Some(b"x")), ("b", Some(b"y"))]));
        assert_ne!(one, digest(&[("b", Some(b"y")), ("a", Some(b"x"))]));
        assert_ne!(one, digest(&[("a", Some(b"x")), ("c", Some(b"y"))]));
        assert_ne!(one, digest(&[("a", Some(b"x")), ("b", Some(b"z"))]));
        assert_ne!(one, digest(&[("a", Some(b"x")), ("b", None)]));
        assert_ne!(one, digest(&[("a", Some(b"x"))]));
    }
}
