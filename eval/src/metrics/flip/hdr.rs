//! HDR-FLIP: the largest LDR-FLIP over a range of exposures of the reference \[A21\].

use rayon::prelude::*;
use serde::Serialize;

use super::ldr;
use crate::color::luminance;
use crate::image::{ImageRgb, Pair};
use crate::plane::Plane;

/// The tone-mapped value that the brightest pixel has at the first exposure, and the median pixel
/// at the last.
const TARGET: f64 = 0.85;

/// Narkowicz's fit to the ACES tone mapper, (`N2` x² + `N1` x) / (`D2` x² + `D1` x + `D0`), with x
/// scaled by 0.6 to cancel the exposure that is built into it.
const N2: f64 = 2.51 * 0.36;
const N1: f64 = 0.03 * 0.6;
const D2: f64 = 2.43 * 0.36;
const D1: f64 = 0.59 * 0.6;
const D0: f64 = 0.14;

/// The exposures at which pictures are compared: `count` of them, evenly from start to stop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Exposures {
    /// The first exposure in stops: not even the brightest pixel of the reference is white.
    pub start: f64,
    /// The last exposure in stops: half of the pixels are nearly white, or more.
    pub stop: f64,
    /// How many there are, at least 2.
    pub count: usize,
}

impl Exposures {
    /// The published choice: from the maximum and the median luminance of a reference.
    ///
    /// As in the reference evaluator, a median below the smallest step of an f32 near 1 counts as
    /// that step; a reference that is black everywhere gets one exposure twice.
    #[must_use]
    pub fn of(reference: &ImageRgb) -> Self {
        let mut luminances: Vec<f64> = reference.data.iter().map(|&rgb| luminance(rgb)).collect();
        let middle = luminances.len() / 2;
        let (_, &mut median, above) = luminances.select_nth_unstable_by(middle, f64::total_cmp);
        let median = median.max(f32::EPSILON.into());
        let maximum = above.iter().copied().fold(median, f64::max);
        let (start, stop) = ((target() / maximum).log2(), (target() / median).log2());
        Self {
            start,
            stop,
            count: ((stop - start).ceil() as usize).max(2),
        }
    }

    fn stops(self) -> impl IndexedParallelIterator<Item = f64> {
        let step = (self.stop - self.start) / (self.count - 1) as f64;
        (0..self.count)
            .into_par_iter()
            .map(move |index| self.start + step * index as f64)
    }
}

/// The largest LDR-FLIP at each pixel over all exposures.
pub(super) fn largest(pair: &Pair<'_>, exposures: Exposures, pixels_per_degree: f64) -> Plane {
    let (width, height) = (pair.width(), pair.height());
    let at_exposure = |stops: f64| {
        let [reference, image] = [pair.reference(), pair.image()].map(|image| tone_mapped(image, stops));
        ldr::difference(width, &reference, &image, pixels_per_degree)
    };
    // The maximum is the same in any order.
    let larger = |a: Plane, b: Plane| a.zip_map(&b, f32::max);
    exposures
        .stops()
        .map(at_exposure)
        .reduce(|| Plane::zeros(width, height), larger)
}

fn tone_mapped(image: &ImageRgb, stops: f64) -> Vec<[f32; 3]> {
    let gain = stops.exp2();
    image
        .data
        .iter()
        .map(|rgb| rgb.map(|value| tone_map(f64::from(value) * gain) as f32))
        .collect()
}

/// Light to a displayable value; negative light and NaN count as none.
fn tone_map(light: f64) -> f64 {
    // Beyond this, squares would overflow.
    let x = if light > 0.0 { light.min(1e100) } else { 0.0 };
    (x * (N2 * x + N1) / (x * (D2 * x + D1) + D0)).min(1.0)
}

/// The light that is tone mapped to [`TARGET`]: the larger root of a quadratic equation.
fn target() -> f64 {
    let (a, b, c) = (N2 - TARGET * D2, N1 - TARGET * D1, -TARGET * D0);
    ((b * b - 4.0 * a * c).sqrt() - b) / (2.0 * a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Encoding;

    fn check_exposures(light: &[f32], start: f64, stop: f64, count: usize) {
        let data = light.iter().map(|&value| [value; 3]).collect();
        let image = ImageRgb {
            width: light.len(),
            height: 1,
            data,
            encoding: Encoding::Linear,
        };
        let exposures = Exposures::of(&image);
        assert!((exposures.start - start).abs() < 1e-4, "{exposures:?}");
        assert!((exposures.stop - stop).abs() < 1e-4, "{exposures:?}");
        assert_eq!(exposures.count, count);
    }

    #[test]
    fn the_target_is_what_the_tone_mapper_takes_to_85_percent() {
        assert!((tone_map(target()) - TARGET).abs() < 1e-12);
        assert!(target() > 0.0);
    }

    #[test]
    fn the_tone_mapper_takes_any_light_to_a_displayable_value() {
        for (light, expected) in [(-1.0, 0.0), (f64::NAN, 0.0), (1e30, 1.0), (f64::INFINITY, 1.0)] {
            assert!((tone_map(light) - expected).abs() < 1e-9, "{light}");
        }
    }

    /// Start and stop as the reference evaluator 1.7 reports them for such pictures.
    #[test]
    fn exposures_run_from_the_maximum_to_the_median_of_the_reference() {
        check_exposures(&[1.0; 4], 1.083_297, 1.083_297, 2);
        check_exposures(&[1.0, 0.0, 0.0, 0.0], 1.083_297, 24.083_297, 23);
        check_exposures(&[0.25, 1.0, 0.25, 8.0], 1.083_297 - 3.0, 1.083_297, 3);
    }

    #[test]
    fn a_black_reference_has_exposures_too() {
        check_exposures(&[0.0; 4], 24.083_297, 24.083_297, 2);
    }
}
