//! VPL sets that hold the same pixels, added up: they lack the same pixels, so they are made complete
//! together.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use crate::buffer::{Buffer, FrameBuffers};

/// Pixels that are summed at a time.
const PIXELS: usize = 512;

/// Sets that hold the same pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Alike {
    /// The first of them, which holds the mean of all.
    pub(super) set: u32,
    /// How many they are.
    pub(super) count: u32,
}

/// Puts the mean of sets that hold the same pixels into the first of them.
///
/// The sums are taken in the order of the sets' numbers, in f64. Fresh memory would cost more time than
/// the sums.
pub(super) fn average_alike(buffers: &mut FrameBuffers, sets: &[u32]) -> Vec<Alike> {
    let mut alike: BTreeMap<Vec<usize>, Vec<u32>> = BTreeMap::new();
    for &set in sets {
        if let Some(buffer) = buffers.set(set) {
            alike.entry(buffer.beginnings().collect()).or_default().push(set);
        }
    }
    alike
        .into_values()
        .map(|sets| {
            let (set, count) = (sets[0], sets.len() as u32);
            if let Some(mut first) = buffers.set_mut(set).take() {
                let others: Vec<_> = sets[1..].iter().filter_map(|&set| buffers.set(set)).collect();
                average(&mut first, &others);
                *buffers.set_mut(set) = Some(first);
            }
            Alike { set, count }
        })
        .collect()
}

fn average(first: &mut Buffer<3>, others: &[&Buffer<3>]) {
    let count = 1.0 + others.len() as f64;
    let chunks = first.light.par_chunks_mut(PIXELS).enumerate();
    chunks.filter(|_| !others.is_empty()).for_each(|(chunk, light)| {
        let begin = chunk * PIXELS;
        let mut sums = [DVec3::ZERO; PIXELS];
        add(&mut sums, light);
        for other in others {
            add(&mut sums, &other.light[begin..begin + light.len()]);
        }
        for (light, sum) in light.iter_mut().zip(sums) {
            *light = (sum / count).as_vec3().to_array();
        }
    });
}

fn add(sums: &mut [DVec3], light: &[[f32; 3]]) {
    for (sum, &[r, g, b]) in sums.iter_mut().zip(light) {
        *sum += DVec3::new(f64::from(r), f64::from(g), f64::from(b));
    }
}
