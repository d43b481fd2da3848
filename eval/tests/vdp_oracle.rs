//! The VDP again, written down as its definition reads: complex f64, one whole transform per map.
//!
//! Slow, and independent of the real one's shortcuts (half spectra, differences instead of two
//! pictures, f32, columns left out), which have to give the same.

use std::f64::consts::PI;

use eval::image::{Encoding, ImageRgb, Pair};
use eval::metrics::vdp::{Settings, Slopes, visible_differences};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

/// A complex map and its transforms, `[height][width]`.
#[derive(Clone)]
struct Map {
    width: usize,
    height: usize,
    data: Vec<Complex64>,
}

impl Map {
    fn real(width: usize, height: usize, data: impl Iterator<Item = f64>) -> Self {
        Self {
            width,
            height,
            data: data.map(Complex64::from).collect(),
        }
    }

    fn transposed(&self) -> Self {
        let (width, height) = (self.height, self.width);
        let at = |i: usize| self.data[(i % width) * self.width + i / width];
        Self {
            width,
            height,
            data: (0..width * height).map(at).collect(),
        }
    }

    fn transform_rows(mut self, inverse: bool) -> Self {
        let mut planner = FftPlanner::new();
        let fft = if inverse {
            planner.plan_fft_inverse(self.width)
        } else {
            planner.plan_fft_forward(self.width)
        };
        fft.process(&mut self.data);
        self
    }

    fn transform(&self, inverse: bool) -> Self {
        let rows = self.clone().transform_rows(inverse);
        rows.transposed().transform_rows(inverse).transposed()
    }

    /// Multiplies by a function of (fx, fy) in cycles per pixel; where the vertical Nyquist frequency
    /// may have either sign, by the mean of both.
    fn times(&self, gain: impl Fn(f64, f64) -> f64) -> Self {
        let signed = |index: usize, count: usize| {
            let index = if 2 * index <= count {
                index as f64
            } else {
                index as f64 - count as f64
            };
            index / count as f64
        };
        let value = |(i, value): (usize, &Complex64)| {
            let (x, y) = (i % self.width, i / self.width);
            let (fx, fy) = (signed(x, self.width), signed(y, self.height));
            let mirrored = if 2 * y == self.height { -fy } else { fy };
            value * f64::midpoint(gain(fx, fy), gain(fx, mirrored))
        };
        Self {
            data: self.data.iter().enumerate().map(value).collect(),
            ..*self
        }
    }

    /// The real part of the inverse transform.
    fn image(&self) -> Vec<f64> {
        let scale = (self.width * self.height) as f64;
        self.transform(true)
            .data
            .iter()
            .map(|value| value.re / scale)
            .collect()
    }
}

fn half(k: i32) -> f64 {
    0.5_f64.powi(k)
}

fn mesa(k: i32, f: f64) -> f64 {
    let tw = 2.0 / 3.0 * half(k);
    if f < half(k) - tw / 2.0 {
        1.0
    } else if f > half(k) + tw / 2.0 {
        0.0
    } else {
        f64::midpoint(1.0, (PI * (f - half(k) + tw / 2.0) / tw).cos())
    }
}

fn base(f: f64) -> f64 {
    let end = half(5) + half(5) / 3.0;
    if f < end {
        (-f * f / (2.0 * (end / 3.0).powi(2))).exp()
    } else {
        0.0
    }
}

/// Band k = 1..=6.
fn band(k: i32, f: f64) -> f64 {
    match k {
        6 => base(f),
        5 => mesa(4, f) - base(f),
        _ => mesa(k - 1, f) - mesa(k, f),
    }
}

fn fan(l: i32, fx: f64, fy: f64) -> f64 {
    if fx == 0.0 && fy == 0.0 {
        return 0.0;
    }
    let centre = f64::from(l - 1) * 30.0 - 90.0;
    let angle = (fy.atan2(fx).to_degrees() - centre).rem_euclid(180.0);
    let distance = angle.min(180.0 - angle);
    if distance <= 30.0 {
        f64::midpoint(1.0, (PI * distance / 30.0).cos())
    } else {
        0.0
    }
}

