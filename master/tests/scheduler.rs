//! What the scheduler decides, event by event.

use std::{
    collections::{BTreeMap, VecDeque},
    time::Duration,
};

use master::{
    frame_time::FrameTime,
    plan::TaskQueues,
    scheduler::{Action, Closing, Event, Extent, Fault, Promise, Scheduler, WorkerId},
};
use render::{
    scene::ImageSize,
    settings::{Algorithm, Settings},
    task::{Component, Task},
};

const A: WorkerId = WorkerId(1);
const B: WorkerId = WorkerId(2);
const LEASES_PER_SLOT_MAX: u32 = 8;

/// Eight groups in one queue.
fn scheduler(promise: Promise) -> Scheduler {
    let size = ImageSize {
        width: 32,
        height: 32,
    };
    let settings = Settings {
        groups: 8,
        ..Settings::paper(Algorithm::Straightforward, size)
    };
    Scheduler::new(TaskQueues::new(&settings), promise, LEASES_PER_SLOT_MAX)
}

fn at(milliseconds: u64) -> FrameTime {
    FrameTime::after_start(Duration::from_millis(milliseconds))
}

fn task(group: u32) -> Task {
    Task {
        component: Component::Full,
        group,
        index: 0,
        passes: 1,
    }
}

fn ready(worker: WorkerId, slots: u32) -> Event {
    Event::WorkerReady { worker, slots }
}

fn request(worker: WorkerId, count: u32) -> Event {
    Event::Request { worker, count }
}

fn completed(worker: WorkerId, group: u32) -> Event {
    Event::Completed {
        worker,
        task: task(group),
        extent: Extent::Whole,
        busy: Duration::ZERO,
    }
}

fn assign(worker: WorkerId, groups: impl IntoIterator<Item = u32>) -> Action {
    Action::Assign {
        worker,
        tasks: groups.into_iter().map(task).collect(),
    }
}

fn add(worker: WorkerId, group: u32) -> Action {
    Action::Add {
        worker,
        task: task(group),
    }
}

/// Gives the events in order, a millisecond apart from `start`, and returns all actions.
fn feed_from(scheduler: &mut Scheduler, start: u64, events: &[Event]) -> Vec<Action> {
    let mut actions = Vec::new();
    for (milliseconds, &event) in (start..).zip(events) {
        scheduler.handle(at(milliseconds), event);
        actions.extend(std::iter::from_fn(|| scheduler.poll_action()));
    }
    actions
}

fn feed(scheduler: &mut Scheduler, events: &[Event]) -> Vec<Action> {
    feed_from(scheduler, 0, events)
}

#[test]
fn a_worker_holds_at_most_one_task_ahead_per_slot_until_its_speed_is_known() {
    let mut scheduler = scheduler(Promise::Deadline);
    let actions = feed(&mut scheduler, &[ready(A, 2), request(A, 100)]);
    assert_eq!(actions, [assign(A, 0..4)]);
}

#[test]
fn what_a_worker_asked_for_follows_as_its_results_come() {
    let mut scheduler = scheduler(Promise::Deadline);
    feed(&mut scheduler, &[ready(A, 1), request(A, 4)]);
    // One result in the second since the first lease: a tenth of a task ahead, so one.
    let actions = feed_from(&mut scheduler, 1_000, &[completed(A, 0)]);
    assert_eq!(actions, [add(A, 0), assign(A, [2])]);
}

#[test]
fn a_fast_worker_holds_a_tenth_of_a_second_of_work_ahead() {
    let mut scheduler = scheduler(Promise::Deadline);
    feed(&mut scheduler, &[ready(A, 1), request(A, 100)]);
    // One result in 20 ms: five in a tenth of a second, and one in the slot.
    let actions = feed_from(&mut scheduler, 21, &[completed(A, 0)]);
    assert_eq!(actions, [add(A, 0), assign(A, 2..7)]);
}

