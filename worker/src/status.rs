//! How a worker is, for people and scripts.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::clock::Clock;
use crate::manners::{Allowance, Hindrance};
use crate::options::WorkerOptions;

/// How a worker is.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Status {
    /// Its name.
    pub name: String,
    /// Its program version.
    pub version: String,
    /// Its process.
    pub process: u32,
    /// Seconds since its start.
    pub up_s: u64,
    /// Slots that may work now.
    pub slots: u32,
    /// Most slots that may work at a time.
    pub slots_max: u32,
    /// Why not all slots may work; absent if they may.
    pub hindrance: Option<String>,
    /// Seconds for which it is paused; absent if it is not.
    pub paused_s: Option<u64>,
    /// The master that it looks for.
    pub master: String,
    /// Whether it is connected to that master.
    pub connected: bool,
    /// Results sent since its start.
    pub results: u64,
    /// Pixels in these, each counted once for every component and pass.
    pub pixels: u64,
}

/// One line for each thing to know.
impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            version,
            process,
            up_s,
            slots,
            slots_max,
            master,
            results,
            pixels,
            ..
        } = self;
        writeln!(
            f,
            "worker  {name}, version {version}, process {process}, up for {up_s} s"
        )?;
        let connected = if self.connected {
            "connected"
        } else {
            "not connected"
        };
        writeln!(f, "master  {master}, {connected}")?;
        write!(f, "slots   {slots} of {slots_max}")?;
        match &self.hindrance {
            Some(hindrance) => writeln!(f, ": {hindrance}")?,
            None => writeln!(f)?,
        }
        write!(f, "sent    {results} results with {pixels} pixels")
    }
}

/// What the worker's parts write their share of the status on. Clones are the same board.
#[derive(Clone, Debug)]
pub struct StatusBoard {
    shared: Arc<Mutex<Status>>,
    clock: Clock,
}

impl StatusBoard {
    /// A board that shows what never changes.
    pub fn new(options: &WorkerOptions, clock: Clock) -> Self {
        let status = Status {
            name: options.name.clone(),
            version: options.version.clone(),
            process: std::process::id(),
            up_s: 0,
            slots: 0,
            slots_max: options.slots,
            hindrance: None,
            paused_s: None,
            master: options.connect.clone(),
            connected: false,
            results: 0,
            pixels: 0,
        };
        Self {
            shared: Arc::new(Mutex::new(status)),
            clock,
        }
    }

    /// The master has welcomed this worker, or is gone.
    pub fn set_connected(&self, connected: bool) {
        self.change(|status| status.connected = connected);
    }

    /// A result is on its way.
    pub fn count_result(&self, pixels: u32) {
        self.change(|status| {
            status.results += 1;
            status.pixels += u64::from(pixels);
        });
    }

    /// All of it, now that so many slots may work.
    pub fn status(&self, allowance: &Allowance) -> Status {
        self.change(|status| {
            status.up_s = self.clock.now().as_secs();
            status.slots = allowance.slots;
            status.hindrance = allowance.hindrance.as_ref().map(Hindrance::to_string);
            status.paused_s = match allowance.hindrance {
                Some(Hindrance::Paused(left)) => Some(left.as_secs()),
                _ => None,
            };
            status.clone()
        })
    }

    fn change<T>(&self, change: impl FnOnce(&mut Status) -> T) -> T {
        // No code that can panic runs under the lock.
        change(&mut self.shared.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::options::Lifetime;
    use crate::priority::Priority;

    #[test]
    fn people_read_in_four_lines_what_scripts_read_as_json() {
        let options = WorkerOptions {
            connect: "lab-1:7420".to_owned(),
            keys: None,
            slots: 4,
            name: "lab-7".to_owned(),
            policy: None,
            priority: Priority::Idle,
            memory_max: 0,
            cache: None,
            lifetime: Lifetime::Service,
            version: "0.1.0".to_owned(),
        };
        let board = StatusBoard::new(&options, Clock::start());
        board.set_connected(true);
        board.count_result(1000);
        let status = board.status(&Allowance {
            slots: 0,
            hindrance: Some(Hindrance::Paused(Duration::from_secs(90))),
        });
        let text = status.to_string();
        for part in [
            "lab-7",
            "lab-1:7420, connected",
            "0 of 4: paused for 90 s",
            "1 results with 1000 pixels",
        ] {
            assert!(text.contains(part), "{part} is missing in:\n{text}");
        }
        let json: serde_json::Value = serde_json::to_value(&status).unwrap();
        assert_eq!((&json["paused_s"], &json["slots"]), (&90.into(), &0.into()));
    }
}
