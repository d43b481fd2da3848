//! One connection: turns what happens into events and carries out what [`State`] decides.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use protocol::connection::{ReadError, Reader, Writer};
use protocol::message::Hello;
use protocol::{FrameId, Task, ToMaster, ToWorker, limits, version};
use tokio::sync::{mpsc, watch};
use tokio::time::{sleep, timeout};

use super::reach::Connection;
use crate::clock::Clock;
use crate::done::{Done, DoneReceiver, DoneSender};
use crate::executor::{Executor, Job, StopTime};
use crate::loader::Loader;
use crate::manners::Allowance;
use crate::options::{Lifetime, WorkerOptions};
use crate::renderer::Frame;
use crate::scene_cache::Found;
use crate::signals::Signals;
use crate::state::{Action, Ending, Event, State};
use crate::status::StatusBoard;

/// A master that does not read is not listened to while so much waits for it.
const QUEUED_BYTES: usize = 2 * limits::ENVELOPE_BYTES as usize;

/// How long the last results of a worker that leaves may take to the master.
const PARTING_WITHIN: Duration = Duration::from_millis(30);

/// How a connection ended.
#[derive(Debug)]
pub(super) enum End {
    /// The worker has to go.
    Signal(String),
    /// For a reason that the state knows.
    Decided(Ending),
    /// The master closed, or the network failed.
    Gone(String),
    /// What came is no message.
    Garbage(String),
    /// A message of our own is not within the limits.
    Unsendable(String),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Signal(text) | Self::Gone(text) | Self::Garbage(text) | Self::Unsendable(text) => {
                f.write_str(text)
            }
            Self::Decided(Ending::Shutdown) => f.write_str("it has no more work"),
            Self::Decided(ending) => write!(f, "{ending:?}"),
        }
    }
}

/// One connection.
pub(super) struct Session<'a> {
    clock: Clock,
    executor: &'a Executor,
    loader: &'a Loader,
    allowance: watch::Receiver<Allowance>,
    board: &'a StatusBoard,
    state: State,
    reader: Reader<ToWorker>,
    writer: Writer<ToMaster>,
    frame: Option<Current>,
    done: DoneSender,
    dones: DoneReceiver,
    signal: Option<String>,
}

/// The frame that the slots work on.
struct Current {
    id: FrameId,
    frame: Arc<dyn Frame>,
    stop: Arc<StopTime>,
}

impl<'a> Session<'a> {
    pub(super) fn new(
        options: &WorkerOptions,
        clock: Clock,
        executor: &'a Executor,
        loader: &'a Loader,
        mut allowance: watch::Receiver<Allowance>,
        board: &'a StatusBoard,
        (reader, writer): Connection,
    ) -> Self {
        let (done, dones) = mpsc::unbounded_channel();
        let state = State::new(clock.now(), hello(options)).with_memory_max(options.memory_max);
        let mut state = if options.lifetime == Lifetime::Service {
            state
        } else {
            state.patient()
        };
        state.handle(clock.now(), Event::Slots(allowance.borrow_and_update().slots));
        Self {
            clock,
            executor,
            loader,
            allowance,
            board,
            state,
            reader,
            writer,
            frame: None,
            done,
            dones,
            signal: None,
        }
    }

    /// Works until the connection ends; says whether the master had welcomed this worker.
    pub(super) async fn run(mut self, signals: &mut Signals) -> (bool, End) {
        let end = self.conversation(signals).await;
        self.board.set_connected(false);
        // Whatever the slots are at is of no more use to anyone.
        self.end_frame();
        (self.state.has_joined(), end)
    }

    async fn conversation(&mut self, signals: &mut Signals) -> End {
        loop {
            if let Some(end) = self.act() {
                self.last_words(&end).await;
                return self.signal.take().map_or(end, End::Signal);
            }
            let event = match self.next_event(signals).await {
                Ok(event) => event,
                Err(end) => return end,
            };
            self.state.handle(self.clock.now(), event);
            if self.state.has_joined() {
                self.reader.handshake_done();
                self.board.set_connected(true);
            }
        }
    }

    /// Waits until something happens, and writes meanwhile.
    async fn next_event(&mut self, signals: &mut Signals) -> Result<Event, End> {
        loop {
            let until_tick = self
                .state
                .poll_timeout()
                .map(|at| at.saturating_sub(self.clock.now()));
            tokio::select! {
                biased;
                signal = signals.next(), if self.signal.is_none() => {
                    self.signal = Some(signal.clone());
                    return Ok(Event::Leave(signal));
                }
                Ok(()) = self.allowance.changed() => {
                    return Ok(Event::Slots(self.allowance.borrow_and_update().slots));
                }
                written = self.writer.flush(), if !self.writer.is_empty() => {
                    written.map_err(|error| End::Gone(error.to_string()))?;
                }
                message = self.reader.read(), if self.writer.queued_bytes() < QUEUED_BYTES => {
                    return received(message);
                }
                Some(done) = self.dones.recv() => return Ok(self.event_of(done)),
                () = sleep(until_tick.unwrap_or_default()), if until_tick.is_some() => {
                    return Ok(Event::Tick);
                }
            }
        }
    }

