//! What a worker can be told, by flags or by a `worker.toml`: the same settings under the same names.

use std::env;
use std::fs;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::thread::available_parallelism;
use std::time::Duration;

use anyhow::{Context as _, anyhow, bail};
use clap::{Args, Parser};
use protocol::key_file::KeyFileError;
use protocol::{Keys, key_file, limits};
use toml::de::{DeTable, DeValue};

use crate::cli::{address, name};
use crate::disk_cache::{self, CacheOptions};
use crate::manners::hours::Hours;
use crate::manners::{Policy, When};
use crate::priority::Priority;

/// Bytes of a `worker.toml`; far more than anyone writes.
const FILE_BYTES: u64 = 64 << 10;

/// Scenes on disk: 4 GB.
const CACHE_BYTES: u64 = 4_000_000_000;

/// Longest time without input after which a machine may count as idle: a day.
const IDLE_MINUTES_MAX: i64 = 24 * 60;

/// Each setting is a flag and a key of `worker.toml`, where `-` is written `_`. Flags win.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Where the master listens
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    pub connect: Option<String>,

    /// Key file, the same as the master's; whoever does not have the key is no master
    #[arg(long, value_name = "FILE", env = "GRIDLIGHT_KEY")]
    pub key: Option<PathBuf>,

    /// Threads that render; auto: one for each core that other programs leave free; a number: so many,
    /// whatever others do [default: auto]
    #[arg(long, value_name = "auto|N", help_heading = "Manners")]
    pub slots: Option<Slots>,

    /// Most slots that `auto` takes [default: one for each core]
    #[arg(long, value_name = "N", value_parser = slot_count, help_heading = "Manners")]
    pub slots_max: Option<NonZeroU32>,

    /// When to render: idle, while nobody uses the machine; always, beside whoever does; never
    /// [default: always]
    #[arg(long, value_enum, help_heading = "Manners")]
    pub when: Option<When>,

    /// A machine is idle when nobody has touched it for so long [default: 10]
    #[arg(long, value_name = "MINUTES", value_parser = clap::value_parser!(u32).range(1..=IDLE_MINUTES_MAX), help_heading = "Manners")]
    pub idle_minutes: Option<u32>,

    /// A machine is not idle while other programs use more cores than this [default: 1]
    #[arg(long, value_name = "CORES", value_parser = cores, help_heading = "Manners")]
    pub idle_load: Option<f64>,

    /// Render in these hours only, as in "Mon-Fri 18:00-08:00", "Sat-Sun" or "22:00-06:00"; can be given
    /// more than once [default: at all hours]
    #[arg(long, value_name = "HOURS", help_heading = "Manners")]
    pub hours: Option<Vec<Hours>>,

    /// Whether to render on battery, too [default: false]
    #[arg(long, value_name = "true|false", num_args = 0..=1, default_missing_value = "true", help_heading = "Manners")]
    pub on_battery: Option<bool>,

    /// How the threads that render stand in line for a core: idle, behind everything else; ordinary, on
    /// machines that are there to render [default: idle]
    #[arg(long, value_enum, help_heading = "Manners")]
    pub priority: Option<Priority>,

    /// Largest memory that a scene may need here, as in "4 GB" [default: half of the machine's]
    #[arg(long, value_name = "SIZE", help_heading = "Manners")]
    pub memory: Option<ByteSize>,

    /// Scenes that came before are kept on disk up to so many bytes; 0 keeps none [default: 4000000000]
    #[arg(long, value_name = "BYTES")]
    pub cache_bytes: Option<u64>,

    /// Name shown to people [default: the host's]
    #[arg(long, value_parser = name)]
    pub name: Option<String>,
}

impl Settings {
    /// Reads a `worker.toml`. Keys that do not exist are refused with their line.
    pub fn read(file: &Path) -> anyhow::Result<Self> {
        let shown = file.display();
        let size = fs::metadata(file)
            .with_context(|| format!("cannot read {shown}"))?
            .len();
        if size > FILE_BYTES {
            bail!("{shown} has {size} bytes; a worker.toml has at most {FILE_BYTES}");
        }
        let text = fs::read_to_string(file).with_context(|| format!("cannot read {shown}"))?;
        Self::parse(&text).map_err(|problem| problem.in_file(file, &text))
    }

