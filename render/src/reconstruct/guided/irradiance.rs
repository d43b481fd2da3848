//! Light divided by albedo, for each half of the samples of each component, and back.

use glam::Vec3;
use rayon::prelude::*;

use super::planes::{Layout, MARGIN, Planes};
use crate::{
    buffer::{Half, HalfBuffers},
    gbuffer::Aovs,
};

/// Halves of direct light, then of indirect light.
pub(super) const SIGNALS: usize = 4;

/// Below this albedo, summed over its channels, light says nothing about what fell on the surface.
const ALBEDO_MIN: f32 = 1e-3;
/// A channel with less albedo than this goes more by the other channels than by its own light.
const CHANNEL_ALBEDO: f32 = 0.01;

/// Radiance per unit albedo of each half of the samples of each component, W·m⁻²·sr⁻¹.
#[derive(Debug)]
pub(super) struct Irradiance {
    /// For each signal red, green, blue, and how much the pixel counts: its number of samples, in
    /// shares of the mean over the picture; 0 where nothing is known.
    pub(super) planes: Planes<{ 4 * SIGNALS }>,
}

impl Irradiance {
    /// The samples' own.
    pub(super) fn new(components: [&HalfBuffers; 2], aovs: &Aovs) -> Self {
        let mut planes = Planes::zeros(Layout::new(aovs.size));
        let width = aovs.size.width as usize;
        let halves = components.map(HalfBuffers::halves);
        let halves = [&halves[0][0], &halves[0][1], &halves[1][0], &halves[1][1]];
        let mean_counts = halves.map(|half| mean_count(half, aovs.size.pixel_count()));
        planes.par_rows_mut().enumerate().for_each(|(y, row)| {
            for (x, pixel) in (y * width..(y + 1) * width).enumerate() {
                for (signal, half) in halves.iter().enumerate() {
                    let Some(light) = per_albedo(half, pixel, aovs.albedo[pixel]) else {
                        continue;
                    };
                    let share = half.count(pixel) as f32 / mean_counts[signal];
                    for (plane, number) in (4 * signal..).zip([light.x, light.y, light.z, share]) {
                        row[plane][MARGIN + x] = number;
                    }
                }
            }
        });
        Self { planes }
    }

    /// Radiance of a component (0: direct, 1: indirect) along a row of the picture, W·m⁻²·sr⁻¹; `None` for
    /// pixels of which nothing is known.
    ///
    /// The samples' mean plus what filtering has changed: without a change it stays what it is, to the bit.
    pub(super) fn light(
        &self,
        component: usize,
        samples: &HalfBuffers,
        aovs: &Aovs,
        y: usize,
    ) -> impl Iterator<Item = Option<Vec3>> {
        let row = self.planes.row(y);
        (0..aovs.size.width as usize).map(move |x| {
            let known = [2 * component, 2 * component + 1].map(|signal| {
                let [red, green, blue, share] = std::array::from_fn(|i| row[4 * signal + i][MARGIN + x]);
                (share > 0.0).then_some(Vec3::new(red, green, blue))
            });
            let pixel = y * aovs.size.width as usize + x;
            let albedo = aovs.albedo[pixel];
            let Some(mean) = samples.mean(pixel) else {
                return match known {
                    [Some(a), Some(b)] => Some(albedo * (0.5 * (a + b))),
                    [one, other] => Some(albedo * one.or(other)?),
                };
            };
            let changes = samples.halves().iter().zip(known).map(|(half, filtered)| {
                let change = filtered? - per_albedo(half, pixel, albedo)?;
                Some(half.count(pixel) as f32 * change)
            });
            let change = changes.flatten().sum::<Vec3>() / samples.count(pixel) as f32;
            Some((mean.as_vec3() + albedo * change).max(Vec3::ZERO))
        })
    }
}

fn mean_count(half: &Half, pixels: usize) -> f32 {
    let sum: u64 = (0..pixels)
        .into_par_iter()
        .map(|pixel| u64::from(half.count(pixel)))
        .sum();
    (sum as f64 / pixels as f64) as f32
}

/// The mean of a pixel's samples per unit albedo. Channels without albedo take on the others' mean.
fn per_albedo(half: &Half, pixel: usize, albedo: Vec3) -> Option<Vec3> {
    let mean = half.mean(pixel)?.as_vec3();
    let sum = albedo.element_sum();
    (sum > ALBEDO_MIN).then(|| {
        let grey = mean.element_sum() / sum;
        (mean + CHANNEL_ALBEDO * grey) / (albedo + CHANNEL_ALBEDO)
    })
}
