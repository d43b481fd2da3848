//! The finished picture and its files.

mod exr_file;
mod png_file;

pub use exr_file::write_exr;
pub use png_file::{display_code, write_png};

use glam::Vec3;
use rayon::prelude::*;

use crate::{
    gbuffer::Aovs,
    reconstruct::{Coverage, Layer},
    scene::ImageSize,
};

/// A picture with its layers, each `[height][width]`, rows from the top; radiance in W·m⁻²·sr⁻¹.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Picture size.
    pub size: ImageSize,
    /// All light: emission + direct + indirect.
    pub beauty: Vec<Vec3>,
    /// Light that came straight from the emitters to the surface.
    pub direct: Vec<Vec3>,
    /// Light that was reflected before.
    pub indirect: Vec<Vec3>,
    /// Diffuse albedo.
    pub albedo: Vec<Vec3>,
    /// Unit shading normals, world space.
    pub normal: Vec<Vec3>,
    /// Distance from the eye, scene units; infinite where nothing is seen.
    pub depth: Vec<f32>,
    /// Passes of direct light with data at the pixel; 0: reconstructed.
    pub samples_direct: Vec<u32>,
    /// VPL sets with data at the pixel; 0: reconstructed.
    pub samples_indirect: Vec<u32>,
    /// How much is real data.
    pub coverage: Coverage,
}

/// Why a picture could not be encoded or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The EXR encoder or its output failed.
    #[error("cannot write the EXR: {0}")]
    Exr(#[from] exr::error::Error),
    /// The PNG encoder or its output failed.
    #[error("cannot write the PNG: {0}")]
    Png(#[from] image::ImageError),
}

impl Picture {
    /// Adds the components and the emission of the first surfaces.
    pub(crate) fn from_components(aovs: &Aovs, direct: Layer, indirect: Layer, coverage: Coverage) -> Self {
        let light = aovs
            .emission
            .par_iter()
            .zip(&direct.radiance)
            .zip(&indirect.radiance);
        Self {
            size: aovs.size,
            beauty: light
                .map(|((&emission, &direct), &indirect)| emission + direct + indirect)
                .collect(),
            direct: direct.radiance,
            indirect: indirect.radiance,
            albedo: aovs.albedo.clone(),
            normal: aovs.normal.clone(),
            depth: aovs.depth.clone(),
            samples_direct: direct.samples,
            samples_indirect: indirect.samples,
            coverage,
        }
    }
}
