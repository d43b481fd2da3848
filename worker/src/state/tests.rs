//! The worker's decisions, event by event, without sockets, threads or clock.

use protocol::message::{CutOff, EndFrame, Ping, Prepare, Refused, Shutdown, Welcome};
use protocol::radiance::Encoding;
use protocol::settings::{Algorithm, LightPoints, Settings};
use protocol::{Component, Radiance, WorkerId};

use super::*;

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn hello(slots: u32) -> Hello {
    Hello {
        magic: protocol::version::MAGIC.to_owned(),
        protocol: protocol::version::PROTOCOL,
        version: "0.1.0".to_owned(),
        name: "lab-7".to_owned(),
        slots,
        token: None,
    }
}

fn task(group: u32) -> Task {
    Task {
        component: Component::Direct,
        group,
        index: 0,
        passes: 1,
    }
}

/// A scene of three chunks.
fn scene(name: &str) -> SceneRef {
    SceneRef {
        digest: Digest::of(name.as_bytes()),
        bytes: 10,
        chunks: vec![Digest::of(b"chunk"); 3],
    }
}

fn chunk(scene: &str, chunk: u32) -> SceneChunk {
    SceneChunk {
        digest: Digest::of(scene.as_bytes()),
        chunk,
        data: vec![7].into(),
    }
}

fn comes(scene: &str, index: u32) -> Event {
    Event::Received(ToWorker::SceneChunk(chunk(scene, index)))
}

fn taken(scene: &str) -> Event {
    Event::ChunkTaken(Digest::of(scene.as_bytes()))
}

fn want(scene: &str, chunk: u32) -> Action {
    let digest = Digest::of(scene.as_bytes());
    Action::Send(ToMaster::Want(Want { digest, chunk }))
}

fn prepared() -> Prepared {
    Prepared {
        digest: Digest::of(b"a"),
        load_us: 1,
        bvh_us: 2,
    }
}

fn frame(id: u32) -> Frame {
    let settings = Settings {
        algorithm: Algorithm::Component,
        width: 64,
        height: 48,
        groups: 4,
        spp: 2,
        vpls: 16,
        vpl_sets: 2,
        seed: 1,
        geometry_clamp: None,
        light_points: LightPoints::PerPass,
    };
    Frame {
        frame: FrameId(id),
        settings,
        vpl_sets: Vec::new(),
        radiance: Encoding::Exact,
    }
}

fn assign(id: u32, groups: std::ops::Range<u32>, send_within: Option<Duration>) -> Event {
    let send_within_us = send_within.map(|time| time.as_micros() as u64);
    let tasks = groups.map(task).collect();
    Event::Received(ToWorker::Assign(Assign {
        frame: FrameId(id),
        tasks,
        send_within_us,
    }))
}

fn rendered(id: u32, group: u32, busy: Duration) -> Event {
    let output = Output {
        pixels: 1,
        radiance: Radiance::pack(&[1.0, 2.0, 3.0], Encoding::Exact),
        primary_rays: 4,
        shadow_rays: 5,
    };
    Event::TaskDone(FrameId(id), task(group), Outcome::Rendered { output, busy })
}

fn not_started(id: u32, group: u32) -> Event {
    Event::TaskDone(FrameId(id), task(group), Outcome::NotStarted)
}

fn request(id: u32, tasks: u32) -> Action {
    Action::Send(ToMaster::Request(Request {
        frame: FrameId(id),
        tasks,
    }))
}

fn failed(what: FailedStep, frame: Option<u32>, task: Option<Task>, message: &str) -> Action {
    let (frame, message) = (frame.map(FrameId), message.to_owned());
    Action::Send(ToMaster::Failed(Failed {
        what,
        frame,
        task,
        message,
    }))
}

fn stop(id: u32, at: Duration) -> Action {
    Action::StopAt(FrameId(id), Some(at))
}

fn drain(state: &mut State) -> Vec<Action> {
    std::iter::from_fn(|| state.poll_action()).collect()
}

/// What the worker does about one event.
fn on(state: &mut State, now: Duration, event: Event) -> Vec<Action> {
    state.handle(now, event);
    drain(state)
}

fn welcome() -> Event {
    Event::Received(ToWorker::Welcome(Welcome {
        worker: WorkerId(3),
        version: "0.1.0".to_owned(),
    }))
}

