//! Nearest-neighbour reconstruction: each missing pixel takes the value of the nearest known one.
//!
//! The exact Euclidean feature transform in two sweeps (Felzenszwalb and Huttenlocher, "Distance
//! transforms of sampled functions", 2012): nearest known pixel along each column, then the lower
//! envelope of the columns' parabolas along each row. Linear in the number of pixels, whatever is
//! missing.

use rayon::prelude::*;

use crate::scene::ImageSize;

/// For each pixel the row-major index of the nearest pixel that is known; `None` when none is.
///
/// Of equally near pixels the left column wins, then the upper row.
pub fn nearest_known(known: &[bool], size: ImageSize) -> Option<Vec<u32>> {
    if !known.contains(&true) {
        return None;
    }
    let (width, height) = (size.width as usize, size.height as usize);
    let rows = nearest_rows(known, width, height);
    let mut nearest = vec![0; known.len()];
    nearest
        .par_chunks_mut(width)
        .zip(rows.par_chunks(width))
        .enumerate()
        .for_each_init(Envelope::default, |envelope, (y, (nearest, rows))| {
            envelope.fill_row(y, rows, nearest);
        });
    Some(nearest)
}

/// No known pixel in the column.
const NONE: u32 = u32::MAX;

/// For each pixel the row of the nearest known pixel in its column.
fn nearest_rows(known: &[bool], width: usize, height: usize) -> Vec<u32> {
    let mut rows = vec![NONE; known.len()];
    let mut above = vec![NONE; width];
    for y in 0..height {
        let line = y * width..(y + 1) * width;
        for ((row, above), &known) in rows[line.clone()].iter_mut().zip(&mut above).zip(&known[line]) {
            if known {
                *above = y as u32;
            }
            *row = *above;
        }
    }
    let mut below = vec![NONE; width];
    for y in (0..height).rev() {
        let line = y * width..(y + 1) * width;
        for ((row, below), &known) in rows[line.clone()].iter_mut().zip(&mut below).zip(&known[line]) {
            if known {
                *below = y as u32;
            } else if *below != NONE && (*row == NONE || *below - (y as u32) < y as u32 - *row) {
                *row = *below;
            }
        }
    }
    rows
}

/// Columns whose nearest known pixel is the nearest of all for a stretch of the row.
#[derive(Debug, Default)]
struct Envelope {
    columns: Vec<Column>,
}

#[derive(Debug, Clone, Copy)]
struct Column {
    x: i64,
    row: u32,
    /// Squared distance from the current row to the known pixel.
    squared: i64,
    /// First place in the row where this column wins.
    from: i64,
}

impl Envelope {
    fn fill_row(&mut self, y: usize, rows: &[u32], nearest: &mut [u32]) {
        self.build(y, rows);
        let width = rows.len() as u32;
        let mut index = 0;
        for (x, nearest) in nearest.iter_mut().enumerate() {
            while index + 1 < self.columns.len() && self.columns[index + 1].from <= x as i64 {
                index += 1;
            }
            let column = self.columns[index];
            *nearest = column.row * width + column.x as u32;
        }
    }

    fn build(&mut self, y: usize, rows: &[u32]) {
        self.columns.clear();
        for (x, &row) in rows.iter().enumerate().filter(|&(_, &row)| row != NONE) {
            let distance = i64::from(row) - y as i64;
            let mut column = Column {
                x: x as i64,
                row,
                squared: distance * distance,
                from: i64::MIN,
            };
            while let Some(last) = self.columns.last() {
                column.from = first_place_nearer(last, &column);
                if column.from > last.from {
                    break;
                }
                self.columns.pop();
                column.from = i64::MIN;
            }
            self.columns.push(column);
        }
    }
}

/// The smallest place in the row that is strictly nearer to `right` than to `left`.
fn first_place_nearer(left: &Column, right: &Column) -> i64 {
    // (p − left.x)² + left.squared > (p − right.x)² + right.squared
    let difference = (right.squared + right.x * right.x) - (left.squared + left.x * left.x);
    difference.div_euclid(2 * (right.x - left.x)) + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn squared_distance(a: u32, b: u32, width: u32) -> i64 {
        let place = |i: u32| (i64::from(i % width), i64::from(i / width));
        let ((ax, ay), (bx, by)) = (place(a), place(b));
        (ax - bx).pow(2) + (ay - by).pow(2)
    }

    proptest! {
        #[test]
        fn no_known_pixel_is_nearer_than_the_one_found(
            width in 1u32..24, height in 1u32..24, seed: u64, share in 1u32..100,
        ) {
            let mut state = seed;
            let known: Vec<bool> = (0..width * height)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 33) % 100 < u64::from(share)
                })
                .collect();
            let Some(nearest) = nearest_known(&known, ImageSize { width, height }) else {
                prop_assert!(!known.contains(&true));
                return Ok(());
            };
            for pixel in 0..width * height {
                let found = nearest[pixel as usize];
                prop_assert!(known[found as usize]);
                let best = (0..width * height)
                    .filter(|&other| known[other as usize])
                    .map(|other| squared_distance(pixel, other, width))
                    .min()
                    .unwrap();
                prop_assert_eq!(squared_distance(pixel, found, width), best);
            }
        }
    }

    #[test]
    fn known_pixels_stay_themselves() {
        let known = [false, true, true, false, false, true];
        assert_eq!(
            nearest_known(&known, ImageSize { width: 3, height: 2 }),
            Some(vec![1, 1, 2, 1, 1, 5])
        );
    }

    #[test]
    fn nothing_known_yields_nothing() {
        assert_eq!(
            nearest_known(&[false; 4], ImageSize { width: 2, height: 2 }),
            None
        );
    }
}
