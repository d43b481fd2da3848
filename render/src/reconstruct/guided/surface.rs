//! How alike the surfaces are that two pixels see.

#![expect(
    clippy::inline_always,
    reason = "the weights must become one loop over constant lanes for the compiler to vectorise it"
)]

use rayon::prelude::*;

use super::planes::{BLOCK, Layout, MARGIN, Planes, lanes};
use crate::gbuffer::Aovs;

/// Weight of the squared difference of two normals: 1/8 of the weight is left at an angle of 33°.
const NORMAL_WEIGHT: f32 = 2.0;
/// Weight of the squared distances of two points from each other's tangent planes, in widths of a pixel there.
const PLANE_WEIGHT: f32 = 0.0375;

/// Normals, positions and sizes of pixels.
#[derive(Debug)]
pub(super) struct Surfaces {
    /// Normal, position, and the reciprocal of a pixel's width at its surface; zeros where nothing is seen.
    planes: Planes<7>,
}

impl Surfaces {
    pub(super) fn new(aovs: &Aovs) -> Self {
        let mut planes = Planes::zeros(Layout::new(aovs.size));
        let (camera, width) = (&aovs.camera, aovs.size.width as usize);
        planes.par_rows_mut().enumerate().for_each(|(y, mut row)| {
            for (x, pixel) in (y * width..(y + 1) * width).enumerate() {
                let depth = aovs.depth[pixel];
                if !depth.is_finite() || depth <= 0.0 {
                    continue;
                }
                let direction = camera.direction(x as f32 + 0.5, y as f32 + 0.5);
                let position = camera.eye() + depth * direction;
                let numbers = [aovs.normal[pixel], position].map(|vector| vector.to_array());
                for (plane, number) in row.iter_mut().zip(numbers.as_flattened()) {
                    plane[MARGIN + x] = *number;
                }
                row[6][MARGIN + x] = 1.0 / (depth * camera.pixel_width());
            }
        });
        Self { planes }
    }

    pub(super) fn layout(&self) -> Layout {
        self.planes.layout()
    }

    /// A row of pixels.
    pub(super) fn row(&self, y: usize) -> [&[f32]; 7] {
        self.planes.row(y)
    }
}

/// How alike the surfaces of two blocks of pixels are, pixel by pixel: 1 for the same plane, 0 for surfaces
/// that have nothing to do with each other. Symmetric.
#[inline(always)]
pub(super) fn likeness(p: [&[f32]; 7], p_begin: usize, q: [&[f32]; 7], q_begin: usize) -> [f32; BLOCK] {
    let p = p.map(|row| lanes::<BLOCK>(row, p_begin));
    let q = q.map(|row| lanes::<BLOCK>(row, q_begin));
    let mut likeness = [0.0; BLOCK];
    for i in 0..BLOCK {
        let delta = |plane: usize| q[plane][i] - p[plane][i];
        let (nx, ny, nz) = (delta(0), delta(1), delta(2));
        let (dx, dy, dz) = (delta(3), delta(4), delta(5));
        let from_p = dx * p[0][i] + dy * p[1][i] + dz * p[2][i];
        let from_q = dx * q[0][i] + dy * q[1][i] + dz * q[2][i];
        let bend = nx * nx + ny * ny + nz * nz;
        let rise = (from_p * from_p + from_q * from_q) * (p[6][i] * q[6][i]);
        let near = 1.0 - (NORMAL_WEIGHT * bend + PLANE_WEIGHT * rise);
        // One instruction, where `f32::max` would look for NaNs first.
        let near = if near > 0.0 { near } else { 0.0 };
        // Close to exp(−4·difference), without a tail.
        likeness[i] = (near * near) * (near * near);
    }
    likeness
}
