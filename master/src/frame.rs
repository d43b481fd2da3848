//! A frame while it is traced: turns what happens into events, and does what the scheduler decides.

use std::{collections::VecDeque, num::NonZeroUsize, sync::Arc, time::Duration};

use protocol::{
    Digest, FrameId, ToMaster, ToWorker, WorkerId,
    envelope::{EncodeError, Sealed},
    limits,
    message::{Assign, EndFrame, Prepare, Shutdown, TaskResult, Want},
    radiance::Encoding,
};
use render::{
    buffer::FrameBuffers,
    pixel_group::PixelGroups,
    settings::Settings,
    task::{RayCounts, Task},
};

use crate::{
    clock::Clock,
    connection::{Arrival, Joined},
    deadline::Ledger,
    frame_time::FrameTime,
    job::Job,
    plan::{Noise, TaskQueues},
    prepare::Traceable,
    roster::Roster,
    scene_bytes::SceneBytes,
    scheduler::{Action, Event, Extent, Promise, Scheduler},
    wire,
};

/// One process renders one frame.
const FRAME: FrameId = FrameId(1);
/// After a signal workers have this long to send what they have, besides their Δt.
const INTERRUPT_WITHIN: Duration = Duration::from_millis(20);

/// A frame, from the first worker to the last result.
#[derive(Debug)]
pub struct Frame {
    clock: Clock,
    delta_t: Option<Duration>,
    encodings: ByPlace<Encoding>,
    /// What workers need of the scene, when it is in memory.
    scene: Option<SceneBytes>,
    promise: Promise,
    ledger: Option<Ledger>,
    roster: Roster,
    tracing: Option<Tracing>,
    interrupted: bool,
    /// Events that came up while actions were carried out.
    deferred: VecDeque<Event>,
}

/// One for the worker on this machine and one for all others.
#[derive(Debug, Clone)]
struct ByPlace<T> {
    local: T,
    remote: T,
}

impl<T> ByPlace<T> {
    fn of(&self, is_local: bool) -> &T {
        if is_local { &self.local } else { &self.remote }
    }
}

/// What there is once rays can be traced.
#[derive(Debug)]
struct Tracing {
    scheduler: Scheduler,
    buffers: Option<FrameBuffers>,
    groups: Arc<PixelGroups>,
    begin: ByPlace<Sealed>,
    rays: RayCounts,
    busy: Duration,
    first_task: Option<FrameTime>,
    last_result: Option<FrameTime>,
}

impl Frame {
    /// Nobody is here, nothing is ready.
    pub fn new(job: &Job, clock: Clock) -> Self {
        Self {
            clock,
            delta_t: job.delta_t,
            encodings: ByPlace {
                local: job.encoding(true),
                remote: job.encoding(false),
            },
            scene: None,
            promise: match job.deadline {
                Some(_) => Promise::Deadline,
                None => Promise::FullWorkload,
            },
            ledger: job.deadline.map(|deadline| {
                let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
                Ledger::new(deadline, job.size_expected().pixel_count(), cores)
            }),
            roster: Roster::default(),
            tracing: None,
            interrupted: false,
            deferred: VecDeque::new(),
        }
    }

    /// Something came from the network.
    pub fn arrived(&mut self, arrival: Arrival) {
        match arrival {
            Arrival::Joined(joined) => self.joined(joined),
            Arrival::Said { worker, message } => self.said(worker, message),
            Arrival::Left { worker, fault } => {
                let why = fault.unwrap_or_else(|| "it closed the connection".to_owned());
                self.left(worker, &why);
            }
        }
        self.settle();
    }

    /// The scene is in memory: workers can have it.
    pub fn scene_loaded(&mut self, scene: SceneBytes) {
        self.scene = Some(scene);
        for worker in self.roster.ids() {
            self.prepare(worker);
        }
        self.settle();
    }

    /// Rays can be traced: tasks can be handed out.
    pub fn traceable(&mut self, settings: &Settings, traceable: &Traceable) -> Result<(), EncodeError> {
        let queues = TaskQueues::new(settings);
        let begin = |encoding| {
            let frame = wire::frame_to_wire(FRAME, settings, &traceable.vpl_sets, encoding);
            Sealed::new(&ToWorker::Frame(frame))
        };
        let begin = ByPlace {
            local: begin(self.encodings.local)?,
            remote: begin(self.encodings.remote)?,
        };
        self.tracing = Some(Tracing {
            scheduler: Scheduler::new(queues, self.promise, limits::LEASES_PER_SLOT),
            buffers: Some(FrameBuffers::new(settings, Arc::clone(&traceable.groups))),
            groups: Arc::clone(&traceable.groups),
            begin,
            rays: RayCounts::default(),
            busy: Duration::ZERO,
            first_task: None,
            last_result: None,
        });
        self.move_cut_off();
        for worker in self.roster.ids() {
            self.begin(worker);
            self.check_ready(worker);
        }
        self.settle();
        Ok(())
    }

