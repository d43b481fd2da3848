//! Portable float map: a line `PF` (colour) or `Pf` (grey), sizes, a scale, floats from the bottom
//! row up. The scale's sign tells the order of bytes; its size is not used.

use super::{Fault, check_size};
use crate::image::{Encoding, ImageRgb};

pub(super) const NAME: &str = "PFM";

pub(super) fn decode(bytes: &[u8]) -> Result<ImageRgb, Fault> {
    let header = Header::parse(bytes).ok_or_else(|| {
        Fault::damaged("its header is not PF or Pf, width, height and a scale other than 0")
    })?;
    let Header {
        width,
        height,
        channels,
        little_endian,
        length,
    } = header;
    check_size(width, height)?;
    let floats = &bytes[length..];
    let wanted = width * height * channels * 4;
    if floats.len() != wanted {
        let reason = format!("{} bytes of pixels instead of {wanted}", floats.len());
        return Err(Fault::Damaged(reason));
    }

    let value = |bytes: &[u8; 4]| {
        if little_endian {
            f32::from_le_bytes(*bytes)
        } else {
            f32::from_be_bytes(*bytes)
        }
    };
    let pixel = |floats: &[[u8; 4]]| match floats {
        [r, g, b] => [value(r), value(g), value(b)],
        [grey, ..] => [value(grey); 3],
        [] => [0.0; 3],
    };
    let (floats, _) = floats.as_chunks::<4>();
    let rows = floats.chunks_exact(width * channels).rev();
    let data = rows
        .flat_map(|row| row.chunks_exact(channels))
        .map(pixel)
        .collect();
    Ok(ImageRgb {
        width,
        height,
        data,
        encoding: Encoding::Linear,
    })
}

struct Header {
    width: usize,
    height: usize,
    channels: usize,
    little_endian: bool,
    /// Bytes, with the one white space after the scale.
    length: usize,
}

impl Header {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let mut length = 0;
        let mut word = || {
            let rest = &bytes[length..];
            let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
            let end = start + rest[start..].iter().position(u8::is_ascii_whitespace)?;
            length += end + 1;
            std::str::from_utf8(&rest[start..end]).ok()
        };
        let channels = if word()? == "PF" { 3 } else { 1 };
        let (width, height) = (word()?.parse().ok()?, word()?.parse().ok()?);
        let scale: f64 = word()?.parse().ok()?;
        let little_endian = scale < 0.0;
        (scale.abs() > 0.0).then_some(Self {
            width,
            height,
            channels,
            little_endian,
            length,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, floats: &[f32], to_bytes: fn(f32) -> [u8; 4]) -> Vec<u8> {
        let floats = floats.iter().flat_map(|&value| to_bytes(value));
        header.bytes().chain(floats).collect()
    }

    #[test]
    fn rows_come_from_the_bottom_up() {
        let bytes = file(
            "PF\n1 2\n-1.0\n",
            &[4.0, 5.0, 6.0, 1.0, 2.0, 3.0],
            f32::to_le_bytes,
        );
        let image = decode(&bytes).ok().expect("a good file");
        assert_eq!(image.data, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(
            (image.width, image.height, image.encoding),
            (1, 2, Encoding::Linear)
        );
    }

    #[test]
    fn a_positive_scale_means_big_endian_and_one_channel_grey() {
        let bytes = file("Pf 2 1 1 ", &[0.25, 8.0], f32::to_be_bytes);
        assert_eq!(
            decode(&bytes).ok().expect("a good file").data,
            [[0.25; 3], [8.0; 3]]
        );
    }

    #[test]
    fn wrong_headers_and_lengths_are_refused() {
        for header in [
            "PF\n",
            "PF\n1 x\n-1\n",
            "PF\n1 1\n0\n",
            "PF\n-1 1\n-1\n",
            "PF\n2 1\n-1\n",
        ] {
            assert!(
                decode(&file(header, &[1.0; 3], f32::to_le_bytes)).is_err(),
                "{header:?}"
            );
        }
        let huge = file("PF\n1000000 1000000\n-1\n", &[], f32::to_le_bytes);
        assert!(matches!(
            decode(&huge),
            Err(Fault::TooLarge(1_000_000, 1_000_000))
        ));
    }
}
