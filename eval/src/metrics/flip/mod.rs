//! FLIP: the difference that an eye sees when it alternates between two pictures.
//!
//! \[A20\] Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: FLIP: a difference
//! evaluator for alternating images, Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020.
//! \[A21\] Andersson, Nilsson, Shirley, Akenine-Möller: Visualizing errors in rendered high dynamic
//! range images, Eurographics short papers 2021.

mod color;
mod feature;
mod filter;
mod hdr;
mod ldr;

pub use self::hdr::Exposures;

use crate::image::{Encoding, Pair};
use crate::plane::Plane;

/// Pixels per degree of the published default: a 0.7 m wide screen of 3840 pixels at 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 67.02;

/// The difference between two pictures by FLIP.
#[derive(Debug, Clone, PartialEq)]
pub struct Flip {
    /// Mean over all pixels, 0..1.
    pub mean: f64,
    /// Difference at each pixel, 0..1.
    pub map: Plane,
    /// At which exposures linear pictures were compared; `None` for encoded ones.
    pub exposures: Option<Exposures>,
}

/// LDR-FLIP of encoded pictures, HDR-FLIP of linear ones.
///
/// HDR-FLIP chooses its exposures from the reference, so the pair's exposure does not matter.
#[must_use]
pub fn flip(pair: &Pair<'_>, pixels_per_degree: f64) -> Flip {
    let (map, exposures) = match pair.encoding() {
        Encoding::Encoded => (ldr::encoded(pair, pixels_per_degree), None),
        Encoding::Linear => {
            let exposures = Exposures::of(pair.reference());
            (hdr::largest(pair, exposures, pixels_per_degree), Some(exposures))
        }
    };
    Flip {
        mean: map.mean(),
        map,
        exposures,
    }
}
