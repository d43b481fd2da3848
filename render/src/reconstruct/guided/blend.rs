//! How far to follow the filter: as far as one half of the samples shows that it brings the other nearer.
//!
//! Let *A* and *B* be the light of both halves before a level, *A'* and *B'* after it. The share *s* of the
//! change for which *A + s·(A' − A)* is nearest to the truth, in the mean of squares, is
//! *s = E\[(A' − A)·(truth − A)\] / E\[(A' − A)²\]*. *B* is right on the average and knows nothing of *A*'s
//! noise, so it stands in for the truth. Expectations are means over near pixels, both halves and all
//! channels.

#![expect(
    clippy::inline_always,
    reason = "the kernels must become loops over constant lanes for the compiler to vectorise them"
)]

use embree4_sys as embree;
use rayon::prelude::*;

use super::{
    irradiance::{Irradiance, SIGNALS},
    level::Filtered,
    planes::{LANES, Layout, Planes, lanes, lanes_mut},
};

/// Weights of the pixels along each axis over which expectations are taken: a tent.
const TENT: [f32; 13] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0];
const RADIUS: usize = TENT.len() / 2;

/// How much a pixel counts that has no samples of its own, only what near ones told it.
const HEARSAY: f32 = 1e-6;

/// Moves irradiance towards what a level of the filter made of it.
#[derive(Debug)]
pub(super) struct Blend {
    /// For each component the expectations above and below the fraction's bar, summed along rows only.
    evidence: Planes<4>,
}

impl Blend {
    /// Nothing yet.
    pub(super) fn new(layout: Layout) -> Self {
        Self {
            evidence: Planes::zeros(layout),
        }
    }

    /// Moves all pixels, with all cores. Those of which nothing was known take on the filtered light.
    pub(super) fn towards(&mut self, filtered: &Filtered, irradiance: &mut Irradiance) {
        self.gather(filtered, irradiance);
        let (layout, evidence) = (self.evidence.layout(), &self.evidence);
        irradiance
            .planes
            .par_rows_mut()
            .enumerate()
            .for_each(|(y, mut light)| {
                let filtered = filtered.planes.row(y);
                let near: [_; TENT.len()] = std::array::from_fn(|tap| {
                    let row = (y + tap).checked_sub(RADIUS).filter(|&row| row < layout.height)?;
                    Some(evidence.row(row))
                });
                embree::with_wide_vectors(|| follow_row(layout, &mut light, &filtered, &near));
            });
    }

    fn gather(&mut self, filtered: &Filtered, irradiance: &Irradiance) {
        let layout = self.evidence.layout();
        let scratch = || [(); 4].map(|()| vec![0.0; layout.row_len()]);
        let rows = self.evidence.par_rows_mut().enumerate();
        rows.for_each_init(scratch, |scratch, (y, mut sums)| {
            let (before, after) = (irradiance.planes.row(y), filtered.planes.row(y));
            embree::with_wide_vectors(|| gather_row(layout, &mut sums, scratch, &before, &after));
        });
    }
}

/// Sums up the evidence along a row.
#[inline(always)]
fn gather_row(
    layout: Layout,
    sums: &mut [&mut [f32]; 4],
    scratch: &mut [Vec<f32>; 4],
    before: &[&[f32]; 4 * SIGNALS],
    after: &[&[f32]; 4 * SIGNALS],
) {
    let components = before.as_chunks::<8>().0.iter().zip(after.as_chunks::<8>().0);
    for ((before, after), sides) in components.zip(scratch.as_chunks_mut::<2>().0) {
        for begin in layout.lanes() {
            weigh(sides, begin, before, after);
        }
    }
    for (sums, scratch) in sums.iter_mut().zip(scratch) {
        for begin in layout.lanes() {
            *lanes_mut::<LANES>(sums, begin) = tent(|tap| Some(&scratch[begin + tap - RADIUS..]));
        }
    }
}

/// Moves a row of pixels, by the evidence in the rows near it.
#[inline(always)]
fn follow_row(
    layout: Layout,
    light: &mut [&mut [f32]; 4 * SIGNALS],
    filtered: &[&[f32]; 4 * SIGNALS],
    near: &[Option<[&[f32]; 4]>; TENT.len()],
) {
    let components = light
        .as_chunks_mut::<8>()
        .0
        .iter_mut()
        .zip(filtered.as_chunks::<8>().0);
    for (component, (light, filtered)) in components.enumerate() {
        for begin in layout.lanes() {
            let above = tent(|tap| Some(&near[tap]?[2 * component][begin..]));
            let below = tent(|tap| Some(&near[tap]?[2 * component + 1][begin..]));
            let share = share(&above, &below);
            let signals = light
                .as_chunks_mut::<4>()
                .0
                .iter_mut()
                .zip(filtered.as_chunks::<4>().0);
            for (light, filtered) in signals {
                follow(light, filtered, begin, &share);
            }
        }
    }
}

