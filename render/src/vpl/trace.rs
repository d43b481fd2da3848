//! Light paths from the emitters, and the candidates for VPLs at their vertices.
//!
//! All sets of a frame share one pool: at every vertex a path leaves a candidate, then goes on with the
//! probability of the surface's mean albedo (Russian roulette). The VPLs are chosen from all candidates
//! at once and dealt out to the sets, so that both each set and all of them together are spread evenly
//! over the lit surfaces.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    Vpl, VplSet,
    choose::{choose, deal},
    curve::sort_along_curve,
    importance,
    view::{VPLS_MIN, View},
};
use crate::{
    intersect::TracedScene,
    light::{LightSampler, luminance},
    sample::{
        Stream,
        sobol::{fold_seed, hash},
        warp::cosine_direction,
    },
    settings::Settings,
};

/// Light paths per VPL: two vertices of so many paths leave a hundred candidates or more for each VPL,
/// of which systematic resampling makes an even spread; a third of a microsecond per vertex on one core.
const PATHS_PER_VPL: u32 = 64;
/// Most paths in a frame with a deadline, a quarter of a second of two cores in a bright hall of 100,000
/// triangles, as long as each VPL has one at least.
const PATHS_MAX: u32 = 1 << 16;
/// Most paths in a frame without a deadline, so that the candidates fit into memory.
const PATHS_THOROUGH_MAX: u32 = 1 << 20;
/// Paths that one thread traces in one go.
const PATHS_PER_RUN: usize = 256;
/// A path that has not ended after this many vertices is cut; at a survival of 0.95 one in 10²² gets here.
const VERTICES_MAX: usize = 1_000;
/// Largest probability of going on, so that paths end between perfect mirrors of white too.
const SURVIVAL_MAX: f32 = 0.95;
/// Sets the paths' numbers apart from those of other purposes.
const SEED_PURPOSE: u32 = 0x7670_6c73;

/// Traces the VPL sets of a frame; a function of scene and settings alone.
///
/// A set of a scene in which no light reaches any reflecting surface is empty.
pub fn trace_sets(scene: &TracedScene, settings: &Settings) -> Vec<VplSet> {
    let candidates = trace_candidates(scene, settings, PATHS_MAX);
    let weights = View::for_settings(scene.scene(), settings).weights(&candidates);
    choose_sets(&candidates, &weights, settings)
}

/// The same when there is time: many VPLs are chosen from the vertices of up to 64 paths for each, and by
/// their importance, which takes a ray from each candidate; fewer than 4,096 in the same way. 16,384 VPLs
/// take 300 MB and seconds.
pub fn trace_sets_thoroughly(scene: &TracedScene, settings: &Settings) -> Vec<VplSet> {
    if settings.vpls < VPLS_MIN {
        return trace_sets(scene, settings);
    }
    let candidates = trace_candidates(scene, settings, PATHS_THOROUGH_MAX);
    let weights = importance::weights(scene, settings, &candidates);
    choose_sets(&candidates, &weights, settings)
}

fn choose_sets(candidates: &[Vpl], weights: &[f64], settings: &Settings) -> Vec<VplSet> {
    let seed = fold_seed(settings.seed, SEED_PURPOSE);
    let places = Stream::new(0, hash(seed, 1)).next_2d();
    let vpls = choose(candidates, weights, settings.vpls, places.x);
    deal(&vpls, settings.vpl_sets, places.y)
}

fn path_count(vpls: u32, paths_max: u32) -> u32 {
    (PATHS_PER_VPL * vpls).min(paths_max).max(vpls)
}

/// The vertices of all paths, along a curve, with their share of the light of all paths.
fn trace_candidates(scene: &TracedScene, settings: &Settings, paths_max: u32) -> Vec<Vpl> {
    let paths = path_count(settings.vpls, paths_max);
    let seed = fold_seed(settings.seed, SEED_PURPOSE);
    let lights = LightSampler::new(&scene.scene().emitters);
    let runs = (0..paths).into_par_iter().step_by(PATHS_PER_RUN);
    let traced = runs.flat_map_iter(|first| {
        let mut candidates = Vec::new();
        for path in first..paths.min(first + PATHS_PER_RUN as u32) {
            trace_path(scene, &lights, Stream::new(path, seed), &mut candidates);
        }
        for candidate in &mut candidates {
            candidate.intensity /= paths as f32;
        }
        candidates
    });
    let mut candidates: Vec<Vpl> = traced.collect();
    sort_along_curve(&mut candidates, scene.scene().mesh.bounds());
    candidates
}

/// Follows one path and leaves a candidate, as bright as the whole path, at each of its vertices.
fn trace_path(scene: &TracedScene, lights: &LightSampler, mut stream: Stream, candidates: &mut Vec<Vpl>) {
    let Some(light) = lights.sample_stream(&mut stream) else {
        return;
    };
    let mut origin = light.position + scene.ray_offset() * light.normal;
    let mut direction = cosine_direction(light.normal, stream.next_2d());
    // ∫ cos dω = π turns radiance into flux.
    let mut flux = std::f32::consts::PI * light.radiance_over_pdf;
    for _ in 0..VERTICES_MAX {
        let Some(point) = scene.nearest(origin, direction) else {
            return;
        };
        let reflected = flux
            * point.albedo
            * adjoint_cosine_ratio(direction, point.geometric_normal, point.shading_normal);
        if reflected.max_element() <= 0.0 {
            return;
        }
        origin = point.lifted(scene.ray_offset());
        candidates.push(Vpl {
            position: origin,
            normal: point.geometric_normal,
            intensity: reflected / std::f32::consts::PI,
        });
        let survival = luminance(point.albedo).min(SURVIVAL_MAX);
        if stream.next_1d() >= survival {
            return;
        }
        flux = reflected / survival;
        direction = cosine_direction(point.geometric_normal, stream.next_2d());
    }
}

/// What interpolated normals change for light that comes from the lamps instead of from the eye
/// (Veach's thesis, section 5.3): 1 where both normals are the same.
fn adjoint_cosine_ratio(direction: Vec3, geometric: Vec3, shading: Vec3) -> f32 {
    let (geometric, shading) = (-direction.dot(geometric), -direction.dot(shading));
    if geometric <= 0.0 {
        0.0
    } else {
        (shading / geometric).max(0.0)
    }
}
