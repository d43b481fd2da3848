//! The picture of the progressive algorithm: the mean of all samples, filtered or not, and what is missing
//! from near pixels.

use std::sync::Arc;

use rayon::prelude::*;

use super::{BAND_ROWS, Coverage, Reconstruction, guided::Guided, nearest_known};
use crate::{
    buffer::{HalfBuffers, PassBuffers},
    gbuffer::Aovs,
    image::Picture,
};
use glam::Vec3;

/// Makes the picture from all passes that have come.
pub(super) fn assemble(buffers: &PassBuffers, aovs: &Arc<Aovs>, method: Reconstruction) -> Picture {
    let [direct, indirect] = [&buffers.direct, &buffers.indirect].map(|halves| Filled {
        nearest: nearest(halves, method),
        halves,
        aovs,
    });
    let guided = levels(method).map(|levels| Guided::new([direct.halves, indirect.halves], aovs, levels));
    let width = aovs.size.width as usize;
    let mut picture = Picture::from_rows(aovs, BAND_ROWS, |rows| {
        let components = [
            (&direct, rows.direct, rows.samples_direct),
            (&indirect, rows.indirect, rows.samples_indirect),
        ];
        for (component, (filled, light, samples)) in components.into_iter().enumerate() {
            let lines = light.chunks_mut(width).zip(samples.chunks_mut(width));
            for (y, (light, samples)) in (rows.first / width..).zip(lines) {
                let mut guided = guided.as_ref().map(|guided| guided.light(component, y));
                for (pixel, (light, samples)) in (y * width..).zip(light.iter_mut().zip(samples)) {
                    let filtered = guided.as_mut().and_then(|row| row.next().flatten());
                    *samples = filled.halves.count(pixel);
                    // Where the eye meets nothing there is no light to copy from a neighbour.
                    if *samples > 0 || aovs.depth[pixel].is_finite() {
                        *light = filtered.unwrap_or_else(|| filled.light(pixel));
                    }
                }
            }
        }
    });
    picture.coverage = coverage(&picture.samples_direct, &picture.samples_indirect);
    picture
}

/// Levels of the guided filter: more of them average over light that differs too much.
fn levels(method: Reconstruction) -> Option<u32> {
    match method {
        Reconstruction::Guided => Some(4),
        Reconstruction::Quick => Some(2),
        Reconstruction::Nearest | Reconstruction::None => None,
    }
}

/// The light of one component, complete as far as that can be.
struct Filled<'a> {
    halves: &'a HalfBuffers,
    /// For each pixel the nearest one with samples, if any pixel lacks them.
    nearest: Option<Vec<u32>>,
    aovs: &'a Aovs,
}

impl Filled<'_> {
    fn light(&self, pixel: usize) -> Vec3 {
        if let Some(mean) = self.halves.mean(pixel) {
            return mean.as_vec3();
        }
        let near = self.nearest.as_ref().map(|nearest| nearest[pixel] as usize);
        let copied = near.and_then(|near| Some((self.halves.mean(near)?.as_vec3(), near)));
        copied.map_or(Vec3::ZERO, |(light, near)| {
            // The light is the neighbour's, the albedo the pixel's own.
            let [own, its] = [pixel, near].map(|pixel| self.aovs.albedo[pixel]);
            let ratio = |own: f32, its: f32| if its > ALBEDO_MIN { own / its } else { 1.0 };
            light * Vec3::new(ratio(own.x, its.x), ratio(own.y, its.y), ratio(own.z, its.z))
        })
    }
}

/// Below it light says nothing about what fell on the surface.
const ALBEDO_MIN: f32 = 1e-3;

fn nearest(halves: &HalfBuffers, method: Reconstruction) -> Option<Vec<u32>> {
    if method == Reconstruction::None {
        return None;
    }
    let known: Vec<bool> = (0..halves.size().pixel_count())
        .into_par_iter()
        .map(|pixel| halves.count(pixel) > 0)
        .collect();
    if known.iter().all(|&known| known) {
        return None;
    }
    nearest_known(&known, halves.size())
}

fn coverage(direct: &[u32], indirect: &[u32]) -> Coverage {
    let [direct, indirect] = [direct, indirect].map(|samples| {
        let missing = samples.iter().filter(|&&count| count == 0).count();
        let sum: u64 = samples.iter().map(|&count| u64::from(count)).sum();
        let pixels = samples.len() as f64;
        (100.0 * missing as f64 / pixels, sum as f64 / pixels)
    });
    Coverage {
        direct_reconstructed_percent: direct.0,
        indirect_reconstructed_percent: indirect.0,
        direct_samples: direct.1,
        indirect_samples: indirect.1,
        ..Coverage::default()
    }
}
