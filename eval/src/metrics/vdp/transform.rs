//! Fourier transforms of real images, and filters between them.
//!
//! A spectrum holds the columns of non-negative horizontal frequency one after the other (the
//! others are their conjugates), so that vertical transforms run along memory. Work that a
//! filter makes needless is left out: a column where it is 0 is not transformed, and one where it
//! is 1 need not be transformed back and forth. Values are f32: they enter as small differences
//! formed in f64, so that 24 bits are relative to the difference itself.

use std::sync::Arc;

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex32;
use rustfft::num_traits::Zero;
use rustfft::{Fft, FftPlanner};

use super::cortex::Channel;

/// Rows moved between row order and column order at a time: two cache lines of each column.
const ROWS_AT_ONCE: usize = 16;

/// A frequency of a spectrum.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frequency {
    /// Cycles per pixel.
    pub(super) radius: f64,
    /// Angle of the wave vector.
    pub(super) degrees: f64,
    /// Whether the vertical part is the Nyquist frequency, which has no sign of its own.
    pub(super) both_signs: bool,
}

/// The frequencies of a spectrum in its order.
pub(super) fn frequencies(width: usize, height: usize) -> Vec<Frequency> {
    let frequency = |column: usize, row: usize| {
        let signed_row = if 2 * row <= height {
            row as f64
        } else {
            row as f64 - height as f64
        };
        let (fx, fy) = (column as f64 / width as f64, signed_row / height as f64);
        Frequency {
            radius: fx.hypot(fy),
            degrees: fy.atan2(fx).to_degrees(),
            both_signs: 2 * row == height,
        }
    };
    (0..=width / 2)
        .flat_map(|column| (0..height).map(move |row| frequency(column, row)))
        .collect()
}

/// A real factor for every frequency of a spectrum, symmetric in the vertical frequency.
#[derive(Debug)]
pub(super) struct Filter {
    height: usize,
    gains: Vec<f32>,
    passes: Vec<Pass>,
}

/// How much of a column a filter lets through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pass {
    Nothing,
    Something,
    Everything,
}

impl Filter {
    /// A filter with the given gains in the order of a spectrum of `height` rows.
    pub(super) fn new(height: usize, gains: impl Iterator<Item = f32>) -> Self {
        let gains: Vec<f32> = gains.collect();
        let pass = |column: &[f32]| {
            if column.iter().all(|&gain| gain <= 0.0) {
                Pass::Nothing
            } else if column.iter().all(|&gain| gain >= 1.0) {
                Pass::Everything
            } else {
                Pass::Something
            }
        };
        let passes = gains.chunks_exact(height).map(pass).collect();
        Self {
            height,
            gains,
            passes,
        }
    }

    pub(super) fn column(&self, column: usize) -> &[f32] {
        &self.gains[column * self.height..][..self.height]
    }

    pub(super) fn column_count(&self) -> usize {
        self.passes.len()
    }
}

/// The transforms of one image size, with their working memory.
pub(super) struct Transform {
    width: usize,
    height: usize,
    row_forward: Arc<dyn RealToComplex<f32>>,
    row_inverse: Arc<dyn ComplexToReal<f32>>,
    column_forward: Arc<dyn Fft<f32>>,
    column_inverse: Arc<dyn Fft<f32>>,
    /// A spectrum in the making, column by column.
    columns: Vec<Complex32>,
    /// Spectra of `ROWS_AT_ONCE` rows, row by row.
    rows: Vec<Complex32>,
    row: Vec<f32>,
    scratch: Vec<Complex32>,
}

