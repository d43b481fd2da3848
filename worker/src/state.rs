//! Decides what a worker does on one connection. Knows no sockets, threads or clock.
//!
//! Time is a [`Duration`] since the worker's start. The shell turns whatever happens into an
//! [`Event`], carries out the [`Action`]s and comes back when [`State::poll_timeout`] says so.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use protocol::limits::{HANDSHAKE_WITHIN, LEASES_PER_SLOT, MASTER_SILENCE};
use protocol::message::{
    Assign, Failed, FailedStep, Frame, Hello, Leaving, Message as _, Pong, Prepared, Request, SceneChunk,
    SceneRef, TaskResult, Want, text,
};
use protocol::{Digest, FrameId, Task, ToMaster, ToWorker};

use crate::renderer::Output;

/// Work that a slot has waiting for it, so that it need not wait for the network: at least one task,
/// more if tasks are shorter than this. Covers a round trip between two busy processes.
const AHEAD: Duration = Duration::from_millis(5);

/// Chunks of a scene that were asked for and not yet taken: one on its way while another is unpacked.
const CHUNKS_AT_ONCE: usize = 2;

/// How long the slots of a worker that leaves may take to stop; they look at the clock every 12 ms or so.
const STOPPING_WITHIN: Duration = Duration::from_millis(60);

/// How long a slot that is to rest may go on with its task. No other worker will ever do the rest of it,
/// so a task that is almost done is better finished. Not longer, for it is a part of the tenth of a second
/// in which whoever comes back to this machine has it for himself: 20 ms until he is seen
/// ([`GLANCE_EVERY`](crate::manners::GLANCE_EVERY)), these, and what a chunk that was begun just before still takes.
const FINISHING_WITHIN: Duration = Duration::from_millis(20);

/// How long a worker whose slots all rest stays with its master. A program that needs all cores for a
/// moment must not cost the frame; but tasks that wait here are of no use to anybody.
const RESTING_WITHIN: Duration = Duration::from_secs(1);

/// Memory that a scene may need for each of its bytes: as it comes, decoded, and its BVH.
const MEMORY_PER_SCENE_BYTE: u64 = 10;

/// What happened.
#[derive(Debug)]
pub enum Event {
    /// The master said something.
    Received(ToWorker),
    /// The scene asked for last is not in memory, and these chunks of it not on disk.
    SceneMissing(Vec<u32>),
    /// A chunk of this scene is in its place.
    ChunkTaken(Digest),
    /// A chunk of this scene is not what it should be.
    ChunkRefused(Digest, String),
    /// The scene asked for last is in memory.
    SceneReady(Prepared),
    /// The scene asked for last cannot be used.
    SceneFailed(String),
    /// The frame asked for last can be rendered.
    FrameReady(FrameId),
    /// The frame asked for last cannot be rendered.
    FrameFailed(FrameId, String),
    /// A slot is done with a task.
    TaskDone(FrameId, Task, Outcome),
    /// So many slots may work from now on.
    Slots(u32),
    /// The worker has to go.
    Leave(String),
    /// The time of [`State::poll_timeout`] has come.
    Tick,
}

/// What became of a task.
#[derive(Debug)]
pub enum Outcome {
    /// It was rendered, to its end or until it was stopped.
    Rendered {
        /// What there is of it.
        output: Output,
        /// The time it took.
        busy: Duration,
    },
    /// Its time was up before it began.
    NotStarted,
    /// The renderer broke.
    Broke(String),
}

/// What to do.
#[derive(Debug, PartialEq)]
pub enum Action {
    /// Say this to the master.
    Send(ToMaster),
    /// Look what there is of the scene, then report [`Event::SceneReady`], [`Event::SceneMissing`] or
    /// [`Event::SceneFailed`].
    FindScene(SceneRef),
    /// Verify a chunk and keep it, then report [`Event::ChunkTaken`] or [`Event::ChunkRefused`].
    TakeChunk(SceneChunk),
    /// Make the scene that was looked for last, of all its chunks, then report [`Event::SceneReady`] or
    /// [`Event::SceneFailed`].
    BuildScene,
    /// Set up the frame, then report [`Event::FrameReady`] or [`Event::FrameFailed`].
    SetUp(Frame),
    /// Let the slots do these, in this order, each to be reported as [`Event::TaskDone`].
    Start(FrameId, Vec<Task>),
    /// Stop the frame's tasks at this time; `None`: let them finish.
    StopAt(FrameId, Option<Duration>),
    /// Let the first so many slots work. The others stop at this time if they are at a task, and begin
    /// no other.
    Awake(u32, Duration),
    /// Stop the frame's tasks now and forget the frame.
    End(FrameId),
    /// Send what is still to be sent, then close. Nothing comes after this.
    Close(Ending),
}