    /// Each entry becomes the flag that it is, so that there is one set of rules for both.
    fn parse(text: &str) -> Result<Self, Problem> {
        let table = DeTable::parse(text)?;
        let mut entries: Vec<_> = table.get_ref().iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let mut settings = Self::default();
        for (key, value) in entries {
            let flags = flags(key.get_ref(), value.get_ref()).map_err(|text| Problem {
                at: key.span().start,
                text,
            })?;
            // Each by itself, so that what is wrong has a line.
            let parsed = Flags::try_parse_from(flags).map_err(|error| Problem {
                at: value.span().start,
                text: one_line(&error),
            })?;
            settings = settings.or(parsed.settings);
        }
        Ok(settings)
    }

    /// These settings, and where they say nothing, the others.
    #[must_use]
    pub fn or(self, others: Self) -> Self {
        Self {
            connect: self.connect.or(others.connect),
            key: self.key.or(others.key),
            slots: self.slots.or(others.slots),
            slots_max: self.slots_max.or(others.slots_max),
            when: self.when.or(others.when),
            idle_minutes: self.idle_minutes.or(others.idle_minutes),
            idle_load: self.idle_load.or(others.idle_load),
            hours: self.hours.or(others.hours),
            on_battery: self.on_battery.or(others.on_battery),
            priority: self.priority.or(others.priority),
            memory: self.memory.or(others.memory),
            cache_bytes: self.cache_bytes.or(others.cache_bytes),
            name: self.name.or(others.name),
        }
    }

    /// Most slots that there can be.
    pub fn slots_max(&self) -> u32 {
        let cores = || available_parallelism().map_or(1, |cores| cores.get() as u32);
        match self.slots.unwrap_or_default() {
            Slots::Count(count) => count.get(),
            Slots::Auto => self
                .slots_max
                .map_or_else(cores, NonZeroU32::get)
                .min(limits::SLOTS),
        }
    }

    /// What the key file holds, if there is one.
    pub fn keys(&self) -> Result<Option<Keys>, KeyFileError> {
        self.key.as_deref().map(key_file::read).transpose()
    }

    /// Where scenes are kept, if they are.
    pub fn cache(&self) -> Option<CacheOptions> {
        let limit_bytes = self.cache_bytes.unwrap_or(CACHE_BYTES);
        if limit_bytes == 0 {
            return None;
        }
        let folder = disk_cache::folder(|name| env::var_os(name));
        if folder.is_none() {
            tracing::warn!(
                "scenes are not kept: set CACHE_DIRECTORY, XDG_CACHE_HOME or HOME to a folder for them"
            );
        }
        folder.map(|folder| CacheOptions { folder, limit_bytes })
    }

    /// Bytes of memory that a scene may need.
    pub fn memory_max(&self) -> u64 {
        let half = || {
            let system = rustix::system::sysinfo();
            system.totalram as u64 * u64::from(system.mem_unit) / 2
        };
        self.memory.map_or_else(half, |ByteSize(bytes)| bytes)
    }

    /// What they allow.
    pub fn policy(&self) -> Policy {
        Policy {
            when: self.when.unwrap_or(When::Always),
            slots_max: self.slots_max(),
            follow_load: self.slots.unwrap_or_default() == Slots::Auto,
            idle_after: Duration::from_secs(60 * u64::from(self.idle_minutes.unwrap_or(10))),
            idle_load: self.idle_load.unwrap_or(1.0),
            hours: self.hours.clone().unwrap_or_default(),
            on_battery: self.on_battery.unwrap_or(false),
        }
    }
}

/// The settings as a command line of their own.
#[derive(Debug, Parser)]
#[command(no_binary_name = true)]
struct Flags {
    #[command(flatten)]
    settings: Settings,
}

