//! The scenes that a worker has: the last ones in memory, ready to render, and one that is coming.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use anyhow::{Context as _, bail};
use protocol::bundle::unpack;
use protocol::message::{Prepared, SceneChunk, SceneRef};
use protocol::{Digest, limits};

use crate::disk_cache::DiskCache;
use crate::renderer::{LoadedScene, Renderer};

/// Scenes stay in memory while all together have at most so many bytes. With its BVH a scene takes about
/// three times its bytes.
const WARM_BYTES: u64 = 128 << 20;

/// Scenes, each known by its digest.
#[derive(Debug, Default)]
pub struct SceneCache {
    /// The one to render is the last.
    warm: VecDeque<Warm>,
    incoming: Option<Incoming>,
    disk: Option<DiskCache>,
}

#[derive(Debug)]
struct Warm {
    digest: Digest,
    bytes: u64,
    scene: LoadedScene,
}

/// A scene of which not all chunks are here.
#[derive(Debug)]
struct Incoming {
    scene: SceneRef,
    bytes: Vec<u8>,
    missing: BTreeSet<u32>,
    /// Whether there is room for it on the disk.
    is_kept: bool,
}

/// What there is of a scene that was asked for.
#[derive(Debug, PartialEq, Eq)]
pub enum Found {
    /// It can be rendered.
    Ready(Prepared),
    /// These chunks are neither in memory nor on disk.
    Missing(Vec<u32>),
}

impl SceneCache {
    /// An empty memory over a disk that may have something.
    pub fn new(disk: Option<DiskCache>) -> Self {
        Self {
            disk,
            ..Self::default()
        }
    }

    /// The scene that was prepared last.
    pub fn scene(&self) -> Option<&LoadedScene> {
        self.warm.back().map(|warm| &warm.scene)
    }

    /// Makes `wanted` the scene to render if it is in memory, else the one that is coming.
    pub fn find(&mut self, wanted: &SceneRef) -> anyhow::Result<Found> {
        if let Some(place) = self.warm.iter().position(|warm| warm.digest == wanted.digest) {
            let warm = self.warm.remove(place);
            self.warm.extend(warm);
            return Ok(Found::Ready(prepared(
                wanted.digest,
                Duration::ZERO,
                Duration::ZERO,
            )));
        }
        wanted.verify()?;
        // What came before the connection broke need not come again.
        if self
            .incoming
            .as_ref()
            .is_none_or(|incoming| incoming.scene.digest != wanted.digest)
        {
            self.incoming = None;
            self.incoming = Some(self.begin(wanted));
        }
        let missing = self.incoming.iter().flat_map(|incoming| &incoming.missing);
        Ok(Found::Missing(missing.copied().collect()))
    }

    /// Takes a chunk of the scene that is coming.
    pub fn take(&mut self, chunk: &SceneChunk) -> anyhow::Result<()> {
        let Some(incoming) = &mut self.incoming else {
            bail!("no scene is coming");
        };
        let digest = incoming.unpack(chunk.chunk, &chunk.data)?;
        if incoming.is_kept
            && let Some(disk) = &self.disk
            && let Err(error) = disk.write(digest, &chunk.data)
        {
            tracing::warn!(%error, "a scene cannot be kept on disk");
            incoming.is_kept = false;
        }
        Ok(())
    }

    /// Makes a scene of all the chunks that have come.
    pub fn build(&mut self, renderer: &dyn Renderer) -> anyhow::Result<Prepared> {
        let complete = self.incoming.take_if(|incoming| incoming.missing.is_empty());
        let incoming = complete.context("the scene is not complete")?;
        let (digest, bytes) = (incoming.scene.digest, incoming.scene.bytes);
        // Before, not after: they might not fit into memory together.
        while self.warm.iter().map(|warm| warm.bytes).sum::<u64>() + bytes > WARM_BYTES
            && !self.warm.is_empty()
        {
            self.warm.pop_front();
        }
        let scene = renderer
            .load(&incoming.bytes)
            .context("cannot use the master's scene")?;
        let answer = prepared(digest, scene.load, scene.bvh);
        self.warm.push_back(Warm { digest, bytes, scene });
        Ok(answer)
    }

