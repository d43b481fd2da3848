//! Pictures as rows of planes with margins, so that loops over pixels become loops over vectors.

use rayon::prelude::*;

use crate::scene::ImageSize;

/// Pixels whose sums stay in registers.
pub(super) const LANES: usize = 8;

/// Pixels whose weights stay in the first cache.
pub(super) const BLOCK: usize = 64;

/// Pixels left and right of a row that belong to no picture: as far as the widest level reaches.
pub(super) const MARGIN: usize = 32;

/// Where pixels are in planes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) width: usize,
    pub(super) height: usize,
    stride: usize,
}

impl Layout {
    pub(super) fn new(size: ImageSize) -> Self {
        let width = size.width as usize;
        Self {
            width,
            height: size.height as usize,
            stride: width.next_multiple_of(BLOCK) + 2 * MARGIN,
        }
    }

    /// Numbers in one row of a plane, margins included.
    pub(super) fn row_len(self) -> usize {
        self.stride
    }

    /// Places in a row of a plane where blocks of pixels begin.
    pub(super) fn blocks(self) -> impl Iterator<Item = usize> {
        (MARGIN..MARGIN + self.width).step_by(BLOCK)
    }

    /// Places in a row of a plane where lanes of pixels begin.
    pub(super) fn lanes(self) -> impl Iterator<Item = usize> {
        (MARGIN..MARGIN + self.width).step_by(LANES)
    }
}

/// `N` numbers for each pixel, `[height][N][stride]`; zero outside of the picture.
#[derive(Debug)]
pub(super) struct Planes<const N: usize> {
    layout: Layout,
    numbers: Vec<f32>,
}

impl<const N: usize> Planes<N> {
    /// Zeros.
    pub(super) fn zeros(layout: Layout) -> Self {
        Self {
            layout,
            // Pages of memory are taken by the threads that fill them.
            numbers: vec![0.0; layout.height * N * layout.stride],
        }
    }

    pub(super) fn layout(&self) -> Layout {
        self.layout
    }

    /// A row of each plane, margins included.
    pub(super) fn row(&self, y: usize) -> [&[f32]; N] {
        let begin = y * N * self.layout.stride;
        std::array::from_fn(|plane| {
            let begin = begin + plane * self.layout.stride;
            &self.numbers[begin..begin + self.layout.stride]
        })
    }

    /// All rows, to be changed by all cores.
    pub(super) fn par_rows_mut(&mut self) -> impl IndexedParallelIterator<Item = [&mut [f32]; N]> {
        let stride = self.layout.stride;
        self.numbers.par_chunks_mut(N * stride).map(move |row| {
            let mut planes = row.chunks_mut(stride);
            std::array::from_fn(|_| planes.next().unwrap_or_default())
        })
    }
}

/// The numbers of some neighbouring pixels in a plane's row, from a place on.
///
/// # Panics
/// When the row ends before they do.
#[inline]
pub(super) fn lanes<const N: usize>(row: &[f32], begin: usize) -> &[f32; N] {
    &row[begin..].as_chunks().0[0]
}

/// The same, to be changed.
#[inline]
pub(super) fn lanes_mut<const N: usize>(row: &mut [f32], begin: usize) -> &mut [f32; N] {
    &mut row[begin..].as_chunks_mut().0[0]
}
