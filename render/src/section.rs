//! Sections of a pixel group, whose points are in an order in which near ones share packets of rays.
//!
//! The pixels of a group come in an order whose beginnings are spread over the image, so neighbours in it
//! are far apart. Rays to near points are up to two and a half times as fast when they are traced together,
//! and a ray's answer does not depend on the packet it is in: so each run of pixels is traced along a curve
//! through the surfaces that they show, and its light put back into the group's order.

use std::{borrow::Cow, ops::Range};

use glam::Vec3;

use crate::{curve::Curve, gbuffer::GBuffer, intersect::TracedScene, scene::ImageSize};

/// The first surfaces behind a section of a group or a run of it, along the curve.
#[derive(Debug, Clone)]
pub struct Section {
    places: Vec<u32>,
    points: GBuffer,
}

impl Section {
    /// Traces the pixels of a section, given in the group's order (row-major indices).
    pub fn trace(scene: &TracedScene, size: ImageSize, pixels: &[u32]) -> Self {
        let seen = GBuffer::trace(scene, size, pixels);
        let mut places: Vec<u32> = (0..pixels.len() as u32).collect();
        if let Some(bounds) = scene.accelerated().bounds() {
            let curve = Curve::through(Vec3::from(bounds.min), Vec3::from(bounds.max));
            places.sort_by_cached_key(|&place| {
                let lane = place as usize;
                curve.place(seen.position.get(lane), seen.geometric_normal.get(lane))
            });
        }
        Self {
            points: seen.select(&places),
            places,
        }
    }

    /// The points of a run of the section, still along the curve; their places are those in the section.
    pub fn run(&self, run: &Range<usize>) -> Cow<'_, Self> {
        if run.len() == self.places.len() {
            return Cow::Borrowed(self);
        }
        let lanes: Vec<u32> = (0..self.places.len() as u32)
            .filter(|&lane| run.contains(&(self.places[lane as usize] as usize)))
            .collect();
        Cow::Owned(Self {
            places: lanes.iter().map(|&lane| self.places[lane as usize]).collect(),
            points: self.points.select(&lanes),
        })
    }

    /// The points, for packets of rays.
    pub fn points(&self) -> &GBuffer {
        &self.points
    }

    /// The place in the section of the pixel in each lane.
    pub fn places(&self) -> &[u32] {
        &self.places
    }
}
