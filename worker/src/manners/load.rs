//! How many cores other programs use, from the system's own count of processor time.

use std::collections::VecDeque;
use std::time::Duration;

/// How often to look. A reaction takes one look or two when others begin, `REMEMBERED` or one more when they
/// end, as what they did since the last look may count either way; all within a second.
pub const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Looks that count: others are believed to use what they used at most in so many.
const REMEMBERED: usize = 3;

/// A core counts as free if others use less than this part of it.
const TOLERATED: f64 = 0.5;

/// Processor time used so far, since any moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CpuTimes {
    /// By all programs on all cores, the system itself included.
    pub all: Duration,
    /// By this process.
    pub own: Duration,
}

/// The cores of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cores {
    /// As the system counts them.
    pub count: u32,
    /// How many of them share the units of one physical core, usually 1 or 2.
    pub threads_per_core: u32,
}

/// What others use.
#[derive(Debug, Default)]
pub struct Load {
    last: Option<(Duration, CpuTimes)>,
    /// Cores in use by others, between the last looks.
    recent: VecDeque<f64>,
}

impl Load {
    /// Takes a look; `None` if the system tells nothing.
    pub fn look(&mut self, now: Duration, times: Option<CpuTimes>) {
        let Some(times) = times else { return };
        if let Some((then, before)) = self.last {
            let passed = now.saturating_sub(then);
            if passed < LOOK_EVERY / 2 {
                return;
            }
            let all = times.all.saturating_sub(before.all);
            let own = times.own.saturating_sub(before.own);
            let others = all.saturating_sub(own).as_secs_f64() / passed.as_secs_f64();
            self.recent.truncate(REMEMBERED - 1);
            self.recent.push_front(others);
        }
        self.last = Some((now, times));
    }

    /// Cores that others use, the most of the last looks; `None` if nothing is known yet.
    pub fn others(&self) -> Option<f64> {
        self.recent.iter().copied().reduce(f64::max)
    }

    /// Cores that others leave free; `None` if nothing is known yet.
    ///
    /// What shares a physical core with another program slows it down, whatever its priority, so a core
    /// in use takes its siblings with it.
    pub fn free(&self, cores: Cores) -> Option<u32> {
        let others = self.others()? * f64::from(cores.threads_per_core);
        Some((f64::from(cores.count) - others + TOLERATED).max(0.0) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOUR: Cores = Cores {
        count: 4,
        threads_per_core: 1,
    };

    /// Looks at a machine on which others and this process use so many cores for so many looks.
    #[derive(Default)]
    struct Machine {
        load: Load,
        now: Duration,
        others: Duration,
        own: Duration,
    }

    impl Machine {
        fn run(&mut self, looks: u32, others: f64, own: f64) -> &Load {
            for _ in 0..looks {
                self.now += LOOK_EVERY;
                self.others += LOOK_EVERY.mul_f64(others);
                self.own += LOOK_EVERY.mul_f64(own);
                let times = CpuTimes {
                    all: self.others + self.own,
                    own: self.own,
                };
                self.load.look(self.now, Some(times));
            }
            &self.load
        }
    }

    #[test]
    fn nothing_is_known_before_the_second_look() {
        let mut machine = Machine::default();
        assert_eq!(machine.run(1, 0.0, 0.0).free(FOUR), None);
        assert_eq!(machine.run(1, 0.0, 0.0).free(FOUR), Some(4));
    }

    #[test]
    fn own_work_takes_nothing_from_the_free_cores() {
        assert_eq!(Machine::default().run(4, 0.1, 3.9).free(FOUR), Some(4));
    }

    #[test]
    fn a_core_is_given_up_at_the_first_look_and_taken_back_within_a_second() {
        let mut machine = Machine::default();
        machine.run(5, 0.0, 4.0);
        assert_eq!(machine.run(1, 1.0, 3.0).free(FOUR), Some(3));
        assert_eq!(machine.run(2, 0.0, 3.0).free(FOUR), Some(3));
        assert_eq!(machine.run(1, 0.0, 3.0).free(FOUR), Some(4));
        // When they end soon after a look, that interval is theirs, too.
        assert!(LOOK_EVERY * (REMEMBERED as u32 + 1) < Duration::from_secs(1));
    }

    #[test]
    fn less_than_half_a_core_of_others_costs_no_slot_and_all_cores_leave_none() {
        for (others, free) in [(0.4, 4), (0.6, 3), (1.0, 3), (3.6, 0), (4.0, 0), (9.0, 0)] {
            assert_eq!(
                Machine::default().run(3, others, 0.0).free(FOUR),
                Some(free),
                "{others}"
            );
        }
    }

    #[test]
    fn a_core_in_use_takes_its_sibling_with_it() {
        let siblings = Cores {
            count: 8,
            threads_per_core: 2,
        };
        assert_eq!(Machine::default().run(3, 1.0, 0.0).free(siblings), Some(6));
    }

    #[test]
    fn two_looks_in_quick_succession_count_as_one() {
        let mut machine = Machine::default();
        machine.run(3, 0.0, 0.0);
        let soon = machine.now + Duration::from_millis(1);
        let all = machine.others + Duration::from_millis(10);
        let times = CpuTimes {
            all,
            own: Duration::ZERO,
        };
        machine.load.look(soon, Some(times));
        assert_eq!(machine.load.free(FOUR), Some(4));
    }
}
