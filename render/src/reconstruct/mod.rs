//! From buffers to a picture, whatever is missing.
//!
//! Each component is made complete by itself, in linear radiance, before the components are added
//! (section 3.2.2). Total: any subset of the results, none included, gives a picture.

mod kept_sets;
mod nearest;
mod sources;

pub use kept_sets::Coverage;
pub use nearest::nearest_known;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    buffer::FrameBuffers, gbuffer::Aovs, image::Picture, pixel_group::PixelGroups, settings::Algorithm,
};
use kept_sets::KeptSets;
use sources::{Fill, SourceMaps};

/// How pixels without data are filled in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reconstruction {
    /// With the value of the nearest pixel that has data, in each buffer by itself (section 3.1.1).
    Nearest,
    /// Not at all: they stay black, so that one can see what was missing.
    None,
}

/// One component of the whole picture.
struct Layer {
    /// Radiance, `[height][width]`.
    radiance: Vec<Vec3>,
    /// Samples (passes, sets) with real data at the pixel, `[height][width]`.
    samples: Vec<u32>,
}

/// Makes the picture from all that has arrived.
///
/// `min_set_percent` is the share of pixels under which the buffer of a VPL set is left out while
/// others have more (section 3.2.2).
pub fn assemble(
    mut buffers: FrameBuffers,
    aovs: &Aovs,
    method: Reconstruction,
    min_set_percent: f32,
) -> Picture {
    buffers.settle();
    let assembly = Assembly {
        buffers: &buffers,
        groups: buffers.groups(),
        aovs,
        method,
    };
    let kept = KeptSets::choose(&buffers, min_set_percent);
    let (direct, indirect) = match buffers.settings().algorithm {
        Algorithm::Component => rayon::join(|| assembly.direct(), || assembly.indirect(&kept.sets)),
        Algorithm::Straightforward => assembly.full(),
    };
    let coverage = kept.coverage(&direct.samples, &indirect.samples, buffers.settings());
    Picture::from_components(
        aovs,
        direct.radiance,
        indirect.radiance,
        direct.samples,
        indirect.samples,
        coverage,
    )
}

struct Assembly<'a> {
    buffers: &'a FrameBuffers,
    groups: &'a PixelGroups,
    aovs: &'a Aovs,
    method: Reconstruction,
}

/// Radiance and number of real samples of each pixel of a group, in the group's order.
type GroupLight = Vec<(Vec3, u32)>;

impl Assembly<'_> {
    fn direct(&self) -> Layer {
        let counts = |group: u32| {
            (0..self.groups.pixels(group).len())
                .take_while(|&place| self.buffers.direct_mean(group, place).samples > 0)
                .count() as u32
        };
        let prefixes: Vec<u32> = self.group_numbers().map(counts).collect();
        let fill = self.fill(&prefixes);
        self.layer(|group, place, pixel| {
            let mean = self.buffers.direct_mean(group, place);
            if mean.samples > 0 {
                return (self.aovs.albedo[pixel] * mean.radiance, mean.samples);
            }
            let copied = fill.source(group, place).map(|source| {
                self.albedo(source.group, source.place)
                    * self
                        .buffers
                        .direct_mean(source.group, source.place as usize)
                        .radiance
            });
            (copied.unwrap_or(Vec3::ZERO), 0)
        })
    }

    /// The mean over the kept sets, each made complete by itself: what is lost changes the noise of a
    /// pixel, never its brightness.
    fn indirect(&self, kept: &[u32]) -> Layer {
        let maps = SourceMaps::new(
            kept.iter().map(|&set| self.buffers.set_prefixes(set)),
            |prefixes| self.fill(prefixes),
        );
        self.layer_by_group(|group| {
            let pixels = self.groups.pixels(group);
            let mut sums = vec![DVec3::ZERO; pixels.len()];
            let mut filled = vec![DVec3::ZERO; pixels.len()];
            let mut samples = vec![0u32; pixels.len()];
            let mut filled_samples = vec![0u32; pixels.len()];
            for (&set, fill) in kept.iter().zip(maps.fills()) {
                let real = self.buffers.set_group(set, group);
                for (place, light) in real.iter().enumerate() {
                    sums[place] += light.as_dvec3();
                    samples[place] += 1;
                }
                for place in real.len()..pixels.len() {
                    let Some(source) = fill.source(group, place) else {
                        break;
                    };
                    let light = self.buffers.set_group(set, source.group)[source.place as usize];
                    filled[place] += (self.albedo(source.group, source.place) * light).as_dvec3();
                    filled_samples[place] += 1;
                }
            }
            (pixels.iter().enumerate())
                .map(|(place, &pixel)| {
                    let count = f64::from((samples[place] + filled_samples[place]).max(1));
                    let real = self.aovs.albedo[pixel as usize] * (sums[place] / count).as_vec3();
                    (real + (filled[place] / count).as_vec3(), samples[place])
                })
                .collect()
        })
    }

    fn full(&self) -> (Layer, Layer) {
        let counts = |group: u32| {
            let pixels = 0..self.groups.pixels(group).len();
            pixels
                .take_while(|&place| self.buffers.full(group, place).is_some())
                .count() as u32
        };
        let prefixes: Vec<u32> = self.group_numbers().map(counts).collect();
        let fill = self.fill(&prefixes);
        let layer = |part: usize| {
            self.layer(|group, place, pixel| {
                if let Some(light) = self.buffers.full(group, place) {
                    return (self.aovs.albedo[pixel] * light[part], 1);
                }
                let copied = fill.source(group, place).and_then(|source| {
                    let light = self.buffers.full(source.group, source.place as usize)?;
                    Some(self.albedo(source.group, source.place) * light[part])
                });
                (copied.unwrap_or(Vec3::ZERO), 0)
            })
        };
        rayon::join(|| layer(0), || layer(1))
    }

    fn fill(&self, prefixes: &[u32]) -> Fill {
        match self.method {
            Reconstruction::Nearest => Fill::nearest(self.groups, self.aovs.size, prefixes),
            Reconstruction::None => Fill::nothing(),
        }
    }

    fn albedo(&self, group: u32, place: u32) -> Vec3 {
        self.aovs.albedo[self.groups.pixels(group)[place as usize] as usize]
    }

    fn group_numbers(&self) -> std::ops::Range<u32> {
        0..self.groups.len() as u32
    }

    fn layer(&self, light: impl Fn(u32, usize, usize) -> (Vec3, u32) + Send + Sync) -> Layer {
        self.layer_by_group(|group| {
            let pixels = self.groups.pixels(group).iter().enumerate();
            pixels
                .map(|(place, &pixel)| light(group, place, pixel as usize))
                .collect()
        })
    }

    /// Computes the groups side by side, then puts their pixels in their places.
    fn layer_by_group(&self, light: impl Fn(u32) -> GroupLight + Send + Sync) -> Layer {
        let by_group: Vec<GroupLight> = self.group_numbers().into_par_iter().map(light).collect();
        let count = self.aovs.size.pixel_count();
        let mut layer = Layer {
            radiance: vec![Vec3::ZERO; count],
            samples: vec![0; count],
        };
        for (group, lights) in by_group.iter().enumerate() {
            for (&pixel, &(radiance, samples)) in self.groups.pixels(group as u32).iter().zip(lights) {
                let pixel = pixel as usize;
                layer.samples[pixel] = samples;
                // Where the eye meets nothing there is no light to copy from a neighbour.
                if self.aovs.depth[pixel].is_finite() {
                    layer.radiance[pixel] = radiance;
                }
            }
        }
        layer
    }
}