    /// What the disk has of a scene; what it has and what is missing will have room there.
    fn begin(&self, scene: &SceneRef) -> Incoming {
        let mut incoming = Incoming {
            // Memory is taken by the system when the bytes come, not now.
            bytes: vec![0; scene.bytes as usize],
            missing: (0..scene.chunks.len() as u32).collect(),
            scene: scene.clone(),
            is_kept: false,
        };
        let Some(disk) = &self.disk else {
            return incoming;
        };
        for (chunk, &digest) in (0..).zip(&scene.chunks) {
            let Some(data) = disk.read(digest, limits::SCENE_CHUNK_BYTES) else {
                continue;
            };
            if let Err(error) = incoming.unpack(chunk, &data) {
                tracing::warn!(%digest, %error, "a chunk on disk is broken; it will come again");
                disk.forget(digest);
            }
        }
        let missing = incoming.missing.iter().filter_map(|&chunk| scene.chunk(chunk));
        let room = disk.make_room(missing.map(|place| place.len() as u64).sum());
        incoming.is_kept = room.unwrap_or_else(|error| {
            tracing::warn!(%error, "no room can be made on disk for a scene");
            false
        });
        incoming
    }
}

impl Incoming {
    /// Puts a chunk in its place.
    fn unpack(&mut self, chunk: u32, data: &[u8]) -> anyhow::Result<Digest> {
        let (Some(place), Some(&digest)) = (self.scene.chunk(chunk), self.scene.chunks.get(chunk as usize))
        else {
            bail!("the scene has no chunk {chunk}");
        };
        unpack(data, digest, &mut self.bytes[place])?;
        self.missing.remove(&chunk);
        Ok(digest)
    }
}

