//! The slots: threads that take tasks from one queue and render them.

use std::collections::VecDeque;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use embree4_sys::FlushDenormals;
use protocol::{FrameId, Task};

use crate::clock::Clock;
use crate::done::{Done, DoneSender, panic_text};
use crate::pace::Pace;
use crate::priority::Priority;
use crate::renderer::Frame;
use crate::state::Outcome;

/// The slots of a worker. They end when this is dropped, each with the task it is at.
#[derive(Debug)]
pub struct Executor {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// A task with all that a slot needs for it.
#[derive(Debug)]
pub struct Job {
    /// The frame's number.
    pub id: FrameId,
    /// The frame.
    pub frame: Arc<dyn Frame>,
    /// The task.
    pub task: Task,
    /// When to stop.
    pub stop: Arc<StopTime>,
    /// Whom to tell.
    pub done: DoneSender,
}

/// When tasks are to stop; may change while they run.
#[derive(Debug)]
pub struct StopTime {
    /// Since the clock's start; the largest number stands for never.
    micros: AtomicU64,
}

const NEVER: u64 = u64::MAX;

#[derive(Debug)]
struct Shared {
    clock: Clock,
    queue: Mutex<Queue>,
    /// For slots that are awake: a job has come.
    job_came: Condvar,
    /// For slots that rest: one of them may be awake again.
    roused: Condvar,
    /// For each slot, when it must have stopped because it is to rest.
    rests: Vec<StopTime>,
}

#[derive(Debug, Default)]
struct Queue {
    jobs: VecDeque<Job>,
    /// The first so many slots work, the others rest.
    awake: usize,
    closed: bool,
}

impl Executor {
    /// Starts the threads, all awake.
    pub fn start(slots: u32, priority: Priority, clock: Clock) -> io::Result<Self> {
        let slots = slots as usize;
        let queue = Queue {
            awake: slots,
            ..Queue::default()
        };
        let shared = Shared {
            clock,
            queue: Mutex::new(queue),
            job_came: Condvar::new(),
            roused: Condvar::new(),
            rests: (0..slots).map(|_| StopTime::never()).collect(),
        };
        let mut executor = Self {
            shared: Arc::new(shared),
            threads: Vec::new(),
        };
        for slot in 0..slots {
            let shared = Arc::clone(&executor.shared);
            let thread = thread::Builder::new().name(format!("slot {slot}"));
            executor.threads.push(thread.spawn(move || {
                priority.take();
                shared.work(slot);
            })?);
        }
        Ok(executor)
    }

    /// Lets only so many slots work. The others take no more tasks, and those they are at stop at
    /// `rest_at`; jobs in the queue are left to the slots that are awake, now or later.
    pub fn set_awake(&self, slots: u32, rest_at: Duration) {
        let awake = slots as usize;
        let mut queue = self.shared.lock();
        for (slot, rest) in self.shared.rests.iter().enumerate() {
            match (slot < awake, slot < queue.awake) {
                (true, _) => rest.set(None),
                (false, true) => rest.set(Some(rest_at)),
                (false, false) => {}
            }
        }
        queue.awake = awake;
        self.shared.roused.notify_all();
        // Who waits for a job and is to rest now must not be the one that the next job wakes.
        self.shared.job_came.notify_all();
    }

    /// Puts a task at the end of the queue.
    pub fn submit(&self, job: Job) {
        self.shared.lock().jobs.push_back(job);
        self.shared.job_came.notify_one();
    }

    /// Ends the slots and waits for the tasks that they are at.
    pub fn join(mut self) {
        self.close();
        for thread in self.threads.drain(..) {
            // A slot catches what breaks in it.
            let _ = thread.join();
        }
    }

