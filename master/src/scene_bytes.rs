//! The scene as workers get it: bytes, known by their digest, given out part by part.
//!
//! A worker asks for each part when it has the one before. So never more than one part waits in front of
//! a worker's other messages, and a slow network delays nobody else.

use std::sync::Arc;

use protocol::{
    limits,
    message::{ScenePart, SceneRef, Want, digest_text},
};
use render::scene::{Scene, geometry};

/// What workers need of a scene; clones share the bytes.
#[derive(Debug, Clone)]
pub struct SceneBytes {
    digest: String,
    bytes: Arc<[u8]>,
}

impl SceneBytes {
    /// Encodes a scene.
    pub fn new(scene: &Scene) -> Self {
        Self::of(geometry::to_bytes(scene))
    }

    fn of(bytes: Vec<u8>) -> Self {
        Self {
            digest: digest_text(blake3::hash(&bytes).as_bytes()),
            bytes: bytes.into(),
        }
    }

    /// What workers are told at first.
    pub fn reference(&self) -> SceneRef {
        SceneRef {
            digest: self.digest.clone(),
            bytes: self.bytes.len() as u64,
        }
    }

    /// The digest of the bytes, as text.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// The part that a worker wants; `None` if there is no such part.
    pub fn part(&self, want: &Want) -> Option<ScenePart> {
        if want.digest != self.digest {
            return None;
        }
        let from = usize::try_from(want.from).ok()?;
        let rest = self.bytes.get(from..).filter(|rest| !rest.is_empty())?;
        let data = &rest[..rest.len().min(limits::SCENE_PART_BYTES)];
        Some(ScenePart {
            digest: want.digest.clone(),
            from: want.from,
            data: data.to_vec().into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_follow_each_other_to_the_end_and_no_further() {
        let whole: Vec<u8> = (0..limits::SCENE_PART_BYTES + 7).map(|i| i as u8).collect();
        let scene = SceneBytes::of(whole.clone());
        let mut got: Vec<u8> = Vec::new();
        while got.len() < whole.len() {
            let want = Want {
                digest: scene.digest().to_owned(),
                from: got.len() as u64,
            };
            got.extend(scene.part(&want).unwrap().data.iter());
        }
        assert_eq!(got, whole);
        for (digest, from) in [
            (scene.digest(), whole.len() as u64),
            (scene.digest(), u64::MAX),
            ("other", 0),
        ] {
            let digest = digest.to_owned();
            assert_eq!(scene.part(&Want { digest, from }), None);
        }
    }
}
