//! Where the pixels that a buffer lacks are copied from.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::nearest_known;
use crate::{pixel_group::PixelGroups, scene::ImageSize};

/// A pixel with data, by its place in the groups.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source {
    pub(super) group: u32,
    pub(super) place: u32,
}

/// The sources of all pixels that a buffer lacks.
#[derive(Debug, Default)]
pub(super) struct Fill {
    /// For each group the number of pixels with data, and the sources of the others.
    groups: Vec<(usize, Vec<Source>)>,
}

impl Fill {
    /// Nothing is copied.
    pub(super) fn nothing() -> Self {
        Self::default()
    }

    /// The nearest pixel with data; `prefixes` says how many pixels of each group have data.
    pub(super) fn nearest(groups: &PixelGroups, size: ImageSize, prefixes: &[u32]) -> Self {
        let numbers = 0..groups.len() as u32;
        let complete = |group: u32| prefixes[group as usize] as usize == groups.pixels(group).len();
        if numbers.clone().all(complete) {
            return Self::nothing();
        }
        let mut known = vec![false; size.pixel_count()];
        let mut place_of = vec![Source { group: 0, place: 0 }; size.pixel_count()];
        for group in numbers.clone() {
            for (place, &pixel) in groups.pixels(group)[..prefixes[group as usize] as usize]
                .iter()
                .enumerate()
            {
                known[pixel as usize] = true;
                place_of[pixel as usize] = Source {
                    group,
                    place: place as u32,
                };
            }
        }
        let Some(nearest) = nearest_known(&known, size) else {
            return Self::nothing();
        };
        let sources = |group: u32| {
            let prefix = prefixes[group as usize] as usize;
            let missing = groups.pixels(group)[prefix..].iter();
            (
                prefix,
                missing
                    .map(|&pixel| place_of[nearest[pixel as usize] as usize])
                    .collect(),
            )
        };
        Self {
            groups: numbers.into_par_iter().map(sources).collect(),
        }
    }

    /// Where to copy from for a pixel without data; `None` if nothing is to be copied.
    pub(super) fn source(&self, group: u32, place: usize) -> Option<Source> {
        let (prefix, sources) = self.groups.get(group as usize)?;
        sources.get(place - prefix).copied()
    }
}

/// The fills of several buffers; buffers that lack the same pixels share theirs.
#[derive(Debug)]
pub(super) struct SourceMaps {
    fills: Vec<Fill>,
    /// For each buffer the index of its fill.
    index: Vec<usize>,
}

impl SourceMaps {
    pub(super) fn new(buffers: impl Iterator<Item = Vec<u32>>, fill: impl Fn(&[u32]) -> Fill + Sync) -> Self {
        let mut distinct = BTreeMap::new();
        let mut prefixes = Vec::new();
        let index = buffers
            .map(|buffer| {
                *distinct.entry(buffer.clone()).or_insert_with(|| {
                    prefixes.push(buffer);
                    prefixes.len() - 1
                })
            })
            .collect();
        Self {
            fills: prefixes.par_iter().map(|prefixes| fill(prefixes)).collect(),
            index,
        }
    }

    /// The fill of each buffer.
    pub(super) fn fills(&self) -> impl Iterator<Item = &Fill> {
        self.index.iter().map(|&index| &self.fills[index])
    }
}
