//! Finds the master, stays with it, and comes back when the connection is lost.

mod reach;
mod session;

use std::hash::{BuildHasher as _, RandomState};
use std::io;
use std::sync::Arc;

use anyhow::{Context as _, anyhow};
use tokio::sync::watch;
use tokio::time::sleep;

use self::reach::Connection;
use self::session::{End, Session};
use crate::backoff::Backoff;
use crate::clock::Clock;
use crate::control::{self, server::ControlSocket};
use crate::disk_cache::{CacheOptions, DiskCache};
use crate::executor::Executor;
use crate::loader::Loader;
use crate::machine::Machine;
use crate::manners::{Allowance, Policy, When};
use crate::options::{Lifetime, WorkerOptions};
use crate::overseer::Overseer;
use crate::renderer::Renderer;
use crate::service;
use crate::signals::Signals;
use crate::state::Ending;
use crate::status::StatusBoard;

/// Why a worker ended as it should.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// A signal said so; this one.
    Signal(String),
    /// Its one master has no more work, or is gone.
    MasterDone,
}

/// Everything of a worker that lives longer than a connection.
#[derive(Debug)]
pub struct Client {
    options: WorkerOptions,
    clock: Clock,
    executor: Executor,
    loader: Loader,
    signals: Signals,
    /// Says how many slots may work; `None`: all, always.
    overseer: Option<Arc<Overseer>>,
    board: StatusBoard,
    /// The last complaint, so that a hundred attempts do not make a hundred lines.
    said: Option<String>,
}

impl Client {
    /// Starts the threads; to be called within the runtime.
    pub fn new(
        options: WorkerOptions,
        clock: Clock,
        renderer: Box<dyn Renderer>,
        signals: Signals,
    ) -> anyhow::Result<Self> {
        let threads = || format!("cannot start {} threads: use fewer --slots", options.slots);
        let priority = options.priority;
        let executor = Executor::start(options.slots, priority, clock).with_context(threads)?;
        let loader = Loader::start(renderer, open_cache(options.cache.clone()), priority)
            .context("cannot start a thread to load scenes")?;
        let oversee = |policy| oversee(policy, clock);
        let overseer = options.policy.clone().map(oversee).transpose();
        let overseer = overseer.context("cannot start a thread to look at the machine")?;
        let board = StatusBoard::new(&options, clock);
        if let Some(overseer) = &overseer {
            tokio::spawn(service::report(overseer.allowance()));
            listen_to_people(overseer, &board);
        }
        Ok(Self {
            options,
            clock,
            executor,
            loader,
            signals,
            overseer,
            board,
            said: None,
        })
    }

    /// Works until told to stop.
    pub async fn run(&mut self) -> anyhow::Result<Ended> {
        let mut backoff = Backoff::new();
        let (_keeps_open, everything) = watch::channel(Allowance::all(self.options.slots));
        let overseer = self.overseer.as_ref();
        let mut allowance = overseer.map_or(everything, |overseer| overseer.allowance());
        loop {
            let mut waiting_since = self.clock.now();
            let attempt = tokio::select! {
                biased;
                signal = self.signals.next() => return Ok(Ended::Signal(signal)),
                attempt = reach_when_allowed(&self.options, &mut allowance) => attempt,
            };
            match attempt {
                Ok(connection) => {
                    let session = Session::new(
                        &self.options,
                        self.clock,
                        &self.executor,
                        &self.loader,
                        allowance.clone(),
                        &self.board,
                        connection,
                    );
                    let (joined, end) = session.run(&mut self.signals).await;
                    waiting_since = self.clock.now();
                    if joined {
                        self.said = None;
                        backoff = Backoff::new();
                    }
                    if let Some(ended) = self.after(&end)? {
                        return Ok(ended);
                    }
                }
                Err(error) => self.unreachable(error)?,
            }
            // An attempt at a machine that does not answer is a part of the wait for the next.
            let waited = self.clock.now().saturating_sub(waiting_since);
            let wait = backoff.wait(chance()).saturating_sub(waited);
            tokio::select! {
                biased;
                signal = self.signals.next() => return Ok(Ended::Signal(signal)),
                () = sleep(wait) => {}
            }
        }
    }

