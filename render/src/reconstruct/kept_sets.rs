//! Which VPL sets enter the picture, and how much of each component is real data.

use serde::Serialize;

use crate::{
    buffer::{Buffer, FrameBuffers},
    settings::{Algorithm, Settings},
};

/// How much of the picture is real data and how much was reconstructed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Coverage {
    /// Share of pixels without any direct sample, in percent.
    pub direct_reconstructed_percent: f64,
    /// Share of pixels without data, in percent: the mean over the buffers that hold any (Table 1).
    pub indirect_reconstructed_percent: f64,
    /// VPL sets of which any data arrived.
    pub open_sets: u32,
    /// Open sets that were left out for having too little.
    pub dropped_sets: u32,
    /// Samples of direct light per pixel, on the average.
    pub direct_samples: f64,
    /// VPL sets per pixel, on the average.
    pub indirect_samples: f64,
}

/// The sets whose buffers are averaged.
#[derive(Debug)]
pub(super) struct KeptSets {
    /// Numbers of the kept sets, ascending.
    pub(super) sets: Vec<u32>,
    /// Share of pixels with data in each open set.
    open: Vec<f64>,
}

impl KeptSets {
    /// Leaves out buffers with less than the minimum while others have that much (section 3.2.2).
    pub(super) fn choose(buffers: &FrameBuffers, min_set_percent: f32) -> Self {
        let pixels = buffers.settings().size.pixel_count() as f64;
        let share = |set: u32| buffers.set(set).map_or(0, Buffer::pixels) as f64 / pixels;
        let open: Vec<(u32, f64)> = (0..buffers.settings().vpl_sets)
            .map(|set| (set, share(set)))
            .filter(|&(_, share)| share > 0.0)
            .collect();
        let enough = |&&(_, share): &&(u32, f64)| share * 100.0 >= f64::from(min_set_percent);
        let mut sets: Vec<u32> = open.iter().filter(enough).map(|&(set, _)| set).collect();
        if sets.is_empty() {
            sets = open.iter().map(|&(set, _)| set).collect();
        }
        Self {
            sets,
            open: open.into_iter().map(|(_, share)| share).collect(),
        }
    }

    pub(super) fn coverage(&self, direct: &[u32], indirect: &[u32], settings: &Settings) -> Coverage {
        let missing_percent = |samples: &[u32]| {
            100.0 * samples.iter().filter(|&&count| count == 0).count() as f64 / samples.len() as f64
        };
        let mean = |samples: &[u32]| {
            samples.iter().map(|&count| u64::from(count)).sum::<u64>() as f64 / samples.len() as f64
        };
        let open_sets = self.open.len() as u32;
        let indirect_missing = match settings.algorithm {
            Algorithm::Straightforward => missing_percent(indirect),
            _ if self.open.is_empty() => 100.0,
            _ => 100.0 - 100.0 * self.open.iter().sum::<f64>() / f64::from(open_sets),
        };
        Coverage {
            direct_reconstructed_percent: missing_percent(direct),
            indirect_reconstructed_percent: indirect_missing,
            open_sets,
            dropped_sets: open_sets - self.sets.len() as u32,
            direct_samples: mean(direct),
            indirect_samples: mean(indirect),
        }
    }
}
