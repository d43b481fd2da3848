//! Plain errors: RMSE, relative MSE, PSNR.
//!
//! RMSE and relMSE judge the values as they were read: radiance of linear pictures (no exposure, no
//! clipping), codes of encoded ones. PSNR judges what a display gets.

use crate::image::Pair;
use crate::plane::Plane;

/// Added to the squared reference in the denominator of relMSE, against division by nearly zero.
pub const RELATIVE_EPSILON: f64 = 1e-2;

/// Root of the mean squared difference over all pixels and channels.
#[must_use]
pub fn rmse(pair: &Pair<'_>) -> f64 {
    mean_squared_error(pair).sqrt()
}

/// Mean over all pixels and channels of (a - r)² / (r² + 0.01), with r of the reference.
#[must_use]
pub fn relative_mse(pair: &Pair<'_>) -> f64 {
    mean(values(pair).map(|(reference, image)| relative_square(reference, image)))
}

/// Peak signal to noise ratio in dB of the pictures as a display gets them (exposed, clipped,
/// sRGB-encoded; peak 1), over all pixels and channels; infinite if they are equal.
#[must_use]
pub fn psnr(pair: &Pair<'_>) -> f64 {
    -10.0 * mean_squared_error(&pair.encoded()).log10()
}

/// Root of each pixel's share in relMSE: about the relative error, and about ten times the absolute
/// one in the dark.
#[must_use]
pub fn relative_error_map(pair: &Pair<'_>) -> Plane {
    let both = pair.reference().data.iter().zip(&pair.image().data);
    let error = |(reference, image): (&[f32; 3], &[f32; 3])| {
        let channels = reference.iter().zip(image);
        let squares = channels.map(|(&reference, &image)| relative_square(reference.into(), image.into()));
        (squares.sum::<f64>() / 3.0).sqrt() as f32
    };
    Plane {
        width: pair.width(),
        height: pair.height(),
        data: both.map(error).collect(),
    }
}

fn relative_square(reference: f64, image: f64) -> f64 {
    (image - reference).powi(2) / (reference.powi(2) + RELATIVE_EPSILON)
}

fn mean_squared_error(pair: &Pair<'_>) -> f64 {
    mean(values(pair).map(|(reference, image)| (image - reference).powi(2)))
}

/// All values of the reference, each with that of the image at the same place.
fn values(pair: &Pair<'_>) -> impl ExactSizeIterator<Item = (f64, f64)> {
    let (reference, image) = (&pair.reference().data, &pair.image().data);
    let both = reference.as_flattened().iter().zip(image.as_flattened());
    both.map(|(&reference, &image)| (f64::from(reference), f64::from(image)))
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len();
    values.sum::<f64>() / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, ImageRgb};

    fn check(metric: fn(&Pair<'_>) -> f64, encoding: Encoding, stops: f64, expected: f64) {
        let image = |data: Vec<[f32; 3]>| ImageRgb {
            width: 2,
            height: 1,
            data,
            encoding,
        };
        let reference = image(vec![[0.5, 0.25, 0.0], [1.0, 1.0, 1.0]]);
        let test = image(vec![[0.5, 0.5, 0.1], [1.0, 1.0, 3.0]]);
        let value = metric(&Pair::new(&reference, &test, stops).expect("one size"));
        assert!((value - expected).abs() < 1e-6, "{value} instead of {expected}");
    }

    #[test]
    fn rmse_is_the_root_of_the_mean_square() {
        let expected = ((0.25_f64.powi(2) + 0.01 + 4.0) / 6.0).sqrt();
        check(rmse, Encoding::Linear, 0.0, expected);
        check(rmse, Encoding::Linear, 5.0, expected);
        check(rmse, Encoding::Encoded, 0.0, expected);
    }

    #[test]
    fn relative_mse_divides_by_the_reference_and_a_hundredth() {
        let expected = (0.0625 / (0.0625 + 0.01) + 0.01 / 0.01 + 4.0 / 1.01) / 6.0;
        check(relative_mse, Encoding::Linear, 0.0, expected);
    }

    #[test]
    fn psnr_is_of_what_a_display_gets() {
        // 3.0 shows as 1.0; 0.25, 0.5 and 0.1 have the codes 0.537099, 0.735357, 0.349190.
        let mse = |differences: [f64; 2]| differences.map(|d| d * d).iter().sum::<f64>() / 6.0;
        let db = |mse: f64| -10.0 * mse.log10();
        check(
            psnr,
            Encoding::Linear,
            0.0,
            db(mse([0.735_356_98 - 0.537_098_73, 0.349_190_21])),
        );
        // One stop more: 0.5, 1.0 and 0.2 have the codes 0.735357, 1, 0.484529.
        check(
            psnr,
            Encoding::Linear,
            1.0,
            db(mse([1.0 - 0.735_356_98, 0.484_529_2])),
        );
    }

    #[test]
    fn equal_pictures_have_an_infinite_psnr() {
        let image = ImageRgb {
            width: 1,
            height: 1,
            data: vec![[0.5; 3]],
            encoding: Encoding::Linear,
        };
        let pair = Pair::new(&image, &image, 0.0).expect("one size");
        assert!(psnr(&pair).is_infinite() && psnr(&pair) > 0.0);
    }

    #[test]
    fn the_map_shows_where_relative_mse_comes_from() {
        let image = |blue| {
            let data = vec![[0.5; 3], [0.5, 0.5, blue]];
            ImageRgb {
                width: 2,
                height: 1,
                data,
                encoding: Encoding::Linear,
            }
        };
        let (reference, test) = (image(0.5), image(0.8));
        let pair = Pair::new(&reference, &test, 0.0).expect("one size");
        let map = relative_error_map(&pair);
        assert!(map.data[0].abs() < 1e-9);
        let mean_square = map.map(|error| error * error).mean();
        assert!((mean_square - relative_mse(&pair)).abs() < 1e-7);
    }
}
