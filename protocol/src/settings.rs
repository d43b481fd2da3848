//! What every task of a frame has in common.

use serde::{Deserialize, Serialize};

use crate::limits::{self, LimitError, one_to};

/// How the work is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// Passes of direct and of indirect light, each through other places of the pixels.
    Progressive,
    /// Direct and indirect light are tasks of their own (section 3.2 of the paper).
    Component,
    /// A task computes all light of its pixels (section 3.1).
    Straightforward,
}

/// How the points on the lights are chosen in a direct pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightPoints {
    /// One point for all pixels of the pass, as in the paper.
    PerPass,
    /// Each pixel has its own.
    PerPixel,
}

/// The settings of a frame. Together with scene, VPLs and task they determine every result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// How the work is cut.
    pub algorithm: Algorithm,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Pixel groups.
    pub groups: u32,
    /// Direct passes: light samples per pixel; progressive: passes of each component.
    pub spp: u32,
    /// VPLs wanted in all sets together.
    pub vpls: u32,
    /// VPL sets.
    pub vpl_sets: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Upper bound of the geometry term, in 1/(scene unit)²; none: unbounded.
    #[serde(default)]
    pub geometry_clamp: Option<f32>,
    /// How light points are chosen.
    pub light_points: LightPoints,
}

impl Settings {
    /// Checks the limits, so that what follows from the settings can be allocated.
    pub fn check(&self) -> Result<(), LimitError> {
        one_to("settings.width", self.width, limits::IMAGE_SIDE)?;
        one_to("settings.height", self.height, limits::IMAGE_SIDE)?;
        one_to("settings.groups", self.groups, limits::GROUPS)?;
        one_to("settings.spp", self.spp, limits::SPP)?;
        one_to("settings.vpls", self.vpls, limits::VPLS)?;
        one_to("settings.vpl_sets", self.vpl_sets, limits::VPL_SETS)?;
        self.check_pixels()?;
        self.check_clamp()
    }

    fn check_pixels(&self) -> Result<(), LimitError> {
        let pixels = u64::from(self.width) * u64::from(self.height);
        if pixels > limits::IMAGE_PIXELS {
            let value = format!("{} x {}", self.width, self.height);
            let allowed = format!("{} pixels", limits::IMAGE_PIXELS);
            return Err(LimitError {
                what: "settings.width x height",
                value,
                allowed,
            });
        }
        let group_pixels = pixels.div_ceil(u64::from(self.groups));
        if group_pixels > u64::from(limits::GROUP_PIXELS) {
            let value = format!("{group_pixels} pixels in {} groups", self.groups);
            let allowed = format!("{} pixels per group: use more groups", limits::GROUP_PIXELS);
            return Err(LimitError {
                what: "settings.groups",
                value,
                allowed,
            });
        }
        Ok(())
    }

    fn check_clamp(&self) -> Result<(), LimitError> {
        match self.geometry_clamp {
            Some(clamp) if !(clamp.is_finite() && clamp > 0.0) => Err(LimitError {
                what: "settings.geometry_clamp",
                value: clamp.to_string(),
                allowed: "a positive number, or none".to_owned(),
            }),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paper() -> Settings {
        Settings {
            algorithm: Algorithm::Component,
            width: 1024,
            height: 768,
            groups: 64,
            spp: 16,
            vpls: 256,
            vpl_sets: 16,
            seed: 1,
            geometry_clamp: Some(10.0),
            light_points: LightPoints::PerPass,
        }
    }

    fn refused(change: impl FnOnce(&mut Settings)) -> &'static str {
        let mut settings = paper();
        change(&mut settings);
        settings.check().unwrap_err().what
    }

    #[test]
    fn the_settings_of_the_paper_are_within_the_limits() {
        assert_eq!(paper().check(), Ok(()));
    }

    #[test]
    fn each_setting_has_a_limit() {
        assert_eq!(refused(|s| s.width = 0), "settings.width");
        assert_eq!(refused(|s| s.height = 1_000_000), "settings.height");
        assert_eq!(
            refused(|s| (s.width, s.height) = (16_384, 16_384)),
            "settings.width x height"
        );
        assert_eq!(
            refused(|s| (s.width, s.height, s.groups) = (8192, 8192, 1)),
            "settings.groups"
        );
        assert_eq!(refused(|s| s.groups = 0), "settings.groups");
        assert_eq!(refused(|s| s.spp = 0), "settings.spp");
        assert_eq!(refused(|s| s.vpls = u32::MAX), "settings.vpls");
        assert_eq!(refused(|s| s.vpl_sets = 0), "settings.vpl_sets");
        assert_eq!(
            refused(|s| s.geometry_clamp = Some(f32::NAN)),
            "settings.geometry_clamp"
        );
        assert_eq!(
            refused(|s| s.geometry_clamp = Some(-1.0)),
            "settings.geometry_clamp"
        );
    }
}