fn joined(slots: u32) -> State {
    let mut state = State::new(ms(0), hello(slots));
    state.handle(ms(0), welcome());
    drain(&mut state);
    state
}

fn prepare(digest: &str) -> Event {
    let scene = scene(digest);
    Event::Received(ToWorker::Prepare(Prepare { scene }))
}

fn begin(id: u32) -> Event {
    Event::Received(ToWorker::Frame(frame(id)))
}

/// A worker in mid-frame that has asked for its first tasks.
fn in_frame(slots: u32, id: u32) -> State {
    let mut state = joined(slots);
    for event in [
        prepare("a"),
        Event::SceneReady(prepared()),
        begin(id),
        Event::FrameReady(FrameId(id)),
    ] {
        state.handle(ms(0), event);
    }
    drain(&mut state);
    state
}

#[test]
fn a_worker_greets_then_prepares_then_asks_for_twice_as_many_tasks_as_it_has_slots() {
    let mut state = State::new(ms(0), hello(2));
    assert_eq!(drain(&mut state), [Action::Send(ToMaster::Hello(hello(2)))]);
    assert_eq!(on(&mut state, ms(1), welcome()), []);
    assert_eq!(
        on(&mut state, ms(2), prepare("a")),
        [Action::FindScene(scene("a"))]
    );
    let ready = on(&mut state, ms(3), Event::SceneReady(prepared()));
    assert_eq!(ready, [Action::Send(ToMaster::Prepared(prepared()))]);
    assert_eq!(on(&mut state, ms(4), begin(1)), [Action::SetUp(frame(1))]);
    assert_eq!(
        on(&mut state, ms(5), Event::FrameReady(FrameId(1))),
        [request(1, 4)]
    );
}

#[test]
fn a_frame_that_comes_before_the_scene_is_ready_waits_for_it() {
    let mut state = joined(1);
    on(&mut state, ms(0), prepare("a"));
    assert_eq!(on(&mut state, ms(1), begin(1)), []);
    let ready = on(&mut state, ms(2), Event::SceneReady(prepared()));
    assert_eq!(
        ready,
        [
            Action::Send(ToMaster::Prepared(prepared())),
            Action::SetUp(frame(1))
        ]
    );
}

#[test]
fn a_scene_that_is_not_here_comes_chunk_by_chunk_two_at_a_time_and_is_built_when_all_are_here() {
    let mut state = joined(1);
    on(&mut state, ms(0), prepare("a"));
    let missing = Event::SceneMissing(vec![0, 1, 2]);
    assert_eq!(on(&mut state, ms(1), missing), [want("a", 0), want("a", 1)]);
    assert_eq!(on(&mut state, ms(2), begin(1)), []);
    let take = |index| [Action::TakeChunk(chunk("a", index))];
    assert_eq!(on(&mut state, ms(3), comes("a", 1)), take(1));
    assert_eq!(on(&mut state, ms(4), comes("a", 0)), take(0));
    assert_eq!(on(&mut state, ms(5), taken("a")), [want("a", 2)]);
    assert_eq!(on(&mut state, ms(6), taken("a")), []);
    assert_eq!(on(&mut state, ms(7), comes("a", 2)), take(2));
    assert_eq!(on(&mut state, ms(8), taken("a")), [Action::BuildScene]);
    let ready = on(&mut state, ms(9), Event::SceneReady(prepared()));
    assert_eq!(
        ready,
        [
            Action::Send(ToMaster::Prepared(prepared())),
            Action::SetUp(frame(1))
        ]
    );
}

#[test]
fn a_scene_of_which_the_disk_has_everything_is_built_without_a_word() {
    let mut state = joined(1);
    on(&mut state, ms(0), prepare("a"));
    let actions = on(&mut state, ms(1), Event::SceneMissing(Vec::new()));
    assert_eq!(actions, [Action::BuildScene]);
}

#[test]
fn a_new_scene_takes_the_place_of_one_that_is_still_coming() {
    let mut state = joined(1);
    on(&mut state, ms(0), prepare("a"));
    on(&mut state, ms(1), Event::SceneMissing(vec![0, 1]));
    assert_eq!(
        on(&mut state, ms(2), prepare("b")),
        [Action::FindScene(scene("b"))]
    );
    for late in [
        comes("a", 0),
        taken("a"),
        Event::ChunkRefused(Digest::of(b"a"), "broken".to_owned()),
    ] {
        assert_eq!(on(&mut state, ms(3), late), []);
    }
    let missing = Event::SceneMissing(vec![0]);
    assert_eq!(on(&mut state, ms(4), missing), [want("b", 0)]);
}

