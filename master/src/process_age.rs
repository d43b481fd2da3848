//! How long the process has existed: the deadline counts from its start, not from `main`.

use std::{fs, time::Duration};

use rustix::time::{ClockId, clock_gettime};

/// An age above this is not the time from `exec` to `main`: the process did something else before,
/// as `cargo run` and `sh -c 'exec …'` do, and nothing tells when it became this program.
const PLAUSIBLE: Duration = Duration::from_millis(250);
/// From `exec` to `main` when it cannot be measured: some ten milliseconds go to the dynamic linker.
const ASSUMED: Duration = Duration::from_millis(30);

/// The time from the start of the program to now, rounded up to the system's resolution of 10 ms.
pub fn process_age() -> Duration {
    match measured() {
        Some(age) if age <= PLAUSIBLE => age,
        _ => ASSUMED,
    }
}

fn measured() -> Option<Duration> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    let started = start_time(&stat)?;
    let now = clock_gettime(ClockId::Boottime);
    let now = Duration::new(now.tv_sec.try_into().ok()?, now.tv_nsec.try_into().ok()?);
    now.checked_sub(started)
}

/// The 22nd field, in ticks since the machine started (`proc_pid_stat(5)`).
fn start_time(stat: &str) -> Option<Duration> {
    // The second field is the program's name in parentheses, which may hold anything.
    let (_, after_name) = stat.rsplit_once(')')?;
    let ticks: u64 = after_name.split_ascii_whitespace().nth(19)?.parse().ok()?;
    let ticks_per_second = rustix::param::clock_ticks_per_second();
    Some(Duration::from_nanos(ticks * (1_000_000_000 / ticks_per_second)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_start_is_found_after_a_name_with_parentheses_and_spaces() {
        let stat = "42 (a b) c) R 1 42 42 0 -1 4194304 90 0 0 0 0 0 0 0 20 0 1 0 1234 2289664 200";
        assert_eq!(start_time(stat), Some(Duration::from_millis(12_340)));
    }

    #[test]
    fn this_process_started_before_now() {
        assert!(measured().is_some_and(|age| age < Duration::from_secs(86_400)));
    }
}
