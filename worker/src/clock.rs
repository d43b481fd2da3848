//! The one place where the worker reads the clock.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use jiff::ZonedDateTime;

use crate::manners::hours::WeekMinute;

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

    /// The system's idea of the time since 1970, to compare with what it notes on files.
    #[expect(
        clippy::disallowed_methods,
        reason = "the shell's clock; all else is told the time"
    )]
    pub fn wall(&self) -> Duration {
        SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
    }

    /// The local time, for people.
    pub fn local_time(&self) -> String {
        ZonedDateTime::now().strftime("%a %F %R %Z").to_string()
    }

    /// The minute of the week, in the time zone of this machine.
    pub fn week_minute(&self) -> WeekMinute {
        let now = ZonedDateTime::now();
        let day = now.weekday().to_monday_zero_offset() as u32;
        WeekMinute::new(day, now.hour() as u32 * 60 + now.minute() as u32)
    }
}
