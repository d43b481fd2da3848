//! The properties that the definition of the VDP demands (its section 10), one test or more each.

#![expect(
    clippy::float_cmp,
    reason = "where nothing is to be seen, the result is exactly zero"
)]

use std::f64::consts::TAU;

use eval::image::{Encoding, ImageRgb, Pair};
use eval::metrics::vdp::{Settings, SettingsError, Slopes, Viewing, VisibleDifferences, visible_differences};

const SIZE: usize = 192;

/// Linear value of the grey field on which things are shown, and its luminance in cd/m².
const GREY: f64 = 0.25;
const GREY_LUMINANCE: f64 = 0.8 + 99.2 * GREY;

/// A grey picture of linear light.
fn picture(width: usize, height: usize, mut light: impl FnMut(f64, f64) -> f64) -> ImageRgb {
    let pixel = |i: usize| [light((i % width) as f64, (i / width) as f64) as f32; 3];
    let data = (0..width * height).map(pixel).collect();
    ImageRgb {
        width,
        height,
        data,
        encoding: Encoding::Linear,
    }
}

fn square(light: impl FnMut(f64, f64) -> f64) -> ImageRgb {
    picture(SIZE, SIZE, light)
}

/// White noise within -1..1.
fn noise() -> impl FnMut() -> f64 {
    let mut state = 0x2545_F491_u32;
    move || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        f64::from(state) / f64::from(u32::MAX) * 2.0 - 1.0
    }
}

/// The picture with white noise added to its light.
fn noisy(clean: &ImageRgb, amplitude: f64) -> ImageRgb {
    let mut noise = noise();
    let mut noisy = clean.clone();
    for pixel in &mut noisy.data {
        let change = (amplitude * noise()) as f32;
        *pixel = pixel.map(|value| value + change);
    }
    noisy
}

/// A texture: many waves of all directions, about as strong in every band.
fn texture(x: f64, y: f64) -> f64 {
    let wave = |n: f64| {
        let (frequency, angle) = (0.02 * 1.25_f64.powf(n), n * 2.4);
        (TAU * frequency * (x * angle.cos() + y * angle.sin()) + n).sin()
    };
    GREY + 0.035 * (0..12).map(|n| wave(f64::from(n))).sum::<f64>()
}

fn differences(reference: &ImageRgb, test: &ImageRgb, settings: &Settings) -> VisibleDifferences {
    let pair = Pair::new(reference, test, 0.0).expect("the sizes are equal");
    let mut all = visible_differences(&pair, settings, &[Slopes::ONE]).expect("valid settings");
    all.pop().expect("one result for one slope")
}

fn compare(reference: &ImageRgb, test: &ImageRgb) -> VisibleDifferences {
    differences(reference, test, &Settings::default())
}

fn percent(reference: &ImageRgb, test: &ImageRgb) -> f64 {
    compare(reference, test).percent
}

fn largest(differences: &VisibleDifferences) -> f64 {
    f64::from(differences.probability.data.iter().copied().fold(0.0, f32::max))
}

/// Sensitivity to `frequency` cycles per pixel at an angle, for an eye adapted to the grey field:
/// section 3, written again.
fn sensitivity(size: (usize, usize), frequency: f64, degrees: f64) -> f64 {
    let ppd = 2.0 * 0.5_f64.to_radians().tan() * 0.5 * 1280.0 / 0.375;
    let area = size.0 as f64 * size.1 as f64 / (ppd * ppd);
    let a = 0.801 * (1.0 + 0.7 / GREY_LUMINANCE).powf(-0.2);
    let b = 0.3 * (1.0 + 100.0 / GREY_LUMINANCE).powf(0.15);
    let s1 = |r: f64| {
        ((3.23 * (r * r * area).powf(-0.3)).powi(5) + 1.0).powf(-0.2)
            * a
            * 0.9
            * r
            * (-b * 0.9 * r).exp()
            * (1.0 + 0.06 * (b * 0.9 * r).exp()).sqrt()
    };
    let rho = frequency * ppd;
    let rt = 0.11 * (4.0 * degrees.to_radians()).cos() + 0.89;
    250.0 * s1(rho / (0.856 * 0.5_f64.powf(0.14) * rt)).min(s1(rho))
}

