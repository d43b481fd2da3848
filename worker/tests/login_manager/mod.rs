//! A worker that renders only while nobody is there, on a machine whose login manager says what a test
//! wants: a real D-Bus of its own, with this process in the place of logind.

use std::io::{self, BufRead as _, BufReader, Write as _};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use protocol::message::Ping;
use protocol::{ToMaster, ToWorker};
use tokio::time::sleep;

use super::Worker;
use super::scripted::Master;

/// A bus; ends with the test.
struct Bus {
    daemon: Child,
    address: String,
}

impl Bus {
    /// `None`, said aloud, if there is no D-Bus on this machine.
    fn start() -> Option<Self> {
        let arguments = ["--session", "--nofork", "--nopidfile", "--print-address=1"];
        let daemon = Command::new("dbus-daemon")
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn();
        let Ok(mut daemon) = daemon else {
            io::stderr()
                .write_all(b"SKIPPED: idle by the login manager: there is no dbus-daemon\n")
                .unwrap();
            return None;
        };
        let mut address = String::new();
        BufReader::new(daemon.stdout.take().unwrap())
            .read_line(&mut address)
            .unwrap();
        let address = address.trim().to_owned();
        Some(Self { daemon, address })
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        let _ = self.daemon.kill();
        let _ = self.daemon.wait();
    }
}

/// Since when everybody is away, in microseconds since 1970; 0: somebody is there.
struct LoginManager(Arc<AtomicU64>);

#[zbus::interface(name = "org.freedesktop.login1.Manager")]
impl LoginManager {
    #[zbus(property)]
    fn idle_hint(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }

    #[zbus(property)]
    fn idle_since_hint(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

#[expect(
    clippy::disallowed_methods,
    reason = "what the login manager of a real machine says"
)]
fn an_hour_ago() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    now.as_micros() as u64 - 3_600_000_000
}

#[tokio::test]
async fn while_everybody_is_away_a_worker_works_and_when_somebody_is_back_it_leaves() {
    let Some(bus) = Bus::start() else { return };
    let away_since = Arc::new(AtomicU64::new(0));
    let _manager = zbus::connection::Builder::address(bus.address.as_str())
        .unwrap()
        .name("org.freedesktop.login1")
        .unwrap()
        .serve_at("/org/freedesktop/login1", LoginManager(Arc::clone(&away_since)))
        .unwrap()
        .build()
        .await
        .unwrap();
    let master = Master::listen().await;
    let mut command = Command::new(env!("CARGO_BIN_EXE_worker"));
    command.args([
        "--connect",
        &master.address.to_string(),
        "--slots",
        "1",
        "--when",
        "idle",
    ]);
    // The machine of a test is not idle: others build and test on it.
    command.args(["--idle-load", "1000"]);
    let worker = Worker::spawn(command.env("DBUS_SYSTEM_BUS_ADDRESS", &bus.address));
    worker.line_with("no slot works for now");

    away_since.store(an_hour_ago(), Ordering::Relaxed);
    let (mut peer, _) = master.join().await;
    away_since.store(0, Ordering::Relaxed);
    let reason = loop {
        // A master that says nothing is left for that reason.
        peer.say(ToWorker::Ping(Ping { nonce: 7 })).await;
        match peer.hear().await {
            ToMaster::Leaving(leaving) => break leaving.reason,
            _ => sleep(Duration::from_millis(100)).await,
        }
    };
    assert!(reason.contains("needed by others"), "{reason}");
    worker.line_with("somebody used the machine 0 s ago");
}
