//! Agreement with evaluators from outside, on pictures made here.
//!
//! The numbers that they gave (flip-evaluator 1.7, scikit-image 0.26.0) are written down, so that
//! they count where no Python is installed; where `python3` has these packages, they are asked
//! again.

use std::process::Command;

use eval::image::{Encoding, ImageRgb, Pair};
use eval::metrics::flip::{self, flip};
use eval::metrics::rmse::{psnr, rmse};
use eval::metrics::ssim::ssim;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;
const LAST_COLUMN: i32 = 95;

/// Colours over a gradient with a disc and stripes, in 256 codes; the same on every machine, since
/// only integers decide.
fn codes(x: i32, y: i32) -> [i32; 3] {
    let disc = (x - 30).pow(2) + (y - 30).pow(2) < 400;
    let stripes = x > 60 && (x / 3 + y / 5) % 2 == 0;
    let [r, g, b] = [x * 2 + 20, y * 3 + 30, 200 - x - y];
    match (disc, stripes) {
        (true, _) => [240, 90, 40],
        (_, true) => [r / 3, g, b / 2],
        _ => [r, g, b],
    }
}

/// What is done to a picture.
#[derive(Clone, Copy, Debug)]
enum Change {
    Noise,
    Shift,
    Darker,
    Tint,
}

fn changed(change: Option<Change>, x: i32, y: i32) -> [i32; 3] {
    let noise = ((x * 7919 + y * 104_729 + x * x * y * 31) % 61 - 30).abs();
    match change {
        None => codes(x, y),
        Some(Change::Noise) => codes(x, y).map(|code| code + noise - 15),
        Some(Change::Shift) => codes((x + 1).min(LAST_COLUMN), y),
        Some(Change::Darker) => codes(x, y).map(|code| code * 9 / 10),
        Some(Change::Tint) => {
            let [r, g, b] = codes(x, y);
            [r + 12, g, b - 12]
        }
    }
}

fn picture(encoding: Encoding, value: impl Fn(i32, i32) -> [f32; 3]) -> ImageRgb {
    let small = |n: usize| i32::try_from(n).expect("a picture is small");
    let pixel = |i: usize| value(small(i % WIDTH), small(i / WIDTH));
    let data = (0..WIDTH * HEIGHT).map(pixel).collect();
    ImageRgb {
        width: WIDTH,
        height: HEIGHT,
        data,
        encoding,
    }
}

fn ldr(change: Option<Change>) -> ImageRgb {
    let code = |code: i32| code.clamp(0, 255) as f32 / 255.0;
    picture(Encoding::Encoded, |x, y| changed(change, x, y).map(code))
}

/// The codes as light, 64 times as bright inside the disc.
fn hdr(change: Option<Change>) -> ImageRgb {
    let light = |code: i32, gain: f32| (code.max(0) as f32 / 128.0).powi(2) * gain;
    picture(Encoding::Linear, |x, y| {
        let gain = if (x - 30).pow(2) + (y - 30).pow(2) < 400 {
            64.0
        } else {
            1.0
        };
        changed(change, x, y).map(|code| light(code, gain))
    })
}

/// Scores of each changed picture by a Python function `score(reference, image)`; none, and a line
/// on stderr, where `python3` lacks the module that it needs.
fn ask_python(module: &str, score: &str, reference: &ImageRgb, images: &[ImageRgb; 4]) -> Option<Vec<f64>> {
    let import = Command::new("python3")
        .args(["-c", &format!("import {module}")])
        .output();
    if !import.is_ok_and(|output| output.status.success()) {
        skipped(module);
        return None;
    }
    let folder = tempfile::tempdir().expect("a folder for pictures");
    let write = |(index, image): (usize, &ImageRgb)| {
        let path = folder.path().join(index.to_string());
        let values = image.data.as_flattened().iter();
        let bytes: Vec<u8> = values.flat_map(|value| value.to_le_bytes()).collect();
        std::fs::write(&path, bytes).expect("writing a picture");
        path
    };
    let paths = std::iter::once(reference).chain(images).enumerate().map(write);
    let whole = format!(
        "import sys, numpy as np\n\
         import {module}\n\
         {score}\n\
         load = lambda path: np.fromfile(path, '<f4').reshape({HEIGHT}, {WIDTH}, 3)\n\
         reference, *images = map(load, sys.argv[1:])\n\
         for image in images: print(score(reference, image))"
    );
    let output = Command::new("python3").args(["-c", &whole]).args(paths).output();
    let output = output.expect("python3 was there a moment ago");
    let text = String::from_utf8_lossy(&output.stdout);
    let scores: Option<Vec<f64>> = text.lines().map(|line| line.parse().ok()).collect();
    let all = scores.filter(|scores| scores.len() == images.len());
    Some(all.unwrap_or_else(|| panic!("{text}{}", String::from_utf8_lossy(&output.stderr))))
}

