//! The worker as systemd runs it: the unit is read, and its command and environment are what is started.

use std::collections::HashMap;
use std::fs;
use std::io::{self, Write as _};
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use tempfile::TempDir;

use super::scripted::Master;
use super::{Worker, output_of};

/// A life sign is wanted this much more often than in the unit, so that a test need not wait.
const HURRY: u32 = 30;

fn deploy(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../deploy/systemd")
        .join(file)
}

/// The settings of the unit's `[Service]`; of those that are there twice, the last.
fn service() -> HashMap<String, String> {
    let unit = fs::read_to_string(deploy("gridlight-worker.service")).unwrap();
    let (_, service) = unit.split_once("[Service]").unwrap();
    let lines = service.lines().take_while(|line| !line.starts_with('['));
    let settings = lines
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.split_once('='));
    settings
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect()
}

/// A machine with the unit's files, for one test.
struct Machine {
    folder: TempDir,
    notify: UnixDatagram,
}

impl Machine {
    /// With the shipped worker.toml, but for where the master is and when to work: nobody knows whether
    /// somebody uses the machine of a test.
    fn new(master: &Master) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let shipped = fs::read_to_string(deploy("worker.toml")).unwrap();
        let text = shipped.replace("gridlight-master:7420", &master.address.to_string());
        let text = text.replace("when = \"idle\"", "when = \"always\"\nslots = 1");
        fs::write(folder.path().join("worker.toml"), text).unwrap();
        let notify = UnixDatagram::bind(folder.path().join("notify")).unwrap();
        notify.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        Self { folder, notify }
    }

    /// Starts what the unit starts.
    fn start(&self) -> Worker {
        let service = service();
        let folder = self.folder.path();
        let etc = folder.to_str().unwrap();
        let mut words = service["ExecStart"].split_whitespace();
        assert_eq!(words.next(), Some("/usr/bin/gridlight-worker"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_worker"));
        command.env_clear();
        command.args(words.map(|word| word.replace("/etc/gridlight", etc)));
        for (setting, variable) in [
            ("RuntimeDirectory", "RUNTIME_DIRECTORY"),
            ("StateDirectory", "STATE_DIRECTORY"),
            ("CacheDirectory", "CACHE_DIRECTORY"),
        ] {
            let made = folder.join(variable).join(&service[setting]);
            fs::create_dir_all(&made).unwrap();
            command.env(variable, made);
        }
        let watchdog = Duration::from_secs(service["WatchdogSec"].parse().unwrap()) / HURRY;
        command.env("WATCHDOG_USEC", watchdog.as_micros().to_string());
        command.env("NOTIFY_SOCKET", folder.join("notify"));
        Worker::spawn(&mut command)
    }

    /// Waits until the worker has told the service manager this.
    fn hear(&self, wanted: &str) {
        let mut bytes = [0; 4096];
        loop {
            let count = self
                .notify
                .recv(&mut bytes)
                .expect("the worker says something in time");
            let text = String::from_utf8_lossy(&bytes[..count]);
            if text.lines().any(|line| line == wanted) {
                return;
            }
        }
    }
}

#[tokio::test]
async fn as_its_unit_starts_it_a_worker_is_ready_alive_and_at_work() {
    assert_eq!(service()["Type"], "notify");
    let master = Master::listen().await;
    let machine = Machine::new(&master);
    let worker = machine.start();
    machine.hear("READY=1");
    machine.hear("STATUS=1 slots");
    for _ in 0..3 {
        machine.hear("WATCHDOG=1");
    }
    master.join().await;
    let control = machine
        .folder
        .path()
        .join("RUNTIME_DIRECTORY/gridlight-worker/control.sock");
    assert!(control.exists());
    drop(worker);
}

#[test]
fn the_shipped_configuration_renders_only_while_nobody_uses_the_machine() {
    let settings = worker::settings::Settings::read(&deploy("worker.toml")).unwrap();
    assert_eq!(settings.policy().when, worker::manners::When::Idle);
    assert!(settings.policy().follow_load && settings.connect.is_some());
}

/// Runs `systemd-analyze` on the unit, with the built program in the place of the installed one.
fn analyze(arguments: &[&str]) -> Option<Output> {
    let folder = tempfile::tempdir().unwrap();
    let unit = fs::read_to_string(deploy("gridlight-worker.service")).unwrap();
    let file = folder.path().join("gridlight-worker.service");
    fs::write(
        &file,
        unit.replace("/usr/bin/gridlight-worker", env!("CARGO_BIN_EXE_worker")),
    )
    .unwrap();
    let run = Command::new("systemd-analyze")
        .args(arguments)
        .arg(&file)
        .output();
    match run {
        Ok(output) => Some(output),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            // Past cargo's capture, which hides what passes.
            let line = format!("SKIPPED: systemd-analyze {arguments:?}: it is not installed\n");
            io::stderr().write_all(line.as_bytes()).unwrap();
            None
        }
        Err(error) => panic!("systemd-analyze: {error}"),
    }
}

#[test]
fn systemd_finds_no_fault_in_the_unit() {
    let Some(output) = analyze(&["verify", "--man=no"]) else {
        return;
    };
    let said = output_of(&output);
    assert!(output.status.success() && said.is_empty(), "{said}");
}

#[test]
fn systemd_rates_the_unit_as_well_protected() {
    // In tenths: exposure of at most 2.5.
    let arguments = ["security", "--offline=true", "--threshold=25", "--no-pager"];
    let Some(output) = analyze(&arguments) else { return };
    assert!(output.status.success(), "{}", output_of(&output));
}
