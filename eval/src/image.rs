//! A picture in memory, and a pair of pictures that can be compared.

use std::borrow::Cow;

use crate::color::{displayable, linear_to_srgb, luminance, srgb_to_linear};
use crate::plane::Plane;

/// The largest half-float: what stands in for infinity where infinities are let through.
const LARGEST_HALF: f32 = 65_504.0;

/// What the numbers of a picture mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Linear light in Rec. 709 primaries, any range (EXR, PFM).
    Linear,
    /// sRGB code values divided by the largest code, 0..1 (PNG).
    Encoded,
}

/// An RGB picture.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageRgb {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[height][width]` RGB values, from the top row down.
    pub data: Vec<[f32; 3]>,
    /// What the values mean.
    pub encoding: Encoding,
}

/// How many values of a picture are not numbers, and where the first such pixel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NonFinite {
    /// Pixels with a NaN in any channel.
    pub nan: usize,
    /// Pixels with an infinity and no NaN.
    pub infinite: usize,
    /// Column and row of the first of all these pixels, counted from 0 at the top left.
    pub first: (usize, usize),
}

impl ImageRgb {
    /// Counts pixels with NaN or infinite values; `None` if there are none.
    #[must_use]
    pub fn non_finite(&self) -> Option<NonFinite> {
        let is_bad = |pixel: &[f32; 3]| pixel.iter().any(|value| !value.is_finite());
        let first = self.data.iter().position(is_bad)?;
        let has_nan = |pixel: &&[f32; 3]| pixel.iter().any(|value| value.is_nan());
        let bad = self.data.iter().filter(|pixel| is_bad(pixel)).count();
        let nan = self.data.iter().filter(has_nan).count();
        let first = (first % self.width, first / self.width);
        Some(NonFinite {
            nan,
            infinite: bad - nan,
            first,
        })
    }

    /// The picture with 0 for NaN and ±65504, the largest half-float, for infinities.
    #[must_use]
    pub fn with_finite_values(mut self) -> Self {
        for value in self.data.iter_mut().flatten() {
            if value.is_nan() {
                *value = 0.0;
            } else if value.is_infinite() {
                *value = LARGEST_HALF.copysign(*value);
            }
        }
        self
    }

    /// The picture as linear light.
    #[must_use]
    pub fn linear(&self) -> Cow<'_, Self> {
        match self.encoding {
            Encoding::Linear => Cow::Borrowed(self),
            Encoding::Encoded => {
                Cow::Owned(self.convert(Encoding::Linear, |code| srgb_to_linear(code.max(0.0))))
            }
        }
    }

    /// The picture as sRGB codes; linear light is exposed by `stops`, then clipped to 0..1.
    #[must_use]
    pub fn encoded(&self, stops: f64) -> Cow<'_, Self> {
        match self.encoding {
            Encoding::Encoded => Cow::Borrowed(self),
            Encoding::Linear => {
                let gain = stops.exp2();
                let encode = |light: f64| linear_to_srgb(displayable(light * gain));
                Cow::Owned(self.convert(Encoding::Encoded, encode))
            }
        }
    }

    /// Luminance of a linear picture, luma of an encoded one.
    #[must_use]
    pub fn luminance(&self) -> Plane {
        Plane {
            width: self.width,
            height: self.height,
            data: self.data.iter().map(|&rgb| luminance(rgb) as f32).collect(),
        }
    }

    fn convert(&self, encoding: Encoding, f: impl Fn(f64) -> f64) -> Self {
        let data = self
            .data
            .iter()
            .map(|rgb| rgb.map(|value| f(f64::from(value)) as f32));
        Self {
            data: data.collect(),
            encoding,
            ..*self
        }
    }
}

/// Why two pictures cannot be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PairError {
    /// The sizes differ.
    #[error(
        "the sizes differ: reference {} × {}, image {} × {} pixels; \
         render both at one size (nothing is resized)",
        reference.0, reference.1, image.0, image.1
    )]
    Sizes {
        /// Width and height of the reference.
        reference: (usize, usize),
        /// Width and height of the image.
        image: (usize, usize),
    },
    /// There are no pixels.
    #[error("the images have no pixels")]
    Empty,
}

/// A reference and an image to judge by it, of one size and one encoding.
#[derive(Debug, Clone)]
pub struct Pair<'a> {
    // Private, because the sizes and encodings must stay equal.
    reference: Cow<'a, ImageRgb>,
    image: Cow<'a, ImageRgb>,
    exposure_stops: f64,
}