/// Writes down what some pixels have to say about both sides of the fraction's bar. A pixel with samples in
/// one half only has nothing to hold against the filter: it votes for the whole way, lest the few that have
/// both, perhaps lit by the same lights, decide for all.
///
/// `before` and `after` are rows of red, green, blue and weight of both halves.
#[inline(always)]
fn weigh([above, below]: &mut [Vec<f32>; 2], begin: usize, before: &[&[f32]; 8], after: &[&[f32]; 8]) {
    let [mut products, mut squares_a, mut squares_b] = [[0.0; LANES]; 3];
    for channel in 0..3 {
        let [a, b, filtered_a, filtered_b] = [
            before[channel],
            before[channel + 4],
            after[channel],
            after[channel + 4],
        ]
        .map(|row| lanes::<LANES>(row, begin));
        for i in 0..LANES {
            let (change_a, change_b) = (filtered_a[i] - a[i], filtered_b[i] - b[i]);
            products[i] += (b[i] - a[i]) * (change_a - change_b);
            squares_a[i] += change_a * change_a;
            squares_b[i] += change_b * change_b;
        }
    }
    let (weight_a, weight_b) = (lanes::<LANES>(before[3], begin), lanes::<LANES>(before[7], begin));
    let (above, below) = (lanes_mut::<LANES>(above, begin), lanes_mut::<LANES>(below, begin));
    for i in 0..LANES {
        let is_a = if weight_a[i] > HEARSAY { 1.0 } else { 0.0 };
        let is_b = if weight_b[i] > HEARSAY { 1.0 } else { 0.0 };
        let both = is_a * is_b;
        let alone = (is_a - both) * squares_a[i] + (is_b - both) * squares_b[i];
        above[i] = both * products[i] + alone;
        below[i] = both * (squares_a[i] + squares_b[i]) + alone;
    }
}

/// How far to follow the filter at some pixels: from 0 to 1.
#[inline(always)]
fn share(above: &[f32; LANES], below: &[f32; LANES]) -> [f32; LANES] {
    let mut share = [0.0; LANES];
    for i in 0..LANES {
        // Without two halves there is nothing to hold against the filter.
        let optimum = if below[i] > 0.0 { above[i] / below[i] } else { 1.0 };
        let optimum = if optimum < 1.0 { optimum } else { 1.0 };
        share[i] = if optimum > 0.0 { optimum } else { 0.0 };
    }
    share
}

/// The weighted sum of the numbers that `near` has for each place of the tent.
#[inline(always)]
fn tent<'a>(near: impl Fn(usize) -> Option<&'a [f32]>) -> [f32; LANES] {
    let mut sums = [0.0; LANES];
    for (tap, weight) in TENT.into_iter().enumerate() {
        if let Some(near) = near(tap) {
            let near = lanes::<LANES>(near, 0);
            for i in 0..LANES {
                sums[i] += weight * near[i];
            }
        }
    }
    sums
}

/// Moves some pixels of a signal, red, green, blue and weight, by a share of the way.
#[inline(always)]
fn follow(light: &mut [&mut [f32]; 4], filtered: &[&[f32]; 4], begin: usize, share: &[f32; LANES]) {
    let weight = *lanes::<LANES>(light[3], begin);
    let near = lanes::<LANES>(filtered[3], begin);
    let mut way = [0.0; LANES];
    for i in 0..LANES {
        let share = if weight[i] > 0.0 { share[i] } else { 1.0 };
        way[i] = if near[i] > 0.0 { share } else { 0.0 };
    }
    for (light, filtered) in light.iter_mut().zip(filtered).take(3) {
        let (light, filtered) = (lanes_mut::<LANES>(light, begin), lanes::<LANES>(filtered, begin));
        for i in 0..LANES {
            light[i] += way[i] * (filtered[i] - light[i]);
        }
    }
    let known = lanes_mut::<LANES>(light[3], begin);
    for i in 0..LANES {
        let at_least = if near[i] > 0.0 { HEARSAY } else { 0.0 };
        known[i] = if weight[i] > at_least { weight[i] } else { at_least };
    }
}
