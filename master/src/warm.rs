//! `master warm`: gives a scene to the workers before there is a frame, so that no frame waits for it.

use std::{collections::BTreeSet, time::Duration};

use anyhow::anyhow;
use protocol::{
    ToMaster, ToWorker, WorkerId,
    envelope::Sealed,
    limits,
    message::{Prepare, Shutdown, Want},
};
use render::scene::load::{LoadOptions, load};
use tokio::{
    sync::{Semaphore, mpsc},
    time::{MissedTickBehavior, interval, sleep},
};

use crate::{
    admission::{self, Admission},
    cli::WarmArgs,
    clock::Clock,
    connection::{Arrival, Joined, Shared},
    exit::{Exit, Failure, OrExit},
    roster::Roster,
    scene_bytes::SceneBytes,
    scene_path, server,
};

/// Arrivals that may wait.
const ARRIVALS_MAX: usize = 64;
/// How often everyone gets a sign of life.
const PING_EVERY: Duration = Duration::from_millis(200);

/// Everyone who came for the scene.
#[derive(Debug)]
struct Warming {
    clock: Clock,
    scene: SceneBytes,
    prepare: Sealed,
    roster: Roster,
    warm: BTreeSet<WorkerId>,
}

/// Lets workers have the scene until the time is up, or until all that are expected have it.
pub fn run(args: &WarmArgs, clock: Clock) -> Result<Exit, Failure> {
    let path = args.scene.clone().unwrap_or_else(scene_path::default_scene);
    let keys = admission::keys(&args.key, args.listen)?;
    server::raise_connections_max();
    let listener = server::bind(args.listen).or_exit(Exit::Listen)?;
    let options = LoadOptions {
        scenes_dir: scene_path::scenes_dir(),
    };
    let scene = SceneBytes::new(&load(&path, &options).or_exit(Exit::Scene)?.scene);
    let prepare = ToWorker::Prepare(Prepare {
        scene: scene.reference().clone(),
    });
    let mut warming = Warming {
        clock,
        prepare: Sealed::new(&prepare).or_exit(Exit::Unforeseen)?,
        scene,
        roster: Roster::default(),
        warm: BTreeSet::new(),
    };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.or_exit(Exit::Unforeseen)?;
    runtime.block_on(async {
        let (sender, arrivals) = mpsc::channel(ARRIVALS_MAX);
        let address = listener.local_addr().or_exit(Exit::Listen)?;
        let shared = Shared {
            arrivals: sender,
            // Nobody is started here.
            admission: Admission::new(keys, None),
            places: Semaphore::new(limits::WORKERS),
            clock,
        };
        tokio::spawn(server::accept(listener, shared.into()));
        tracing::info!(scene = %path.display(), %address, "workers may come for the scene");
        warming.serve(args, arrivals).await.or_exit(Exit::Unforeseen)
    })?;
    let (warm, came) = (warming.warm.len(), warming.roster.reports().len());
    if warm < args.expect_workers.unwrap_or(1) {
        let error = anyhow!("{warm} workers have the scene of {came} that came; give them longer by --wait");
        return Err(Failure::new(Exit::Incomplete, error));
    }
    tracing::info!("{warm} workers have the scene in memory");
    Ok(Exit::Delivered)
}

impl Warming {
    async fn serve(&mut self, args: &WarmArgs, mut arrivals: mpsc::Receiver<Arrival>) -> anyhow::Result<()> {
        let mut beat = interval(PING_EVERY);
        beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let time_is_up = sleep(args.wait);
        tokio::pin!(time_is_up);
        while args
            .expect_workers
            .is_none_or(|expected| self.warm.len() < expected)
        {
            tokio::select! {
                biased;
                () = &mut time_is_up => break,
                _ = beat.tick() => self.roster.ping_all(self.clock.now())?,
                Some(arrival) = arrivals.recv() => self.arrived(arrival),
            }
        }
        self.roster.send_all(&ToWorker::Shutdown(Shutdown {}))?;
        Ok(())
    }

    fn arrived(&mut self, arrival: Arrival) {
        match arrival {
            Arrival::Joined(joined) => self.joined(joined),
            Arrival::Said { worker, message } => match message {
                ToMaster::Want(want) => self.send_chunk(worker, want),
                ToMaster::Prepared(prepared) if prepared.digest == self.scene.digest() => {
                    self.prepared(worker);
                }
                ToMaster::Failed(failed) => self.left(worker, &failed.message),
                _ => {}
            },
            Arrival::Left { worker, fault } => {
                self.left(worker, fault.as_deref().unwrap_or("it closed the connection"));
            }
        }
    }

    fn joined(&mut self, joined: Joined) {
        let worker = self.roster.join(joined, self.clock.now());
        self.send(worker, self.prepare.clone());
    }

    fn send_chunk(&mut self, worker: WorkerId, want: Want) {
        match self.scene.chunk(want, false) {
            Ok(Some(chunk)) => {
                if let Some(report) = self.roster.report(worker) {
                    report.scene_bytes += chunk.bytes().len() as u64;
                }
                self.send(worker, chunk);
            }
            Ok(None) => self.left(worker, "it wants a scene that we do not have"),
            Err(error) => self.left(worker, &error.to_string()),
        }
    }

    fn prepared(&mut self, worker: WorkerId) {
        if let Some(report) = self.roster.report(worker) {
            let (name, bytes) = (&report.name, report.scene_bytes);
            tracing::info!(name, bytes, "a worker has the scene");
            self.warm.insert(worker);
        }
    }

    fn send(&mut self, worker: WorkerId, message: Sealed) {
        if !self.roster.send(worker, message) {
            self.left(worker, "it does not read what it is sent");
        }
    }

    /// A worker that goes keeps the scene that it has.
    fn left(&mut self, worker: WorkerId, why: &str) {
        if let Some(member) = self.roster.leave(worker, why) {
            tracing::warn!(name = member.name, why, "a worker is gone");
        }
    }
}