/// Why a connection ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// This worker had to go, or its slots had to rest.
    Left,
    /// The master has no more work.
    Shutdown,
    /// The master does not want this worker.
    Refused(String),
    /// Nothing was heard of the master for too long.
    Silent(Duration),
    /// The master said what it may not say here.
    Violation(String),
}

/// What a worker knows on one connection.
#[derive(Debug)]
pub struct State {
    /// Slots that may work.
    awake: u32,
    /// When to leave, because no slot may work.
    rest_until: Option<Duration>,
    joined: bool,
    heard_at: Duration,
    /// Bytes that a scene may need.
    memory_max: u64,
    /// How long the master may say nothing; `None`: as long as it likes.
    silence: Option<Duration>,
    scene: Scene,
    /// What is to come of the scene, while it comes.
    incoming: Option<Incoming>,
    /// What the loading thread is at; it does one thing at a time.
    loading: Option<Load>,
    /// What it shall do next. A later wish replaces an earlier one, so that no queue can grow.
    next_scene: Option<SceneRef>,
    next_frame: Option<Frame>,
    frame: Option<CurrentFrame>,
    /// Mean time of a task.
    pace: Option<Duration>,
    leaving: Option<Goodbye>,
    closed: bool,
    actions: VecDeque<Action>,
}

#[derive(Debug, PartialEq)]
enum Scene {
    Missing,
    Ready,
    Failed,
}

/// A scene on its way, chunk by chunk.
#[derive(Debug)]
struct Incoming {
    scene: Digest,
    /// Chunks to ask for.
    missing: VecDeque<u32>,
    /// Chunks asked for.
    asked: BTreeSet<u32>,
    /// How many have come and are being unpacked.
    unpacking: usize,
}

#[derive(Clone, Debug, PartialEq)]
enum Load {
    Scene(Digest),
    Frame(FrameId),
    /// A frame that ended meanwhile; it cannot be interrupted.
    EndedFrame,
}

#[derive(Debug)]
struct CurrentFrame {
    id: FrameId,
    /// Tasks with the slots.
    held: u32,
    /// Tasks asked for and not yet here.
    asked: u32,
    stop_at: Option<Duration>,
}

#[derive(Debug)]
struct Goodbye {
    reason: String,
    by: Duration,
}

impl State {
    /// A fresh connection: greets the master.
    pub fn new(now: Duration, hello: Hello) -> Self {
        let mut state = Self {
            awake: hello.slots,
            rest_until: None,
            joined: false,
            heard_at: now,
            memory_max: u64::MAX,
            silence: Some(MASTER_SILENCE),
            scene: Scene::Missing,
            incoming: None,
            loading: None,
            next_scene: None,
            next_frame: None,
            frame: None,
            pace: None,
            leaving: None,
            closed: false,
            actions: VecDeque::new(),
        };
        state.send(ToMaster::Hello(hello));
        state
    }

    /// Trusts a silent master: one on the same machine whose end closes the connection.
    #[must_use]
    pub fn patient(mut self) -> Self {
        self.silence = None;
        self
    }

    /// Refuses scenes that may need more bytes of memory than this.
    #[must_use]
    pub fn with_memory_max(mut self, bytes: u64) -> Self {
        self.memory_max = bytes;
        self
    }

    /// Takes one event.
    pub fn handle(&mut self, now: Duration, event: Event) {
        match event {
            Event::Received(message) => self.received(now, message),
            Event::SceneMissing(chunks) => self.scene_missing(chunks),
            Event::ChunkTaken(scene) => self.chunk_taken(scene),
            Event::ChunkRefused(scene, message) => self.chunk_refused(scene, &message),
            Event::SceneReady(prepared) => self.scene_ready(prepared),
            Event::SceneFailed(message) => self.scene_failed(message),
            Event::FrameReady(frame) => self.frame_ready(now, frame),
            Event::FrameFailed(frame, message) => self.frame_failed(frame, message),
            Event::TaskDone(frame, task, outcome) => self.task_done(now, frame, task, outcome),
            Event::Slots(slots) => self.set_slots(now, slots),
            Event::Leave(reason) => self.leave(now, reason),
            Event::Tick => self.tick(now),
        }
        self.say_goodbye(now);
    }

