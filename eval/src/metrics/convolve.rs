//! Separable convolution; beyond the border, the edge pixels repeat.

use crate::plane::Plane;

/// Outputs summed at a time, so that the sums stay in registers.
const LANES: usize = 16;

/// Filters rows by one kernel and columns by another; both of odd length, centred.
pub(super) fn separable(plane: &Plane, horizontal: &[f32], vertical: &[f32]) -> Plane {
    columns(&rows(plane, horizontal), vertical)
}

/// Filters every row.
pub(super) fn rows(plane: &Plane, kernel: &[f32]) -> Plane {
    let mut filtered = Plane::zeros(plane.width, plane.height);
    let radius = kernel.len() / 2;
    let mut padded = vec![0.0; plane.width + 2 * radius];
    let row_pairs = filtered.data.chunks_exact_mut(plane.width);
    for (out, row) in row_pairs.zip(plane.data.chunks_exact(plane.width)) {
        padded[..radius].fill(row[0]);
        padded[radius..][..row.len()].copy_from_slice(row);
        padded[radius + row.len()..].fill(row[row.len() - 1]);
        let shifted: Vec<_> = (0..kernel.len()).map(|tap| &padded[tap..][..row.len()]).collect();
        weighted_sum(out, kernel, &shifted);
    }
    filtered
}

/// Filters every column.
pub(super) fn columns(plane: &Plane, kernel: &[f32]) -> Plane {
    let mut filtered = Plane::zeros(plane.width, plane.height);
    let radius = kernel.len() / 2;
    for (y, out) in filtered.data.chunks_exact_mut(plane.width).enumerate() {
        let row = |tap: usize| {
            let y = (y + tap).saturating_sub(radius).min(plane.height - 1);
            &plane.data[y * plane.width..][..plane.width]
        };
        let rows: Vec<_> = (0..kernel.len()).map(row).collect();
        weighted_sum(out, kernel, &rows);
    }
    filtered
}

/// Adds up slices of the output's length, each times its weight.
fn weighted_sum(out: &mut [f32], weights: &[f32], slices: &[&[f32]]) {
    let (blocks, rest) = out.as_chunks_mut::<LANES>();
    let rest_start = blocks.len() * LANES;
    for (block, start) in blocks.iter_mut().zip((0..).step_by(LANES)) {
        let mut sums = [0.0; LANES];
        for (weight, slice) in weights.iter().zip(slices) {
            add_weighted(&mut sums, *weight, &slice[start..][..LANES]);
        }
        *block = sums;
    }
    for (weight, slice) in weights.iter().zip(slices) {
        add_weighted(rest, *weight, &slice[rest_start..]);
    }
}

fn add_weighted(sums: &mut [f32], weight: f32, values: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += weight * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_output_is_the_weighted_sum_of_its_neighbours() {
        let (width, height) = (37, 5);
        let data = (0..width * height).map(|i| (i * i % 17) as f32).collect();
        let plane = Plane { width, height, data };
        let (horizontal, vertical) = ([1.0, 2.0, -4.0, 8.0, 16.0], [3.0, 5.0, -7.0]);
        let filtered = separable(&plane, &horizontal, &vertical);
        let at = |x: usize, y: usize, dx: usize, dy: usize| {
            let column = (x + dx).saturating_sub(2).min(width - 1);
            let row = (y + dy).saturating_sub(1).min(height - 1);
            plane.data[row * width + column] * horizontal[dx] * vertical[dy]
        };
        for (index, value) in filtered.data.iter().enumerate() {
            let (x, y) = (index % width, index / width);
            let taps = (0..3).flat_map(|dy| (0..5).map(move |dx| (dx, dy)));
            let expected: f32 = taps.map(|(dx, dy)| at(x, y, dx, dy)).sum();
            assert!(
                (value - expected).abs() < 1e-3,
                "{value} instead of {expected} at {x}, {y}"
            );
        }
    }
}
