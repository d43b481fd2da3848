//! What the eye's optics and nerves blur away: contrast sensitivity as spatial filters.

use std::f64::consts::PI;

use super::color::opponent;
use crate::metrics::convolve::separable;
use crate::plane::Plane;

/// A contrast sensitivity function as a sum of Gaussians a √(π/b) exp(-π² x² / b), x in degrees.
type Gaussians<'a> = &'a [(f64, f64)];

/// Constants (a, b) of \[A20, table 1\].
const ACHROMATIC: Gaussians = &[(1.0, 0.0047)];
const RED_GREEN: Gaussians = &[(1.0, 0.0053)];
const BLUE_YELLOW: Gaussians = &[(34.1, 0.04), (13.5, 0.025)];

/// The largest b; it decides the size of all kernels.
const WIDEST: f64 = 0.04;

/// Achromatic, red-green and blue-yellow planes.
pub(super) type Opponent = [Plane; 3];

/// Splits linear RGB pixels into opponent planes.
pub(super) fn opponent_planes(width: usize, pixels: &[[f32; 3]]) -> Opponent {
    let mut planes = [(); 3].map(|()| Plane::zeros(width, pixels.len() / width));
    for (index, &rgb) in pixels.iter().enumerate() {
        let colors = opponent(rgb);
        planes
            .iter_mut()
            .zip(colors)
            .for_each(|(plane, color)| plane.data[index] = color);
    }
    planes
}

/// Blurs each plane as far as the eye does not resolve it.
pub(super) fn blur(planes: &Opponent, pixels_per_degree: f64) -> Opponent {
    let [achromatic, red_green, blue_yellow] = planes;
    [
        blur_plane(achromatic, ACHROMATIC, pixels_per_degree),
        blur_plane(red_green, RED_GREEN, pixels_per_degree),
        blur_plane(blue_yellow, BLUE_YELLOW, pixels_per_degree),
    ]
}

fn blur_plane(plane: &Plane, gaussians: Gaussians, pixels_per_degree: f64) -> Plane {
    let kernels: Vec<_> = gaussians
        .iter()
        .map(|&(_, b)| kernel(b, pixels_per_degree))
        .collect();
    // The volume of each Gaussian under the square of the kernel, which normalisation took out.
    let volume = |(&(a, b), (_, sum)): (&(f64, f64), &(Vec<f32>, f64))| a * (PI / b).sqrt() * sum * sum;
    let volumes: Vec<_> = gaussians.iter().zip(&kernels).map(volume).collect();
    let total: f64 = volumes.iter().sum();

    let shares = volumes.into_iter().map(|volume| (volume / total) as f32);
    let blurred = kernels.iter().zip(shares).map(|((kernel, _), share)| {
        let scaled: Vec<_> = kernel.iter().map(|value| value * share).collect();
        separable(plane, &scaled, kernel)
    });
    let sum = blurred.reduce(|sum, plane| sum.zip_map(&plane, |a, b| a + b));
    sum.unwrap_or_else(|| plane.clone())
}

/// exp(-π² x² / b) with sum 1, and the sum before.
fn kernel(b: f64, pixels_per_degree: f64) -> (Vec<f32>, f64) {
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
    let degrees = (-radius..=radius).map(|pixels| f64::from(pixels) / pixels_per_degree);
    let values: Vec<_> = degrees.map(|x| (-PI * PI * x * x / b).exp()).collect();
    let sum: f64 = values.iter().sum();
    (
        values.into_iter().map(|value| (value / sum) as f32).collect(),
        sum,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_picture_stays_as_it_is() {
        let planes = opponent_planes(40, &[[0.2, 0.5, 0.7]; 40 * 30]);
        let blurred = blur(&planes, 67.02);
        for (plane, blurred) in planes.iter().zip(&blurred) {
            for (value, blurred) in plane.data.iter().zip(&blurred.data) {
                assert!((value - blurred).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn blue_yellow_is_the_sum_of_two_gaussians_in_two_dimensions() {
        let ppd = 30.0;
        let mut point = Plane::zeros(21, 21);
        point.data[10 * 21 + 10] = 1.0;
        let blurred = blur_plane(&point, BLUE_YELLOW, ppd);
        let value = |index: usize| {
            let (dx, dy) = ((index % 21) as f64 - 10.0, (index / 21) as f64 - 10.0);
            let gauss = |a: f64, b: f64| {
                a * (PI / b).sqrt() * (-PI * PI * (dx * dx + dy * dy) / (ppd * ppd * b)).exp()
            };
            let inside = dx.abs() <= 5.0 && dy.abs() <= 5.0;
            if inside {
                gauss(34.1, 0.04) + gauss(13.5, 0.025)
            } else {
                0.0
            }
        };
        let sum: f64 = (0..21 * 21).map(value).sum();
        for (index, &blurred) in blurred.data.iter().enumerate() {
            assert!((f64::from(blurred) - value(index) / sum).abs() < 1e-6);
        }
    }
}
