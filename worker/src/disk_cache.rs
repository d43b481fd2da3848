//! Chunks of scenes on disk, shared by all workers of a machine: a scene travels there once.
//!
//! A file is named by its chunk's digest and holds the chunk as it travelled. It is written under
//! another name and renamed, and verified by whoever reads it, so neither a crash nor a bad disk nor
//! another worker can do more than make a chunk travel again.

use std::ffi::OsString;
use std::fs::{self, DirBuilder, File};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use protocol::Digest;
use rustix::fs::{Timespec, Timestamps, UTIME_NOW, UTIME_OMIT, futimens};

/// Where a worker keeps chunks, and how many.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CacheOptions {
    /// The folder; made if it is not there.
    pub folder: PathBuf,
    /// All files together are kept below this.
    pub limit_bytes: u64,
}

/// A folder of chunks.
#[derive(Debug)]
pub struct DiskCache {
    options: CacheOptions,
}

/// A file in the folder.
#[derive(Debug)]
struct Entry {
    used: SystemTime,
    bytes: u64,
    path: PathBuf,
}

impl DiskCache {
    /// Opens the folder, which only its owner can read if it has to be made.
    pub fn open(options: CacheOptions) -> io::Result<Self> {
        let mut builder = DirBuilder::new();
        builder.recursive(true).mode(0o700).create(&options.folder)?;
        Ok(Self { options })
    }

    /// What is kept of a chunk, if that is at most `limit_bytes`; it counts as just used. Not verified.
    pub fn read(&self, chunk: Digest, limit_bytes: usize) -> Option<Vec<u8>> {
        let file = File::open(self.path(chunk)).ok()?;
        let mut data = Vec::new();
        let read = (&file).take(limit_bytes as u64 + 1).read_to_end(&mut data);
        if read.is_err() || data.len() > limit_bytes {
            self.forget(chunk);
            return None;
        }
        let now = Timestamps {
            last_access: nanoseconds(UTIME_OMIT),
            last_modification: nanoseconds(UTIME_NOW),
        };
        // The file of another user stays as old as it is.
        let _ = futimens(&file, &now);
        Some(data)
    }

    /// Keeps a chunk.
    pub fn write(&self, chunk: Digest, data: &[u8]) -> io::Result<()> {
        let mut file = tempfile::NamedTempFile::new_in(&self.options.folder)?;
        file.write_all(data)?;
        file.persist(self.path(chunk))?;
        Ok(())
    }

    /// Removes a chunk that is not what it should be.
    pub fn forget(&self, chunk: Digest) {
        // Another worker may have been first.
        let _ = fs::remove_file(self.path(chunk));
    }

    /// Removes what was not used for longest until there is room for so many bytes more. False if there
    /// never can be.
    pub fn make_room(&self, bytes: u64) -> io::Result<bool> {
        let Some(allowed) = self.options.limit_bytes.checked_sub(bytes) else {
            return Ok(false);
        };
        let mut entries = self.entries()?;
        entries.sort_unstable_by_key(|entry| entry.used);
        let mut kept: u64 = entries.iter().map(|entry| entry.bytes).sum();
        for entry in entries {
            if kept <= allowed {
                break;
            }
            fs::remove_file(&entry.path).or_else(|error| match error.kind() {
                io::ErrorKind::NotFound => Ok(()),
                _ => Err(error),
            })?;
            kept -= entry.bytes;
        }
        Ok(true)
    }

    /// Every file, also what a worker that was killed left unfinished: it grows old like the rest.
    fn entries(&self) -> io::Result<Vec<Entry>> {
        let mut entries = Vec::new();
        for entry in fs::read_dir(&self.options.folder)? {
            let entry = entry?;
            // One that is gone meanwhile takes no room.
            if let Ok(metadata) = entry.metadata()
                && metadata.is_file()
            {
                entries.push(Entry {
                    used: metadata.modified()?,
                    bytes: metadata.len(),
                    path: entry.path(),
                });
            }
        }
        Ok(entries)
    }

    fn path(&self, chunk: Digest) -> PathBuf {
        self.options.folder.join(chunk.to_string())
    }
}

fn nanoseconds(tv_nsec: i64) -> Timespec {
    Timespec { tv_sec: 0, tv_nsec }
}

