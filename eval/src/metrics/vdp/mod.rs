//! Daly's Visible Differences Predictor: how likely an eye sees that two pictures differ, and where.
//!
//! display luminance → contrast → sensitivity → channels → masking → probability → picture.
//! `docs/metrics.md` has the definition and its sources (\[D93\], \[DP\], \[W87\]); section numbers
//! in these files are those of the project's definition of the VDP.

mod display;

mod csf;

mod cortex;
mod transform;

mod masking;

mod detect;
mod observer;

mod map;

pub use self::display::Viewing;
pub use self::map::picture;
pub use self::masking::Slopes;

use self::detect::Detection;
use self::observer::Observer;
use crate::image::Pair;
use crate::plane::Plane;

/// Above this probability a difference counts as visible.
pub const VISIBLE: f32 = 0.75;

/// Luminances nearer than this count as identical, cd/m².
const IDENTICAL: f64 = 1e-4;

/// How the pictures are looked at; the slope of masking is given apart, see [`Slopes`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Display and distance.
    pub viewing: Viewing,
    /// Whether thresholds are blurred, since the eye masks regardless of the mask's exact phase.
    pub phase_uncertainty: bool,
    /// Whether pixels of equal luminance count as invisible whatever their neighbours say.
    pub zero_identical: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            viewing: Viewing::default(),
            phase_uncertainty: true,
            zero_identical: false,
        }
    }
}

impl Settings {
    fn check(&self) -> Result<(), SettingsError> {
        let Viewing {
            peak,
            black,
            distance,
            ..
        } = self.viewing;
        if !(black > 0.0 && peak > black && peak.is_finite()) {
            return Err(SettingsError::Display { peak, black });
        }
        let pixels_per_degree = self.viewing.pixels_per_degree();
        let possible = |value: f64| value > 0.0 && value.is_finite();
        if !possible(distance) || !possible(pixels_per_degree) {
            return Err(SettingsError::Distance {
                distance,
                pixels_per_degree,
            });
        }
        Ok(())
    }

    /// Every setting that is not the default, as text to print with a result; the exposure and
    /// the slopes are not among them.
    #[must_use]
    pub fn changes(&self) -> Vec<String> {
        let default = Viewing::default();
        let number = |name: &str, value: f64, default: f64, unit: &str| {
            ((value - default).abs() > 0.0).then(|| format!("{name} {value} {unit}"))
        };
        [
            number("peak", self.viewing.peak, default.peak, "cd/m²"),
            number("black", self.viewing.black, default.black, "cd/m²"),
            number("distance", self.viewing.distance, default.distance, "m"),
            self.viewing
                .pixels_per_degree
                .map(|ppd| format!("{ppd} pixels per degree")),
            (!self.phase_uncertainty).then(|| "phase uncertainty off".into()),
            self.zero_identical.then(|| "zero identical".into()),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// Settings that make no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// The display would be negative, or absorb light.
    #[error("peak {peak} and black {black} cd/m²: need 0 < black < peak, both finite")]
    Display {
        /// Luminance of white.
        peak: f64,
        /// Luminance of black.
        black: f64,
    },
    /// The observer would be nowhere.
    #[error("distance {distance} m at {pixels_per_degree} pixels per degree: both must be above 0")]
    Distance {
        /// From eye to screen, metres.
        distance: f64,
        /// As set or as computed.
        pixels_per_degree: f64,
    },
    /// Masking would be undefined.
    #[error("slope of masking {0}: need a number from 0 to 2")]
    Slope(f64),
}

/// What an observer sees of the difference between two pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct VisibleDifferences {
    /// The slopes of masking that were used.
    pub slopes: Slopes,
    /// Probability, 0..1, that the difference at a pixel is seen.
    pub probability: Plane,
    /// VDP(P > 75 %): the percentage of pixels where the probability exceeds 0.75.
    pub percent: f64,
    /// The same, with probability 0 wherever both luminances differ by less than 10⁻⁴ cd/m².
    pub percent_zero_identical: f64,
}

/// Predicts the visible differences of a pair of pictures, once for each of `slopes`.
///
/// Several slopes cost less than as many calls, since the channels are the same.
///
/// # Errors
/// Settings or slopes outside their range.
pub fn visible_differences(
    pair: &Pair<'_>,
    settings: &Settings,
    slopes: &[Slopes],
) -> Result<Vec<VisibleDifferences>, SettingsError> {
    settings.check()?;
    slopes.iter().try_for_each(Slopes::check)?;
    let (width, height) = (pair.width(), pair.height());
    let reference = settings.viewing.luminances(pair.reference(), pair.gain());
    let test = settings.viewing.luminances(pair.image(), pair.gain());
    let identical: Vec<bool> = reference
        .iter()
        .zip(&test)
        .map(|(a, b)| (a - b).abs() < IDENTICAL)
        .collect();

    let mut observer = Observer::new((width, height), settings, &reference, &test);
    let conclude = |(&slopes, detection): (&Slopes, Detection)| {
        let probability = Plane {
            width,
            height,
            data: detection.into_probabilities(),
        };
        conclude(slopes, probability, &identical, settings.zero_identical)
    };
    Ok(slopes.iter().zip(observer.detect(slopes)).map(conclude).collect())
}

/// Counts the pixels where a difference is seen.
fn conclude(
    slopes: Slopes,
    mut probability: Plane,
    identical: &[bool],
    zero_identical: bool,
) -> VisibleDifferences {
    let percent = |plane: &Plane| {
        let visible = plane.data.iter().filter(|&&p| p > VISIBLE).count();
        100.0 * visible as f64 / plane.data.len() as f64
    };
    let percent_everywhere = percent(&probability);
    let mut unequal = probability.clone();
    for (p, _) in unequal
        .data
        .iter_mut()
        .zip(identical)
        .filter(|(_, identical)| **identical)
    {
        *p = 0.0;
    }
    let percent_zero_identical = percent(&unequal);
    if zero_identical {
        probability = unequal;
    }
    VisibleDifferences {
        slopes,
        percent: if zero_identical {
            percent_zero_identical
        } else {
            percent_everywhere
        },
        percent_zero_identical,
        probability,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_count_where_the_probability_exceeds_three_quarters() {
        let probability = Plane {
            width: 4,
            height: 1,
            data: vec![0.74, 0.75, 0.76, 0.9],
        };
        let found = conclude(Slopes::ONE, probability, &[false, false, false, true], false);
        assert!((found.percent - 50.0).abs() < 1e-9, "{}", found.percent);
        assert!((found.percent_zero_identical - 25.0).abs() < 1e-9);
    }
}
