//! The one loop of a frame: selects over sockets, timers, signals and threads until the picture is there.

use std::{net::TcpListener, sync::Arc, time::Duration};

use anyhow::anyhow;
use protocol::{Keys, limits};
use rayon::ThreadPool;
use render::{gbuffer::Aovs, reconstruct::Reconstruction, settings::Settings};
use tokio::{
    signal::unix::{Signal, SignalKind, signal},
    sync::{Semaphore, mpsc, oneshot},
    time::{Interval, MissedTickBehavior, interval, sleep_until},
};

use crate::{
    admission::Admission,
    clock::Clock,
    connection::{Arrival, Shared},
    cores,
    cpu_share::CpuShare,
    deadline::Rehearsed,
    deliver::StagedPicture,
    exit::{Exit, Failure, OrExit},
    finish::{self, Finished, Material},
    frame::Frame,
    frame_time::FrameTime,
    job::Job,
    local_worker::{LocalWorker, Start},
    prepare::{self, Loaded, Ready},
    progress::{Progress, Snapshot},
    rehearsal,
    rehearsals::Rehearsals,
    report::LedgerReport,
    reporting,
    run::Delivered,
    server,
};

/// Arrivals that may wait; beyond it connections are not read, so that senders slow down.
const ARRIVALS_MAX: usize = 64;
/// The beat of all that happens now and then.
const BEAT: Duration = Duration::from_millis(25);
/// Beats between two pings of everyone, and two estimates of the noise: a tenth of a second.
const BEATS_PER_PING: u32 = 4;
/// Beats between two pictures of the progress.
const BEATS_PER_SNAPSHOT: u32 = 4;
/// How often a local worker that died is replaced.
const RESTARTS_MAX: u32 = 3;
/// So long before the deadline the program gives up if there is no scene to make a picture of.
const GIVE_UP: Duration = Duration::from_millis(20);

/// What a session needs to know.
#[derive(Debug)]
pub struct Setting {
    /// What is asked for.
    pub job: Job,
    /// Time since the start of the process.
    pub clock: Clock,
    /// By which the local worker is known.
    pub local_token: String,
}

/// Everything that is alive while a frame is rendered.
#[derive(Debug)]
pub struct Session {
    setting: Setting,
    frame: Frame,
    arrivals: mpsc::Receiver<Arrival>,
    ready: mpsc::UnboundedReceiver<Result<Ready, Failure>>,
    all_ready: bool,
    rehearsals: Rehearsals,
    local: Local,
    signals: Signals,
    beat: Interval,
    beats: u32,
    share: CpuShare,
    looked: FrameTime,
    prepared: Prepared,
    shown: (FrameTime, u64),
    finishers: Arc<ThreadPool>,
    ledger: Option<LedgerReport>,
    interrupted: Option<Exit>,
}

/// The worker on this machine.
#[derive(Debug)]
struct Local {
    start: Start,
    worker: Option<LocalWorker>,
    restarts: u32,
}

/// What the preparing thread has told so far.
#[derive(Debug, Default)]
pub struct Prepared {
    /// The workload.
    pub settings: Option<Settings>,
    /// Digest of the scene.
    pub digest: String,
    /// Time to read the scene.
    pub load: Duration,
    /// Time to build the BVH.
    pub bvh: Duration,
    aovs: Option<Arc<Aovs>>,
}

#[derive(Debug)]
struct Signals {
    interrupt: Signal,
    terminate: Signal,
}

impl Session {
    /// Starts everything: the server, the local worker, the threads that prepare and rehearse.
    pub fn start(setting: Setting, listener: TcpListener) -> Result<Self, Failure> {
        let address = listener.local_addr().or_exit(Exit::Listen)?;
        let (sender, arrivals) = mpsc::channel(ARRIVALS_MAX);
        let shared = Arc::new(Shared {
            arrivals: sender,
            admission: Admission::new(setting.job.keys.clone(), Some(&setting.local_token)),
            places: Semaphore::new(limits::WORKERS),
            clock: setting.clock,
        });
        tokio::spawn(server::accept(listener, shared));
        tracing::info!(%address, keys = setting.job.keys.as_ref().map(Keys::fingerprints), "workers may connect");
        if setting.job.keys.is_none() && !address.ip().is_loopback() {
            tracing::warn!(%address, "anybody who reaches this address may join and see the scene: --insecure");
        }

        let mut share = CpuShare::default();
        let mut local = Local {
            start: Start {
                master: address,
                slots: setting.job.local_slots,
                token: setting.local_token.clone(),
            },
            worker: None,
            restarts: 0,
        };
        local.start(&setting.job, &mut share)?;
        let finishers = Arc::new(cores::pool().or_exit(Exit::Unforeseen)?);
        let mut beat = interval(BEAT);
        beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Ok(Self {
            frame: Frame::new(&setting.job, setting.clock),
            ready: prepare::start(&setting.job, setting.clock),
            all_ready: false,
            rehearsals: Rehearsals::start(&setting.job, setting.clock, &finishers),
            arrivals,
            local,
            signals: Signals::listen()?,
            beat,
            beats: 0,
            share,
            looked: FrameTime::START,
            prepared: Prepared::default(),
            shown: (FrameTime::START, 0),
            ledger: None,
            finishers,
            interrupted: None,
            setting,
        })
    }