fn luminance(image: &ImageRgb) -> Vec<f64> {
    let y = |p: &[f32; 3]| {
        let [r, g, b] = p.map(|value| f64::from(value).clamp(0.0, 1.0));
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    image.data.iter().map(|pixel| 0.8 + 99.2 * y(pixel)).collect()
}

fn sensitivity(rho: f64, theta: f64, la: f64, area: f64) -> f64 {
    if rho == 0.0 {
        return 0.0;
    }
    let a = 0.801 * (1.0 + 0.7 / la).powf(-0.2);
    let b = 0.3 * (1.0 + 100.0 / la).powf(0.15);
    let s1 = |r: f64| {
        ((3.23 * (r * r * area).powf(-0.3)).powi(5) + 1.0).powf(-0.2)
            * (a * 0.9 * r)
            * (-b * 0.9 * r).exp()
            * (1.0 + 0.06 * (b * 0.9 * r).exp()).sqrt()
    };
    let ra = 0.856 * 0.5_f64.powf(0.14);
    let rt = 0.11 * (4.0 * theta).cos() + 0.89;
    250.0 * s1(rho / (ra * rt)).min(s1(rho))
}

/// The probability of seeing a difference at each pixel.
fn probabilities(reference: &ImageRgb, test: &ImageRgb, slopes: [f64; 6], blur: bool) -> Vec<f64> {
    let (width, height) = (reference.width, reference.height);
    let luminances = [reference, test].map(luminance);
    let la = luminances[0].iter().sum::<f64>() / luminances[0].len() as f64;
    let response = |l: f64| l / (l + (12.6 * l).powf(0.63));
    let divisor = 0.37 * response(la) * (1.0 - response(la));
    let ppd = 2.0 * 0.5_f64.to_radians().tan() * 0.5 * 1280.0 / 0.375;
    let area = width as f64 * height as f64 / ppd.powi(2);
    let spectra = luminances.map(|luminances| {
        let contrast = luminances
            .into_iter()
            .map(|l| (response(l) - response(la)) / divisor);
        let map = Map::real(width, height, contrast).transform(false);
        map.times(|fx, fy| sensitivity(fx.hypot(fy) * ppd, fy.atan2(fx), la, area))
    });

    let mut miss = vec![1.0; width * height];
    for k in 1..=6 {
        for l in 1..=(if k == 6 { 1 } else { 6 }) {
            let oriented = |fx: f64, fy: f64| if k == 6 { 1.0 } else { fan(l, fx, fy) };
            let signals = spectra.each_ref().map(|spectrum| {
                spectrum
                    .times(|fx, fy| band(k, fx.hypot(fy)) * oriented(fx, fy))
                    .image()
            });
            let thresholds = signals.each_ref().map(|signal| {
                let (k1, k2) = (6.0_f64.powf(1.0 - 1.0 / 0.3), 6.0_f64.powf(1.0 / 0.3));
                let slope = slopes[k as usize - 1];
                let te = |m: &f64| (1.0 + (k1 * (k2 * m.abs()).powf(slope)).powi(4)).powf(0.25);
                let te: Vec<f64> = signal.iter().map(te).collect();
                if !blur {
                    return te;
                }
                let low_pass = |f: f64| if k == 6 { base(f) } else { mesa(k - 1, f) };
                let spectrum = Map::real(width, height, te.into_iter()).transform(false);
                spectrum.times(|fx, fy| low_pass(fx.hypot(fy))).image()
            });
            for (pixel, miss) in miss.iter_mut().enumerate() {
                let threshold = thresholds[0][pixel].max(1.0).min(thresholds[1][pixel].max(1.0));
                let difference = (signals[1][pixel] - signals[0][pixel]).abs();
                *miss *= (-(difference / threshold).powf(3.5)).exp();
            }
        }
    }
    miss.into_iter().map(|miss| 1.0 - miss).collect()
}

/// A picture of edges, gradients, colours, deep black and values above white.
fn scene(width: usize, height: usize, noise: f32) -> ImageRgb {
    let mut state = 88_172_645_u32;
    let pixel = |i: usize| {
        let (x, y) = (
            (i % width) as f32 / width as f32,
            (i / width) as f32 / height as f32,
        );
        let light = if (x - 0.4).hypot(y - 0.5) < 0.3 {
            0.9 + x
        } else {
            0.3 * y * y
        };
        [1.0, 0.8, 0.6].map(|tint| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            light * tint + noise * (state as f32 / u32::MAX as f32 - 0.5)
        })
    };
    let data = (0..width * height).map(pixel).collect();
    ImageRgb {
        width,
        height,
        data,
        encoding: Encoding::Linear,
    }
}

fn check((width, height): (usize, usize), slopes: Slopes, phase_uncertainty: bool) {
    let (reference, test) = (scene(width, height, 0.0), scene(width, height, 0.08));
    let pair = Pair::new(&reference, &test, 0.0).expect("the sizes are equal");
    let settings = Settings {
        phase_uncertainty,
        ..Settings::default()
    };
    let ours = visible_differences(&pair, &settings, &[slopes]).expect("valid settings");
    let expected = probabilities(&reference, &test, slopes.0, phase_uncertainty);
    let middling = expected.iter().filter(|p| (0.1..0.9).contains(*p)).count();
    assert!(
        middling > expected.len() / 50,
        "a picture on which everything is clear proves little"
    );
    for (pixel, (ours, expected)) in ours[0].probability.data.iter().zip(&expected).enumerate() {
        let error = (f64::from(*ours) - expected).abs();
        assert!(error < 1e-4, "{ours} instead of {expected} at pixel {pixel}");
    }
}

#[test]
fn probabilities_agree_with_the_plain_formulas_on_even_sizes() {
    check((96, 64), Slopes::ONE, true);
}

#[test]
fn probabilities_agree_with_the_plain_formulas_on_odd_sizes() {
    check((61, 45), Slopes::ONE, true);
}

#[test]
fn probabilities_agree_with_the_plain_formulas_for_other_slopes() {
    check((60, 50), Slopes::NINE_TENTHS, true);
    check((50, 61), Slopes::PER_BAND, true);
}

#[test]
fn probabilities_agree_with_the_plain_formulas_without_phase_uncertainty() {
    check((64, 48), Slopes::ONE, false);
}
