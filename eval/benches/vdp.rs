//! How long the VDP of a 1024 × 768 picture takes; it runs on one core.

use criterion::{Criterion, criterion_group, criterion_main};
use eval::image::{Encoding, ImageRgb, Pair};
use eval::metrics::vdp::{Settings, Slopes, visible_differences};

/// Waves and blocks, with noise of a given amplitude.
fn picture(noise: f32) -> ImageRgb {
    let (width, height) = (1024, 768);
    let mut random = 1_u32;
    let pixel = |index: usize| {
        let (x, y) = (index % width, index / width);
        random ^= random << 13;
        random ^= random >> 17;
        random ^= random << 5;
        let waves = 0.3 + 0.1 * (x as f32 * 0.05).sin() * (y as f32 * 0.11).cos();
        let block = if (x / 64 + y / 48).is_multiple_of(2) {
            0.2
        } else {
            0.0
        };
        [waves + block + noise * (random as f32 / u32::MAX as f32 - 0.5); 3]
    };
    let data = (0..width * height).map(pixel).collect();
    ImageRgb {
        width,
        height,
        data,
        encoding: Encoding::Linear,
    }
}

fn vdp(criterion: &mut Criterion) {
    let (reference, image) = (picture(0.0), picture(0.1));
    let pair = Pair::new(&reference, &image, 0.0).expect("both are of one size");
    let mut group = criterion.benchmark_group("vdp_1024x768");
    group.sample_size(10);
    let settings = Settings::default();
    group.bench_function("default", |bencher| {
        bencher.iter(|| visible_differences(&pair, &settings, &[Slopes::ONE]));
    });
    group.bench_function("all_published_slopes", |bencher| {
        bencher.iter(|| visible_differences(&pair, &settings, &Slopes::PUBLISHED));
    });
}

criterion_group!(benches, vdp);
criterion_main!(benches);
