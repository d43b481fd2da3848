//! Keeps the last scene in memory, so that the next frame of it needs neither the network nor a BVH.

use std::time::Duration;

use anyhow::{Context as _, bail};
use protocol::message::{Prepared, SceneRef, digest_text};

use crate::renderer::{LoadedScene, Renderer};

/// One scene, known by the digest of its bytes.
#[derive(Debug, Default)]
pub struct SceneCache {
    kept: Option<(String, LoadedScene)>,
}

impl SceneCache {
    /// The scene that was prepared last.
    pub fn scene(&self) -> Option<&LoadedScene> {
        self.kept.as_ref().map(|(_, scene)| scene)
    }

    /// Makes `wanted` the scene to render, if it is the one in memory.
    pub fn find(&self, wanted: &SceneRef) -> Option<Prepared> {
        let (digest, _) = self.kept.as_ref()?;
        (*digest == wanted.digest).then(|| prepared(wanted, Duration::ZERO, Duration::ZERO))
    }

    /// Makes a scene of the bytes that came for `wanted`.
    pub fn build(
        &mut self,
        wanted: &SceneRef,
        bytes: &[u8],
        renderer: &dyn Renderer,
    ) -> anyhow::Result<Prepared> {
        // Two large scenes might not fit into memory.
        self.kept = None;
        let digest = digest_text(blake3::hash(bytes).as_bytes());
        if digest != wanted.digest {
            bail!(
                "the scene did not arrive as it was sent: its digest is {digest}, that of the master {}",
                wanted.digest
            );
        }
        let loaded = renderer.load(bytes).context("cannot use the master's scene")?;
        let answer = prepared(wanted, loaded.load, loaded.bvh);
        self.kept = Some((digest, loaded));
        Ok(answer)
    }
}

fn prepared(scene: &SceneRef, load: Duration, bvh: Duration) -> Prepared {
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

    /// Takes any bytes but empty ones for a scene.
    #[derive(Debug)]
    struct Reads;

    #[derive(Debug)]
    struct Nothing;

    impl Renderer for Reads {
        fn load(&self, bytes: &[u8]) -> anyhow::Result<LoadedScene> {
            if bytes.is_empty() {
                bail!("no bytes");
            }
            Ok(LoadedScene {
                scene: Arc::new(Nothing),
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

    fn scene(bytes: &[u8]) -> SceneRef {
        SceneRef {
            digest: digest_text(blake3::hash(bytes).as_bytes()),
            bytes: bytes.len() as u64,
        }
    }

    #[test]
    fn a_scene_is_found_until_another_one_is_built() {
        let mut cache = SceneCache::default();
        let (red, green) = (scene(b"red"), scene(b"green"));
        assert_eq!(cache.find(&red), None);
        assert_eq!(cache.build(&red, b"red", &Reads).unwrap().load_us, 7);
        assert_eq!(cache.find(&red).unwrap().load_us, 0);
        cache.build(&green, b"green", &Reads).unwrap();
        assert_eq!(cache.find(&red), None);
        assert!(cache.find(&green).is_some());
    }

    #[test]
    fn bytes_that_are_not_those_of_the_digest_are_refused() {
        let error = SceneCache::default()
            .build(&scene(b"red"), b"rod", &Reads)
            .unwrap_err()
            .to_string();
        assert!(error.contains("did not arrive as it was sent"), "{error}");
    }

    #[test]
    fn a_scene_that_cannot_be_used_says_why_and_is_not_kept() {
        let mut cache = SceneCache::default();
        let error = cache.build(&scene(b""), b"", &Reads).unwrap_err();
        assert!(format!("{error:#}").contains("no bytes"), "{error:#}");
        assert!(cache.scene().is_none());
    }
}
