//! `worker doctor`: tries everything that a worker needs of its machine, its settings and its master, and
//! says for what fails what to do.

use std::fmt;
use std::fs;
use std::path::Path;
use std::thread;
use std::time::Duration;

use embree4_sys::{Device, DeviceConfig};
use protocol::connection::{self, Reader, Writer};
use protocol::message::Hello;
use protocol::opening;
use protocol::{ToMaster, ToWorker, version};
use serde::Serialize;
use tokio::net::{TcpStream, lookup_host};
use tokio::time::timeout;

use crate::autogroup;
use crate::cli::{VERSION, host_name};
use crate::clock::Clock;
use crate::disk_cache::DiskCache;
use crate::machine::Machine;
use crate::manners::When;
use crate::priority::be_idle;
use crate::settings::Settings;

/// How long an answer over the network may take.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// How good something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Health {
    /// As it should be.
    Good,
    /// It works, but maybe not as was meant.
    Doubtful,
    /// No picture will ever get light from this worker.
    Bad,
}

/// What was found about one thing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The thing.
    pub what: &'static str,
    /// How good it is.
    pub health: Health,
    /// What is so.
    pub found: String,
    /// What to do about it; absent if nothing need be done.
    pub remedy: Option<String>,
}

impl Finding {
    fn good(what: &'static str, found: impl Into<String>) -> Self {
        Self {
            what,
            health: Health::Good,
            found: found.into(),
            remedy: None,
        }
    }

    fn doubtful(what: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            health: Health::Doubtful,
            remedy: Some(remedy.into()),
            ..Self::good(what, found)
        }
    }

    fn bad(what: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            health: Health::Bad,
            ..Self::doubtful(what, found, remedy)
        }
    }
}

/// One line, and one more for what to do.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = match self.health {
            Health::Good => "ok",
            Health::Doubtful => "??",
            Health::Bad => "NO",
        };
        write!(f, "{mark}  {:<9} {}", self.what, self.found)?;
        match &self.remedy {
            Some(remedy) => write!(f, "\n    {:<9} → {remedy}", ""),
            None => Ok(()),
        }
    }
}

/// Looks at everything; to be called within the runtime.
pub async fn examine(settings: &Settings, clock: Clock) -> Vec<Finding> {
    let machine = Machine::new(clock);
    // The login manager has this long to answer.
    let asked = timeout(ANSWER_WITHIN / 2, machine.sessions().ask());
    let (master, _) = tokio::join!(master(settings), asked);
    let mut findings = master;
    findings.extend([
        embree(),
        scheduling(),
        session(),
        load(&machine),
        presence(&machine, settings),
        memory(settings),
        cache(settings),
        time(settings, clock),
    ]);
    findings
}

/// The master's address, and whether it would take this worker.
async fn master(settings: &Settings) -> Vec<Finding> {
    let Some(address) = &settings.connect else {
        let remedy = "name it in worker.toml as `connect`, or give --connect HOST:PORT";
        return vec![Finding::bad("master", "no master is named", remedy)];
    };
    let resolved = match lookup_host(address.as_str()).await {
        Ok(addresses) => addresses.collect::<Vec<_>>(),
        Err(error) => {
            let remedy = "correct the name, or ask who looks after the network's names";
            return vec![Finding::bad("master", format!("{address}: {error}"), remedy)];
        }
    };
    match timeout(ANSWER_WITHIN, TcpStream::connect(&resolved[..])).await {
        Err(_) => vec![Finding::doubtful(
            "master",
            format!("{address} does not answer"),
            "it may be switched off; if it is not, let its firewall pass this port",
        )],
        Ok(Err(error)) => vec![Finding::doubtful(
            "master",
            format!("{address}: {error}"),
            "start a master there with --listen, or leave it so: the worker waits for one",
        )],
        Ok(Ok(stream)) => vec![
            Finding::good("master", format!("{address} answers")),
            match open(stream, settings).await {
                Ok(connection) => handshake(connection).await,
                Err(finding) => finding,
            },
        ],
    }
}

