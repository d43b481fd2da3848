//! How far a picture is from the gold one, by every setting of every metric.

use render::image::Picture;

use crate::{
    image::{Encoding, ImageRgb, Pair},
    metrics::{
        flip::{self, flip},
        rmse::rmse,
        vdp::{self, Slopes, visible_differences},
    },
};

/// What is printed side by side, the default first. None is left out for disagreeing.
pub const METRICS: [Metric; 8] = [
    metric("VDP, slope 1.0", Scale::Percent),
    metric("VDP, slope 1.0, zero identical", Scale::Percent),
    metric("VDP, slope 0.9", Scale::Percent),
    metric("VDP, slope 0.9, zero identical", Scale::Percent),
    metric("VDP, slopes per band", Scale::Percent),
    metric("VDP, slopes per band, zero identical", Scale::Percent),
    metric("FLIP, mean", Scale::Absolute),
    metric("RMSE, linear light", Scale::Absolute),
];
/// The place of VDP(P > 75 %) with the default settings, which stands beside the paper's.
pub const VDP: usize = 0;
/// The place of FLIP.
pub const FLIP: usize = 6;

/// A metric with its setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Metric {
    /// For people.
    pub name: &'static str,
    /// How its numbers are printed.
    pub scale: Scale,
}

/// How a metric's numbers are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Percent of the pixels.
    Percent,
    /// A small number.
    Absolute,
}

const fn metric(name: &'static str, scale: Scale) -> Metric {
    Metric { name, scale }
}

impl Metric {
    /// A value of this metric with as many digits as mean something.
    pub fn format(&self, value: f64) -> String {
        match self.scale {
            Scale::Percent => format!("{value:.2}"),
            Scale::Absolute => format!("{value:.4}"),
        }
    }
}

/// One value for each of [`METRICS`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scores(pub [f64; METRICS.len()]);

impl Scores {
    /// All of them as texts, in the order of [`METRICS`].
    pub fn cells(&self) -> impl Iterator<Item = String> {
        let scores = METRICS.iter().zip(self.0);
        scores.map(|(metric, score)| metric.format(score))
    }
}

/// A judged picture.
#[derive(Debug, Clone)]
pub struct Judgement {
    /// Its distance from the gold one.
    pub scores: Scores,
    /// 8-bit sRGB `[height][width]`: where a difference is seen, by the default VDP.
    pub map: Vec<[u8; 3]>,
}

/// A picture as the metrics take it.
pub fn linear(picture: &Picture) -> ImageRgb {
    ImageRgb {
        width: picture.size.width as usize,
        height: picture.size.height as usize,
        data: picture.beauty.iter().map(glam::Vec3::to_array).collect(),
        encoding: Encoding::Linear,
    }
}

/// VDP(P > 75 %), slope 1.0, of a picture that is looked at from `distance` metres.
///
/// # Errors
/// If the pictures' sizes differ.
pub fn vdp_from(
    distance: f64,
    gold: &ImageRgb,
    image: &ImageRgb,
    exposure_stops: f64,
) -> anyhow::Result<f64> {
    let settings = vdp::Settings {
        viewing: vdp::Viewing {
            distance,
            ..vdp::Viewing::default()
        },
        ..vdp::Settings::default()
    };
    let pair = Pair::new(gold, image, exposure_stops)?;
    let found = visible_differences(&pair, &settings, &[Slopes::default()])?;
    Ok(found.first().map_or(0.0, |found| found.percent))
}

/// Judges a picture by the gold one.
///
/// # Errors
/// If their sizes differ.
pub fn judge(gold: &ImageRgb, image: &ImageRgb, exposure_stops: f64) -> anyhow::Result<Judgement> {
    let pair = Pair::new(gold, image, exposure_stops)?;
    let (vdp, flip) = rayon::join(
        || visible_differences(&pair, &vdp::Settings::default(), &Slopes::PUBLISHED),
        || flip(&pair, flip::PIXELS_PER_DEGREE).mean,
    );
    let vdp = vdp?;
    let mut values = [0.0; METRICS.len()];
    for (values, vdp) in values.chunks_exact_mut(2).zip(&vdp) {
        values.copy_from_slice(&[vdp.percent, vdp.percent_zero_identical]);
    }
    values[FLIP] = flip;
    values[FLIP + 1] = rmse(&pair);
    Ok(Judgement {
        scores: Scores(values),
        map: vdp::picture(&vdp[VDP].probability, pair.reference(), pair.gain()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_metric_has_a_value_in_its_place() {
        let image = |value: f32| ImageRgb {
            width: 48,
            height: 48,
            data: (0..48 * 48)
                .map(|pixel| [if pixel % 48 < 24 { 0.2 } else { value }; 3])
                .collect(),
            encoding: Encoding::Linear,
        };
        let gold = image(0.2);
        let Judgement { scores, map } = judge(&gold, &image(0.6), 0.0).unwrap();
        assert_eq!(map.len(), 48 * 48);
        assert!(scores.0.iter().all(|&value| value > 0.0), "{scores:?}");
        assert!((scores.0[FLIP + 1] - 0.4 / 2f64.sqrt()).abs() < 1e-6);
        // Half of the pixels are identical, the other half differs visibly.
        assert!((scores.0[VDP + 1] - 50.0).abs() < 5.0, "{scores:?}");
        let same = judge(&gold, &gold, 0.0).unwrap();
        assert!(same.scores.0.iter().all(|value| value.abs() < 1e-9));
    }

    #[test]
    fn names_of_metrics_follow_the_published_slopes() {
        assert_eq!(Slopes::PUBLISHED[0], Slopes::default());
        assert_eq!(
            METRICS
                .iter()
                .filter(|metric| metric.scale == Scale::Percent)
                .count(),
            2 * Slopes::PUBLISHED.len()
        );
    }
}
