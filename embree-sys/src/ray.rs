//! One ray, and where it hits.

use crate::{
    geometry::GeometryId,
    raw::{RTCHit, RTCRay, RTCRayHit, RTCRayQueryFlags},
};

/// The segment from `origin + tnear·dir` to `origin + tfar·dir`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts, in scene units.
    pub origin: [f32; 3],
    /// Where it goes; of any length but zero.
    pub dir: [f32; 3],
    /// Start of the segment, in lengths of `dir`; not negative.
    pub tnear: f32,
    /// End of the segment, in lengths of `dir`; may be infinite.
    pub tfar: f32,
}

/// Where a ray hits a triangle first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in lengths of its `dir`.
    pub t: f32,
    /// Barycentric weight of the triangle's second corner.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner.
    pub v: f32,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
    /// The mesh.
    pub geometry: GeometryId,
    /// Geometric normal, not normalised; to the side from which the corners are
    /// seen counter-clockwise, whichever side was hit.
    pub ng: [f32; 3],
}

/// Whether the rays of a packet go much the same way. Only speed depends on it;
/// which is faster differs from scene to scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Coherence {
    /// Each ray finds its own way through the tree.
    #[default]
    Incoherent,
    /// The packet goes through the tree as one.
    Coherent,
}

impl Ray {
    /// The half line from `origin` along `dir`.
    pub fn new(origin: [f32; 3], dir: [f32; 3]) -> Self {
        Self {
            origin,
            dir,
            tnear: 0.0,
            tfar: f32::INFINITY,
        }
    }

    /// The same line, between two distances in lengths of `dir`.
    #[must_use]
    pub fn between(self, tnear: f32, tfar: f32) -> Self {
        Self { tnear, tfar, ..self }
    }

    /// What Embree asks of a ray ("Embree API", rtcIntersect1); checked in debug
    /// builds only.
    pub(crate) fn is_valid(&self) -> bool {
        let numbers = self.origin.iter().chain(&self.dir);
        numbers.copied().all(f32::is_finite) && self.tnear >= 0.0 && !self.tfar.is_nan()
    }

    #[inline]
    pub(crate) fn to_raw(self) -> RTCRay {
        RTCRay {
            org_x: self.origin[0],
            org_y: self.origin[1],
            org_z: self.origin[2],
            tnear: self.tnear,
            dir_x: self.dir[0],
            dir_y: self.dir[1],
            dir_z: self.dir[2],
            time: 0.0,
            tfar: self.tfar,
            mask: u32::MAX,
            id: 0,
            flags: 0,
        }
    }
}

impl Hit {
    #[inline]
    pub(crate) fn from_raw(RTCRayHit { ray, hit }: &RTCRayHit) -> Option<Self> {
        if hit.geomID == NOTHING {
            return None;
        }
        Some(Self {
            t: ray.tfar,
            u: hit.u,
            v: hit.v,
            primitive: hit.primID,
            geometry: GeometryId(hit.geomID),
            ng: [hit.Ng_x, hit.Ng_y, hit.Ng_z],
        })
    }

    /// What Embree asks a hit to be before a call.
    #[inline]
    pub(crate) fn none() -> RTCHit {
        RTCHit {
            geomID: NOTHING,
            instID: [NOTHING; _],
            ..RTCHit::default()
        }
    }
}

/// The number for "no geometry" (`RTC_INVALID_GEOMETRY_ID`).
pub(crate) const NOTHING: u32 = u32::MAX;

impl Coherence {
    #[inline]
    pub(crate) fn flags(self) -> RTCRayQueryFlags {
        match self {
            Self::Incoherent => RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_INCOHERENT,
            Self::Coherent => RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_COHERENT,
        }
    }
}
