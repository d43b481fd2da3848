//! PNG: sRGB codes of 8 or 16 bits; embedded colour profiles are not used.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageResult, RgbImage};

use super::{Fault, check_size};
use crate::image::{Encoding, ImageRgb};

pub(super) const NAME: &str = "PNG";

/// Code values divided by the largest code; grey becomes three equal channels.
pub(super) fn decode(bytes: &[u8]) -> Result<ImageRgb, Fault> {
    let decoder = image::codecs::png::PngDecoder::new(Cursor::new(bytes)).map_err(Fault::damaged)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    let picture = DynamicImage::from_decoder(decoder).map_err(Fault::damaged)?;
    let per_channel = picture.color().bits_per_pixel() / u16::from(picture.color().channel_count());
    let data = if per_channel > 8 {
        let codes = picture.into_rgb16();
        codes
            .pixels()
            .map(|pixel| pixel.0.map(|code| f32::from(code) / 65_535.0))
            .collect()
    } else {
        let codes = picture.into_rgb8();
        codes
            .pixels()
            .map(|pixel| pixel.0.map(|code| f32::from(code) / 255.0))
            .collect()
    };
    Ok(ImageRgb {
        width,
        height,
        data,
        encoding: Encoding::Encoded,
    })
}

/// Writes 8-bit sRGB pixels, `[height][width]`, as a PNG file.
pub fn write_png(path: &Path, width: usize, height: usize, pixels: &[[u8; 3]]) -> ImageResult<()> {
    let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
    let bytes = pixels.as_flattened().to_vec();
    let picture = RgbImage::from_raw(side(width), side(height), bytes);
    debug_assert!(
        picture.is_some(),
        "{} pixels for {width} × {height}",
        pixels.len()
    );
    picture
        .unwrap_or_default()
        .save_with_format(path, ImageFormat::Png)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, Luma, Rgba};

    fn bytes(picture: impl Into<DynamicImage>) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        picture
            .into()
            .write_to(&mut bytes, ImageFormat::Png)
            .expect("writing to memory");
        bytes.into_inner()
    }

    fn check(bytes: &[u8], expected: [f32; 3]) {
        let image = decode(bytes).ok().expect("a good file");
        assert_eq!(
            (image.width, image.height, image.encoding),
            (2, 1, Encoding::Encoded)
        );
        assert_eq!(image.data, [expected; 2]);
    }

    #[test]
    fn eight_bit_codes_are_divided_by_255_and_alpha_is_left_aside() {
        let picture = ImageBuffer::from_pixel(2, 1, Rgba([255_u8, 128, 0, 7]));
        check(&bytes(picture), [1.0, 128.0 / 255.0, 0.0]);
    }

    #[test]
    fn sixteen_bit_codes_are_divided_by_65535_and_grey_fills_all_channels() {
        let picture = ImageBuffer::from_pixel(2, 1, Luma([1000_u16]));
        check(&bytes(picture), [1000.0 / 65_535.0; 3]);
    }

    #[test]
    fn damaged_files_are_refused() {
        let bytes = bytes(ImageBuffer::from_pixel(2, 1, Luma([1000_u16])));
        for end in 8..bytes.len() - 12 {
            assert!(decode(&bytes[..end]).is_err(), "only {end} bytes");
        }
    }
}
