//! The unit of work: one component of the light for one pixel group.

use crate::settings::{Algorithm, Settings};

/// A part of the light that is computed, buffered and reconstructed apart from the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Component {
    /// Light that comes straight from the emitters.
    Direct,
    /// Diffuse light from one set of virtual point lights.
    Indirect,
    /// Both at once, as the straightforward algorithm has it.
    Full,
}

impl Component {
    /// Numbers per pixel in a result: RGB, and for [`Component::Full`] direct RGB then indirect RGB.
    pub fn floats_per_pixel(self) -> usize {
        match self {
            Self::Direct | Self::Indirect => 3,
            Self::Full => 6,
        }
    }

    /// Tasks for each group of a frame with these settings: passes, or VPL sets; 0 if its algorithm
    /// has no such component.
    pub fn tasks_per_group(self, settings: &Settings) -> u32 {
        match (settings.algorithm, self) {
            (Algorithm::Progressive, Self::Direct | Self::Indirect)
            | (Algorithm::Component, Self::Direct) => settings.spp,
            (Algorithm::Component, Self::Indirect) => settings.vpl_sets,
            (Algorithm::Straightforward, Self::Full) => 1,
            _ => 0,
        }
    }
}

/// One task. The light it yields depends on scene, settings and these numbers alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Task {
    /// Which part of the light.
    pub component: Component,
    /// Which pixels.
    pub group: u32,
    /// Direct: the light sample (pass). Indirect: the VPL set. Full: 0. Progressive: the first pass.
    pub index: u32,
    /// Progressive: so many passes, added up; a power of two that divides `index`. Otherwise 1.
    pub passes: u32,
}

impl Task {
    /// Whether a frame with these settings has this task.
    pub fn is_within(self, settings: &Settings) -> bool {
        let is_span = match settings.algorithm {
            Algorithm::Progressive => self.passes.is_power_of_two() && self.index.is_multiple_of(self.passes),
            _ => self.passes == 1,
        };
        let end = self.index.checked_add(self.passes);
        let all = self.component.tasks_per_group(settings);
        self.group < settings.groups && is_span && end.is_some_and(|end| end <= all)
    }

    /// Progressive: which half of the samples the task belongs to. Spans of equal length take turns.
    pub fn half(self) -> usize {
        (self.index / self.passes % 2) as usize
    }
}

/// Rays traced for a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// Rays from the eye.
    pub primary: u64,
    /// Rays that asked whether a light is visible.
    pub shadow: u64,
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.shadow += other.shadow;
    }
}
