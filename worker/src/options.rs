//! What a worker is told when it starts.

use protocol::Keys;

use crate::disk_cache::CacheOptions;
use crate::manners::Policy;
use crate::priority::Priority;

/// What a worker is told when it starts.
#[derive(Clone, Debug)]
pub struct WorkerOptions {
    /// The master, as `HOST:PORT`.
    pub connect: String,
    /// What it shows that it belongs to the grid, and asks of the master; `None`: nothing.
    pub keys: Option<Keys>,
    /// Threads that render, 1 to [`protocol::limits::SLOTS`].
    pub slots: u32,
    /// Name by which people know this worker.
    pub name: String,
    /// What the owner of this machine allows; `None`: all slots, always.
    pub policy: Option<Policy>,
    /// How the threads that render stand in line for a core.
    pub priority: Priority,
    /// Bytes of memory that a scene may need.
    pub memory_max: u64,
    /// How long to work.
    pub lifetime: Lifetime,
    /// Where to keep scenes, if anywhere.
    pub cache: Option<CacheOptions>,
    /// Program version for people, as `0.1.0 (1234abcd)`.
    pub version: String,
}

/// How long a worker works.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Lifetime {
    /// For any number of masters, until it is told to go.
    Service,
    /// For one master, which started it on its own machine: ends with the connection.
    OneMaster {
        /// By which the master knows it.
        token: Option<String>,
    },
}