/// The folder for chunks as the environment has it: `$CACHE_DIRECTORY` of a systemd unit, else
/// `$XDG_CACHE_HOME/gridlight`, else `~/.cache/gridlight`.
pub fn folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let path = |name| {
        let value = variable(name)?;
        // systemd separates several folders by colons.
        let first = std::env::split_paths(&value).next()?;
        first.is_absolute().then_some(first)
    };
    let gridlight = |cache: &Path| cache.join("gridlight");
    let folder = path("CACHE_DIRECTORY")
        .or_else(|| path("XDG_CACHE_HOME").map(|cache| gridlight(&cache)))
        .or_else(|| path("HOME").map(|home| gridlight(&home.join(".cache"))))?;
    Some(folder.join("chunks"))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tempfile::TempDir;

    use super::*;

    fn cache(limit_bytes: u64) -> (DiskCache, TempDir) {
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().join("a/chunks");
        let options = CacheOptions { folder, limit_bytes };
        (DiskCache::open(options).unwrap(), directory)
    }

    /// Keeps a chunk of ten bytes that was used so many seconds after the others' beginning.
    fn keep(cache: &DiskCache, name: &str, used: u64) -> Digest {
        let chunk = Digest::of(name.as_bytes());
        cache.write(chunk, b"0123456789").unwrap();
        let file = File::open(cache.path(chunk)).unwrap();
        file.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(used))
            .unwrap();
        chunk
    }

    fn kept(cache: &DiskCache, chunks: &[Digest]) -> Vec<bool> {
        chunks.iter().map(|&chunk| cache.path(chunk).exists()).collect()
    }

    #[test]
    fn what_was_written_is_read_also_by_another_worker_of_the_machine() {
        let (cache, _directory) = cache(100);
        let chunk = keep(&cache, "red", 1);
        let other = DiskCache::open(cache.options.clone()).unwrap();
        assert_eq!(other.read(chunk, 10).as_deref(), Some(&b"0123456789"[..]));
        assert_eq!(other.read(Digest::of(b"green"), 10), None);
    }

    #[test]
    fn a_file_that_is_longer_than_the_chunk_can_be_is_removed_unread() {
        let (cache, _directory) = cache(100);
        let chunk = keep(&cache, "red", 1);
        assert_eq!(cache.read(chunk, 9), None);
        assert_eq!(kept(&cache, &[chunk]), [false]);
    }

    #[test]
    fn what_was_not_used_for_longest_goes_first() {
        let (cache, _directory) = cache(50);
        let chunks = [("red", 3), ("green", 1), ("blue", 2), ("white", 4)]
            .map(|(name, used)| keep(&cache, name, used));
        // Reading is use.
        cache.read(chunks[1], 10).unwrap();
        assert!(cache.make_room(10).unwrap());
        assert_eq!(kept(&cache, &chunks), [true; 4]);
        assert!(cache.make_room(25).unwrap());
        assert_eq!(kept(&cache, &chunks), [false, true, false, true]);
        assert!(!cache.make_room(51).unwrap());
    }

    #[test]
    fn what_a_killed_worker_left_unfinished_is_removed_in_its_time() {
        let (cache, _directory) = cache(50);
        let unfinished = cache.options.folder.join(".tmpA1b2C3");
        fs::write(&unfinished, [0; 30]).unwrap();
        assert!(cache.make_room(40).unwrap());
        assert!(!unfinished.exists());
    }

    #[test]
    fn whatever_a_digest_is_its_file_is_in_the_folder() {
        let (cache, directory) = cache(100);
        let chunk = Digest(*b"../../../../../../../etc/crontab");
        cache.write(chunk, b"0123456789").unwrap();
        let files: Vec<_> = fs::read_dir(&cache.options.folder).unwrap().collect();
        let [Ok(file)] = &files[..] else {
            panic!("{files:?}")
        };
        assert_eq!(file.file_name(), chunk.to_string().as_str());
        assert!(file.path().starts_with(directory.path()));
    }

    #[test]
    fn the_folder_is_the_units_else_the_users() {
        let folder_in = |variables: &[(&str, &str)]| {
            folder(|name| {
                let found = variables.iter().find(|(known, _)| *known == name);
                found.map(|(_, value)| value.into())
            })
        };
        let unit = ("CACHE_DIRECTORY", "/var/cache/gridlight:/var/cache/other");
        let (xdg, home) = (("XDG_CACHE_HOME", "/x"), ("HOME", "/users/ann"));
        assert_eq!(
            folder_in(&[unit, xdg, home]),
            Some("/var/cache/gridlight/chunks".into())
        );
        assert_eq!(folder_in(&[xdg, home]), Some("/x/gridlight/chunks".into()));
        assert_eq!(
            folder_in(&[home]),
            Some("/users/ann/.cache/gridlight/chunks".into())
        );
        assert_eq!(folder_in(&[("HOME", "relative")]), None);
        assert_eq!(folder_in(&[]), None);
    }
}