    /// A new prediction of the finish phase is there, or time has passed.
    pub fn move_cut_off(&mut self) {
        let (Some(ledger), true) = (&self.ledger, self.tracing.is_some()) else {
            return;
        };
        if !self.interrupted {
            let at = ledger.cut_off();
            self.handle(Event::CutOff { at }, None);
        }
    }

    /// The timer of [`Self::timeout`] has fired.
    pub fn tick(&mut self) {
        self.handle(Event::Tick, None);
    }

    /// A sign of life to everyone, and what was learnt by the last ones.
    pub fn ping(&mut self) {
        for (worker, delta_t) in self.roster.delta_ts() {
            self.delta_t(worker, delta_t);
        }
        for (worker, time) in self.roster.times_on_the_wire() {
            self.handle(Event::OnTheWire { worker, time }, None);
        }
        let now = self.clock.now();
        encoded(self.roster.ping_all(now));
    }

    /// Looks how noisy what has come so far is, which decides what is traced next.
    pub fn estimate_noise(&mut self) {
        let buffers = self.tracing.as_ref().and_then(|tracing| tracing.buffers.as_ref());
        if let Some(buffers) = buffers {
            let [direct, indirect] = buffers.relative_variances();
            self.handle(Event::Noise(Noise { direct, indirect }), None);
        }
    }

    /// A signal ends the tracing: what workers have done so far is collected.
    pub fn interrupt(&mut self) {
        self.interrupted = true;
        let longest = self.roster.delta_t_longest() + INTERRUPT_WITHIN;
        let at = self.clock.now() + longest;
        self.handle(Event::CutOff { at }, None);
    }

    /// When to call [`Self::tick`].
    pub fn timeout(&self) -> Option<FrameTime> {
        match &self.tracing {
            Some(tracing) => tracing.scheduler.poll_timeout(),
            None => None,
        }
    }

    /// Whether tasks have been handed out.
    pub fn has_begun(&self) -> bool {
        self.tracing
            .as_ref()
            .is_some_and(|tracing| tracing.first_task.is_some())
    }

    /// Whether the tracing is over.
    pub fn is_closed(&self) -> bool {
        self.tracing
            .as_ref()
            .is_some_and(|tracing| tracing.scheduler.is_closed())
    }

    /// The prediction of the finish phase.
    pub fn ledger(&mut self) -> Option<&mut Ledger> {
        self.ledger.as_mut()
    }

    /// Everyone.
    pub fn roster(&self) -> &Roster {
        &self.roster
    }

    /// What the scheduler has counted.
    pub fn scheduler(&self) -> Option<&Scheduler> {
        self.tracing.as_ref().map(|tracing| &tracing.scheduler)
    }

    /// Rays of all results that counted.
    pub fn rays(&self) -> RayCounts {
        self.tracing
            .as_ref()
            .map_or(RayCounts::default(), |tracing| tracing.rays)
    }

    /// Time that slots spent on results that counted, and from the first task to the last result.
    pub fn times(&self) -> (Duration, Duration) {
        let Some(tracing) = &self.tracing else {
            return (Duration::ZERO, Duration::ZERO);
        };
        let wall = match (tracing.first_task, tracing.last_result) {
            (Some(first), Some(last)) => first.until(last),
            _ => Duration::ZERO,
        };
        (tracing.busy, wall)
    }

    /// All light; to be taken once, when the frame is closed.
    pub fn take_buffers(&mut self) -> Option<FrameBuffers> {
        self.tracing.as_mut()?.buffers.take()
    }

    /// Tells everyone that there is nothing more to do.
    pub fn dismiss(&mut self) {
        encoded(
            self.roster
                .send_all(&ToWorker::EndFrame(EndFrame { frame: FRAME })),
        );
        encoded(self.roster.send_all(&ToWorker::Shutdown(Shutdown {})));
    }

    fn joined(&mut self, joined: Joined) {
        tracing::info!(name = joined.hello.name, address = %joined.address, slots = joined.hello.slots, "a worker joined");
        let now = self.clock.now();
        let worker = self.roster.join(joined, now);
        encoded(self.roster.ping(worker, now));
        self.prepare(worker);
        self.begin(worker);
    }

    /// Tells a worker of the frame, if it has begun.
    fn begin(&mut self, worker: WorkerId) {
        let is_local = self.roster.get(worker).is_some_and(|member| member.is_local);
        let begin = self
            .tracing
            .as_ref()
            .map(|tracing| tracing.begin.of(is_local).clone());
        if let Some(begin) = begin {
            self.send_sealed(worker, begin);
        }
    }

