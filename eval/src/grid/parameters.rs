//! What the machines, the network and the pictures are like: `paper.toml`, checked.

use std::{ops::RangeInclusive, path::Path, time::Duration};

use render::{
    scene::ImageSize,
    settings::{Algorithm, Settings},
};
use serde::Deserialize;

/// The parameters of the paper's grid.
const PAPER: &str = include_str!("../../paper.toml");

/// Everything that an experiment on the virtual grid needs to know besides scene and deadline.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The machines.
    pub grid: Grid,
    /// The way to the master and back.
    pub network: Network,
    /// The pictures.
    pub picture: PictureParameters,
    /// The scenes of the paper.
    pub scene: Vec<SceneParameters>,
}

/// The machines.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Machines at the start.
    pub machines: u32,
    /// Workers on each.
    pub cores_per_machine: u32,
    /// Between which moments the cores ask for their first task, seconds after the start.
    pub first_request_s: [f64; 2],
    /// Time of a task besides its rays and pixels, seconds.
    pub task_overhead_s: f64,
    /// Time of each pixel of a result besides its rays, seconds.
    pub pixel_overhead_s: f64,
    /// Largest deviation of a core's speed, as a share.
    pub speed_spread: f64,
    /// Part of every random draw.
    pub seed: u64,
}

/// The way to the master and back.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// One way, seconds.
    pub latency_s: f64,
    /// Into the master, shared by all results.
    pub bandwidth_bytes_per_s: f64,
    /// How long before the deadline a worker sends what it has, seconds: the paper's Δt.
    pub delta_t_s: f64,
}

/// The pictures.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PictureParameters {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// See `master --clamp auto`.
    pub clamp_distance_share: f32,
    /// See `master --min-set-percent`.
    pub min_set_percent: f32,
}

/// A scene of the paper.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneParameters {
    /// As the paper calls it.
    pub name: String,
    /// In the folder `scenes`.
    pub file: String,
    /// Exposure at which its pictures are looked at.
    pub exposure_stops: f64,
    /// Speed of one core in it.
    pub core_rays_per_s: f64,
}

/// Why there are no parameters.
#[derive(Debug, thiserror::Error)]
pub enum ParametersError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// It is not of the expected form.
    #[error("{path}: {source}")]
    Form {
        /// The file.
        path: String,
        /// Where and why.
        source: Box<toml::de::Error>,
    },
    /// A number makes no sense.
    #[error("{path}: `{name}` is {value}, but must be from {min} to {max}")]
    Range {
        /// The file.
        path: String,
        /// The number's name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Smallest accepted value.
        min: f64,
        /// Largest accepted value.
        max: f64,
    },
}

