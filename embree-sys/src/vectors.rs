//! The widest vectors of the processor for loops that were compiled for the oldest one.

/// Runs `work` as code for AVX2 if the processor has it, so that its loops over the lanes of a packet
/// become one instruction each, and Embree reads in one piece what they write in one piece.
///
/// Results are the same bits either way: AVX2 rounds every operation as SSE2 does, and fused
/// multiplication, which would not, stays off. Only what is inlined into `work` gains anything.
#[inline]
pub fn with_wide_vectors<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has what the function is compiled for ("The Rust Reference",
        // section "The target_feature attribute").
        return unsafe { with_avx2(work) };
    }
    work()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<R>(work: impl FnOnce() -> R) -> R {
    work()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hint::black_box;

    #[test]
    fn wide_vectors_round_like_narrow_ones() {
        let numbers: Vec<f32> = (1..10_000_u16).map(|i| f32::from(i).sqrt()).collect();
        let sums = |numbers: &[f32]| -> Vec<u32> {
            numbers
                .windows(3)
                .map(|n| (n[0] * n[1] + n[2] / n[0]).to_bits())
                .collect()
        };
        let narrow = sums(black_box(&numbers));
        assert_eq!(with_wide_vectors(|| sums(black_box(&numbers))), narrow);
    }
}
