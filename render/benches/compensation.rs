//! Bounded VPLs and what short rays put back, at several bounds: agreement with the path tracer, noise, cost.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a benchmark reports")]

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use embree4_sys::FlushDenormals;
use glam::Vec3;
use rayon::prelude::*;
use render::{
    gbuffer::{GBuffer, Vec3Lanes, trace_aovs},
    intersect::TracedScene,
    light::{LightSampler, luminance},
    path::{Through, path_trace},
    scene::{ImageSize, LoadOptions, load},
    settings::{Algorithm, LightPoints, Settings},
    vpl::{Compensation, Gather, GeometryBound, automatic_bound, trace_sets},
};

const SIZE: ImageSize = ImageSize {
    width: 48,
    height: 36,
};
/// Independent frames, so that the mean has a known error.
const SEEDS: u64 = 32;
/// Paths for each pixel of the reference.
const SPP: u32 = 1024;

fn main() {
    // `cargo test` runs benchmarks, too, and needs no figures.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let options = LoadOptions {
        scenes_dir: std::env::var_os("GRIDLIGHT_SCENES")
            .map_or_else(|| root.join("../shared/scenes"), PathBuf::from),
    };
    println!(
        "| Scene | Bound, of the automatic one | Put back | Mean, of the paths' | Relative variance | Rays, of the gather's |"
    );
    println!("| --- | --: | --: | --: | --: | --: |");
    for name in ["cornell-box/cornell-box", "sibenik", "nave/nave"] {
        let file = root.join("scenes").join(name).with_extension("toml");
        match load(&file, &options) {
            Ok(loaded) => bench_scene(name, loaded.scene),
            Err(error) => eprintln!("{name} is skipped: {error}"),
        }
    }
}

fn bench_scene(name: &str, scene: render::scene::Scene) {
    let scene = match TracedScene::build(scene) {
        Ok(scene) => scene,
        Err(error) => return eprintln!("{name} is skipped: {error}"),
    };
    let aovs = Arc::new(trace_aovs(&scene, SIZE));
    let gold = path_trace(&scene, &aovs, Through::Centre, SPP, 0, &|_| ()).indirect;
    let gold = gold.iter().map(|&light| f64::from(luminance(light))).sum::<f64>() / gold.len() as f64;
    for share in [0.0625, 0.25, 1.0, f32::INFINITY] {
        let frames: Vec<Frame> = (0..SEEDS)
            .into_par_iter()
            .map(|seed| Frame::render(&scene, &aovs.albedo, seed, share))
            .collect();
        let mean = |of: &dyn Fn(&Frame) -> f64| frames.iter().map(of).sum::<f64>() / frames.len() as f64;
        let light = mean(&|frame| frame.light);
        let error = (mean(&|frame| (frame.light - light).powi(2)) / (SEEDS - 1) as f64).sqrt();
        println!(
            "| {name} | {share} | {:.1} % | {:+.2} ± {:.2} % | {:.2} | {:.2} |",
            100.0 * mean(&|frame| frame.put_back) / light,
            100.0 * (light / gold - 1.0),
            100.0 * error / gold,
            mean(&|frame| frame.variance) / gold.powi(2),
            mean(&|frame| frame.short_rays as f64) / mean(&|frame| frame.gather_rays as f64),
        );
    }
}

/// What the paper's 16 sets of 16 VPLs give, indirect light alone; luminances.
struct Frame {
    /// Mean of all pixels and sets.
    light: f64,
    /// The part of it that short rays put back.
    put_back: f64,
    /// Mean variance of a pixel from set to set.
    variance: f64,
    gather_rays: u64,
    short_rays: u64,
}

impl Frame {
    fn render(scene: &TracedScene, albedo: &[Vec3], seed: u64, share: f32) -> Self {
        let _flush = FlushDenormals::in_this_thread();
        let mut settings = Settings {
            seed,
            light_points: LightPoints::PerPixel,
            ..Settings::paper(Algorithm::Component, SIZE)
        };
        let sets = trace_sets(scene, &settings);
        settings.geometry_clamp = automatic_bound(scene, &settings, &sets[0])
            .map(|bound| share * bound)
            .filter(|bound| bound.is_finite());
        let gather = Gather::new(scene, GeometryBound::new(settings.geometry_clamp));
        let lights = LightSampler::new(&scene.scene().emitters);
        let compensation = Compensation::new(scene, &lights, &settings);
        let pixels: Vec<u32> = (0..SIZE.pixel_count() as u32).collect();
        let points = GBuffer::trace(scene, SIZE, &pixels);
        let mut frame = Self {
            light: 0.0,
            put_back: 0.0,
            variance: 0.0,
            gather_rays: 0,
            short_rays: 0,
        };
        let (mut sums, mut squares) = (vec![0.0; pixels.len()], vec![0.0; pixels.len()]);
        let count = (sets.len() * pixels.len()) as f64;
        for (pass, set) in (0..).zip(&sets) {
            let mut radiance = Vec3Lanes::zeros(points.position.x.len());
            frame.gather_rays += gather.add(&points, &set.vpls, &mut radiance);
            let of_pixel = |radiance: &Vec3Lanes, pixel: usize| {
                f64::from(luminance(albedo[pixel] * radiance.get(pixel)))
            };
            let bounded: f64 = (0..pixels.len()).map(|pixel| of_pixel(&radiance, pixel)).sum();
            if let Some(compensation) = &compensation {
                let rays = compensation.add(&pixels, &points, &set.vpls, pass, &mut radiance);
                frame.short_rays += rays.shadow;
            }
            let mut all = 0.0;
            for pixel in 0..pixels.len() {
                let light = of_pixel(&radiance, pixel);
                all += light;
                sums[pixel] += light;
                squares[pixel] += light * light;
            }
            frame.light += all / count;
            frame.put_back += (all - bounded) / count;
        }
        let n = sets.len() as f64;
        let variance = |(sum, square): (&f64, &f64)| (square / n - (sum / n).powi(2)) * n / (n - 1.0);
        frame.variance = sums.iter().zip(&squares).map(variance).sum::<f64>() / pixels.len() as f64;
        frame
    }
}
