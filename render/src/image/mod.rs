//! The finished picture and its files.

mod exr_file;
mod png_file;

pub use exr_file::write_exr;
pub use png_file::{display_code, write_png};

use std::sync::Arc;

use bytemuck::zeroed_vec;
use glam::Vec3;
use rayon::prelude::*;

use crate::{gbuffer::Aovs, reconstruct::Coverage, scene::ImageSize};

/// A picture with its layers, each `[height][width]`, rows from the top; radiance in W·m⁻²·sr⁻¹.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Picture size.
    pub size: ImageSize,
    /// What the eye sees first.
    pub aovs: Arc<Aovs>,
    /// All light: emission + direct + indirect.
    pub beauty: Vec<Vec3>,
    /// Light that came straight from the emitters to the surface.
    pub direct: Vec<Vec3>,
    /// Light that was reflected before.
    pub indirect: Vec<Vec3>,
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

/// Some rows of a picture that is being made.
#[derive(Debug)]
pub(crate) struct Rows<'a> {
    /// Row-major index of the first pixel.
    pub(crate) first: usize,
    /// Light that came straight from the emitters; black so far, as all here.
    pub(crate) direct: &'a mut [Vec3],
    /// Light that was reflected before.
    pub(crate) indirect: &'a mut [Vec3],
    /// Passes of direct light with data at the pixel.
    pub(crate) samples_direct: &'a mut [u32],
    /// VPL sets with data at the pixel.
    pub(crate) samples_indirect: &'a mut [u32],
}

impl Picture {
    /// Makes a picture with all cores, so many rows at a time, of what `fill` writes into them.
    pub(crate) fn from_rows(aovs: &Arc<Aovs>, rows: usize, fill: impl Fn(Rows<'_>) + Sync) -> Self {
        let count = aovs.size.pixel_count();
        // Pages of memory are taken by the threads that fill them.
        let (mut beauty, mut direct, mut indirect) =
            (zeroed_vec(count), zeroed_vec(count), zeroed_vec(count));
        let (mut samples_direct, mut samples_indirect) = (vec![0; count], vec![0; count]);
        let pixels = rows * aovs.size.width as usize;
        (beauty.par_chunks_mut(pixels))
            .zip(direct.par_chunks_mut(pixels))
            .zip(indirect.par_chunks_mut(pixels))
            .zip(samples_direct.par_chunks_mut(pixels))
            .zip(samples_indirect.par_chunks_mut(pixels))
            .enumerate()
            .for_each(
                |(band, ((((beauty, direct), indirect), samples_direct), samples_indirect))| {
                    let first = band * pixels;
                    fill(Rows {
                        first,
                        direct,
                        indirect,
                        samples_direct,
                        samples_indirect,
                    });
                    let light = direct.iter().zip(&*indirect);
                    for ((beauty, (&direct, &indirect)), &emission) in
                        beauty.iter_mut().zip(light).zip(&aovs.emission[first..])
                    {
                        *beauty = emission + direct + indirect;
                    }
                },
            );
        Self {
            size: aovs.size,
            aovs: Arc::clone(aovs),
            beauty,
            direct,
            indirect,
            samples_direct,
            samples_indirect,
            coverage: Coverage::default(),
        }
    }
}
