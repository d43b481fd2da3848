//! Decides how many slots may work now, so that the owner of the machine does not notice. Knows no
//! files, threads or clock.
//!
//! Time is a [`Duration`] since the worker's start. The shell takes a [`Look`] at the machine when
//! [`Manners::poll_timeout`] says so, and gives what it saw to [`Manners::handle`]; the answer is
//! [`Manners::allowance`].

pub mod hours;
pub mod load;
pub mod presence;

use std::fmt;
use std::time::Duration;

use clap::ValueEnum;

use self::hours::{Hours, WeekMinute};
use self::load::{Cores, CpuTimes, LOOK_EVERY, Load};
use self::presence::{Presence, Signs};

/// How often to look for signs of the owner while slots work that must go when he comes.
pub const GLANCE_EVERY: Duration = Duration::from_millis(20);

/// What the owner of a machine allows.
#[derive(Clone, Debug, PartialEq)]
pub struct Policy {
    /// Whether to work at all.
    pub when: When,
    /// Most slots at a time.
    pub slots_max: u32,
    /// Whether slots make room for other programs.
    pub follow_load: bool,
    /// For how long nobody may have touched an idle machine.
    pub idle_after: Duration,
    /// Cores that other programs may use of an idle machine.
    pub idle_load: f64,
    /// The only hours in which to work; none: all hours.
    pub hours: Vec<Hours>,
    /// Whether to work on battery.
    pub on_battery: bool,
}

/// When a worker works.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum When {
    /// While nobody is at the machine and little runs on it.
    Idle,
    /// Whoever is there.
    Always,
    /// Not now, but stay installed.
    Never,
}

/// What happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A look at all of the machine.
    Looked(Look),
    /// A look for signs of the owner only.
    Glanced(Signs),
    /// The owner wants quiet for so long.
    Pause(Duration),
    /// The owner allows work again.
    Resume,
}

/// What can be seen of the machine. What cannot is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Look {
    /// Processor time so far.
    pub cpu: Option<CpuTimes>,
    /// Signs of the owner.
    pub signs: Signs,
    /// Whether the machine is on mains power.
    pub on_mains: Option<bool>,
    /// The time of the week, in local time.
    pub week_minute: Option<WeekMinute>,
}

/// How many slots may work.
#[derive(Clone, Debug, PartialEq)]
pub struct Allowance {
    /// So many.
    pub slots: u32,
    /// Why none, or fewer than the most.
    pub hindrance: Option<Hindrance>,
}

impl Allowance {
    /// All that there are.
    pub fn all(slots: u32) -> Self {
        Self {
            slots,
            hindrance: None,
        }
    }
}

/// What keeps slots from working.
#[derive(Clone, Debug, PartialEq)]
pub enum Hindrance {
    /// The first looks are still to come.
    Looking,
    /// The owner wants quiet for so long from now on.
    Paused(Duration),
    /// The policy says never.
    Never,
    /// It is not the time.
    OutsideHours,
    /// The machine runs on battery.
    OnBattery,
    /// Somebody touched the machine so long ago.
    OwnerHere(Duration),
    /// Nothing tells whether somebody is there.
    OwnerUnknown,
    /// Other programs use so many cores.
    Load(f64),
}

impl fmt::Display for Hindrance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Looking => f.write_str("taking a first look at the machine"),
            Self::Paused(left) => write!(f, "paused for {} more", minutes(*left)),
            Self::Never => f.write_str("`when` is \"never\""),
            Self::OutsideHours => f.write_str("it is not the time: see `hours`"),
            Self::OnBattery => f.write_str("the machine runs on battery"),
            Self::OwnerHere(ago) => write!(f, "somebody used the machine {} ago", minutes(*ago)),
            Self::OwnerUnknown => f.write_str(
                "nothing tells whether somebody is at the machine, so somebody may be; \
                 `worker doctor` says what is missing",
            ),
            Self::Load(cores) => write!(f, "other programs use {cores:.1} cores"),
        }
    }
}

fn minutes(time: Duration) -> String {
    match time.as_secs() {
        seconds @ 0..120 => format!("{seconds} s"),
        seconds => format!("{} min", seconds / 60),
    }
}

