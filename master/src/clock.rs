//! The only place of this program that reads a clock.
#![expect(
    clippy::disallowed_methods,
    reason = "the shell's one clock; all else is told the time"
)]

use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

use crate::frame_time::FrameTime;

/// Measures time since the start of the process.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    start: Instant,
}

impl Clock {
    /// A clock of a process that is already so old.
    pub fn new(age: Duration) -> Self {
        let now = Instant::now();
        Self {
            start: now.checked_sub(age).unwrap_or(now),
        }
    }

    /// The present moment.
    pub fn now(&self) -> FrameTime {
        FrameTime::after_start(self.start.elapsed())
    }

    /// The moment as the timers of the operating system know it.
    pub fn instant(&self, at: FrameTime) -> Instant {
        self.start + at.elapsed()
    }

    /// Does something and says how long it took.
    pub fn time<T>(&self, work: impl FnOnce() -> T) -> (T, Duration) {
        let begin = self.now();
        let result = work();
        (result, begin.until(self.now()))
    }
}

/// Processor time that the calling thread has used.
pub fn thread_cpu_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    // This clock counts up from zero, so neither part is negative.
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}
