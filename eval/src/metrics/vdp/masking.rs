//! How a picture hides differences in itself: threshold elevation (section 5).

use super::SettingsError;
use super::cortex::BANDS;

/// Constants W and Q of \[D93\].
const W: f32 = 6.0;
const Q: f32 = 0.7;

/// Slope s of masking in each band, from the finest (dom 1) to the base.
///
/// The literature does not settle it, and it decides close cases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slopes(pub [f64; BANDS]);

impl Slopes {
    /// Slope 1.0 in every band: HDR-VDP 1.x, and the default here.
    pub const ONE: Self = Self([1.0; BANDS]);

    /// Slope 0.9 in every band: the VDP of 1993 as compared against by HDR-VDP-2.
    pub const NINE_TENTHS: Self = Self([0.9; BANDS]);

    /// The older values, falling from fine to coarse bands.
    pub const PER_BAND: Self = Self([1.0, 1.0, 1.0, 0.8, 0.8, 0.7]);

    /// Every published setting, the default first.
    pub const PUBLISHED: [Self; 3] = [Self::ONE, Self::NINE_TENTHS, Self::PER_BAND];

    pub(super) fn check(&self) -> Result<(), SettingsError> {
        let wrong = self.0.into_iter().find(|slope| !(0.0..=2.0).contains(slope));
        wrong.map_or(Ok(()), |slope| Err(SettingsError::Slope(slope)))
    }
}

impl Default for Slopes {
    fn default() -> Self {
        Self::ONE
    }
}

/// One number if all bands have the same slope, else six, joined by commas.
impl std::fmt::Display for Slopes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let texts = self.0.map(|slope| format!("{slope:?}"));
        let all_equal = texts.iter().all(|text| *text == texts[0]);
        f.write_str(&if all_equal {
            texts[0].clone()
        } else {
            texts.join(",")
        })
    }
}

/// The threshold Te of a channel whose own signal is `m`, both in threshold units, for one slope.
///
/// Te = (1 + (k1 (k2 |m|)^s)^4)^(1/4), with k1 = W^(1 - 1/(1-Q)), k2 = W^(1/(1-Q)).
pub(super) enum Elevation {
    /// For s = 1 the product k1 k2 is W, and no power is needed.
    Linear,
    Power {
        slope: f32,
    },
}

impl Elevation {
    pub(super) fn new(slope: f64) -> Self {
        let is_one = (slope - 1.0).abs() < f64::EPSILON;
        if is_one {
            Self::Linear
        } else {
            Self::Power { slope: slope as f32 }
        }
    }

    /// The thresholds that signals make, pixel by pixel.
    pub(super) fn thresholds(&self, signals: impl Iterator<Item = f32>, thresholds: &mut [f32]) {
        let pixels = thresholds.iter_mut().zip(signals);
        match *self {
            Self::Linear => pixels.for_each(|(te, m)| *te = above_one(W * m.abs())),
            Self::Power { slope } => {
                let k1 = W.powf(1.0 - 1.0 / (1.0 - Q));
                let k2 = W.powf(1.0 / (1.0 - Q));
                pixels.for_each(|(te, m)| *te = above_one(k1 * (k2 * m.abs()).powf(slope)));
            }
        }
    }
}

/// A smooth maximum of 1 and x: (1 + x⁴)^(1/4).
fn above_one(x: f32) -> f32 {
    let square = x * x;
    (1.0 + square * square).sqrt().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn te(elevation: &Elevation, m: f32) -> f32 {
        let mut thresholds = [0.0];
        elevation.thresholds([m].into_iter(), &mut thresholds);
        thresholds[0]
    }

    #[test]
    fn thresholds_have_the_values_of_section_9() {
        for (m, expected) in [
            (0.1, 1.030_93),
            (1.0, 6.001_16),
            (10.0, 60.000_0),
            (-1.0, 6.001_16),
        ] {
            for elevation in [Elevation::new(1.0), Elevation::Power { slope: 1.0 }] {
                let value = te(&elevation, m);
                assert!((value / expected - 1.0).abs() < 5e-6, "Te({m}) = {value}");
            }
        }
    }

    #[test]
    fn a_slope_below_one_masks_less_where_the_mask_is_strong() {
        // By hand: k1 (k2 m)^s = 0.015277 * 3927.5^0.9 = 26.23.
        let value = te(&Elevation::new(0.9), 10.0);
        assert!((value - 26.23).abs() < 0.02, "{value}");
    }

    #[test]
    fn equal_slopes_print_as_one_number() {
        assert_eq!(Slopes::ONE.to_string(), "1.0");
        assert_eq!(Slopes::PER_BAND.to_string(), "1.0,1.0,1.0,0.8,0.8,0.7");
    }
}
