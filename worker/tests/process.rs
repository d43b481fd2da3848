//! The program itself, as a process: how it comes, how it stays, how it goes.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

mod login_manager;
mod scripted;
mod service;

use std::collections::HashMap;
use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{SocketAddr, TcpListener};
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use protocol::envelope::encode;
use protocol::message::*;
use protocol::radiance::Encoding;
use protocol::{Component, FrameId, Task, ToMaster, ToWorker, limits};
use render::intersect::TracedScene;
use render::scene::{LoadOptions, Scene, geometry, load};
use render::{frame::FrameRenderer, vpl};
use serde_bytes::ByteBuf;
use tempfile::TempDir;
use tokio::io::AsyncWriteExt as _;
use worker::autogroup;
use worker::clock::Clock;

use self::scripted::{Master, Peer, direct, settings};

/// The program under test; killed when the test is over.
struct Worker {
    child: Child,
    lines: mpsc::Receiver<String>,
}

impl Worker {
    fn start(arguments: &[&str]) -> Self {
        Self::start_with(arguments, &[])
    }

    fn start_with(arguments: &[&str], variables: &[(&str, &Path)]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_worker"));
        Self::spawn(command.args(arguments).envs(variables.iter().copied()))
    }

    fn spawn(command: &mut Command) -> Self {
        let mut child = command
            .env_remove("RUST_LOG")
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (sender, lines) = mpsc::channel();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        thread::spawn(move || {
            stderr
                .lines()
                .map_while(Result::ok)
                .try_for_each(|line| sender.send(line))
        });
        Self { child, lines }
    }

    fn connect(address: SocketAddr, slots: u32) -> Self {
        Self::start(&[
            "--connect",
            &address.to_string(),
            "--slots",
            &slots.to_string(),
            "--name",
            "lab-7",
            // What other tests left on disk must not matter.
            "--cache-bytes",
            "0",
            "--priority",
            "ordinary",
        ])
    }

    /// The next line on standard error that has this in it.
    fn line_with(&self, part: &str) -> String {
        loop {
            let line = self
                .lines
                .recv_timeout(Duration::from_secs(20))
                .expect("the line comes");
            if line.contains(part) {
                return line;
            }
        }
    }

    fn signal(&self, name: &str) {
        let pid = self.child.id().to_string();
        assert!(
            Command::new("kill")
                .args(["-s", name, &pid])
                .status()
                .unwrap()
                .success()
        );
    }