#[test]
fn chunks_that_were_not_asked_for_or_come_twice_or_broken_end_the_connection() {
    for wrong in [
        comes("a", 2),
        comes("a", 0),
        Event::ChunkRefused(Digest::of(b"a"), "broken".to_owned()),
    ] {
        let mut state = joined(1);
        on(&mut state, ms(0), prepare("a"));
        on(&mut state, ms(1), Event::SceneMissing(vec![0, 1, 2]));
        on(&mut state, ms(2), comes("a", 0));
        let actions = on(&mut state, ms(2), wrong);
        assert!(
            matches!(&actions[..], [Action::Close(Ending::Violation(_))]),
            "{actions:?}"
        );
    }
}

#[test]
fn each_result_is_sent_and_followed_by_a_request() {
    let mut state = in_frame(1, 1);
    let started = on(&mut state, ms(1), assign(1, 0..2, None));
    assert_eq!(started, [Action::Start(FrameId(1), vec![task(0), task(1)])]);
    let result = TaskResult {
        frame: FrameId(1),
        task: task(0),
        pixels: 1,
        radiance: Radiance::pack(&[1.0, 2.0, 3.0], Encoding::Exact),
        primary_rays: 4,
        shadow_rays: 5,
        busy_us: 20_000,
    };
    let done = on(&mut state, ms(21), rendered(1, 0, ms(20)));
    assert_eq!(done, [Action::Send(ToMaster::Result(result)), request(1, 1)]);
}

#[test]
fn the_shorter_the_tasks_the_more_wait_in_advance_up_to_the_limit() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(1), assign(1, 0..2, None));
    let done = on(&mut state, ms(2), rendered(1, 0, ms(1)));
    assert_eq!(
        done[1..],
        [request(1, 5)],
        "one is being done, five make up AHEAD"
    );

    let mut state = in_frame(1, 1);
    on(&mut state, ms(1), assign(1, 0..2, None));
    let done = on(&mut state, ms(1), rendered(1, 0, Duration::ZERO));
    assert_eq!(done[1..], [request(1, LEASES_PER_SLOT - 1)]);
}

#[test]
fn tasks_are_asked_for_when_half_of_those_in_advance_are_used_up() {
    let mut state = in_frame(2, 1);
    on(&mut state, ms(0), assign(1, 0..4, None));
    let first = on(&mut state, ms(1), rendered(1, 0, ms(1)));
    assert_eq!(
        first[1..],
        [request(1, 9)],
        "two are done at a time, five wait for each slot"
    );
    on(&mut state, ms(1), assign(1, 4..13, None));
    for group in 1..5 {
        let done = on(&mut state, ms(2), rendered(1, group, ms(1)));
        assert!(
            matches!(done[..], [Action::Send(ToMaster::Result(_))]),
            "{done:?}"
        );
    }
    let fifth = on(&mut state, ms(3), rendered(1, 5, ms(1)));
    assert_eq!(fifth[1..], [request(1, 5)]);
}

#[test]
fn results_are_to_be_sent_so_long_after_the_assignment_was_read() {
    let mut state = in_frame(1, 1);
    let started = on(&mut state, ms(10), assign(1, 0..1, Some(ms(500))));
    assert_eq!(
        started,
        [stop(1, ms(510)), Action::Start(FrameId(1), vec![task(0)])]
    );
    let only_time = on(&mut state, ms(20), assign(1, 0..0, Some(ms(400))));
    assert_eq!(only_time, [stop(1, ms(420))]);
}

#[test]
fn nothing_is_asked_for_once_the_time_is_up() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(0), assign(1, 0..2, Some(ms(100))));
    let done = on(&mut state, ms(101), rendered(1, 0, ms(100)));
    assert!(
        matches!(done[..], [Action::Send(ToMaster::Result(_))]),
        "{done:?}"
    );
    assert_eq!(on(&mut state, ms(101), not_started(1, 1)), []);
}

#[test]
fn a_cut_off_stops_the_tasks_now_and_their_results_are_sent() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(0), assign(1, 0..1, None));
    let cut = Event::Received(ToWorker::CutOff(CutOff { frame: FrameId(1) }));
    assert_eq!(on(&mut state, ms(7), cut), [stop(1, ms(7))]);
    let done = on(&mut state, ms(8), rendered(1, 0, ms(8)));
    assert!(
        matches!(done[..], [Action::Send(ToMaster::Result(_))]),
        "{done:?}"
    );
}

