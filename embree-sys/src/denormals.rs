//! The floating-point mode that Embree asks for in every thread that traces.

use std::marker::PhantomData;

/// While it lives, the current thread treats numbers below 1.2·10⁻³⁸ as zero,
/// as operands and as results. Embree's traversal is written for this mode:
/// without it, denormal numbers "can significantly reduce" its speed ("Embree
/// API", section "MXCSR control and status register").
///
/// Take one at the start of each tracing thread and keep it to the end. Does
/// nothing on processors other than `x86_64`.
#[derive(Debug)]
#[must_use = "the mode ends when the guard is dropped"]
pub struct FlushDenormals {
    #[cfg_attr(
        not(target_arch = "x86_64"),
        expect(dead_code, reason = "no mode to restore here")
    )]
    before: u32,
    /// The mode belongs to a thread, so the guard must stay there.
    not_send: PhantomData<*const ()>,
}

impl FlushDenormals {
    /// Switches the mode on in this thread.
    pub fn in_this_thread() -> Self {
        let before = control::read();
        control::write(before | control::FLUSH_TO_ZERO | control::DENORMALS_ARE_ZERO);
        Self {
            before,
            not_send: PhantomData,
        }
    }
}

impl Drop for FlushDenormals {
    fn drop(&mut self) {
        control::write(self.before);
    }
}

/// The control and status register of SSE and AVX.
#[cfg(target_arch = "x86_64")]
mod control {
    use std::arch::asm;

    pub(super) const FLUSH_TO_ZERO: u32 = 1 << 15;
    pub(super) const DENORMALS_ARE_ZERO: u32 = 1 << 6;

    pub(super) fn read() -> u32 {
        let mut bits = 0_u32;
        // SAFETY: `stmxcsr` writes four bytes to the address of `bits` (Intel
        // SDM volume 2, "STMXCSR"), and touches no stack and no flags.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut bits, options(nostack, preserves_flags)) };
        bits
    }

    pub(super) fn write(bits: u32) {
        // SAFETY: `ldmxcsr` reads four bytes (Intel SDM volume 2, "LDMXCSR");
        // the value is one that was read before, with at most the two bits set
        // that Embree's manual names ("MXCSR control and status register"), so
        // no exception gets unmasked. Rust assumes the default mode: what it
        // may do otherwise here is to compute a constant with a denormal in it
        // at compile time, and no result of ours depends on denormals.
        unsafe {
            asm!("ldmxcsr [{}]", in(reg) &raw const bits, options(nostack, preserves_flags, readonly));
        };
    }
}

#[cfg(not(target_arch = "x86_64"))]
mod control {
    pub(super) const FLUSH_TO_ZERO: u32 = 0;
    pub(super) const DENORMALS_ARE_ZERO: u32 = 0;

    pub(super) fn read() -> u32 {
        0
    }

    pub(super) fn write(_bits: u32) {}
}

#[cfg(test)]
mod tests {
    use std::hint::black_box;

    use super::*;

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn denormals_are_zero_only_while_the_guard_lives() {
        let half_of_smallest = || black_box(f32::MIN_POSITIVE) * black_box(0.5);
        assert!(half_of_smallest() > 0.0);
        {
            let _guard = FlushDenormals::in_this_thread();
            assert!(half_of_smallest().to_bits() == 0);
        }
        assert!(half_of_smallest() > 0.0);
    }
}