    /// Sends a signal; says how the process ended and how long it took.
    fn ends_after(&mut self, signal: &str) -> (ExitStatus, Duration) {
        let clock = Clock::start();
        self.signal(signal);
        (self.child.wait().unwrap(), clock.now())
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn output(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_worker"))
        .args(arguments)
        .output()
        .unwrap()
}

/// All that a program said.
fn output_of(output: &Output) -> String {
    let texts = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    texts.concat()
}

/// The scene in a file of our own.
fn scene(file: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(file);
    let options = LoadOptions {
        scenes_dir: "scenes".into(),
    };
    load(&path, &options).unwrap().scene
}

fn cornell_box() -> Scene {
    scene("cornell-box/cornell-box.toml")
}

/// A port at which nobody listens.
fn closed_port() -> SocketAddr {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}

const LEAVE_WITHIN: Duration = Duration::from_millis(100);

#[test]
fn version_and_help_say_what_people_need() {
    let version = String::from_utf8(output(&["--version"]).stdout).unwrap();
    assert!(
        version.starts_with(concat!("worker ", env!("CARGO_PKG_VERSION"), " (")),
        "{version}"
    );
    let help = String::from_utf8(output(&["--help"]).stdout).unwrap();
    for part in [
        "--connect <HOST:PORT>",
        "[default: auto]",
        "--when <WHEN>",
        "Exit codes",
    ] {
        assert!(help.contains(part), "{part} is missing in:\n{help}");
    }
    assert_eq!(output(&["--connect", "nowhere"]).status.code(), Some(2));
}

#[tokio::test]
async fn a_worker_waits_for_a_master_and_says_so_once() {
    let address = closed_port();
    let mut worker = Worker::connect(address, 1);
    let line = worker.line_with("no master at");
    assert!(
        line.contains("refused") && line.contains("trying again"),
        "{line}"
    );
    thread::sleep(Duration::from_millis(700));
    assert_eq!(worker.lines.try_recv().ok(), None, "said more than once");
    let (status, time) = worker.ends_after("TERM");
    assert!(status.success() && time < LEAVE_WITHIN, "{status}, {time:?}");
}

#[tokio::test]
async fn a_host_that_does_not_exist_is_named() {
    let worker = Worker::start(&["--connect", "no-such-host.invalid:7420", "--slots", "1"]);
    worker.line_with("cannot resolve no-such-host.invalid:7420");
}

#[tokio::test]
async fn when_the_master_vanishes_the_worker_looks_for_the_next_within_100_ms() {
    let master = Master::listen().await;
    let _worker = Worker::connect(master.address, 1);
    for _ in 0..3 {
        let (peer, hello) = master.join().await;
        assert_eq!((hello.name.as_str(), hello.token), ("lab-7", None));
        drop(peer);
        let clock = Clock::start();
        drop(master.accept_bytes().await);
        assert!(clock.now() < Duration::from_millis(100), "{:?}", clock.now());
    }
}

#[tokio::test]
async fn a_refused_worker_says_why_once_and_tries_again() {
    let master = Master::listen().await;
    let worker = Worker::connect(master.address, 1);
    for _ in 0..3 {
        let mut peer = master.accept().await;
        peer.hello().await;
        let reason = "the worker is version 0.0.9, the master is version 0.1.0".to_owned();
        peer.say(ToWorker::Refused(Refused { reason })).await;
    }
    let line = worker.line_with("refuses this worker");
    assert!(line.contains("0.0.9") && line.contains("0.1.0"), "{line}");
    assert_eq!(worker.lines.try_recv().ok(), None, "said more than once");
}

#[tokio::test]
async fn a_worker_gives_up_a_master_that_says_nothing() {
    let master = Master::listen().await;
    let worker = Worker::connect(master.address, 1);
    let mut peer = master.accept().await;
    peer.hello().await;
    worker.line_with("nothing was heard");
    assert!(peer.is_closed().await);
}

/// Brings a worker with the real renderer into the middle of a frame.
async fn in_frame(master: &Master, settings: &protocol::settings::Settings) -> Peer {
    let (mut peer, _) = master.join().await;
    peer.prepare(&geometry::to_bytes(&cornell_box())).await;
    let prepared = peer.hear().await;
    assert!(
        matches!(&prepared, ToMaster::Prepared(prepared) if prepared.bvh_us > 0),
        "{prepared:?}"
    );
    let frame = Frame {
        frame: FrameId(1),
        settings: settings.clone(),
        vpl_sets: vpl_sets(settings).1,
        radiance: Encoding::Exact,
    };
    peer.say(ToWorker::Frame(frame)).await;
    peer.request().await;
    peer
}

fn traced() -> TracedScene {
    TracedScene::build(cornell_box()).unwrap()
}

/// The VPLs as a master has them, and as they are sent.
fn vpl_sets(settings: &protocol::settings::Settings) -> (Vec<vpl::VplSet>, Vec<ByteBuf>) {
    let sets = vpl::trace_sets(&traced(), &inside(settings));
    let bytes = sets.iter().map(|set| ByteBuf::from(set.to_bytes())).collect();
    (sets, bytes)
}

/// The test's settings as `render` has them.
fn inside(settings: &protocol::settings::Settings) -> render::settings::Settings {
    render::settings::Settings {
        algorithm: render::settings::Algorithm::Component,
        size: render::scene::ImageSize {
            width: settings.width,
            height: settings.height,
        },
        groups: settings.groups,
        spp: settings.spp,
        vpls: settings.vpls,
        vpl_sets: settings.vpl_sets,
        seed: settings.seed,
        geometry_clamp: settings.geometry_clamp,
        light_points: render::settings::LightPoints::PerPass,
    }
}

#[tokio::test]
async fn a_task_has_the_same_bits_from_a_worker_as_from_the_renderer_here() {
    let (settings, master) = (settings(), Master::listen().await);
    let _worker = Worker::connect(master.address, 2);
    let mut peer = in_frame(&master, &settings).await;
    let here = FrameRenderer::new(traced().into(), inside(&settings), vpl_sets(&settings).0).unwrap();

    let indirect = |group, index| Task {
        component: Component::Indirect,
        group,
        index,
        passes: 1,
    };
    peer.assign(vec![direct(1, 2), indirect(3, 0)], None).await;
    for _ in 0..2 {
        let result = peer.result().await;
        let component = match result.task.component {
            Component::Direct => render::task::Component::Direct,
            _ => render::task::Component::Indirect,
        };
        let (group, index) = (result.task.group, result.task.index);
        let task = render::task::Task {
            component,
            group,
            index,
            passes: 1,
        };
        let expected = here.render(task, &mut |left| left);
        assert_eq!(result.pixels, expected.pixels_done);
        let radiance = result.radiance.unpack();
        assert_eq!(radiance, expected.radiance);
        assert_eq!(result.shadow_rays, expected.rays.shadow);
        assert!(radiance.iter().any(|&value| value > 0.0));
    }
}

/// A machine that is busy with other tests may be late once, but not every time.
#[tokio::test]
async fn told_to_go_in_mid_task_a_worker_sends_what_it_has_and_is_gone_within_100_ms() {
    for signal in ["TERM", "INT"] {
        let mut times = Vec::new();
        while times.len() < 4 && !times.iter().any(|&time| time < LEAVE_WITHIN) {
            times.push(leaving_in_mid_task(signal).await);
        }
        assert!(
            times.iter().any(|&time| time < LEAVE_WITHIN),
            "{signal}: {times:?}"
        );
    }
}

/// How long it took from the signal to the end, once everything was sent; or for ever.
async fn leaving_in_mid_task(signal: &str) -> Duration {
    let master = Master::listen().await;
    let mut worker = Worker::connect(master.address, 2);
    let mut peer = in_frame(&master, &long_tasks()).await;
    let task = |group| Task {
        component: Component::Indirect,
        group,
        index: 0,
        passes: 1,
    };
    peer.assign((0..4).map(task).collect(), None).await;
    tokio::time::sleep(Duration::from_millis(300)).await;

    let signal_sent = signal.to_owned();
    let ended = thread::spawn(move || worker.ends_after(&signal_sent));
    let results = last_results(&mut peer, signal).await;
    drop(peer);
    let (status, time) = ended.join().unwrap();
    assert!(status.success(), "{status}");
    if results == 2 { time } else { Duration::MAX }
}

/// Counts the results that come before the worker's last word.
async fn last_results(peer: &mut Peer, signal: &str) -> u32 {
    let mut results = 0;
    loop {
        match peer.hear().await {
            ToMaster::Result(result) => {
                assert!(result.task.group < 2, "the tasks in advance were not begun");
                assert!((1..1 << 20).contains(&result.pixels), "{} pixels", result.pixels);
                results += 1;
            }
            ToMaster::Leaving(leaving) => {
                assert!(leaving.reason.contains(signal), "{}", leaving.reason);
                assert!(peer.is_closed().await);
                return results;
            }
            _ => {}
        }
    }
}

/// Embree's threads may be anywhere in the BVH when the process ends.
#[tokio::test]
async fn told_to_go_while_it_loads_a_scene_a_worker_just_goes() {
    let nave = geometry::to_bytes(&scene("nave/nave.toml"));
    for millis in [0, 20, 40, 60, 80, 120, 160, 240] {
        let master = Master::listen().await;
        let mut worker = Worker::connect(master.address, 1);
        let (mut peer, _) = master.join().await;
        peer.prepare(&nave).await;
        peer.send_scene().await;
        tokio::time::sleep(Duration::from_millis(millis)).await;
        let (status, _) = worker.ends_after("TERM");
        assert!(status.success(), "{status} after {millis} ms");
    }
}

#[tokio::test]
async fn settings_and_vpls_that_make_no_sense_are_refused_by_name() {
    let master = Master::listen().await;
    let _worker = Worker::connect(master.address, 1);
    let (mut peer, _) = master.join().await;
    peer.prepare(&geometry::to_bytes(&cornell_box())).await;
    peer.hear().await;
    let uneven = protocol::settings::Settings {
        vpls: 7,
        ..settings()
    };
    let sets = |bytes: &[u8]| vec![ByteBuf::from(bytes); 4];
    for (settings, vpl_sets, expected) in [
        (uneven, sets(&[]), "7 VPLs"),
        (settings(), sets(&[1, 2, 3]), "VPL set 0"),
        (settings(), Vec::new(), "VPL sets"),
    ] {
        peer.say(ToWorker::Frame(Frame {
            frame: FrameId(1),
            settings,
            vpl_sets,
            radiance: Encoding::Exact,
        }))
        .await;
        let failed = peer.failed().await;
        assert_eq!(failed.what, FailedStep::Frame);
        assert!(failed.message.contains(expected), "{}", failed.message);
    }
}

/// Brings a scene of several chunks to a worker of its own and says how many had to be sent.
async fn chunks_sent(cache: &Path, scene: &[u8]) -> usize {
    let master = Master::listen().await;
    let address = master.address.to_string();
    let _worker = Worker::start_with(
        &["--connect", &address, "--slots", "1", "--priority", "ordinary"],
        &[("CACHE_DIRECTORY", cache)],
    );
    let (mut peer, _) = master.join().await;
    peer.prepare(scene).await;
    let prepared = peer.hear().await;
    assert!(matches!(prepared, ToMaster::Prepared(_)), "{prepared:?}");
    peer.chunks_sent
}

#[tokio::test]
async fn a_worker_that_was_started_again_has_its_scenes_on_disk() {
    let cache = tempfile::tempdir().unwrap();
    let nave = geometry::to_bytes(&scene("nave/nave.toml"));
    let chunks = SceneRef::of(&nave).chunks.len();
    assert!(chunks > 3, "{chunks} chunks");
    assert_eq!(chunks_sent(cache.path(), &nave).await, chunks);
    assert_eq!(chunks_sent(cache.path(), &nave).await, 0);
}

#[tokio::test]
async fn after_a_broken_connection_only_the_rest_of_a_scene_is_asked_for() {
    let nave = geometry::to_bytes(&scene("nave/nave.toml"));
    let chunks = SceneRef::of(&nave).chunks.len();
    let master = Master::listen().await;
    let _worker = Worker::connect(master.address, 1);
    let (mut peer, _) = master.join().await;
    peer.prepare(&nave).await;
    for _ in 0..3 {
        let want = peer.want().await;
        peer.send_chunk(want).await;
    }
    // The next one is asked for when another one has been taken.
    peer.want().await;
    drop(peer);

    let (mut peer, _) = master.join().await;
    peer.prepare(&nave).await;
    peer.hear().await;
    assert!(peer.chunks_sent <= chunks - 2, "{} of {chunks}", peer.chunks_sent);
}

/// Sends this in place of the first chunk that a worker wants, and returns what its log says of it.
async fn refused(data: &[u8]) -> String {
    let cache = tempfile::tempdir().unwrap();
    let master = Master::listen().await;
    let address = master.address.to_string();
    let worker = Worker::start_with(
        &["--connect", &address, "--slots", "1", "--priority", "ordinary"],
        &[("CACHE_DIRECTORY", cache.path())],
    );
    let (mut peer, _) = master.join().await;
    peer.prepare(&vec![7; 300_000]).await;
    let Want { digest, chunk } = peer.want().await;
    let data = ByteBuf::from(data);
    peer.say(ToWorker::SceneChunk(SceneChunk { digest, chunk, data }))
        .await;
    let line = worker.line_with("does not talk like");
    let kept = fs::read_dir(cache.path().join("chunks")).unwrap().count();
    assert_eq!(kept, 0, "nothing of it is kept");
    line
}

#[tokio::test]
async fn a_chunk_that_would_unpack_to_a_gigabyte_is_refused() {
    let bomb = zstd::bulk::compress(&vec![0; 1 << 30], 1).unwrap();
    assert!(refused(&bomb).await.contains("cannot be unpacked"));
}

#[tokio::test]
async fn a_chunk_that_is_not_the_one_asked_for_is_refused() {
    let line = refused(&protocol::bundle::pack(&vec![8; limits::SCENE_CHUNK_BYTES])).await;
    assert!(line.contains("did not arrive as it was sent"), "{line}");
}

/// A digest is 32 bytes and nothing else, so no name of a file can be smuggled in.
#[tokio::test]
async fn a_scene_whose_name_would_lead_out_of_the_cache_is_refused() {
    let scene = SceneRef::of(b"scene");
    let mut digest = vec![0xc4, 32];
    digest.extend(scene.digest.0);
    let mut prepare = encode(&ToWorker::Prepare(Prepare { scene })).unwrap();
    let place = prepare
        .windows(digest.len())
        .position(|window| window == digest)
        .unwrap();
    let path = b"\xb1../../etc/crontab";
    prepare.splice(place..place + digest.len(), path.iter().copied());
    prepare[3] -= (digest.len() - path.len()) as u8;

    let master = Master::listen().await;
    let worker = Worker::connect(master.address, 1);
    let welcome = ToWorker::Welcome(Welcome {
        worker: protocol::WorkerId(1),
        version: "0.1.0".to_owned(),
    });
    let mut stream = master.accept_bytes().await;
    stream.write_all(&encode(&welcome).unwrap()).await.unwrap();
    stream.write_all(&prepare).await.unwrap();
    worker.line_with("not a message of this protocol");
}

/// A worker with a socket for orders in a folder of its own.
struct Controlled {
    worker: Worker,
    folder: TempDir,
}

impl Controlled {
    fn connect(address: SocketAddr) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let arguments = ["--slots", "2", "--priority", "ordinary", "--connect"];
        let mut command = Command::new(env!("CARGO_BIN_EXE_worker"));
        let command = command.args(arguments).arg(address.to_string());
        let worker = Worker::spawn(command.env("RUNTIME_DIRECTORY", folder.path()));
        Self { worker, folder }
    }

    fn socket(&self) -> PathBuf {
        self.folder.path().join("control.sock")
    }

    /// Runs `worker` with this order.
    fn order(&self, arguments: &[&str]) -> Output {
        let socket = self.socket();
        output(&[arguments, &["--socket", socket.to_str().unwrap()]].concat())
    }

    fn status(&self) -> serde_json::Value {
        serde_json::from_slice(&self.order(&["status", "--json"]).stdout).unwrap()
    }
}

/// Tasks of a minute.
fn long_tasks() -> protocol::settings::Settings {
    protocol::settings::Settings {
        width: 2048,
        height: 2048,
        groups: 4,
        vpls: 1024,
        vpl_sets: 1,
        ..settings()
    }
}

#[tokio::test]
async fn a_paused_worker_sends_what_it_has_leaves_and_is_back_when_it_may() {
    let master = Master::listen().await;
    let controlled = Controlled::connect(master.address);
    let mut peer = in_frame(&master, &long_tasks()).await;
    let task = |group| Task {
        component: Component::Indirect,
        group,
        index: 0,
        passes: 1,
    };
    peer.assign((0..4).map(task).collect(), None).await;
    tokio::time::sleep(Duration::from_millis(300)).await;

    let paused = controlled.order(&["pause", "1h"]);
    assert!(paused.status.success());
    let text = output_of(&paused);
    assert!(text.contains("0 of 2: paused for"), "{text}");
    for _ in 0..2 {
        let result = peer.result().await;
        assert!((1..1 << 20).contains(&result.pixels), "{} pixels", result.pixels);
    }
    let leaving = peer.leaving().await;
    assert!(leaving.reason.contains("needed by others"), "{}", leaving.reason);
    assert!(peer.is_closed().await);
    drop(peer);
    while controlled.status()["connected"] == true {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let status = controlled.status();
    assert_eq!(status["slots"], 0);
    assert_eq!(status["results"], 2);
    assert!(status["paused_s"].as_u64().unwrap() > 3500, "{status}");

    assert!(controlled.order(&["resume"]).status.success());
    let (_peer, _) = master.join().await;
    assert_eq!(controlled.status()["slots"], 2);
}

#[tokio::test]
async fn orders_that_make_no_sense_are_refused_and_disturb_nothing() {
    let master = Master::listen().await;
    let controlled = Controlled::connect(master.address);
    let (_peer, _) = master.join().await;
    for nonsense in [
        "hello\n".to_owned(),
        "{\"pause\":{\"seconds\":-1}}\n".to_owned(),
        "x".repeat(1 << 20),
    ] {
        let mut stream = UnixStream::connect(controlled.socket()).unwrap();
        // It may stop reading before all is written.
        let _ = stream.write_all(nonsense.as_bytes());
        let mut answer = String::new();
        let _ = BufReader::new(stream).read_line(&mut answer);
        assert!(!answer.contains("status"), "{answer}");
    }
    assert_eq!(controlled.status()["connected"], true);
}

#[tokio::test]
async fn anyone_at_the_machine_may_pause_its_worker_and_a_worker_that_ends_leaves_no_socket() {
    let master = Master::listen().await;
    let mut controlled = Controlled::connect(master.address);
    let (_peer, _) = master.join().await;
    let mode = fs::metadata(controlled.socket()).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o666);
    controlled.worker.ends_after("TERM");
    assert!(!controlled.socket().exists());
    let nobody = controlled.order(&["status"]);
    assert_eq!(nobody.status.code(), Some(1));
    let error = output_of(&nobody);
    assert!(error.contains("no worker listens at"), "{error}");
}

/// How the session of a process stands among the others, as the system shows it: `/autogroup-7 nice 0`.
fn nice_of_session(process: &str) -> String {
    fs::read_to_string(format!("/proc/{process}/autogroup")).unwrap()
}

#[test]
fn a_worker_puts_a_session_of_its_own_behind_all_others_and_leaves_that_of_others_as_it_is() {
    if !autogroup::is_known() {
        eprintln!("skipped: this system does not weigh sessions against each other");
        return;
    }
    let master = closed_port().to_string();
    let arguments = ["--connect", &master, "--slots", "1", "--cache-bytes", "0"];
    let mut command = Command::new("setsid");
    let service = Worker::spawn(command.arg(env!("CARGO_BIN_EXE_worker")).args(arguments));
    let patience = Clock::start();
    let own = service.child.id().to_string();
    while !nice_of_session(&own).trim_end().ends_with("nice 19") {
        assert!(
            patience.now() < Duration::from_secs(20),
            "{}",
            nice_of_session(&own)
        );
        thread::sleep(Duration::from_millis(10));
    }

    let before = nice_of_session("self");
    let shares = Worker::start(&arguments);
    if autogroup::are_weighed() {
        shares.line_with("`setsid`");
    }
    shares.line_with("trying again until a master is there");
    assert_eq!(nice_of_session("self"), before);
    assert_eq!(nice_of_session(&shares.child.id().to_string()), before);
}

/// The findings of `worker doctor` with these flags, by what they are about, and its exit code.
fn examined(arguments: &[&str]) -> (HashMap<String, serde_json::Value>, Option<i32>) {
    let output = output(&[&["doctor", "--json"], arguments].concat());
    let findings: Vec<serde_json::Value> = serde_json::from_slice(&output.stdout).unwrap();
    let what = |finding: &serde_json::Value| finding["what"].as_str().unwrap().to_owned();
    let by_name = findings.into_iter().map(|finding| (what(&finding), finding));
    (by_name.collect(), output.status.code())
}

#[tokio::test]
async fn the_doctor_joins_the_master_and_finds_nothing_wrong() {
    let master = Master::listen().await;
    let address = master.address.to_string();
    let examination = thread::spawn(move || examined(&["--connect", &address]));
    let (_peer, hello) = master.join().await;
    assert!(hello.name.starts_with("doctor of "), "{}", hello.name);
    let (findings, code) = examination.join().unwrap();
    assert_eq!(code, Some(0), "{findings:?}");
    let found = |what: &str| findings[what]["found"].as_str().unwrap();
    assert!(found("versions").contains("master 0.1.0"), "{findings:?}");
    assert!(found("tracing").contains("Embree 4."), "{findings:?}");
    for what in [
        "master", "priority", "session", "load", "presence", "memory", "cache", "clock",
    ] {
        assert!(findings.contains_key(what), "{what}: {findings:?}");
    }
}

#[tokio::test]
async fn the_doctor_names_what_fails_and_what_to_do() {
    let remedy = |findings: &HashMap<String, serde_json::Value>, what: &str| {
        let finding = &findings[what];
        format!("{} {}", finding["health"], finding["remedy"])
    };
    let (findings, code) = examined(&[]);
    assert_eq!(code, Some(1));
    assert!(remedy(&findings, "master").contains("--connect"), "{findings:?}");
    let (findings, code) = examined(&["--connect", "no-such-host.invalid:7420"]);
    assert_eq!(code, Some(1));
    assert!(
        remedy(&findings, "master").contains("correct the name"),
        "{findings:?}"
    );
    // That no master is there now is no fault of the worker.
    let (findings, code) = examined(&["--connect", &closed_port().to_string()]);
    assert_eq!(code, Some(0));
    assert!(
        remedy(&findings, "master").contains("start a master"),
        "{findings:?}"
    );

    let master = Master::listen().await;
    let address = master.address.to_string();
    let examination = thread::spawn(move || examined(&["--connect", &address]));
    let mut peer = master.accept().await;
    peer.hello().await;
    let reason = "the master is version 0.2.0".to_owned();
    peer.say(ToWorker::Refused(Refused { reason })).await;
    let (findings, code) = examination.join().unwrap();
    assert_eq!(code, Some(1));
    assert!(
        remedy(&findings, "versions").contains("install the same"),
        "{findings:?}"
    );
}

#[test]
fn a_configuration_that_is_wrong_ends_the_worker_with_its_line() {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(&file, "connect = 'lab-1:7420'\nwen = 'idle'\n").unwrap();
    let refused = output(&["--config", file.path().to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(1));
    let error = output_of(&refused);
    assert!(
        error.contains(":2: unknown key `wen`; did you mean `when`?"),
        "{error}"
    );
}
