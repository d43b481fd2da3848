//! How the worker's session stands among the others.
//!
//! Where the kernel groups processes by session, classes and nice values count only within each, and every
//! session with something to do gets the same share of a core: even one in which all threads are of the class
//! `SCHED_IDLE`. So a worker that has a session of its own, as a service has, gives that the nice value of
//! its threads. Source: sched(7), "The autogroup feature".

use std::io;
use std::thread;
use std::time::Duration;
use std::{fs, fs::OpenOptions};

use rustix::process::{getpid, getsid};

use crate::priority::NICE;

/// Shows the session's nice value, and takes a new one.
const OWN: &str = "/proc/self/autogroup";
/// Whether sessions are weighed at all.
const SWITCH: &str = "/proc/sys/kernel/sched_autogroup_enabled";

/// Unprivileged processes may change a value ten times a second, all of them together.
const TRY_EVERY: Duration = Duration::from_millis(150);
const TRIES: u32 = 20;

/// Whether the system weighs sessions against each other now. Its administrator may change that at any time.
pub fn are_weighed() -> bool {
    is_known() && fs::read_to_string(SWITCH).is_ok_and(|switch| switch.trim() != "0")
}

/// Whether a session can have a nice value here.
pub fn is_known() -> bool {
    fs::metadata(OWN).is_ok()
}

/// Puts a session of our own behind all others, in a thread that ends with that. Of a session that is not ours
/// alone nothing is changed: that would put somebody's whole terminal behind.
pub fn stand_back() -> io::Result<()> {
    let is_own = getsid(None).is_ok_and(|session| session == getpid());
    if is_own && is_known() {
        let thread = thread::Builder::new().name("session".to_owned());
        thread.spawn(|| {
            if let Err(error) = lower() {
                tracing::warn!(%error, "the session of this worker stays beside the others: {OWN} takes no {NICE}");
            }
        })?;
    } else if are_weighed() {
        tracing::info!(
            "the priority of this worker counts within its session only, of which there are others: \
             as a service or started by `setsid` it is behind all programs"
        );
    }
    Ok(())
}

/// Whether this process may change how its session stands.
pub fn may_change() -> io::Result<()> {
    OpenOptions::new().write(true).open(OWN).map(drop)
}

fn lower() -> io::Result<()> {
    let mut result = Ok(());
    for _ in 0..TRIES {
        result = fs::write(OWN, NICE.to_string());
        match &result {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => thread::sleep(TRY_EVERY),
            _ => break,
        }
    }
    result
}
