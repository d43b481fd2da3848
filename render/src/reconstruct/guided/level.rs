//! One level of the wavelet: weighted means over 5×5 pixels some way apart.

#![expect(
    clippy::inline_always,
    reason = "the kernel must become one loop over constant lanes for the compiler to vectorise it"
)]

use embree4_sys as embree;
use rayon::prelude::*;

use super::{
    irradiance::{Irradiance, SIGNALS},
    planes::{BLOCK, LANES, Layout, Planes, lanes, lanes_mut},
    surface::{Surfaces, likeness},
};

/// The B3 spline's weights along an axis.
const SPLINE: [f32; 5] = [1.0 / 16.0, 1.0 / 4.0, 3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];

/// Sums of weights that are no smaller can be divided by.
const WEIGHT_MIN: f32 = 1e-20;

/// Irradiance of each signal after a level.
#[derive(Debug)]
pub(super) struct Filtered {
    /// For each signal red, green, blue, and the sum of the weights: 0 where nothing alike is near.
    pub(super) planes: Planes<{ 4 * SIGNALS }>,
}

impl Filtered {
    /// Nothing yet.
    pub(super) fn new(layout: Layout) -> Self {
        Self {
            planes: Planes::zeros(layout),
        }
    }

    /// Averages over pixels `step` apart, with all cores.
    pub(super) fn filter(&mut self, irradiance: &Irradiance, surfaces: &Surfaces, step: usize) {
        let layout = self.planes.layout();
        let mut rows: Vec<_> = self.planes.par_rows_mut().enumerate().collect();
        // Rows that look at the same rows follow each other, so that these stay in the cache.
        rows.sort_by_key(|&(y, _)| (y % step, y));
        rows.into_par_iter().for_each(|(y, mut row)| {
            embree::with_wide_vectors(|| {
                for begin in layout.blocks() {
                    filter_block(&mut row, begin, y, irradiance, surfaces, step);
                }
            });
        });
    }
}

#[inline(always)]
fn filter_block(
    out: &mut [&mut [f32]; 4 * SIGNALS],
    begin: usize,
    y: usize,
    irradiance: &Irradiance,
    surfaces: &Surfaces,
    step: usize,
) {
    let here = surfaces.row(y);
    let first = begin - 2 * step;
    let mut sums = [[0.0; BLOCK]; 4 * SIGNALS];
    for (tap_y, weight_y) in SPLINE.into_iter().enumerate() {
        let Some(row) = (y + tap_y * step).checked_sub(2 * step) else {
            continue;
        };
        if row >= surfaces.layout().height {
            break;
        }
        let there = surfaces.row(row);
        let mut weights = [[0.0; BLOCK]; 5];
        for (tap_x, weight_x) in SPLINE.into_iter().enumerate() {
            let alike = likeness(here, begin, there, first + tap_x * step);
            weights[tap_x] = alike.map(|alike| weight_y * weight_x * alike);
        }
        let light = irradiance.planes.row(row);
        for (sums, light) in sums
            .as_chunks_mut::<4>()
            .0
            .iter_mut()
            .zip(light.as_chunks::<4>().0)
        {
            add_weighted(
                sums,
                &weights,
                light.map(|row| &row[first..first + 4 * step + BLOCK]),
                step,
            );
        }
    }
    for (sums, out) in sums.as_chunks::<4>().0.iter().zip(out.as_chunks_mut::<4>().0) {
        divide(sums, out.each_mut().map(|row| lanes_mut(row, begin)));
    }
}

/// Adds a row of five taps of a signal: each pixel by its weight and by how much it counts.
#[inline(always)]
fn add_weighted(sums: &mut [[f32; BLOCK]; 4], weights: &[[f32; BLOCK]; 5], light: [&[f32]; 4], step: usize) {
    for begin in (0..BLOCK).step_by(LANES) {
        let mut sum: [[f32; LANES]; 4] = sums.each_ref().map(|sum| *lanes(sum, begin));
        for (tap, weights) in weights.iter().enumerate() {
            let weights: &[f32; LANES] = lanes(weights, begin);
            let light: [&[f32; LANES]; 4] = light.map(|row| lanes(row, tap * step + begin));
            for i in 0..LANES {
                let weight = weights[i] * light[3][i];
                sum[0][i] += weight * light[0][i];
                sum[1][i] += weight * light[1][i];
                sum[2][i] += weight * light[2][i];
                sum[3][i] += weight;
            }
        }
        for (sums, sum) in sums.iter_mut().zip(sum) {
            *lanes_mut(sums, begin) = sum;
        }
    }
}

/// Makes means of sums.
#[inline(always)]
fn divide(sums: &[[f32; BLOCK]; 4], [red, green, blue, total]: [&mut [f32; BLOCK]; 4]) {
    for i in 0..BLOCK {
        let is_known = sums[3][i] > WEIGHT_MIN;
        let scale = if is_known { 1.0 / sums[3][i] } else { 0.0 };
        red[i] = scale * sums[0][i];
        green[i] = scale * sums[1][i];
        blue[i] = scale * sums[2][i];
        total[i] = if is_known { sums[3][i] } else { 0.0 };
    }
}
