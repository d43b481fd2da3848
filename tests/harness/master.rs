//! A `master` process: started with flags, watched from outside, judged by what it leaves.

use std::{
    ffi::OsStr,
    fs,
    io::Read as _,
    net::SocketAddr,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Stdio},
    sync::{Mutex, MutexGuard, PoisonError, mpsc},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value;
use tempfile::TempDir;

use crate::{
    log::Log,
    network::Host,
    pixels::Pixels,
    programs::{begun_by, children, program, root, signal},
};

/// Only one frame is rendered at a time: its deadline is a matter between it and the whole machine.
static MACHINE: Mutex<()> = Mutex::new(());

/// So much too late may a picture come in these tests: the machine that runs them may have other work.
/// bench/deadline measures the promise itself, beside a known load.
const LATE: Duration = Duration::from_millis(100);
/// Exit code of a picture that came after its deadline.
const CAME_LATE: i32 = 6;

/// A command line that is not yet run. The picture and the report go into a folder of their own.
#[derive(Debug)]
pub struct Master {
    command: Command,
    folder: TempDir,
    out: PathBuf,
    report: PathBuf,
}

impl Master {
    /// The default scene with these flags, which are separated by spaces.
    pub fn new(flags: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("picture.exr");
        let report = folder.path().join("report.json");
        let mut command = Command::new(program("master"));
        command.arg("-v").args(flags.split_whitespace());
        Self {
            command,
            folder,
            out,
            report,
        }
    }

    /// A scene other than the Cornell box.
    #[must_use]
    pub fn scene(self, path: impl AsRef<OsStr>) -> Self {
        self.flag("--scene", path)
    }

    /// A flag whose value may hold spaces.
    #[must_use]
    pub fn flag(mut self, name: &str, value: impl AsRef<OsStr>) -> Self {
        self.command.arg(name).arg(value);
        self
    }

    /// A place for the picture other than the test's own folder.
    #[must_use]
    pub fn out(mut self, path: impl Into<PathBuf>) -> Self {
        self.out = path.into();
        self
    }

    /// Lets no file grow beyond so many KiB, as on a full disk.
    #[must_use]
    pub fn with_files_up_to(mut self, kib: u32) -> Self {
        // The signal that comes with the limit is ignored, so that the write fails as any other;
        // bash counts in units of 1024 bytes.
        let script = format!("trap '' XFSZ; ulimit -f {kib}; exec \"$0\" \"$@\"");
        self.command = begun_by("bash", &["-c", &script], &self.command);
        self
    }

    /// Runs on another host.
    #[must_use]
    pub fn on(mut self, host: &Host) -> Self {
        self.command = host.command(&self.command);
        self
    }

    /// Runs to the end.
    pub fn run(self) -> Finished {
        self.start().finish()
    }

    /// Runs to the end, which must be a delivered picture.
    #[track_caller]
    pub fn deliver(self) -> Finished {
        let finished = self.run();
        finished.assert_code(0);
        finished
    }

    /// Starts, and does not wait.
    pub fn start(mut self) -> Running {
        let machine = MACHINE.lock().unwrap_or_else(PoisonError::into_inner);
        self.command
            .arg("--out")
            .arg(&self.out)
            .arg("--report")
            .arg(&self.report);
        self.command
            .current_dir(root())
            .env_remove("RUST_LOG")
            .env_remove("GRIDLIGHT_KEY")
            .env("RUST_BACKTRACE", "1");
        self.command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let begun = Instant::now();
        let mut child = self.command.spawn().expect("the program starts");
        Running {
            process: child.id(),
            given_up: GivenUp(Some(child.id())),
            log: Log::follow(child.stderr.take().expect("standard error is a pipe")),
            end: wait_on_a_thread(child, begun),
            begun,
            files: Files {
                folder: self.folder,
                out: self.out,
                report: self.report,
            },
            machine,
        }
    }
}

/// What was seen at the end of the process.
#[derive(Debug)]
struct End {
    status: ExitStatus,
    wall: Duration,
    stdout: String,
}

/// The end is noticed when it happens, whatever the test does meanwhile.
fn wait_on_a_thread(mut child: Child, begun: Instant) -> mpsc::Receiver<End> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        let mut stdout = String::new();
        if let Some(mut pipe) = child.stdout.take() {
            pipe.read_to_string(&mut stdout).expect("standard output is text");
        }
        let status = child.wait().expect("a child can be waited for");
        let wall = begun.elapsed();
        // If nobody listens any more the test has given up.
        let _ = sender.send(End { status, wall, stdout });
    });
    receiver
}

/// Where things are put.
#[derive(Debug)]
struct Files {
    /// Kept while something in it may be looked at.
    folder: TempDir,
    out: PathBuf,
    report: PathBuf,
}

/// A process that renders.
#[derive(Debug)]
pub struct Running {
    /// Its number.
    pub process: u32,
    /// What it says.
    pub log: Log,
    end: mpsc::Receiver<End>,
    begun: Instant,
    files: Files,
    given_up: GivenUp,
    machine: MutexGuard<'static, ()>,
}

/// Kills a process that nobody will wait for any more, because the test has failed.
#[derive(Debug)]
struct GivenUp(Option<u32>);

impl Drop for GivenUp {
    fn drop(&mut self) {
        if let Some(process) = self.0 {
            signal(process, "KILL");
        }
    }
}

impl Running {
    /// Where workers may connect.
    #[track_caller]
    pub fn address(&self) -> SocketAddr {
        let line = self.log.wait_for(&["workers may connect", "address="]);
        let address = line
            .split("address=")
            .nth(1)
            .and_then(|rest| rest.split_whitespace().next());
        address
            .and_then(|address| address.parse().ok())
            .expect("the address is printed")
    }

