//! The widest vectors of the processor for loops that were compiled for the oldest one.

/// A computation that [`with_wide_vectors`] runs.
pub trait WideKernel {
    /// What comes out.
    type Output;

    /// Runs it. Only what is inlined here gains anything: this function, to be marked
    /// `#[inline(always)]`, and what it calls in its loops.
    fn run(self) -> Self::Output;
}

/// A closure, as long as it is small: a large one is not inlined, and its loops stay narrow.
impl<R, F: FnOnce() -> R> WideKernel for F {
    type Output = R;

    #[inline(always)]
    #[expect(
        clippy::inline_always,
        reason = "it must be compiled for the processor's vectors"
    )]
    fn run(self) -> R {
        self()
    }
}

/// Runs a kernel as code for AVX-512 or AVX2 if the processor has it, so that its loops over the lanes of
/// a packet become one or two instructions each, and Embree reads in one piece what they write in one.
///
/// Results are the same bits either way: the wide instructions round every operation as SSE2 does, and
/// fused multiplication, which would not, is never put in place of what the source says.
#[inline]
pub fn with_wide_vectors<K: WideKernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("avx512vl") {
            // SAFETY: the processor has what the function is compiled for ("The Rust Reference",
            // section "The target_feature attribute").
            return unsafe { with_avx512(kernel) };
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: as above.
            return unsafe { with_avx2(kernel) };
        }
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl")]
fn with_avx512<K: WideKernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<K: WideKernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hint::black_box;

    struct Sums<'a>(&'a [f32]);

    impl WideKernel for Sums<'_> {
        type Output = Vec<u32>;

        #[inline(always)]
        #[expect(
            clippy::inline_always,
            reason = "it must be compiled for the processor's vectors"
        )]
        fn run(self) -> Vec<u32> {
            let sum = |n: &[f32]| n[0] * n[1] + n[2] / n[0];
            self.0.windows(3).map(|n| sum(n).to_bits()).collect()
        }
    }

    #[test]
    fn wide_vectors_round_like_narrow_ones() {
        let numbers: Vec<f32> = (1..10_000_u16).map(|i| f32::from(i).sqrt()).collect();
        let narrow = Sums(black_box(&numbers)).run();
        assert_eq!(with_wide_vectors(Sums(black_box(&numbers))), narrow);
    }
}
