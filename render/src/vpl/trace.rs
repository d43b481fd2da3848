//! Light paths from the emitters, and the VPLs chosen from their vertices.
//!
//! Each set has its own paths: at every vertex the path leaves a candidate VPL, then goes on with the
//! probability of the surface's mean albedo (Russian roulette). From all candidates of the set exactly
//! as many VPLs as asked for are drawn by systematic resampling in proportion to their intensity, along
//! a Morton curve through the scene: unbiased, equally bright, and spread over the lit surfaces.

use glam::Vec3;
use rayon::prelude::*;

use super::{Vpl, VplSet};
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

/// Light paths per VPL; more paths make the VPLs of a set more even, and cost next to nothing.
const PATHS_PER_VPL: u32 = 4;
/// Fewest paths of a set.
const PATHS_MIN: u32 = 64;
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
    let lights = LightSampler::new(&scene.scene().emitters);
    (0..settings.vpl_sets)
        .into_par_iter()
        .map(|set| {
            trace_set(
                scene,
                &lights,
                settings.vpls_per_set(),
                set,
                fold_seed(settings.seed, SEED_PURPOSE),
            )
        })
        .collect()
}

fn trace_set(scene: &TracedScene, lights: &LightSampler, vpls: u32, set: u32, seed: u32) -> VplSet {
    let paths = (PATHS_PER_VPL * vpls).max(PATHS_MIN);
    let first = set * paths;
    let mut candidates = Vec::with_capacity(2 * paths as usize);
    for path in 0..paths {
        // Consecutive numbers, so that each set is stratified by itself and with all the others.
        trace_path(scene, lights, Stream::new(first + path, seed), &mut candidates);
    }
    for candidate in &mut candidates {
        candidate.intensity /= paths as f32;
    }
    sort_along_morton_curve(&mut candidates, scene);
    VplSet {
        vpls: resample(&candidates, vpls, Stream::new(set, hash(seed, 1)).next_1d()),
    }
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

fn sort_along_morton_curve(candidates: &mut [Vpl], scene: &TracedScene) {
    let Some((min, max)) = scene.scene().mesh.bounds() else {
        return;
    };
    let scale = 1023.0 / (max - min).max_element().max(f32::MIN_POSITIVE);
    // A stable sort, so that equal keys keep the order of the paths.
    candidates.sort_by_key(|vpl| {
        morton(
            ((vpl.position - min) * scale)
                .max(Vec3::ZERO)
                .as_uvec3()
                .to_array(),
        )
    });
}

/// Interleaves the lower ten bits of three coordinates.
fn morton(cell: [u32; 3]) -> u32 {
    let spread = |v: u32| {
        let v = v.min(1023);
        let v = (v | v << 16) & 0x0300_00ff;
        let v = (v | v << 8) & 0x0300_f00f;
        let v = (v | v << 4) & 0x030c_30c3;
        (v | v << 2) & 0x0924_9249
    };
    let [x, y, z] = cell.map(spread);
    x | y << 1 | z << 2
}

/// Systematic resampling: `count` candidates, each expected in proportion to its luminance, their
/// intensities scaled so that the expected sum stays that of all candidates.
fn resample(candidates: &[Vpl], count: u32, offset: f32) -> Vec<Vpl> {
    let weights: Vec<f64> = candidates
        .iter()
        .map(|vpl| f64::from(luminance(vpl.intensity)))
        .collect();
    let total: f64 = weights.iter().sum();
    if total <= 0.0 {
        return Vec::new();
    }
    let step = total / f64::from(count);
    let mut next = f64::from(offset) * step;
    let mut sum = 0.0;
    let mut chosen = Vec::with_capacity(count as usize);
    for (candidate, weight) in candidates.iter().zip(&weights) {
        sum += weight;
        while next < sum && chosen.len() < count as usize {
            chosen.push(Vpl {
                intensity: candidate.intensity * (step / weight) as f32,
                ..*candidate
            });
            next += step;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidates() -> Vec<Vpl> {
        (1u8..40)
            .map(|i| Vpl {
                position: Vec3::splat(f32::from(i)),
                normal: Vec3::Y,
                intensity: Vec3::new(f32::from(i), f32::from(i % 7), 1.0),
            })
            .collect()
    }

    #[test]
    fn resampling_keeps_the_expected_sum_of_every_channel() {
        let candidates = candidates();
        let expected: Vec3 = candidates.iter().map(|vpl| vpl.intensity).sum();
        let n = 20_000;
        let mean: Vec3 = (0..n)
            .map(|i| {
                let offset = (i as f32 + 0.5) / n as f32;
                resample(&candidates, 5, offset)
                    .iter()
                    .map(|vpl| vpl.intensity)
                    .sum::<Vec3>()
                    / n as f32
            })
            .sum();
        assert!(
            ((mean - expected) / expected).abs().max_element() < 1e-3,
            "{mean} is not {expected}"
        );
    }

    #[test]
    fn resampled_vpls_are_as_many_as_asked_for_and_equally_bright() {
        for count in [1, 5, 39, 200] {
            let chosen = resample(&candidates(), count, 0.3);
            assert_eq!(chosen.len(), count as usize);
            let first = luminance(chosen[0].intensity);
            assert!(
                chosen
                    .iter()
                    .all(|vpl| (luminance(vpl.intensity) / first - 1.0).abs() < 1e-4)
            );
        }
    }

    #[test]
    fn no_candidates_make_an_empty_set() {
        assert_eq!(resample(&[], 16, 0.5), []);
    }
}
