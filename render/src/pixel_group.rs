//! Pixel groups: pixels spread over the whole image by a Sobol sequence (section 3.1.1, figure 1).
//!
//! The smallest power-of-two grid over the image is filled by the (0,2)-sequence, which visits each of
//! its cells exactly once; the cells inside the image, in the order of the visit, are cut into groups of
//! equal size. So every pixel is in exactly one group, and any run of the order, thus any group, any
//! union of consecutive groups and any beginning of a group, is spread evenly over the image.
//!
//! Within a group the order is cut into chunks. Inside a chunk the pixels follow a Morton curve, since
//! rays through near pixels are faster together; for how shadow rays are put together, see
//! [`section`](crate::section). The progressive algorithm, which comes to every pixel many times, orders
//! the whole group so: the pixels of a chunk are then as near as a group allows.

use rayon::prelude::*;

use crate::{
    sample::sobol::{fold_seed, point_bits},
    scene::ImageSize,
    settings::{Algorithm, Settings},
};

/// Rays in one chunk, a millisecond or two of work.
const RAYS_PER_CHUNK: usize = 16_384;
/// Chunks hold a multiple of this many pixels, the widest ray packet.
const CHUNK_STEP: usize = 16;
/// Largest chunk: a stopped task loses at most what it has not finished of one chunk.
const CHUNK_MAX: usize = 1_024;
/// Largest chunk of the progressive algorithm, whose tasks take several passes over each.
const CHUNK_MAX_PROGRESSIVE: usize = 256;
/// About so many pixels are in a section: a few milliseconds of rays from the eye, which nothing stops.
const SECTION_PIXELS: usize = 16_384;

/// The division of an image into groups.
#[derive(Debug, Clone)]
pub struct PixelGroups {
    order: Vec<u32>,
    groups: usize,
    chunk_pixels: usize,
}

impl PixelGroups {
    /// Divides the image as the settings say. Deterministic in size, groups, seed and chunk size.
    pub fn new(settings: &Settings) -> Self {
        let chunk_pixels = chunk_pixels(settings);
        let groups = settings.groups as usize;
        let mut order = sobol_order(settings.size, fold_seed(settings.seed, SEED_PURPOSE));
        let count = order.len();
        let mut rest = order.as_mut_slice();
        let mut chunks = Vec::new();
        for group in 0..groups {
            let (head, tail) =
                rest.split_at_mut(group_start(count, groups, group + 1) - group_start(count, groups, group));
            let sorted = match settings.algorithm {
                Algorithm::Progressive => head.len().max(1),
                _ => chunk_pixels,
            };
            chunks.extend(head.chunks_mut(sorted));
            rest = tail;
        }
        let width = settings.size.width;
        chunks
            .into_par_iter()
            .for_each(|chunk| sort_along_morton_curve(chunk, width));
        Self {
            order,
            groups,
            chunk_pixels,
        }
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.groups
    }

    /// Whether there is no group; never so for valid settings.
    pub fn is_empty(&self) -> bool {
        self.groups == 0
    }

    /// Row-major indices of the pixels of a group, in the order in which they are rendered.
    ///
    /// # Panics
    /// If there is no such group.
    pub fn pixels(&self, group: u32) -> &[u32] {
        assert!((group as usize) < self.groups, "group {group} of {}", self.groups);
        &self.order[self.range(group)]
    }

    /// Row-major indices of all pixels, group after group.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The places of a group's pixels in [`PixelGroups::order`].
    fn range(&self, group: u32) -> std::ops::Range<usize> {
        let start = |group: usize| group_start(self.order.len(), self.groups, group);
        start(group as usize)..start(group as usize + 1)
    }

    /// Pixels in a chunk; the last one of a group may have fewer.
    pub fn chunk_pixels(&self) -> usize {
        self.chunk_pixels
    }

    /// Pixels in a section, whole chunks of them that may be rendered together; the last one of a group may
    /// have fewer.
    pub fn section_pixels(&self) -> usize {
        (SECTION_PIXELS / self.chunk_pixels).max(1) * self.chunk_pixels
    }

    /// Whether a task may end after this many pixels of the group: after whole chunks, or all.
    pub fn is_prefix(&self, group: u32, pixels: usize) -> bool {
        let len = self.pixels(group).len();
        pixels == len || (pixels < len && pixels.is_multiple_of(self.chunk_pixels))
    }
}

/// Chunks of one group, on the average: what a stopped task may be cut into.
pub fn chunks_per_group(settings: &Settings) -> f64 {
    let pixels = settings.size.pixel_count() as f64 / f64::from(settings.groups);
    (pixels / chunk_pixels(settings) as f64).max(1.0)
}

/// Sets the scrambling of pixel groups apart from that of light.
const SEED_PURPOSE: u32 = 0x6772_6f75;

fn group_start(pixels: usize, groups: usize, group: usize) -> usize {
    // Sizes differ by one pixel at most.
    pixels * group / groups
}

