//! When to rehearse: at the start, and again while the frame is traced.

use std::{sync::Arc, thread, time::Duration};

use rayon::ThreadPool;
use tokio::sync::mpsc;

use crate::{
    clock::Clock, cores, deadline::Rehearsed, frame_time::FrameTime, job::Job, rehearsal::Rehearsal,
};

/// Rehearsals in a frame, the one at the start not counted.
const PER_FRAME: u32 = 4;
/// The first one is played twice: it finds cold caches, and a short frame has time for no other.
const PLAYS_AT_START: u32 = 2;
/// Time between two of them, at least: each takes from the tracing what it costs.
const PAUSE_MIN: Duration = Duration::from_millis(350);
/// None begins with less time to the cut-off than so many times what the last one took.
const LAST_BEFORE_CUT_OFF: u32 = 3;

/// Plays the finish phase through, again and again, on a thread of its own.
#[derive(Debug)]
pub struct Rehearsals {
    /// Asks for one more.
    orders: Option<std::sync::mpsc::Sender<()>>,
    learnt: mpsc::UnboundedReceiver<(Rehearsed, Duration)>,
    pause: Duration,
    is_running: bool,
    next: FrameTime,
    took: Duration,
}

impl Rehearsals {
    /// Begins the first one. There is nothing to rehearse without a deadline.
    pub fn start(job: &Job, clock: Clock, threads: &Arc<ThreadPool>) -> Self {
        let (orders, ordered) = std::sync::mpsc::channel();
        let (teach, learnt) = mpsc::unbounded_channel();
        if let Some(deadline) = job.deadline {
            let (job, threads) = (job.clone(), Arc::clone(threads));
            thread::spawn(move || {
                // The process has ended when this thread has, too.
                cores::go_first();
                let rehearsal = Rehearsal::new(&job, deadline.elapsed(), clock);
                let mut plays = PLAYS_AT_START;
                while ordered.recv().is_ok() {
                    for _ in 0..plays {
                        match clock.time(|| rehearsal.play(&threads)) {
                            (Ok(rehearsed), took) => drop(teach.send((rehearsed, took))),
                            (Err(failure), _) => {
                                return tracing::debug!(error = %failure.error, "the rehearsal failed");
                            }
                        }
                    }
                    plays = 1;
                }
            });
        }
        let mut rehearsals = Self {
            orders: job.deadline.map(|_| orders),
            learnt,
            pause: job
                .deadline
                .map_or(Duration::MAX, |deadline| deadline.elapsed() / (PER_FRAME + 1))
                .max(PAUSE_MIN),
            is_running: false,
            next: FrameTime::START,
            took: Duration::ZERO,
        };
        rehearsals.again(FrameTime::START, Duration::MAX);
        rehearsals
    }

    /// One more, if it is time and the real thing would not have to wait for it.
    pub fn again(&mut self, now: FrameTime, left: Duration) {
        let has_room = left > self.took * LAST_BEFORE_CUT_OFF;
        if let (Some(orders), false, true) = (&self.orders, self.is_running, has_room && now >= self.next) {
            self.is_running = orders.send(()).is_ok();
            self.next = now + self.pause;
        }
    }

    /// What the last one taught; `None` when there will be no more.
    pub async fn learnt(&mut self) -> Option<Rehearsed> {
        let (rehearsed, took) = self.learnt.recv().await?;
        self.is_running = false;
        self.took = took;
        Some(rehearsed)
    }
}
