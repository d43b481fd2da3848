//! What runs by the clock have measured, as it is kept in a file beside the page.

use std::{collections::BTreeMap, fs, path::Path};

use anyhow::Context;
use render::settings::Algorithm;
use serde::{Deserialize, Serialize};

use crate::paper::judge::{METRICS, Scores};

/// The file's name in the folder of the page.
pub const FILE: &str = "realtime.json";

/// All cases, and the circumstances under which they were measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Version and revision of the master.
    pub version: String,
    /// The processor, as the system calls it.
    pub processor: String,
    /// Cores that rendered.
    pub cores: usize,
    /// Size of the pictures, as `1024x768`.
    pub size: String,
    /// Light samples per pixel.
    pub spp: u32,
    /// Virtual point lights.
    pub vpls: u32,
    /// Sets that they are divided into.
    pub vpl_sets: u32,
    /// By scene, deadline and algorithm.
    pub cases: Vec<Case>,
}

/// One algorithm in one scene with one deadline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// As the page calls it.
    pub scene: String,
    /// Seconds.
    pub deadline_s: f64,
    /// `component` or `straightforward`.
    pub algorithm: String,
    /// At least one.
    pub runs: Vec<OneRun>,
}

/// One delivered picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OneRun {
    /// From the master's start until the picture was delivered, seconds.
    pub elapsed_s: f64,
    /// Reconstructed pixels of direct and indirect light, percent.
    pub reconstructed_percent: [f64; 2],
    /// Distance from the picture without a deadline, by the metric's name.
    pub scores: BTreeMap<String, f64>,
}

/// Median and range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// The middle value.
    pub median: f64,
    /// The smallest value.
    pub least: f64,
    /// The largest value.
    pub most: f64,
}

impl Measured {
    /// Reads the file in a folder; `None` if there is none.
    ///
    /// # Errors
    /// If it cannot be read or is of another version of this program.
    pub fn load(folder: &Path) -> anyhow::Result<Option<Self>> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(None);
        }
        let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let measured = serde_json::from_str(&text).with_context(|| {
            format!(
                "{} is not what this program writes; remove it or measure again with `eval realtime`",
                path.display()
            )
        })?;
        Ok(Some(measured))
    }

    /// Writes the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save(&self, folder: &Path) -> anyhow::Result<()> {
        let path = folder.join(FILE);
        let text = serde_json::to_string_pretty(self).context("cannot write the results as JSON")?;
        fs::write(&path, text + "\n").with_context(|| format!("cannot write {}", path.display()))
    }

    /// The scenes, in the order in which they were measured.
    pub fn scenes(&self) -> Vec<&str> {
        let mut scenes: Vec<&str> = self.cases.iter().map(|case| case.scene.as_str()).collect();
        scenes.dedup();
        scenes
    }

    /// Medians of a metric by scene and deadline, for both algorithms where both were measured.
    pub fn pairs(&self, metric: usize) -> Vec<[f64; 2]> {
        let of = |algorithm| self.cases.iter().filter(move |case| case.algorithm == algorithm);
        let pair = |component: &Case| {
            let same = |other: &&Case| {
                other.scene == component.scene && other.deadline_s.total_cmp(&component.deadline_s).is_eq()
            };
            let straightforward = of(name(Algorithm::Straightforward)).find(same)?;
            Some([
                component.score(metric)?.median,
                straightforward.score(metric)?.median,
            ])
        };
        of(name(Algorithm::Component)).filter_map(pair).collect()
    }
}

impl Case {
    /// Of the time until delivery, seconds.
    pub fn elapsed_s(&self) -> Option<Spread> {
        Spread::of(self.runs.iter().map(|run| run.elapsed_s))
    }

    /// Of reconstructed pixels, percent; `component` is 0 for direct and 1 for indirect light.
    pub fn reconstructed_percent(&self, component: usize) -> Option<Spread> {
        Spread::of(self.runs.iter().map(|run| run.reconstructed_percent[component]))
    }

    /// Of a metric, by its place among all of them.
    pub fn score(&self, metric: usize) -> Option<Spread> {
        let name = METRICS[metric].name;
        Spread::of(self.runs.iter().filter_map(|run| run.scores.get(name).copied()))
    }
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let (&least, &most) = (values.first()?, values.last()?);
        let middle = values.len() / 2;
        let median = if values.len().is_multiple_of(2) {
            f64::midpoint(values[middle - 1], values[middle])
        } else {
            values[middle]
        };
        Some(Self { median, least, most })
    }

    /// The median with the range in brackets.
    pub fn format(&self, number: impl Fn(f64) -> String) -> String {
        let [median, least, most] = [self.median, self.least, self.most].map(number);
        format!("{median} ({least} to {most})")
    }
}

/// Scores by the names of their metrics.
pub(super) fn by_name(scores: &Scores) -> BTreeMap<String, f64> {
    let names = METRICS.iter().map(|metric| metric.name.to_owned());
    names.zip(scores.0).collect()
}

/// An algorithm as the master's flag has it.
pub(super) fn name(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::Progressive => "progressive",
        Algorithm::Component => "component",
        Algorithm::Straightforward => "straightforward",
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Two deadlines in one scene; the component-based algorithm is better in the first.
    pub(in crate::paper) fn measured() -> Measured {
        let case = |algorithm, deadline_s, values: [f64; 3]| Case {
            scene: "Sibenik".into(),
            deadline_s,
            algorithm: name(algorithm).into(),
            runs: values
                .map(|value| OneRun {
                    elapsed_s: deadline_s - 0.01 * value,
                    reconstructed_percent: [0.0, 50.0],
                    scores: by_name(&Scores([value; METRICS.len()])),
                })
                .into(),
        };
        Measured {
            version: "0.1.0".into(),
            processor: "one".into(),
            cores: 2,
            size: "64x48".into(),
            spp: 64,
            vpls: 1024,
            vpl_sets: 64,
            cases: vec![
                case(Algorithm::Component, 1.0, [3.0, 1.0, 2.0]),
                case(Algorithm::Straightforward, 1.0, [4.0, 3.0, 5.0]),
                case(Algorithm::Component, 2.0, [3.0, 1.0, 2.0]),
                case(Algorithm::Straightforward, 2.0, [1.0, 1.0, 1.0]),
            ],
        }
    }

    #[test]
    fn a_spread_is_the_median_with_the_range() {
        let spread = |values: &[f64]| Spread::of(values.iter().copied()).map(|s| s.format(|v| v.to_string()));
        assert_eq!(spread(&[3.0, 1.0, 2.0]).as_deref(), Some("2 (1 to 3)"));
        assert_eq!(spread(&[4.0, 1.0, 2.0, 3.0]).as_deref(), Some("2.5 (1 to 4)"));
        assert_eq!(spread(&[]), None);
    }

    #[test]
    fn what_is_measured_comes_back_from_its_file() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Measured::load(folder.path()).unwrap(), None);
        measured().save(folder.path()).unwrap();
        assert_eq!(Measured::load(folder.path()).unwrap(), Some(measured()));
        fs::write(folder.path().join(FILE), "{}").unwrap();
        let error = Measured::load(folder.path()).unwrap_err();
        assert!(format!("{error:#}").contains("measure again"), "{error:#}");
    }

    #[test]
    fn algorithms_are_paired_by_scene_and_deadline() {
        assert_eq!(measured().pairs(0), [[2.0, 4.0], [2.0, 1.0]]);
        assert_eq!(measured().scenes(), ["Sibenik"]);
    }
}
