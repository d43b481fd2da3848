//! The worker on this machine: this same program, started again with its hidden subcommand.
//!
//! A process of its own, so that whatever kills it (a crash, a lack of memory, an impatient owner)
//! leaves the master and the picture alive; its results take the way of all others.

use std::{env, io, net::SocketAddr, process::Stdio};

use tokio::{
    io::{AsyncBufReadExt, AsyncRead, BufReader},
    process::{Child, Command},
};

use worker::{Lifetime, Priority, WorkerOptions};

use crate::cli::{LocalWorkerArgs, VERSION};

/// Tells the worker the token by which its master knows it. Not a flag: those can be seen by all.
const TOKEN_VARIABLE: &str = "GRIDLIGHT_LOCAL_TOKEN";
/// What the local worker is called.
const NAME: &str = "local";

/// The worker process itself: works for the master that started it until that is gone.
pub fn run(args: LocalWorkerArgs) -> anyhow::Result<()> {
    worker::run(WorkerOptions {
        connect: args.connect.to_string(),
        // Its token is enough, and what it says does not leave this machine.
        keys: None,
        slots: args.slots,
        name: NAME.to_owned(),
        policy: None,
        priority: Priority::Ordinary,
        memory_max: u64::MAX,
        lifetime: Lifetime::OneMaster {
            token: env::var(TOKEN_VARIABLE).ok(),
        },
        // The scene is on this machine already.
        cache: None,
        version: VERSION.to_owned(),
    })?;
    Ok(())
}

/// A running worker process; killed when dropped.
#[derive(Debug)]
pub struct LocalWorker {
    child: Child,
}

/// How to start one.
#[derive(Debug, Clone)]
pub struct Start {
    /// Where the master listens.
    pub master: SocketAddr,
    /// Tasks rendered at a time.
    pub slots: u32,
    /// Known to this worker alone.
    pub token: String,
}

impl Start {
    /// Starts a worker that inherits nothing but the environment: whoever waits for the end of this
    /// process' output must not wait for the worker's memory to be torn down.
    pub fn start(&self) -> io::Result<LocalWorker> {
        let mut child = Command::new(env::current_exe()?)
            .arg("worker")
            .args(["--connect", &self.master.to_string()])
            .args(["--slots", &self.slots.to_string()])
            .env(TOKEN_VARIABLE, &self.token)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn()?;
        if let Some(stderr) = child.stderr.take() {
            tokio::spawn(pass_on(stderr));
        }
        Ok(LocalWorker { child })
    }
}

impl LocalWorker {
    /// The number of the process, while it lives.
    pub fn process(&self) -> Option<u32> {
        self.child.id()
    }

    /// Ends it at once. It has no work of which anything would be lost.
    pub fn kill(&mut self) {
        if let Err(error) = self.child.start_kill() {
            tracing::debug!(%error, "the local worker was gone already");
        }
    }

    /// Waits for its end and says how it came, for people.
    pub async fn ended(&mut self) -> String {
        match self.child.wait().await {
            Ok(status) => status.to_string(),
            Err(error) => error.to_string(),
        }
    }
}

/// Puts what the worker says into our own log.
async fn pass_on(output: impl AsyncRead + Unpin) {
    let mut lines = BufReader::new(output).lines();
    while let Ok(Some(line)) = lines.next_line().await {
        tracing::info!(target: "local_worker", "{line}");
    }
}