    /// Waits for the threads, which end with what they are at.
    pub fn join(self) {
        self.executor.join();
        self.loader.join();
    }

    /// Decides whether the end of a connection is the end of the worker.
    fn after(&mut self, end: &End) -> anyhow::Result<Option<Ended>> {
        let master = &self.options.connect;
        let complaint = match end {
            End::Signal(signal) => return Ok(Some(Ended::Signal(signal.clone()))),
            End::Decided(Ending::Left) => {
                tracing::info!(%master, "left the master until slots may work again");
                return Ok(None);
            }
            End::Decided(Ending::Shutdown) | End::Gone(_) => None,
            End::Decided(Ending::Refused(reason)) => {
                Some(format!("the master at {master} refuses this worker: {reason}"))
            }
            End::Decided(Ending::Silent(time)) => Some(format!(
                "nothing was heard of {master} for {} s",
                time.as_secs_f32()
            )),
            End::Decided(Ending::Violation(text)) | End::Garbage(text) => Some(format!(
                "{master} does not talk like a Gridlight master of this version: {text}"
            )),
            End::Unsendable(text) => Some(format!("a message could not be sent: {text}")),
        };
        match (self.options.lifetime == Lifetime::Service, complaint) {
            (true, Some(complaint)) => self.say(format!("{complaint}; trying again")),
            (true, None) => tracing::info!(%master, "the master is gone ({end}); waiting for the next"),
            (false, Some(complaint)) => return Err(anyhow!(complaint)),
            (false, None) => return Ok(Some(Ended::MasterDone)),
        }
        Ok(None)
    }

    /// Decides what to do about a master that cannot be reached.
    fn unreachable(&mut self, error: anyhow::Error) -> anyhow::Result<()> {
        if self.options.lifetime != Lifetime::Service {
            // It listens before it starts its own worker: it is gone.
            return Err(error);
        }
        self.say(format!("{error:#}; trying again until a master is there"));
        Ok(())
    }

    /// Says something once, however often it happens.
    fn say(&mut self, text: String) {
        if self.said.as_ref() == Some(&text) {
            tracing::debug!("{text}");
        } else {
            tracing::warn!("{text}");
            self.said = Some(text);
        }
    }
}

/// Without a disk scenes come over the network each time; that is no reason not to work.
fn open_cache(options: Option<CacheOptions>) -> Option<DiskCache> {
    let options = options?;
    let folder = options.folder.clone();
    DiskCache::open(options)
        .inspect_err(
            |error| tracing::warn!(folder = %folder.display(), %error, "scenes cannot be kept on disk"),
        )
        .ok()
}

/// Starts to look at this machine, to be told by its login manager if that makes a difference.
fn oversee(policy: Policy, clock: Clock) -> io::Result<Arc<Overseer>> {
    let machine = Machine::new(clock);
    if policy.when == When::Idle {
        tokio::spawn(machine.sessions().ask());
    }
    Overseer::start(policy, machine, clock).map(Arc::new)
}

/// Opens the socket for orders, if the machine has a place for it. A worker works without it, too.
fn listen_to_people(overseer: &Arc<Overseer>, board: &StatusBoard) {
    let Some(path) = control::own_socket() else {
        tracing::debug!("neither RUNTIME_DIRECTORY nor XDG_RUNTIME_DIR is set: no socket for orders");
        return;
    };
    match ControlSocket::bind(&path) {
        Ok(socket) => {
            tokio::spawn(socket.serve(Arc::clone(overseer), board.clone()));
        }
        Err(error) => {
            tracing::warn!("`worker status`, `pause` and `resume` cannot reach this worker: {error:#}");
        }
    }
}

/// Leaves the master alone while no slot may work.
async fn reach_when_allowed(
    options: &WorkerOptions,
    allowance: &mut watch::Receiver<Allowance>,
) -> anyhow::Result<Connection> {
    let allowed = allowance.wait_for(|allowance| allowance.slots > 0).await;
    allowed.context("the thread that looks at the machine is gone")?;
    reach::master(options).await
}

/// A number from 0 to 1 that differs between machines and attempts. The standard library seeds its
/// hash tables by chance; nothing that is rendered depends on it.
fn chance() -> f64 {
    RandomState::new().hash_one(0) as f64 / u64::MAX as f64
}
