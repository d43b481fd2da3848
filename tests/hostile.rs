//! Peers that send nonsense or lies: each is refused with a line in the log, and the frame is fine.
//!
//! The master has no worker of its own here; an honest one comes when the others have done their
//! worst, so that nothing depends on who is faster.

use std::{net::SocketAddr, time::Duration};

use gridlight::{
    key::KeyFile,
    master::{Finished, Master, Running},
    oiio::{assert_finite, pixel_hash},
    peer::{Peer, PeerFrame, hello},
    programs::allow_open_files,
    worker::Worker,
};
use protocol::{
    Component, FrameId, Task, ToMaster, ToWorker,
    envelope::encode,
    limits,
    message::{Hello, Message as _, Pong, Request, TaskResult},
    secure::Caller,
};

const WORK: &str = "--paper --size 128x96 --vpls 64 --vpl-sets 4 --spp 4 --local-slots 0 --pixels exact";

/// A frame that waits for workers.
fn start(flags: &str) -> Running {
    // The same bits whoever renders, with a deadline or without.
    Master::new(&format!("{WORK} {flags}")).start()
}

/// Lets an honest worker do the work, which must then be there: complete, in time, and the same bits
/// as without the others.
#[track_caller]
fn assert_fine(master: Running) {
    let worker = Worker::start("honest", master.address(), 2);
    assert_fine_with(master, worker);
}

#[track_caller]
fn assert_fine_with(master: Running, _honest: Worker) -> Finished {
    let deadline = Duration::from_secs(12);
    let picture = master.finish();
    picture.assert_in_time(deadline);
    assert_undisturbed(&picture);
    picture
}

#[track_caller]
fn assert_undisturbed(picture: &Finished) {
    assert_finite(picture.exr());
    assert!(picture.is_whole(), "{}", picture.log);
    assert_eq!(pixel_hash(picture.exr()), undisturbed(), "{}", picture.log);
}

/// The picture when nobody disturbs.
fn undisturbed() -> String {
    let master = start("--no-deadline");
    let _worker = Worker::start("honest", master.address(), 2);
    let picture = master.finish();
    picture.assert_code(0);
    pixel_hash(picture.exr())
}

/// With a deadline there is the same promise to keep, and no task may be issued twice: nobody who lies
/// below has been given one.
const IN_TIME: &str = "--deadline 12";

#[test]
fn garbage_before_the_handshake_is_refused() {
    let master = start(IN_TIME);
    let address = master.address();
    let long = vec![0xc1; 100_000];
    for bytes in [
        b"GET / HTTP/1.1\r\nHost: gridlight\r\n\r\n".as_slice(),
        b"SSH-2.0-OpenSSH_9.2\r\n",
        &[0; 64],
        &[0xff; 64],
        &long,
    ] {
        refused(&master, address, bytes, "");
    }
    assert_fine(master);
}

#[test]
fn a_length_of_4_gb_is_refused_before_a_byte_of_it_has_come() {
    let master = start(IN_TIME);
    refused(
        &master,
        master.address(),
        &[0xff, 0xff, 0xff, 0xff],
        "4294967295 bytes was announced",
    );
    assert_fine(master);
}

#[test]
fn a_length_just_above_the_limit_of_a_hello_is_refused() {
    let master = start(IN_TIME);
    let length = limits::HANDSHAKE_ENVELOPE_BYTES + 1;
    refused(&master, master.address(), &length.to_be_bytes(), "was announced");
    assert_fine(master);
}

#[test]
fn half_an_envelope_is_refused() {
    let master = start(IN_TIME);
    let whole = encode(&ToMaster::Hello(hello("half"))).expect("a hello");
    let mut peer = Peer::connect(master.address());
    peer.send_bytes(&whole[..whole.len() / 2]);
    drop(peer);
    master.log.wait_for(&["a peer was sent away"]);
    assert_fine(master);
}

#[test]
fn who_says_nothing_is_sent_away_after_the_time_for_a_handshake() {
    let master = start(IN_TIME);
    let silent = Peer::connect(master.address());
    assert_eq!(silent.until_closed(), []);
    master.log.wait_for(&["did not introduce itself"]);
    assert_fine(master);
}

