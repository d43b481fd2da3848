//! How much of a task a slot renders before it looks at the clock again.
//!
//! The more chunks are rendered at once, the faster each is; but a slot that is to stop should not be in the
//! middle of many. So it renders as many as surely end before it must stop.

use std::collections::BTreeMap;
use std::time::Duration;

use protocol::{Component, FrameId};

/// Longest time without a look at the clock: what stops a frame may come at any moment.
const RUN_MAX: Duration = Duration::from_millis(12);
/// A run may take this many times longer than runs before it took, as when other programs come.
const RESERVE: u32 = 2;

/// What a slot knows of the time that chunks take. Time is the worker's clock.
#[derive(Debug, Default)]
pub struct Pace {
    task: Option<(FrameId, Component, u32)>,
    /// Time that one pass over a chunk takes, for each component of the frame.
    pass: BTreeMap<Component, Duration>,
    /// The run that is being rendered: when it began, and its chunks.
    run: Option<(Duration, usize)>,
}

impl Pace {
    /// A task of so many passes begins. What was learnt of other frames is forgotten.
    pub fn begin(&mut self, frame: FrameId, component: Component, passes: u32) {
        if self.task.is_none_or(|(known, ..)| known != frame) {
            self.pass.clear();
        }
        self.task = Some((frame, component, passes.max(1)));
        self.run = None;
    }

    /// How many of the chunks left in the task to render next, when the slot must stop after `time_left`:
    /// at least one if there is any time. One of what has not been timed yet.
    pub fn next(&mut self, left: usize, now: Duration, time_left: Duration) -> usize {
        self.end(now);
        if time_left.is_zero() {
            return 0;
        }
        let chunk = self
            .task
            .and_then(|(_, component, passes)| Some(*self.pass.get(&component)? * passes));
        let fit = chunk.map_or(1, |chunk| {
            let time = RUN_MAX.min(time_left / RESERVE);
            (time.as_nanos() / chunk.as_nanos().max(1)) as usize
        });
        let chunks = fit.clamp(1, left.max(1));
        self.run = Some((now, chunks));
        chunks
    }

    /// The run that was begun last is done.
    pub fn end(&mut self, now: Duration) {
        if let (Some((_, component, passes)), Some((begun, chunks))) = (self.task, self.run.take()) {
            let chunks = u32::try_from(chunks).unwrap_or(u32::MAX);
            self.pass
                .insert(component, now.saturating_sub(begun) / chunks / passes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: FrameId = FrameId(1);
    const LONG: Duration = Duration::from_secs(100);

    fn millis(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    /// After a pass over a chunk of indirect light that took 2 ms, in a task of the given kind.
    fn paced(frame: FrameId, component: Component) -> Pace {
        let mut pace = Pace::default();
        pace.begin(FRAME, Component::Indirect, 1);
        pace.next(12, millis(0), LONG);
        pace.end(millis(2));
        pace.begin(frame, component, 1);
        pace
    }

    #[test]
    fn what_has_not_been_timed_begins_with_one_chunk() {
        for (frame, component) in [(FRAME, Component::Direct), (FrameId(2), Component::Indirect)] {
            let mut pace = paced(frame, component);
            assert_eq!(pace.next(12, millis(2), LONG), 1);
            assert_eq!(pace.next(11, millis(4), LONG), 6);
        }
    }

    #[test]
    fn a_run_is_as_long_as_a_slot_may_look_away_but_not_longer_than_the_task() {
        let mut pace = paced(FRAME, Component::Indirect);
        assert_eq!(pace.next(100, millis(2), LONG), 6);
        assert_eq!(pace.next(3, millis(14), LONG), 3);
    }

    #[test]
    fn runs_get_shorter_towards_the_stop_and_end_at_it() {
        let chunks = |time_left| paced(FRAME, Component::Indirect).next(12, millis(2), time_left);
        assert_eq!(
            [millis(24), millis(9), millis(1), millis(0)].map(chunks),
            [6, 2, 1, 0]
        );
    }

    #[test]
    fn a_chunk_of_three_passes_takes_three_times_as_long() {
        let mut pace = paced(FRAME, Component::Indirect);
        pace.begin(FRAME, Component::Indirect, 3);
        assert_eq!(pace.next(100, millis(2), LONG), 2);
        assert_eq!(pace.next(100, millis(14), LONG), 2);
    }
}
