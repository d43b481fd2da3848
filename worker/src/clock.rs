//! The one place where the worker reads the clock.

use std::time::{Duration, Instant};

/// Tells the time since it was started. Copies tell the same.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
}

impl Clock {
    /// Time begins now.
    #[expect(
        clippy::disallowed_methods,
        reason = "the shell's clock; all else is told the time"
    )]
    pub fn start() -> Self {
        Self {
            start: Instant::now(),
        }
    }

    /// Time since the start.
    pub fn now(&self) -> Duration {
        self.start.elapsed()
    }
}
