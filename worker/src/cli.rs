//! The command line of `worker`.

use std::fmt::Display;
use std::fs;
use std::io::{IsTerminal as _, Write as _, stdout};
use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::error::ErrorKind;
use clap::{ArgAction, Args, CommandFactory as _, Parser, Subcommand};
use jiff::SignedDuration;
use protocol::limits;
use tracing_subscriber::EnvFilter;

use crate::clock::Clock;
use crate::control::{self, Order};
use crate::doctor::{self, Finding, Health};
use crate::exit;
use crate::options::{Lifetime, WorkerOptions};
use crate::priority::Priority;
use crate::settings::Settings;

/// The program's version and the revision it was built from.
pub const VERSION: &str = concat!(env!("GRIDLIGHT_VERSION"), " (", env!("GRIDLIGHT_REVISION"), ")");

const EXIT_CODES: &str = "\
Exit codes: 0 told to stop; 1 could not work, the last line says why; 2 wrong command line.

Scenes are kept in $CACHE_DIRECTORY, else $XDG_CACHE_HOME/gridlight, else ~/.cache/gridlight.";

/// Longest pause; who wants more writes `when = "never"`.
const PAUSE_SECONDS_MAX: u64 = 366 * 24 * 3600;

/// Renders for a Gridlight master on the cores of this machine.
///
/// Keeps trying until a master is there, and again when it is gone, until SIGTERM or Control-C. Then
/// what is done so far is sent, within a tenth of a second.
#[derive(Debug, Parser)]
#[command(name = "worker", version = VERSION, after_help = EXIT_CODES, args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,

    #[command(flatten)]
    work: WorkArguments,

    /// Only errors; twice: nothing
    #[arg(short, long, action = ArgAction::Count)]
    quiet: u8,

    /// More of what happens; twice: everything
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "quiet")]
    verbose: u8,
}

/// What can be wanted of the worker that runs on this machine.
#[derive(Debug, Subcommand)]
enum Command {
    /// Say how the worker of this machine is
    Status {
        /// As JSON, for scripts
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        control: ControlArguments,
    },
    /// Let the worker of this machine render nothing for a while, as in `worker pause 1h`
    Pause {
        /// How long, as in 90s, 20min, 1h30m or 48h
        #[arg(value_parser = pause_seconds)]
        time: u64,
        #[command(flatten)]
        control: ControlArguments,
    },
    /// End a pause
    Resume {
        #[command(flatten)]
        control: ControlArguments,
    },
    /// Try everything that a worker needs here, and say what to do about what fails
    ///
    /// Give it the flags of the worker that you mean. Exit code 1: a worker cannot work.
    Doctor {
        /// As JSON, for scripts
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        work: Box<WorkArguments>,
    },
}

