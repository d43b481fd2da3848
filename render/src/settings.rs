//! What is to be rendered: the numbers that decide every task, and their limits.

use crate::scene::ImageSize;

/// How the work is divided into tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Algorithm {
    /// A task is some passes of one component for one pixel group; each pass looks through another place
    /// of each pixel, and neighbouring groups see different VPL sets.
    Progressive,
    /// A task is one component of the light for one pixel group (section 3.2).
    Component,
    /// A task is all light of one pixel group (section 3.1).
    Straightforward,
}

/// How one pass of direct light chooses its points on the emitters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightPoints {
    /// The same point for every pixel of the image (section 3.2.1).
    PerPass,
    /// Another point for each pixel: noise in place of stacked hard shadows.
    PerPixel,
}

/// The workload of a frame. Two frames with equal settings and scenes have equal tasks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Division of the work.
    pub algorithm: Algorithm,
    /// Picture size.
    pub size: ImageSize,
    /// Number of pixel groups.
    pub groups: u32,
    /// Light samples per pixel, that is passes of direct light; progressive: passes of each component.
    pub spp: u32,
    /// Virtual point lights in all sets together.
    pub vpls: u32,
    /// Sets that the VPLs are divided into; divides `vpls`.
    pub vpl_sets: u32,
    /// Seed of every random number.
    pub seed: u64,
    /// Upper bound of the geometry term `cos·cos/d²` of VPLs, in 1/(scene unit)²; `None`: unbounded.
    pub geometry_clamp: Option<f32>,
    /// Choice of points on the emitters.
    pub light_points: LightPoints,
}

/// A number that no frame can have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// A count outside its limits.
    #[error("{what} is {value}, but must be from {min} to {max}")]
    OutOfRange {
        /// Name of the setting.
        what: &'static str,
        /// The refused value.
        value: u64,
        /// Smallest accepted value.
        min: u64,
        /// Largest accepted value.
        max: u64,
    },
    /// The sets would differ in size.
    #[error(
        "{vpls} VPLs cannot be divided into {vpl_sets} sets of equal size; choose a number of sets that divides {vpls}"
    )]
    UnevenSets {
        /// VPLs in all.
        vpls: u32,
        /// Sets asked for.
        vpl_sets: u32,
    },
    /// The picture is empty or too large.
    #[error("an image of {width}×{height} pixels is not possible: each side must be from 1 to {side_max}, and the picture at most {pixels_max} pixels", side_max = ImageSize::SIDE_MAX, pixels_max = ImageSize::PIXELS_MAX)]
    Size {
        /// Pixels per row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The bound of the geometry term is not a positive number.
    #[error("the bound of the geometry term is {0}, but must be a positive number")]
    Clamp(f32),
}

impl Settings {
    /// Most pixel groups.
    pub const GROUPS_MAX: u32 = 65_536;
    /// Most light samples per pixel.
    pub const SPP_MAX: u32 = 65_536;
    /// Most virtual point lights.
    pub const VPLS_MAX: u32 = 1 << 20;
    /// Most VPL sets.
    pub const VPL_SETS_MAX: u32 = 4_096;

    /// The parameters of the paper's section 4.1, at any size.
    pub fn paper(algorithm: Algorithm, size: ImageSize) -> Self {
        Self {
            algorithm,
            size,
            groups: match algorithm {
                Algorithm::Straightforward => 2_048,
                Algorithm::Component | Algorithm::Progressive => 64,
            },
            spp: 16,
            vpls: 256,
            vpl_sets: 16,
            seed: 0,
            geometry_clamp: None,
            light_points: LightPoints::PerPass,
        }
    }

    /// What the progressive algorithm does when nothing else is asked for.
    pub fn progressive(size: ImageSize) -> Self {
        Self {
            algorithm: Algorithm::Progressive,
            size,
            groups: 16,
            spp: 64,
            vpls: 16_384,
            vpl_sets: 1_024,
            seed: 0,
            geometry_clamp: None,
            light_points: LightPoints::PerPixel,
        }
    }

    /// Checks every limit.
    pub fn validate(&self) -> Result<(), SettingsError> {
        if !self.size.is_valid() {
            return Err(SettingsError::Size {
                width: self.size.width,
                height: self.size.height,
            });
        }
        in_range("the number of pixel groups", self.groups, Self::GROUPS_MAX)?;
        in_range(
            "the number of light samples per pixel (spp)",
            self.spp,
            Self::SPP_MAX,
        )?;
        in_range("the number of VPLs", self.vpls, Self::VPLS_MAX)?;
        in_range("the number of VPL sets", self.vpl_sets, Self::VPL_SETS_MAX)?;
        if !self.vpls.is_multiple_of(self.vpl_sets) {
            return Err(SettingsError::UnevenSets {
                vpls: self.vpls,
                vpl_sets: self.vpl_sets,
            });
        }
        match self.geometry_clamp {
            Some(bound) if !(bound.is_finite() && bound > 0.0) => Err(SettingsError::Clamp(bound)),
            _ => Ok(()),
        }
    }

    /// VPLs in each set.
    pub fn vpls_per_set(&self) -> u32 {
        self.vpls / self.vpl_sets
    }
}

fn in_range(what: &'static str, value: u32, max: u32) -> Result<(), SettingsError> {
    if (1..=max).contains(&value) {
        return Ok(());
    }
    Err(SettingsError::OutOfRange {
        what,
        value: value.into(),
        min: 1,
        max: max.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: ImageSize = ImageSize {
        width: 1024,
        height: 768,
    };

    #[test]
    fn the_settings_of_every_algorithm_are_valid() {
        for algorithm in [Algorithm::Component, Algorithm::Straightforward] {
            Settings::paper(algorithm, SIZE).validate().unwrap();
        }
        Settings::progressive(SIZE).validate().unwrap();
    }

    #[test]
    fn each_number_out_of_range_is_refused_by_name() {
        let paper = Settings::paper(Algorithm::Component, SIZE);
        let cases = [
            (Settings { groups: 0, ..paper }, "pixel groups"),
            (Settings { spp: 0, ..paper }, "spp"),
            (Settings { vpls: 0, ..paper }, "VPLs"),
            (Settings { vpl_sets: 0, ..paper }, "VPL sets"),
            (
                Settings {
                    vpl_sets: 15,
                    ..paper
                },
                "divided into 15",
            ),
            (
                Settings {
                    size: ImageSize { width: 0, height: 9 },
                    ..paper
                },
                "0×9",
            ),
            (
                Settings {
                    size: ImageSize {
                        width: 1_000_000,
                        height: 1_000_000,
                    },
                    ..paper
                },
                "1000000",
            ),
            (
                Settings {
                    geometry_clamp: Some(f32::NAN),
                    ..paper
                },
                "NaN",
            ),
        ];
        for (settings, message) in cases {
            let error = settings.validate().unwrap_err().to_string();
            assert!(error.contains(message), "{error:?} does not say {message:?}");
        }
    }
}
