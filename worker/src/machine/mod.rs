//! What can be seen of this machine. Reads files of the system; decides nothing.

pub mod cpu;
pub mod input;
pub mod power;
pub mod session;

use std::fs;
use std::path::{Path, PathBuf};

use self::session::Sessions;
use crate::clock::Clock;
use crate::manners::Look;
use crate::manners::load::Cores;
use crate::manners::presence::Signs;

/// The machine as its files show it.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Where `proc`, `sys` and `dev` are.
    root: PathBuf,
    sessions: Sessions,
    clock: Clock,
}

impl Machine {
    /// This machine.
    pub fn new(clock: Clock) -> Self {
        Self::at(Path::new("/"), clock)
    }

    /// A machine whose files are in another folder.
    pub fn at(root: &Path, clock: Clock) -> Self {
        Self {
            root: root.to_owned(),
            sessions: Sessions::default(),
            clock,
        }
    }

    /// What its login manager says, once somebody lets it ask.
    pub fn sessions(&self) -> Sessions {
        self.sessions.clone()
    }

    /// A look at all of it.
    pub fn look(&self) -> Look {
        Look {
            cpu: self.read("proc/stat").and_then(|stat| cpu::times(&stat)),
            signs: self.signs(),
            on_mains: power::on_mains(&self.root.join("sys/class/power_supply")),
            week_minute: Some(self.clock.week_minute()),
        }
    }

    /// A look for signs of the owner.
    pub fn signs(&self) -> Signs {
        let now = self.clock.wall();
        Signs {
            session: self.sessions.idle_for(now),
            terminal: input::terminal_used(&self.root.join("dev"), now),
            interrupts: self
                .read("proc/interrupts")
                .and_then(|text| input::interrupts(&text)),
        }
    }

    /// Its cores.
    pub fn cores(&self) -> Cores {
        let count = self.read("proc/stat").map_or(0, |stat| cpu::cores(&stat));
        let siblings = self.read("sys/devices/system/cpu/cpu0/topology/thread_siblings_list");
        Cores {
            count: count.max(1),
            threads_per_core: siblings.map_or(1, |list| cpu::siblings(&list)),
        }
    }

    fn read(&self, file: &str) -> Option<String> {
        fs::read_to_string(self.root.join(file)).ok()
    }
}