/// The flags that an entry of a file stands for, or why it stands for none.
fn flags(key: &str, value: &DeValue<'_>) -> Result<Vec<String>, String> {
    let known = keys();
    if !known.iter().any(|known| known == key) {
        let likeness = |candidate: &String| strsim::jaro_winkler(&key.to_lowercase(), candidate);
        let nearest = known.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
        return Err(format!(
            "unknown key `{key}`; did you mean `{}`? (worker.toml knows {})",
            nearest.map_or("", String::as_str),
            known.join(", ")
        ));
    }
    let flag = |value: &DeValue<'_>| match value {
        DeValue::String(text) => Ok(text.to_string()),
        DeValue::Integer(digits) => Ok(digits.to_string()),
        DeValue::Float(digits) => Ok(digits.to_string()),
        DeValue::Boolean(is) => Ok(is.to_string()),
        other => Err(format!("`{key}` cannot be a {}", other.type_str())),
    };
    let flag = |value| Ok(format!("--{}={}", key.replace('_', "-"), flag(value)?));
    match value {
        DeValue::Array(values) => values.iter().map(|value| flag(value.get_ref())).collect(),
        value => Ok(vec![flag(value)?]),
    }
}

/// What the command line's parser says, without its advice about the command line.
fn one_line(error: &clap::Error) -> String {
    let text = error.to_string();
    let text = text.split("\n\n").next().unwrap_or_default();
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    lines.join(" ").trim_start_matches("error: ").to_owned()
}

/// What is wrong with a file.
#[derive(Debug)]
struct Problem {
    /// The byte at which it is.
    at: usize,
    text: String,
}

impl Problem {
    fn in_file(self, file: &Path, text: &str) -> anyhow::Error {
        let before = text.get(..self.at).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        anyhow!("{}:{line}: {}", file.display(), self.text)
    }
}

impl From<toml::de::Error> for Problem {
    fn from(error: toml::de::Error) -> Self {
        Self {
            at: error.span().map_or(0, |span| span.start),
            text: error.message().trim_end().replace('\n', "; "),
        }
    }
}

/// The keys of a `worker.toml`: the flags, so that none can be forgotten.
pub fn keys() -> Vec<String> {
    let flags = Settings::augment_args(clap::Command::new("worker"));
    let names = flags.get_arguments().filter_map(|flag| flag.get_long());
    names.map(|name| name.replace('-', "_")).collect()
}

/// A number of threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Slots {
    /// One for each core that other programs leave free.
    #[default]
    Auto,
    /// So many, whatever others do.
    Count(NonZeroU32),
}

impl FromStr for Slots {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let wrong = |_| format!("give auto, or a number from 1 to {}", limits::SLOTS);
        slot_count(text).map(Self::Count).map_err(wrong)
    }
}

/// An amount of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ByteSize(pub u64);

impl FromStr for ByteSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unit_at = text
            .find(|character: char| character.is_alphabetic())
            .unwrap_or(text.len());
        let (number, unit) = text.split_at(unit_at);
        let factor = match unit.trim().to_ascii_uppercase().as_str() {
            "MB" => 1e6,
            "GB" => 1e9,
            _ => 0.0,
        };
        let bytes = number.trim().parse::<f64>().unwrap_or(0.0) * factor;
        // Up to a petabyte: more than there is, and exact.
        if (1e6..=1e15).contains(&bytes) {
            Ok(Self(bytes as u64))
        } else {
            Err("give a size such as \"500 MB\" or \"4 GB\"".to_owned())
        }
    }
}

fn slot_count(text: &str) -> Result<NonZeroU32, String> {
    let count = text.parse().ok().and_then(NonZeroU32::new);
    count
        .filter(|count| count.get() <= limits::SLOTS)
        .ok_or_else(|| format!("give a number from 1 to {}", limits::SLOTS))
}

