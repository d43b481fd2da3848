//! A worker in this process, with a renderer made for tests, talks to a scripted master.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

mod scripted;

use std::thread::{self, JoinHandle};
use std::time::Duration;

use protocol::message::*;
use protocol::radiance::Encoding;
use protocol::settings::Settings;
use protocol::{FrameId, Radiance, ToMaster, ToWorker};
use tokio::io::AsyncWriteExt as _;
use worker::clock::Clock;
use worker::{Ended, Lifetime, Priority, Stop, WorkerOptions};

use self::scripted::{BREAKING, Grey, Master, digest_of, direct, settings};

const FAST: Grey = Grey {
    pixel: Duration::ZERO,
};
const SLOW: Grey = Grey {
    pixel: Duration::from_millis(1),
};

/// Group of the test's settings, in pixels.
const GROUP: u32 = 64 * 48 / 4;

/// A worker for one master, in threads of this process.
struct Running(JoinHandle<anyhow::Result<Ended>>);

impl Running {
    fn start(master: &Master, slots: u32, renderer: Grey) -> Self {
        let options = WorkerOptions {
            connect: master.address.to_string(),
            keys: None,
            slots,
            name: "lab-7".to_owned(),
            policy: None,
            priority: Priority::Ordinary,
            memory_max: u64::MAX,
            lifetime: Lifetime::OneMaster {
                token: Some("secret".to_owned()),
            },
            cache: None,
            version: "0.0.9".to_owned(),
        };
        Self(thread::spawn(move || {
            worker::run_with(options, Clock::start(), Box::new(renderer))
        }))
    }

    /// How it ended, and the time since the call until it did.
    fn ended(self) -> (anyhow::Result<Ended>, Duration) {
        let clock = Clock::start();
        let ended = self.0.join().unwrap();
        (ended, clock.now())
    }

    fn error(self) -> String {
        format!("{:#}", self.ended().0.unwrap_err())
    }
}

#[tokio::test]
async fn a_worker_introduces_itself_renders_a_frame_and_ends_with_its_master() {
    let master = Master::listen().await;
    let worker = Running::start(&master, 2, FAST);
    let (mut peer, hello) = master.join().await;
    assert_eq!(
        (hello.name.as_str(), hello.version.as_str(), hello.slots),
        ("lab-7", "0.0.9", 2)
    );
    assert_eq!(hello.token.as_deref(), Some("secret"));

    peer.prepare(b"scene").await;
    let prepared = Prepared {
        digest: digest_of(b"scene"),
        load_us: 7,
        bvh_us: 8,
    };
    assert_eq!(peer.hear().await, ToMaster::Prepared(prepared));
    let frame = Frame {
        frame: FrameId(1),
        settings: settings(),
        vpl_sets: Vec::new(),
        radiance: Encoding::Exact,
    };
    peer.say(ToWorker::Frame(frame)).await;
    assert_eq!(
        peer.request().await,
        4,
        "each slot wants a task and one in advance"
    );

    peer.assign((0..4).map(|group| direct(group, 0)).collect(), None)
        .await;
    for _ in 0..4 {
        let result = peer.result().await;
        assert_eq!((result.pixels, result.shadow_rays), (GROUP, u64::from(GROUP)));
        assert_eq!(
            result.radiance,
            Radiance::pack(
                &vec![result.task.group as f32; 3 * GROUP as usize],
                Encoding::Exact
            )
        );
    }
    peer.say(ToWorker::Shutdown(Shutdown {})).await;
    assert_eq!(worker.ended().0.unwrap(), Ended::MasterDone);
}

