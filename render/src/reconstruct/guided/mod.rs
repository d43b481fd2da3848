//! Guided reconstruction: each component's irradiance, averaged over pixels that see the same surface, as
//! far as its own noise asks for it.
//!
//! Light is divided by albedo, so that textures stay apart from it, and goes through levels of an à-trous
//! wavelet (Dammertz et al., "Edge-avoiding À-Trous wavelet transform for fast global illumination
//! filtering", 2010): 5×5 pixels that lie ever farther apart, weighted by how alike the surfaces are
//! (`surface`), never by the light. So light that is right on the average stays so, and a bright
//! outlier is neither kept nor lost.
//!
//! What the surfaces do not tell, such as the edge of a shadow, is found by cross-validation between the
//! two halves of the samples: at each level the filtered light of one half replaces the light before it
//! by the share that brings it nearest to the other half (`blend`). Where the noise is gone that share
//! is zero, so the picture converges to the mean of the samples.

mod blend;
mod irradiance;
mod level;
mod planes;
mod surface;

use glam::Vec3;

use self::{blend::Blend, irradiance::Irradiance, level::Filtered, surface::Surfaces};
use crate::{buffer::HalfBuffers, gbuffer::Aovs};

/// Light of both components, complete as far as near pixels of the same surface know it.
#[derive(Debug)]
pub struct Guided<'a> {
    components: [&'a HalfBuffers; 2],
    aovs: &'a Aovs,
    irradiance: Irradiance,
}

impl<'a> Guided<'a> {
    /// Most levels. The pixels that the last one averages are 2⁴ apart.
    pub const LEVELS_MAX: u32 = planes::MARGIN.ilog2();

    /// Filters direct and indirect light through so many levels, with all cores. The time it takes depends
    /// on the number of pixels and levels alone.
    pub fn new(components: [&'a HalfBuffers; 2], aovs: &'a Aovs, levels: u32) -> Self {
        let surfaces = Surfaces::new(aovs);
        let mut irradiance = Irradiance::new(components, aovs);
        let mut filtered = Filtered::new(surfaces.layout());
        let mut blend = Blend::new(surfaces.layout());
        for level in 0..levels.min(Self::LEVELS_MAX) {
            filtered.filter(&irradiance, &surfaces, 1 << level);
            blend.towards(&filtered, &mut irradiance);
        }
        Self {
            components,
            aovs,
            irradiance,
        }
    }

    /// Radiance of a component (0: direct, 1: indirect) along a row of the picture, W·m⁻²·sr⁻¹. `None` where
    /// neither the pixel nor any near one of the same surface has samples.
    pub fn light(&self, component: usize, y: usize) -> impl Iterator<Item = Option<Vec3>> {
        self.irradiance
            .light(component, self.components[component], self.aovs, y)
    }
}

#[cfg(test)]
mod tests;
