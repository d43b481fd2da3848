//! Who comes and who goes: the volatile resources of section 4.2.

use std::{path::Path, time::Duration};

use anyhow::Context;
use serde::Deserialize;

/// Machines that come and go while a frame is rendered.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// Machines at the start, if not as many as the grid has.
    pub machines: Option<u32>,
    /// What happens, in any order.
    #[serde(default, rename = "change")]
    pub changes: Vec<Change>,
}

/// Machines that come or go at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// Seconds after the start.
    pub at_s: f64,
    /// Machines that join, then ask for their first tasks.
    #[serde(default)]
    pub join: u32,
    /// Machines that leave without a word; those that came last go first.
    #[serde(default)]
    pub leave: u32,
}

/// Latest moment of a change, seconds after the start.
const AT_MAX_S: f64 = 86_400.0;
/// Most machines that may come at one moment.
const JOIN_MAX: u32 = 10_000;

impl Script {
    /// Reads a script: `machines = 14`, and a `[[change]]` with `at_s` and `join` or `leave` for each
    /// change.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the script {}", path.display()))?;
        let script: Self = toml::from_str(&text).with_context(|| format!("script {}", path.display()))?;
        for change in &script.changes {
            anyhow::ensure!(
                (0.0..=AT_MAX_S).contains(&change.at_s) && change.join <= JOIN_MAX,
                "script {}: a change at {} s of {} machines: need 0 to {AT_MAX_S} s and at most {JOIN_MAX} machines",
                path.display(),
                change.at_s,
                change.join
            );
        }
        anyhow::ensure!(
            script.machines.is_none_or(|machines| machines <= JOIN_MAX),
            "script {}: at most {JOIN_MAX} machines",
            path.display()
        );
        Ok(script)
    }

    /// One machine after the other, a second apart, "from 14 machines (56 cores) to 24 machines
    /// (96 cores) linearly".
    pub fn growing(from: u32, to: u32) -> Self {
        Self::linear(from, from.abs_diff(to), 1, 0)
    }

    /// One machine after the other, "from 24 machines (96 cores) to 14 machines (56 cores) linearly".
    pub fn shrinking(from: u32, to: u32) -> Self {
        Self::linear(from, from.abs_diff(to), 0, 1)
    }

    fn linear(machines: u32, steps: u32, join: u32, leave: u32) -> Self {
        let change = |second: u32| Change {
            at_s: second.into(),
            join,
            leave,
        };
        Self {
            machines: Some(machines),
            changes: (1..=steps).map(change).collect(),
        }
    }
}

impl Change {
    /// The moment, as time since the start.
    pub fn at(&self) -> Duration {
        Duration::from_secs_f64(self.at_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_runs_change_by_one_machine_each_second() {
        let growing = Script::growing(14, 24);
        assert_eq!((growing.machines, growing.changes.len()), (Some(14), 10));
        assert_eq!((growing.changes[9].at_s, growing.changes[9].join), (10.0, 1));
        let shrinking = Script::shrinking(24, 14);
        assert_eq!((shrinking.machines, shrinking.changes[0].leave), (Some(24), 1));
    }

    #[test]
    fn a_script_is_read_from_toml_and_refused_if_it_makes_no_sense() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("script.toml");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Script::load(&path).map_err(|error| format!("{error:#}"))
        };
        let script = read("machines = 2\n[[change]]\nat_s = 1.5\njoin = 3").unwrap();
        assert_eq!((script.machines, script.changes[0].join), (Some(2), 3));
        assert!(read("[[change]]\nat_s = -1").unwrap_err().contains("-1 s"));
        assert!(read("[[change]]\njoin = 1").unwrap_err().contains("at_s"));
    }
}
