//! A BLAKE3 digest, by which bytes are known wherever they are.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::limits::DIGEST_BYTES;

/// On the wire a byte string of exactly [`DIGEST_BYTES`], for people lower-case hexadecimal. It can
/// name a file, since it can be nothing else.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Digest(#[serde(with = "serde_bytes")] pub [u8; DIGEST_BYTES]);

impl Digest {
    /// That of some bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Digest({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_is_shown_in_hexadecimal() {
        let text = Digest(std::array::from_fn(|place| place as u8 + 0x98)).to_string();
        assert!(text.starts_with("98999a") && text.ends_with("b6b7"), "{text}");
        assert_eq!(text.len(), 2 * DIGEST_BYTES);
    }
}
