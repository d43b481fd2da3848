//! Owen-scrambled Sobol points in two dimensions, padded to any number of dimensions.
//!
//! The first two Sobol dimensions form a (0,2)-sequence in base 2: of its first 2ᵃ⁺ᵇ points exactly one
//! lies in each of the 2ᵃ×2ᵇ cells of the unit square. Nested uniform scrambling (Owen 1995), here by
//! the hash of Laine and Karras (2011) with Vegdahl's constants, keeps that and removes the regular
//! patterns. Higher dimensions are padded: each pair is the same sequence, scrambled and shuffled anew
//! (Burley, "Practical hash-based Owen scrambling", 2020).

use glam::Vec2;

/// The `index`-th point of the sequence as 32-bit fractions of the unit square, scrambled by `seed`.
pub fn point_bits(index: u32, seed: u32) -> [u32; 2] {
    let x = index.reverse_bits();
    let y = second_dimension(index);
    [owen(x, hash(seed, 0)), owen(y, hash(seed, 1))]
}

/// The second Sobol dimension: Pascal's triangle modulo 2 applied to the bits of `index`.
///
/// By Lucas' theorem bit j of the result is the sum of the bits k of which j is a submask: one step for
/// each of the five bits that number them.
fn second_dimension(index: u32) -> u32 {
    let mut bits = index;
    for (shift, lower) in [
        (1, 0x5555_5555),
        (2, 0x3333_3333),
        (4, 0x0f0f_0f0f),
        (8, 0x00ff_00ff),
        (16, 0x0000_ffff),
    ] {
        bits ^= (bits >> shift) & lower;
    }
    bits.reverse_bits()
}

/// Nested uniform scrambling: each bit is flipped or not depending on `seed` and the bits above it.
fn owen(bits: u32, seed: u32) -> u32 {
    let mut x = bits.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// Mixes a value into a seed (the finaliser of Wellons' `lowbias32`).
pub fn hash(seed: u32, value: u32) -> u32 {
    let mut x = seed.wrapping_mul(0x9e37_79b9) ^ value;
    x = (x ^ (x >> 16)).wrapping_mul(0x21f0_aaad);
    x = (x ^ (x >> 15)).wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

/// Folds the frame's seed and a purpose into the 32 bits that scrambling takes.
pub fn fold_seed(seed: u64, purpose: u32) -> u32 {
    hash(hash(purpose, seed as u32), (seed >> 32) as u32)
}

/// The dimensions of one sample, drawn in pairs; depends on (seed, index, number of draws) alone.
#[derive(Debug, Clone)]
pub struct Stream {
    index: u32,
    seed: u32,
    pair: u32,
}

impl Stream {
    /// Starts at the first dimension of the `index`-th sample.
    pub fn new(index: u32, seed: u32) -> Self {
        Self { index, seed, pair: 0 }
    }

    /// Leaves out so many pairs of dimensions.
    #[must_use]
    pub fn skip(mut self, pairs: u32) -> Self {
        self.pair += pairs;
        self
    }

    /// The next two dimensions, each in [0, 1).
    pub fn next_2d(&mut self) -> Vec2 {
        let seed = hash(self.seed, 0x5bd1_e995 ^ self.pair);
        self.pair += 1;
        // Scrambling the index permutes within aligned blocks, so every block stays stratified.
        let shuffled = owen(self.index, seed);
        let [x, y] = point_bits(shuffled, hash(seed, 2));
        Vec2::new(unit(x), unit(y))
    }

    /// The next dimension, in [0, 1); uses up a pair.
    pub fn next_1d(&mut self) -> f32 {
        self.next_2d().x
    }
}

/// The largest float in [0, 1) not above `bits / 2³²`.
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Counts the points in each cell of a `2ᵃ×2ᵇ` grid.
    fn occupancy(points: impl Iterator<Item = [u32; 2]>, a: u32, b: u32) -> Vec<u32> {
        let mut counts = vec![0; 1 << (a + b)];
        for [x, y] in points {
            let column = if a == 0 { 0 } else { x >> (32 - a) };
            let row = if b == 0 { 0 } else { y >> (32 - b) };
            counts[((row << a) | column) as usize] += 1;
        }
        counts
    }

    proptest! {
        #[test]
        fn every_elementary_interval_holds_one_point(seed: u32, a in 0u32..7, b in 0u32..7, block in 0u32..4) {
            let first = block << (a + b);
            let points = (first..first + (1 << (a + b))).map(|i| point_bits(i, seed));
            prop_assert!(occupancy(points, a, b).iter().all(|&count| count == 1));
        }

        #[test]
        fn every_pair_of_a_stream_is_stratified_by_itself(seed: u32, a in 0u32..5, b in 0u32..5, pair in 0u32..5) {
            let points = (0..1 << (a + b)).map(|i| {
                let mut stream = Stream { index: i, seed, pair };
                let p = stream.next_2d();
                [p.x, p.y].map(|v| (f64::from(v) * 4_294_967_296.0) as u32)
            });
            prop_assert!(occupancy(points, a, b).iter().all(|&count| count == 1));
        }
    }

    #[test]
    fn pairs_are_not_correlated_with_each_other() {
        let n = 4096;
        let mean: f32 = (0..n)
            .map(|i| {
                let mut stream = Stream::new(i, 7);
                let (first, second) = (stream.next_1d(), stream.next_1d());
                (first - 0.5) * (second - 0.5)
            })
            .sum::<f32>()
            / n as f32;
        assert!(mean.abs() < 4.0 / 12.0 / (n as f32).sqrt(), "covariance {mean}");
    }

    #[test]
    fn the_unscrambled_second_dimension_begins_as_published() {
        let first = (0..8).map(|i| second_dimension(i) >> 29).collect::<Vec<_>>();
        assert_eq!(first, [0b000, 0b100, 0b110, 0b010, 0b101, 0b001, 0b011, 0b111]);
    }
}
