//! The cortex transform \[D93, W87\]: six frequency bands times six orientations (section 4).

use std::f64::consts::PI;

use super::transform::{Filter, Frequency};

/// Frequency bands: five differences of mesas, and the base.
pub(super) const BANDS: usize = 6;

/// Orientations in each band but the base.
const FANS: usize = 6;

/// The filters of one image size; channels are made of them on the way.
///
/// `low_pass[k]` is mesa k for k = 0..5 and the base for k = 5. The difference of two neighbours
/// is a band, and band `k` is blurred by `low_pass[k]` for phase uncertainty.
#[derive(Debug)]
pub(super) struct Cortex {
    low_pass: Vec<Filter>,
    fans: Vec<Filter>,
}

/// What one detector of the visual cortex lets through: a product of a band and an orientation.
#[derive(Debug)]
pub(super) struct Channel<'a> {
    /// The band ends where this low-pass ends ...
    below: &'a Filter,
    /// ... and begins where this one ends; the base has no beginning.
    above: Option<&'a Filter>,
    /// The base has no orientation either.
    fan: Option<&'a Filter>,
    /// Which columns of a spectrum the channel lets anything of through.
    pub(super) passes: Vec<bool>,
}

impl Cortex {
    /// The filters for spectra of `height` rows, whose frequencies are given in their order.
    pub(super) fn new(height: usize, frequencies: &[Frequency]) -> Self {
        let filter = |gain: &dyn Fn(&Frequency) -> f64| {
            Filter::new(height, frequencies.iter().map(|frequency| gain(frequency) as f32))
        };
        let mesas = (0..BANDS - 1).map(|k| filter(&|frequency| mesa(k, frequency.radius)));
        let base = filter(&|frequency| base(frequency.radius));
        Self {
            low_pass: mesas.chain([base]).collect(),
            fans: (1..=FANS)
                .map(|l| filter(&|frequency| fan_at(l, frequency)))
                .collect(),
        }
    }

    /// The channels of band `k` = 0..6: six, but only one for the base.
    pub(super) fn channels(&self, k: usize) -> Vec<Channel<'_>> {
        let below = &self.low_pass[k];
        match self.low_pass.get(k + 1) {
            None => vec![Channel::new(below, None, None)],
            above => self
                .fans
                .iter()
                .map(|fan| Channel::new(below, above, Some(fan)))
                .collect(),
        }
    }

    /// The blur of thresholds in band `k` = 0..6 that stands for phase uncertainty.
    pub(super) fn phase_uncertainty(&self, k: usize) -> &Filter {
        &self.low_pass[k]
    }
}

impl<'a> Channel<'a> {
    fn new(below: &'a Filter, above: Option<&'a Filter>, fan: Option<&'a Filter>) -> Self {
        let mut channel = Self {
            below,
            above,
            fan,
            passes: Vec::new(),
        };
        let lets_through = |column| channel.gains(column).any(|gain| gain > 0.0);
        channel.passes = (0..below.column_count()).map(lets_through).collect();
        channel
    }

    /// The factors on the frequencies of one column of a spectrum.
    pub(super) fn gains(&self, column: usize) -> impl Iterator<Item = f32> {
        let below = self.below.column(column);
        let above = self.above.map_or(below, |filter| filter.column(column));
        let fan = self.fan.map_or(below, |filter| filter.column(column));
        let base = self.fan.is_none();
        below.iter().zip(above).zip(fan).map(
            move |((below, above), fan)| {
                if base { *below } else { (below - above) * fan }
            },
        )
    }
}

/// Half of all frequencies, `k` times.
fn half(k: usize) -> f64 {
    1.0 / f64::from(1_u32 << k)
}

/// Falls from 1 at position 0 to 0 at position 1, as half a period of a cosine.
fn fall(position: f64) -> f64 {
    if position <= 0.0 {
        1.0
    } else if position >= 1.0 {
        0.0
    } else {
        0.5 * (1.0 + (PI * position).cos())
    }
}

/// Low-pass with half amplitude at `half(k)`; `f` in cycles per pixel.
fn mesa(k: usize, f: f64) -> f64 {
    let half = half(k);
    let transition = 2.0 / 3.0 * half;
    fall((f - half + transition / 2.0) / transition)
}

/// The lowest frequencies: a Gaussian, cut at three standard deviations.
fn base(f: f64) -> f64 {
    let end = half(BANDS - 1) * 4.0 / 3.0;
    let s = end / 3.0;
    if f < end {
        (-f * f / (2.0 * s * s)).exp()
    } else {
        0.0
    }
}

/// Orientation filter `l` = 1..=6 at a frequency; 0 at zero frequency.
///
/// A frequency that stands for both signs of its vertical part gets the mean of the two.
fn fan_at(l: usize, frequency: &Frequency) -> f64 {
    let &Frequency {
        radius,
        degrees,
        both_signs,
    } = frequency;
    if radius <= 0.0 {
        0.0
    } else if both_signs {
        0.5 * (fan(l, degrees) + fan(l, -degrees))
    } else {
        fan(l, degrees)
    }
}

/// Orientation filter `l` = 1..=6 at an angle in degrees.
fn fan(l: usize, degrees: f64) -> f64 {
    let width = 180.0 / FANS as f64;
    let centre = (l as f64 - 1.0) * width - 90.0;
    let turned = (degrees - centre).rem_euclid(180.0);
    fall(turned.min(180.0 - turned) / width)
}

#[cfg(test)]
mod tests {
    use super::super::transform::frequencies;
    use super::*;

    fn check(value: f64, expected: f64) {
        assert!((value - expected).abs() < 5e-7, "{value} instead of {expected}");
    }

    #[test]
    fn filters_have_the_values_of_section_9() {
        check(mesa(2, 0.15) - mesa(3, 0.15), 0.904_508);
        check(mesa(0, 0.5) - mesa(1, 0.5), 0.5);
        check(base(0.02), 0.354_588);
        check(fan(4, 10.0), 0.75);
        check(fan(5, 10.0), 0.25);
        check(fan(1, 85.0), 0.933_013);
    }

    #[test]
    fn orientations_sum_to_one_at_every_angle() {
        for degrees in -180..180 {
            let sum: f64 = (1..=FANS).map(|l| fan(l, f64::from(degrees))).sum();
            check(sum, 1.0);
        }
    }

    #[test]
    fn channels_sum_to_one_within_one_percent() {
        for (width, height) in [(96, 96), (33, 50)] {
            let cortex = Cortex::new(height, &frequencies(width, height));
            let channels: Vec<_> = (0..BANDS).flat_map(|k| cortex.channels(k)).collect();
            assert_eq!(channels.len(), 31);
            for column in 0..=width / 2 {
                let mut sums = vec![0.0; height];
                for channel in &channels {
                    sums.iter_mut()
                        .zip(channel.gains(column))
                        .for_each(|(sum, gain)| *sum += gain);
                }
                for (row, sum) in sums.into_iter().enumerate() {
                    assert!((sum - 1.0_f32).abs() < 0.01, "{sum} at ({column}, {row})");
                }
            }
        }
    }
}
