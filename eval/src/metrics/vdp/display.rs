//! What the eye receives and makes of it: display luminance, then contrast (sections 1 and 2).

use crate::color::{displayable, luminance, srgb_to_linear};
use crate::image::{Encoding, ImageRgb};

/// The Michaelis-Menten constants of the amplitude nonlinearity \[D93\].
const C1: f64 = 12.6;
const B: f64 = 0.63;

/// Width of the screen in metres, and in pixels.
const SCREEN_WIDTH: (f64, f64) = (0.375, 1280.0);

/// The display and the place of the observer before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewing {
    /// Luminance of white, cd/m².
    pub peak: f64,
    /// Luminance of black with flare, cd/m².
    pub black: f64,
    /// From the eye to the screen, metres; also sets how the eye accommodates.
    pub distance: f64,
    /// Pixels per degree of visual angle, where they do not follow from the distance.
    pub pixels_per_degree: Option<f64>,
}

impl Default for Viewing {
    fn default() -> Self {
        Self {
            peak: 100.0,
            black: 0.8,
            distance: 0.5,
            pixels_per_degree: None,
        }
    }
}

impl Viewing {
    /// Pixels per degree: as set, or of a 37.5 cm wide screen of 1280 pixels at the distance.
    #[must_use]
    pub fn pixels_per_degree(&self) -> f64 {
        let (metres, pixels) = SCREEN_WIDTH;
        let from_distance = || 2.0 * 0.5_f64.to_radians().tan() * self.distance * pixels / metres;
        self.pixels_per_degree.unwrap_or_else(from_distance)
    }

    /// Luminance in cd/m² of each pixel of an image whose linear light is multiplied by `gain`.
    pub(super) fn luminances(&self, image: &ImageRgb, gain: f64) -> Vec<f64> {
        let decode: fn(f64) -> f64 = match image.encoding {
            Encoding::Linear => |light| light,
            Encoding::Encoded => srgb_to_linear,
        };
        let shown = |value: f32| displayable(decode(f64::from(value)) * gain) as f32;
        let luminance = |rgb: &[f32; 3]| self.luminance(rgb.map(shown));
        image.data.iter().map(luminance).collect()
    }

    /// Luminance in cd/m² of one pixel of linear RGB within 0..1.
    fn luminance(&self, rgb: [f32; 3]) -> f64 {
        self.black + (self.peak - self.black) * luminance(rgb)
    }
}

/// The eye's response R to a luminance.
fn response(luminance: f64) -> f64 {
    luminance / (luminance + (C1 * luminance).powf(B))
}

/// Contrast C of luminances for an eye adapted to one of them.
///
/// The divisor is dR/d ln L at the adaptation luminance, so that a weak modulation about it keeps
/// its physical contrast.
pub(super) fn contrast(adaptation: f64) -> impl Fn(f64) -> f64 {
    let adapted = response(adaptation);
    let divisor = (1.0 - B) * adapted * (1.0 - adapted);
    move |luminance| (response(luminance) - adapted) / divisor
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(value: f64, expected: f64) {
        assert!(
            (value / expected - 1.0).abs() < 3e-6,
            "{value} instead of {expected}"
        );
    }

    #[test]
    fn luminance_response_and_contrast_have_the_values_of_section_9() {
        check(Viewing::default().luminance([0.5, 0.25, 0.1]), 29.7981);
        check(response(1.0), 0.168_509);
        check(response(20.0), 0.380_410);
        check(response(80.0), 0.506_280);
        check(contrast(25.0)(20.0), -0.221_193);
        check(contrast(25.0)(30.0), 0.183_489);
    }

    #[test]
    fn the_default_screen_has_29_788_pixels_per_degree() {
        assert!((Viewing::default().pixels_per_degree() - 29.788).abs() < 5e-4);
        let nearer = Viewing {
            distance: 0.25,
            ..Viewing::default()
        };
        assert!((nearer.pixels_per_degree() - 14.894).abs() < 5e-4);
    }

    #[test]
    fn the_display_clips_light_and_shows_nan_as_black() {
        let data = vec![[f32::NAN; 3], [-2.0; 3], [9.0; 3], [f32::INFINITY; 3]];
        let image = ImageRgb {
            width: 4,
            height: 1,
            data,
            encoding: Encoding::Linear,
        };
        let shown = Viewing::default().luminances(&image, 1.0);
        for (luminance, expected) in shown.into_iter().zip([0.8, 0.8, 100.0, 100.0]) {
            check(luminance, expected);
        }
    }

    #[test]
    fn codes_are_decoded_before_they_are_shown() {
        let data = vec![[128.0 / 255.0; 3]];
        let image = ImageRgb {
            width: 1,
            height: 1,
            data,
            encoding: Encoding::Encoded,
        };
        check(
            Viewing::default().luminances(&image, 1.0)[0],
            0.8 + 99.2 * 0.215_861,
        );
    }
}