/// A grating with whole periods in its picture and a crest at the first pixel.
#[derive(Clone, Copy)]
struct Grating {
    size: (usize, usize),
    cycles: (f64, f64),
    /// One over the contrast at threshold.
    sensitivity: f64,
}

impl Grating {
    /// `frequency` in cycles per pixel; `degrees` a multiple of 30.
    ///
    /// 194 cos 30° and 192 sin 30° are nearly 168 and 96, so that pictures of these sides hold whole
    /// periods of all four frequencies.
    fn new(frequency: f64, degrees: f64) -> Self {
        let near_30 = (degrees.abs() - 30.0).abs() < 1.0 || (degrees.abs() - 150.0).abs() < 1.0;
        let near_60 = (degrees.abs() - 60.0).abs() < 1.0 || (degrees.abs() - 120.0).abs() < 1.0;
        let size = (if near_30 { 194 } else { 192 }, if near_60 { 194 } else { 192 });
        let (sin, cos) = degrees.to_radians().sin_cos();
        let cycles = (
            (size.0 as f64 * frequency * cos).round(),
            (size.1 as f64 * frequency * sin).round(),
        );
        Self {
            size,
            cycles,
            sensitivity: sensitivity(size, frequency, degrees),
        }
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        let (width, height) = self.size;
        (TAU * (self.cycles.0 * x / width as f64 + self.cycles.1 * y / height as f64)).cos()
    }

    /// The change of light that gives the display a contrast of `multiple` thresholds.
    fn light(&self, multiple: f64, x: f64, y: f64) -> f64 {
        multiple / self.sensitivity * GREY_LUMINANCE / 99.2 * self.at(x, y)
    }

    /// The largest probability of seeing the grating on the grey field.
    fn largest(&self, multiple: f64) -> f64 {
        let (width, height) = self.size;
        let field = picture(width, height, |_, _| GREY);
        let test = picture(width, height, |x, y| GREY + self.light(multiple, x, y));
        largest(&compare(&field, &test))
    }
}

const CENTRES: [f64; 4] = [1.0 / 3.0, 1.0 / 6.0, 1.0 / 12.0, 1.0 / 24.0];

#[test]
fn identical_pictures_show_no_difference_at_all() {
    let picture = square(texture);
    let result = compare(&picture, &picture.clone());
    assert!(
        result
            .probability
            .data
            .iter()
            .all(|p| p.to_bits() == 0.0_f32.to_bits())
    );
    assert_eq!((result.percent, result.percent_zero_identical), (0.0, 0.0));
}

#[test]
fn noise_well_under_threshold_is_not_seen() {
    let field = square(|_, _| GREY);
    let result = compare(&field, &noisy(&field, GREY * 0.003));
    assert_eq!(result.percent, 0.0);
    let mean = result.probability.mean();
    assert!(mean > 0.0 && mean < 1e-3, "mean P {mean}");
}

#[test]
fn a_change_of_chroma_at_equal_luminance_is_not_seen() {
    let field = square(|_, _| GREY);
    let mut tinted = field.clone();
    for (index, pixel) in tinted.data.iter_mut().enumerate() {
        let change = if index % 7 < 3 { 0.2_f32 } else { -0.2 };
        *pixel = [pixel[0] + change, pixel[1] - change * 0.2126 / 0.7152, pixel[2]];
    }
    assert_eq!(percent(&field, &tinted), 0.0);
}

#[test]
fn values_above_display_white_are_equal() {
    let bright = square(|x, _| if x < 96.0 { 1.0 } else { 0.2 });
    let brighter = square(|x, _| if x < 96.0 { 50.0 + x } else { 0.2 });
    assert_eq!(largest(&compare(&bright, &brighter)), 0.0);
}

#[test]
fn a_grating_at_a_channels_centre_is_seen_as_its_contrast_over_threshold_says() {
    for frequency in CENTRES {
        for degrees in [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0] {
            let grating = Grating::new(frequency, degrees);
            let at = format!("{frequency:.3} cycles per pixel, {degrees}°");
            let [below, threshold, above] = [0.5, 1.0, 2.0].map(|m| grating.largest(m));
            assert!(below < 0.15, "half threshold: P = {below} at {at}");
            assert!(
                (0.55..=0.66).contains(&threshold),
                "threshold: P = {threshold} at {at}"
            );
            assert!(above > 0.99, "twice threshold: P = {above} at {at}");
        }
    }
}