#[test]
fn another_version_or_program_is_refused_in_words() {
    let master = start(IN_TIME);
    let hellos: [fn(Hello) -> Hello; 2] = [
        |hello| Hello {
            protocol: 99,
            ..hello
        },
        |hello| Hello {
            magic: "torrent".to_owned(),
            ..hello
        },
    ];
    for (change, word) in hellos.into_iter().zip(["protocol 99", "not a Gridlight worker"]) {
        let mut peer = Peer::connect(master.address());
        peer.send(&ToMaster::Hello(change(hello("stranger"))));
        let answer = peer.until_closed();
        let [ToWorker::Refused(refused)] = answer.as_slice() else {
            panic!("{answer:?}");
        };
        assert!(refused.reason.contains(word), "{}", refused.reason);
        master.log.wait_for(&["a peer was sent away", word]);
    }
    assert_fine(master);
}

#[test]
fn who_does_not_begin_with_a_hello_is_refused() {
    let master = start(IN_TIME);
    let mut peer = Peer::connect(master.address());
    peer.send(&ToMaster::Pong(Pong { nonce: 0 }));
    assert_eq!(peer.until_closed(), []);
    master.log.wait_for(&["not a `hello`"]);
    assert_fine(master);
}

#[test]
fn a_name_of_a_megabyte_is_refused() {
    let master = start(IN_TIME);
    let name = [&b"\xdb\x00\x10\x00\x00"[..], &vec![b'x'; 1 << 20]].concat();
    let hello = [&b"\x81\xa5hello\x81\xa4name"[..], &name].concat();
    let envelope = [&(hello.len() as u32).to_be_bytes(), &hello[..]].concat();
    refused(&master, master.address(), &envelope, "was announced");
    assert_fine(master);
}

#[test]
fn too_many_connections_from_one_address_keep_nobody_out_and_the_oldest_is_closed() {
    let master = start(IN_TIME);
    let address = master.address();
    allow_open_files(2 * limits::STRANGERS_PER_ADDRESS);
    let crowd: Vec<Peer> = (0..=limits::STRANGERS_PER_ADDRESS)
        .map(|_| Peer::connect(address))
        .collect();
    master
        .log
        .wait_for(&["too many peers", "127.0.0.1", "limit=1024"]);
    assert_fine(master);
    drop(crowd);
}

/// A frame to which only those may come who have the key.
fn start_with_key(key: &KeyFile) -> Running {
    let flags = format!("{WORK} {IN_TIME}");
    Master::new(&flags).flag("--key", key.path()).start()
}

/// Lets an honest worker with the key do the work; each of those before it must have had one line.
#[track_caller]
fn assert_fine_with_key(master: Running, key: &KeyFile, refusals: usize) {
    let worker = Worker::start_with_key("honest", master.address(), 2, key.path());
    let log = assert_fine_with(master, worker).log;
    assert_eq!(log.matches("a peer was sent away").count(), refusals, "{log}");
}

/// What a master says to a peer whom it does not let in.
#[track_caller]
fn refusal(peer: Peer) -> String {
    match peer.until_closed().as_slice() {
        [ToWorker::Refused(refused)] => refused.reason.clone(),
        other => panic!("no refusal: {other:?}"),
    }
}

#[test]
fn who_does_not_have_the_key_is_refused_with_one_line() {
    let (key, other) = (KeyFile::make(), KeyFile::make());
    let master = start_with_key(&key);
    let address = master.address();

    let mut peer = Peer::connect(address);
    peer.send_bytes(&Caller::call(other.key()).expect("a call").1);
    assert!(refusal(peer).contains("key is not the master's"), "another key");
    master
        .log
        .wait_for(&["a peer was sent away", "key is not the master's"]);

    let mut peer = Peer::connect(address);
    peer.send(&ToMaster::Hello(hello("keyless")));
    assert!(
        refusal(peer).contains("only workers with this master's key"),
        "no key"
    );
    master
        .log
        .wait_for(&["a peer was sent away", "only workers with this master's key"]);

    let mut peer = Peer::connect(address);
    peer.send(&ToMaster::Hello(Hello {
        protocol: 1,
        ..hello("old and keyless")
    }));
    assert!(
        refusal(peer).contains("protocol 1"),
        "an old version without a key"
    );
    master.log.wait_for(&["a peer was sent away", "protocol 1"]);

    let mut peer = Peer::connect(address);
    peer.send_bytes(b"GLN\x02");
    peer.send_bytes(&[0; 48]);
    assert!(
        refusal(peer).contains("channels of another version"),
        "another channel"
    );
    master
        .log
        .wait_for(&["a peer was sent away", "channels of another version"]);

    assert_fine_with_key(master, &key, 4);
}

