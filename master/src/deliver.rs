//! Puts finished files in their places, whole or not at all.
//!
//! Each file is written under a temporary name in the folder of its final place, then renamed. A
//! reader meets the old file or the new one, never a part; whatever goes wrong before the rename
//! leaves nothing behind. Nothing is forced to the medium: a flush of the disk takes from
//! milliseconds to seconds and would have to be paid out of every deadline.

use std::{
    ffi::{OsStr, OsString},
    fs::{File, Permissions},
    io,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
};

use rustix::fs::{CWD, RenameFlags, renameat_with};
use tempfile::NamedTempFile;

/// A place where no file can be put.
#[derive(Debug, thiserror::Error)]
pub enum DeliverError {
    /// The folder is not there.
    #[error("the folder {} does not exist; create it, or choose another place", .0.display())]
    NoFolder(PathBuf),
    /// Something other than a file has the name already.
    #[error("{} is a folder; choose a file name", .0.display())]
    IsFolder(PathBuf),
    /// The folder does not take files.
    #[error("cannot write into the folder {}: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The last step failed.
    #[error("cannot put {} in its place: {source}", path.display())]
    Rename {
        /// The final name.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The name says nothing about the format.
    #[error("{} has no known extension; use .exr or .png", .0.display())]
    Extension(PathBuf),
}

/// A file that is being written under a temporary name.
#[derive(Debug)]
pub struct StagedFile {
    temporary: NamedTempFile,
    path: PathBuf,
}

impl StagedFile {
    /// Creates the temporary file. Done at start, this also tells early whether the folder is there
    /// and takes files.
    pub fn create(path: &Path) -> Result<Self, DeliverError> {
        if path.is_dir() {
            return Err(DeliverError::IsFolder(path.to_owned()));
        }
        let folder = folder_of(path);
        if !folder.is_dir() {
            return Err(DeliverError::NoFolder(folder.to_owned()));
        }
        let mut prefix = OsString::from(".");
        prefix.push(path.file_name().unwrap_or_default());
        prefix.push(".");
        let temporary = tempfile::Builder::new()
            .prefix(&prefix)
            .suffix(".partial")
            // As any new file: readable for whom the umask says, unlike other temporary files.
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(folder)
            .map_err(|source| DeliverError::Folder {
                folder: folder.to_owned(),
                source,
            })?;
        Ok(Self {
            temporary,
            path: path.to_owned(),
        })
    }

    /// Where to write.
    pub fn file(&mut self) -> &mut File {
        self.temporary.as_file_mut()
    }

    /// The final name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives the file its final name, in place of what had it.
    pub fn publish(self) -> Result<(), DeliverError> {
        if exchange(self.temporary.path(), &self.path).is_ok() {
            // The temporary name is now that of the old file, which goes with it.
            return Ok(());
        }
        match self.temporary.persist(&self.path) {
            Ok(_) => Ok(()),
            Err(error) => Err(DeliverError::Rename {
                path: self.path,
                source: error.error,
            }),
        }
    }
}

/// Lets two files change names. To rename onto a file does the same to all who look, but ext4 then
/// begins to write the new one to the disk, and the caller has to wait for tens of milliseconds.
fn exchange(a: &Path, b: &Path) -> io::Result<()> {
    // A folder that has come up in the place since the start would be deleted.
    if !b.symlink_metadata()?.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    Ok(renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE)?)
}

/// Where a file of this name is put.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// The files of a picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PictureFiles {
    /// The multi-layer EXR.
    pub exr: Option<PathBuf>,
    /// The 8-bit PNG.
    pub png: Option<PathBuf>,
}

impl PictureFiles {
    /// What `--out` and `--no-png` ask for.
    pub fn new(out: &Path, no_png: bool) -> Result<Self, DeliverError> {
        let extension = out.extension().map(OsStr::to_ascii_lowercase);
        match extension.as_deref().and_then(|extension| extension.to_str()) {
            Some("exr") => Ok(Self {
                exr: Some(out.to_owned()),
                png: (!no_png).then(|| out.with_extension("png")),
            }),
            Some("png") => Ok(Self {
                exr: None,
                png: Some(out.to_owned()),
            }),
            _ => Err(DeliverError::Extension(out.to_owned())),
        }
    }

    /// Creates a file without a name where the picture goes: it is gone when this process is, however
    /// that ends.
    pub fn nameless(&self) -> io::Result<File> {
        let path = self.exr.as_deref().or(self.png.as_deref());
        tempfile::tempfile_in(path.map_or(Path::new("."), folder_of))
    }

    /// Creates the temporary files.
    pub fn stage(&self) -> Result<StagedPicture, DeliverError> {
        let stage = |path: &Option<PathBuf>| path.as_deref().map(StagedFile::create).transpose();
        Ok(StagedPicture {
            exr: stage(&self.exr)?,
            png: stage(&self.png)?,
        })
    }
}

/// The files of a picture under temporary names.
#[derive(Debug)]
pub struct StagedPicture {
    /// The multi-layer EXR.
    pub exr: Option<StagedFile>,
    /// The 8-bit PNG.
    pub png: Option<StagedFile>,
}

impl StagedPicture {
    /// Puts the files in their places.
    pub fn publish(self) -> Result<(), DeliverError> {
        [self.exr, self.png]
            .into_iter()
            .flatten()
            .try_for_each(StagedFile::publish)
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, io::Write};

    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn an_exr_has_a_png_beside_it_and_a_png_is_alone() {
        let files = |out: &str, no_png| PictureFiles::new(Path::new(out), no_png).unwrap();
        assert_eq!(files("a/b.exr", false).png, Some("a/b.png".into()));
        assert_eq!(files("a/b.EXR", true).png, None);
        assert_eq!(files("a/b.png", false).exr, None);
        for out in ["a/b", "a/b.jpg", ".exr"] {
            assert!(PictureFiles::new(Path::new(out), false).is_err(), "{out}");
        }
    }

    #[test]
    fn the_final_name_appears_only_with_the_whole_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let mut staged = StagedFile::create(&path).unwrap();
        staged.file().write_all(b"light").unwrap();
        assert!(!path.exists());
        staged.publish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"light");
        assert_eq!(names(folder.path()), ["picture.png"]);
    }

    #[test]
    fn an_old_file_is_replaced_by_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        fs::write(&path, "old and longer").unwrap();
        let mut staged = StagedFile::create(&path).unwrap();
        staged.file().write_all(b"new").unwrap();
        staged.publish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["picture.png"]);
    }

    #[test]
    fn what_is_given_up_leaves_nothing_and_the_old_file_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        fs::write(&path, "old").unwrap();
        let mut staged = StagedFile::create(&path).unwrap();
        staged.file().write_all(b"new").unwrap();
        drop(staged);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["picture.png"]);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let error = StagedFile::create(Path::new("/no/such/folder/a.exr")).unwrap_err();
        assert!(matches!(error, DeliverError::NoFolder(folder) if folder == Path::new("/no/such/folder")));
    }
}