#[tokio::test]
async fn slots_go_on_pulling_until_everything_is_rendered() {
    let master = Master::listen().await;
    let _worker = Running::start(&master, 2, FAST);
    let (mut peer, mut asked) = master.join_in_frame(b"scene", settings()).await;
    let mut left: Vec<_> = (0..4)
        .flat_map(|group| (0..BREAKING).map(move |pass| direct(group, pass)))
        .collect();
    let mut results = 0;
    while results < 12 {
        let count = (asked as usize).min(left.len());
        asked -= count as u32;
        peer.assign(left.drain(..count).collect(), None).await;
        match peer.hear().await {
            ToMaster::Request(request) => asked += request.tasks,
            ToMaster::Result(_) => results += 1,
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test]
async fn a_cut_off_brings_what_is_done_at_once() {
    let master = Master::listen().await;
    let _worker = Running::start(&master, 2, SLOW);
    let (mut peer, _) = master.join_in_frame(b"scene", settings()).await;
    peer.assign((0..4).map(|group| direct(group, 0)).collect(), None)
        .await;
    tokio::time::sleep(Duration::from_millis(100)).await;

    let clock = Clock::start();
    peer.say(ToWorker::CutOff(CutOff { frame: FrameId(1) })).await;
    for _ in 0..2 {
        let result = peer.result().await;
        assert!(result.task.group < 2, "the tasks in advance were not begun");
        assert!((1..GROUP).contains(&result.pixels), "{} pixels", result.pixels);
    }
    assert!(clock.now() < Duration::from_millis(50), "{:?}", clock.now());

    // Nothing more comes, neither results nor requests.
    peer.say(ToWorker::Ping(Ping { nonce: 5 })).await;
    assert_eq!(peer.hear().await, ToMaster::Pong(Pong { nonce: 5 }));
}

#[tokio::test]
async fn results_are_on_their_way_when_the_time_is_up() {
    let master = Master::listen().await;
    let _worker = Running::start(&master, 1, SLOW);
    let (mut peer, _) = master.join_in_frame(b"scene", settings()).await;
    let clock = Clock::start();
    peer.assign(vec![direct(0, 0), direct(1, 0)], Some(Duration::from_millis(100)))
        .await;
    let result = peer.result().await;
    let late = clock.now().saturating_sub(Duration::from_millis(100));
    assert!((1..GROUP).contains(&result.pixels), "{} pixels", result.pixels);
    assert!(
        clock.now() >= Duration::from_millis(100) && late < Duration::from_millis(50),
        "{late:?} late"
    );
}

#[tokio::test]
async fn a_scene_in_memory_is_not_loaded_again() {
    let master = Master::listen().await;
    let _worker = Running::start(&master, 1, FAST);
    let (mut peer, _) = master.join().await;
    for load_us in [7, 0] {
        peer.prepare(b"scene").await;
        let ToMaster::Prepared(prepared) = peer.hear().await else {
            panic!("not prepared")
        };
        assert_eq!(prepared.load_us, load_us);
    }
}

#[tokio::test]
async fn what_fails_is_named_and_the_worker_stays() {
    let master = Master::listen().await;
    let _worker = Running::start(&master, 1, FAST);
    let (mut peer, _) = master.join().await;

    peer.prepare(b"broken").await;
    let failed = peer.failed().await;
    assert_eq!(failed.what, FailedStep::Scene);
    assert!(
        failed.message.contains("cannot use the master's scene: no scene"),
        "{}",
        failed.message
    );

    peer.prepare(b"scene").await;
    peer.hear().await;
    let uneven = Settings {
        vpls: 7,
        ..settings()
    };
    peer.say(ToWorker::Frame(Frame {
        frame: FrameId(1),
        settings: uneven,
        vpl_sets: Vec::new(),
        radiance: Encoding::Exact,
    }))
    .await;
    let failed = peer.failed().await;
    assert_eq!((failed.what, failed.frame), (FailedStep::Frame, Some(FrameId(1))));

    let frame = Frame {
        frame: FrameId(1),
        settings: settings(),
        vpl_sets: Vec::new(),
        radiance: Encoding::Exact,
    };
    peer.say(ToWorker::Frame(frame)).await;
    assert_eq!(peer.request().await, 2);
    peer.assign(vec![direct(0, BREAKING), direct(99, 0)], None).await;
    let [broken, unknown] = [peer.failed().await, peer.failed().await];
    assert_eq!(broken.task, Some(direct(0, BREAKING)));
    assert!(
        broken.message.contains("this task is broken"),
        "{}",
        broken.message
    );
    assert_eq!(unknown.task, Some(direct(99, 0)));
    peer.assign(vec![direct(1, 0)], None).await;
    assert_eq!(peer.result().await.pixels, GROUP);
}

#[tokio::test]
async fn when_its_master_vanishes_a_local_worker_ends_at_once_even_in_mid_task() {
    let master = Master::listen().await;
    let worker = Running::start(&master, 2, SLOW);
    let (mut peer, _) = master.join_in_frame(b"scene", settings()).await;
    peer.assign(vec![direct(0, 0), direct(1, 0)], None).await;
    tokio::time::sleep(Duration::from_millis(30)).await;
    drop(peer);
    let (ended, time) = worker.ended();
    assert_eq!(ended.unwrap(), Ended::MasterDone);
    assert!(time < Duration::from_millis(100), "{time:?}");
}

#[tokio::test]
async fn a_refusal_is_passed_on_to_people() {
    let master = Master::listen().await;
    let worker = Running::start(&master, 1, FAST);
    let mut peer = master.accept().await;
    let mut hello = peer.hello().await;
    hello.protocol += 1;
    let reason = protocol::version::check(&hello, "0.1.0").unwrap_err();
    peer.say(ToWorker::Refused(Refused { reason })).await;
    let error = worker.error();
    assert!(
        error.contains("refuses") && error.contains("0.0.9") && error.contains("0.1.0"),
        "{error}"
    );
}

#[tokio::test]
async fn a_worker_inside_a_program_goes_when_that_says_so() {
    let master = Master::listen().await;
    let options = WorkerOptions {
        connect: master.address.to_string(),
        keys: None,
        slots: 2,
        name: "screen saver".to_owned(),
        policy: None,
        priority: Priority::Ordinary,
        memory_max: u64::MAX,
        lifetime: Lifetime::Service,
        cache: None,
        version: "0.0.9".to_owned(),
    };
    let stop = Stop::default();
    let told = stop.clone();
    let worker = thread::spawn(move || worker::run_hosted(options, told));
    let (mut peer, _) = master.join().await;
    peer.prepare(b"no scene").await;
    assert_eq!(peer.failed().await.what, FailedStep::Scene);
    stop.stop();
    let ToMaster::Leaving(leaving) = peer.hear().await else {
        panic!("the worker does not say that it leaves");
    };
    assert_eq!(leaving.reason, "its program");
    drop(peer);
    let ended = worker.join().unwrap().unwrap();
    assert_eq!(ended, Ended::Signal("its program".to_owned()));
}

#[tokio::test]
async fn garbage_ends_the_connection_with_a_clear_line() {
    let http = b"HTTP/1.1 400 Bad Request\r\n\r\n".to_vec();
    let four_gb = vec![0xff; 4];
    let no_message = [&[0, 0, 0, 2], b"\x81\xc0".as_slice()].concat();
    for (bytes, expected) in [
        (http, "announced"),
        (four_gb, "4294967295"),
        (no_message, "not a message"),
    ] {
        let master = Master::listen().await;
        let worker = Running::start(&master, 1, FAST);
        let mut stream = master.accept_bytes().await;
        stream.write_all(&bytes).await.unwrap();
        let error = worker.error();
        assert!(error.contains("does not talk like a Gridlight master"), "{error}");
        assert!(error.contains(expected), "{error}");
    }
}

#[tokio::test]
async fn work_before_the_welcome_is_not_accepted() {
    let master = Master::listen().await;
    let worker = Running::start(&master, 1, FAST);
    let mut peer = master.accept().await;
    peer.hello().await;
    peer.prepare(b"scene").await;
    let error = worker.error();
    assert!(error.contains("`prepare` came before `welcome`"), "{error}");
}
