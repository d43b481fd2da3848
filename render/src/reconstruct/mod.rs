//! From buffers to a picture, whatever is missing.
//!
//! Each buffer is made complete by itself, in linear radiance, before buffers and components are added
//! (section 3.2.2). Total: any subset of the results, none included, gives a picture.

mod alike;
mod complete;
pub mod guided;
mod kept_sets;
mod nearest;
mod passes;

pub use kept_sets::Coverage;
pub use nearest::nearest_known;

use std::sync::Arc;

use rayon::prelude::*;

use crate::{
    buffer::FrameBuffers,
    gbuffer::Aovs,
    image::{Picture, Rows},
    settings::Algorithm,
};
use alike::{Alike, average_alike};
use complete::{CompleteBuffer, Completion, Sum};
use kept_sets::KeptSets;

/// How pixels without data are filled in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reconstruction {
    /// All light is averaged along the surfaces, as far as its noise asks for it ([`guided`]). The buffers of
    /// the paper's algorithms have nothing to tell the noise by: they are filled in by `Nearest`.
    Guided,
    /// The same, not as far: for half of the time.
    Quick,
    /// With the value of the nearest pixel that has data, in each buffer by itself (section 3.1.1).
    Nearest,
    /// Not at all: they stay black, so that one can see what was missing.
    None,
}

impl Reconstruction {
    /// What there may be time for when there is none for this: about half as much.
    #[must_use]
    pub fn cheaper(self) -> Self {
        match self {
            Self::Guided => Self::Quick,
            Self::Quick => Self::Nearest,
            Self::Nearest | Self::None => Self::None,
        }
    }
}

/// Rows that a core works on at a time.
const BAND_ROWS: usize = 16;
/// Pixels whose sums are kept at hand.
const RUN_PIXELS: usize = 256;

/// Makes the picture from all that has arrived. The buffers are used up by it: their memory serves as
/// scratch space.
///
/// `min_set_percent` is the share of pixels under which the buffer of a VPL set is left out while
/// others have more (section 3.2.2).
pub fn assemble(
    buffers: &mut FrameBuffers,
    aovs: &Arc<Aovs>,
    method: Reconstruction,
    min_set_percent: f32,
) -> Picture {
    if let Some(buffers) = buffers.passes() {
        return passes::assemble(buffers, aovs, method);
    }
    buffers.settle();
    let kept = KeptSets::choose(buffers, min_set_percent);
    let alike = average_alike(buffers, &kept.sets);
    let buffers = &*buffers;
    let completion = Completion {
        groups: buffers.groups(),
        aovs,
        method,
    };
    let (direct, indirect) = match buffers.settings().algorithm {
        Algorithm::Component | Algorithm::Progressive => rayon::join(
            || vec![completion.direct(buffers.direct())],
            || {
                let complete = |alike: &Alike| Some(completion.sets(buffers.set(alike.set)?, alike.count));
                alike.par_iter().filter_map(complete).collect()
            },
        ),
        Algorithm::Straightforward => match buffers.full().map(|full| completion.full(full)) {
            Some([direct, indirect]) => (vec![direct], vec![indirect]),
            None => (Vec::new(), Vec::new()),
        },
    };
    let mut picture = Picture::from_rows(aovs, BAND_ROWS, |rows| {
        fill(rows, &direct, &indirect, aovs);
    });
    picture.coverage = kept.coverage(
        &picture.samples_direct,
        &picture.samples_indirect,
        buffers.settings(),
    );
    picture
}

/// The mean of the buffers, each made complete by itself: what is lost changes the noise of a pixel,
/// never its brightness.
fn fill(rows: Rows<'_>, direct: &[CompleteBuffer<'_>], indirect: &[CompleteBuffer<'_>], aovs: &Aovs) {
    let mut sums = [Sum::default(); RUN_PIXELS];
    for (buffers, light, samples) in [
        (direct, rows.direct, rows.samples_direct),
        (indirect, rows.indirect, rows.samples_indirect),
    ] {
        let runs = light.chunks_mut(RUN_PIXELS).zip(samples.chunks_mut(RUN_PIXELS));
        for (first, (light, samples)) in (rows.first..).step_by(RUN_PIXELS).zip(runs) {
            let sums = &mut sums[..light.len()];
            sums.fill(Sum::default());
            for buffer in buffers {
                buffer.add_to(sums, first, aovs);
            }
            for ((pixel, sum), (light, samples)) in (first..).zip(sums).zip(light.iter_mut().zip(samples)) {
                *samples = sum.samples;
                // Where the eye meets nothing there is no light to copy from a neighbour.
                if aovs.depth[pixel].is_finite() {
                    *light = sum.mean();
                }
            }
        }
    }
}
