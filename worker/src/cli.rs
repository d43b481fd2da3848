//! The command line of `worker`.

use std::fs;
use std::io::IsTerminal as _;
use std::num::NonZeroU32;
use std::str::FromStr;
use std::thread::available_parallelism;

use clap::{ArgAction, CommandFactory as _, Parser};
use protocol::limits;
use tracing_subscriber::EnvFilter;

use crate::disk_cache::{self, CacheOptions};
use crate::exit;
use crate::options::{Lifetime, WorkerOptions};

/// The program's version and the revision it was built from.
pub const VERSION: &str = concat!(env!("GRIDLIGHT_VERSION"), " (", env!("GRIDLIGHT_REVISION"), ")");

const EXIT_CODES: &str = "\
Exit codes: 0 told to stop; 1 could not work, the last line says why; 2 wrong command line.

Scenes are kept in $CACHE_DIRECTORY, else $XDG_CACHE_HOME/gridlight, else ~/.cache/gridlight.";

/// Renders for a Gridlight master on the cores of this machine.
///
/// Keeps trying until a master is there, and again when it is gone, until SIGTERM or Control-C. Then
/// what is done so far is sent, within a tenth of a second.
#[derive(Debug, Parser)]
#[command(name = "worker", version = VERSION, after_help = EXIT_CODES)]
struct Arguments {
    /// Where the master listens
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    connect: String,

    /// Threads that render; auto: one for each core
    #[arg(long, value_name = "auto|N", default_value = "auto")]
    slots: Slots,

    /// Name shown to people [default: the host's]
    #[arg(long, value_parser = name)]
    name: Option<String>,

    /// Scenes that came before are kept on disk up to so many bytes; 0 keeps none
    #[arg(long, value_name = "BYTES", default_value_t = CACHE_BYTES)]
    cache_bytes: u64,

    /// Only errors; twice: nothing
    #[arg(short, long, action = ArgAction::Count)]
    quiet: u8,

    /// More of what happens; twice: everything
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "quiet")]
    verbose: u8,
}

/// Scenes on disk: 4 GB.
const CACHE_BYTES: u64 = 4_000_000_000;

/// A number of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slots {
    /// One for each core that this process may use.
    Auto,
    /// So many.
    Count(NonZeroU32),
}

impl Slots {
    /// The number, never more than the protocol allows.
    pub fn count(self) -> u32 {
        match self {
            Self::Auto => available_parallelism()
                .map_or(1, |cores| cores.get() as u32)
                .min(limits::SLOTS),
            Self::Count(count) => count.get(),
        }
    }
}

impl FromStr for Slots {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let count = text
            .parse()
            .ok()
            .and_then(NonZeroU32::new)
            .filter(|count| count.get() <= limits::SLOTS);
        count
            .map(Self::Count)
            .ok_or_else(|| format!("give auto, or a number from 1 to {}", limits::SLOTS))
    }
}

/// The command line as data, for manual pages and completions.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Runs the program.
pub fn main() -> ! {
    let arguments = Arguments::parse();
    start_log(arguments.quiet, arguments.verbose);
    let code = match crate::run(arguments.into()) {
        Ok(ended) => {
            tracing::info!(?ended, "bye");
            0
        }
        Err(error) => {
            tracing::error!("{error:#}");
            1
        }
    };
    exit::at_once(code)
}

impl From<Arguments> for WorkerOptions {
    fn from(arguments: Arguments) -> Self {
        Self {
            connect: arguments.connect,
            slots: arguments.slots.count(),
            name: arguments.name.unwrap_or_else(host_name),
            lifetime: Lifetime::Service,
            cache: cache(arguments.cache_bytes),
            version: VERSION.to_owned(),
        }
    }
}

/// Where scenes are kept, if they are.
fn cache(limit_bytes: u64) -> Option<CacheOptions> {
    if limit_bytes == 0 {
        return None;
    }
    let folder = disk_cache::folder(|name| std::env::var_os(name));
    if folder.is_none() {
        tracing::warn!(
            "scenes are not kept: set CACHE_DIRECTORY, XDG_CACHE_HOME or HOME to a folder for them"
        );
    }
    folder.map(|folder| CacheOptions { folder, limit_bytes })
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
    fn slots_are_a_number_within_the_limit_or_auto() {
        assert_eq!("auto".parse(), Ok(Slots::Auto));
        assert_eq!("3".parse::<Slots>().map(Slots::count), Ok(3));
        for text in ["0", "-1", "1025", "many", ""] {
            assert!(text.parse::<Slots>().is_err(), "{text}");
        }
        assert!(Slots::Auto.count() >= 1);
    }

    #[test]
    fn a_wrong_command_line_says_what_to_give() {
        assert!(refused(&["worker"]).contains("--connect"));
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
    fn defaults_are_this_machine() {
        let arguments = Arguments::try_parse_from(["worker", "--connect", "lab-1:7420"]).unwrap();
        let options = WorkerOptions::from(arguments);
        assert_eq!(
            (options.connect.as_str(), options.lifetime),
            ("lab-1:7420", Lifetime::Service)
        );
        assert!(!options.name.is_empty() && options.slots >= 1);
    }
}
