//! The unit of work: one component of one pixel group.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Which part of the light a task computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Component {
    /// Direct light, one light point per pixel.
    Direct,
    /// Indirect light, from one set of VPLs.
    Indirect,
    /// Everything at once, for the straightforward algorithm.
    Full,
}

impl Component {
    /// Numbers per pixel in a result: RGB, or direct RGB followed by indirect RGB.
    pub fn floats_per_pixel(self) -> usize {
        match self {
            Self::Direct | Self::Indirect => 3,
            Self::Full => 6,
        }
    }

    /// The word on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Indirect => "indirect",
            Self::Full => "full",
        }
    }
}

/// A task names itself: within a frame no two are equal, and none is issued twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Task {
    /// The part of the light.
    pub component: Component,
    /// The pixel group, `group < groups`.
    pub group: u32,
    /// The light sample (direct), the VPL set (indirect), or 0 (full); progressive: the first pass.
    pub index: u32,
    /// Progressive: so many passes, added up; otherwise 1.
    #[serde(default = "one")]
    pub passes: u32,
}

fn one() -> u32 {
    1
}

impl fmt::Display for Task {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} {} of group {}",
            self.component.name(),
            self.index,
            self.group
        )
    }
}