    fn said(&mut self, worker: WorkerId, message: ToMaster) {
        match message {
            ToMaster::Want(want) => self.send_chunk(worker, want),
            ToMaster::Prepared(prepared) => self.prepared(worker, prepared.digest),
            ToMaster::Request(request) if request.frame == FRAME => {
                let count = request.tasks;
                self.handle(Event::Request { worker, count }, None);
            }
            ToMaster::Result(result) if result.frame == FRAME => self.result(worker, &result),
            ToMaster::Failed(failed) => {
                tracing::warn!(%worker, what = ?failed.what, reason = failed.message, "a worker failed");
                if let Some(task) = failed.task {
                    let task = wire::task_from_wire(task);
                    let failed = Event::Completed {
                        worker,
                        task,
                        extent: Extent::Nothing,
                        busy: Duration::ZERO,
                    };
                    self.handle(failed, None);
                }
            }
            ToMaster::Pong(pong) => {
                self.roster.pong(worker, pong.nonce, self.clock.now());
            }
            ToMaster::Leaving(leaving) => {
                tracing::info!(%worker, reason = leaving.reason, "a worker leaves");
            }
            // Of another frame, and so too late to matter.
            ToMaster::Request(_) | ToMaster::Result(_) => {}
            other => {
                let name = protocol::message::Message::name(&other);
                self.send_away(worker, &format!("it sent a `{name}` in mid-frame"));
            }
        }
    }

    fn left(&mut self, worker: WorkerId, why: &str) {
        let Some(member) = self.roster.leave(worker, why) else {
            return;
        };
        if !self.is_closed() {
            tracing::warn!(name = member.name, why, "a worker is gone");
        }
        self.handle(Event::WorkerLeft { worker }, None);
    }

    /// Closes the connection of a worker that broke the rules.
    fn send_away(&mut self, worker: WorkerId, why: &str) {
        if let Some(member) = self.roster.leave(worker, why) {
            tracing::warn!(name = member.name, why, "a worker was sent away");
        }
        self.deferred.push_back(Event::WorkerLeft { worker });
    }

    /// Tells a worker which scene there is.
    fn prepare(&mut self, worker: WorkerId) {
        if let Some(scene) = &self.scene {
            let scene = scene.reference().clone();
            self.send(worker, &ToWorker::Prepare(Prepare { scene }));
        }
    }

    fn send_chunk(&mut self, worker: WorkerId, want: Want) {
        let is_local = self.roster.get(worker).is_some_and(|member| member.is_local);
        match self.scene.as_ref().map(|scene| scene.chunk(want, is_local)) {
            Some(Ok(Some(chunk))) => {
                if let Some(report) = self.roster.report(worker) {
                    report.scene_bytes += chunk.bytes().len() as u64;
                }
                self.send_sealed(worker, chunk);
            }
            Some(Err(error)) => self.send_away(worker, &error.to_string()),
            Some(Ok(None)) | None => self.send_away(worker, "it wants a scene that we do not have"),
        }
    }

    fn prepared(&mut self, worker: WorkerId, digest: Digest) {
        if self.scene.as_ref().is_none_or(|scene| scene.digest() != digest) {
            return self.send_away(worker, "it prepared another scene than ours");
        }
        if let Some(member) = self.roster.get(worker) {
            member.prepared = true;
        }
        self.check_ready(worker);
    }

    fn check_ready(&mut self, worker: WorkerId) {
        let has_begun = self.tracing.is_some();
        let Some(member) = self.roster.get(worker) else {
            return;
        };
        if has_begun && member.prepared && !member.ready {
            member.ready = true;
            let slots = member.slots;
            let nothing_yet = member.link.delta_t(Duration::ZERO);
            self.handle(Event::WorkerReady { worker, slots }, None);
            self.delta_t(worker, nothing_yet);
        }
    }

    fn delta_t(&mut self, worker: WorkerId, measured: Duration) {
        let delta_t = self.delta_t.unwrap_or(measured);
        if let Some(report) = self.roster.report(worker) {
            report.delta_t_s = delta_t.as_secs_f64();
        }
        self.handle(Event::DeltaT { worker, delta_t }, None);
    }

    /// A result, from wherever it came.
    fn result(&mut self, worker: WorkerId, result: &TaskResult) {
        let Some(tracing) = &self.tracing else {
            return self.send_away(worker, "it sent a result before the frame began");
        };
        let task = wire::task_from_wire(result.task);
        let Some(extent) = extent(&tracing.groups, task, result.pixels) else {
            return self.deferred.push_back(Event::Unusable { worker, task });
        };
        let completed = Event::Completed {
            worker,
            task,
            extent,
            busy: Duration::from_micros(result.busy_us),
        };
        self.handle(completed, Some(result));
        self.measure(worker, result);
    }

