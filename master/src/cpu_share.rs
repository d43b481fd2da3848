//! How much of the cores the local worker's threads get, from the system's own count.
//!
//! Linux tells for each thread how long it ran and how long it was ready but had to wait
//! (`/proc/PID/task/TID/schedstat`). Where it does not, nothing is known. Only of another process: who
//! waits for the end of a process whose threads were looked at there may have to wait for a tenth of a
//! second more, until the kernel has forgotten all that was looked at (seen on Linux 6.18).

use std::{collections::BTreeMap, fs, iter::Sum, path::PathBuf, time::Duration};

/// Watches the threads of other processes.
#[derive(Debug, Default)]
pub struct CpuShare {
    task_folders: Vec<PathBuf>,
    seen: BTreeMap<String, CpuTime>,
}

/// Added up over threads.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CpuTime {
    /// Time on a core.
    pub ran: Duration,
    /// Time on a core or waiting for one.
    pub wanted: Duration,
}

impl CpuTime {
    /// What was used since an earlier look.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self {
            ran: self.ran.saturating_sub(earlier.ran),
            wanted: self.wanted.saturating_sub(earlier.wanted),
        }
    }

    /// Time on a core, of the time when one was wanted; 1 if none was.
    pub fn share(self) -> f64 {
        if self.wanted.is_zero() {
            return 1.0;
        }
        self.ran.as_secs_f64() / self.wanted.as_secs_f64()
    }
}

impl Sum for CpuTime {
    fn sum<I: Iterator<Item = Self>>(times: I) -> Self {
        times.fold(Self::default(), |sum, time| Self {
            ran: sum.ran + time.ran,
            wanted: sum.wanted + time.wanted,
        })
    }
}

impl CpuShare {
    /// Watches a process too.
    pub fn watch(&mut self, process: u32) {
        self.task_folders.push(format!("/proc/{process}/task").into());
    }

    /// What has been used since the last look.
    pub fn look(&mut self) -> CpuTime {
        let now: BTreeMap<String, CpuTime> = self.threads().collect();
        // A thread that is new counts from the next look on.
        let used = now
            .iter()
            .map(|(thread, &now)| now.since(self.seen.get(thread).copied().unwrap_or(now)));
        let used = used.sum();
        self.seen = now;
        used
    }

    fn threads(&self) -> impl Iterator<Item = (String, CpuTime)> {
        let folders = self
            .task_folders
            .iter()
            .filter_map(|folder| fs::read_dir(folder).ok());
        folders.flatten().flatten().filter_map(|thread| {
            let times = fs::read_to_string(thread.path().join("schedstat")).ok()?;
            Some((thread.file_name().into_string().ok()?, parse(&times)?))
        })
    }
}

/// Nanoseconds that a thread ran, nanoseconds that it waited, number of turns.
fn parse(schedstat: &str) -> Option<CpuTime> {
    let mut fields = schedstat.split_ascii_whitespace();
    let mut next = || Some(Duration::from_nanos(fields.next()?.parse().ok()?));
    let ran = next()?;
    Some(CpuTime {
        ran,
        wanted: ran + next()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_systems_line_is_understood() {
        let expected = CpuTime {
            ran: Duration::from_nanos(1_500),
            wanted: Duration::from_micros(2),
        };
        assert_eq!(parse("1500 500 3\n"), Some(expected));
        assert_eq!(parse(""), None);
    }
}
