//! How many passes one lease covers, of tasks whose passes are added up before they are sent.
//!
//! A lease is long enough that its result is worth its way, and short enough that little is lost with the
//! machine that has it and little is under way at the cut-off. Machines differ in speed and in the wires that
//! they hang on, so each has leases of its own length.

use std::time::Duration;

use render::task::{Component, Task};

/// What a lease takes on a wire that costs nothing. As passes are dealt out in powers of two, it is between this
/// and half of it; and each result costs the master's one loop some tenths of a millisecond.
const AIM_MIN: Duration = Duration::from_millis(100);
/// The most that any wire makes of it.
const AIM_MAX: Duration = Duration::from_millis(200);
/// A lease is so many times as long as its result is on the wire.
const TIMES_ON_THE_WIRE: u32 = 10;
/// Near the cut-off a lease takes at most this part of the time that is left.
const PART_OF_REMAINING: u32 = 4;
/// What a new measurement counts beside those before.
const NEW: f64 = 0.25;

/// What is known of one worker.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pace {
    /// Seconds that a slot takes for one pass of direct light of a group, if that was measured.
    pub direct_s: Option<f64>,
    /// Of indirect light.
    pub indirect_s: Option<f64>,
    /// How long results of all slots are on the wires that they share, with those of everyone else.
    pub on_the_wire: Duration,
}

impl Pace {
    /// A slot spent so long on a whole task.
    pub fn took(&mut self, task: Task, busy: Duration) {
        let pass_s = busy.as_secs_f64() / f64::from(task.passes);
        let known = match task.component {
            Component::Direct => &mut self.direct_s,
            _ => &mut self.indirect_s,
        };
        let before = known.unwrap_or(pass_s);
        *known = Some(before + NEW * (pass_s - before));
    }

    /// Seconds that a slot takes for one pass of a component, if that was measured.
    pub fn pass_s(&self, component: Component) -> Option<f64> {
        match component {
            Component::Direct => self.direct_s,
            _ => self.indirect_s,
        }
    }

    /// Passes to lease at once, at least one, if one takes a slot `pass_s` seconds. `remaining` is the time
    /// until the worker must send what it has.
    pub fn passes(&self, pass_s: f64, remaining: Duration) -> u32 {
        let aim = self.aim().min(remaining / PART_OF_REMAINING);
        // Of what takes no time at all there cannot be too much: the conversion saturates.
        ((aim.as_secs_f64() / pass_s) as u32).max(1)
    }

    /// Time that a lease should take while the cut-off is far.
    fn aim(&self) -> Duration {
        let worth_its_way = self.on_the_wire.saturating_mul(TIMES_ON_THE_WIRE);
        worth_its_way.clamp(AIM_MIN, AIM_MAX)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LONG: Duration = Duration::from_secs(100);

    const fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// A worker whose results are on the wire for so long.
    fn pace(on_the_wire: Duration) -> Pace {
        Pace {
            on_the_wire,
            ..Pace::default()
        }
    }

    #[test]
    fn on_a_fast_network_a_lease_takes_a_tenth_of_a_second() {
        assert_eq!(pace(ms(1)).passes(0.010, LONG), 10);
    }

    #[test]
    fn on_a_slower_one_it_takes_ten_times_as_long_as_its_result_is_under_way() {
        assert_eq!(pace(ms(15)).passes(0.010, LONG), 15);
    }

    #[test]
    fn no_network_makes_it_longer_than_200_ms() {
        assert_eq!(pace(ms(5_000)).passes(0.010, LONG), 20);
        assert_eq!(pace(Duration::MAX).passes(0.010, LONG), 20);
    }

    #[test]
    fn towards_the_cut_off_it_shrinks_to_a_quarter_of_what_is_left() {
        let sizes = [2_000, 400, 100, 20, 0].map(|left| pace(ms(100)).passes(0.001, ms(left)));
        assert_eq!(sizes, [200, 100, 25, 5, 1]);
    }

    #[test]
    fn the_speed_of_each_component_is_a_running_mean_over_its_passes() {
        let task = |component, passes| Task {
            component,
            group: 0,
            index: 0,
            passes,
        };
        let mut pace = Pace::default();
        assert_eq!(pace.pass_s(Component::Direct), None);
        pace.took(task(Component::Direct, 4), ms(40));
        pace.took(task(Component::Direct, 1), ms(50));
        pace.took(task(Component::Indirect, 2), ms(600));
        let ms_of = |component| pace.pass_s(component).map(|s| (1e3 * s).round());
        assert_eq!(ms_of(Component::Direct), Some(20.0));
        assert_eq!(ms_of(Component::Indirect), Some(300.0));
    }

    proptest! {
        #[test]
        fn a_lease_of_several_passes_is_never_longer_than_200_ms_nor_than_a_quarter_of_what_is_left(
            pass_us in 0u32..1_000_000, on_the_wire_us: u32, left_us: u32,
        ) {
            let pace = pace(Duration::from_micros(on_the_wire_us.into()));
            let (pass_s, left) = (f64::from(pass_us) * 1e-6, Duration::from_micros(left_us.into()));
            let passes = pace.passes(pass_s, left);
            prop_assert!(passes >= 1);
            let most_s = AIM_MAX.min(left / 4).as_secs_f64() + 1e-9;
            prop_assert!(passes == 1 || pass_s * f64::from(passes) <= most_s);
        }
    }
}
