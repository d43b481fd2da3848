//! Pixels on the wire: exact, or in half or a third of the bytes with a loss far below the noise.

use std::fmt;

use half::f16;
use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;

/// How light is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// Each value as an f32: the same bits.
    #[default]
    Exact,
    /// Each value as a 16-bit float: within 1/2048 of itself.
    Half,
    /// Three values in 32 bits, with one exponent (RGB9E5): within 1/512 of the largest of the three.
    SharedExponent,
}

/// Radiance values, pixel after pixel, packed.
#[derive(Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Radiance {
    encoding: Encoding,
    /// What the packed values are to be multiplied by: a power of two, so that no scene is too bright.
    scale: f32,
    data: ByteBuf,
}

const EXACT_BYTES: usize = size_of::<f32>();
const HALF_BYTES: usize = size_of::<f16>();
/// Of three values.
const SHARED_BYTES: usize = size_of::<u32>();

/// The largest value is scaled to at least 2 to this and less than twice that, within what both encodings
/// hold.
const LARGEST_EXPONENT: i32 = 14;
/// Of RGB9E5.
const MANTISSA_BITS: i32 = 9;
/// Of RGB9E5.
const EXPONENT_BIAS: i32 = 15;

impl Radiance {
    /// Packs values. Those that are no light, negative or not finite, stay exact, whoever they puzzle;
    /// so do those that do not come in threes.
    pub fn pack(values: &[f32], encoding: Encoding) -> Self {
        let is_light = values.iter().all(|value| value.is_finite() && *value >= 0.0);
        let in_threes = values.len().is_multiple_of(3);
        let encoding = match encoding {
            Encoding::Half if is_light => Encoding::Half,
            Encoding::SharedExponent if is_light && in_threes => Encoding::SharedExponent,
            _ => Encoding::Exact,
        };
        let scale = match encoding {
            Encoding::Exact => 1.0,
            Encoding::Half | Encoding::SharedExponent => scale(values),
        };
        let data: Vec<u8> = match encoding {
            Encoding::Exact => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            Encoding::Half => {
                let halves = values.iter().map(|value| f16::from_f32(value / scale));
                halves.flat_map(f16::to_le_bytes).collect()
            }
            Encoding::SharedExponent => {
                let pixels = values.as_chunks::<3>().0.iter();
                let words = pixels.map(|pixel| to_rgb9e5(pixel.map(|value| value / scale)));
                words.flat_map(u32::to_le_bytes).collect()
            }
        };
        Self {
            encoding,
            scale,
            data: data.into(),
        }
    }

    /// The values.
    pub fn unpack(&self) -> Vec<f32> {
        match self.encoding {
            Encoding::Exact => {
                let values = self.data.as_chunks::<EXACT_BYTES>().0.iter();
                values.map(|&bytes| f32::from_le_bytes(bytes)).collect()
            }
            Encoding::Half => {
                let values = self.data.as_chunks::<HALF_BYTES>().0.iter();
                values
                    .map(|&bytes| f16::from_le_bytes(bytes).to_f32() * self.scale)
                    .collect()
            }
            Encoding::SharedExponent => {
                let words = self.data.as_chunks::<SHARED_BYTES>().0.iter();
                let pixels = words.map(|&bytes| from_rgb9e5(u32::from_le_bytes(bytes)));
                pixels.flatten().map(|value| value * self.scale).collect()
            }
        }
    }

    /// Number of values; `None` if the bytes are no whole number of them.
    pub fn values(&self) -> Option<usize> {
        let (bytes, values) = match self.encoding {
            Encoding::Exact => (EXACT_BYTES, 1),
            Encoding::Half => (HALF_BYTES, 1),
            Encoding::SharedExponent => (SHARED_BYTES, 3),
        };
        let length = self.data.len();
        length.is_multiple_of(bytes).then_some(length / bytes * values)
    }

    /// Bytes of the values on the wire.
    pub fn bytes(&self) -> usize {
        self.data.len()
    }
}

impl fmt::Debug for Radiance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Radiance({:?}, {} bytes)", self.encoding, self.data.len())
    }
}

/// The power of two that brings the largest value to [`LARGEST_EXPONENT`].
fn scale(values: &[f32]) -> f32 {
    let largest = values.iter().copied().fold(0.0, f32::max);
    if largest == 0.0 {
        return 1.0;
    }
    // So far from the ends of f32 that neither the scale nor a quotient is lost.
    power_of_two((exponent(largest) - LARGEST_EXPONENT).clamp(-100, 100))
}

/// The shared exponent's format, as of OpenGL's `EXT_texture_shared_exponent`: three mantissas of nine bits
/// without a hidden one, red lowest, then five bits of exponent. `rgb` are less than 2¹⁵·2.
fn to_rgb9e5(rgb: [f32; 3]) -> u32 {
    let largest = rgb.into_iter().fold(0.0, f32::max);
    let unit_of = |shared| power_of_two(shared - EXPONENT_BIAS - MANTISSA_BITS);
    let mut shared = (exponent(largest) + 1 + EXPONENT_BIAS).max(0);
    if (largest / unit_of(shared)).round() >= power_of_two(MANTISSA_BITS) {
        shared += 1;
    }
    let [red, green, blue] = rgb.map(|value| (value / unit_of(shared)).round() as u32);
    red | green << MANTISSA_BITS | blue << (2 * MANTISSA_BITS) | (shared as u32) << (3 * MANTISSA_BITS)
}