#[derive(Debug, Args)]
struct ControlArguments {
    /// Where the worker listens to people [default: where a worker of this user or of the system does]
    #[arg(long, value_name = "FILE")]
    socket: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct WorkArguments {
    /// A worker.toml with settings; flags win over it
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,

    #[command(flatten)]
    settings: Settings,
}

impl WorkArguments {
    /// The settings of the command line and, where it says nothing, of the file.
    fn settings(self) -> anyhow::Result<Settings> {
        let file = self.config.as_deref().map(Settings::read).transpose()?;
        Ok(self.settings.or(file.unwrap_or_default()))
    }
}

/// The command line as data, for manual pages and completions.
pub fn command() -> clap::Command {
    Arguments::command()
}

const NO_ADDRESS: &str =
    "there is no address of a master; give --connect HOST:PORT, or `connect` in worker.toml";

/// Runs the program.
pub fn main() -> ! {
    let arguments = Arguments::parse();
    start_log(arguments.quiet, arguments.verbose);
    let done = match arguments.command {
        None => work(arguments.work),
        Some(Command::Status { json, control }) => give(Order::Status, control, json),
        Some(Command::Pause { time, control }) => give(Order::Pause { seconds: time }, control, false),
        Some(Command::Resume { control }) => give(Order::Resume, control, false),
        Some(Command::Doctor { json, work }) => examine(*work, json),
    };
    let code = match done {
        Ok(()) => 0,
        Err(error) => {
            tracing::error!("{error:#}");
            1
        }
    };
    exit::at_once(code)
}

fn work(arguments: WorkArguments) -> anyhow::Result<()> {
    let settings = arguments.settings()?;
    if settings.connect.is_none() {
        // Wrong use of the command line, as if the flag were mandatory.
        Arguments::command()
            .error(ErrorKind::MissingRequiredArgument, NO_ADDRESS)
            .exit();
    }
    let ended = crate::run(options(settings)?)?;
    tracing::info!(?ended, "bye");
    Ok(())
}

/// Gives an order to the worker of this machine and shows how it is then.
fn give(order: Order, control: ControlArguments, json: bool) -> anyhow::Result<()> {
    let status = control::client::give(order, control.socket)?;
    if json {
        print(serde_json::to_string(&status)?)
    } else {
        print(status)
    }
}

/// Shows what is found, and fails if a worker could not work.
fn examine(arguments: WorkArguments, json: bool) -> anyhow::Result<()> {
    let settings = arguments.settings()?;
    let findings = crate::in_network_loop(async { Ok(doctor::examine(&settings, Clock::start()).await) })?;
    if json {
        print(serde_json::to_string(&findings)?)?;
    } else {
        findings.iter().try_for_each(print)?;
    }
    let is_bad = |finding: &&Finding| finding.health == Health::Bad;
    match findings.iter().filter(is_bad).count() {
        0 => Ok(()),
        bad => bail!(
            "a worker cannot work here: {bad} of {} findings forbid it",
            findings.len()
        ),
    }
}

fn print(text: impl Display) -> anyhow::Result<()> {
    writeln!(stdout(), "{text}").context("cannot write to standard output")
}

fn options(settings: Settings) -> anyhow::Result<WorkerOptions> {
    let policy = settings.policy();
    let keys = settings.keys()?;
    if let Some(keys) = &keys {
        tracing::info!(
            keys = keys.fingerprints(),
            "only a master that has the key is believed"
        );
    }
    Ok(WorkerOptions {
        memory_max: settings.memory_max(),
        cache: settings.cache(),
        connect: settings.connect.context(NO_ADDRESS)?,
        keys,
        slots: policy.slots_max,
        name: settings.name.unwrap_or_else(host_name),
        policy: Some(policy),
        priority: settings.priority.unwrap_or(Priority::Idle),
        lifetime: Lifetime::Service,
        version: VERSION.to_owned(),
    })
}

/// Lines for people on standard error. `RUST_LOG` has the last word.
fn start_log(quiet: u8, verbose: u8) {
    let level = match (quiet, verbose) {
        (0, 0) => "info",
        (1, _) => "error",
        (0, 1) => "debug",
        (0, _) => "trace",
        _ => "off",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .init();
}

/// Checks an address as far as it can be checked before the first attempt; the host is looked up each time anew.
pub fn address(text: &str) -> Result<String, String> {
    let port = text
        .rsplit_once(':')
        .filter(|(host, _)| !host.is_empty())
        .map(|(_, port)| port.parse::<u16>());
    match port {
        Some(Ok(port)) if port != 0 => Ok(text.to_owned()),
        _ => Err("give host and port, as in lab-1:7420 or [::1]:7420".to_owned()),
    }
}

/// Checks a name for people.
pub fn name(text: &str) -> Result<String, String> {
    if text.len() > limits::NAME_BYTES || text.chars().any(char::is_control) {
        return Err(format!(
            "give up to {} bytes without control characters",
            limits::NAME_BYTES
        ));
    }
    Ok(text.to_owned())
}

/// A time such as `1h30m`, in seconds.
fn pause_seconds(text: &str) -> Result<u64, String> {
    let time = text.parse::<SignedDuration>().ok().map(|time| time.as_secs());
    let seconds = time.and_then(|seconds| u64::try_from(seconds).ok());
    seconds
        .filter(|seconds| (1..=PAUSE_SECONDS_MAX).contains(seconds))
        .ok_or_else(|| "give a time such as 90s, 20min, 1h30m or 48h, up to a year".to_owned())
}

/// The name of this machine, as far as it can be shown to people.
pub fn host_name() -> String {
    let text = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name(text.trim())
        .ok()
        .filter(|name| !name.is_empty())
        .unwrap_or_else(|| "worker".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(arguments: &[&str]) -> String {
        Arguments::try_parse_from(arguments).unwrap_err().to_string()
    }

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn a_wrong_command_line_says_what_to_give() {
        for address in ["lab-1", "lab-1:", ":7420", "lab-1:70000", "lab-1:0"] {
            assert!(
                refused(&["worker", "--connect", address]).contains("lab-1:7420"),
                "{address}"
            );
        }
        let long = "x".repeat(65);
        assert!(refused(&["worker", "--connect", "a:1", "--name", &long]).contains("64 bytes"));
    }

    #[test]
    fn a_pause_is_given_as_people_say_it() {
        let times = [("90s", 90), ("20min", 1200), ("1h30m", 5400), ("2h", 7200)];
        for (text, seconds) in times {
            assert_eq!(pause_seconds(text), Ok(seconds), "{text}");
        }
        for text in ["", "1", "soon", "-1h", "0s", "2d", "9000h"] {
            assert!(pause_seconds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_worker_needs_an_address_and_takes_its_machine_for_the_rest() {
        let error = options(Settings::default()).unwrap_err().to_string();
        assert!(
            error.contains("--connect") && error.contains("worker.toml"),
            "{error}"
        );
        let connect = Some("lab-1:7420".to_owned());
        let settings = Settings {
            connect,
            ..Settings::default()
        };
        let options = options(settings).unwrap();
        assert_eq!(options.lifetime, Lifetime::Service);
        assert_eq!(options.priority, Priority::Idle);
        assert!(!options.name.is_empty() && options.slots >= 1);
    }
}
