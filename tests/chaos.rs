//! Workers die, stall, come late and go early: the picture is there by its deadline all the same.

use std::{net::TcpListener, process::Command, thread, time::Duration};

use gridlight::{
    master::{Finished, Master, Running},
    oiio::assert_finite,
    programs::{children, program, root, signal},
    worker::Worker,
};

/// More work than any machine of today does in three seconds.
const ENDLESS: &str = "--size 512x512 --vpls 16384 --vpl-sets 64";
const DEADLINE: Duration = Duration::from_secs(3);

fn start(flags: &str) -> Running {
    Master::new(&format!("--deadline 3 {ENDLESS} {flags}")).start()
}

/// In time, whole, and with real data somewhere.
fn assert_delivered(picture: &Finished) {
    picture.assert_in_time(DEADLINE);
    assert_finite(picture.exr());
    assert!(picture.tasks_done() > 0, "nothing was finished:\n{}", picture.log);
    assert!(picture.pixels().count_positive("samples.direct") > 0);
}

fn tasks_of(picture: &Finished, worker: &str) -> u64 {
    picture.worker(worker)["tasks"]
        .as_u64()
        .expect("a number of tasks")
}

#[test]
fn a_killed_local_worker_is_replaced_and_what_it_did_is_in_the_picture() {
    let master = start("");
    master.log.wait_for(&["a worker joined"]);
    master.sleep_until(DEADLINE / 2);
    let worker = master.local_worker().expect("a local worker");
    signal(worker, "KILL");
    let picture = master.finish();
    assert_delivered(&picture);
    let workers = picture.report("/workers").as_array().expect("a list").clone();
    assert_eq!(workers.len(), 2, "{workers:#?}");
    for worker in &workers {
        assert!(worker["tasks"].as_u64() > Some(0), "{worker:#}");
    }
    assert!(
        workers[0]["left"].is_string() && workers[1]["left"].is_null(),
        "{workers:#?}"
    );
}

#[test]
fn with_every_local_worker_killed_the_picture_shows_what_was_finished() {
    let master = start("");
    master.log.wait_for(&["a worker joined"]);
    master.sleep_until(DEADLINE / 2);
    // Replacements die, too.
    while master.is_running() {
        for worker in children(master.process) {
            signal(worker, "KILL");
        }
        thread::sleep(Duration::from_millis(5));
    }
    let picture = master.finish();
    assert_delivered(&picture);
    assert!(picture.log.contains("the local worker died"), "{}", picture.log);
}

#[test]
fn a_stopped_worker_delays_nothing() {
    let master = start("--local-slots 0");
    let address = master.address();
    let straggler = Worker::start("straggler", address, 1);
    let _steady = Worker::start("steady", address, 1);
    master.log.wait_for(&["a worker joined", "steady"]);
    master.sleep_until(DEADLINE / 2);
    straggler.signal("STOP");
    let picture = master.finish();
    assert_delivered(&picture);
    let (stopped, steady) = (tasks_of(&picture, "straggler"), tasks_of(&picture, "steady"));
    assert!(0 < stopped && stopped < steady, "{stopped} and {steady} tasks");
}

#[test]
fn a_worker_that_comes_in_mid_frame_contributes() {
    let master = start("--local-slots 1");
    let address = master.address();
    master.sleep_until(DEADLINE / 3);
    let _late = Worker::start("late", address, 1);
    let picture = master.finish();
    assert_delivered(&picture);
    assert!(tasks_of(&picture, "late") > 0);
    assert_eq!(picture.count("/slots"), 2);
}

/// The same worker serves one master after the other.
#[test]
fn a_worker_that_was_warmed_needs_no_byte_of_the_scene_for_its_frame() {
    let free = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr());
    let address = free.expect("a free port");
    let _warmed = Worker::start("warmed", address, 1);
    let flags = ["--wait", "30", "--expect-workers", "1", "--listen"];
    let warm = Command::new(program("master"))
        .arg("warm")
        .args(flags)
        .arg(address.to_string())
        .current_dir(root())
        .output()
        .expect("the program starts");
    let said = String::from_utf8_lossy(&warm.stderr);
    assert!(
        warm.status.success() && said.contains("a worker has the scene"),
        "{said}"
    );

    let picture = start(&format!("--local-slots 0 --listen {address}")).finish();
    assert_delivered(&picture);
    assert!(tasks_of(&picture, "warmed") > 0);
    assert_eq!(picture.worker("warmed")["scene_bytes"], 0);
}

#[test]
fn a_worker_that_is_told_to_go_hands_in_what_it_has() {
    // Tasks so long that one would never be finished, of chunks that take milliseconds.
    let flags = "--deadline 3 --size 1024x1024 --groups 1 --vpls 256 --vpl-sets 1 --local-slots 0 --no-png";
    let master = Master::new(flags).start();
    let mut worker = Worker::start("guest", master.address(), 1);
    master.log.wait_for(&["a worker joined"]);
    master.sleep_until(DEADLINE / 2);
    worker.signal("TERM");
    assert!(worker.wait().success(), "{}", worker.log.whole());
    let picture = master.finish();
    picture.assert_code(0);
    let partial = picture.count("/tasks/direct/partial") + picture.count("/tasks/indirect/partial");
    assert!(partial > 0, "{}", picture.log);
    let samples = ["samples.direct", "samples.indirect"].map(|name| picture.pixels().count_positive(name));
    assert!(samples.iter().sum::<usize>() > 0);
    assert!(picture.worker("guest")["left"].is_string());
}

#[test]
fn with_no_worker_at_all_there_is_a_picture_that_says_so() {
    let picture = start("--local-slots 0").finish();
    picture.assert_in_time(DEADLINE);
    assert_finite(picture.exr());
    assert_eq!(picture.tasks_done(), 0);
    assert_eq!(picture.pixels().count_positive("samples.direct"), 0);
    assert_eq!(picture.report("/reconstructed_percent/direct"), 100.0);
}

#[test]
fn an_interrupted_master_delivers_what_is_finished() {
    for (name, code) in [("INT", 130), ("TERM", 143)] {
        let master = start("");
        master.log.wait_for(&["a worker joined"]);
        master.sleep_until(DEADLINE / 3);
        master.signal(name);
        let picture = master.finish();
        picture.assert_code(code);
        assert!(picture.wall < DEADLINE, "{:?}", picture.wall);
        assert_finite(picture.exr());
        assert!(picture.tasks_done() > 0, "{}", picture.log);
        assert_eq!(picture.left_behind(), ["picture.exr", "picture.png"]);
    }
}