    /// The next thing to do; call until `None` after every [`Self::handle`].
    pub fn poll_action(&mut self) -> Option<Action> {
        self.actions.pop_front()
    }

    /// When to come back with [`Event::Tick`] if nothing else happens.
    pub fn poll_timeout(&self) -> Option<Duration> {
        if let Some(goodbye) = &self.leaving {
            return Some(goodbye.by);
        }
        let silent_at = self.patience().map(|patience| self.heard_at + patience);
        [silent_at, self.rest_until].into_iter().flatten().min()
    }

    /// Whether the master has welcomed this worker.
    pub fn has_joined(&self) -> bool {
        self.joined
    }

    fn patience(&self) -> Option<Duration> {
        if self.joined {
            self.silence
        } else {
            Some(HANDSHAKE_WITHIN)
        }
    }

    fn tick(&mut self, now: Duration) {
        if self.rest_until.is_some_and(|end| now >= end) {
            self.leave(now, "its machine is needed by others".to_owned());
        }
        match self.patience() {
            Some(patience) if self.leaving.is_none() && now >= self.heard_at + patience => {
                self.close(Ending::Silent(patience));
            }
            _ => {}
        }
    }

    fn received(&mut self, now: Duration, message: ToWorker) {
        self.heard_at = now;
        match message {
            ToWorker::Refused(refused) => self.close(Ending::Refused(refused.reason)),
            ToWorker::Welcome(_) if !self.joined => self.joined = true,
            message if !self.joined => {
                self.close(Ending::Violation(format!(
                    "`{}` came before `welcome`",
                    message.name()
                )));
            }
            // A frame's end is always of interest; of new work there is none for one who leaves.
            ToWorker::CutOff(cut_off) => self.stop_at(cut_off.frame, Some(now)),
            ToWorker::EndFrame(end) => self.end_frame(end.frame),
            ToWorker::Ping(ping) => self.send(ToMaster::Pong(Pong { nonce: ping.nonce })),
            ToWorker::Shutdown(_) => self.close(Ending::Shutdown),
            _ if self.leaving.is_some() => {}
            ToWorker::Prepare(prepare) => self.prepare(prepare.scene),
            ToWorker::SceneChunk(chunk) => self.scene_chunk(chunk),
            ToWorker::Frame(frame) => self.new_frame(frame),
            ToWorker::Assign(assign) => self.assign(now, assign),
            other => self.close(Ending::Violation(format!(
                "`{}` was not expected here",
                other.name()
            ))),
        }
    }

    fn prepare(&mut self, scene: SceneRef) {
        self.end_current_frame();
        self.next_frame = None;
        self.incoming = None;
        let needed = scene.bytes.saturating_mul(MEMORY_PER_SCENE_BYTE);
        if needed > self.memory_max {
            self.scene = Scene::Failed;
            let gigabytes = |bytes: u64| bytes as f64 / 1e9;
            let message = format!(
                "the scene may need {:.1} GB, of which this worker may use {:.1} GB: see `memory` in its worker.toml",
                gigabytes(needed),
                gigabytes(self.memory_max)
            );
            return self.send_failed(FailedStep::Scene, None, None, message);
        }
        self.next_scene = Some(scene);
        self.load_next();
    }

    fn new_frame(&mut self, frame: Frame) {
        self.end_current_frame();
        self.next_frame = Some(frame);
        self.load_next();
    }

    /// Gives the loading thread its next work, if it is free and there is some.
    fn load_next(&mut self) {
        if self.loading.is_some() || self.incoming.is_some() {
            return;
        }
        if let Some(scene) = self.next_scene.take() {
            self.scene = Scene::Missing;
            self.loading = Some(Load::Scene(scene.digest));
            self.act(Action::FindScene(scene));
        } else if let Some(frame) = self.next_frame.take() {
            if self.scene == Scene::Ready {
                self.loading = Some(Load::Frame(frame.frame));
                self.act(Action::SetUp(frame));
            } else {
                let why = if self.scene == Scene::Failed {
                    "its scene failed"
                } else {
                    "no scene was named"
                };
                self.send_failed(FailedStep::Frame, Some(frame.frame), None, why.to_owned());
            }
        }
    }

