//! Buffers in the order of the pixel groups, and where the pixels that they lack are copied from.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Reconstruction, nearest_known};
use crate::{buffer::FrameBuffers, gbuffer::Aovs, pixel_group::PixelGroups};

/// A buffer, or several that hold the same pixels, that can be asked for any pixel.
#[derive(Debug)]
pub(super) struct CompleteBuffer<'a> {
    /// Mean radiance per unit albedo, in the order of the groups; anything where there is no data.
    light: Vec<Vec3>,
    /// Samples behind the light of each pixel, in the order of the groups.
    samples: Vec<u32>,
    /// Buffers in this one.
    weight: u32,
    /// Place of each pixel in the order of the groups.
    places: &'a [u32],
    missing: Missing,
}

/// What to do for pixels without data.
#[derive(Debug, Clone)]
enum Missing {
    /// There are none.
    Nothing,
    /// Copy from the pixel with this row-major index; pixels with data name themselves.
    CopiedFrom(Vec<u32>),
    /// Leave them out.
    LeftOut,
}

impl CompleteBuffer<'_> {
    /// Radiance of a pixel, its own or copied; `None` where there is neither.
    pub(super) fn light(&self, pixel: usize, aovs: &Aovs) -> Option<Vec3> {
        let source = match &self.missing {
            Missing::CopiedFrom(sources) => sources[pixel] as usize,
            Missing::LeftOut if self.samples(pixel) == 0 => return None,
            Missing::Nothing | Missing::LeftOut => pixel,
        };
        Some(aovs.albedo[source] * self.light[self.places[source] as usize])
    }

    /// Samples of the pixel's own.
    pub(super) fn samples(&self, pixel: usize) -> u32 {
        self.samples[self.places[pixel] as usize]
    }

    pub(super) fn weight(&self) -> u32 {
        self.weight
    }
}

/// Makes the buffers of a frame complete.
#[derive(Debug)]
pub(super) struct Completion<'a> {
    buffers: &'a FrameBuffers,
    groups: &'a PixelGroups,
    aovs: &'a Aovs,
    method: Reconstruction,
    places: Vec<u32>,
}

impl<'a> Completion<'a> {
    pub(super) fn new(buffers: &'a FrameBuffers, aovs: &'a Aovs, method: Reconstruction) -> Self {
        let groups = buffers.groups();
        let mut places = vec![0; groups.order().len()];
        for (place, &pixel) in groups.order().iter().enumerate() {
            places[pixel as usize] = place as u32;
        }
        Self {
            buffers,
            groups,
            aovs,
            method,
            places,
        }
    }

    pub(super) fn direct(&self) -> CompleteBuffer<'_> {
        let (light, samples) = self.by_group(|group, light, samples| {
            let (means, counts) = self.buffers.direct_group(group);
            light
                .iter_mut()
                .zip(means)
                .for_each(|(light, mean)| *light = mean);
            samples[..counts.len()].copy_from_slice(counts);
        });
        let missing = self.missing(&samples);
        CompleteBuffer {
            light,
            samples,
            weight: 1,
            places: &self.places,
            missing,
        }
    }

    /// Direct and indirect light of the straightforward algorithm.
    pub(super) fn full(&self) -> [CompleteBuffer<'_>; 2] {
        let parts = [0, 1].map(|part| {
            self.by_group(|group, light, samples| {
                let pairs = self.buffers.full_group(group);
                light
                    .iter_mut()
                    .zip(pairs)
                    .for_each(|(light, pair)| *light = pair[part]);
                samples[..pairs.len()].fill(1);
            })
        });
        let missing = self.missing(&parts[0].1);
        parts.map(|(light, samples)| CompleteBuffer {
            light,
            samples,
            weight: 1,
            places: &self.places,
            missing: missing.clone(),
        })
    }

    /// The given VPL sets, those that hold the same pixels added up, in the order of their numbers.
    pub(super) fn sets(&self, sets: &[u32]) -> Vec<CompleteBuffer<'_>> {
        let mut alike: BTreeMap<Vec<usize>, Vec<u32>> = BTreeMap::new();
        for &set in sets {
            let groups = 0..self.groups.len() as u32;
            let prefixes = groups
                .map(|group| self.buffers.set_group(set, group).len())
                .collect();
            alike.entry(prefixes).or_default().push(set);
        }
        alike.par_iter().map(|(_, sets)| self.sets_alike(sets)).collect()
    }

    fn sets_alike(&self, sets: &[u32]) -> CompleteBuffer<'_> {
        let weight = sets.len() as u32;
        let (light, samples) = self.by_group(|group, light, samples| {
            let mut sums = vec![DVec3::ZERO; light.len()];
            for &set in sets {
                let data = self.buffers.set_group(set, group);
                sums.iter_mut()
                    .zip(data)
                    .for_each(|(sum, light)| *sum += light.as_dvec3());
                samples[..data.len()].fill(weight);
            }
            let means = sums.into_iter().map(|sum| (sum / f64::from(weight)).as_vec3());
            light
                .iter_mut()
                .zip(means)
                .for_each(|(light, mean)| *light = mean);
        });
        let missing = self.missing(&samples);
        CompleteBuffer {
            light,
            samples,
            weight,
            places: &self.places,
            missing,
        }
    }

    /// Fills light and samples group by group, side by side.
    fn by_group(&self, fill: impl Fn(u32, &mut [Vec3], &mut [u32]) + Sync) -> (Vec<Vec3>, Vec<u32>) {
        let count = self.places.len();
        let (mut light, mut samples) = (vec![Vec3::ZERO; count], vec![0; count]);
        let (mut light_rest, mut samples_rest) = (light.as_mut_slice(), samples.as_mut_slice());
        rayon::scope(|scope| {
            for group in 0..self.groups.len() as u32 {
                let len = self.groups.range(group).len();
                let (light, samples);
                (light, light_rest) = std::mem::take(&mut light_rest).split_at_mut(len);
                (samples, samples_rest) = std::mem::take(&mut samples_rest).split_at_mut(len);
                let fill = &fill;
                scope.spawn(move |_| fill(group, light, samples));
            }
        });
        (light, samples)
    }

    /// `samples` in the order of the groups.
    fn missing(&self, samples: &[u32]) -> Missing {
        if !samples.contains(&0) {
            return Missing::Nothing;
        }
        let known = || -> Vec<bool> {
            self.places
                .iter()
                .map(|&place| samples[place as usize] > 0)
                .collect()
        };
        match self.method {
            Reconstruction::None => Missing::LeftOut,
            Reconstruction::Nearest => {
                nearest_known(&known(), self.aovs.size).map_or(Missing::LeftOut, Missing::CopiedFrom)
            }
        }
    }
}
