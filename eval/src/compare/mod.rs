//! The subcommand `compare`: files in, numbers and maps out.

mod maps;
mod report;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use rayon::prelude::*;

pub use self::report::Report;

use self::report::Scores;
use crate::image::{ImageRgb, NonFinite, Pair};
use crate::image_io;
use crate::metrics::flip::{Flip, flip};
use crate::metrics::rmse::{psnr, relative_mse, rmse};
use crate::metrics::ssim::{Ssim, ssim};
use crate::metrics::vdp::{self, Slopes, VisibleDifferences, visible_differences};

/// What to compare, and how.
#[derive(Debug, Clone)]
pub struct Options {
    /// The reference.
    pub gold: PathBuf,
    /// The pictures to judge by it.
    pub images: Vec<PathBuf>,
    /// The layer of EXR files; none for the picture itself.
    pub layer: Option<String>,
    /// Whether NaN counts as 0 and infinity as the largest half-float, or is an error.
    pub allow_nan: bool,
    /// Exposure of linear light for VDP, SSIM and PSNR.
    pub exposure_stops: f64,
    /// The folder for maps, if they are wanted.
    pub maps: Option<PathBuf>,
    /// Viewing conditions of the VDP.
    pub vdp: vdp::Settings,
    /// Slopes of masking to run the VDP with; at least one, the first is the main one.
    pub slopes: Vec<Slopes>,
    /// Pixels per degree of FLIP.
    pub flip_pixels_per_degree: f64,
}

/// All metrics of one pair, with their maps.
struct Judgement {
    vdp: Vec<VisibleDifferences>,
    flip: Flip,
    ssim: Option<Ssim>,
    rmse: f64,
    relative_mse: f64,
    psnr: f64,
}

/// Compares every image with the gold one, and writes the maps that are asked for.
pub fn run(options: &Options) -> anyhow::Result<Report> {
    let gold = read(&options.gold, options)?;
    let names = maps::names(&options.images);
    let judge = |(path, name): (&PathBuf, String)| -> anyhow::Result<Scores> {
        let image = read(path, options)?;
        let pair = Pair::new(&gold, &image, options.exposure_stops).with_context(|| {
            format!(
                "cannot compare {} with {}",
                path.display(),
                options.gold.display()
            )
        })?;
        let judgement = Judgement::of(&pair, options)?;
        if let Some(folder) = &options.maps {
            maps::write(folder, &name, &pair, &judgement)?;
        }
        Ok(Scores::new(path, pair.encoding(), &judgement))
    };
    let scores = options
        .images
        .par_iter()
        .zip(names)
        .map(judge)
        .collect::<anyhow::Result<_>>()?;
    Ok(Report::new(options, &gold, scores))
}

/// Reads a picture and refuses values that are not numbers, unless they are allowed.
fn read(path: &Path, options: &Options) -> anyhow::Result<ImageRgb> {
    let image = image_io::read(path, options.layer.as_deref())?;
    match image.non_finite() {
        Some(NonFinite {
            nan,
            infinite,
            first: (x, y),
        }) if !options.allow_nan => bail!(
            "{} has {nan} pixels with NaN and {infinite} with infinite values, the first at column {x}, \
             row {y} (from 0 at the top left); mend what wrote it, or pass --allow-nan to count NaN as 0 \
             and infinity as 65504",
            path.display()
        ),
        _ => Ok(image.with_finite_values()),
    }
}

impl Judgement {
    fn of(pair: &Pair<'_>, options: &Options) -> Result<Self, vdp::SettingsError> {
        let (vdp, flip) = rayon::join(
            || visible_differences(pair, &options.vdp, &options.slopes),
            || flip(pair, options.flip_pixels_per_degree),
        );
        let shown = pair.encoded();
        Ok(Self {
            vdp: vdp?,
            flip,
            ssim: ssim(&shown),
            rmse: rmse(pair),
            relative_mse: relative_mse(pair),
            psnr: psnr(&shown),
        })
    }
}
