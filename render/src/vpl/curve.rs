//! Candidates in an order in which neighbours light the same surroundings.

use glam::Vec3;
use rayon::prelude::*;

use super::Vpl;
use crate::curve::Curve;

/// Sorts along the [`Curve`] through the bounds of the scene: what is drawn at even steps along it is
/// spread evenly over each wall.
pub(super) fn sort_along_curve(vpls: &mut [Vpl], bounds: Option<(Vec3, Vec3)>) {
    let Some((min, max)) = bounds else {
        return;
    };
    let curve = Curve::through(min, max);
    // A stable sort, so that equal keys keep the order of the paths.
    vpls.par_sort_by_cached_key(|vpl| curve.place(vpl.position, vpl.normal));
}