fn from_rgb9e5(word: u32) -> [f32; 3] {
    let shared = (word >> (3 * MANTISSA_BITS)) as i32;
    let unit = power_of_two(shared - EXPONENT_BIAS - MANTISSA_BITS);
    let mask = (1 << MANTISSA_BITS) - 1;
    [0, 1, 2].map(|channel| (word >> (channel * MANTISSA_BITS) & mask) as f32 * unit)
}

/// ⌊log₂ value⌋ of a normal number; −127 for what is smaller.
fn exponent(value: f32) -> i32 {
    (value.to_bits() >> 23 & 0xff) as i32 - 127
}

/// 2 to a power from −126 to 127.
fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn back(values: &[f32], encoding: Encoding) -> Vec<f32> {
        let packed = Radiance::pack(values, encoding);
        assert_eq!(packed.values(), Some(values.len()));
        packed.unpack()
    }

    #[test]
    fn a_pixel_takes_twelve_six_or_four_bytes() {
        let bytes = |encoding| Radiance::pack(&[0.5, 0.25, 2.0], encoding).bytes();
        let encodings = [Encoding::Exact, Encoding::Half, Encoding::SharedExponent];
        assert_eq!(encodings.map(bytes), [12, 6, 4]);
    }

    #[test]
    fn exact_values_keep_their_bits() {
        let values = [0.1, -0.0, f32::MIN_POSITIVE, 1e38, f32::INFINITY, -3.0];
        assert_eq!(
            back(&values, Encoding::Exact).map_bits(),
            values.to_vec().map_bits()
        );
    }

    #[test]
    fn round_values_lose_nothing_however_bright_the_scene() {
        for brightness in [1e-20_f32, 1.0, 1e20].map(|value| power_of_two(exponent(value))) {
            let values = [0.0, 0.25, 0.5, 1.0, 1.0, 1.0].map(|value| value * brightness);
            for encoding in [Encoding::Half, Encoding::SharedExponent] {
                assert_eq!(back(&values, encoding), values, "{brightness} {encoding:?}");
            }
        }
    }

    #[test]
    fn what_is_no_light_comes_as_it_is_so_that_it_is_noticed() {
        for wrong in [f32::NAN, f32::INFINITY, -1.0] {
            for encoding in [Encoding::Half, Encoding::SharedExponent] {
                assert_eq!(
                    back(&[1.0, wrong, 0.3], encoding).map_bits(),
                    vec![1.0, wrong, 0.3].map_bits()
                );
            }
        }
    }

    #[test]
    fn bytes_that_are_no_whole_values_are_none() {
        for (encoding, bytes) in [
            (Encoding::Exact, 7),
            (Encoding::Half, 3),
            (Encoding::SharedExponent, 6),
        ] {
            let data = vec![0; bytes].into();
            let cut = Radiance {
                encoding,
                scale: 1.0,
                data,
            };
            assert_eq!(cut.values(), None, "{encoding:?}");
        }
    }

    /// Of the mean of many pixels: rounding goes both ways.
    #[test]
    fn packing_does_not_change_the_mean() {
        let values: Vec<f32> = (0..30_000u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 1e6)
            .collect();
        let mean = |values: &[f32]| values.iter().copied().map(f64::from).sum::<f64>() / values.len() as f64;
        for encoding in [Encoding::Half, Encoding::SharedExponent] {
            let ratio = mean(&back(&values, encoding)) / mean(&values);
            assert!((ratio - 1.0).abs() < 2e-5, "{encoding:?}: {ratio}");
        }
    }

    trait Bits {
        fn map_bits(&self) -> Vec<u32>;
    }

    impl Bits for Vec<f32> {
        fn map_bits(&self) -> Vec<u32> {
            self.iter().map(|value| value.to_bits()).collect()
        }
    }

    proptest! {
        #[test]
        fn the_loss_is_within_what_the_encoding_states(pixel in prop::array::uniform3(0.0..1e6_f32), largest in 0.0..1e6_f32) {
            let values = [pixel, [largest; 3]].concat();
            let floor = values.iter().copied().fold(0.0, f32::max) * 1e-7;
            let brightest = pixel.into_iter().fold(0.0, f32::max);
            for (value, half) in pixel.iter().zip(back(&values, Encoding::Half)) {
                prop_assert!((value - half).abs() <= value / 2048.0 + floor, "{value} {half}");
            }
            for (value, shared) in pixel.iter().zip(back(&values, Encoding::SharedExponent)) {
                prop_assert!((value - shared).abs() <= brightest / 512.0 + floor, "{value} {shared}");
            }
        }

        #[test]
        fn no_bytes_do_harm(data in prop::collection::vec(any::<u8>(), 0..60), scale: f32) {
            for encoding in [Encoding::Exact, Encoding::Half, Encoding::SharedExponent] {
                let radiance = Radiance { encoding, scale, data: data.clone().into() };
                if let Some(values) = radiance.values() {
                    prop_assert_eq!(radiance.unpack().len(), values);
                }
            }
        }
    }
}
