//! Pictures as `eval compare` judges them, and limits for each of its numbers.

use std::{fmt::Write as _, fs, path::Path, process::Command};

use serde_json::Value;

use crate::{pixels::Pixels, programs::program};

/// How far a picture is from its reference, by every metric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scores {
    /// VDP(P > 75 %), percent of the pixels.
    pub vdp_percent: f64,
    /// Mean FLIP.
    pub flip: f64,
    /// Root of the mean square error of linear light, or of sRGB codes.
    pub rmse: f64,
    /// Mean square error relative to the reference.
    pub relmse: f64,
    /// Structural similarity, 1 at best.
    pub ssim: f64,
    /// Ratio of white to the error of what is displayed, dB.
    pub psnr_db: f64,
}

/// The worst scores with which a picture is still the same as its reference.
#[derive(Debug, Clone, Copy)]
pub struct ScoreLimits(pub Scores);

impl Scores {
    /// Lets `eval compare` judge a picture, with its default settings.
    #[track_caller]
    pub fn of(picture: &Path, reference: &Path) -> Self {
        let output = Command::new(program("eval"))
            .args(["compare", "--json"])
            .args([reference, picture])
            .output()
            .expect("eval runs");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "eval compare: {errors}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("the report is JSON");
        let number = |path: &str| {
            let value = &report["images"][0];
            let value = value.pointer(path).and_then(Value::as_f64);
            value.unwrap_or_else(|| panic!("{path} is not in {report:#}"))
        };
        let is_equal = report["images"][0]["psnr_db"].is_null();
        Self {
            vdp_percent: number("/vdp/0/percent"),
            flip: number("/flip"),
            rmse: number("/rmse"),
            relmse: number("/relmse"),
            ssim: number("/ssim"),
            psnr_db: if is_equal {
                f64::INFINITY
            } else {
                number("/psnr_db")
            },
        }
    }
}

impl ScoreLimits {
    /// How many times beyond its limit each metric is; below one is within. Of SSIM, what it lacks to
    /// one is compared; of PSNR, the error that it stands for.
    pub fn excess(&self, scores: &Scores) -> [(&'static str, f64); 6] {
        let Self(limit) = self;
        [
            ("VDP", scores.vdp_percent / limit.vdp_percent),
            ("FLIP", scores.flip / limit.flip),
            ("RMSE", scores.rmse / limit.rmse),
            ("relMSE", scores.relmse / limit.relmse),
            ("SSIM", (1.0 - scores.ssim) / (1.0 - limit.ssim)),
            ("PSNR", 10_f64.powf((limit.psnr_db - scores.psnr_db) / 20.0)),
        ]
    }

    /// The largest of [`Self::excess`].
    pub fn worst_excess(&self, scores: &Scores) -> f64 {
        self.excess(scores)
            .iter()
            .map(|(_, excess)| *excess)
            .fold(0.0, f64::max)
    }

    /// A line for people: how many times beyond its limit each metric is.
    pub fn line(&self, scores: &Scores) -> String {
        let mut line = String::new();
        for (name, excess) in self.excess(scores) {
            let _ = write!(line, "  {name} {excess:.3}");
        }
        line
    }
}

/// Writes red, green and blue of a picture as PFM, each pixel from where `place` says: for faults that
/// `oiiotool` cannot make.
#[track_caller]
pub fn write_rearranged(pixels: &Pixels, place: impl Fn(usize, usize) -> (usize, usize), file: &Path) {
    let channels = ["R", "G", "B"].map(|name| pixels.channel(name));
    // A PFM begins with its lowest row.
    let rows = (0..pixels.height).rev();
    let places = rows.flat_map(|y| (0..pixels.width).map(move |x| (x, y)));
    let values = places.flat_map(|(x, y)| {
        let (x, y) = place(x, y);
        channels.map(|channel| channel[y * pixels.width + x].to_le_bytes())
    });
    let mut bytes = format!("PF\n{} {}\n-1.0\n", pixels.width, pixels.height).into_bytes();
    bytes.extend(values.flatten());
    fs::write(file, bytes).expect("a file in a temporary folder");
}
