//! Scenes on their way: cut into chunks, each packed by itself and known by its digest. No I/O.
//!
//! What the bytes mean is not known here. A [`SceneRef`] names every chunk by its digest and is itself
//! known by the digest of that list, so whatever a chunk came by, network or disk, it is verified when it
//! is unpacked, before the next one is asked for.

use std::ops::Range;

use thiserror::Error;

use crate::digest::Digest;
use crate::limits::SCENE_CHUNK_BYTES;
use crate::message::SceneRef;

/// Zstandard's level. Levels above save a twentieth more of a scene, for four times the time.
const LEVEL: i32 = 3;

/// Why a scene or a chunk of it was refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BundleError {
    /// The list is not the one that the scene is known by.
    #[error("the scene is said to be {said}, but the list of its chunks has the digest {found}")]
    Scene {
        /// What the list was called.
        said: Digest,
        /// Its own digest.
        found: Digest,
    },
    /// More bytes than the chunk could ever need.
    #[error("a chunk of {chunk_bytes} bytes came as {bytes} bytes")]
    TooLong {
        /// What came.
        bytes: usize,
        /// What it should unpack to.
        chunk_bytes: usize,
    },
    /// Not Zstandard, or more of it than the chunk has room for.
    #[error("a chunk cannot be unpacked to its {chunk_bytes} bytes: {reason}")]
    Packing {
        /// What it should unpack to.
        chunk_bytes: usize,
        /// What Zstandard says.
        reason: String,
    },
    /// Other bytes than those asked for.
    #[error("a chunk did not arrive as it was sent: its digest is {found}, not {expected}")]
    Chunk {
        /// Of what came.
        found: Digest,
        /// Of what was asked for.
        expected: Digest,
    },
}

impl SceneRef {
    /// Names a scene, which has at least one byte.
    pub fn of(bytes: &[u8]) -> Self {
        let chunks: Vec<Digest> = bytes.chunks(SCENE_CHUNK_BYTES).map(Digest::of).collect();
        Self {
            digest: digest_of_list(bytes.len() as u64, &chunks),
            bytes: bytes.len() as u64,
            chunks,
        }
    }

    /// Whether the list of chunks is the one that the scene is known by.
    pub fn verify(&self) -> Result<(), BundleError> {
        let (said, found) = (self.digest, digest_of_list(self.bytes, &self.chunks));
        if said == found {
            Ok(())
        } else {
            Err(BundleError::Scene { said, found })
        }
    }

    /// Where a chunk's bytes are in the scene; `None` if it has no such chunk.
    pub fn chunk(&self, chunk: u32) -> Option<Range<usize>> {
        let begin = chunk as usize * SCENE_CHUNK_BYTES;
        let end = (begin + SCENE_CHUNK_BYTES).min(self.bytes as usize);
        (begin < end).then_some(begin..end)
    }
}

fn digest_of_list(bytes: u64, chunks: &[Digest]) -> Digest {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes.to_le_bytes());
    for chunk in chunks {
        hasher.update(&chunk.0);
    }
    Digest(*hasher.finalize().as_bytes())
}

/// A chunk as it travels and as it is kept on disk: packed if that makes it shorter, else as it is.
pub fn pack(chunk: &[u8]) -> Vec<u8> {
    match zstd::bulk::compress(chunk, LEVEL) {
        Ok(packed) if packed.len() < chunk.len() => packed,
        _ => chunk.to_vec(),
    }
}

