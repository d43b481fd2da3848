//! The results as a table for people and as JSON for scripts.

use std::path::Path;

use anyhow::Context;
use serde::Serialize;

use super::{Judgement, Options};
use crate::image::{Encoding, ImageRgb};
use crate::metrics::flip::{self, Exposures};
use crate::metrics::vdp::{Slopes, VisibleDifferences};

/// The numbers of all images, with the conditions under which they hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    gold: String,
    width: usize,
    height: usize,
    vdp_pixels_per_degree: f64,
    flip_pixels_per_degree: f64,
    /// Every setting that is not the default, in words.
    changed_settings: Vec<String>,
    images: Vec<Scores>,
}

/// The numbers of one image; docs/metrics.md says what they mean.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Scores {
    image: String,
    /// What the compared values are: `linear` or `srgb`.
    values: &'static str,
    /// One for each setting of the slopes; the map is of the first.
    vdp: Vec<VdpScore>,
    flip: f64,
    /// Null for LDR-FLIP.
    flip_exposures: Option<Exposures>,
    rmse: f64,
    relmse: f64,
    /// Null for images smaller than one window of 11 × 11 pixels.
    ssim: Option<f64>,
    /// Null for equal images, whose PSNR is infinite.
    psnr_db: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct VdpScore {
    slopes: [f64; 6],
    percent: f64,
    percent_zero_identical: f64,
    mean_probability: f64,
}

impl Report {
    pub(super) fn new(options: &Options, gold: &ImageRgb, images: Vec<Scores>) -> Self {
        Self {
            gold: options.gold.display().to_string(),
            width: gold.width,
            height: gold.height,
            vdp_pixels_per_degree: options.vdp.viewing.pixels_per_degree(),
            flip_pixels_per_degree: options.flip_pixels_per_degree,
            changed_settings: changed_settings(options),
            images,
        }
    }

    /// One JSON object.
    pub fn to_json(&self) -> anyhow::Result<String> {
        serde_json::to_string_pretty(self).context("cannot write the report as JSON")
    }

    /// A table, with another one for the VDP if there are several settings of the slopes.
    #[must_use]
    pub fn to_table(&self) -> String {
        let heading = format!("reference {}, {} × {} pixels", self.gold, self.width, self.height);
        let settings = match &self.changed_settings[..] {
            [] => "all settings are the defaults".into(),
            changes => format!("settings: {}", changes.join(", ")),
        };
        let mut tables = vec![format!("{heading}; {settings}"), self.metrics_table()];
        if self.images.iter().any(|scores| scores.vdp.len() > 1) {
            let title = "VDP(P > 75 %) by slope of masking, and with the zero-identical rule:";
            tables.push(format!("{title}\n{}", self.slopes_table()));
        }
        tables.join("\n\n")
    }

    fn metrics_table(&self) -> String {
        let head = [
            "image", "VDP>75%", "zero id.", "FLIP", "RMSE", "relMSE", "SSIM", "PSNR dB", "values",
        ];
        let row = |scores: &Scores| {
            let vdp = |percent: fn(&VdpScore) -> f64| {
                scores
                    .vdp
                    .first()
                    .map(|score| format!("{:.2} %", percent(score)))
                    .unwrap_or_default()
            };
            vec![
                scores.image.clone(),
                vdp(|score| score.percent),
                vdp(|score| score.percent_zero_identical),
                format!("{:.5}", scores.flip),
                significant(scores.rmse),
                significant(scores.relmse),
                scores
                    .ssim
                    .map_or("too small".into(), |ssim| format!("{ssim:.5}")),
                scores
                    .psnr_db
                    .map_or("infinite".into(), |psnr| format!("{psnr:.2}")),
                scores.values.into(),
            ]
        };
        aligned(head.map(String::from).into(), self.images.iter().map(row))
    }

