//! How long to wait before the next attempt to reach the master.

use std::time::Duration;

/// The first wait; short, because a master that was just started has seconds to live.
const FIRST: Duration = Duration::from_millis(80);

/// The longest wait. A worker is back within a second of its master, or of its link to it.
const LONGEST: Duration = Duration::from_millis(800);

/// Waits that double up to the longest, each shortened by chance, so that the machines of a lab do not
/// all come at the same moment.
#[derive(Debug)]
pub struct Backoff {
    next: Duration,
}

impl Backoff {
    /// Starts with the shortest wait.
    pub fn new() -> Self {
        Self { next: FIRST }
    }

    /// The next wait; `chance` is from 0 to 1.
    pub fn wait(&mut self, chance: f64) -> Duration {
        let longest = self.next;
        self.next = (longest * 2).min(LONGEST);
        longest.mul_f64(1.0 - 0.5 * chance.clamp(0.0, 1.0))
    }
}

impl Default for Backoff {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_wait_is_under_100_ms_and_none_is_over_a_second() {
        let mut backoff = Backoff::new();
        let waits = [(); 10].map(|()| backoff.wait(0.0));
        assert!(waits[0] < Duration::from_millis(100), "{waits:?}");
        assert!(waits.is_sorted(), "{waits:?}");
        assert_eq!(waits[9], LONGEST);
    }

    #[test]
    fn chance_shortens_a_wait_by_up_to_half() {
        let [mut long, mut short] = [Backoff::new(), Backoff::new()];
        for _ in 0..8 {
            assert_eq!(short.wait(1.0), long.wait(0.0) / 2);
        }
    }
}