#[test]
fn who_has_the_key_but_another_version_is_refused_in_words() {
    let key = KeyFile::make();
    let master = start_with_key(&key);
    let mut peer = Peer::connect_with_key(master.address(), key.key());
    peer.send(&ToMaster::Hello(Hello {
        protocol: 1,
        ..hello("old")
    }));
    assert!(refusal(peer).contains("protocol 1"));
    assert_fine_with_key(master, &key, 1);
}

#[test]
fn a_recorded_hello_cannot_be_repeated() {
    let key = KeyFile::make();
    let master = start_with_key(&key);
    let mut peer = Peer::connect_with_key(master.address(), key.key());
    peer.send(&ToMaster::Hello(hello("recorded")));
    assert!(matches!(peer.receive(), Some(ToWorker::Welcome(_))));

    let mut again = Peer::connect(master.address());
    again.send_bytes(&peer.recorded());
    master
        .log
        .wait_for(&["a peer was sent away", "forged or a repetition"]);
    assert_fine_with_key(master, &key, 1);
}

#[test]
fn who_stalls_while_a_channel_is_opened_is_sent_away_after_the_time_for_a_handshake() {
    let key = KeyFile::make();
    let master = start_with_key(&key);
    let call = Caller::call(key.key()).expect("a call").1;
    let mut half = Peer::connect(master.address());
    half.send_bytes(&call[..20]);
    // The master has answered this one, and waits for its hello.
    let answered = Peer::connect_with_key(master.address(), key.key());
    assert_eq!((half.until_closed(), answered.until_closed()), (vec![], vec![]));
    master.log.wait_for(&["did not introduce itself"]);
    assert_fine_with_key(master, &key, 2);
}

#[test]
fn a_worker_that_is_refused_for_its_key_says_what_to_do_and_stays() {
    let (key, other) = (KeyFile::make(), KeyFile::make());
    let master = start_with_key(&key);
    let address = master.address();
    let mut wrong = Worker::start_with_key("wrong", address, 1, other.path());
    let line = wrong.log.wait_for(&["key is not the master's"]);
    for part in [&other.key().fingerprint(), "copy", "--key", "trying again"] {
        assert!(line.contains(part), "{part:?} is not in {line}");
    }
    let mut none = Worker::start("none", address, 1);
    let line = none.log.wait_for(&["only workers with this master's key"]);
    assert!(line.contains("--key") && line.contains("trying again"), "{line}");
    for worker in [&mut wrong, &mut none] {
        worker.signal("TERM");
        assert!(worker.wait().success());
    }

    let honest = Worker::start_with_key("honest", address, 2, key.path());
    assert_fine_with(master, honest);
}

#[test]
fn while_keys_are_changed_over_either_key_lets_in() {
    let (old, new, other) = (KeyFile::make(), KeyFile::make(), KeyFile::make());
    let both = KeyFile::of(&[new.key(), old.key()]);
    let master = start_with_key(&both);
    for key in [&old, &new] {
        let mut peer = Peer::connect_with_key(master.address(), key.key());
        peer.send(&ToMaster::Hello(hello("either")));
        assert!(matches!(peer.receive(), Some(ToWorker::Welcome(_))));
    }
    // A worker's second key counts, too, once the first was refused.
    assert_fine_with_key(master, &KeyFile::of(&[other.key(), old.key()]), 1);
}

#[test]
fn garbage_after_the_handshake_is_refused() {
    let master = start("--no-deadline");
    let envelope = |payload: &[u8]| [&(payload.len() as u32).to_be_bytes(), payload].concat();
    for bytes in [
        envelope(b"\xc1garbage"),
        envelope(b"\x81\xa3lie\x80"),
        vec![0xff; 4],
    ] {
        let (mut peer, _) = Peer::with_tasks(master.address(), "babbler");
        peer.send_bytes(&bytes);
        peer.until_closed();
    }
    master.log.wait_for(&["a worker is gone", "babbler"]);
    assert_untouched(master);
}

/// Sends bytes in the place of a hello, and sees the connection closed with a line in the log.
#[track_caller]
fn refused(master: &Running, address: SocketAddr, bytes: &[u8], word: &str) {
    let mut peer = Peer::connect(address);
    peer.send_bytes(bytes);
    assert_eq!(peer.until_closed(), []);
    master.log.wait_for(&["a peer was sent away", word]);
}

/// Without a deadline the tasks of a liar are given to others: nothing of what it said may remain.
#[track_caller]
fn assert_untouched(master: Running) {
    let _worker = Worker::start("honest", master.address(), 2);
    let picture = master.finish();
    picture.assert_code(0);
    assert_undisturbed(&picture);
}

