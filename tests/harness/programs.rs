//! The executables beside the running test, signals to them, and what is said when a test is skipped.

use std::{
    env,
    io::Write as _,
    path::{Path, PathBuf},
    process::Command,
};

/// The project's folder.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// An executable of the workspace, built for the same profile as the running test.
pub fn program(name: &str) -> PathBuf {
    let test = env::current_exe().expect("a running test has a path");
    // target/<profile>/deps/<test>
    let folder = test
        .ancestors()
        .nth(2)
        .expect("tests are built into a folder of cargo's");
    let program = folder.join(name);
    assert!(
        program.is_file(),
        "{} is not built. The end-to-end tests start the programs: run `cargo test --workspace`, or \
         `cargo build -p master -p worker -p eval` before testing this package alone",
        program.display()
    );
    program
}

/// Lets this process have so many open files at a time.
pub fn allow_open_files(count: usize) {
    let allowed = Command::new("prlimit")
        .args(["--pid", &std::process::id().to_string()])
        .arg(format!("--nofile={count}:"))
        .status();
    assert!(allowed.expect("`prlimit` is on every Linux").success());
}

/// Sends a signal, by its name as `kill` knows it. A process that is gone gets none.
pub fn signal(process: u32, name: &str) {
    let sent = Command::new("kill")
        .args(["-s", name, &process.to_string()])
        .output();
    sent.expect("`kill` is on every Unix");
}

/// The same command line as another's, begun by a program that runs the rest of its own arguments.
pub fn begun_by(program: &str, arguments: &[&str], command: &Command) -> Command {
    let mut whole = Command::new(program);
    whole.args(arguments).arg(command.get_program());
    whole.args(command.get_args());
    whole
}

/// The processes that a process has started and that are still there.
pub fn children(process: u32) -> Vec<u32> {
    let threads = std::fs::read_dir(format!("/proc/{process}/task"));
    let lists = threads.into_iter().flatten().flatten().map(|thread| {
        let list = std::fs::read_to_string(thread.path().join("children"));
        list.unwrap_or_default()
    });
    let numbers = |list: String| -> Vec<u32> { list.split_whitespace().flat_map(str::parse).collect() };
    lists.flat_map(numbers).collect()
}

/// Says aloud that something was not tested; past cargo's capture, which hides what passes.
pub fn skipped(what: &str, why: &str) {
    let line = format!("SKIPPED: {what}: {why}\n");
    std::io::stderr()
        .write_all(line.as_bytes())
        .expect("standard error takes a line");
}