/// Opens a connection, with the first key if there is one.
async fn open(
    stream: TcpStream,
    settings: &Settings,
) -> Result<(Reader<ToWorker>, Writer<ToMaster>), Finding> {
    let bad = |text: String| {
        Finding::bad(
            "key",
            text,
            "see docs/security.md: master and worker need copies of one key file",
        )
    };
    let keys = settings.keys().map_err(|error| bad(error.to_string()))?;
    let Some(key) = keys.as_ref().and_then(|keys| keys.iter().next()) else {
        return connection::open(stream).map_err(|error| bad(error.to_string()));
    };
    let called = timeout(ANSWER_WITHIN, opening::call(stream, key)).await;
    let called =
        called.map_err(|_elapsed| bad("who listens there does not answer a call with a key".to_owned()))?;
    called.map_err(|error| bad(error.to_string()))
}

/// Joins and leaves.
async fn handshake((mut reader, mut writer): (Reader<ToWorker>, Writer<ToMaster>)) -> Finding {
    let conversation = async {
        writer.send(&ToMaster::Hello(hello())).await?;
        anyhow::Ok(reader.read().await?)
    };
    let remedy = "let another port be used: something else than a Gridlight master listens there";
    match timeout(ANSWER_WITHIN, conversation).await {
        Ok(Ok(Some(ToWorker::Welcome(welcome)))) => Finding::good(
            "versions",
            format!("master {}, worker {VERSION}", welcome.version),
        ),
        Ok(Ok(Some(ToWorker::Refused(refused)))) => Finding::bad(
            "versions",
            refused.reason,
            "do as the master says; if it names versions, install the same on both machines",
        ),
        Ok(Ok(_)) => Finding::bad("versions", "who listens there says nothing of use", remedy),
        Ok(Err(error)) => Finding::bad("versions", format!("{error:#}"), remedy),
        Err(_) => Finding::bad("versions", "who listens there says nothing", remedy),
    }
}

fn hello() -> Hello {
    Hello {
        magic: version::MAGIC.to_owned(),
        protocol: version::PROTOCOL,
        version: VERSION.to_owned(),
        name: format!("doctor of {}", host_name()).chars().take(60).collect(),
        slots: 1,
        token: None,
    }
}

fn embree() -> Finding {
    match Device::new(&DeviceConfig::default()) {
        Ok(device) => {
            let (major, minor, patch) = device.version();
            let lanes = device.native_packet_width();
            let found = format!(
                "Embree {major}.{minor}.{patch}, packets {lanes:?}, {}",
                instruction_sets()
            );
            Finding::good("tracing", found)
        }
        Err(error) => Finding::bad("tracing", error.to_string(), "run ./setup, or install Embree 4"),
    }
}

/// What of interest to a ray tracer the processor knows.
fn instruction_sets() -> String {
    let known = [
        ("AVX-512", is_x86_feature_detected!("avx512f")),
        ("AVX2", is_x86_feature_detected!("avx2")),
        ("SSE4.2", is_x86_feature_detected!("sse4.2")),
    ];
    let names: Vec<_> = known
        .iter()
        .filter(|(_, is_known)| *is_known)
        .map(|(name, _)| *name)
        .collect();
    format!("processor with {}", names.join(", "))
}

/// Tries it in a thread that ends at once.
fn scheduling() -> Finding {
    if thread::spawn(be_idle).join().unwrap_or(false) {
        return Finding::good(
            "priority",
            "threads that render are behind all others (SCHED_IDLE)",
        );
    }
    let remedy =
        "let the service or container call sched_setscheduler; until then only nice 19 holds it back";
    Finding::doubtful("priority", "the system does not allow SCHED_IDLE", remedy)
}

