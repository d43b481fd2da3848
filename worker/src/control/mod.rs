//! The local socket by which people on this machine ask a worker how it is, and make it pause.
//!
//! A connection carries one line of JSON each way: an [`Order`], and the [`Reply`].

pub mod client;
pub mod server;

use std::env;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::status::Status;

/// Bytes of a line, either way.
const LINE_BYTES: u64 = 16 << 10;

/// Where the system's own worker listens; its service makes the folder.
const SYSTEM_SOCKET: &str = "/run/gridlight-worker/control.sock";

/// What people want of a worker.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// To say how it is.
    Status,
    /// To render nothing for so long.
    Pause {
        /// Seconds.
        seconds: u64,
    },
    /// To end a pause.
    Resume,
}

/// What a worker answers.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reply {
    /// How it is, after the order was carried out.
    Status(Box<Status>),
    /// Why it did nothing.
    Refused(String),
}

/// Where a worker started here listens: in the folder that its service was given, or that the system
/// keeps for its user. `None` if there is neither.
pub fn own_socket() -> Option<PathBuf> {
    let first = |folders: String| folders.split(':').next().map(PathBuf::from);
    match env::var("RUNTIME_DIRECTORY").ok().and_then(first) {
        Some(folder) => Some(folder.join("control.sock")),
        None => user_socket(),
    }
}

fn user_socket() -> Option<PathBuf> {
    let folder = env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty())?;
    Some(PathBuf::from(folder).join("gridlight-worker.sock"))
}