#[test]
fn no_worker_ever_holds_more_than_the_limit_however_fast_it_seems() {
    let size = ImageSize {
        width: 64,
        height: 64,
    };
    let settings = Settings {
        groups: 1_000,
        ..Settings::paper(Algorithm::Straightforward, size)
    };
    let mut scheduler = Scheduler::new(TaskQueues::new(&settings), Promise::Deadline, LEASES_PER_SLOT_MAX);
    feed(&mut scheduler, &[ready(A, 2), request(A, u32::MAX)]);
    let mut events: Vec<Event> = (0..4).map(|group| completed(A, group)).collect();
    events.push(request(A, u32::MAX));
    let actions = feed_from(&mut scheduler, 5, &events);
    let assigned = actions.iter().map(|action| match action {
        Action::Assign { tasks, .. } => tasks.len() as u32,
        _ => 0,
    });
    assert_eq!(assigned.sum::<u32>(), 2 * LEASES_PER_SLOT_MAX);
}

#[test]
fn a_lost_task_is_not_handed_out_again_with_a_deadline() {
    let mut scheduler = scheduler(Promise::Deadline);
    let actions = feed(
        &mut scheduler,
        &[
            ready(A, 2),
            request(A, 4),
            Event::WorkerLeft { worker: A },
            ready(B, 8),
            request(B, 8),
        ],
    );
    assert_eq!(actions, [assign(A, 0..4), assign(B, 4..8)]);
}

#[test]
fn a_lost_task_is_handed_out_again_without_a_deadline() {
    let mut scheduler = scheduler(Promise::FullWorkload);
    let actions = feed(
        &mut scheduler,
        &[
            ready(A, 2),
            request(A, 4),
            ready(B, 8),
            request(B, 8),
            Event::WorkerLeft { worker: A },
        ],
    );
    assert_eq!(actions, [assign(A, 0..4), assign(B, 4..8), assign(B, 0..4)]);
}

#[test]
fn a_result_for_a_task_that_the_worker_never_had_ends_its_connection_and_counts_nothing() {
    let mut scheduler = scheduler(Promise::Deadline);
    let actions = feed(
        &mut scheduler,
        &[ready(A, 1), request(A, 2), ready(B, 1), completed(B, 0)],
    );
    let fault = Fault::NeverHad(task(0));
    assert_eq!(
        actions,
        [assign(A, 0..2), Action::Disconnect { worker: B, fault }]
    );
    assert_eq!(scheduler.tallies()[&Component::Full].completed, 0);
}

#[test]
fn a_second_result_for_a_task_is_refused_and_the_first_one_stays() {
    let mut scheduler = scheduler(Promise::Deadline);
    let actions = feed(
        &mut scheduler,
        &[ready(A, 1), request(A, 1), completed(A, 0), completed(A, 0)],
    );
    let fault = Fault::Twice(task(0));
    assert_eq!(
        actions,
        [assign(A, [0]), add(A, 0), Action::Disconnect { worker: A, fault }]
    );
    assert_eq!(scheduler.tallies()[&Component::Full].completed, 1);
}

#[test]
fn a_result_that_cannot_be_added_is_not_counted() {
    let mut scheduler = scheduler(Promise::Deadline);
    feed(&mut scheduler, &[ready(A, 1), request(A, 1), completed(A, 0)]);
    let unusable = Event::Unusable {
        worker: A,
        task: task(0),
    };
    let actions = feed_from(&mut scheduler, 9, &[unusable]);
    let fault = Fault::Unusable(task(0));
    assert_eq!(actions, [Action::Disconnect { worker: A, fault }]);
    assert_eq!(scheduler.tallies()[&Component::Full].completed, 0);
}

#[test]
fn whoever_asks_before_it_is_ready_is_sent_away() {
    let mut scheduler = scheduler(Promise::Deadline);
    let actions = feed(&mut scheduler, &[request(A, 1)]);
    let fault = Fault::NotReady;
    assert_eq!(actions, [Action::Disconnect { worker: A, fault }]);
}

#[test]
fn the_cut_off_closes_the_frame_once_and_later_results_are_counted_as_late() {
    let mut scheduler = scheduler(Promise::Deadline);
    feed(
        &mut scheduler,
        &[Event::CutOff { at: at(100) }, ready(A, 1), request(A, 2)],
    );
    assert_eq!(scheduler.poll_timeout(), Some(at(100)));
    let actions = feed_from(
        &mut scheduler,
        100,
        &[Event::Tick, completed(A, 0), request(A, 5), Event::Tick],
    );
    assert_eq!(actions, [Action::Close(Closing::CutOff)]);
    assert_eq!(scheduler.late_results(), 1);
    assert_eq!(scheduler.tallies()[&Component::Full].completed, 0);
    assert_eq!(scheduler.poll_timeout(), None);
}