    /// Learns from a result how fast the worker is.
    fn measure(&mut self, worker: WorkerId, result: &TaskResult) {
        let Some(tracing) = &self.tracing else {
            return;
        };
        let chunks = result.pixels.div_ceil(tracing.groups.chunk_pixels() as u32);
        if let Some(member) = self.roster.get(worker) {
            let busy = Duration::from_micros(result.busy_us);
            member.link.result(result.radiance.bytes(), chunks, busy);
        }
    }

    /// Gives one event to the scheduler and does what it says. `result` is the one that the event is
    /// about.
    fn handle(&mut self, event: Event, result: Option<&TaskResult>) {
        let now = self.clock.now();
        if let Some(tracing) = &mut self.tracing {
            tracing.scheduler.handle(now, event);
        }
        while let Some(action) = self
            .tracing
            .as_mut()
            .and_then(|tracing| tracing.scheduler.poll_action())
        {
            self.act(action, result);
        }
        self.settle();
    }

    /// Handles what came up on the way.
    fn settle(&mut self) {
        while let Some(event) = self.deferred.pop_front() {
            self.handle(event, None);
        }
    }

    fn act(&mut self, action: Action, result: Option<&TaskResult>) {
        match action {
            Action::Assign { worker, tasks } => self.assign(worker, &tasks),
            Action::SendBy { worker, .. } => self.assign(worker, &[]),
            Action::Add { worker, task } => {
                if let Some(result) = result {
                    self.add(worker, task, result);
                }
            }
            Action::Disconnect { worker, fault } => self.send_away(worker, &fault.to_string()),
            Action::Close(closing) => {
                tracing::debug!(?closing, at = %self.clock.now(), "the tracing is over");
                encoded(
                    self.roster
                        .send_all(&ToWorker::EndFrame(EndFrame { frame: FRAME })),
                );
            }
        }
    }

    fn assign(&mut self, worker: WorkerId, tasks: &[Task]) {
        let now = self.clock.now();
        let Some(tracing) = &mut self.tracing else {
            return;
        };
        let send_by = tracing.scheduler.send_by(worker);
        let assign = Assign {
            frame: FRAME,
            tasks: tasks.iter().copied().map(wire::task_to_wire).collect(),
            send_within_us: send_by.map(|at| now.until(at).as_micros() as u64),
        };
        if !tasks.is_empty() {
            tracing.first_task.get_or_insert(now);
            if let Some(report) = self.roster.report(worker) {
                report.first_task_s.get_or_insert(now.elapsed().as_secs_f64());
            }
        }
        self.send(worker, &ToWorker::Assign(assign));
    }

    /// The one way by which light enters the picture.
    fn add(&mut self, worker: WorkerId, task: Task, result: &TaskResult) {
        let now = self.clock.now();
        let Some(tracing) = &mut self.tracing else {
            return;
        };
        let Some(buffers) = &mut tracing.buffers else {
            return;
        };
        if let Err(error) = buffers.add(task, &result.radiance.unpack()) {
            tracing::warn!(%worker, %error, "a result was refused");
            return self.deferred.push_back(Event::Unusable { worker, task });
        }
        let rays = RayCounts {
            primary: result.primary_rays,
            shadow: result.shadow_rays,
        };
        let busy = Duration::from_micros(result.busy_us);
        tracing.rays += rays;
        tracing.busy += busy;
        tracing.last_result = Some(now);
        if let Some(report) = self.roster.report(worker) {
            report.tasks += task.passes;
            report.rays = report
                .rays
                .saturating_add(rays.primary)
                .saturating_add(rays.shadow);
            report.busy_s += busy.as_secs_f64();
        }
    }

    fn send(&mut self, worker: WorkerId, message: &ToWorker) {
        match Sealed::new(message) {
            Ok(message) => self.send_sealed(worker, message),
            Err(error) => self.send_away(worker, &error.to_string()),
        }
    }

    fn send_sealed(&mut self, worker: WorkerId, message: Sealed) {
        if !self.roster.send(worker, message) {
            self.send_away(worker, "it does not read what it is sent");
        }
    }
}

/// Says aloud what only a mistake of this program brings about; the frame goes on.
fn encoded(sent: Result<(), EncodeError>) {
    if let Err(error) = sent {
        tracing::error!(%error, "a message to all workers was not sent");
    }
}

/// `None`: no beginning of the group, so no result of this task.
fn extent(groups: &PixelGroups, task: Task, pixels: u32) -> Option<Extent> {
    if task.group as usize >= groups.len() || !groups.is_prefix(task.group, pixels as usize) {
        return None;
    }
    Some(match pixels as usize {
        // Of a group without pixels, too, if there are more groups than pixels.
        pixels if pixels == groups.pixels(task.group).len() => Extent::Whole,
        0 => Extent::Nothing,
        _ => Extent::Prefix,
    })
}
