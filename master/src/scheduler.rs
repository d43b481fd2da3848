//! Decides which worker gets which task and which results count. Knows no sockets, threads or clock.
//!
//! With a deadline no task is handed out twice: a lost one is a hole that reconstruction fills
//! (section 3.1.1). Without a deadline the full workload is the promise, so lost tasks are handed
//! out again.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    fmt,
    time::Duration,
};

// Numbers of workers are never reused, so nothing of a worker that left is mistaken for one that
// came later.
pub use protocol::WorkerId;
use render::task::{Component, Task};

use crate::{
    frame_time::FrameTime,
    lease::Pace,
    plan::{Noise, Outlook, TaskQueues},
};

/// How much of its pixel group a result covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Every pixel.
    Whole,
    /// The first chunks, at least one: the worker had to stop.
    Prefix,
    /// No pixel: the worker stopped before it began.
    Nothing,
}

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// A worker can render this frame, or the number of its slots has changed.
    WorkerReady {
        /// Who.
        worker: WorkerId,
        /// Tasks that it renders at a time.
        slots: u32,
    },
    /// A worker asks for more tasks.
    Request {
        /// Who.
        worker: WorkerId,
        /// For how many.
        count: u32,
    },
    /// A result has arrived; its pixels have not been looked at yet.
    Completed {
        /// From whom.
        worker: WorkerId,
        /// For what.
        task: Task,
        /// How much of it.
        extent: Extent,
        /// Time that the slot spent on it.
        busy: Duration,
    },
    /// A result cannot be added to the picture: wrong size, or not numbers.
    Unusable {
        /// From whom.
        worker: WorkerId,
        /// For what.
        task: Task,
    },
    /// A connection is gone.
    WorkerLeft {
        /// Whose.
        worker: WorkerId,
    },
    /// A new estimate of how long before the cut-off this worker must send.
    DeltaT {
        /// Who.
        worker: WorkerId,
        /// The paper's Δt.
        delta_t: Duration,
    },
    /// A new estimate of how long results of all slots of this worker are on the wires that it shares.
    OnTheWire {
        /// Who.
        worker: WorkerId,
        /// With those of everyone else.
        time: Duration,
    },
    /// The cut-off has been set or moved.
    CutOff {
        /// After this moment no result counts.
        at: FrameTime,
    },
    /// How noisy a pass of each component is has been estimated anew; matters to the progressive
    /// algorithm alone.
    Noise(Noise),
    /// Nothing but time has passed.
    Tick,
}

/// What is to be done.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// Send these tasks.
    Assign {
        /// To whom.
        worker: WorkerId,
        /// In this order.
        tasks: Vec<Task>,
    },
    /// Tell a worker when it must have sent what it has.
    SendBy {
        /// Whom.
        worker: WorkerId,
        /// The cut-off less its Δt.
        at: FrameTime,
    },
    /// The result that the last event announced counts: add its pixels.
    Add {
        /// Whose.
        worker: WorkerId,
        /// For what.
        task: Task,
    },
    /// Close the connection of a worker that broke the rules.
    Disconnect {
        /// Whose.
        worker: WorkerId,
        /// Which rule.
        fault: Fault,
    },
    /// The tracing is over; nothing that comes from now on counts. Happens once.
    Close(Closing),
}

/// A rule that a worker broke.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// It sent a result for a task that it never had.
    #[error("it sent a result for {} which it never had", Name(*.0))]
    NeverHad(Task),
    /// It sent a result twice.
    #[error("it sent a second result for {}", Name(*.0))]
    Twice(Task),
    /// The pixels of a result make no sense.
    #[error("its result for {} has the wrong size or is not made of finite numbers", Name(*.0))]
    Unusable(Task),
    /// It acted before it said that it was ready.
    #[error("it asked for tasks before it was ready")]
    NotReady,
}

struct Name(Task);

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Task {
            component,
            group,
            index,
            passes,
        } = self.0;
        match component {
            _ if passes > 1 => {
                write!(
                    f,
                    "{component:?} passes {index} to {} of group {group},",
                    index + passes - 1
                )
            }
            Component::Direct => write!(f, "direct pass {index} of group {group},"),
            Component::Indirect => write!(f, "VPL set {index} of group {group},"),
            Component::Full => write!(f, "group {group},"),
        }
    }
}

/// Why the tracing ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Closing {
    /// Every task has been completed, or lost for good.
    WorkDone,
    /// The cut-off has come, or nobody can send anything more before it.
    CutOff,
}