    /// The worker that it started, if it is there.
    pub fn local_worker(&self) -> Option<u32> {
        children(self.process).first().copied()
    }

    /// Time since the start.
    pub fn age(&self) -> Duration {
        self.begun.elapsed()
    }

    /// Sleeps until so long after the start.
    pub fn sleep_until(&self, since_start: Duration) {
        thread::sleep(since_start.saturating_sub(self.begun.elapsed()));
    }

    /// Whether it is still there, so long after its start.
    pub fn is_running(&self) -> bool {
        Path::new(&format!("/proc/{}/fd/2", self.process)).exists()
    }

    /// Sends a signal.
    pub fn signal(&self, name: &str) {
        signal(self.process, name);
    }

    /// Waits for the end.
    pub fn finish(mut self) -> Finished {
        let end = self.end.recv().expect("the end is always noticed");
        self.given_up.0 = None;
        let log = self.log.whole();
        drop(self.machine);
        let report = fs::read_to_string(&self.files.report).ok();
        Finished {
            code: end.status.code(),
            wall: end.wall,
            stdout: end.stdout,
            log,
            report: report.map(|text| serde_json::from_str(&text).expect("the report is JSON")),
            files: self.files,
        }
    }
}

/// A process that has ended, and what it left.
#[derive(Debug)]
pub struct Finished {
    /// Exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// From before the start until after the end.
    pub wall: Duration,
    /// All of standard output.
    pub stdout: String,
    /// All of standard error.
    pub log: String,
    report: Option<Value>,
    files: Files,
}

impl Finished {
    /// The EXR, whether it is there or not.
    pub fn exr(&self) -> &Path {
        &self.files.out
    }

    /// The PNG beside it.
    pub fn png(&self) -> PathBuf {
        self.files.out.with_extension("png")
    }

    /// The pixels of the EXR.
    #[track_caller]
    pub fn pixels(&self) -> Pixels {
        Pixels::read(self.exr())
    }

    /// The names of all that is in the folder of the picture, sorted, but for the report.
    pub fn left_behind(&self) -> Vec<String> {
        let folder = self.files.out.parent().expect("a picture is in a folder");
        let mut names: Vec<String> = fs::read_dir(folder)
            .into_iter()
            .flatten()
            .flatten()
            .filter(|entry| entry.path() != self.files.report)
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// A place in the test's own folder.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.files.folder.path().join(name)
    }

    /// A value of the report, by its path as in `/tasks/direct/total`.
    #[track_caller]
    pub fn report(&self, path: &str) -> &Value {
        let report = self
            .report
            .as_ref()
            .unwrap_or_else(|| panic!("there is no report:\n{}", self.log));
        report
            .pointer(path)
            .unwrap_or_else(|| panic!("{path} is not in the report: {report:#}"))
    }

    /// A number of the report.
    #[track_caller]
    pub fn number(&self, path: &str) -> f64 {
        let value = self.report(path);
        value
            .as_f64()
            .unwrap_or_else(|| panic!("{path} is {value}, no number"))
    }

    /// A whole number of the report.
    #[track_caller]
    pub fn count(&self, path: &str) -> u64 {
        let value = self.report(path);
        value
            .as_u64()
            .unwrap_or_else(|| panic!("{path} is {value}, no count"))
    }

    /// Results that are in the picture, whole or in part.
    #[track_caller]
    pub fn tasks_done(&self) -> u64 {
        let tasks = self.report("/tasks").as_object().into_iter().flatten();
        let counts = tasks.flat_map(|(_, counts)| [&counts["completed"], &counts["partial"]]);
        counts.filter_map(Value::as_u64).sum()
    }

    /// Whether all tasks of all components are there, and nothing is reconstructed.
    #[track_caller]
    pub fn is_whole(&self) -> bool {
        let tasks = self.report("/tasks").as_object().into_iter().flatten();
        let percents = self
            .report("/reconstructed_percent")
            .as_object()
            .into_iter()
            .flatten();
        let all_done = tasks
            .map(|(_, counts)| counts)
            .all(|counts| counts["completed"] == counts["total"]);
        all_done
            && percents
                .map(|(_, percent)| percent)
                .all(|percent| percent.as_f64() == Some(0.0))
    }

    /// A worker's part of the report, by the worker's name.
    #[track_caller]
    pub fn worker(&self, name: &str) -> &Value {
        let workers = self.report("/workers");
        let mut all = workers.as_array().into_iter().flatten();
        all.find(|worker| worker["name"] == name)
            .unwrap_or_else(|| panic!("no worker `{name}` in {workers:#}"))
    }

    /// Fails, with the log, unless the exit code is this one; a picture may be a little late.
    #[track_caller]
    pub fn assert_code(&self, code: i32) {
        if code == 0 && self.is_hardly_late() {
            return;
        }
        assert_eq!(self.code, Some(code), "exit code; the log:\n{}", self.log);
    }

    fn is_hardly_late(&self) -> bool {
        let has_report = self.code == Some(CAME_LATE) && self.report.is_some();
        has_report && self.number("/slack_s") >= -LATE.as_secs_f64()
    }

    /// Fails unless picture and report were there in time, by the clock of whoever waits.
    #[track_caller]
    pub fn assert_in_time(&self, deadline: Duration) {
        self.assert_code(0);
        assert!(
            self.wall <= deadline + LATE,
            "{:?} after a deadline of {deadline:?}; the log:\n{}",
            self.wall,
            self.log
        );
        assert_eq!(self.left_behind(), ["picture.exr", "picture.png"]);
    }
}