#[test]
fn a_result_that_arrives_after_the_cut_off_is_late_even_before_the_timer_fires() {
    let mut scheduler = scheduler(Promise::Deadline);
    feed(
        &mut scheduler,
        &[Event::CutOff { at: at(100) }, ready(A, 1), request(A, 1)],
    );
    let actions = feed_from(&mut scheduler, 101, &[completed(A, 0)]);
    assert_eq!(actions, [Action::Close(Closing::CutOff)]);
    assert_eq!(scheduler.late_results(), 1);
}

#[test]
fn each_worker_is_told_to_send_its_delta_t_before_the_cut_off_and_told_again_when_that_moves() {
    let mut scheduler = scheduler(Promise::Deadline);
    let delta_t = Duration::from_millis(30);
    let actions = feed(
        &mut scheduler,
        &[
            Event::CutOff { at: at(500) },
            ready(A, 1),
            Event::DeltaT { worker: A, delta_t },
            Event::CutOff { at: at(450) },
            // Half a millisecond is not worth a message.
            Event::CutOff {
                at: at(450) + Duration::from_micros(500),
            },
        ],
    );
    let send_by = |milliseconds| Action::SendBy {
        worker: A,
        at: at(milliseconds),
    };
    assert_eq!(actions, [send_by(500), send_by(470), send_by(420)]);
}

#[test]
fn no_task_is_handed_out_to_a_worker_that_would_have_to_send_at_once() {
    let mut scheduler = scheduler(Promise::Deadline);
    let delta_t = Duration::from_millis(30);
    feed(
        &mut scheduler,
        &[
            Event::CutOff { at: at(100) },
            ready(A, 1),
            Event::DeltaT { worker: A, delta_t },
            request(A, 1),
        ],
    );
    assert_eq!(feed_from(&mut scheduler, 75, &[request(A, 1)]), []);
}

#[test]
fn a_prefix_counts_with_a_deadline_and_is_done_again_without_one() {
    let prefix = Event::Completed {
        worker: A,
        task: task(0),
        extent: Extent::Prefix,
        busy: Duration::ZERO,
    };
    let mut with_deadline = scheduler(Promise::Deadline);
    let actions = feed(&mut with_deadline, &[ready(A, 1), request(A, 1), prefix]);
    assert_eq!(actions, [assign(A, [0]), add(A, 0)]);
    assert_eq!(with_deadline.tallies()[&Component::Full].partial, 1);

    let mut without = scheduler(Promise::FullWorkload);
    let actions = feed(&mut without, &[ready(A, 1), request(A, 1), prefix, request(A, 1)]);
    assert_eq!(actions, [assign(A, [0]), assign(A, [0])]);
}

#[test]
fn an_interrupted_full_workload_takes_what_workers_have() {
    let prefix = Event::Completed {
        worker: A,
        task: task(0),
        extent: Extent::Prefix,
        busy: Duration::ZERO,
    };
    let mut scheduler = scheduler(Promise::FullWorkload);
    feed(&mut scheduler, &[ready(A, 1), request(A, 1)]);
    let actions = feed_from(&mut scheduler, 10, &[Event::CutOff { at: at(40) }, prefix]);
    assert!(actions.contains(&add(A, 0)), "{actions:?}");
    assert_eq!(scheduler.tallies()[&Component::Full].partial, 1);
}

#[test]
fn the_frame_closes_when_the_last_result_is_in() {
    let mut scheduler = scheduler(Promise::Deadline);
    feed(&mut scheduler, &[ready(A, 8), request(A, 8)]);
    let events: Vec<Event> = (0..8).map(|group| completed(A, group)).collect();
    let actions = feed_from(&mut scheduler, 5, &events);
    assert_eq!(actions.last(), Some(&Action::Close(Closing::WorkDone)));
    assert_eq!(scheduler.tallies()[&Component::Full].completed, 8);
}