/// Tasks of one component; those of several passes count as so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// The full workload.
    pub total: u32,
    /// Handed out so far, each counted once.
    pub issued: u32,
    /// Whole results.
    pub completed: u32,
    /// Results that cover a part of their pixels.
    pub partial: u32,
}

/// What is promised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Promise {
    /// The picture is delivered in time, with holes if need be; each task is handed out once.
    Deadline,
    /// The full workload, however long it takes; lost tasks are handed out again.
    FullWorkload,
}

/// Work that a worker may hold ahead, so that its slots never wait for the network.
const AHEAD: Duration = Duration::from_millis(100);
/// Near the cut-off at most this part of the remaining time is held ahead: what has been handed
/// out and not begun by the cut-off is lost.
const AHEAD_OF_REMAINING: u32 = 4;
/// A new cut-off is told to a worker only if it differs by more than this.
const SEND_BY_STEP: Duration = Duration::from_millis(1);

/// Hands out tasks. See the module's documentation.
///
/// Each [`handle`](Self::handle) is followed by [`poll_action`](Self::poll_action) until `None`.
#[derive(Debug)]
pub struct Scheduler {
    promise: Promise,
    leases_per_slot_max: u32,
    queues: TaskQueues,
    status: BTreeMap<Task, Status>,
    tallies: BTreeMap<Component, Tally>,
    workers: BTreeMap<WorkerId, Worker>,
    cut_off: Option<FrameTime>,
    closed: bool,
    late_results: u64,
    actions: VecDeque<Action>,
}

/// Where a task that has been handed out is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Status {
    Leased(WorkerId),
    Done(WorkerId, Extent),
    Lost,
}

#[derive(Debug, Default)]
struct Worker {
    slots: u32,
    /// Tasks that it asked for and has not got.
    wanted: u32,
    leases: BTreeSet<Task>,
    first_lease: Option<FrameTime>,
    completed: u64,
    delta_t: Duration,
    send_by: Option<FrameTime>,
    pace: Pace,
}

impl Scheduler {
    /// A frame in which no worker ever holds, or has asked for, more than `leases_per_slot_max`
    /// tasks for each of its slots.
    pub fn new(queues: TaskQueues, promise: Promise, leases_per_slot_max: u32) -> Self {
        let tally = |total| Tally {
            total,
            ..Tally::default()
        };
        let totals = queues.totals().into_iter();
        let tallies = totals
            .map(|(component, total)| (component, tally(total)))
            .collect();
        Self {
            promise,
            leases_per_slot_max,
            queues,
            status: BTreeMap::new(),
            tallies,
            workers: BTreeMap::new(),
            cut_off: None,
            closed: false,
            late_results: 0,
            actions: VecDeque::new(),
        }
    }

    /// Takes one event; `now` is the time since the frame began and never goes back.
    pub fn handle(&mut self, now: FrameTime, event: Event) {
        // The cut-off comes first: a result that arrives after it is late even if the timer is later.
        self.close_at_cut_off(now);
        match event {
            Event::WorkerReady { worker, slots } => self.worker_ready(now, worker, slots),
            Event::Request { worker, count } => self.request(now, worker, count),
            Event::Completed {
                worker,
                task,
                extent,
                busy,
            } => self.completed(now, worker, task, extent, busy),
            Event::Unusable { worker, task } => self.unusable(now, worker, task),
            Event::WorkerLeft { worker } => self.worker_left(now, worker),
            Event::DeltaT { worker, delta_t } => self.delta_t(worker, delta_t),
            Event::OnTheWire { worker, time } => self.on_the_wire(worker, time),
            Event::CutOff { at } => self.move_cut_off(at),
            Event::Noise(noise) => self.queues.noise(noise),
            Event::Tick => {}
        }
        self.close_at_cut_off(now);
        self.close_when_nothing_can_come(now);
    }

    /// The next thing to do; call until `None` after every [`handle`](Self::handle).
    pub fn poll_action(&mut self) -> Option<Action> {
        self.actions.pop_front()
    }

    /// When to call `handle(now, Event::Tick)` if nothing else happens.
    pub fn poll_timeout(&self) -> Option<FrameTime> {
        if self.closed { None } else { self.cut_off }
    }

    /// The components of this frame and how far they are.
    pub fn tallies(&self) -> &BTreeMap<Component, Tally> {
        &self.tallies
    }

    /// Results that came after the tracing was over.
    pub fn late_results(&self) -> u64 {
        self.late_results
    }