impl Transform {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let mut real = RealFftPlanner::new();
        let (row_forward, row_inverse) = (real.plan_fft_forward(width), real.plan_fft_inverse(width));
        let mut complex = FftPlanner::new();
        let (column_forward, column_inverse) =
            (complex.plan_fft_forward(height), complex.plan_fft_inverse(height));
        let scratch_len = [
            row_forward.get_scratch_len(),
            row_inverse.get_scratch_len(),
            column_forward.get_inplace_scratch_len(),
            column_inverse.get_inplace_scratch_len(),
        ];
        let column_count = width / 2 + 1;
        Self {
            width,
            height,
            row_forward,
            row_inverse,
            column_forward,
            column_inverse,
            columns: vec![Complex32::zero(); column_count * height],
            rows: vec![Complex32::zero(); column_count * ROWS_AT_ONCE],
            row: vec![0.0; width],
            scratch: vec![Complex32::zero(); scratch_len.into_iter().max().unwrap_or(0)],
        }
    }

    /// The spectrum of an image.
    pub(super) fn spectrum(&mut self, image: &[f32]) -> Vec<Complex32> {
        self.transform_rows(image, |_| true);
        self.column_forward
            .process_with_scratch(&mut self.columns, &mut self.scratch);
        self.columns.clone()
    }

    /// What a channel sees of a spectrum, as an image.
    pub(super) fn channel(&mut self, spectrum: &[Complex32], channel: &Channel<'_>, image: &mut [f32]) {
        let scale = 1.0 / (self.width * self.height) as f32;
        let columns = self.columns.chunks_exact_mut(self.height);
        let spectra = spectrum.chunks_exact(self.height);
        for (index, (column, spectrum)) in columns.zip(spectra).enumerate() {
            if channel.passes[index] {
                for ((value, seen), gain) in column.iter_mut().zip(spectrum).zip(channel.gains(index)) {
                    *value = seen * (gain * scale);
                }
                self.column_inverse
                    .process_with_scratch(column, &mut self.scratch);
            }
        }
        self.inverse_rows(image, |column| channel.passes[column]);
    }

    /// Filters an image in place.
    pub(super) fn filter(&mut self, image: &mut [f32], filter: &Filter) {
        let keeps = |column: usize| filter.passes[column] != Pass::Nothing;
        self.transform_rows(image, keeps);
        let row_scale = 1.0 / self.width as f32;
        let scale = row_scale / self.height as f32;
        for (index, column) in self.columns.chunks_exact_mut(self.height).enumerate() {
            match filter.passes[index] {
                Pass::Nothing => {}
                Pass::Everything => column.iter_mut().for_each(|value| *value *= row_scale),
                Pass::Something => {
                    self.column_forward
                        .process_with_scratch(column, &mut self.scratch);
                    for (value, gain) in column.iter_mut().zip(filter.column(index)) {
                        *value *= gain * scale;
                    }
                    self.column_inverse
                        .process_with_scratch(column, &mut self.scratch);
                }
            }
        }
        self.inverse_rows(image, keeps);
    }

    /// Transforms the rows of an image into those of `self.columns` that are wanted.
    fn transform_rows(&mut self, image: &[f32], wanted: impl Fn(usize) -> bool) {
        let column_count = self.columns.len() / self.height;
        let blocks = image.chunks(ROWS_AT_ONCE * self.width);
        for (block, first_row) in blocks.zip((0..).step_by(ROWS_AT_ONCE)) {
            let row_spectra = self.rows.chunks_exact_mut(column_count);
            for (row, spectrum) in block.chunks_exact(self.width).zip(row_spectra) {
                self.row.copy_from_slice(row);
                // Fails only for wrong lengths.
                let done = self
                    .row_forward
                    .process_with_scratch(&mut self.row, spectrum, &mut self.scratch);
                debug_assert!(done.is_ok());
            }
            let row_count = block.len() / self.width;
            let columns = self.columns.chunks_exact_mut(self.height).enumerate();
            for (index, column) in columns.filter(|(index, _)| wanted(*index)) {
                let entries = self.rows[index..].iter().step_by(column_count);
                column[first_row..][..row_count]
                    .iter_mut()
                    .zip(entries)
                    .for_each(|(to, from)| *to = *from);
            }
        }
    }

    /// Makes the rows of an image from those of `self.columns` that pass; the others count as 0.
    fn inverse_rows(&mut self, image: &mut [f32], passes: impl Fn(usize) -> bool) {
        let column_count = self.columns.len() / self.height;
        let blocks = image.chunks_mut(ROWS_AT_ONCE * self.width);
        for (block, first_row) in blocks.zip((0..).step_by(ROWS_AT_ONCE)) {
            let row_count = block.len() / self.width;
            self.rows.fill(Complex32::zero());
            let columns = self.columns.chunks_exact(self.height).enumerate();
            for (index, column) in columns.filter(|(index, _)| passes(*index)) {
                let entries = self.rows[index..].iter_mut().step_by(column_count);
                entries
                    .zip(&column[first_row..][..row_count])
                    .for_each(|(to, from)| *to = *from);
            }
            let row_spectra = self.rows.chunks_exact_mut(column_count);
            for (row, spectrum) in block.chunks_exact_mut(self.width).zip(row_spectra) {
                make_ends_real(spectrum, self.width);
                // Fails only for wrong lengths and for ends that are not real.
                let done = self
                    .row_inverse
                    .process_with_scratch(spectrum, row, &mut self.scratch);
                debug_assert!(done.is_ok());
            }
        }
    }
}

/// Drops the imaginary parts of frequencies that are their own conjugates: the real part is taken.
fn make_ends_real(spectrum: &mut [Complex32], width: usize) {
    spectrum[0].im = 0.0;
    if width.is_multiple_of(2) {
        spectrum[width / 2].im = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Anything without symmetry.
    fn image(width: usize, height: usize) -> Vec<f32> {
        (0..width * height)
            .map(|i| ((i * i * 7 + i * 3) % 101) as f32 / 101.0)
            .collect()
    }

    fn check_equal(a: &[f32], b: &[f32]) {
        for (index, (a, b)) in a.iter().zip(b).enumerate() {
            assert!((a - b).abs() < 2e-6, "{a} and {b} at {index}");
        }
    }

    const SIZES: [(usize, usize); 6] = [(16, 16), (30, 17), (17, 30), (5, 3), (1, 1), (2, 33)];

    #[test]
    fn a_filter_that_passes_everything_changes_nothing_at_any_size() {
        for (width, height) in SIZES {
            let all = Filter::new(height, frequencies(width, height).iter().map(|_| 1.0));
            let almost_all = Filter::new(height, frequencies(width, height).iter().map(|_| 0.999_999_9));
            for filter in [all, almost_all] {
                let mut filtered = image(width, height);
                Transform::new(width, height).filter(&mut filtered, &filter);
                check_equal(&filtered, &image(width, height));
            }
        }
    }

    #[test]
    fn a_filter_that_passes_the_mean_leaves_the_mean() {
        for (width, height) in SIZES {
            let gain = |frequency: &Frequency| if frequency.radius > 0.0 { 0.0 } else { 1.0 };
            let filter = Filter::new(height, frequencies(width, height).iter().map(gain));
            let mut filtered = image(width, height);
            let mean = filtered.iter().sum::<f32>() / filtered.len() as f32;
            Transform::new(width, height).filter(&mut filtered, &filter);
            check_equal(&filtered, &vec![mean; width * height]);
        }
    }
}