    /// Traces until the cut-off, then makes the picture and puts it in its place.
    pub async fn run(
        &mut self,
        staged: StagedPicture,
        progress: &mut Progress,
    ) -> Result<Delivered, Failure> {
        while !(self.frame.is_closed() && self.prepared.aovs.is_some()) {
            self.step(progress).await?;
        }
        if self.setting.job.deadline.is_some() {
            // This thread has the last word: it may not wait behind other programs.
            cores::go_first();
        }
        let finished = self.finish(staged)?;
        let finished = self.wait_for(finished).await?;
        self.deliver(finished)
    }

    /// Ends the local worker. Nobody waits until its memory is torn down.
    pub fn kill_local_worker(&mut self) {
        if let Some(worker) = &mut self.local.worker {
            worker.kill();
        }
    }

    /// Waits for one thing to happen and sees to it.
    async fn step(&mut self, progress: &mut Progress) -> Result<(), Failure> {
        let timeout = self.timeout();
        let deadline = self
            .setting
            .clock
            .instant(timeout.unwrap_or(FrameTime::START))
            .into();
        tokio::select! {
            biased;
            () = sleep_until(deadline), if timeout.is_some() => self.time_is_up(timeout)?,
            exit = self.signals.next() => self.interrupt(exit)?,
            ready = self.ready.recv(), if !self.all_ready => self.now_ready(ready, progress)?,
            Some(rehearsed) = self.rehearsals.learnt() => self.rehearsed(&rehearsed),
            _ = self.beat.tick() => self.beat(progress),
            how = self.local.ended() => self.local_worker_ended(&how)?,
            Some(arrival) = self.arrivals.recv() => self.frame.arrived(arrival),
        }
        Ok(())
    }

    /// The cut-off; or, while there is nothing to make a picture of, the end of all hope.
    fn timeout(&self) -> Option<FrameTime> {
        self.frame.timeout().or_else(|| {
            let deadline = self.setting.job.deadline?;
            Some(deadline - GIVE_UP)
        })
    }

    fn time_is_up(&mut self, timeout: Option<FrameTime>) -> Result<(), Failure> {
        if let (Some(timeout), Some(ledger)) = (timeout, self.frame.ledger()) {
            ledger.lateness(timeout.until(self.setting.clock.now()));
        }
        if self.frame.timeout().is_none() && self.prepared.aovs.is_none() {
            let what = if self.prepared.settings.is_some() {
                "the BVH of the scene was ready"
            } else {
                "the scene was in memory"
            };
            let error = anyhow!("the deadline came before {what}; choose a later --deadline");
            return Err(Failure::new(Exit::DeadlineMissed, error));
        }
        self.frame.tick();
        Ok(())
    }

    /// What the preparing thread says.
    fn now_ready(
        &mut self,
        ready: Option<Result<Ready, Failure>>,
        progress: &mut Progress,
    ) -> Result<(), Failure> {
        match ready.transpose()? {
            Some(Ready::Loaded(loaded)) => {
                for note in &loaded.notes {
                    tracing::warn!("{note}");
                }
                progress.announce(&self.greeting(&loaded));
                self.prepared.settings = Some(loaded.settings);
                self.prepared.digest.clone_from(&loaded.digest);
                self.prepared.load = loaded.load;
                if let Some(ledger) = self.frame.ledger() {
                    let size = loaded.settings.size;
                    let leave = rehearsal::leave(size, &self.setting.job.files);
                    ledger.resize(size.pixel_count(), leave);
                }
                self.frame.scene_loaded(loaded.geometry);
            }
            Some(Ready::Traceable(traceable)) => {
                self.prepared.bvh = traceable.bvh;
                if let Some(settings) = self.prepared.settings {
                    let begun = self.frame.traceable(&settings, &traceable);
                    begun.or_exit(Exit::Unforeseen)?;
                }
            }
            Some(Ready::Aovs(aovs)) => self.prepared.aovs = Some(aovs),
            None => self.all_ready = true,
        }
        Ok(())
    }

