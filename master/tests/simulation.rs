//! The real scheduler among simulated workers: they join and die, straggle and lie, and what they send
//! takes its time. From one seed; a failing run prints the seed that replays it.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, BinaryHeap},
    time::Duration,
};

use master::{
    frame_time::FrameTime,
    plan::TaskQueues,
    scheduler::{Action, Event, Extent, Promise, Scheduler, WorkerId},
};
use proptest::prelude::*;
use render::{
    scene::ImageSize,
    settings::{Algorithm, Settings},
    task::{Component, Task},
};

const LEASES_PER_SLOT_MAX: u32 = 8;
const CUT_OFF: FrameTime = FrameTime::after_start(Duration::from_secs(1));
/// Nothing of a run without a deadline lasts longer; a simulated hour means that it never ends.
const NEVER: FrameTime = FrameTime::after_start(Duration::from_secs(3_600));

/// Numbers that look random and are a function of the seed alone (`SplitMix64`).
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % sides
    }

    fn one_in(&mut self, sides: u64) -> bool {
        self.roll(sides) == 0
    }

    fn milliseconds(&mut self, most: u64) -> Duration {
        Duration::from_micros(self.roll(most * 1_000))
    }
}

/// What a simulated worker does at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Deed {
    Join(u32),
    Finish(u32, TaskKey),
    Die(u32),
    Lie(u32),
    MoveCutOff,
    Tick,
}

type TaskKey = (Component, u32, u32);

fn key(task: Task) -> TaskKey {
    (task.component, task.group, task.index)
}

fn task((component, group, index): TaskKey) -> Task {
    Task {
        component,
        group,
        index,
        passes: 1,
    }
}

struct Simulation {
    dice: Dice,
    promise: Promise,
    scheduler: Scheduler,
    agenda: BinaryHeap<Reverse<(FrameTime, u64, Deed)>>,
    deeds: u64,
    alive: BTreeMap<u32, Worker>,
    issued: BTreeMap<TaskKey, u32>,
    added: BTreeSet<TaskKey>,
    closed_at: Vec<FrameTime>,
    workers_left: u32,
}

struct Worker {
    slots: u32,
    held: BTreeSet<TaskKey>,
    sent: Vec<TaskKey>,
}

impl Simulation {
    fn new(seed: u64, promise: Promise, workers: u32) -> Self {
        let size = ImageSize {
            width: 32,
            height: 32,
        };
        let settings = Settings {
            groups: 16,
            spp: 4,
            vpls: 8,
            vpl_sets: 8,
            ..Settings::paper(Algorithm::Component, size)
        };
        let mut simulation = Self {
            dice: Dice(seed),
            promise,
            scheduler: Scheduler::new(TaskQueues::new(&settings), promise, LEASES_PER_SLOT_MAX),
            agenda: BinaryHeap::new(),
            deeds: 0,
            alive: BTreeMap::new(),
            issued: BTreeMap::new(),
            added: BTreeSet::new(),
            closed_at: Vec::new(),
            workers_left: workers,
        };
        if promise == Promise::Deadline {
            simulation.happen(FrameTime::START, Event::CutOff { at: CUT_OFF });
            for _ in 0..5 {
                let at = FrameTime::START + simulation.dice.milliseconds(1_100);
                simulation.plan(at, Deed::MoveCutOff);
            }
        }
        for worker in 0..workers {
            let at = FrameTime::START + simulation.dice.milliseconds(600);
            simulation.plan(at, Deed::Join(worker));
        }
        simulation
    }

    fn plan(&mut self, at: FrameTime, deed: Deed) {
        self.deeds += 1;
        self.agenda.push(Reverse((at, self.deeds, deed)));
    }

    fn run(&mut self) -> Result<(), TestCaseError> {
        while let Some(Reverse((now, _, deed))) = self.agenda.pop() {
            prop_assert!(now < NEVER, "the frame never ends");
            self.do_deed(now, deed)?;
            if let Some(timeout) = self.scheduler.poll_timeout() {
                // A timer may be late.
                let late = self.dice.milliseconds(3);
                self.plan(timeout.max(now) + late, Deed::Tick);
            }
        }
        Ok(())
    }

    fn do_deed(&mut self, now: FrameTime, deed: Deed) -> Result<(), TestCaseError> {
        match deed {
            Deed::Join(worker) => {
                let slots = 1 + self.dice.roll(4) as u32;
                let held = BTreeSet::new();
                let sent = Vec::new();
                self.alive.insert(worker, Worker { slots, held, sent });
                let id = WorkerId(worker);
                self.happen(now, Event::WorkerReady { worker: id, slots });
                self.happen(
                    now,
                    Event::Request {
                        worker: id,
                        count: 2 * slots,
                    },
                );
                if self.dice.one_in(3) {
                    let at = now + self.dice.milliseconds(500);
                    self.plan(at, Deed::Die(worker));
                }
                if self.dice.one_in(4) {
                    let at = now + self.dice.milliseconds(500);
                    self.plan(at, Deed::Lie(worker));
                }
            }
            Deed::Finish(worker, task) => self.finish(now, worker, task),
            Deed::Die(worker) => self.die(now, worker),
            Deed::Lie(worker) => self.lie(now, worker),
            Deed::MoveCutOff => {
                let at = CUT_OFF - self.dice.milliseconds(200);
                self.happen(now, Event::CutOff { at });
            }
            Deed::Tick => self.happen(now, Event::Tick),
        }
        self.act(now)
    }