#[test]
fn after_the_end_of_a_frame_its_tasks_are_stopped_and_not_mentioned() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(0), assign(1, 0..1, None));
    let end = Event::Received(ToWorker::EndFrame(EndFrame { frame: FrameId(1) }));
    assert_eq!(on(&mut state, ms(5), end), [Action::End(FrameId(1))]);
    assert_eq!(on(&mut state, ms(6), rendered(1, 0, ms(6))), []);
}

#[test]
fn messages_about_another_frame_are_late_and_ignored() {
    let mut state = in_frame(1, 2);
    assert_eq!(on(&mut state, ms(1), assign(1, 0..1, Some(ms(5)))), []);
    let late = [
        ToWorker::CutOff(CutOff { frame: FrameId(1) }),
        ToWorker::EndFrame(EndFrame { frame: FrameId(1) }),
    ];
    for message in late {
        assert_eq!(on(&mut state, ms(2), Event::Received(message)), []);
    }
    assert_eq!(on(&mut state, ms(3), rendered(1, 0, ms(1))), []);
}

#[test]
fn a_new_frame_ends_the_one_before_it() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(0), assign(1, 0..1, None));
    assert_eq!(
        on(&mut state, ms(5), begin(2)),
        [Action::End(FrameId(1)), Action::SetUp(frame(2))]
    );
    assert_eq!(on(&mut state, ms(6), rendered(1, 0, ms(6))), []);
    assert_eq!(
        on(&mut state, ms(7), Event::FrameReady(FrameId(2))),
        [request(2, 2)]
    );
}

#[test]
fn a_frame_that_ends_while_it_is_set_up_is_forgotten() {
    let mut state = joined(1);
    for event in [prepare("a"), Event::SceneReady(prepared()), begin(1)] {
        on(&mut state, ms(0), event);
    }
    let end = Event::Received(ToWorker::EndFrame(EndFrame { frame: FrameId(1) }));
    assert_eq!(on(&mut state, ms(1), end), []);
    assert_eq!(on(&mut state, ms(2), Event::FrameReady(FrameId(1))), []);
    assert_eq!(on(&mut state, ms(3), begin(2)), [Action::SetUp(frame(2))]);
}

#[test]
fn of_many_wishes_while_the_loader_is_busy_only_the_last_is_kept() {
    let mut state = joined(1);
    assert_eq!(
        on(&mut state, ms(0), prepare("a")),
        [Action::FindScene(scene("a"))]
    );
    for path in ["b", "c", "d"] {
        assert_eq!(on(&mut state, ms(1), prepare(path)), []);
    }
    for id in 1..=3 {
        assert_eq!(on(&mut state, ms(1), begin(id)), []);
    }
    assert_eq!(
        on(&mut state, ms(2), Event::SceneReady(prepared())),
        [Action::FindScene(scene("d"))]
    );
    let ready = on(&mut state, ms(3), Event::SceneReady(prepared()));
    assert_eq!(
        ready,
        [
            Action::Send(ToMaster::Prepared(prepared())),
            Action::SetUp(frame(3))
        ]
    );
}

#[test]
fn what_cannot_be_done_is_said_and_the_worker_stays() {
    let mut state = joined(1);
    let unnamed = failed(FailedStep::Frame, Some(1), None, "no scene was named");
    assert_eq!(on(&mut state, ms(0), begin(1)), [unnamed]);

    on(&mut state, ms(0), prepare("a"));
    let missing = failed(FailedStep::Scene, None, None, "no such file");
    assert_eq!(
        on(&mut state, ms(1), Event::SceneFailed("no such file".to_owned())),
        [missing]
    );
    let of_failed_scene = failed(FailedStep::Frame, Some(2), None, "its scene failed");
    assert_eq!(on(&mut state, ms(1), begin(2)), [of_failed_scene]);

    on(&mut state, ms(2), prepare("b"));
    on(&mut state, ms(2), Event::SceneReady(prepared()));
    on(&mut state, ms(2), begin(3));
    let impossible = failed(FailedStep::Frame, Some(3), None, "spp is 0");
    assert_eq!(
        on(
            &mut state,
            ms(3),
            Event::FrameFailed(FrameId(3), "spp is 0".to_owned())
        ),
        [impossible]
    );

    on(&mut state, ms(4), begin(4));
    on(&mut state, ms(4), Event::FrameReady(FrameId(4)));
    on(&mut state, ms(4), assign(4, 0..1, None));
    let broke = Event::TaskDone(
        FrameId(4),
        task(0),
        Outcome::Broke("index out of range".to_owned()),
    );
    let broken = failed(FailedStep::Task, Some(4), Some(task(0)), "index out of range");
    assert_eq!(on(&mut state, ms(5), broke), [broken, request(4, 1)]);
}