    fn slopes_table(&self) -> String {
        let mut head = vec!["image".to_owned()];
        for score in self.images.iter().take(1).flat_map(|scores| &scores.vdp) {
            head.extend([Slopes(score.slopes).to_string(), "zero id.".into()]);
        }
        let row = |scores: &Scores| {
            let percents = |score: &VdpScore| [score.percent, score.percent_zero_identical];
            let cells = scores
                .vdp
                .iter()
                .flat_map(percents)
                .map(|percent| format!("{percent:.2} %"));
            std::iter::once(scores.image.clone()).chain(cells).collect()
        };
        aligned(head, self.images.iter().map(row))
    }
}

impl Scores {
    pub(super) fn new(path: &Path, encoding: Encoding, judgement: &Judgement) -> Self {
        Self {
            image: path.display().to_string(),
            values: match encoding {
                Encoding::Linear => "linear",
                Encoding::Encoded => "srgb",
            },
            vdp: judgement.vdp.iter().map(VdpScore::from).collect(),
            flip: judgement.flip.mean,
            flip_exposures: judgement.flip.exposures,
            rmse: judgement.rmse,
            relmse: judgement.relative_mse,
            ssim: judgement.ssim.as_ref().map(|ssim| ssim.mean),
            psnr_db: Some(judgement.psnr).filter(|psnr| psnr.is_finite()),
        }
    }
}

impl From<&VisibleDifferences> for VdpScore {
    fn from(differences: &VisibleDifferences) -> Self {
        Self {
            slopes: differences.slopes.0,
            percent: differences.percent,
            percent_zero_identical: differences.percent_zero_identical,
            mean_probability: differences.probability.mean(),
        }
    }
}

fn changed_settings(options: &Options) -> Vec<String> {
    let mut changes: Vec<_> = options
        .layer
        .iter()
        .map(|layer| format!("layer {layer}"))
        .collect();
    if options.exposure_stops.abs() > 0.0 {
        changes.push(format!("exposure {} stops", options.exposure_stops));
    }
    changes.extend(
        options
            .vdp
            .changes()
            .into_iter()
            .map(|change| format!("VDP {change}")),
    );
    if options.slopes.first() != Some(&Slopes::default()) {
        let slopes = options.slopes.iter().map(Slopes::to_string);
        changes.extend(slopes.map(|slopes| format!("VDP slope of masking {slopes}")));
    }
    if (options.flip_pixels_per_degree - flip::PIXELS_PER_DEGREE).abs() > 0.0 {
        changes.push(format!(
            "FLIP {} pixels per degree",
            options.flip_pixels_per_degree
        ));
    }
    if options.allow_nan {
        changes.push("NaN allowed".into());
    }
    changes
}

/// Four significant digits, small numbers by powers of ten.
fn significant(value: f64) -> String {
    if value.abs() < 1e-4 && value.abs() > 0.0 || value.abs() >= 1e4 {
        format!("{value:.3e}")
    } else {
        let digits = 3 - value.abs().max(1e-4).log10().floor() as i32;
        format!("{value:.*}", usize::try_from(digits).unwrap_or(0).min(7))
    }
}

/// Rows under a head in columns: the first to the left, the others to the right.
fn aligned(head: Vec<String>, rows: impl Iterator<Item = Vec<String>>) -> String {
    let rows: Vec<_> = std::iter::once(head).chain(rows).collect();
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let line = |row: &Vec<String>| {
        let cell = |(column, cell): (usize, &String)| match column {
            0 => format!("{cell:<0$}", width(0)),
            _ => format!("  {cell:>0$}", width(column)),
        };
        row.iter()
            .enumerate()
            .map(cell)
            .collect::<String>()
            .trim_end()
            .to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_significant_digits() {
        for (value, text) in [
            (0.0, "0.0000000"),
            (0.012_345_6, "0.01235"),
            (1.5, "1.500"),
            (123.456, "123.5"),
            (0.000_012_345, "1.234e-5"),
            (123_456.0, "1.235e5"),
        ] {
            assert_eq!(significant(value), text);
        }
    }

    #[test]
    fn columns_line_up() {
        let rows = [
            vec!["short".into(), "1".into()],
            vec!["é".into(), "22.5 %".into()],
        ];
        let table = aligned(vec!["name".into(), "value".into()], rows.into_iter());
        assert_eq!(table, "name    value\nshort       1\né      22.5 %");
    }
}
