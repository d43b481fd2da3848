//! Keeps the last scene in memory, so that the next frame of it loads nothing.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Context as _, bail};
use protocol::message::{Prepared, SceneRef};

use crate::renderer::{LoadedScene, Renderer};

/// One scene, and how its files looked when it was read.
#[derive(Debug, Default)]
pub struct SceneCache {
    kept: Option<Kept>,
}

#[derive(Debug)]
struct Kept {
    path: PathBuf,
    loaded: LoadedScene,
    stamps: Vec<Stamp>,
}

/// What changes when a file is written.
#[derive(Debug, PartialEq)]
struct Stamp {
    modified: Option<SystemTime>,
    bytes: Option<u64>,
}

impl SceneCache {
    /// The scene that was prepared last.
    pub fn scene(&self) -> Option<&LoadedScene> {
        self.kept.as_ref().map(|kept| &kept.loaded)
    }

    /// Makes `wanted` the scene in memory, unless it is already.
    pub fn prepare(&mut self, wanted: &SceneRef, renderer: &dyn Renderer) -> anyhow::Result<Prepared> {
        if let Some(kept) = self.kept.as_ref().filter(|kept| kept.is(wanted)) {
            return Ok(prepared(&kept.loaded, Duration::ZERO, Duration::ZERO));
        }
        // Two large scenes might not fit into memory.
        self.kept = None;
        let path = PathBuf::from(&wanted.path);
        let loaded = renderer
            .load(&path)
            .with_context(|| format!("cannot load {}", path.display()))?;
        if let (Some(wanted), Some(found)) = (&wanted.digest, &loaded.digest)
            && wanted != found
        {
            bail!(
                "{} differs from the master's copy (digest {found} here, {wanted} there): \
                 make both machines see the same files",
                path.display()
            );
        }
        let stamps = loaded.files.iter().map(|file| Stamp::of(file)).collect();
        let answer = prepared(&loaded, loaded.load, loaded.bvh);
        self.kept = Some(Kept { path, loaded, stamps });
        Ok(answer)
    }
}

impl Kept {
    fn is(&self, wanted: &SceneRef) -> bool {
        let same_content = match (&wanted.digest, &self.loaded.digest) {
            (Some(wanted), Some(kept)) => wanted == kept,
            _ => true,
        };
        let unchanged = || {
            self.loaded
                .files
                .iter()
                .zip(&self.stamps)
                .all(|(file, stamp)| Stamp::of(file) == *stamp)
        };
        self.path == Path::new(&wanted.path) && same_content && unchanged()
    }
}

impl Stamp {
    fn of(file: &Path) -> Self {
        let metadata = fs::metadata(file).ok();
        Self {
            modified: metadata.as_ref().and_then(|metadata| metadata.modified().ok()),
            bytes: metadata.map(|metadata| metadata.len()),
        }
    }
}

fn prepared(scene: &LoadedScene, load: Duration, bvh: Duration) -> Prepared {
    Prepared {
        digest: scene.digest.clone(),
        load_us: load.as_micros() as u64,
        bvh_us: bvh.as_micros() as u64,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use protocol::settings::Settings;
    use serde_bytes::ByteBuf;

    use super::*;
    use crate::renderer::{Frame, Scene};

    /// "Loads" a text file; its content is its digest.
    #[derive(Debug)]
    struct Reads;

    #[derive(Debug)]
    struct Nothing;

    impl Renderer for Reads {
        fn load(&self, path: &Path) -> anyhow::Result<LoadedScene> {
            Ok(LoadedScene {
                scene: Arc::new(Nothing),
                digest: Some(fs::read_to_string(path)?),
                files: vec![path.to_owned()],
                load: Duration::from_micros(7),
                bvh: Duration::from_micros(8),
            })
        }
    }

    impl Scene for Nothing {
        fn set_up(&self, _: &Settings, _: &[ByteBuf]) -> anyhow::Result<Arc<dyn Frame>> {
            bail!("not here")
        }
    }

    fn scene_file(content: &str) -> (tempfile::TempDir, SceneRef) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        fs::write(&path, content).unwrap();
        let path = path.to_str().unwrap().to_owned();
        (folder, SceneRef { path, digest: None })
    }

    fn load_us(cache: &mut SceneCache, scene: &SceneRef) -> u64 {
        cache.prepare(scene, &Reads).unwrap().load_us
    }

    #[test]
    fn the_same_scene_is_loaded_once() {
        let (_folder, scene) = scene_file("red");
        let mut cache = SceneCache::default();
        assert_eq!(load_us(&mut cache, &scene), 7);
        assert_eq!(load_us(&mut cache, &scene), 0);
    }

    #[test]
    fn a_scene_is_loaded_again_when_a_file_has_changed() {
        let (_folder, scene) = scene_file("red");
        let mut cache = SceneCache::default();
        load_us(&mut cache, &scene);
        fs::write(&scene.path, "green").unwrap();
        assert_eq!(load_us(&mut cache, &scene), 7);
        assert_eq!(load_us(&mut cache, &scene), 0);
    }

    #[test]
    fn a_scene_that_differs_from_the_masters_is_refused() {
        let (_folder, mut scene) = scene_file("red");
        scene.digest = Some("green".to_owned());
        let error = SceneCache::default()
            .prepare(&scene, &Reads)
            .unwrap_err()
            .to_string();
        assert!(error.contains("digest red here, green there"), "{error}");
    }

    #[test]
    fn a_missing_scene_is_named() {
        let scene = SceneRef {
            path: "/no/such/scene.toml".to_owned(),
            digest: None,
        };
        let error = SceneCache::default().prepare(&scene, &Reads).unwrap_err();
        assert!(format!("{error:#}").contains("/no/such/scene.toml"), "{error:#}");
    }
}