/// This process is in another session than the worker will be, so only what any could do is known.
fn session() -> Finding {
    match (autogroup::are_weighed(), autogroup::may_change()) {
        (false, _) => Finding::good("session", "priorities count among all programs"),
        (_, Ok(())) => Finding::good(
            "session",
            "the system weighs sessions against each other, and one of the worker's own is put behind all: \
             that of a service, or of `setsid worker`",
        ),
        (_, Err(error)) => Finding::doubtful(
            "session",
            format!(
                "the system weighs sessions against each other, and the worker's cannot be put behind: {error}"
            ),
            "let the service or container write to /proc/self/autogroup, or give it a low CPUWeight",
        ),
    }
}

fn load(machine: &Machine) -> Finding {
    let cores = machine.cores();
    match machine.look().cpu {
        Some(_) => Finding::good(
            "load",
            format!("{} cores, whose use by others is known", cores.count),
        ),
        None => Finding::doubtful(
            "load",
            "/proc/stat cannot be read, so slots do not follow what others use",
            "let the service or container see /proc/stat (not ProcSubset=pid), or give --slots a number",
        ),
    }
}

fn presence(machine: &Machine, settings: &Settings) -> Finding {
    let signs = machine.signs();
    let known = [
        ("the login manager", signs.session.is_some()),
        ("interrupts of input devices", signs.interrupts.is_some()),
        ("terminals", signs.terminal.is_some()),
    ];
    let names: Vec<_> = known
        .iter()
        .filter(|(_, is_known)| *is_known)
        .map(|(name, _)| *name)
        .collect();
    let tells_absence = signs.session.is_some() || signs.interrupts.is_some();
    let found = match names[..] {
        [] => "nothing tells whether somebody is here".to_owned(),
        _ => format!("whether somebody is here is told by {}", names.join(", ")),
    };
    let is_needed = settings.policy().when == When::Idle;
    match (tells_absence, is_needed) {
        (true, _) => Finding::good("presence", found),
        (false, true) => Finding::bad(
            "presence",
            format!("{found}; that is not enough to know that nobody is"),
            "install systemd-logind with D-Bus, let the service see /proc/interrupts, or set when = \"always\"",
        ),
        (false, false) => Finding::good(
            "presence",
            format!("{found}; of no interest while `when` is not \"idle\""),
        ),
    }
}

fn memory(settings: &Settings) -> Finding {
    let allowed = settings.memory_max() as f64 / 1e9;
    let free = available_bytes(Path::new("/proc/meminfo")).map(|bytes| bytes as f64 / 1e9);
    let found = match free {
        Some(free) => format!("scenes may need {allowed:.1} GB; {free:.1} GB are free now"),
        None => format!("scenes may need {allowed:.1} GB"),
    };
    match free {
        Some(free) if free < allowed => Finding::doubtful(
            "memory",
            found,
            "set `memory` to less, or end what uses the memory",
        ),
        _ => Finding::good("memory", found),
    }
}

fn available_bytes(meminfo: &Path) -> Option<u64> {
    let text = fs::read_to_string(meminfo).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}

/// The folder in which scenes are kept.
fn cache(settings: &Settings) -> Finding {
    let Some(options) = settings.cache() else {
        let remedy = "set CACHE_DIRECTORY or HOME, unless scenes shall come over the network each time";
        return Finding::doubtful("cache", "scenes are not kept", remedy);
    };
    let folder = options.folder.display().to_string();
    match DiskCache::open(options) {
        Ok(_) => Finding::good("cache", format!("scenes are kept in {folder}")),
        Err(error) => {
            let remedy = "let the worker's user write there, or set CACHE_DIRECTORY to another folder";
            Finding::doubtful("cache", format!("{folder}: {error}"), remedy)
        }
    }
}

/// No time of day crosses the wire, so only the hours depend on it.
fn time(settings: &Settings, clock: Clock) -> Finding {
    let now = clock.local_time();
    let policy = settings.policy();
    if policy.hours.is_empty() {
        return Finding::good(
            "clock",
            format!("{now}; of no interest while there are no `hours`"),
        );
    }
    let is_time = policy
        .hours
        .iter()
        .any(|hours| hours.contain(clock.week_minute()));
    let found = if is_time {
        "within the hours"
    } else {
        "outside of the hours"
    };
    Finding::good("clock", format!("{now}, {found}"))
}