#[test]
fn a_ping_is_answered() {
    let mut state = joined(1);
    let ping = Event::Received(ToWorker::Ping(Ping { nonce: 9 }));
    assert_eq!(
        on(&mut state, ms(1), ping),
        [Action::Send(ToMaster::Pong(Pong { nonce: 9 }))]
    );
}

#[test]
fn who_leaves_stops_its_slots_sends_what_they_have_and_says_so() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(0), assign(1, 0..2, None));
    assert_eq!(
        on(&mut state, ms(50), Event::Leave("SIGTERM".to_owned())),
        [stop(1, ms(50))]
    );
    assert_eq!(
        on(&mut state, ms(51), assign(1, 2..3, None)),
        [],
        "no new work is begun"
    );
    assert_eq!(on(&mut state, ms(51), not_started(1, 1)), []);
    let last = on(&mut state, ms(52), rendered(1, 0, ms(52)));
    let leaving = Action::Send(ToMaster::Leaving(Leaving {
        reason: "SIGTERM".to_owned(),
    }));
    assert!(matches!(last[0], Action::Send(ToMaster::Result(_))), "{last:?}");
    assert_eq!(last[1..], [leaving, Action::Close(Ending::Left)]);
}

#[test]
fn who_leaves_does_not_wait_long_for_a_slot_that_does_not_stop() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(0), assign(1, 0..1, None));
    on(&mut state, ms(50), Event::Leave("SIGTERM".to_owned()));
    let timeout = state.poll_timeout().unwrap();
    assert!(timeout <= ms(50 + 100), "{timeout:?}");
    let actions = on(&mut state, timeout, Event::Tick);
    assert_eq!(actions.last(), Some(&Action::Close(Ending::Left)));
    assert_eq!(
        on(&mut state, timeout, rendered(1, 0, ms(1))),
        [],
        "nothing comes after the end"
    );
}

#[test]
fn a_master_that_is_silent_too_long_is_given_up() {
    let mut state = State::new(ms(0), hello(1));
    drain(&mut state);
    assert_eq!(state.poll_timeout(), Some(HANDSHAKE_WITHIN));
    assert_eq!(
        on(&mut state, HANDSHAKE_WITHIN.saturating_sub(ms(1)), Event::Tick),
        []
    );
    let silent = |time| [Action::Close(Ending::Silent(time))];
    assert_eq!(
        on(&mut state, HANDSHAKE_WITHIN, Event::Tick),
        silent(HANDSHAKE_WITHIN)
    );

    let mut state = joined(1);
    on(
        &mut state,
        ms(1000),
        Event::Received(ToWorker::Ping(Ping { nonce: 1 })),
    );
    assert_eq!(state.poll_timeout(), Some(ms(1000) + MASTER_SILENCE));
    assert_eq!(
        on(&mut state, ms(1000) + MASTER_SILENCE, Event::Tick),
        silent(MASTER_SILENCE)
    );
}

#[test]
fn a_patient_worker_waits_for_ever_once_it_has_joined() {
    let mut state = State::new(ms(0), hello(1)).patient();
    assert_eq!(state.poll_timeout(), Some(HANDSHAKE_WITHIN));
    state.handle(ms(0), welcome());
    drain(&mut state);
    assert_eq!(state.poll_timeout(), None);
    assert_eq!(on(&mut state, ms(1_000_000), Event::Tick), []);
}

#[test]
fn a_connection_ends_when_the_master_says_so() {
    let shutdown = Event::Received(ToWorker::Shutdown(Shutdown {}));
    assert_eq!(
        on(&mut joined(1), ms(1), shutdown),
        [Action::Close(Ending::Shutdown)]
    );

    let mut state = State::new(ms(0), hello(1));
    drain(&mut state);
    let reason = "the worker is version 0.0.9".to_owned();
    let refused = Event::Received(ToWorker::Refused(Refused {
        reason: reason.clone(),
    }));
    assert_eq!(
        on(&mut state, ms(1), refused),
        [Action::Close(Ending::Refused(reason))]
    );
}