/// Undoes [`pack`], into exactly the room that the chunk has in its scene: no data, whatever they claim to
/// unpack to, take more memory. What is in `room` afterwards is of use only if this succeeds.
pub fn unpack(data: &[u8], expected: Digest, room: &mut [u8]) -> Result<(), BundleError> {
    let (bytes, chunk_bytes) = (data.len(), room.len());
    if bytes > chunk_bytes {
        return Err(BundleError::TooLong { bytes, chunk_bytes });
    }
    if bytes == chunk_bytes {
        room.copy_from_slice(data);
    } else {
        let unpacked = zstd::bulk::Decompressor::new()
            .and_then(|mut decompressor| decompressor.decompress_to_buffer(data, room));
        let reason = match unpacked {
            Ok(length) if length == chunk_bytes => None,
            Ok(length) => Some(format!("it has {length}")),
            Err(error) => Some(error.to_string()),
        };
        if let Some(reason) = reason {
            return Err(BundleError::Packing { chunk_bytes, reason });
        }
    }
    let found = Digest::of(room);
    if found == expected {
        Ok(())
    } else {
        Err(BundleError::Chunk { found, expected })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn scene() -> Vec<u8> {
        (0..2 * SCENE_CHUNK_BYTES + 7)
            .map(|place| (place / 9) as u8)
            .collect()
    }

    #[test]
    fn a_scene_comes_back_chunk_by_chunk_in_any_order() {
        let bytes = scene();
        let scene = SceneRef::of(&bytes);
        assert_eq!((scene.verify(), scene.chunks.len()), (Ok(()), 3));
        let mut back = vec![0; bytes.len()];
        for chunk in [2, 0, 1] {
            let place = scene.chunk(chunk).unwrap();
            let packed = pack(&bytes[place.clone()]);
            unpack(&packed, scene.chunks[chunk as usize], &mut back[place]).unwrap();
        }
        assert_eq!(back, bytes);
        assert_eq!(scene.chunk(3), None);
    }

    #[test]
    fn what_becomes_shorter_is_packed_and_what_does_not_travels_as_it_is() {
        assert!(pack(&scene()[..SCENE_CHUNK_BYTES]).len() < SCENE_CHUNK_BYTES / 10);
        let noise: Vec<u8> = (0u32..50)
            .flat_map(|place| Digest::of(&place.to_le_bytes()).0)
            .collect();
        assert_eq!(pack(&noise), noise);
    }

    #[test]
    fn a_scene_under_the_name_of_another_is_refused() {
        let mut scene = SceneRef::of(b"red");
        scene.chunks = SceneRef::of(b"rod").chunks;
        assert!(matches!(scene.verify(), Err(BundleError::Scene { .. })));
    }

    /// 1 GB of zeros in 32 kB: unpacked where only a chunk has room.
    #[test]
    fn a_chunk_that_unpacks_to_more_than_it_may_is_refused_without_taking_memory_for_it() {
        let bomb = zstd::bulk::compress(&vec![0; 1 << 30], 1).unwrap();
        assert!(bomb.len() < SCENE_CHUNK_BYTES, "{} bytes", bomb.len());
        let mut room = vec![7; SCENE_CHUNK_BYTES];
        let refused = unpack(&bomb, Digest::of(b""), &mut room);
        assert!(matches!(refused, Err(BundleError::Packing { .. })), "{refused:?}");
    }

    #[test]
    fn wrong_chunks_are_refused() {
        let refused = |data: &[u8]| unpack(data, Digest::of(b"a red wall"), &mut [0; 10]).unwrap_err();
        assert!(matches!(refused(b"a rad wall"), BundleError::Chunk { .. }));
        assert!(matches!(refused(b"a red wall too"), BundleError::TooLong { .. }));
        assert!(matches!(refused(b"a red"), BundleError::Packing { .. }));
        assert!(matches!(refused(b""), BundleError::Packing { .. }));
        let shorter = zstd::bulk::compress(b"", 3).unwrap();
        assert!(matches!(refused(&shorter), BundleError::Packing { .. }));
    }

    proptest! {
        #[test]
        fn any_chunk_comes_back(chunk in prop::collection::vec(0u8..4, 1..2000)) {
            let mut room = vec![0; chunk.len()];
            prop_assert_eq!(unpack(&pack(&chunk), Digest::of(&chunk), &mut room), Ok(()));
            prop_assert_eq!(room, chunk);
        }

        #[test]
        fn no_data_do_harm(data in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = unpack(&data, Digest::of(b"something else"), &mut [0; 150]);
        }
    }
}