    /// What will be rendered, and where to join.
    fn greeting(&self, loaded: &Loaded) -> String {
        format!(
            "{}: {} triangles, {}; workers join with --connect {}",
            self.setting.job.scene.display(),
            loaded.triangles,
            reporting::workload(&loaded.settings),
            self.local.start.master
        )
    }

    fn rehearsed(&mut self, rehearsed: &Rehearsed) {
        tracing::debug!(?rehearsed, "the finish phase was rehearsed");
        if let Some(ledger) = self.frame.ledger() {
            ledger.rehearsed(*rehearsed);
        }
        self.frame.move_cut_off();
    }

    /// Rehearses again if it is time, and if the real thing would not have to wait for it.
    fn rehearse(&mut self) {
        let now = self.setting.clock.now();
        let is_steady = self.frame.has_begun() && self.prepared.aovs.is_some();
        let cut_off = self.frame.timeout();
        if let (true, Some(cut_off)) = (is_steady, cut_off) {
            self.rehearsals.again(now, now.until(cut_off));
        }
    }

    /// Everything that happens now and then.
    fn beat(&mut self, progress: &mut Progress) {
        self.beats = self.beats.wrapping_add(1);
        self.measure_share();
        self.rehearse();
        self.frame.move_cut_off();
        if self.beats.is_multiple_of(BEATS_PER_PING) {
            self.frame.ping();
            self.frame.estimate_noise();
        }
        if self.beats.is_multiple_of(BEATS_PER_SNAPSHOT) {
            self.show(progress);
        }
    }

    /// Looks how much of the cores is ours.
    fn measure_share(&mut self) {
        let now = self.setting.clock.now();
        let interval = self.looked.until(now);
        self.looked = now;
        let used = self.share.look();
        // While our own preparations and tasks stand in each other's way, nothing is learnt of others.
        let tracing_alone = self.frame.has_begun() && self.prepared.aovs.is_some();
        if let (true, Some(ledger)) = (tracing_alone, self.frame.ledger()) {
            ledger.cpu_time(interval, used.ran, used.wanted);
        }
    }

    fn show(&mut self, progress: &mut Progress) {
        let Some(scheduler) = self.frame.scheduler() else {
            return;
        };
        let now = self.setting.clock.now();
        let rays = self.frame.rays();
        let rays = rays.primary.saturating_add(rays.shadow);
        let (shown_at, shown_rays) = self.shown;
        progress.show(&Snapshot {
            now,
            deadline: self.setting.job.deadline,
            tallies: scheduler.tallies(),
            slots: self.frame.roster().slots(),
            rays: rays.saturating_sub(shown_rays),
            since: shown_at.until(now),
        });
        self.shown = (now, rays);
    }

    /// A first signal ends the tracing; a second one ends everything.
    fn interrupt(&mut self, exit: Exit) -> Result<(), Failure> {
        if self.interrupted.is_some() || self.frame.scheduler().is_none() {
            return Err(Failure::new(exit, anyhow!("interrupted; there is no picture")));
        }
        tracing::warn!("interrupted: delivering what is finished");
        self.interrupted = Some(exit);
        self.frame.interrupt();
        Ok(())
    }

    fn local_worker_ended(&mut self, how: &str) -> Result<(), Failure> {
        self.local.worker = None;
        if self.frame.is_closed() {
            return Ok(());
        }
        tracing::warn!(how, "the local worker died");
        if self.local.restarts < RESTARTS_MAX {
            self.local.restarts += 1;
            return self.local.start(&self.setting.job, &mut self.share);
        }
        if self.setting.job.deadline.is_none() && self.frame.roster().slots() == 0 {
            let error = anyhow!(
                "the local worker died {} times; see its last words above",
                RESTARTS_MAX + 1
            );
            return Err(Failure::new(Exit::Incomplete, error));
        }
        Ok(())
    }