#[test]
fn a_master_that_breaks_the_rules_is_left() {
    fn violation(mut state: State, event: Event) -> String {
        match on(&mut state, ms(1), event).pop() {
            Some(Action::Close(Ending::Violation(text))) => text,
            other => panic!("{other:?}"),
        }
    }
    assert!(violation(State::new(ms(0), hello(1)), begin(1)).contains("`frame` came before"));
    assert!(violation(joined(1), welcome()).contains("`welcome`"));
    assert!(violation(in_frame(1, 1), assign(1, 0..3, None)).contains("3 tasks were assigned, only 2"));
}

#[test]
fn with_fewer_slots_fewer_tasks_are_asked_for_and_with_more_again_more() {
    let mut state = in_frame(4, 1);
    on(&mut state, ms(0), assign(1, 0..8, None));
    let fewer = on(&mut state, ms(10), Event::Slots(1));
    assert_eq!(fewer, [Action::Awake(1, ms(10) + FINISHING_WITHIN)]);
    for group in 0..6 {
        let done = on(&mut state, ms(20), rendered(1, group, ms(20)));
        assert!(
            matches!(done[..], [Action::Send(ToMaster::Result(_))]),
            "{done:?}"
        );
    }
    let done = on(&mut state, ms(40), rendered(1, 6, ms(20)));
    assert_eq!(done[1..], [request(1, 1)], "one is done, one waits");
    let more = on(&mut state, ms(50), Event::Slots(4));
    assert_eq!(more, [Action::Awake(4, ms(50) + FINISHING_WITHIN), request(1, 6)]);
}

#[test]
fn a_worker_whose_slots_all_rest_sends_what_they_have_and_leaves_after_a_while() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(0), assign(1, 0..2, None));
    assert_eq!(
        on(&mut state, ms(10), Event::Slots(0)),
        [Action::Awake(0, ms(10) + FINISHING_WITHIN)]
    );
    let prefix = on(&mut state, ms(60), rendered(1, 0, ms(60)));
    assert!(
        matches!(prefix[..], [Action::Send(ToMaster::Result(_))]),
        "nothing more is asked for"
    );
    let end = ms(10) + RESTING_WITHIN;
    assert_eq!(state.poll_timeout(), Some(end));
    // The task that waits for a slot never begins.
    assert_eq!(on(&mut state, end, Event::Tick), [stop(1, end)]);
    let gone = on(&mut state, end + STOPPING_WITHIN, Event::Tick);
    assert!(
        matches!(&gone[..], [Action::Send(ToMaster::Leaving(leaving)), Action::Close(Ending::Left)]
            if leaving.reason.contains("needed by others")),
        "{gone:?}"
    );
}

#[test]
fn slots_that_rest_for_a_moment_only_do_not_cost_the_frame() {
    let mut state = in_frame(1, 1);
    on(&mut state, ms(0), Event::Slots(0));
    let awake = on(&mut state, ms(900), Event::Slots(1));
    assert_eq!(awake, [Action::Awake(1, ms(900) + FINISHING_WITHIN)]);
    assert_eq!(on(&mut state, ms(1100), Event::Tick), []);
    assert_eq!(state.poll_timeout(), Some(ms(0) + MASTER_SILENCE));
}

#[test]
fn a_scene_that_is_too_large_for_the_memory_is_refused_before_it_comes() {
    let mut state = joined(1).with_memory_max(10 * MEMORY_PER_SCENE_BYTE - 1);
    let refusal = on(&mut state, ms(1), prepare("a"));
    assert!(
        matches!(&refusal[..], [Action::Send(ToMaster::Failed(failed))]
            if failed.what == FailedStep::Scene && failed.message.contains("`memory`")),
        "{refusal:?}"
    );
    let frame = on(&mut state, ms(2), begin(1));
    assert_eq!(
        frame,
        [failed(FailedStep::Frame, Some(1), None, "its scene failed")]
    );
    let mut state = joined(1).with_memory_max(10 * MEMORY_PER_SCENE_BYTE);
    assert_eq!(
        on(&mut state, ms(1), prepare("a")),
        [Action::FindScene(scene("a"))]
    );
}
