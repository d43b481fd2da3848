//! The scene as workers get it: chunks, each asked for by itself, packed when one is first sent.
//!
//! A worker asks for a chunk when it has taken one before. So no more than two ever wait in front of a
//! worker, its other messages overtake them, and a slow network delays nobody else. All workers share the
//! bytes of a packed chunk.

use std::sync::{Arc, OnceLock};

use protocol::{
    Digest, ToWorker,
    bundle::pack,
    envelope::{EncodeError, Sealed},
    message::{SceneChunk, SceneRef, Want},
};
use render::scene::{Scene, geometry};

/// What workers need of a scene; clones share the bytes.
#[derive(Debug, Clone)]
pub struct SceneBytes {
    scene: Arc<SceneRef>,
    bytes: Arc<[u8]>,
    packed: Arc<[OnceLock<Sealed>]>,
}

impl SceneBytes {
    /// Encodes a scene.
    pub fn new(scene: &Scene) -> Self {
        Self::of(geometry::to_bytes(scene))
    }

    fn of(bytes: Vec<u8>) -> Self {
        let scene = SceneRef::of(&bytes);
        Self {
            packed: scene.chunks.iter().map(|_| OnceLock::new()).collect(),
            scene: Arc::new(scene),
            bytes: bytes.into(),
        }
    }

    /// What workers are told at first.
    pub fn reference(&self) -> &SceneRef {
        &self.scene
    }

    /// By which the scene is known.
    pub fn digest(&self) -> Digest {
        self.scene.digest
    }

    /// The chunk that a worker wants; `None` if there is no such chunk. On one machine, packing would only
    /// take time.
    pub fn chunk(&self, want: Want, is_local: bool) -> Result<Option<Sealed>, EncodeError> {
        let place = self.scene.chunk(want.chunk);
        let (Some(place), true) = (place, want.digest == self.scene.digest) else {
            return Ok(None);
        };
        let bytes = &self.bytes[place];
        if is_local {
            return seal(want, bytes.to_vec()).map(Some);
        }
        let packed = &self.packed[want.chunk as usize];
        if packed.get().is_none() {
            // Only one thread sends, so nobody was faster.
            let _ = packed.set(seal(want, pack(bytes))?);
        }
        Ok(packed.get().cloned())
    }
}

fn seal(want: Want, data: Vec<u8>) -> Result<Sealed, EncodeError> {
    let Want { digest, chunk } = want;
    let data = data.into();
    Sealed::new(&ToWorker::SceneChunk(SceneChunk { digest, chunk, data }))
}

#[cfg(test)]
mod tests {
    use protocol::{
        bundle::unpack,
        envelope::{Decoded, Decoder},
        limits::SCENE_CHUNK_BYTES,
    };

    use super::*;

    fn data(sealed: &Sealed) -> Vec<u8> {
        let mut decoder = Decoder::new();
        decoder.handshake_done();
        decoder.push(sealed.bytes());
        match decoder.decode() {
            Ok(Decoded::Message(ToWorker::SceneChunk(chunk))) => chunk.data.into_vec(),
            other => panic!("not a chunk: {other:?}"),
        }
    }

    fn want(scene: &SceneBytes, chunk: u32) -> Want {
        let digest = scene.digest();
        Want { digest, chunk }
    }

    #[test]
    fn every_chunk_can_be_had_packed_or_as_it_is_and_no_other() {
        let whole: Vec<u8> = (0..SCENE_CHUNK_BYTES + 7).map(|i| (i / 50) as u8).collect();
        let scene = SceneBytes::of(whole.clone());
        let mut back = vec![0; whole.len()];
        for chunk in [0, 1] {
            let place = scene.reference().chunk(chunk).unwrap();
            let local = scene.chunk(want(&scene, chunk), true).unwrap().unwrap();
            assert_eq!(data(&local), whole[place.clone()]);
            let packed = scene.chunk(want(&scene, chunk), false).unwrap().unwrap();
            let digest = scene.reference().chunks[chunk as usize];
            unpack(&data(&packed), digest, &mut back[place]).unwrap();
        }
        assert_eq!(back, whole);
        let other = Want {
            digest: Digest::of(b"other"),
            chunk: 0,
        };
        for beyond in [want(&scene, 2), want(&scene, u32::MAX), other] {
            assert!(scene.chunk(beyond, false).unwrap().is_none());
        }
    }

    #[test]
    fn a_chunk_is_packed_once_for_all_workers() {
        let scene = SceneBytes::of(vec![3; 1000]);
        let [one, other] = [0, 0].map(|chunk| scene.chunk(want(&scene, chunk), false).unwrap().unwrap());
        assert!(std::ptr::eq(one.bytes(), other.bytes()));
    }
}
