//! By what a worker is told to go: signals to its process, or the program that it is a part of.

use std::io;
use std::sync::Arc;

use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::Notify;

use crate::options::Lifetime;

/// Whatever tells this worker to go, from now on.
#[derive(Debug)]
pub enum Signals {
    /// SIGTERM and SIGINT.
    Process {
        /// SIGTERM.
        terminate: Signal,
        /// SIGINT.
        interrupt: Signal,
        /// Whether the latter counts.
        lifetime: Lifetime,
    },
    /// The program around it, whose signals are its own.
    Host(Stop),
}

/// By this a program tells the worker inside it to go; clones tell the same worker.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<Notify>);

impl Stop {
    /// Tells the worker to go, whether it has begun or not.
    pub fn stop(&self) {
        self.0.notify_one();
    }
}

impl Signals {
    /// Takes the signals over from the system's default of ending the process.
    pub fn listen(lifetime: Lifetime) -> io::Result<Self> {
        Ok(Self::Process {
            terminate: signal(SignalKind::terminate())?,
            interrupt: signal(SignalKind::interrupt())?,
            lifetime,
        })
    }

    /// Waits for the next signal that means: go. Cancel safe.
    pub async fn next(&mut self) -> String {
        let (terminate, interrupt, lifetime) = match self {
            Self::Host(stop) => {
                stop.0.notified().await;
                return "its program".to_owned();
            }
            Self::Process {
                terminate,
                interrupt,
                lifetime,
            } => (terminate, interrupt, lifetime),
        };
        loop {
            tokio::select! {
                _ = terminate.recv() => return "SIGTERM".to_owned(),
                _ = interrupt.recv() => {
                    // Control-C at the terminal reaches the master and its own workers alike. What
                    // it means is for the master to say: it may still want their results.
                    if *lifetime == Lifetime::Service {
                        return "SIGINT".to_owned();
                    }
                }
            }
        }
    }
}
