//! Buffers that can be asked for any pixel: those that they lack are copied from near ones.

use glam::{DVec3, Vec3};

use super::{Reconstruction, nearest_known};
use crate::{
    buffer::{Buffer, DirectBuffer},
    gbuffer::Aovs,
    pixel_group::PixelGroups,
};

/// Light of one component of a pixel, and what it rests on.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sum {
    /// Radiance, times its weight.
    light: DVec3,
    /// Number of samples that the light stands for, copied ones included.
    weight: u32,
    /// Samples of the pixel's own.
    pub(super) samples: u32,
}

impl Sum {
    /// Mean radiance; black where nothing is known.
    pub(super) fn mean(&self) -> Vec3 {
        if self.weight > 0 {
            (self.light / f64::from(self.weight)).as_vec3()
        } else {
            Vec3::ZERO
        }
    }
}

/// A buffer, or several that hold the same pixels, that can be asked for any pixel.
#[derive(Debug)]
pub(super) struct CompleteBuffer<'a> {
    content: Content<'a>,
    missing: Missing,
}

/// Where the light is.
#[derive(Debug, Clone, Copy)]
pub(super) enum Content<'a> {
    /// The running sums of the direct component.
    Direct(&'a DirectBuffer),
    /// The mean of so many VPL sets.
    Sets(&'a [[f32; 3]], u32),
    /// The part of the straightforward algorithm's pairs that begins at this number.
    Full(&'a [[f32; 6]], usize),
}

/// What to do for pixels without data.
#[derive(Debug, Clone)]
enum Missing {
    /// There are none.
    Nothing,
    /// Copy from the pixel with this row-major index; pixels with data name themselves.
    CopiedFrom(Vec<u32>),
    /// Leave out those that are not known, `[height][width]`.
    LeftOut(Vec<bool>),
}

impl CompleteBuffer<'_> {
    /// Adds the light of a run of pixels, its own or copied, that begins at a row-major index.
    pub(super) fn add_to(&self, sums: &mut [Sum], first: usize, aovs: &Aovs) {
        match self.content {
            Content::Direct(buffer) => self.add(sums, first, aovs, 1, |pixel| {
                (buffer.mean(pixel), buffer.counts[pixel])
            }),
            Content::Sets(light, sets) => self.add(sums, first, aovs, sets, |pixel| {
                (Vec3::from_array(light[pixel]), sets)
            }),
            Content::Full(pairs, part) => self.add(sums, first, aovs, 1, |pixel| {
                (Vec3::from_slice(&pairs[pixel][part..]), 1)
            }),
        }
    }

    fn add(
        &self,
        sums: &mut [Sum],
        first: usize,
        aovs: &Aovs,
        weight: u32,
        light_at: impl Fn(usize) -> (Vec3, u32),
    ) {
        for (offset, sum) in sums.iter_mut().enumerate() {
            let pixel = first + offset;
            let source = match &self.missing {
                Missing::Nothing => pixel,
                Missing::CopiedFrom(sources) => sources[pixel] as usize,
                Missing::LeftOut(known) if known[pixel] => pixel,
                Missing::LeftOut(_) => continue,
            };
            let (light, samples) = light_at(source);
            sum.light += f64::from(weight) * (aovs.albedo[source] * light).as_dvec3();
            sum.weight += weight;
            if source == pixel {
                sum.samples += samples;
            }
        }
    }
}

/// Makes the buffers of a frame complete.
#[derive(Debug)]
pub(super) struct Completion<'a> {
    pub(super) groups: &'a PixelGroups,
    pub(super) aovs: &'a Aovs,
    pub(super) method: Reconstruction,
}

impl Completion<'_> {
    pub(super) fn direct<'b>(&self, buffer: &'b DirectBuffer) -> CompleteBuffer<'b> {
        CompleteBuffer {
            content: Content::Direct(buffer),
            missing: self.missing(buffer.beginnings()),
        }
    }

    /// Direct and indirect light of the straightforward algorithm.
    pub(super) fn full<'b>(&self, buffer: &'b Buffer<6>) -> [CompleteBuffer<'b>; 2] {
        let missing = self.missing(buffer.beginnings());
        [0, 3].map(|part| CompleteBuffer {
            content: Content::Full(&buffer.light, part),
            missing: missing.clone(),
        })
    }

    /// The mean of so many VPL sets that hold the same pixels.
    pub(super) fn sets<'b>(&self, mean: &'b Buffer<3>, sets: u32) -> CompleteBuffer<'b> {
        CompleteBuffer {
            content: Content::Sets(&mean.light, sets),
            missing: self.missing(mean.beginnings()),
        }
    }

    fn missing(&self, beginnings: impl Iterator<Item = usize>) -> Missing {
        let mut known = vec![false; self.groups.order().len()];
        let mut count = 0;
        for (group, beginning) in beginnings.enumerate() {
            for &pixel in &self.groups.pixels(group as u32)[..beginning] {
                known[pixel as usize] = true;
            }
            count += beginning;
        }
        if count == known.len() {
            return Missing::Nothing;
        }
        match self.method {
            Reconstruction::Guided | Reconstruction::Quick | Reconstruction::Nearest => {
                nearest_known(&known, self.aovs.size)
                    .map_or_else(|| Missing::LeftOut(known), Missing::CopiedFrom)
            }
            Reconstruction::None => Missing::LeftOut(known),
        }
    }
}