#[test]
fn the_psychometric_slope_is_three_and_a_half() {
    for frequency in CENTRES {
        let grating = Grating::new(frequency, 0.0);
        let log_miss = |m: f64| (1.0 - grating.largest(m)).ln();
        let slope = (log_miss(1.25) / log_miss(0.8)).ln() / (1.25_f64 / 0.8).ln();
        assert!((slope - 3.5).abs() < 0.1, "slope {slope} at {frequency}");
    }
}

/// Demands that no test picture of a series is seen less than the one before, and the last seen.
fn check_rises(reference: &ImageRgb, tests: &[ImageRgb]) {
    let percents: Vec<_> = tests.iter().map(|test| percent(reference, test)).collect();
    assert!(percents.is_sorted(), "{percents:?}");
    assert!(percents.last() > percents.first(), "{percents:?}");
}

#[test]
fn more_noise_is_seen_more() {
    let clean = square(texture);
    check_rises(
        &clean,
        &[0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2].map(|a| noisy(&clean, a)),
    );
}

#[test]
fn more_blur_is_seen_more() {
    let blocks = |x: f64, y: f64| {
        if ((x / 16.0) as i32 + (y / 12.0) as i32) % 2 == 0 {
            0.1
        } else {
            0.4
        }
    };
    let sharp = square(|x, y| blocks(x, y) + 0.3 * (texture(x, y) - GREY));
    let blurred = |radius: i32| {
        let wrap = |position: f64| position.rem_euclid(SIZE as f64) as usize;
        square(|x, y| {
            let offsets = (-radius..=radius).map(f64::from);
            let taps = offsets
                .clone()
                .flat_map(|dy| offsets.clone().map(move |dx| (dx, dy)));
            let values = taps.map(|(dx, dy)| f64::from(sharp.data[wrap(y + dy) * SIZE + wrap(x + dx)][0]));
            values.sum::<f64>() / f64::from((2 * radius + 1).pow(2))
        })
    };
    check_rises(&sharp, &[0, 1, 2, 3, 4, 6].map(blurred));
}

#[test]
fn more_missing_pixels_are_seen_more() {
    let whole = square(texture);
    let with_holes = |share: f64| {
        let mut noise = noise();
        square(|x, y| {
            if noise() * 0.5 + 0.5 < share {
                0.0
            } else {
                texture(x, y)
            }
        })
    };
    check_rises(&whole, &[0.0, 0.001, 0.005, 0.02, 0.1, 0.3].map(with_holes));
}

#[test]
fn more_missing_light_sets_are_seen_more() {
    let sets = |count: i32| {
        square(|x, y| {
            let spot = |set: i32| {
                let (cx, cy) = (f64::from(set * 37 % 192), f64::from(set * 91 % 192));
                0.6 * (-((x - cx).powi(2) + (y - cy).powi(2)) / 1500.0).exp()
            };
            (0..count).map(spot).sum::<f64>()
        })
    };
    check_rises(&sets(16), &[16, 15, 14, 12, 8, 4].map(sets));
}

/// Noise that everybody sees on a flat area: a contrast of at most 8 %.
const NOISE: f64 = 0.02;

#[test]
fn a_texture_hides_noise_that_a_flat_area_shows() {
    let (flat, textured) = (square(|_, _| GREY), square(texture));
    let (on_flat, on_texture) = (
        percent(&flat, &noisy(&flat, NOISE)),
        percent(&textured, &noisy(&textured, NOISE)),
    );
    assert!(
        on_flat > 10.0 && on_texture < on_flat / 5.0,
        "{on_flat} % and {on_texture} %"
    );
}