fn chunk_pixels(settings: &Settings) -> usize {
    let rays_per_pixel = match settings.algorithm {
        Algorithm::Component | Algorithm::Progressive => settings.vpls_per_set(),
        Algorithm::Straightforward => settings.spp + settings.vpls,
    };
    let pixels = RAYS_PER_CHUNK / rays_per_pixel as usize;
    let max = match settings.algorithm {
        Algorithm::Progressive => CHUNK_MAX_PROGRESSIVE,
        _ => CHUNK_MAX,
    };
    pixels.clamp(CHUNK_STEP, max).next_multiple_of(CHUNK_STEP)
}

/// All pixels of the image in the order in which the sequence visits them.
fn sobol_order(size: ImageSize, seed: u32) -> Vec<u32> {
    let bits = |side: u32| side.next_power_of_two().trailing_zeros();
    let (columns, rows) = (bits(size.width), bits(size.height));
    let cell = |fraction: u32, bits: u32| if bits == 0 { 0 } else { fraction >> (32 - bits) };
    (0..1u32 << (columns + rows))
        .into_par_iter()
        .filter_map(|index| {
            let [x, y] = point_bits(index, seed);
            let (x, y) = (cell(x, columns), cell(y, rows));
            (x < size.width && y < size.height).then(|| y * size.width + x)
        })
        .collect()
}

fn sort_along_morton_curve(chunk: &mut [u32], width: u32) {
    let mut keyed: Vec<u64> = chunk
        .iter()
        .map(|&pixel| u64::from(morton(pixel % width, pixel / width)) << 32 | u64::from(pixel))
        .collect();
    keyed.sort_unstable();
    for (pixel, key) in chunk.iter_mut().zip(keyed) {
        *pixel = key as u32;
    }
}

/// Interleaves the lower 16 bits of both coordinates.
pub(crate) fn morton(x: u32, y: u32) -> u32 {
    let spread = |v: u32| {
        let v = v & 0xffff;
        let v = (v | v << 8) & 0x00ff_00ff;
        let v = (v | v << 4) & 0x0f0f_0f0f;
        let v = (v | v << 2) & 0x3333_3333;
        (v | v << 1) & 0x5555_5555
    };
    spread(x) | spread(y) << 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn groups(width: u32, height: u32, groups: u32, seed: u64) -> PixelGroups {
        let size = ImageSize { width, height };
        PixelGroups::new(&Settings {
            groups,
            seed,
            ..Settings::paper(Algorithm::Component, size)
        })
    }

    proptest! {
        #[test]
        fn every_pixel_is_in_exactly_one_group(width in 1u32..70, height in 1u32..70, count in 1u32..40, seed: u64) {
            let groups = groups(width, height, count, seed);
            let mut pixels: Vec<u32> = (0..count).flat_map(|g| groups.pixels(g).to_vec()).collect();
            pixels.sort_unstable();
            prop_assert_eq!(pixels, (0..width * height).collect::<Vec<_>>());
        }

        #[test]
        fn groups_differ_by_one_pixel_at_most(width in 1u32..70, height in 1u32..70, count in 1u32..40) {
            let groups = groups(width, height, count, 0);
            let sizes: Vec<usize> = (0..count).map(|g| groups.pixels(g).len()).collect();
            prop_assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1);
        }
    }

    #[test]
    fn each_group_visits_every_part_of_the_image_evenly() {
        let groups = groups(1024, 768, 64, 0);
        for group in 0..64 {
            let mut tiles = [0u32; 32 * 24];
            for &pixel in groups.pixels(group) {
                tiles[((pixel / 1024 / 32) * 32 + pixel % 1024 / 32) as usize] += 1;
            }
            // 1,024 pixels in a tile of 32×32, 16 of them in each of the 64 groups; a run that does not
            // begin at a multiple of its length may split an elementary interval.
            assert!(
                tiles.iter().all(|count| (8..=24).contains(count)),
                "group {group}: {tiles:?}"
            );
        }
    }

    #[test]
    fn a_chunk_holds_a_millisecond_of_rays_for_both_algorithms() {
        let size = ImageSize {
            width: 1024,
            height: 768,
        };
        let chunk = |algorithm| PixelGroups::new(&Settings::paper(algorithm, size)).chunk_pixels();
        assert_eq!(chunk(Algorithm::Component), 1024);
        assert_eq!(chunk(Algorithm::Straightforward), 64);
    }

    #[test]
    fn only_whole_chunks_or_the_whole_group_are_prefixes() {
        let groups = groups(1024, 768, 64, 0);
        assert_eq!(groups.pixels(3).len(), 12_288);
        for (pixels, is_prefix) in [
            (0, true),
            (1024, true),
            (1000, false),
            (12_288, true),
            (13_312, false),
        ] {
            assert_eq!(groups.is_prefix(3, pixels), is_prefix, "{pixels}");
        }
    }
}