    /// Starts the finish phase on threads of its own.
    fn finish(
        &mut self,
        staged: StagedPicture,
    ) -> Result<oneshot::Receiver<Result<Finished, Failure>>, Failure> {
        let unforeseen = || Failure::new(Exit::Unforeseen, anyhow!("the frame was finished twice"));
        let buffers = self.frame.take_buffers().ok_or_else(unforeseen)?;
        let aovs = self.prepared.aovs.clone().ok_or_else(unforeseen)?;
        let method = self.method();
        let now = self.setting.clock.now();
        self.ledger = self
            .frame
            .ledger()
            .map(|ledger| reporting::of_ledger(ledger, now));
        let job = &self.setting.job;
        let material = Material {
            buffers,
            aovs,
            method,
            min_set_percent: job.min_set_percent,
        };
        let mut report = reporting::of_frame(job, &self.frame, &self.prepared);
        report.interrupted = self.interrupted.is_some();
        report.ledger = self.ledger;
        report.settings.reconstruction_used = reporting::reconstruction_name(material.method);
        let (clock, exposure_stops) = (self.setting.clock, job.exposure_stops);
        let (sender, receiver) = oneshot::channel();
        self.finishers.spawn(move || {
            let finished = finish::finish(
                material,
                staged,
                exposure_stops,
                clock,
                |coverage, reconstruct| {
                    report.seconds.reconstruct = reconstruct.as_secs_f64();
                    reporting::add_coverage(&mut report, coverage);
                    report.metadata()
                },
            );
            let _ = sender.send(finished);
        });
        Ok(receiver)
    }

    /// What there is time for.
    fn method(&mut self) -> Reconstruction {
        let now = self.setting.clock.now();
        let wanted = self.setting.job.reconstruction;
        let Some(ledger) = self.frame.ledger() else {
            return wanted;
        };
        let (mut method, mut part) = (wanted, 1.0);
        while method != Reconstruction::None && !ledger.affords(now, part) {
            (method, part) = (method.cheaper(), part / 2.0);
        }
        if method != wanted {
            let method = reporting::reconstruction_name(method);
            tracing::warn!(
                method,
                "there is no time left for the reconstruction that was asked for"
            );
        }
        method
    }

    /// Goes on listening while the picture is made: late results are counted, goodbyes are read.
    async fn wait_for(
        &mut self,
        mut finished: oneshot::Receiver<Result<Finished, Failure>>,
    ) -> Result<Finished, Failure> {
        loop {
            tokio::select! {
                biased;
                finished = &mut finished => {
                    return finished.or_exit(Exit::Unforeseen)?;
                }
                exit = self.signals.next() => self.interrupted = Some(exit),
                Some(arrival) = self.arrivals.recv() => self.frame.arrived(arrival),
            }
        }
    }

    /// Puts the files in their places. What is said of it comes after; nothing else is waited for.
    fn deliver(&mut self, finished: Finished) -> Result<Delivered, Failure> {
        let clock = self.setting.clock;
        let begun = clock.now();
        finished.staged.publish().or_exit(Exit::Output)?;
        let now = clock.now();

        let mut report = reporting::of_frame(&self.setting.job, &self.frame, &self.prepared);
        reporting::add_coverage(&mut report, &finished.coverage);
        report.seconds.reconstruct = finished.reconstruct.as_secs_f64();
        report.seconds.encode = finished.encode.as_secs_f64();
        report.seconds.write = begun.until(now).as_secs_f64();
        report.interrupted = self.interrupted.is_some();
        report.ledger = self.ledger;
        reporting::add_time(&mut report, now);
        let late = self.setting.job.deadline.is_some_and(|deadline| now > deadline);
        let exit = match self.interrupted {
            Some(exit) => exit,
            None if late => Exit::DeadlineMissed,
            None => Exit::Delivered,
        };
        Ok(Delivered { exit, report })
    }
}

impl Local {
    fn start(&mut self, job: &Job, share: &mut CpuShare) -> Result<(), Failure> {
        if job.local_slots == 0 {
            return Ok(());
        }
        let worker = self.start.start().map_err(|error| {
            let error = anyhow::Error::new(error).context("cannot start the local worker");
            Failure::new(Exit::Unforeseen, error)
        })?;
        if let Some(process) = worker.process() {
            share.watch(process);
        }
        self.worker = Some(worker);
        Ok(())
    }

    /// Waits for the end of the worker; for ever if there is none.
    async fn ended(&mut self) -> String {
        match &mut self.worker {
            Some(worker) => worker.ended().await,
            None => std::future::pending().await,
        }
    }
}

impl Signals {
    fn listen() -> Result<Self, Failure> {
        Ok(Self {
            interrupt: signal(SignalKind::interrupt()).or_exit(Exit::Unforeseen)?,
            terminate: signal(SignalKind::terminate()).or_exit(Exit::Unforeseen)?,
        })
    }

    async fn next(&mut self) -> Exit {
        tokio::select! {
            _ = self.interrupt.recv() => Exit::Interrupted,
            _ = self.terminate.recv() => Exit::Terminated,
        }
    }
}