impl<'a> Pair<'a> {
    /// Pairs two pictures; linear light is shown to eyes with an exposure of `exposure_stops`.
    ///
    /// If one is linear and the other encoded, the linear one is exposed, clipped and encoded, so
    /// that both are what a display would show.
    pub fn new(reference: &'a ImageRgb, image: &'a ImageRgb, exposure_stops: f64) -> Result<Self, PairError> {
        let (size, image_size) = (size(reference), size(image));
        if size != image_size {
            return Err(PairError::Sizes {
                reference: size,
                image: image_size,
            });
        }
        if size.0 == 0 || size.1 == 0 {
            return Err(PairError::Empty);
        }
        let (reference, image) = if reference.encoding == image.encoding {
            (Cow::Borrowed(reference), Cow::Borrowed(image))
        } else {
            (reference.encoded(exposure_stops), image.encoded(exposure_stops))
        };
        Ok(Self {
            reference,
            image,
            exposure_stops,
        })
    }

    /// The picture that is right.
    #[must_use]
    pub fn reference(&self) -> &ImageRgb {
        &self.reference
    }

    /// The picture to judge.
    #[must_use]
    pub fn image(&self) -> &ImageRgb {
        &self.image
    }

    /// What the values of both pictures mean.
    #[must_use]
    pub fn encoding(&self) -> Encoding {
        self.reference.encoding
    }

    /// Pixels in a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.reference.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.reference.height
    }

    /// The factor on linear light before it is shown: two to the power of the exposure's stops;
    /// 1 for encoded pictures, whose exposure is already chosen.
    #[must_use]
    pub fn gain(&self) -> f64 {
        match self.encoding() {
            Encoding::Linear => self.exposure_stops.exp2(),
            Encoding::Encoded => 1.0,
        }
    }

    /// Both pictures as a display gets them: exposed, clipped to 0..1 and sRGB-encoded.
    #[must_use]
    pub fn encoded(&self) -> Pair<'_> {
        Pair {
            reference: self.reference.encoded(self.exposure_stops),
            image: self.image.encoded(self.exposure_stops),
            exposure_stops: self.exposure_stops,
        }
    }
}

fn size(image: &ImageRgb) -> (usize, usize) {
    assert_eq!(
        image.data.len(),
        image.width * image.height,
        "ImageRgb with a wrong data length"
    );
    (image.width, image.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: usize, data: &[[f32; 3]], encoding: Encoding) -> ImageRgb {
        ImageRgb {
            width,
            height: data.len() / width,
            data: data.to_vec(),
            encoding,
        }
    }

    #[test]
    fn pixels_that_are_not_numbers_are_counted_and_the_first_is_located() {
        let pixels = [[0.0; 3], [1.0; 3], [0.0, f32::INFINITY, 0.0], [f32::NAN; 3]];
        let found = image(2, &pixels, Encoding::Linear).non_finite();
        assert_eq!(
            found,
            Some(NonFinite {
                nan: 1,
                infinite: 1,
                first: (0, 1)
            })
        );
        assert_eq!(image(2, &pixels[..2], Encoding::Linear).non_finite(), None);
    }

    #[test]
    fn nan_becomes_black_and_infinity_the_largest_half() {
        let pixels = [[f32::NAN, f32::NEG_INFINITY, 0.5]];
        let finite = image(1, &pixels, Encoding::Linear).with_finite_values();
        assert_eq!(finite.data, [[0.0, -65_504.0, 0.5]]);
    }

    #[test]
    fn exposure_acts_on_light_and_not_on_codes() {
        let linear = image(1, &[[0.25; 3]], Encoding::Linear);
        let exposed = linear.encoded(1.0).data[0][0];
        assert!((f64::from(exposed) - linear_to_srgb(0.5)).abs() < 1e-6);
        let encoded = image(1, &[[0.25; 3]], Encoding::Encoded);
        assert_eq!(*encoded.encoded(1.0), encoded);
    }

    #[test]
    fn a_linear_and_an_encoded_picture_meet_as_codes() {
        let linear = image(1, &[[4.0, 0.25, 0.0]], Encoding::Linear);
        let encoded = linear.encoded(0.0).into_owned();
        let pair = Pair::new(&linear, &encoded, 0.0).expect("sizes are equal");
        assert_eq!(pair.encoding(), Encoding::Encoded);
        assert_eq!(pair.reference(), pair.image());
    }

    #[test]
    fn pictures_of_two_sizes_make_no_pair() {
        let wide = image(2, &[[0.0; 3]; 2], Encoding::Linear);
        let high = image(1, &[[0.0; 3]; 2], Encoding::Linear);
        let error = Pair::new(&wide, &high, 0.0).expect_err("2 × 1 and 1 × 2");
        assert_eq!(
            error,
            PairError::Sizes {
                reference: (2, 1),
                image: (1, 2)
            }
        );
        let empty = ImageRgb {
            width: 0,
            height: 0,
            data: vec![],
            encoding: Encoding::Linear,
        };
        assert_eq!(Pair::new(&empty, &empty, 0.0).err(), Some(PairError::Empty));
    }
}