    fn event_of(&mut self, done: Done) -> Event {
        match done {
            Done::Found(Ok(Found::Missing(chunks))) => Event::SceneMissing(chunks),
            Done::Found(Ok(Found::Ready(prepared))) | Done::Scene(Ok(prepared)) => {
                Event::SceneReady(prepared)
            }
            Done::Chunk(scene, Ok(())) => Event::ChunkTaken(scene),
            Done::Chunk(scene, Err(error)) => Event::ChunkRefused(scene, format!("{error:#}")),
            Done::Found(Err(error)) | Done::Scene(Err(error)) => Event::SceneFailed(format!("{error:#}")),
            Done::Frame(id, Ok(frame)) => {
                let stop = Arc::new(StopTime::never());
                self.frame = Some(Current { id, frame, stop });
                Event::FrameReady(id)
            }
            Done::Frame(id, Err(error)) => Event::FrameFailed(id, format!("{error:#}")),
            Done::Task(id, task, outcome) => Event::TaskDone(id, task, outcome),
        }
    }

    /// Does all that the state wants; says if the connection is to end.
    fn act(&mut self) -> Option<End> {
        while let Some(action) = self.state.poll_action() {
            match action {
                Action::Send(message) => {
                    if let ToMaster::Result(result) = &message {
                        self.board.count_result(result.pixels);
                    }
                    if let Err(error) = self.writer.push(&message) {
                        return Some(End::Unsendable(error.to_string()));
                    }
                }
                Action::FindScene(scene) => self.loader.find(scene, self.done.clone()),
                Action::TakeChunk(chunk) => self.loader.take(chunk, self.done.clone()),
                Action::BuildScene => self.loader.build(self.done.clone()),
                Action::SetUp(frame) => self.loader.set_up(frame, self.done.clone()),
                Action::Start(id, tasks) => self.start(id, tasks),
                Action::StopAt(id, stop_at) => {
                    if let Some(current) = self.current(id) {
                        current.stop.set(stop_at);
                    }
                }
                Action::Awake(slots, rest_at) => self.executor.set_awake(slots, rest_at),
                Action::End(id) => {
                    if self.current(id).is_some() {
                        self.end_frame();
                    }
                }
                Action::Close(ending) => return Some(End::Decided(ending)),
            }
        }
        None
    }

    fn start(&self, id: FrameId, tasks: Vec<Task>) {
        let Some(current) = self.current(id) else { return };
        for task in tasks {
            self.executor.submit(Job {
                id,
                frame: Arc::clone(&current.frame),
                task,
                stop: Arc::clone(&current.stop),
                done: self.done.clone(),
            });
        }
    }

    fn current(&self, id: FrameId) -> Option<&Current> {
        self.frame.as_ref().filter(|current| current.id == id)
    }

    fn end_frame(&mut self) {
        if let Some(current) = self.frame.take() {
            current.stop.set_now();
        }
    }

    /// Gives the network a moment to take what the slots had when the worker was told to go.
    async fn last_words(&mut self, end: &End) {
        if !matches!(end, End::Decided(Ending::Left)) {
            return;
        }
        let parting = async {
            self.writer.shutdown().await.ok()?;
            // To close with something unread would be a reset, which takes back what was sent.
            while let Ok(Some(_)) = self.reader.read().await {}
            Some(())
        };
        // If it takes longer, the machine's owner is more important.
        let _ = timeout(PARTING_WITHIN, parting).await;
    }
}

fn received(message: Result<Option<ToWorker>, ReadError>) -> Result<Event, End> {
    match message {
        Ok(Some(message)) => Ok(Event::Received(message)),
        Ok(None) => Err(End::Gone("it closed the connection".to_owned())),
        Err(error @ (ReadError::Envelope(_) | ReadError::Secure(_))) => Err(End::Garbage(error.to_string())),
        Err(error @ (ReadError::CutShort | ReadError::Io(_))) => Err(End::Gone(error.to_string())),
    }
}

fn hello(options: &WorkerOptions) -> Hello {
    let token = match &options.lifetime {
        Lifetime::Service => None,
        Lifetime::OneMaster { token } => token.clone(),
    };
    Hello {
        magic: version::MAGIC.to_owned(),
        protocol: version::PROTOCOL,
        version: options.version.clone(),
        name: options.name.clone(),
        slots: options.slots,
        token,
    }
}
