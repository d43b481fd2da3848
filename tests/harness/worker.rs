//! A `worker` process that connects over loopback, as from another machine.

use std::{
    ffi::OsStr,
    net::SocketAddr,
    path::Path,
    process::{Child, Command, ExitStatus, Stdio},
};

use crate::{
    log::Log,
    network::Host,
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
        Self::start_with(name, master, slots, &[])
    }

    /// Starts a worker that has a key.
    pub fn start_with_key(name: &str, master: SocketAddr, slots: u32, key: &Path) -> Self {
        Self::start_with(name, master, slots, &["--key".as_ref(), key.as_os_str()])
    }

    /// Starts a worker that has a key on another host, whether there is a master or not.
    pub fn start_on(host: &Host, master: SocketAddr, slots: u32, key: &Path) -> Self {
        let command = command(host.name(), master, slots, &["--key".as_ref(), key.as_os_str()]);
        Self::spawn(host.command(&command))
    }

    fn start_with(name: &str, master: SocketAddr, slots: u32, flags: &[&OsStr]) -> Self {
        Self::spawn(command(name, master, slots, flags))
    }

    fn spawn(mut command: Command) -> Self {
        let mut child = command
            .current_dir(root())
            .env_remove("RUST_LOG")
            .env_remove("GRIDLIGHT_KEY")
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

fn command(name: &str, master: SocketAddr, slots: u32, flags: &[&OsStr]) -> Command {
    let mut command = Command::new(program("worker"));
    command
        .args(flags)
        .args(["--connect", &master.to_string(), "--name", name])
        .args(["--slots", &slots.to_string(), "--priority", "ordinary"])
        // What other tests left on disk must not matter.
        .args(["--cache-bytes", "0"]);
    command
}

impl Drop for Worker {
    fn drop(&mut self) {
        // It may have ended by itself; a stopped process can be killed, too.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
