//! Pictures for a page: made smaller, cut out, and encoded.

use anyhow::Context;
use image::{
    RgbImage,
    codecs::jpeg::JpegEncoder,
    imageops::{self, FilterType},
};

use super::experiment::Shown;

/// High enough that no block is seen beside the noise that the figures are about.
const JPEG_QUALITY: u8 = 88;

/// A part of a picture, in shares of its sides.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width and height.
    pub side: f64,
}

/// The whole picture as a JPEG at most `width` pixels wide.
///
/// # Errors
/// If a picture has no pixels.
pub fn whole(shown: &Shown, width: u32) -> anyhow::Result<Vec<u8>> {
    let image = to_image(shown)?;
    let width = width.min(image.width());
    let height = (f64::from(image.height()) * f64::from(width) / f64::from(image.width())).round() as u32;
    jpeg(&imageops::resize(
        &image,
        width,
        height.max(1),
        FilterType::Lanczos3,
    ))
}

/// A part of the picture as a JPEG `width` pixels wide, each pixel a sharp square.
///
/// # Errors
/// If a picture has no pixels.
pub fn part(shown: &Shown, part: Part, width: u32) -> anyhow::Result<Vec<u8>> {
    let image = to_image(shown)?;
    let length = |share: f64, side: u32| (share * f64::from(side)).round() as u32;
    let (across, down) = (
        length(part.side, image.width()),
        length(part.side, image.height()),
    );
    let (x, y) = (length(part.x, image.width()), length(part.y, image.height()));
    let cut = imageops::crop_imm(&image, x, y, across.max(1), down.max(1)).to_image();
    let height = f64::from(width) * f64::from(cut.height()) / f64::from(cut.width());
    jpeg(&imageops::resize(
        &cut,
        width,
        height.round() as u32,
        FilterType::Nearest,
    ))
}

fn to_image(shown: &Shown) -> anyhow::Result<RgbImage> {
    RgbImage::from_raw(shown.width, shown.height, shown.codes.as_flattened().to_vec())
        .context("a picture has fewer pixels than its size says")
}

fn jpeg(image: &RgbImage) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).encode_image(image)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown() -> Shown {
        let codes = (0..64 * 48).map(|pixel| [if pixel % 64 < 32 { 255 } else { 0 }; 3]);
        Shown {
            width: 64,
            height: 48,
            codes: codes.collect(),
        }
    }

    #[test]
    fn figures_have_the_asked_width_and_show_the_asked_part() {
        let decode = |bytes: Vec<u8>| image::load_from_memory(&bytes).unwrap().to_rgb8();
        let small = decode(whole(&shown(), 32).unwrap());
        assert_eq!(small.dimensions(), (32, 24));
        assert_eq!(decode(whole(&shown(), 500).unwrap()).dimensions(), (64, 48));
        let left = Part {
            x: 0.0,
            y: 0.25,
            side: 0.25,
        };
        let cut = decode(part(&shown(), left, 64).unwrap());
        assert_eq!(cut.dimensions(), (64, 48));
        assert!(cut.pixels().all(|pixel| pixel.0[0] > 250));
    }
}