#[expect(clippy::print_stderr, reason = "a comparison that is left out says so")]
fn skipped(module: &str) {
    eprintln!("SKIPPED: asking {module} again; python3 does not have it");
}

/// A metric and what it has to agree with.
struct Outside {
    module: &'static str,
    /// Python that defines `score(reference, image)`.
    score: &'static str,
    /// What it gave for noise, shift, darkening and tint.
    recorded: [f64; 4],
    tolerance: f64,
}

impl Outside {
    /// Compares our values with those written down and, if possible, with those fetched now.
    fn check(&self, picture: fn(Option<Change>) -> ImageRgb, ours: impl Fn(&Pair<'_>) -> f64) {
        let changes = [Change::Noise, Change::Shift, Change::Darker, Change::Tint];
        let (reference, images) = (picture(None), changes.map(|change| picture(Some(change))));
        let now = ask_python(self.module, self.score, &reference, &images);
        for (index, image) in images.iter().enumerate() {
            let ours = ours(&Pair::new(&reference, image, 0.0).expect("one size"));
            let (recorded, now) = (self.recorded[index], now.as_ref().map(|now| now[index]));
            for outside in [Some(recorded), now].into_iter().flatten() {
                let error = (ours - outside).abs();
                let what = changes[index];
                assert!(
                    error < self.tolerance,
                    "{what:?}: {ours}, {} {outside}",
                    self.module
                );
            }
        }
    }
}

#[test]
fn ldr_flip_agrees_with_the_reference_evaluator() {
    let outside = Outside {
        module: "flip_evaluator",
        score: "score = lambda a, b: flip_evaluator.evaluate(a, b, 'LDR', applyMagma=False)[1]",
        recorded: [0.064_858, 0.123_445, 0.323_574, 0.197_412],
        tolerance: 2e-5,
    };
    outside.check(ldr, |pair| flip(pair, flip::PIXELS_PER_DEGREE).mean);
}

#[test]
fn hdr_flip_agrees_with_the_reference_evaluator() {
    let outside = Outside {
        module: "flip_evaluator",
        score: "score = lambda a, b: flip_evaluator.evaluate(a, b, 'HDR', applyMagma=False)[1]",
        recorded: [0.097_300, 0.156_234, 0.278_060, 0.314_816],
        tolerance: 2e-5,
    };
    outside.check(hdr, |pair| flip(pair, flip::PIXELS_PER_DEGREE).mean);
}

#[test]
fn ssim_agrees_with_scikit_image() {
    let outside = Outside {
        module: "skimage.metrics",
        score: "luma = lambda rgb: rgb.astype(float) @ [0.2126, 0.7152, 0.0722]\n\
                score = lambda a, b: skimage.metrics.structural_similarity(luma(a), luma(b),\
                data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False)",
        recorded: [0.670_253, 0.761_090, 0.991_160, 0.999_875],
        tolerance: 2e-5,
    };
    outside.check(ldr, |pair| ssim(pair).expect("more than one window").mean);
}

#[test]
fn psnr_and_rmse_agree_with_scikit_image() {
    let outside = Outside {
        module: "skimage.metrics",
        score: "score = lambda a, b: skimage.metrics.peak_signal_noise_ratio(a.astype(float),\
                b.astype(float), data_range=1.0)",
        recorded: [29.363_287, 19.091_479, 25.758_046, 28.308_091],
        tolerance: 1e-6,
    };
    outside.check(ldr, psnr);
    outside.check(ldr, |pair| -20.0 * rmse(pair).log10());
}
