//! From buffers to a picture, whatever is missing.
//!
//! Each buffer is made complete by itself, in linear radiance, before buffers and components are added
//! (section 3.2.2). Total: any subset of the results, none included, gives a picture.

mod complete;
mod kept_sets;
mod nearest;

pub use kept_sets::Coverage;
pub use nearest::nearest_known;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{buffer::FrameBuffers, gbuffer::Aovs, image::Picture, settings::Algorithm};
use complete::{CompleteBuffer, Completion};
use kept_sets::KeptSets;

/// How pixels without data are filled in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reconstruction {
    /// With the value of the nearest pixel that has data, in each buffer by itself (section 3.1.1).
    Nearest,
    /// Not at all: they stay black, so that one can see what was missing.
    None,
}

/// One component of the whole picture, `[height][width]`.
pub(crate) struct Layer {
    /// Radiance, W·m⁻²·sr⁻¹.
    pub(crate) radiance: Vec<Vec3>,
    /// Samples (passes, sets) with real data at the pixel.
    pub(crate) samples: Vec<u32>,
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
    let kept = KeptSets::choose(&buffers, min_set_percent);
    let completion = Completion::new(&buffers, aovs, method);
    let (direct, indirect) = match buffers.settings().algorithm {
        Algorithm::Component => (vec![completion.direct()], completion.sets(&kept.sets)),
        Algorithm::Straightforward => {
            let [direct, indirect] = completion.full();
            (vec![direct], vec![indirect])
        }
    };
    let (direct, indirect) = rayon::join(|| layer(&direct, aovs), || layer(&indirect, aovs));
    let coverage = kept.coverage(&direct.samples, &indirect.samples, buffers.settings());
    Picture::from_components(aovs, direct, indirect, coverage)
}

/// The mean of the buffers, each made complete by itself: what is lost changes the noise of a pixel,
/// never its brightness.
fn layer(buffers: &[CompleteBuffer], aovs: &Aovs) -> Layer {
    let pixel = |pixel: usize| {
        let (mut sum, mut weights, mut samples) = (DVec3::ZERO, 0, 0);
        for buffer in buffers {
            if let Some(light) = buffer.light(pixel, aovs) {
                sum += f64::from(buffer.weight()) * light.as_dvec3();
                weights += buffer.weight();
            }
            samples += buffer.samples(pixel);
        }
        // Where the eye meets nothing there is no light to copy from a neighbour.
        let has_light = weights > 0 && aovs.depth[pixel].is_finite();
        (
            if has_light {
                (sum / f64::from(weights)).as_vec3()
            } else {
                Vec3::ZERO
            },
            samples,
        )
    };
    let (radiance, samples) = (0..aovs.size.pixel_count()).into_par_iter().map(pixel).unzip();
    Layer { radiance, samples }
}