    fn close(&self) {
        let mut queue = self.shared.lock();
        queue.closed = true;
        queue.jobs.clear();
        self.shared.job_came.notify_all();
        self.shared.roused.notify_all();
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        self.close();
    }
}

impl Shared {
    /// The life of a slot.
    fn work(&self, slot: usize) {
        let _mode = FlushDenormals::in_this_thread();
        let mut pace = Pace::default();
        while let Some(job) = self.next(slot) {
            let outcome = self.run(&job, &self.rests[slot], &mut pace);
            // Nobody listens if the connection has ended meanwhile.
            let _ = job.done.send(Done::Task(job.id, job.task, outcome));
        }
    }

    /// The next job, as soon as there is one and the slot is awake.
    fn next(&self, slot: usize) -> Option<Job> {
        let mut queue = self.lock();
        while !queue.closed {
            let awake = slot < queue.awake;
            if awake && let Some(job) = queue.jobs.pop_front() {
                return Some(job);
            }
            let news = if awake { &self.job_came } else { &self.roused };
            queue = news.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
        None
    }

    fn run(&self, job: &Job, rest: &StopTime, pace: &mut Pace) -> Outcome {
        let begun = self.clock.now();
        if job.stop.time_left(begun).is_zero() {
            return Outcome::NotStarted;
        }
        if !job.frame.has(job.task) {
            return Outcome::Broke(format!("the frame has no task {}", job.task));
        }
        pace.begin(job.id, job.task.component, job.task.passes);
        let mut chunks = |left| {
            let now = self.clock.now();
            pace.next(left, now, job.stop.time_left(now).min(rest.time_left(now)))
        };
        // A task that breaks must end neither the slot nor the worker.
        match catch_unwind(AssertUnwindSafe(|| job.frame.render(job.task, &mut chunks))) {
            Ok(output) => {
                let now = self.clock.now();
                pace.end(now);
                Outcome::Rendered {
                    output,
                    busy: now.saturating_sub(begun),
                }
            }
            Err(panic) => Outcome::Broke(panic_text(&*panic)),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        // No code that can panic runs under the lock.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl StopTime {
    /// Not to be stopped yet.
    pub fn never() -> Self {
        Self {
            micros: AtomicU64::new(NEVER),
        }
    }

    /// Changes the time, also for tasks that run.
    pub fn set(&self, stop_at: Option<Duration>) {
        let micros = stop_at.map_or(NEVER, |time| u64::try_from(time.as_micros()).unwrap_or(NEVER));
        self.micros.store(micros, Ordering::Relaxed);
    }

    /// Stops all tasks of the frame now.
    pub fn set_now(&self) {
        self.set(Some(Duration::ZERO));
    }

    /// Zero when the time has come.
    fn time_left(&self, now: Duration) -> Duration {
        // Nothing else is published through this number, so no order is needed.
        Duration::from_micros(self.micros.load(Ordering::Relaxed)).saturating_sub(now)
    }
}

#[cfg(test)]
mod tests {
    use protocol::Component;
    use tokio::sync::mpsc;

    use super::*;
    use crate::renderer::Output;

    /// Renders a pixel per question; group 13 breaks.
    #[derive(Debug)]
    struct Counting {
        pixels: u32,
    }

    impl Frame for Counting {
        fn has(&self, task: Task) -> bool {
            task.group < 20
        }

        fn render(&self, task: Task, chunks: &mut dyn FnMut(usize) -> usize) -> Output {
            assert!(task.group != 13, "thirteen");
            let pixels = (0..self.pixels).take_while(|_| chunks(1) > 0).count() as u32;
            Output {
                pixels,
                ..Output::default()
            }
        }
    }

    struct Slots {
        executor: Executor,
        stop: Arc<StopTime>,
        sender: DoneSender,
        done: mpsc::UnboundedReceiver<Done>,
        clock: Clock,
    }

    impl Slots {
        fn new(count: u32) -> Self {
            let clock = Clock::start();
            let (sender, done) = mpsc::unbounded_channel();
            let (executor, stop) = (
                Executor::start(count, Priority::Ordinary, clock).unwrap(),
                Arc::new(StopTime::never()),
            );
            Self {
                executor,
                stop,
                sender,
                done,
                clock,
            }
        }

        fn submit(&self, pixels: u32, group: u32) {
            self.executor.submit(Job {
                id: FrameId(1),
                frame: Arc::new(Counting { pixels }),
                task: Task {
                    component: Component::Direct,
                    group,
                    index: 0,
                    passes: 1,
                },
                stop: Arc::clone(&self.stop),
                done: self.sender.clone(),
            });
        }

        fn next(&mut self) -> (u32, Outcome) {
            let patience = self.clock.now() + Duration::from_secs(20);
            while self.clock.now() < patience {
                match self.done.try_recv() {
                    Ok(Done::Task(_, task, outcome)) => return (task.group, outcome),
                    Ok(other) => panic!("not a task: {other:?}"),
                    Err(_) => thread::sleep(Duration::from_millis(1)),
                }
            }
            panic!("no slot reports anything");
        }
    }

    #[test]
    fn every_task_is_rendered_and_reported_once() {
        let mut slots = Slots::new(3);
        (0..10).for_each(|group| slots.submit(5, group));
        let mut groups: Vec<u32> = (0..10).map(|_| slots.next().0).collect();
        groups.sort_unstable();
        assert_eq!(groups, (0..10).collect::<Vec<_>>());
    }

    #[test]
    fn a_running_task_stops_at_a_time_set_after_its_start_and_the_next_is_not_begun() {
        let mut slots = Slots::new(1);
        slots.submit(u32::MAX, 0);
        slots.submit(u32::MAX, 1);
        let stop_at = slots.clock.now() + Duration::from_millis(20);
        slots.stop.set(Some(stop_at));
        let (group, outcome) = slots.next();
        let late = slots.clock.now().saturating_sub(stop_at);
        assert!(matches!(outcome, Outcome::Rendered { output, .. } if group == 0 && output.pixels > 0));
        assert!(late < Duration::from_millis(50), "{late:?}");
        assert!(matches!(slots.next(), (1, Outcome::NotStarted)));
    }

    #[test]
    fn a_task_that_breaks_or_does_not_exist_is_reported_and_the_slot_goes_on() {
        let mut slots = Slots::new(1);
        for group in [13, 99, 2] {
            slots.submit(1, group);
        }
        assert!(matches!(slots.next(), (13, Outcome::Broke(text)) if text.contains("thirteen")));
        assert!(matches!(slots.next(), (99, Outcome::Broke(text)) if text.contains("no task")));
        assert!(matches!(slots.next(), (2, Outcome::Rendered { .. })));
    }

    #[test]
    fn a_slot_that_is_to_rest_stops_its_task_and_takes_no_other_until_it_is_awake_again() {
        let mut slots = Slots::new(1);
        slots.submit(u32::MAX, 0);
        slots.submit(5, 1);
        thread::sleep(Duration::from_millis(20));
        let rest_at = slots.clock.now() + Duration::from_millis(20);
        slots.executor.set_awake(0, rest_at);
        let (group, outcome) = slots.next();
        assert!(slots.clock.now() >= rest_at, "stopped too early");
        assert!(matches!(outcome, Outcome::Rendered { output, .. } if group == 0 && output.pixels > 0));
        thread::sleep(Duration::from_millis(20));
        assert!(slots.done.try_recv().is_err(), "the second task was begun");
        slots.executor.set_awake(1, Duration::ZERO);
        assert!(matches!(slots.next(), (1, Outcome::Rendered { output, .. }) if output.pixels == 5));
    }

    #[test]
    fn jobs_reach_the_slots_that_are_awake_however_often_their_number_changes() {
        let mut slots = Slots::new(4);
        for round in 0..500 {
            slots.executor.set_awake(1 + round % 4, slots.clock.now());
            slots.submit(1, 0);
            assert_eq!(slots.next().0, 0, "round {round}");
        }
    }
}