#[test]
fn without_a_deadline_the_frame_stays_open_when_its_only_worker_dies() {
    let mut scheduler = scheduler(Promise::FullWorkload);
    let actions = feed(
        &mut scheduler,
        &[ready(A, 8), request(A, 8), Event::WorkerLeft { worker: A }],
    );
    assert_eq!(actions, [assign(A, 0..8)]);
    assert!(!scheduler.is_closed());
}

#[test]
fn with_nobody_there_the_frame_stays_open_until_the_cut_off() {
    let mut scheduler = scheduler(Promise::Deadline);
    let actions = feed(&mut scheduler, &[Event::CutOff { at: at(100) }, Event::Tick]);
    assert_eq!(actions, []);
    let actions = feed_from(&mut scheduler, 100, &[Event::Tick]);
    assert_eq!(actions, [Action::Close(Closing::CutOff)]);
}

#[test]
fn the_frame_closes_before_the_cut_off_when_every_worker_has_sent_its_last() {
    let mut scheduler = scheduler(Promise::Deadline);
    let delta_t = Duration::from_millis(30);
    feed(
        &mut scheduler,
        &[
            Event::CutOff { at: at(100) },
            ready(A, 1),
            Event::DeltaT { worker: A, delta_t },
            request(A, 1),
        ],
    );
    let nothing = Event::Completed {
        worker: A,
        task: task(0),
        extent: Extent::Nothing,
        busy: Duration::ZERO,
    };
    let actions = feed_from(&mut scheduler, 72, &[nothing]);
    assert_eq!(actions, [Action::Close(Closing::CutOff)]);
}

/// Two workers, of which the second takes eight times as long for a pass, share the work: the passes of those
/// leases of each that it spent most time on.
fn leases_of_two(on_the_wire: Duration) -> [u32; 2] {
    let size = ImageSize {
        width: 1024,
        height: 768,
    };
    let settings = Settings {
        spp: 65_536,
        ..Settings::progressive(size)
    };
    let mut scheduler = Scheduler::new(TaskQueues::new(&settings), Promise::Deadline, LEASES_PER_SLOT_MAX);
    scheduler.handle(at(0), Event::CutOff { at: at(40_000) });
    let workers = [(A, 2), (B, 16)];
    for (worker, _) in workers {
        scheduler.handle(at(0), ready(worker, 1));
        scheduler.handle(at(0), request(worker, 1));
        let time = on_the_wire;
        scheduler.handle(at(0), Event::OnTheWire { worker, time });
    }
    // What each works on, and until when in milliseconds.
    let mut working: [VecDeque<(Task, u64)>; 2] = Default::default();
    let mut times: [BTreeMap<u32, u64>; 2] = Default::default();
    let mut now = 0;
    while now < 15_000 {
        while let Some(action) = scheduler.poll_action() {
            if let Action::Assign { worker, tasks } = action {
                let place = usize::from(worker == B);
                for task in tasks {
                    let begin = working[place].back().map_or(now, |&(_, end)| end);
                    working[place].push_back((task, begin + workers[place].1 * u64::from(task.passes)));
                }
            }
        }
        let end = |place: &usize| working[*place].front().map(|&(_, end)| end);
        let place = (0..2)
            .filter(|place| end(place).is_some())
            .min_by_key(end)
            .expect("work");
        let (task, end) = working[place].pop_front().expect("work");
        let (worker, pass_ms) = workers[place];
        let busy_ms = pass_ms * u64::from(task.passes);
        *times[place].entry(task.passes).or_default() += busy_ms;
        now = end;
        let completed = Event::Completed {
            worker,
            task,
            extent: Extent::Whole,
            busy: Duration::from_millis(busy_ms),
        };
        scheduler.handle(at(now), completed);
        scheduler.handle(at(now), request(worker, 1));
    }
    let most = |times: &BTreeMap<u32, u64>| {
        times
            .iter()
            .max_by_key(|&(_, ms)| ms)
            .map_or(0, |(&passes, _)| passes)
    };
    [most(&times[0]), most(&times[1])]
}

#[test]
fn a_lease_is_as_long_as_suits_the_speed_of_its_worker_and_its_wires() {
    assert_eq!(leases_of_two(Duration::ZERO), [32, 4], "64 ms");
    assert_eq!(leases_of_two(Duration::from_millis(15)), [64, 8], "128 ms");
}
