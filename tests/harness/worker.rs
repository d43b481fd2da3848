//! A `worker` process that connects over loopback, as from another machine.

use std::{
    net::SocketAddr,
    process::{Child, Command, ExitStatus, Stdio},
};

use crate::{
    log::Log,
    programs::{program, root, signal},
};

/// A worker process; killed at the end of the test.
#[derive(Debug)]
pub struct Worker {
    child: Child,
    /// What it says.
    pub log: Log,
}

impl Worker {
    /// Starts a worker that renders so many tasks at a time.
    pub fn start(name: &str, master: SocketAddr, slots: u32) -> Self {
        let mut child = Command::new(program("worker"))
            .args(["--connect", &master.to_string(), "--name", name])
            .args(["--slots", &slots.to_string(), "--priority", "ordinary"])
            // What other tests left on disk must not matter.
            .args(["--cache-bytes", "0"])
            .current_dir(root())
            .env_remove("RUST_LOG")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let log = Log::follow(child.stderr.take().expect("standard error is a pipe"));
        Self { child, log }
    }

    /// Sends a signal.
    pub fn signal(&self, name: &str) {
        signal(self.child.id(), name);
    }

    /// Waits for its end.
    pub fn wait(&mut self) -> ExitStatus {
        self.child.wait().expect("a child can be waited for")
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // It may have ended by itself; a stopped process can be killed, too.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
