//! One value per pixel: luminance, a filtered channel, an error map.

/// One value per pixel, `[height][width]` row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The values, `width * height` of them.
    pub data: Vec<f32>,
}

impl Plane {
    /// A plane of zeros.
    #[must_use]
    pub fn zeros(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            data: vec![0.0; width * height],
        }
    }

    /// The arithmetic mean, summed in f64; NaN for a plane without pixels.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.data.iter().copied().map(f64::from).sum::<f64>() / self.data.len() as f64
    }

    /// The same shape with every value replaced.
    #[must_use]
    pub fn map(&self, f: impl Fn(f32) -> f32) -> Self {
        Self {
            data: self.data.iter().map(|&value| f(value)).collect(),
            ..*self
        }
    }

    /// Combines the values of two planes of one shape, pixel by pixel.
    #[must_use]
    pub fn zip_map(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        debug_assert_eq!((self.width, self.height), (other.width, other.height));
        let data = self
            .data
            .iter()
            .zip(&other.data)
            .map(|(&a, &b)| f(a, b))
            .collect();
        Self { data, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_counts_every_pixel_once() {
        let plane = Plane {
            width: 3,
            height: 1,
            data: vec![1.0, 2.0, 6.0],
        };
        assert!((plane.mean() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn planes_combine_pixel_by_pixel() {
        let a = Plane {
            width: 2,
            height: 1,
            data: vec![1.0, 2.0],
        };
        let b = a.map(|value| value * 10.0);
        assert_eq!(a.zip_map(&b, |a, b| b - a).data, [9.0, 18.0]);
    }
}
