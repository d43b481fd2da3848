//! Structural similarity: Wang, Bovik, Sheikh, Simoncelli, Image quality assessment: from error
//! visibility to structural similarity, IEEE Transactions on Image Processing 13(4), 2004.
//!
//! Of Rec. 709 luma of the pictures as a display gets them (exposed, clipped, sRGB-encoded; data
//! range 1), with the paper's Gaussian window of 11 × 11 pixels and population statistics.

use super::convolve::separable;
use crate::image::Pair;
use crate::plane::Plane;

/// The window's side in pixels and its standard deviation.
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;

/// The stabilising constants (K1 L)² and (K2 L)² for a data range L of 1.
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;

/// The similarity of two pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct Ssim {
    /// Mean over all windows that lie within the picture: 1 for equal pictures.
    pub mean: f64,
    /// Similarity at each pixel, -1..1; near the border, edge pixels are repeated.
    pub map: Plane,
}

/// Structural similarity; `None` for pictures smaller than one window of 11 × 11 pixels.
#[must_use]
pub fn ssim(pair: &Pair<'_>) -> Option<Ssim> {
    if pair.width() < WINDOW || pair.height() < WINDOW {
        return None;
    }
    let shown = pair.encoded();
    let (x, y) = (shown.reference().luminance(), shown.image().luminance());
    let window = window();
    let local_mean = |plane: &Plane| separable(plane, &window, &window);
    let (mean_x, mean_y) = (local_mean(&x), local_mean(&y));
    let [xx, yy, xy] = [(&x, &x), (&y, &y), (&x, &y)].map(|(a, b)| local_mean(&a.zip_map(b, |a, b| a * b)));

    let similarity = |pixel: usize| {
        let (mx, my) = (mean_x.data[pixel], mean_y.data[pixel]);
        let (vx, vy) = (xx.data[pixel] - mx * mx, yy.data[pixel] - my * my);
        let covariance = xy.data[pixel] - mx * my;
        let luminance = (2.0 * mx * my + C1) / (mx * mx + my * my + C1);
        luminance * (2.0 * covariance + C2) / (vx + vy + C2)
    };
    let data = (0..x.data.len()).map(similarity).collect();
    let map = Plane { data, ..x };
    Some(Ssim {
        mean: mean_of_interior(&map),
        map,
    })
}

fn window() -> [f32; WINDOW] {
    let gauss = |i: usize| (-(i as f64 - 5.0).powi(2) / (2.0 * SIGMA * SIGMA)).exp();
    let sum: f64 = (0..WINDOW).map(gauss).sum();
    std::array::from_fn(|i| (gauss(i) / sum) as f32)
}

/// The mean over pixels whose whole window lies within the picture.
fn mean_of_interior(map: &Plane) -> f64 {
    let border = WINDOW / 2;
    let rows = map
        .data
        .chunks_exact(map.width)
        .skip(border)
        .take(map.height - 2 * border);
    let interior = rows.flat_map(|row| &row[border..map.width - border]);
    let count = (map.width - 2 * border) * (map.height - 2 * border);
    interior.map(|&value| f64::from(value)).sum::<f64>() / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, ImageRgb};

    fn grey(width: usize, height: usize, value: impl Fn(usize) -> f32) -> ImageRgb {
        let data = (0..width * height).map(|i| [value(i); 3]).collect();
        ImageRgb {
            width,
            height,
            data,
            encoding: Encoding::Encoded,
        }
    }

    fn mean(reference: &ImageRgb, image: &ImageRgb) -> Option<f64> {
        ssim(&Pair::new(reference, image, 0.0).expect("one size")).map(|ssim| ssim.mean)
    }

    #[test]
    fn equal_pictures_have_similarity_one() {
        let image = grey(20, 13, |i| (i * i % 31) as f32 / 31.0);
        assert!((mean(&image, &image).expect("large enough") - 1.0).abs() < 1e-7);
    }

    #[test]
    fn flat_pictures_differ_in_the_luminance_term_alone() {
        let (dark, bright) = (grey(12, 12, |_| 0.2), grey(12, 12, |_| 0.6));
        let expected = (2.0 * 0.2 * 0.6 + 1e-4) / (0.04 + 0.36 + 1e-4);
        assert!((mean(&dark, &bright).expect("large enough") - expected).abs() < 1e-4);
    }

    #[test]
    fn a_negative_is_unlike() {
        let stripes = grey(24, 24, |i| if i % 4 < 2 { 0.9 } else { 0.1 });
        let negative = grey(24, 24, |i| if i % 4 < 2 { 0.1 } else { 0.9 });
        assert!(mean(&stripes, &negative).expect("large enough") < -0.9);
    }

    #[test]
    fn pictures_below_one_window_have_no_similarity() {
        let small = grey(10, 30, |_| 0.5);
        assert_eq!(mean(&small, &small), None);
    }
}