/// What is known of a machine, and what follows.
#[derive(Debug)]
pub struct Manners {
    policy: Policy,
    cores: Cores,
    load: Load,
    presence: Presence,
    /// The last look, and when it was.
    seen: Option<(Duration, Look)>,
    glanced_at: Duration,
    paused_until: Option<Duration>,
}

impl Manners {
    /// Knows nothing yet, so no slot works before the first looks.
    pub fn new(policy: Policy, cores: Cores) -> Self {
        Self {
            policy,
            cores,
            load: Load::default(),
            presence: Presence::default(),
            seen: None,
            glanced_at: Duration::ZERO,
            paused_until: None,
        }
    }

    /// Takes one event.
    pub fn handle(&mut self, now: Duration, event: Event) {
        match event {
            Event::Looked(look) => {
                self.load.look(now, look.cpu);
                self.presence.look(now, &look.signs);
                self.glanced_at = now;
                self.seen = Some((now, look));
            }
            Event::Glanced(signs) => {
                self.presence.look(now, &signs);
                self.glanced_at = now;
            }
            Event::Pause(time) => self.paused_until = Some(now.saturating_add(time)),
            Event::Resume => self.paused_until = None,
        }
    }

    /// When to look again, and at what: at all if it is [`Self::look_at`], else for signs only.
    pub fn poll_timeout(&self, now: Duration) -> Duration {
        let may_be_disturbed = self.policy.when == When::Idle && self.allowance(now).slots > 0;
        let look_at = self.look_at();
        if may_be_disturbed {
            look_at.min(self.glanced_at + GLANCE_EVERY)
        } else {
            look_at
        }
    }

    /// When to look at all of the machine.
    pub fn look_at(&self) -> Duration {
        self.seen
            .as_ref()
            .map_or(Duration::ZERO, |(then, _)| *then + LOOK_EVERY)
    }

    /// How many slots may work now.
    pub fn allowance(&self, now: Duration) -> Allowance {
        if let Some(hindrance) = self.hindrance(now) {
            return Allowance {
                slots: 0,
                hindrance: Some(hindrance),
            };
        }
        let slots_max = self.policy.slots_max;
        let (true, Some(free)) = (self.policy.follow_load, self.load.free(self.cores)) else {
            return Allowance::all(slots_max);
        };
        Allowance {
            slots: free.min(slots_max),
            hindrance: (free < slots_max).then(|| Hindrance::Load(self.load.others().unwrap_or_default())),
        }
    }

    /// What forbids all work.
    fn hindrance(&self, now: Duration) -> Option<Hindrance> {
        if let Some(left) = self.pause_left(now) {
            return Some(Hindrance::Paused(left));
        }
        let policy = &self.policy;
        if policy.when == When::Never {
            return Some(Hindrance::Never);
        }
        let Some((_, look)) = &self.seen else {
            return Some(Hindrance::Looking);
        };
        let in_hours = |minute| policy.hours.iter().any(|hours| hours.contain(minute));
        if !policy.hours.is_empty() && !look.week_minute.is_some_and(in_hours) {
            return Some(Hindrance::OutsideHours);
        }
        if !policy.on_battery && look.on_mains == Some(false) {
            return Some(Hindrance::OnBattery);
        }
        // The load is known from the second look on, if the system tells it at all.
        if look.cpu.is_some() && self.load.others().is_none() && self.needs_load() {
            return Some(Hindrance::Looking);
        }
        (policy.when == When::Idle).then(|| self.not_idle(now)).flatten()
    }

    fn needs_load(&self) -> bool {
        self.policy.follow_load || self.policy.when == When::Idle
    }

    /// Why the machine is not idle, if it is not.
    fn not_idle(&self, now: Duration) -> Option<Hindrance> {
        let Some(untouched) = self.presence.untouched(now) else {
            return Some(Hindrance::OwnerUnknown);
        };
        if untouched < self.policy.idle_after {
            return Some(Hindrance::OwnerHere(untouched));
        }
        let others = self.load.others().unwrap_or(f64::INFINITY);
        (others > self.policy.idle_load).then_some(Hindrance::Load(others))
    }

    fn pause_left(&self, now: Duration) -> Option<Duration> {
        let left = self.paused_until?.saturating_sub(now);
        (!left.is_zero()).then_some(left)
    }
}

#[cfg(test)]
mod tests;
