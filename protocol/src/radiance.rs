//! Pixels on the wire: f32 values as one byte string, copied once each way.

use std::borrow::Cow;
use std::fmt;

use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Radiance values, pixel after pixel; little-endian f32 in a `MessagePack` `bin`.
#[derive(Clone, Default, PartialEq)]
pub struct Radiance(pub Vec<f32>);

/// Bytes of one value.
const VALUE_BYTES: usize = size_of::<f32>();

impl Radiance {
    /// Bytes of the values on the wire.
    pub fn bytes(&self) -> usize {
        self.0.len() * VALUE_BYTES
    }
}

impl fmt::Debug for Radiance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Radiance({} values)", self.0.len())
    }
}

impl Serialize for Radiance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let bytes: Cow<'_, [u8]> = if cfg!(target_endian = "little") {
            Cow::Borrowed(bytemuck::cast_slice(&self.0))
        } else {
            self.0.iter().flat_map(|value| value.to_le_bytes()).collect()
        };
        serializer.serialize_bytes(&bytes)
    }
}

impl<'de> Deserialize<'de> for Radiance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_bytes(RadianceVisitor)
    }
}

struct RadianceVisitor;

impl Visitor<'_> for RadianceVisitor {
    type Value = Radiance;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("little-endian f32 values in a byte string")
    }

    fn visit_bytes<E: de::Error>(self, bytes: &[u8]) -> Result<Radiance, E> {
        let (values, rest) = bytes.as_chunks::<VALUE_BYTES>();
        if !rest.is_empty() {
            return Err(E::invalid_length(bytes.len(), &self));
        }
        Ok(Radiance(
            values.iter().map(|&value| f32::from_le_bytes(value)).collect(),
        ))
    }
}