    fn scene_missing(&mut self, chunks: Vec<u32>) {
        let loading = self.loading.take();
        match loading {
            Some(Load::Scene(scene)) if self.next_scene.is_none() => {
                self.incoming = Some(Incoming {
                    scene,
                    missing: chunks.into(),
                    asked: BTreeSet::new(),
                    unpacking: 0,
                });
                self.fetch();
            }
            _ => self.load_next(),
        }
    }

    /// Asks for as many chunks as may be on their way; builds the scene when all have come.
    fn fetch(&mut self) {
        let Some(incoming) = &mut self.incoming else {
            return;
        };
        let digest = incoming.scene;
        let mut wants = Vec::new();
        while incoming.asked.len() + incoming.unpacking < CHUNKS_AT_ONCE
            && let Some(chunk) = incoming.missing.pop_front()
        {
            incoming.asked.insert(chunk);
            wants.push(Want { digest, chunk });
        }
        if incoming.asked.is_empty() && incoming.unpacking == 0 {
            self.incoming = None;
            self.loading = Some(Load::Scene(digest));
            self.act(Action::BuildScene);
        }
        for want in wants {
            self.send(ToMaster::Want(want));
        }
    }

    fn scene_chunk(&mut self, chunk: SceneChunk) {
        // Of a scene that is wanted no more.
        let Some(incoming) = self.incoming(chunk.digest) else {
            return;
        };
        if !incoming.asked.remove(&chunk.chunk) {
            let text = format!("chunk {} of the scene was not asked for", chunk.chunk);
            return self.close(Ending::Violation(text));
        }
        incoming.unpacking += 1;
        self.act(Action::TakeChunk(chunk));
    }

    fn chunk_taken(&mut self, scene: Digest) {
        if let Some(incoming) = self.incoming(scene) {
            incoming.unpacking -= 1;
            self.fetch();
        }
    }

    fn chunk_refused(&mut self, scene: Digest, message: &str) {
        if self.incoming(scene).is_some() {
            self.close(Ending::Violation(message.to_owned()));
        }
    }

    fn incoming(&mut self, scene: Digest) -> Option<&mut Incoming> {
        self.incoming.as_mut().filter(|incoming| incoming.scene == scene)
    }

    fn scene_ready(&mut self, prepared: Prepared) {
        self.loading = None;
        // Of a scene that is to be replaced at once the master need not hear.
        if self.next_scene.is_none() {
            self.scene = Scene::Ready;
            self.send(ToMaster::Prepared(prepared));
        }
        self.load_next();
    }

    fn scene_failed(&mut self, message: String) {
        self.loading = None;
        if self.next_scene.is_none() {
            self.scene = Scene::Failed;
            self.send_failed(FailedStep::Scene, None, None, message);
        }
        self.load_next();
    }

    fn frame_ready(&mut self, now: Duration, id: FrameId) {
        let wanted = self.loading.take() == Some(Load::Frame(id))
            && self.next_scene.is_none()
            && self.next_frame.is_none();
        if wanted {
            self.frame = Some(CurrentFrame {
                id,
                held: 0,
                asked: 0,
                stop_at: None,
            });
            self.request(now);
        }
        self.load_next();
    }

    fn frame_failed(&mut self, id: FrameId, message: String) {
        if self.loading.take() == Some(Load::Frame(id)) {
            self.send_failed(FailedStep::Frame, Some(id), None, message);
        }
        self.load_next();
    }

    fn assign(&mut self, now: Duration, assign: Assign) {
        let Some(frame) = self.frame.as_mut().filter(|frame| frame.id == assign.frame) else {
            return;
        };
        let count = assign.tasks.len() as u32;
        let Some(asked) = frame.asked.checked_sub(count) else {
            let text = format!("{count} tasks were assigned, only {} were asked for", frame.asked);
            return self.close(Ending::Violation(text));
        };
        frame.asked = asked;
        frame.held += count;
        let stop_at = assign
            .send_within_us
            .map(|us| now.saturating_add(Duration::from_micros(us)));
        self.stop_at(assign.frame, stop_at);
        if count > 0 {
            self.act(Action::Start(assign.frame, assign.tasks));
        }
    }

    fn stop_at(&mut self, id: FrameId, stop_at: Option<Duration>) {
        let Some(frame) = self.frame.as_mut().filter(|frame| frame.id == id) else {
            return;
        };
        if frame.stop_at != stop_at {
            frame.stop_at = stop_at;
            self.act(Action::StopAt(id, stop_at));
        }
    }