#[test]
fn a_texture_hides_noise_beside_a_flat_area_of_the_same_picture() {
    let halves = square(|x, y| if x < 96.0 { GREY } else { texture(x, y) });
    let result = compare(&halves, &noisy(&halves, NOISE));
    // The borders between the halves, where one blurs into the other, are left out.
    let mean = |columns: std::ops::Range<usize>| {
        let rows = result.probability.data.chunks_exact(SIZE);
        rows.flat_map(|row| &row[columns.clone()])
            .map(|&p| f64::from(p > 0.75))
            .sum::<f64>()
    };
    let (flat, textured) = (mean(16..80), mean(112..176));
    assert!(
        flat > 500.0 && textured < flat / 5.0,
        "{flat} and {textured} visible pixels"
    );
}

/// The multiple of its threshold on grey at which `test` is seen with P = 0.5 over a strong mask.
fn elevation(test: Grating, mask: Grating) -> f64 {
    let (width, height) = test.size;
    let masked = |x: f64, y: f64| GREY + mask.light(30.0, x, y);
    let reference = picture(width, height, masked);
    let seen = |multiple: f64| {
        let shown = picture(width, height, |x, y| masked(x, y) + test.light(multiple, x, y));
        largest(&compare(&reference, &shown)) > 0.5
    };
    let (mut low, mut high) = (0.1_f64, 100.0_f64);
    for _ in 0..9 {
        let middle = (low * high).sqrt();
        *(if seen(middle) { &mut high } else { &mut low }) = middle;
    }
    high
}

#[test]
fn a_strong_grating_masks_its_like_and_not_what_is_unlike() {
    let mask = Grating::new(1.0 / 6.0, 0.0);
    let alike = elevation(Grating::new(1.0 / 6.0, 0.0), mask);
    let across = elevation(Grating::new(1.0 / 6.0, 90.0), mask);
    let two_octaves_away = elevation(Grating::new(1.0 / 24.0, 0.0), mask);
    assert!(alike > 4.0, "alike: {alike}");
    assert!((0.5..2.0).contains(&across), "at 90 degrees: {across}");
    assert!(
        (0.5..2.0).contains(&two_octaves_away),
        "two octaves away: {two_octaves_away}"
    );
}

#[test]
fn fine_noise_fades_with_viewing_distance() {
    let field = square(|_, _| GREY);
    let noisy = noisy(&field, NOISE);
    let percents = [0.35, 0.5, 0.7, 1.0].map(|distance| {
        let viewing = Viewing {
            distance,
            ..Viewing::default()
        };
        differences(
            &field,
            &noisy,
            &Settings {
                viewing,
                ..Settings::default()
            },
        )
        .percent
    });
    assert!(percents.is_sorted_by(|near, far| near > far), "{percents:?}");
}

#[test]
fn noise_of_one_contrast_fades_with_luminance() {
    let field = square(|_, _| GREY);
    let noisy = noisy(&field, 0.06);
    let percents = [100.0, 10.0, 1.0, 0.1].map(|peak| {
        let viewing = Viewing {
            peak,
            black: 0.008 * peak,
            ..Viewing::default()
        };
        differences(
            &field,
            &noisy,
            &Settings {
                viewing,
                ..Settings::default()
            },
        )
        .percent
    });
    assert!(percents.is_sorted_by(|bright, dim| bright > dim), "{percents:?}");
}

#[test]
fn swapping_pictures_of_one_mean_changes_nothing() {
    let a = square(texture);
    let mut b = a.clone();
    b.data.rotate_left(SIZE * 5 + 3);
    let (forth, back) = (compare(&a, &b), compare(&b, &a));
    assert!(
        (forth.percent - back.percent).abs() < 0.01,
        "{} {}",
        forth.percent,
        back.percent
    );
    for (forth, back) in forth.probability.data.iter().zip(&back.probability.data) {
        assert!((forth - back).abs() < 2e-4, "{forth} {back}");
    }
}

#[test]
fn a_step_of_brightness_everywhere_is_the_known_blind_spot() {
    let (dark, bright) = (square(|_, _| 0.2), square(|_, _| 0.4));
    assert_eq!(percent(&dark, &bright), 0.0);
}

