//! How many passes one lease covers, of tasks whose passes are added up before they are sent.
//!
//! A lease is long enough that its result is worth its way, and short enough that little is lost with
//! the machine that has it and little is under way at the cut-off.

use std::time::Duration;

/// The shortest lease that is aimed at: asking for it costs well under a hundredth of it.
const AIM_MIN: Duration = Duration::from_millis(50);
/// The longest.
const AIM_MAX: Duration = Duration::from_millis(200);
/// A lease is so many times as long as its result is on the wire.
const TIMES_ON_THE_WIRE: u32 = 10;
/// Near the cut-off a lease takes at most this part of the time that is left.
const PART_OF_REMAINING: u32 = 4;

/// What is known of one slot and of a task.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Time that the slot takes for one pass; zero if nothing was measured.
    pub pass: Duration,
    /// Bytes of the result, which does not grow with the passes.
    pub result_bytes: usize,
    /// The slot's own part of the way to the master, which all slots of a machine share.
    pub bytes_per_second: f64,
}

/// Passes to lease at once, at least one. `remaining` is the time until the worker must send what it
/// has; none without a deadline.
pub fn passes(pace: Pace, remaining: Option<Duration>) -> u32 {
    // The first lease is there to be measured.
    if pace.pass.is_zero() {
        return 1;
    }
    let aim = aim(pace).min(remaining.map_or(AIM_MAX, |remaining| remaining / PART_OF_REMAINING));
    let passes = aim.as_nanos() / pace.pass.as_nanos();
    u32::try_from(passes).unwrap_or(u32::MAX).max(1)
}

/// Time that a lease should take while the cut-off is far.
fn aim(pace: Pace) -> Duration {
    let seconds = pace.result_bytes as f64 / pace.bytes_per_second;
    let on_the_wire = Duration::try_from_secs_f64(seconds).unwrap_or(AIM_MAX);
    on_the_wire
        .saturating_mul(TIMES_ON_THE_WIRE)
        .clamp(AIM_MIN, AIM_MAX)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// A slot whose result is on the wire for so long.
    fn pace(pass: Duration, on_the_wire: Duration) -> Pace {
        Pace {
            pass,
            result_bytes: 50_000,
            bytes_per_second: 50_000.0 / on_the_wire.as_secs_f64(),
        }
    }

    #[test]
    fn on_a_fast_network_a_lease_takes_50_ms() {
        assert_eq!(passes(pace(ms(10), ms(1)), None), 5);
    }

    #[test]
    fn on_a_slower_one_it_takes_ten_times_as_long_as_its_result_is_under_way() {
        assert_eq!(passes(pace(ms(10), ms(12)), None), 12);
    }

    #[test]
    fn no_network_makes_it_longer_than_200_ms() {
        assert_eq!(passes(pace(ms(10), ms(5_000)), None), 20);
        let nothing = Pace {
            bytes_per_second: 0.0,
            ..pace(ms(10), ms(1))
        };
        assert_eq!(passes(nothing, None), 20);
    }

    #[test]
    fn towards_the_cut_off_it_shrinks_to_a_quarter_of_what_is_left() {
        let sizes = [2_000, 400, 100, 20, 0].map(|left| passes(pace(ms(1), ms(100)), Some(ms(left))));
        assert_eq!(sizes, [200, 100, 25, 5, 1]);
    }

    #[test]
    fn the_first_lease_is_one_pass_and_so_is_one_whose_pass_is_longer_than_any_lease() {
        assert_eq!(passes(pace(Duration::ZERO, ms(1)), None), 1);
        assert_eq!(passes(pace(ms(3_000), ms(1)), None), 1);
    }

    proptest! {
        #[test]
        fn a_lease_of_several_passes_is_never_longer_than_200_ms_nor_than_a_quarter_of_what_is_left(
            pass_us in 0u64..1_000_000, bytes in 0usize..100_000_000, rate in 0.0..1e10, left_us: u32,
        ) {
            let pass = Duration::from_micros(pass_us);
            let left = Duration::from_micros(left_us.into());
            let passes = passes(Pace { pass, result_bytes: bytes, bytes_per_second: rate }, Some(left));
            prop_assert!(passes >= 1);
            prop_assert!(passes == 1 || pass * passes <= AIM_MAX.min(left / 4));
        }
    }
}
