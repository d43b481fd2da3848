//! The picture of the probabilities in the paper's colours (section 7).

use crate::color::{displayable, linear_to_srgb, luminance};
use crate::image::ImageRgb;
use crate::plane::Plane;

/// Below this probability a difference counts as not perceivable.
const PERCEIVABLE: f32 = 0.25;

/// Colours the probability of seeing a difference; `[height][width]` of 8-bit sRGB.
///
/// Grey: none is perceivable; green to yellow: low to middling probability; red: high. The
/// reference's brightness shines through, so that one sees where in the picture one is.
#[must_use]
pub fn picture(probability: &Plane, reference: &ImageRgb, gain: f64) -> Vec<[u8; 3]> {
    let light = reference.linear();
    let pixels = probability.data.iter().zip(&light.data);
    pixels
        .map(|(&p, &rgb)| color(p, context(rgb, gain)).map(to_code))
        .collect()
}

/// Brightness 0.3..1 of a colour over a reference pixel of linear light.
fn context(rgb: [f32; 3], gain: f64) -> f32 {
    let shown = rgb.map(|value| displayable(f64::from(value) * gain) as f32);
    (0.30 + 0.70 * linear_to_srgb(luminance(shown))) as f32
}

fn color(p: f32, context: f32) -> [f32; 3] {
    let t = (p - PERCEIVABLE) / 0.5;
    let color = if p < PERCEIVABLE {
        [0.75; 3]
    } else if p < super::VISIBLE {
        [(2.0 * t).min(1.0), 0.9 * (2.0 - 2.0 * t).min(1.0), 0.0]
    } else {
        [1.0, 0.0, 0.0]
    };
    color.map(|value| value * context)
}

fn to_code(value: f32) -> u8 {
    (value * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Encoding;

    #[test]
    fn colours_are_grey_then_green_through_yellow_then_red() {
        for (p, expected) in [
            (0.0, [0.75, 0.75, 0.75]),
            (0.25, [0.0, 0.9, 0.0]),
            (0.5, [1.0, 0.9, 0.0]),
            (0.625, [1.0, 0.45, 0.0]),
            (0.75, [1.0, 0.0, 0.0]),
            (1.0, [1.0, 0.0, 0.0]),
        ] {
            for (value, expected) in color(p, 1.0).into_iter().zip(expected) {
                assert!((value - expected).abs() < 1e-6, "P = {p}");
            }
        }
    }

    #[test]
    fn the_reference_shines_through() {
        let data = vec![[0.0; 3], [0.5; 3], [f32::NAN; 3]];
        let reference = ImageRgb {
            width: 3,
            height: 1,
            data,
            encoding: Encoding::Linear,
        };
        let probability = Plane {
            width: 3,
            height: 1,
            data: vec![1.0, 0.0, 0.0],
        };
        let picture = picture(&probability, &reference, 2.0);
        assert_eq!(picture, [[77, 0, 0], [191, 191, 191], [57, 57, 57]]);
    }
}