#[test]
fn zero_identical_forgives_pixels_of_equal_luminance_only() {
    let reference = square(texture);
    let mut test = reference.clone();
    for pixel in test.data.iter_mut().skip(90 * SIZE).take(12 * SIZE) {
        *pixel = [0.6; 3];
    }
    let plain = compare(&reference, &test);
    assert!(
        plain.percent > plain.percent_zero_identical + 1.0,
        "{}",
        plain.percent
    );
    let changed_share = 100.0 * 12.0 / SIZE as f64;
    assert!((plain.percent_zero_identical - changed_share).abs() < 0.01);

    let settings = Settings {
        zero_identical: true,
        ..Settings::default()
    };
    let forgiven = differences(&reference, &test, &settings);
    assert_eq!(forgiven.percent, plain.percent_zero_identical);
    assert_eq!(forgiven.probability.data[0], 0.0);
}

#[test]
fn luminances_within_a_ten_thousandth_of_a_candela_count_as_identical() {
    let reference = square(|_, _| GREY);
    let with_band = |rest_luminance: f64| {
        square(|_, y| {
            if y < 96.0 {
                0.6
            } else {
                GREY + rest_luminance / 99.2
            }
        })
    };
    let percent = |test: ImageRgb| compare(&reference, &test).percent_zero_identical;
    let (nearer, farther) = (percent(with_band(0.5e-4)), percent(with_band(2e-4)));
    assert!(
        nearer <= 50.0 && farther > nearer + 1.0,
        "{nearer} % and {farther} %"
    );
}

#[test]
fn several_slopes_at_once_give_what_each_gives_alone() {
    let clean = square(texture);
    let noisy = noisy(&clean, 0.1);
    let pair = Pair::new(&clean, &noisy, 0.0).expect("the sizes are equal");
    let run =
        |slopes: &[Slopes]| visible_differences(&pair, &Settings::default(), slopes).expect("valid settings");
    let together = run(&Slopes::PUBLISHED);
    let alone: Vec<_> = Slopes::PUBLISHED
        .iter()
        .flat_map(|&slopes| run(&[slopes]))
        .collect();
    assert_eq!(together, alone);
    assert!(
        together[0].percent < together[1].percent,
        "a lower slope masks less"
    );
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let field = square(|_, _| GREY);
    let pair = Pair::new(&field, &field, 0.0).expect("the sizes are equal");
    let check = |viewing: Viewing, slope: f64| {
        let settings = Settings {
            viewing,
            ..Settings::default()
        };
        visible_differences(&pair, &settings, &[Slopes([slope; 6])]).expect_err("nonsense")
    };
    let viewing = Viewing::default();
    assert!(matches!(
        check(
            Viewing {
                black: 0.0,
                ..viewing
            },
            1.0
        ),
        SettingsError::Display { .. }
    ));
    assert!(matches!(
        check(Viewing { peak: 0.5, ..viewing }, 1.0),
        SettingsError::Display { .. }
    ));
    assert!(matches!(
        check(
            Viewing {
                distance: f64::NAN,
                ..viewing
            },
            1.0
        ),
        SettingsError::Distance { .. }
    ));
    assert!(matches!(
        check(
            Viewing {
                pixels_per_degree: Some(0.0),
                ..viewing
            },
            1.0
        ),
        SettingsError::Distance { .. }
    ));
    assert_eq!(check(viewing, -1.0), SettingsError::Slope(-1.0));
}

#[test]
fn odd_sizes_work() {
    for (width, height) in [(1, 1), (7, 1), (1, 9), (31, 53), (101, 64)] {
        let reference = picture(width, height, texture);
        let result = compare(&reference, &noisy(&reference, 0.2));
        assert!(result.probability.data.iter().all(|p| (0.0..=1.0).contains(p)));
    }
}

/// A check of the pictures themselves, whose sides must hold whole periods.
#[test]
fn the_gratings_have_the_frequency_and_angle_that_they_are_named_for() {
    for frequency in CENTRES {
        for degrees in [-60.0, -30.0, 30.0, 60.0] {
            let Grating { size, cycles, .. } = Grating::new(frequency, degrees);
            let (fx, fy) = (cycles.0 / size.0 as f64, cycles.1 / size.1 as f64);
            assert!((fx.hypot(fy) / frequency - 1.0).abs() < 1e-3);
            assert!((fy.atan2(fx) - degrees.to_radians()).abs() < 1e-3);
        }
    }
}
