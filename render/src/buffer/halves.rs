//! The light of one component in two halves that share no sample, so that their difference tells the noise.
//!
//! Sums are integers: they are exact, so any order of arrival gives the same bits.

use bytemuck::zeroed_vec;
use glam::DVec3;

use crate::scene::ImageSize;

/// Steps of the sums in one W·m⁻²·sr⁻¹: a sum may be 10⁻⁹ to 10¹⁰, and stays at the largest it can be.
const STEPS: f64 = (1_u64 << 30) as f64;

/// Every so many-th pixel is asked for its noise; the step has no factor in common with usual widths.
const PILOT_STEP: usize = 97;

/// Running sums of radiance, its albedo included, in two halves.
#[derive(Debug, Clone)]
pub struct HalfBuffers {
    size: ImageSize,
    halves: [Half; 2],
}

/// Half of the samples.
#[derive(Debug, Clone)]
pub struct Half {
    /// `[height][width][3]`, in [`STEPS`].
    sums: Vec<[u64; 3]>,
    /// Samples in each sum, `[height][width]`.
    counts: Vec<u32>,
}

impl HalfBuffers {
    /// Without light. Memory is taken where light arrives.
    pub fn new(size: ImageSize) -> Self {
        let half = || Half {
            sums: zeroed_vec(size.pixel_count()),
            counts: zeroed_vec(size.pixel_count()),
        };
        Self {
            size,
            halves: [half(), half()],
        }
    }

    /// Picture size.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// Both halves; which is which has no meaning.
    pub fn halves(&self) -> &[Half; 2] {
        &self.halves
    }

    /// Adds the sums of so many samples at each of some pixels, given by their row-major indices:
    /// radiance in W·m⁻²·sr⁻¹, not negative.
    ///
    /// # Panics
    /// For pixels outside of the picture, and halves other than 0 and 1.
    pub fn add(&mut self, half: usize, pixels: &[u32], light: &[[f32; 3]], samples: u32) {
        let half = &mut self.halves[half];
        for (&pixel, light) in pixels.iter().zip(light) {
            let pixel = pixel as usize;
            for (sum, &light) in half.sums[pixel].iter_mut().zip(light) {
                *sum = sum.saturating_add((f64::from(light) * STEPS).round() as u64);
            }
            half.counts[pixel] = half.counts[pixel].saturating_add(samples);
        }
    }

    /// Samples at a pixel.
    pub fn count(&self, pixel: usize) -> u32 {
        let [a, b] = &self.halves;
        a.counts[pixel].saturating_add(b.counts[pixel])
    }

    /// How noisy one sample is: its squared error, in shares of the squared mean, on the average over some
    /// of the pixels that have samples in both halves; `None` where there are none.
    ///
    /// From the difference of both halves: within a half samples may have their error in common.
    pub fn relative_variance(&self) -> Option<f64> {
        let luminance = |light: DVec3| light.dot(DVec3::new(0.2126, 0.7152, 0.0722));
        let [a, b] = &self.halves;
        let (mut sum, mut pixels) = (0.0, 0.0);
        for pixel in (0..self.size.pixel_count()).step_by(PILOT_STEP) {
            let (Some(mean_a), Some(mean_b)) = (a.mean(pixel), b.mean(pixel)) else {
                continue;
            };
            // The difference is as noisy as the mean of so many samples.
            let samples = 1.0 / (1.0 / f64::from(a.count(pixel)) + 1.0 / f64::from(b.count(pixel)));
            let (light_a, light_b) = (luminance(mean_a), luminance(mean_b));
            let mean = 0.5 * (light_a + light_b);
            if mean > 0.0 {
                sum += samples * ((light_a - light_b) / mean).powi(2);
            }
            pixels += 1.0;
        }
        (pixels > 0.0).then(|| sum / pixels)
    }

    /// The mean of all samples at a pixel; `None` where there are none.
    pub fn mean(&self, pixel: usize) -> Option<DVec3> {
        let [a, b] = &self.halves;
        let count = self.count(pixel);
        (count > 0).then(|| (a.sum(pixel) + b.sum(pixel)) / f64::from(count))
    }
}

impl Half {
    /// Samples at a pixel, given by its row-major index.
    pub fn count(&self, pixel: usize) -> u32 {
        self.counts[pixel]
    }

    /// Sum of their radiance, W·m⁻²·sr⁻¹.
    pub fn sum(&self, pixel: usize) -> DVec3 {
        DVec3::from_array(self.sums[pixel].map(|steps| steps as f64 / STEPS))
    }

    /// Their mean; `None` where there are none.
    pub fn mean(&self, pixel: usize) -> Option<DVec3> {
        let count = self.counts[pixel];
        (count > 0).then(|| self.sum(pixel) / f64::from(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: ImageSize = ImageSize { width: 3, height: 2 };

    #[test]
    fn any_order_gives_the_same_bits() {
        let results: Vec<(usize, f32, u32)> = (0..40_u8)
            .map(|i| {
                (
                    usize::from(i % 2),
                    0.1_f32.powi(i32::from(i % 9)) * 1.7,
                    1 << (i % 3),
                )
            })
            .collect();
        let sum = |order: &mut dyn Iterator<Item = &(usize, f32, u32)>| {
            let mut buffers = HalfBuffers::new(SIZE);
            for &(half, light, samples) in order {
                buffers.add(half, &[4], &[[light; 3]], samples);
            }
            (buffers.halves[0].sum(4), buffers.mean(4), buffers.count(4))
        };
        let forward = sum(&mut results.iter());
        assert_eq!(sum(&mut results.iter().rev()), forward);
        assert_eq!(sum(&mut results[7..].iter().chain(&results[..7])), forward);
    }

    #[test]
    fn sums_and_counts_give_the_mean_of_both_halves() {
        let mut buffers = HalfBuffers::new(SIZE);
        assert_eq!(buffers.mean(1), None);
        buffers.add(0, &[1, 5], &[[3.0, 0.0, 1.0], [1.0; 3]], 2);
        buffers.add(1, &[1], &[[6.0, 3.0, 0.5]], 1);
        assert_eq!(buffers.mean(1), Some(DVec3::new(3.0, 1.0, 0.5)));
        assert_eq!(buffers.halves()[0].mean(1), Some(DVec3::new(1.5, 0.0, 0.5)));
        assert_eq!(buffers.halves()[1].mean(5), None);
        assert_eq!([1, 5, 0].map(|pixel| buffers.count(pixel)), [3, 2, 0]);
    }

    #[test]
    fn light_beyond_all_measure_stays_at_the_largest_sum() {
        let mut buffers = HalfBuffers::new(SIZE);
        for _ in 0..3 {
            buffers.add(0, &[0], &[[f32::MAX; 3]], 1);
        }
        let mean = buffers.mean(0).unwrap();
        assert!(mean.is_finite() && mean.min_element() > 1e9, "{mean}");
    }
}