fn cores(text: &str) -> Result<f64, String> {
    let cores = text
        .parse()
        .ok()
        .filter(|cores: &f64| *cores >= 0.0 && cores.is_finite());
    cores.ok_or_else(|| "give a number of cores such as 0.5".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Settings of a file in which everything is given.
    const WHOLE: &str = r#"
connect = "lab-1:7420"
key = "/etc/gridlight/key"
slots = "auto"
slots_max = 3
when = "idle"
idle_minutes = 5
idle_load = 0.5
hours = ["Mon-Fri 18:00-08:00", "Sat-Sun"]
on_battery = true
priority = "ordinary"
memory = "4 GB"
cache_bytes = 0
name = "lab-7"
"#;

    /// The text and the line that a wrong file is refused with.
    #[track_caller]
    fn check_refused(text: &str, line: u32, parts: &[&str]) {
        let problem = Settings::parse(text).unwrap_err();
        let error = problem.in_file(Path::new("worker.toml"), text).to_string();
        assert!(error.starts_with(&format!("worker.toml:{line}: ")), "{error}");
        for part in parts {
            assert!(error.contains(part), "{part} is missing in: {error}");
        }
    }

    #[test]
    fn a_file_can_say_everything_that_flags_can_and_the_documentation_shows_it() {
        let policy = Settings::parse(WHOLE).unwrap().policy();
        let hours = ["Mon-Fri 18:00-08:00", "Sat-Sun"].map(|hours| hours.parse().unwrap());
        let expected = Policy {
            when: When::Idle,
            slots_max: 3,
            follow_load: true,
            idle_after: Duration::from_secs(300),
            idle_load: 0.5,
            hours: hours.to_vec(),
            on_battery: true,
        };
        assert_eq!(policy, expected);
        let page = include_str!("../../docs/worker.md");
        for key in keys().iter().map(|key| format!("{key} = ")) {
            assert!(WHOLE.contains(&key), "{key} is not tested");
            assert!(
                page.contains(&format!("\n{key}")),
                "{key} is not in the example of docs/worker.md"
            );
        }
    }

    #[test]
    fn flags_win_over_the_file() {
        let flags = Settings {
            when: Some(When::Always),
            ..Settings::default()
        };
        let settings = flags.or(Settings::parse(WHOLE).unwrap());
        assert_eq!(
            (settings.when, settings.idle_minutes),
            (Some(When::Always), Some(5))
        );
    }

    #[test]
    fn an_unknown_key_is_refused_with_its_line_and_the_nearest_known_one() {
        let slot = "connect = 'a:1'\n\nslot = 4\n";
        check_refused(slot, 3, &["unknown key `slot`", "did you mean `slots`?"]);
        check_refused("Memory_limit = '4 GB'\n", 1, &["did you mean `memory`?"]);
        check_refused("[manners]\nwhen = 'idle'\n", 1, &["unknown key `manners`"]);
    }

    #[test]
    fn a_wrong_value_is_refused_with_its_line_and_what_to_give() {
        check_refused(
            "name = 'a'\nslots = 0\n",
            2,
            &["--slots", "a number from 1 to 1024"],
        );
        check_refused("when = 'soon'", 1, &["idle, always, never"]);
        check_refused("connect = 'lab-1'", 1, &["lab-1:7420"]);
        check_refused("hours = ['Mon-Fri', 'late']", 1, &["Mon-Fri 18:00-08:00"]);
        check_refused("memory = 4", 1, &["4 GB"]);
        check_refused("idle_minutes = 0", 1, &["1..=1440"]);
        check_refused("idle_load = -1", 1, &["cores"]);
        check_refused("hours = { from = 8 }", 1, &["cannot be a"]);
        check_refused("when = 'idle'\nwhen = 'idle'", 2, &["duplicate key"]);
        check_refused("when = ", 1, &[]);
    }

    #[test]
    fn defaults_are_all_cores_at_any_time_on_mains_power() {
        let policy = Settings::default().policy();
        assert!(policy.follow_load && policy.hours.is_empty() && !policy.on_battery);
        assert_eq!(policy.when, When::Always);
        assert!(policy.slots_max >= 1);
    }

    #[test]
    fn slots_are_a_number_within_the_limit_or_auto() {
        assert_eq!("auto".parse(), Ok(Slots::Auto));
        assert_eq!("3".parse(), Ok(Slots::Count(NonZeroU32::new(3).unwrap())));
        for text in ["0", "-1", "1025", "many", ""] {
            assert!(text.parse::<Slots>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_size_has_a_unit() {
        assert_eq!("4 GB".parse(), Ok(ByteSize(4_000_000_000)));
        assert_eq!("1.5gb".parse(), Ok(ByteSize(1_500_000_000)));
        assert_eq!("500 MB".parse(), Ok(ByteSize(500_000_000)));
        for text in ["4", "GB", "-4 GB", "4 KB", "0 MB", "inf GB", "NaN GB", "1e99 GB"] {
            assert!(text.parse::<ByteSize>().is_err(), "{text}");
        }
    }
}