/// Lets a peer that has tasks say one thing, for which it must be sent away.
#[track_caller]
fn caught(what: &str, word: &str, lie: impl FnOnce(&mut Peer, &PeerFrame)) {
    let master = start("--no-deadline");
    let (mut peer, frame) = Peer::with_tasks(master.address(), "liar");
    lie(&mut peer, &frame);
    peer.until_closed();
    let line = master.log.wait_for(&["liar", "why="]);
    assert!(line.contains(word), "{what}: {word:?} is not in {line}");
    assert_untouched(master);
}

fn say(result: TaskResult) -> impl FnOnce(&mut Peer, &PeerFrame) {
    move |peer, _| peer.send(&ToMaster::Result(result))
}

#[test]
fn a_result_for_a_task_that_it_never_had_is_refused() {
    caught("another's task", "group 63", |peer, frame| {
        let task = Task {
            component: Component::Indirect,
            group: 63,
            index: 3,
            passes: 1,
        };
        assert!(!frame.tasks.contains(&task));
        say(frame.result(task, frame.pixels_per_task(), 9.0))(peer, frame);
    });
}

#[test]
fn a_result_for_a_task_that_does_not_exist_is_refused() {
    caught("no such group", "group 1000", |peer, frame| {
        let task = Task {
            component: Component::Direct,
            group: 1000,
            index: 0,
            passes: 1,
        };
        say(frame.result(task, frame.pixels_per_task(), 9.0))(peer, frame);
    });
}

#[test]
fn the_same_result_twice_is_refused() {
    caught("twice", "", |peer, frame| {
        let result = frame.result(frame.tasks[0], 0, 0.0);
        for _ in 0..2 {
            peer.send(&ToMaster::Result(result.clone()));
        }
    });
}

#[test]
fn a_result_that_is_no_beginning_of_its_group_is_refused() {
    for pixels in [1, 7, 100_000] {
        caught("a wrong size", "", |peer, frame| {
            say(frame.result(frame.tasks[0], pixels, 9.0))(peer, frame);
        });
    }
}

#[test]
fn a_result_that_says_more_pixels_than_it_has_is_refused() {
    caught("a false count", "result.radiance", |peer, frame| {
        let honest = ToMaster::Result(frame.result(frame.tasks[0], 2, 9.0));
        let mut bytes = encode(&honest).expect("a message within the limits");
        let name = b"\xa6pixels";
        let place = bytes.windows(name.len()).position(|window| window == name);
        bytes[place.expect("the field is there") + name.len()] = 3;
        peer.send_bytes(&bytes);
    });
}

#[test]
fn a_result_that_is_no_number_is_refused() {
    for value in [f32::NAN, f32::INFINITY] {
        caught("no number", "", |peer, frame| {
            say(frame.result(frame.tasks[0], frame.pixels_per_task(), value))(peer, frame);
        });
    }
}

#[test]
fn nobody_gets_more_tasks_than_a_worker_may_hold() {
    let master = start("--no-deadline");
    let (mut peer, frame) = Peer::with_tasks(master.address(), "glutton");
    peer.send(&ToMaster::Request(Request {
        frame: frame.id,
        tasks: 4 * limits::LEASES_PER_SLOT,
    }));
    // Ends the conversation, so that all that was assigned before can be counted.
    peer.send(&ToMaster::Hello(hello("glutton")));
    let more = peer.until_closed().into_iter().map(|message| match message {
        ToWorker::Assign(assign) => assign.tasks.len(),
        _ => 0,
    });
    let held = frame.tasks.len() + more.sum::<usize>();
    assert!(held <= limits::LEASES_PER_SLOT as usize, "{held} tasks");
    assert_untouched(master);
}

#[test]
fn a_second_hello_is_refused() {
    caught("a second hello", "hello", |peer, _| {
        let hello = ToMaster::Hello(hello("liar"));
        assert_eq!(hello.name(), "hello");
        peer.send(&hello);
    });
}

#[test]
fn results_of_another_frame_are_dropped_without_complaint() {
    let master = start("--no-deadline");
    let (mut peer, frame) = Peer::with_tasks(master.address(), "dreamer");
    let result = TaskResult {
        frame: FrameId(77),
        ..frame.result(frame.tasks[0], frame.pixels_per_task(), 9.0)
    };
    peer.send(&ToMaster::Result(result));
    drop(peer);
    assert_untouched(master);
}
