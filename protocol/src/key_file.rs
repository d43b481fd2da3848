//! Key files: made for one owner, and read only if nobody else can.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::key::{Key, KeyTextError, Keys};
use crate::limits;

/// What may be permitted to others than the owner: nothing.
const OTHERS: u32 = 0o077;

/// Reading, for a group.
const GROUP_READS: u32 = 0o040;

/// The superuser, and its group.
const ROOT: u32 = 0;

/// A key file cannot be made or used. Each text says what to do.
#[derive(Debug, Error)]
pub enum KeyFileError {
    /// It cannot be read.
    #[error(
        "cannot read the key file {path}: {source}; make one with `master keygen`, once, and copy it to all \
         machines of the grid"
    )]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Others than its owner may use it.
    #[error("the key file {path} is open to other users (mode {mode:04o}): run `chmod 600 {path}`")]
    NotPrivate {
        /// The file.
        path: PathBuf,
        /// Its permissions.
        mode: u32,
    },
    /// It is somebody else's.
    #[error(
        "the key file {path} belongs to user {owner}, this program runs as user {user}: run `chown {user} {path}`"
    )]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Its owner's number.
        owner: u32,
        /// Ours.
        user: u32,
    },
    /// It holds no keys.
    #[error("{path} is no key file: {source}")]
    Content {
        /// The file.
        path: PathBuf,
        /// Why.
        source: KeyTextError,
    },
    /// It is too long to be one.
    #[error("{path} is no key file: it has more than {} bytes", limits::KEY_FILE_BYTES)]
    TooLong {
        /// The file.
        path: PathBuf,
    },
    /// A new one cannot be written.
    #[error("cannot make the key file {path}: {source}")]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The system has no random numbers.
    #[error("cannot make a key: {0}")]
    NoRandomness(#[from] getrandom::Error),
}

/// Reads the keys of a file that belongs to this user, or to root, and to nobody else.
pub fn read(path: &Path) -> Result<Keys, KeyFileError> {
    let unreadable = |source| KeyFileError::Unreadable {
        path: path.to_owned(),
        source,
    };
    // Of the file that is open, not of what has its name a moment later.
    let file = File::open(path).map_err(unreadable)?;
    check_private(path, &file.metadata().map_err(unreadable)?)?;

    let mut text = String::new();
    let limit = limits::KEY_FILE_BYTES as u64;
    file.take(limit + 1)
        .read_to_string(&mut text)
        .map_err(unreadable)?;
    if text.len() > limits::KEY_FILE_BYTES {
        return Err(KeyFileError::TooLong {
            path: path.to_owned(),
        });
    }
    Keys::parse(&text).map_err(|source| KeyFileError::Content {
        path: path.to_owned(),
        source,
    })
}

/// Makes a file with a new key. One that exists is left alone: a key that is lost locks a grid out.
pub fn create(path: &Path) -> Result<Key, KeyFileError> {
    let key = Key::generate()?;
    let text = format!(
        "# The key of a Gridlight grid, {}. Who has it can join the grid: keep it secret, mode 0600.\n{}\n",
        key.fingerprint(),
        key.to_line(),
    );
    let mut options = OpenOptions::new();
    let created = options.write(true).create_new(true).mode(0o600).open(path);
    let written = created.and_then(|mut file| {
        file.write_all(text.as_bytes())?;
        file.sync_all()
    });
    written.map_err(|source| KeyFileError::Unwritable {
        path: path.to_owned(),
        source,
    })?;
    Ok(key)
}

fn check_private(path: &Path, metadata: &Metadata) -> Result<(), KeyFileError> {
    let (path, mode) = (path.to_owned(), metadata.mode() & 0o7777);
    // Service managers hand a secret to an unprivileged service as root's own, with a list of who may
    // read it besides; the list shows as permissions of root's group.
    let is_handed_out = metadata.uid() == ROOT && metadata.gid() == ROOT && mode & OTHERS == GROUP_READS;
    if mode & OTHERS != 0 && !is_handed_out {
        return Err(KeyFileError::NotPrivate { path, mode });
    }
    let (owner, user) = (metadata.uid(), rustix::process::geteuid().as_raw());
    if owner != user && owner != ROOT {
        return Err(KeyFileError::Foreign { path, owner, user });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{PermissionsExt as _, chown};

    use super::*;

    /// What reading a file says that was just made and then changed.
    fn read_after(change: impl FnOnce(&Path)) -> Result<String, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.key");
        create(&path).unwrap();
        change(&path);
        read(&path)
            .map(|keys| keys.fingerprints())
            .map_err(|error| error.to_string())
    }

    fn set_mode(path: &Path, mode: u32) {
        fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    }

    #[track_caller]
    fn refused(change: impl FnOnce(&Path), words: &str) {
        let said = read_after(change).unwrap_err();
        assert!(said.contains(words), "{said}");
    }

    #[test]
    fn a_new_key_file_is_private_and_holds_its_key() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.key");
        let key = create(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        assert_eq!(read(&path).unwrap().fingerprints(), key.fingerprint());
    }

    #[test]
    fn a_file_that_exists_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.key");
        let key = create(&path).unwrap();
        assert!(create(&path).unwrap_err().to_string().contains("exists"));
        assert_eq!(read(&path).unwrap().fingerprints(), key.fingerprint());
    }

    #[test]
    fn a_key_that_others_can_read_is_refused_with_the_remedy() {
        for mode in [0o644, 0o604, 0o660, 0o620, 0o601] {
            refused(|path| set_mode(path, mode), "chmod 600");
        }
        assert!(read_after(|path| set_mode(path, 0o400)).is_ok());
    }

    #[test]
    fn another_users_key_is_refused_with_the_remedy() {
        if rustix::process::geteuid().is_root() {
            refused(|path| chown(path, Some(12_345), None).unwrap(), "chown 0");
        }
    }

    #[test]
    fn roots_key_may_be_readable_for_roots_group() {
        if rustix::process::geteuid().is_root() {
            assert!(read_after(|path| set_mode(path, 0o440)).is_ok());
            refused(|path| set_mode(path, 0o444), "chmod 600");
        }
    }

    #[test]
    fn what_is_no_key_file_is_refused_in_words() {
        refused(|path| fs::remove_file(path).unwrap(), "master keygen");
        refused(|path| fs::write(path, "secret\n").unwrap(), "line 1 is no key");
        let long = "#".repeat(limits::KEY_FILE_BYTES + 1);
        refused(|path| fs::write(path, long).unwrap(), "more than");
        let folder = tempfile::tempdir().unwrap();
        set_mode(folder.path(), 0o700);
        let said = read(folder.path()).unwrap_err().to_string();
        assert!(said.contains("directory"), "{said}");
    }
}