    fn end_frame(&mut self, id: FrameId) {
        if self.next_frame.as_ref().is_some_and(|frame| frame.frame == id) {
            self.next_frame = None;
        }
        if self.loading == Some(Load::Frame(id)) {
            self.loading = Some(Load::EndedFrame);
        }
        if self.frame.as_ref().is_some_and(|frame| frame.id == id) {
            self.end_current_frame();
        }
    }

    fn end_current_frame(&mut self) {
        if let Some(frame) = self.frame.take() {
            self.act(Action::End(frame.id));
        }
    }

    fn task_done(&mut self, now: Duration, id: FrameId, task: Task, outcome: Outcome) {
        let Some(frame) = self.frame.as_mut().filter(|frame| frame.id == id) else {
            return;
        };
        // A master that uses a frame's number twice could bring this about.
        let Some(held) = frame.held.checked_sub(1) else {
            return;
        };
        frame.held = held;
        match outcome {
            Outcome::Rendered { output, busy } => {
                self.note_pace(busy);
                self.send(ToMaster::Result(TaskResult {
                    frame: id,
                    task,
                    pixels: output.pixels,
                    radiance: output.radiance,
                    primary_rays: output.primary_rays,
                    shadow_rays: output.shadow_rays,
                    busy_us: busy.as_micros() as u64,
                }));
            }
            Outcome::NotStarted => {}
            Outcome::Broke(message) => self.send_failed(FailedStep::Task, Some(id), Some(task), message),
        }
        self.request(now);
    }

    /// Asks for as many tasks as keep every slot busy, once half of those in advance are used up.
    fn request(&mut self, now: Duration) {
        let ahead = self.awake * self.tasks_ahead();
        let (wanted, least) = (self.awake + ahead, (ahead / 2).max(1));
        let Some(frame) = self.frame.as_mut() else { return };
        let stopped = frame.stop_at.is_some_and(|stop_at| now >= stop_at);
        let tasks = wanted.saturating_sub(frame.held + frame.asked);
        if stopped || self.leaving.is_some() || tasks < least {
            return;
        }
        frame.asked += tasks;
        let frame = frame.id;
        self.send(ToMaster::Request(Request { frame, tasks }));
    }

    /// Tasks that wait for each slot.
    fn tasks_ahead(&self) -> u32 {
        let Some(pace) = self.pace else { return 1 };
        let tasks = AHEAD.as_micros().div_ceil(pace.as_micros().max(1));
        tasks.clamp(1, u128::from(LEASES_PER_SLOT) - 1) as u32
    }

    fn note_pace(&mut self, busy: Duration) {
        self.pace = Some(self.pace.map_or(busy, |pace| (pace * 7 + busy) / 8));
    }

    fn set_slots(&mut self, now: Duration, slots: u32) {
        self.awake = slots;
        self.rest_until = match slots {
            0 => self.rest_until.or(Some(now + RESTING_WITHIN)),
            _ => None,
        };
        self.act(Action::Awake(slots, now + FINISHING_WITHIN));
        self.request(now);
    }

    fn leave(&mut self, now: Duration, reason: String) {
        if self.leaving.is_some() {
            return;
        }
        self.leaving = Some(Goodbye {
            reason,
            by: now + STOPPING_WITHIN,
        });
        if let Some(id) = self.frame.as_ref().map(|frame| frame.id) {
            self.stop_at(id, Some(now));
        }
    }

    /// Leaves when all slots have stopped, or when they take too long.
    fn say_goodbye(&mut self, now: Duration) {
        let Some(goodbye) = &self.leaving else { return };
        let stopped = self.frame.as_ref().is_none_or(|frame| frame.held == 0);
        if stopped || now >= goodbye.by {
            let reason = text(goodbye.reason.as_str());
            if self.joined {
                self.send(ToMaster::Leaving(Leaving { reason }));
            }
            self.close(Ending::Left);
        }
    }

    fn send_failed(&mut self, what: FailedStep, frame: Option<FrameId>, task: Option<Task>, message: String) {
        let message = text(message);
        self.send(ToMaster::Failed(Failed {
            what,
            frame,
            task,
            message,
        }));
    }

    fn send(&mut self, message: ToMaster) {
        self.act(Action::Send(message));
    }

    fn close(&mut self, ending: Ending) {
        self.act(Action::Close(ending));
        self.closed = true;
    }

    fn act(&mut self, action: Action) {
        if !self.closed {
            self.actions.push_back(action);
        }
    }
}

#[cfg(test)]
mod tests;