fn prepared(digest: Digest, load: Duration, bvh: Duration) -> Prepared {
    Prepared {
        digest,
        load_us: load.as_micros() as u64,
        bvh_us: bvh.as_micros() as u64,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;
    use std::sync::Arc;

    use protocol::bundle::pack;
    use protocol::message::Frame as FrameMessage;

    use super::*;
    use crate::disk_cache::CacheOptions;
    use crate::renderer::{Frame, Scene};

    /// Takes any bytes for a scene but those that say `broken`.
    #[derive(Debug)]
    struct Reads;

    #[derive(Debug)]
    struct Nothing;

    impl Renderer for Reads {
        fn load(&self, bytes: &[u8]) -> anyhow::Result<LoadedScene> {
            if bytes == b"broken" {
                bail!("it is broken");
            }
            Ok(LoadedScene {
                scene: Arc::new(Nothing),
                load: Duration::from_micros(7),
                bvh: Duration::from_micros(8),
            })
        }
    }

    impl Scene for Nothing {
        fn set_up(&self, _: &FrameMessage) -> anyhow::Result<Arc<dyn Frame>> {
            bail!("not here")
        }
    }

    fn chunk(scene: &SceneRef, bytes: &[u8], chunk: u32) -> SceneChunk {
        SceneChunk {
            digest: scene.digest,
            chunk,
            data: pack(&bytes[scene.chunk(chunk).unwrap()]).into(),
        }
    }

    /// Lets a scene come and builds it.
    fn bring(cache: &mut SceneCache, bytes: &[u8]) -> anyhow::Result<Prepared> {
        let scene = SceneRef::of(bytes);
        if let Found::Missing(missing) = cache.find(&scene)? {
            for index in missing {
                cache.take(&chunk(&scene, bytes, index))?;
            }
        }
        cache.build(&Reads)
    }

    fn on_disk(folder: &Path, limit_bytes: u64) -> SceneCache {
        let folder = folder.to_owned();
        SceneCache::new(Some(
            DiskCache::open(CacheOptions { folder, limit_bytes }).unwrap(),
        ))
    }

    /// A scene of two chunks and a bit, each of them different.
    fn large() -> Vec<u8> {
        (0..2 * limits::SCENE_CHUNK_BYTES + 7)
            .map(|place| (place / 1000) as u8)
            .collect()
    }

    #[test]
    fn scenes_stay_in_memory_one_beside_the_other() {
        let mut cache = SceneCache::default();
        assert_eq!(bring(&mut cache, b"red").unwrap().load_us, 7);
        bring(&mut cache, b"green").unwrap();
        for scene in [b"red".as_slice(), b"green"] {
            let found = cache.find(&SceneRef::of(scene)).unwrap();
            assert!(
                matches!(found, Found::Ready(Prepared { load_us: 0, .. })),
                "{found:?}"
            );
        }
    }

    #[test]
    fn large_scenes_push_out_the_oldest() {
        let mut cache = SceneCache::default();
        let scenes = [1, 2, 3].map(|byte| vec![byte; WARM_BYTES as usize / 2]);
        for scene in &scenes {
            bring(&mut cache, scene).unwrap();
        }
        let warm: Vec<Digest> = cache.warm.iter().map(|warm| warm.digest).collect();
        assert_eq!(
            warm,
            [&scenes[1], &scenes[2]].map(|scene| SceneRef::of(scene).digest)
        );
    }

    #[test]
    fn a_scene_that_cannot_be_used_says_why_and_is_not_kept() {
        let mut cache = SceneCache::default();
        let error = bring(&mut cache, b"broken").unwrap_err();
        assert!(format!("{error:#}").contains("it is broken"), "{error:#}");
        assert!(cache.scene().is_none());
    }

    #[test]
    fn a_scene_under_the_name_of_another_is_refused() {
        let mut scene = SceneRef::of(b"red");
        scene.digest = SceneRef::of(b"green").digest;
        let error = SceneCache::default().find(&scene).unwrap_err().to_string();
        assert!(error.contains("the list of its chunks"), "{error}");
    }

    #[test]
    fn only_chunks_that_are_missing_are_asked_for_after_a_broken_connection() {
        let (bytes, mut cache) = (large(), SceneCache::default());
        let scene = SceneRef::of(&bytes);
        assert_eq!(cache.find(&scene).unwrap(), Found::Missing(vec![0, 1, 2]));
        cache.take(&chunk(&scene, &bytes, 1)).unwrap();
        assert_eq!(cache.find(&scene).unwrap(), Found::Missing(vec![0, 2]));
        assert!(cache.build(&Reads).is_err());
    }

    #[test]
    fn a_worker_that_starts_again_finds_on_disk_what_came_before() {
        let (bytes, folder) = (large(), tempfile::tempdir().unwrap());
        let scene = SceneRef::of(&bytes);
        let mut cache = on_disk(folder.path(), 1 << 20);
        cache.find(&scene).unwrap();
        cache.take(&chunk(&scene, &bytes, 2)).unwrap();

        let mut cache = on_disk(folder.path(), 1 << 20);
        assert_eq!(cache.find(&scene).unwrap(), Found::Missing(vec![0, 1]));
        bring(&mut cache, &bytes).unwrap();
        let mut cache = on_disk(folder.path(), 1 << 20);
        assert_eq!(cache.find(&scene).unwrap(), Found::Missing(Vec::new()));
        assert_eq!(cache.build(&Reads).unwrap().load_us, 7);
    }

    #[test]
    fn a_chunk_that_the_disk_has_spoiled_comes_again() {
        let (bytes, folder) = (large(), tempfile::tempdir().unwrap());
        let scene = SceneRef::of(&bytes);
        bring(&mut on_disk(folder.path(), 1 << 20), &bytes).unwrap();
        let file = folder.path().join(scene.chunks[1].to_string());
        let mut data = fs::read(&file).unwrap();
        let last = data.len() - 1;
        data[last] ^= 1;
        fs::write(&file, data).unwrap();

        let mut cache = on_disk(folder.path(), 1 << 20);
        assert_eq!(cache.find(&scene).unwrap(), Found::Missing(vec![1]));
        assert!(!file.exists());
        bring(&mut cache, &bytes).unwrap();
        assert!(file.exists());
    }

    #[test]
    fn a_scene_that_is_larger_than_the_disk_may_hold_comes_without_it() {
        let (bytes, folder) = (large(), tempfile::tempdir().unwrap());
        bring(&mut on_disk(folder.path(), 1000), &bytes).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn wrong_chunks_are_refused_and_not_kept() {
        let (bytes, folder) = (large(), tempfile::tempdir().unwrap());
        let scene = SceneRef::of(&bytes);
        let mut cache = on_disk(folder.path(), 1 << 20);
        cache.find(&scene).unwrap();
        for wrong in [chunk(&scene, &bytes, 0), chunk(&scene, &bytes, 2)] {
            let wrong = SceneChunk { chunk: 1, ..wrong };
            assert!(cache.take(&wrong).is_err());
        }
        let beyond = SceneChunk {
            chunk: 3,
            ..chunk(&scene, &bytes, 0)
        };
        assert!(cache.take(&beyond).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
