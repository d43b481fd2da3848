//! Processor time of the whole machine and of this process, from `/proc/stat` and the process's own clock.

use std::time::Duration;

use rustix::param::clock_ticks_per_second;
use rustix::time::{ClockId, clock_gettime};

use crate::manners::load::CpuTimes;

/// Processor time so far; `None` if the text is not that of `/proc/stat`.
pub(super) fn times(stat: &str) -> Option<CpuTimes> {
    let own = clock_gettime(ClockId::ProcessCPUTime);
    Some(CpuTimes {
        all: busy(stat)?,
        own: Duration::new(u64::try_from(own.tv_sec).ok()?, u32::try_from(own.tv_nsec).ok()?),
    })
}

/// Time in user and kernel mode and in interrupts. Not: idle, waiting for a disk, taken by the host of a
/// virtual machine, and what guests use, which is in the user's time already.
fn busy(stat: &str) -> Option<Duration> {
    let fields = stat.lines().next()?.strip_prefix("cpu ")?;
    let ticks: Vec<u64> = fields
        .split_whitespace()
        .map_while(|field| field.parse().ok())
        .collect();
    let [user, nice, system, _idle, _iowait, irq, softirq, ..] = ticks[..] else {
        return None;
    };
    let busy = user + nice + system + irq + softirq;
    Some(Duration::from_secs_f64(
        busy as f64 / clock_ticks_per_second() as f64,
    ))
}

/// How many cores `/proc/stat` has lines for.
pub(super) fn cores(stat: &str) -> u32 {
    let is_core = |line: &&str| {
        let number = line.strip_prefix("cpu");
        number.is_some_and(|number| number.starts_with(|digit: char| digit.is_ascii_digit()))
    };
    stat.lines().filter(is_core).count() as u32
}

/// How many cores a list such as `0,4` or `0-1` names.
pub(super) fn siblings(list: &str) -> u32 {
    let count = |part: &str| -> Option<u32> {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last): (u32, u32) = (first.parse().ok()?, last.parse().ok()?);
        Some(last.saturating_sub(first) + 1)
    };
    list.trim().split(',').filter_map(count).sum::<u32>().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAT: &str = "\
cpu  100 20 30 4000 50 6 7 8 9 0
cpu0 50 10 15 2000 25 3 3 4 4 0
cpu1 50 10 15 2000 25 3 4 4 5 0
intr 1 2 3
ctxt 4
";

    #[test]
    fn busy_is_what_programs_and_interrupts_take() {
        let per_second = clock_ticks_per_second() as f64;
        assert_eq!(busy(STAT), Some(Duration::from_secs_f64(163.0 / per_second)));
        assert_eq!(busy("cpu  1 2"), None);
        assert_eq!(busy("nonsense"), None);
    }

    #[test]
    fn cores_and_their_siblings_are_counted() {
        assert_eq!(cores(STAT), 2);
        for (list, count) in [("0\n", 1), ("0,4\n", 2), ("0-3", 4), ("", 1)] {
            assert_eq!(siblings(list), count, "{list:?}");
        }
    }
}