    /// Slots of all workers that are here now.
    pub fn slots(&self) -> u32 {
        self.workers.values().map(|worker| worker.slots).sum()
    }

    /// When a worker must have sent what it has, as it was told last.
    pub fn send_by(&self, worker: WorkerId) -> Option<FrameTime> {
        self.workers.get(&worker)?.send_by
    }

    /// Whether the tracing is over.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    fn worker_ready(&mut self, now: FrameTime, id: WorkerId, slots: u32) {
        self.workers.entry(id).or_default().slots = slots;
        self.announce(id);
        self.serve(now, id);
    }

    fn request(&mut self, now: FrameTime, id: WorkerId, count: u32) {
        let leases_per_slot_max = self.leases_per_slot_max;
        let Some(worker) = self.workers.get_mut(&id) else {
            return self.disconnect(id, Fault::NotReady);
        };
        let held = worker.leases.len() as u32;
        let open_max = worker.leases_max(leases_per_slot_max).saturating_sub(held);
        worker.wanted = worker.wanted.saturating_add(count).min(open_max);
        self.serve(now, id);
    }

    fn completed(&mut self, now: FrameTime, id: WorkerId, task: Task, extent: Extent, busy: Duration) {
        if !self.workers.contains_key(&id) {
            return self.disconnect(id, Fault::NotReady);
        }
        match self.status.get(&task) {
            Some(Status::Leased(holder)) if *holder == id => {}
            Some(Status::Done(holder, _)) if *holder == id => {
                return self.disconnect(id, Fault::Twice(task));
            }
            _ => return self.disconnect(id, Fault::NeverHad(task)),
        }
        self.end_lease(id, task);
        if self.closed {
            self.status.insert(task, Status::Lost);
            self.late_results += u64::from(extent != Extent::Nothing);
            return;
        }
        // A cut-off without a deadline is an interruption: then, too, everything is of use.
        let counts = match extent {
            Extent::Whole => true,
            Extent::Prefix => self.promise == Promise::Deadline || self.cut_off.is_some(),
            Extent::Nothing => false,
        };
        if extent == Extent::Whole {
            self.queues.took(task, busy);
            if let Some(worker) = self.workers.get_mut(&id) {
                worker.pace.took(task, busy);
            }
        }
        if counts {
            self.status.insert(task, Status::Done(id, extent));
            self.count(task, extent, task.passes.cast_signed());
            self.actions.push_back(Action::Add { worker: id, task });
        } else {
            self.lose(task);
        }
        self.serve(now, id);
        self.serve_all(now);
    }

    fn unusable(&mut self, now: FrameTime, id: WorkerId, task: Task) {
        if let Some(&Status::Done(holder, extent)) = self.status.get(&task)
            && holder == id
        {
            self.count(task, extent, -task.passes.cast_signed());
            self.lose(task);
        }
        self.disconnect(id, Fault::Unusable(task));
        self.serve_all(now);
    }

    fn worker_left(&mut self, now: FrameTime, id: WorkerId) {
        self.drop_worker(id);
        self.serve_all(now);
    }

    fn delta_t(&mut self, id: WorkerId, delta_t: Duration) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.delta_t = delta_t;
            self.announce(id);
        }
    }

    fn on_the_wire(&mut self, id: WorkerId, time: Duration) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.pace.on_the_wire = time;
        }
    }

    fn move_cut_off(&mut self, at: FrameTime) {
        self.cut_off = Some(at);
        for id in self.workers.keys().copied().collect::<Vec<_>>() {
            self.announce(id);
        }
    }

    /// Tells a worker when it must send, unless it knows.
    fn announce(&mut self, id: WorkerId) {
        if self.closed {
            return;
        }
        let (Some(worker), Some(cut_off)) = (self.workers.get_mut(&id), self.cut_off) else {
            return;
        };
        let at = cut_off - worker.delta_t;
        let known = worker
            .send_by
            .is_some_and(|told| told.until(at).max(at.until(told)) <= SEND_BY_STEP);
        if !known {
            worker.send_by = Some(at);
            self.actions.push_back(Action::SendBy { worker: id, at });
        }
    }

    /// Hands out what a worker asked for, as far as it may hold more.
    fn serve(&mut self, now: FrameTime, id: WorkerId) {
        if self.closed {
            return;
        }
        let slots = self.slots();
        let Some(worker) = self.workers.get_mut(&id) else {
            return;
        };
        let outlook = Outlook {
            left: self.cut_off.map(|at| now.until(at - worker.delta_t)),
            slots,
            pace: worker.pace,
        };
        let held = worker.leases.len() as u32;
        let allowed = worker
            .leases_now(now, self.cut_off)
            .min(worker.leases_max(self.leases_per_slot_max));
        let count = worker.wanted.min(allowed.saturating_sub(held));
        let tasks: Vec<Task> = std::iter::from_fn(|| self.queues.next_task(&outlook))
            .take(count as usize)
            .collect();
        if tasks.is_empty() {
            return;
        }
        worker.wanted -= tasks.len() as u32;
        worker.leases.extend(&tasks);
        worker.first_lease.get_or_insert(now);
        for &task in &tasks {
            let before = self.status.insert(task, Status::Leased(id));
            assert!(
                before.is_none() || self.promise == Promise::FullWorkload,
                "{task:?} was handed out a second time, after {before:?}"
            );
            if before.is_none() {
                self.tallies.entry(task.component).or_default().issued += task.passes;
            }
        }
        self.actions.push_back(Action::Assign { worker: id, tasks });
    }

    /// After tasks came back to the queues: whoever waits, in order of arrival.
    fn serve_all(&mut self, now: FrameTime) {
        if self.promise == Promise::Deadline || self.queues.is_empty() {
            return;
        }
        for id in self.workers.keys().copied().collect::<Vec<_>>() {
            self.serve(now, id);
        }
    }

    fn end_lease(&mut self, id: WorkerId, task: Task) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.leases.remove(&task);
            worker.completed += 1;
        }
    }

    fn lose(&mut self, task: Task) {
        self.status.insert(task, Status::Lost);
        if self.promise == Promise::FullWorkload {
            self.queues.put_back(task);
        }
    }

    fn count(&mut self, task: Task, extent: Extent, by: i32) {
        let tally = self.tallies.entry(task.component).or_default();
        let counter = match extent {
            Extent::Whole => &mut tally.completed,
            Extent::Prefix => &mut tally.partial,
            Extent::Nothing => return,
        };
        *counter = counter.saturating_add_signed(by);
    }

    fn disconnect(&mut self, id: WorkerId, fault: Fault) {
        self.drop_worker(id);
        self.actions.push_back(Action::Disconnect { worker: id, fault });
    }

    fn drop_worker(&mut self, id: WorkerId) {
        let Some(worker) = self.workers.remove(&id) else {
            return;
        };
        // Backwards, so that tasks put back at the front keep their order.
        for task in worker.leases.into_iter().rev() {
            self.lose(task);
        }
    }

    fn close_at_cut_off(&mut self, now: FrameTime) {
        if self.cut_off.is_some_and(|at| now >= at) {
            self.close(Closing::CutOff);
        }
    }

    fn close_when_nothing_can_come(&mut self, now: FrameTime) {
        let outstanding = self.workers.values().any(|worker| !worker.leases.is_empty());
        if outstanding {
            return;
        }
        if self.queues.is_empty() {
            self.close(Closing::WorkDone);
        }
        // Every worker has passed the moment at which it sends its last.
        let all_sent = self
            .workers
            .values()
            .all(|worker| worker.send_by.is_some_and(|at| now >= at));
        if all_sent && !self.workers.is_empty() {
            self.close(Closing::CutOff);
        }
    }

    fn close(&mut self, closing: Closing) {
        if !self.closed {
            self.closed = true;
            self.actions.push_back(Action::Close(closing));
        }
    }
}

impl Worker {
    fn leases_max(&self, leases_per_slot_max: u32) -> u32 {
        self.slots.saturating_mul(leases_per_slot_max)
    }

    /// Tasks that this worker may hold: one per slot and as many again as it completes in [`AHEAD`],
    /// fewer near the cut-off, none when it would have to send at once.
    fn leases_now(&self, now: FrameTime, cut_off: Option<FrameTime>) -> u32 {
        let ahead = match cut_off {
            None => AHEAD,
            Some(cut_off) => {
                let remaining = now.until(cut_off - self.delta_t);
                if remaining.is_zero() {
                    return 0;
                }
                AHEAD.min(remaining / AHEAD_OF_REMAINING)
            }
        };
        let busy = self.first_lease.map_or(Duration::ZERO, |first| first.until(now));
        let tasks_ahead = if busy.is_zero() {
            f64::from(self.slots)
        } else {
            self.completed as f64 * ahead.as_secs_f64() / busy.as_secs_f64()
        };
        self.slots.saturating_add(tasks_ahead.ceil() as u32)
    }
}
