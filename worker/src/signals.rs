//! The signals by which a worker is told to go.

use std::io;

use tokio::signal::unix::{Signal, SignalKind, signal};

use crate::options::Lifetime;

/// SIGTERM and SIGINT, from now on.
#[derive(Debug)]
pub struct Signals {
    terminate: Signal,
    interrupt: Signal,
    lifetime: Lifetime,
}

impl Signals {
    /// Takes the signals over from the system's default of ending the process.
    pub fn listen(lifetime: Lifetime) -> io::Result<Self> {
        let terminate = signal(SignalKind::terminate())?;
        let interrupt = signal(SignalKind::interrupt())?;
        Ok(Self {
            terminate,
            interrupt,
            lifetime,
        })
    }

    /// Waits for the next signal that means: go. Cancel safe.
    pub async fn next(&mut self) -> String {
        loop {
            tokio::select! {
                _ = self.terminate.recv() => return "SIGTERM".to_owned(),
                _ = self.interrupt.recv() => {
                    // Control-C at the terminal reaches the master and its own workers alike. What
                    // it means is for the master to say: it may still want their results.
                    if self.lifetime == Lifetime::Service {
                        return "SIGINT".to_owned();
                    }
                }
            }
        }
    }
}
