//! Edges and points, which the eye is quick to find.

use crate::metrics::convolve::{columns, rows};
use crate::plane::Plane;

/// Width of the features that the eye detects, in degrees; the Gaussian's deviation is half of it.
const WIDTH: f64 = 0.082;

/// How strong edges and points are at each pixel.
pub(super) struct Features {
    edges: Plane,
    points: Plane,
}

impl Features {
    /// Finds the features of an achromatic plane.
    pub(super) fn of(achromatic: &Plane, pixels_per_degree: f64) -> Self {
        let [gauss, first, second] = kernels(pixels_per_degree);
        let smooth_columns = columns(achromatic, &gauss);
        let smooth_rows = rows(achromatic, &gauss);
        let length = |kernel: &[f32]| {
            rows(&smooth_columns, kernel).zip_map(&columns(&smooth_rows, kernel), f32::hypot)
        };
        Self {
            edges: length(&first),
            points: length(&second),
        }
    }

    /// The difference of features at each pixel, 0..1: of edges or points, whichever is larger.
    pub(super) fn difference(&self, other: &Self) -> Plane {
        let edges = self.edges.zip_map(&other.edges, |a, b| (a - b).abs());
        let points = self.points.zip_map(&other.points, |a, b| (a - b).abs());
        edges.zip_map(&points, |edge, point| (edge.max(point) / f32::sqrt(2.0)).sqrt())
    }
}

/// A Gaussian of sum 1 and its first two derivatives, whose positive values have sum 1 and whose
/// negative ones have sum -1.
fn kernels(pixels_per_degree: f64) -> [Vec<f32>; 3] {
    let deviation = 0.5 * WIDTH * pixels_per_degree;
    let radius = (3.0 * deviation).ceil() as i32;
    let sample = |f: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        let at = |x: f64| f(x, (-x * x / (2.0 * deviation * deviation)).exp());
        (-radius..=radius).map(|pixels| at(f64::from(pixels))).collect()
    };
    [
        normalised(&sample(&|_, gauss| gauss)),
        normalised(&sample(&|x, gauss| -x * gauss)),
        normalised(&sample(&|x, gauss| {
            (x * x / (deviation * deviation) - 1.0) * gauss
        })),
    ]
}

fn normalised(values: &[f64]) -> Vec<f32> {
    let sum_of = |sign: f64| values.iter().map(|value| (value * sign).max(0.0)).sum::<f64>();
    let (positive, negative) = (sum_of(1.0), sum_of(-1.0));
    let scale = |value: f64| value / if value < 0.0 { negative } else { positive };
    values.iter().map(|&value| scale(value) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_centre(value: impl Fn(usize, usize) -> f32) -> (f32, f32) {
        let data = (0..61 * 61).map(|i| value(i % 61, i / 61)).collect();
        let features = Features::of(
            &Plane {
                width: 61,
                height: 61,
                data,
            },
            67.02,
        );
        let centre = 30 * 61 + 30;
        (features.edges.data[centre], features.points.data[centre])
    }

    #[test]
    fn a_flat_picture_has_no_features() {
        let (edge, point) = at_centre(|_, _| 0.7);
        assert!(edge < 1e-6 && point < 1e-6, "{edge} {point}");
    }

    #[test]
    fn a_step_is_an_edge_of_its_height_in_either_direction() {
        // The derivative of an odd kernel has no middle; half of the step's weight is on each side.
        let (across, _) = at_centre(|x, _| if x > 30 { 0.8 } else { 0.0 });
        let (down, _) = at_centre(|_, y| if y > 30 { 0.8 } else { 0.0 });
        assert!(
            (across - 0.8).abs() < 1e-5 && (down - 0.8).abs() < 1e-5,
            "{across} {down}"
        );
    }

    #[test]
    fn a_dot_is_a_point_and_no_edge() {
        let (edge, point) = at_centre(|x, y| if (x, y) == (30, 30) { 1.0 } else { 0.0 });
        assert!(edge < 1e-6 && point > 0.01, "{edge} {point}");
    }
}