impl Parameters {
    /// Those of the paper, or those of another file.
    ///
    /// # Errors
    /// If the file cannot be read, is not of the form of `eval/paper.toml`, or has impossible numbers.
    pub fn load(path: Option<&Path>) -> Result<Self, ParametersError> {
        let Some(path) = path else {
            return Self::parse("eval/paper.toml", PAPER);
        };
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| ParametersError::Read {
            path: name.clone(),
            source,
        })?;
        Self::parse(&name, &text)
    }

    fn parse(path: &str, text: &str) -> Result<Self, ParametersError> {
        let parameters: Self = toml::from_str(text).map_err(|source| ParametersError::Form {
            path: path.to_owned(),
            source: Box::new(source),
        })?;
        for (name, value, range) in parameters.ranges() {
            if !range.contains(&value) {
                return Err(ParametersError::Range {
                    path: path.to_owned(),
                    name,
                    value,
                    min: *range.start(),
                    max: *range.end(),
                });
            }
        }
        Ok(parameters)
    }

    fn ranges(&self) -> Vec<(&'static str, f64, RangeInclusive<f64>)> {
        let Self {
            grid,
            network,
            picture,
            scene,
        } = self;
        let [first, last] = grid.first_request_s;
        let mut ranges = vec![
            ("machines", grid.machines.into(), 0.0..=10_000.0),
            ("cores_per_machine", grid.cores_per_machine.into(), 1.0..=1_024.0),
            ("first_request_s", first, 0.0..=3_600.0),
            ("first_request_s", last, first.max(0.0)..=3_600.0),
            ("task_overhead_s", grid.task_overhead_s, 0.0..=3_600.0),
            ("pixel_overhead_s", grid.pixel_overhead_s, 0.0..=1.0),
            ("speed_spread", grid.speed_spread, 0.0..=0.9),
            ("latency_s", network.latency_s, 0.0..=60.0),
            ("bandwidth_bytes_per_s", network.bandwidth_bytes_per_s, 1.0..=1e15),
            ("delta_t_s", network.delta_t_s, 0.0..=3_600.0),
            ("width", picture.width.into(), 1.0..=16_384.0),
            ("height", picture.height.into(), 1.0..=16_384.0),
            (
                "clamp_distance_share",
                picture.clamp_distance_share.into(),
                1e-6..=1.0,
            ),
            ("min_set_percent", picture.min_set_percent.into(), 0.0..=100.0),
        ];
        for scene in scene {
            ranges.push(("exposure_stops", scene.exposure_stops, -30.0..=30.0));
            ranges.push(("core_rays_per_s", scene.core_rays_per_s, 1.0..=1e12));
        }
        ranges
    }

    /// The same experiment with smaller or larger pictures: cores, overheads and network are scaled so
    /// that every task takes the time it would take at the parameters' own size.
    #[must_use]
    pub fn at_size(&self, size: ImageSize) -> Self {
        let share =
            size.pixel_count() as f64 / (f64::from(self.picture.width) * f64::from(self.picture.height));
        let mut scaled = self.clone();
        scaled.picture.width = size.width;
        scaled.picture.height = size.height;
        scaled.grid.pixel_overhead_s /= share;
        scaled.network.bandwidth_bytes_per_s *= share;
        for scene in &mut scaled.scene {
            scene.core_rays_per_s *= share;
        }
        scaled
    }

    /// The picture's size.
    pub fn size(&self) -> ImageSize {
        ImageSize {
            width: self.picture.width,
            height: self.picture.height,
        }
    }

    /// The paper's workload; `extent` is the scene's size in scene units.
    pub fn settings(&self, algorithm: Algorithm, extent: f32) -> Settings {
        Settings {
            geometry_clamp: Some((self.picture.clamp_distance_share * extent).powi(-2)),
            ..Settings::paper(algorithm, self.size())
        }
    }
}

impl Network {
    /// The paper's Δt.
    pub fn delta_t(&self) -> Duration {
        Duration::from_secs_f64(self.delta_t_s)
    }

    /// One way.
    pub fn latency(&self) -> Duration {
        Duration::from_secs_f64(self.latency_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parameters_of_the_paper_are_valid() {
        let parameters = Parameters::load(None).unwrap();
        assert_eq!(
            (parameters.grid.machines, parameters.grid.cores_per_machine),
            (24, 4)
        );
        assert_eq!(parameters.scene.len(), 3);
    }

    #[test]
    fn impossible_numbers_and_unknown_names_are_refused_by_name() {
        for (from, to, message) in [
            ("speed_spread = 0.05", "speed_spread = 2", "`speed_spread` is 2"),
            ("latency_s = 0.0002", "latency_s = -1", "`latency_s` is -1"),
            ("[0.25, 2.25]", "[3, 2]", "`first_request_s` is 2"),
            ("latency_s = 0.0002", "latency_s = nan", "`latency_s` is NaN"),
            ("seed = 2010", "sead = 2010", "sead"),
        ] {
            let text = PAPER.replace(from, to);
            let error = Parameters::parse("grid.toml", &text).unwrap_err().to_string();
            assert!(error.contains(message) && error.contains("grid.toml"), "{error}");
        }
    }

    #[test]
    fn smaller_pictures_meet_cores_that_are_slower_by_as_much() {
        let parameters = Parameters::load(None).unwrap();
        let small = parameters.at_size(ImageSize {
            width: 256,
            height: 192,
        });
        let ratio = parameters.scene[0].core_rays_per_s / small.scene[0].core_rays_per_s;
        assert!((ratio - 16.0).abs() < 1e-9);
        assert_eq!(small.size().pixel_count() * 16, parameters.size().pixel_count());
    }
}
