//! From differences in units of their threshold to a probability of seeing them (section 6).

/// Slope of the psychometric function \[DP\]: `P = 1 - exp(-x^3.5)`.
fn psychometric_power(x: f32) -> f32 {
    x * x * x * x.sqrt()
}

/// Probability summation over channels, for each pixel.
///
/// The product of all `1 - P_kl` is `exp(-sum)` of the psychometric powers, so only the sum is
/// kept.
#[derive(Debug)]
pub(super) struct Detection {
    sums: Vec<f32>,
}

impl Detection {
    pub(super) fn nothing(pixels: usize) -> Self {
        Self {
            sums: vec![0.0; pixels],
        }
    }

    /// Adds one channel: its difference and the threshold maps of reference and test.
    ///
    /// Masking is mutual: the lower threshold of the two counts, but at least 1.
    pub(super) fn add_channel(&mut self, difference: &[f32], thresholds: [&[f32]; 2]) {
        let [reference, test] = thresholds;
        let pixels = self.sums.iter_mut().zip(difference).zip(reference).zip(test);
        for (((sum, difference), reference), test) in pixels {
            let threshold = reference.min(*test).max(1.0);
            *sum += psychometric_power(difference.abs() / threshold);
        }
    }

    /// The probability, 0..1, that the difference at each pixel is seen.
    pub(super) fn into_probabilities(mut self) -> Vec<f32> {
        for sum in &mut self.sums {
            *sum = (1.0 - (-f64::from(*sum)).exp()) as f32;
        }
        self.sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_at_threshold_is_seen_with_probability_63_percent() {
        let mut detection = Detection::nothing(1);
        detection.add_channel(&[-3.0], [&[3.0], &[4.0]]);
        assert!((detection.into_probabilities()[0] - 0.632_120_6).abs() < 1e-6);
    }

    #[test]
    fn thresholds_below_one_count_as_one() {
        let mut detection = Detection::nothing(1);
        detection.add_channel(&[1.0], [&[0.5], &[0.9]]);
        assert!((detection.into_probabilities()[0] - 0.632_120_6).abs() < 1e-6);
    }

    #[test]
    fn probabilities_of_channels_multiply_as_those_of_missing() {
        let mut detection = Detection::nothing(1);
        let miss = |x: f64| (-x.powf(3.5)).exp();
        for difference in [0.9, 0.7, 0.2] {
            detection.add_channel(&[difference], [&[1.0], &[1.0]]);
        }
        let expected = 1.0 - miss(0.9) * miss(0.7) * miss(0.2);
        assert!((f64::from(detection.into_probabilities()[0]) - expected).abs() < 1e-6);
    }
}