    fn finish(&mut self, now: FrameTime, worker: u32, done: TaskKey) {
        let Some(state) = self.alive.get_mut(&worker) else {
            return;
        };
        if !state.held.remove(&done) {
            return;
        }
        state.sent.push(done);
        let extent = match self.dice.roll(20) {
            0 => Extent::Prefix,
            1 => Extent::Nothing,
            _ => Extent::Whole,
        };
        let id = WorkerId(worker);
        self.happen(
            now,
            Event::Completed {
                worker: id,
                task: task(done),
                extent,
                busy: Duration::ZERO,
            },
        );
        self.happen(now, Event::Request { worker: id, count: 1 });
    }

    fn die(&mut self, now: FrameTime, worker: u32) {
        if self.alive.remove(&worker).is_some() {
            let id = WorkerId(worker);
            self.happen(now, Event::WorkerLeft { worker: id });
            self.replace(now);
        }
    }

    /// Without a deadline somebody always comes after one who went; who would finish otherwise?
    fn replace(&mut self, now: FrameTime) {
        if self.promise == Promise::FullWorkload {
            let at = now + self.dice.milliseconds(50);
            self.plan(at, Deed::Join(self.workers_left));
            self.workers_left += 1;
        }
    }

    /// Sends a result that it never had, or one that it has sent before.
    fn lie(&mut self, now: FrameTime, worker: u32) {
        let Some(state) = self.alive.get(&worker) else {
            return;
        };
        let lie = match (state.sent.last(), self.dice.one_in(2)) {
            (Some(&sent), true) => sent,
            _ => (
                Component::Direct,
                self.dice.roll(20) as u32,
                self.dice.roll(6) as u32,
            ),
        };
        let is_true = state.held.contains(&lie);
        if !is_true {
            let id = WorkerId(worker);
            self.happen(
                now,
                Event::Completed {
                    worker: id,
                    task: task(lie),
                    extent: Extent::Whole,
                    busy: Duration::ZERO,
                },
            );
        }
    }

    fn happen(&mut self, now: FrameTime, event: Event) {
        self.scheduler.handle(now, event);
    }

    fn act(&mut self, now: FrameTime) -> Result<(), TestCaseError> {
        while let Some(action) = self.scheduler.poll_action() {
            match action {
                Action::Assign { worker, tasks } => self.assigned(now, worker.0, &tasks)?,
                Action::Add { task, .. } => {
                    prop_assert!(self.closed_at.is_empty(), "{task:?} was added after the end");
                    prop_assert!(self.added.insert(key(task)), "{task:?} was added twice");
                }
                Action::Disconnect { worker, .. } => {
                    if self.alive.remove(&worker.0).is_some() {
                        self.replace(now);
                    }
                }
                Action::Close(_) => self.closed_at.push(now),
                Action::SendBy { .. } => {}
            }
        }
        Ok(())
    }

    fn assigned(&mut self, now: FrameTime, worker: u32, tasks: &[Task]) -> Result<(), TestCaseError> {
        prop_assert!(self.closed_at.is_empty(), "tasks were handed out after the end");
        for &task in tasks {
            let times = self.issued.entry(key(task)).or_default();
            *times += 1;
            let once = *times == 1 || self.promise == Promise::FullWorkload;
            prop_assert!(once, "{task:?} was handed out {times} times");
            prop_assert!(
                !self.added.contains(&key(task)),
                "{task:?} was handed out again though it is done"
            );
        }
        let Some(state) = self.alive.get_mut(&worker) else {
            return Err(TestCaseError::fail("a worker that is gone got tasks"));
        };
        state.held.extend(tasks.iter().copied().map(key));
        let held = state.held.len() as u32;
        prop_assert!(
            held <= state.slots * LEASES_PER_SLOT_MAX,
            "a worker holds {held} tasks"
        );
        // One in sixteen straggles and is back long after the end.
        let slow = if self.dice.one_in(16) { 5_000 } else { 40 };
        for &task in tasks {
            let at = now + self.dice.milliseconds(slow);
            self.plan(at, Deed::Finish(worker, key(task)));
        }
        Ok(())
    }
}

proptest! {
    #[test]
    fn with_a_deadline_the_frame_closes_once_and_in_time_and_nothing_counts_twice(seed: u64, workers in 0u32..6) {
        let mut simulation = Simulation::new(seed, Promise::Deadline, workers);
        simulation.run()?;
        let [closed_at] = simulation.closed_at[..] else {
            return Err(TestCaseError::fail(format!("closed {} times", simulation.closed_at.len())));
        };
        let timer_late = Duration::from_millis(3);
        prop_assert!(closed_at <= CUT_OFF + timer_late, "closed at {closed_at}");
        let counted: u32 = simulation.scheduler.tallies().values().map(|tally| tally.completed + tally.partial).sum();
        prop_assert_eq!(counted as usize, simulation.added.len());
    }

    #[test]
    fn without_a_deadline_every_task_is_completed_once_whoever_dies_or_lies(seed: u64, workers in 1u32..6) {
        let mut simulation = Simulation::new(seed, Promise::FullWorkload, workers);
        simulation.run()?;
        prop_assert_eq!(simulation.closed_at.len(), 1);
        for tally in simulation.scheduler.tallies().values() {
            prop_assert_eq!(tally.completed, tally.total);
            prop_assert_eq!(tally.partial, 0);
        }
    }

    #[test]
    fn the_same_seed_replays_the_same_run(seed: u64) {
        let run = || {
            let mut simulation = Simulation::new(seed, Promise::Deadline, 4);
            let ended = simulation.run();
            (ended.is_ok(), simulation.closed_at, simulation.added, simulation.scheduler.late_results())
        };
        prop_assert_eq!(run(), run());
    }
}
