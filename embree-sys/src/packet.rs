//! Packets of 4, 8 or 16 rays, in the layout that Embree traces.

use std::ffi::c_void;

use crate::{
    geometry::GeometryId,
    raw::{self, RTCIntersectArguments, RTCOccludedArguments, RTCScene},
    ray::{Hit, NOTHING, Ray},
};

/// `N` rays, each field an array over the lanes; the fields mean what those of
/// [`Ray`] do. Laid out like `RTCRay4`, `RTCRay8` or `RTCRay16`.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct RayPacket<const N: usize> {
    /// Origins.
    pub org_x: [f32; N],
    /// Origins.
    pub org_y: [f32; N],
    /// Origins.
    pub org_z: [f32; N],
    /// Starts of the segments.
    pub tnear: [f32; N],
    /// Directions.
    pub dir_x: [f32; N],
    /// Directions.
    pub dir_y: [f32; N],
    /// Directions.
    pub dir_z: [f32; N],
    time: [f32; N],
    /// Ends of the segments. Tracing writes here: the distance of a hit, or −∞
    /// for an occluded ray.
    pub tfar: [f32; N],
    mask: [u32; N],
    id: [u32; N],
    flags: [u32; N],
}

/// `N` hits, each field an array over the lanes. Laid out like `RTCHit4`,
/// `RTCHit8` or `RTCHit16`.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct HitPacket<const N: usize> {
    /// Geometric normals, not normalised.
    pub ng_x: [f32; N],
    /// Geometric normals, not normalised.
    pub ng_y: [f32; N],
    /// Geometric normals, not normalised.
    pub ng_z: [f32; N],
    /// Barycentric weights of the second corners.
    pub u: [f32; N],
    /// Barycentric weights of the third corners.
    pub v: [f32; N],
    /// Indices of the triangles in their meshes.
    pub primitive: [u32; N],
    /// Numbers of the meshes; the highest number where nothing was hit.
    pub geometry: [u32; N],
    instance: [u32; N],
    /// Unused by Embree 4.0 to 4.2, which end a hit before it.
    instance_primitive: [u32; N],
}

/// Rays and what they hit. Laid out like `RTCRayHit4`, `RTCRayHit8` or
/// `RTCRayHit16`.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct RayHitPacket<const N: usize> {
    /// The rays; their `tfar` becomes the distance of the hit.
    pub rays: RayPacket<N>,
    /// The hits; what they were before tracing does not matter.
    pub hits: HitPacket<N>,
}

/// Which lanes of a packet hold a ray to be traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct LaneMask<const N: usize>([i32; N]);

/// A number of lanes as a type, so that code may be written for any of the
/// three: `fn gather<const N: usize>(…) where Lanes<N>: PacketSize`.
#[derive(Debug, Clone, Copy)]
pub struct Lanes<const N: usize>;

/// Holds for `Lanes<4>`, `Lanes<8>` and `Lanes<16>` only.
pub trait PacketSize: sealed::Calls {}

impl<const N: usize> RayPacket<N> {
    /// A packet of empty segments.
    #[inline]
    pub fn new() -> Self {
        Self {
            org_x: [0.0; N],
            org_y: [0.0; N],
            org_z: [0.0; N],
            tnear: [0.0; N],
            dir_x: [0.0; N],
            dir_y: [0.0; N],
            dir_z: [0.0; N],
            time: [0.0; N],
            tfar: [0.0; N],
            mask: [u32::MAX; N],
            id: [0; N],
            flags: [0; N],
        }
    }

    /// Puts a ray into a lane.
    ///
    /// # Panics
    /// If `lane` is not below `N`.
    #[inline]
    pub fn set(&mut self, lane: usize, ray: &Ray) {
        [self.org_x[lane], self.org_y[lane], self.org_z[lane]] = ray.origin;
        [self.dir_x[lane], self.dir_y[lane], self.dir_z[lane]] = ray.dir;
        self.tnear[lane] = ray.tnear;
        self.tfar[lane] = ray.tfar;
    }

    /// The ray in a lane.
    ///
    /// # Panics
    /// If `lane` is not below `N`.
    #[inline]
    pub fn get(&self, lane: usize) -> Ray {
        Ray {
            origin: [self.org_x[lane], self.org_y[lane], self.org_z[lane]],
            dir: [self.dir_x[lane], self.dir_y[lane], self.dir_z[lane]],
            tnear: self.tnear[lane],
            tfar: self.tfar[lane],
        }
    }

    /// After [`Scene::occluded`](crate::Scene::occluded): bit `i` is set if the
    /// ray in lane `i` meets something. Lanes that were not traced keep their
    /// `tfar`.
    #[inline]
    pub fn occluded_bits(&self) -> u32 {
        (0..N).fold(0, |bits, lane| bits | (u32::from(self.tfar[lane] < 0.0) << lane))
    }

    /// Embree's terms hold for every lane of `valid`; checked in debug builds.
    pub(crate) fn is_valid(&self, valid: &LaneMask<N>) -> bool {
        (0..N).all(|lane| valid.0[lane] == 0 || self.get(lane).is_valid())
    }
}

impl<const N: usize> Default for RayPacket<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> RayHitPacket<N> {
    /// Rays that have hit nothing yet.
    #[inline]
    pub fn new(rays: RayPacket<N>) -> Self {
        let hits = HitPacket {
            ng_x: [0.0; N],
            ng_y: [0.0; N],
            ng_z: [0.0; N],
            u: [0.0; N],
            v: [0.0; N],
            primitive: [NOTHING; N],
            geometry: [NOTHING; N],
            instance: [NOTHING; N],
            instance_primitive: [NOTHING; N],
        };
        Self { rays, hits }
    }

    /// What the ray in a lane hit.
    ///
    /// # Panics
    /// If `lane` is not below `N`.
    #[inline]
    pub fn hit(&self, lane: usize) -> Option<Hit> {
        let hits = &self.hits;
        if hits.geometry[lane] == NOTHING {
            return None;
        }
        Some(Hit {
            t: self.rays.tfar[lane],
            u: hits.u[lane],
            v: hits.v[lane],
            primitive: hits.primitive[lane],
            geometry: GeometryId(hits.geometry[lane]),
            ng: [hits.ng_x[lane], hits.ng_y[lane], hits.ng_z[lane]],
        })
    }

    /// What Embree asks of hits before a call ("Embree API", rtcIntersect1).
    #[inline]
    pub(crate) fn forget_hits(&mut self) {
        self.hits.geometry = [NOTHING; N];
        self.hits.instance = [NOTHING; N];
    }
}

impl<const N: usize> LaneMask<N> {
    /// All lanes.
    pub const ALL: Self = Self([-1; N]);

    /// The lanes below `count`.
    #[inline]
    pub fn first(count: usize) -> Self {
        Self(std::array::from_fn(|lane| -i32::from(lane < count)))
    }

    /// The lanes that are true.
    #[inline]
    pub fn from_lanes(lanes: [bool; N]) -> Self {
        Self(lanes.map(|lane| -i32::from(lane)))
    }

    /// Number of lanes in the mask.
    #[inline]
    pub fn count(&self) -> u32 {
        self.0.iter().sum::<i32>().unsigned_abs()
    }

    /// The lanes whose bit is set.
    #[inline]
    pub fn from_bits(bits: u32) -> Self {
        Self(std::array::from_fn(|lane| -i32::from(bits >> lane & 1 == 1)))
    }

    /// Bit `i` is set if lane `i` is in the mask.
    #[inline]
    pub fn bits(&self) -> u32 {
        (0..N).fold(0, |bits, lane| bits | (u32::from(self.0[lane] != 0) << lane))
    }

    pub(crate) fn as_ptr(&self) -> *const i32 {
        self.0.as_ptr()
    }
}

pub(crate) mod sealed {
    use super::{RTCIntersectArguments, RTCOccludedArguments, RTCScene, c_void};

    /// Embree's calls for one number of lanes.
    pub trait Calls {
        /// # Safety
        /// As for `rtcIntersect4/8/16`; `rays` is a `RayHitPacket` of this size.
        unsafe fn intersect(
            valid: *const i32,
            scene: RTCScene,
            rays: *mut c_void,
            arguments: *mut RTCIntersectArguments,
        );

        /// # Safety
        /// As for `rtcOccluded4/8/16`; `rays` is a `RayPacket` of this size.
        unsafe fn occluded(
            valid: *const i32,
            scene: RTCScene,
            rays: *mut c_void,
            arguments: *mut RTCOccludedArguments,
        );
    }
}

macro_rules! packet_size {
    ($lanes:literal, $rays:ident, $hits:ident, $ray_hits:ident, $intersect:ident, $occluded:ident) => {
        impl PacketSize for Lanes<$lanes> {}

        impl sealed::Calls for Lanes<$lanes> {
            #[inline]
            unsafe fn intersect(
                valid: *const i32,
                scene: RTCScene,
                rays: *mut c_void,
                arguments: *mut RTCIntersectArguments,
            ) {
                // SAFETY: the caller keeps the terms of "Embree API",
                // rtcIntersect4/8/16; the layouts are the same (asserted below).
                unsafe { raw::$intersect(valid, scene, rays.cast(), arguments) };
            }

            #[inline]
            unsafe fn occluded(
                valid: *const i32,
                scene: RTCScene,
                rays: *mut c_void,
                arguments: *mut RTCOccludedArguments,
            ) {
                // SAFETY: the caller keeps the terms of "Embree API",
                // rtcOccluded4/8/16; the layouts are the same (asserted below).
                unsafe { raw::$occluded(valid, scene, rays.cast(), arguments) };
            }
        }

        // Our packets are what Embree expects: every field at the same place,
        // no smaller, no less aligned.
        const _: () = {
            use std::mem::offset_of;
            type Rays = RayPacket<$lanes>;
            type Hits = HitPacket<$lanes>;
            assert!(size_of::<Rays>() == size_of::<raw::$rays>());
            assert!(align_of::<Rays>() >= align_of::<raw::$rays>());
            assert!(align_of::<LaneMask<$lanes>>() >= align_of::<raw::$rays>());
            assert!(offset_of!(Rays, org_x) == offset_of!(raw::$rays, org_x));
            assert!(offset_of!(Rays, org_y) == offset_of!(raw::$rays, org_y));
            assert!(offset_of!(Rays, org_z) == offset_of!(raw::$rays, org_z));
            assert!(offset_of!(Rays, tnear) == offset_of!(raw::$rays, tnear));
            assert!(offset_of!(Rays, dir_x) == offset_of!(raw::$rays, dir_x));
            assert!(offset_of!(Rays, dir_y) == offset_of!(raw::$rays, dir_y));
            assert!(offset_of!(Rays, dir_z) == offset_of!(raw::$rays, dir_z));
            assert!(offset_of!(Rays, time) == offset_of!(raw::$rays, time));
            assert!(offset_of!(Rays, tfar) == offset_of!(raw::$rays, tfar));
            assert!(offset_of!(Rays, mask) == offset_of!(raw::$rays, mask));
            assert!(offset_of!(Rays, id) == offset_of!(raw::$rays, id));
            assert!(offset_of!(Rays, flags) == offset_of!(raw::$rays, flags));
            assert!(offset_of!(Hits, ng_x) == offset_of!(raw::$hits, Ng_x));
            assert!(offset_of!(Hits, ng_y) == offset_of!(raw::$hits, Ng_y));
            assert!(offset_of!(Hits, ng_z) == offset_of!(raw::$hits, Ng_z));
            assert!(offset_of!(Hits, u) == offset_of!(raw::$hits, u));
            assert!(offset_of!(Hits, v) == offset_of!(raw::$hits, v));
            assert!(offset_of!(Hits, primitive) == offset_of!(raw::$hits, primID));
            assert!(offset_of!(Hits, geometry) == offset_of!(raw::$hits, geomID));
            assert!(offset_of!(Hits, instance) == offset_of!(raw::$hits, instID));
            assert!(offset_of!(RayHitPacket<$lanes>, rays) == offset_of!(raw::$ray_hits, ray));
            assert!(offset_of!(RayHitPacket<$lanes>, hits) == offset_of!(raw::$ray_hits, hit));
            assert!(size_of::<RayHitPacket<$lanes>>() >= size_of::<raw::$ray_hits>());
            // One level of instances, or the hits would be longer than ours.
            assert!(raw::RTC_MAX_INSTANCE_LEVEL_COUNT == 1);
        };
    };
}

packet_size!(4, RTCRay4, RTCHit4, RTCRayHit4, rtcIntersect4, rtcOccluded4);
packet_size!(8, RTCRay8, RTCHit8, RTCRayHit8, rtcIntersect8, rtcOccluded8);
packet_size!(16, RTCRay16, RTCHit16, RTCRayHit16, rtcIntersect16, rtcOccluded16);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_is_its_bits() {
        assert_eq!(LaneMask::<8>::ALL.bits(), 0xff);
        assert_eq!(LaneMask::<8>::first(3).bits(), 0b111);
        assert_eq!(LaneMask::<16>::from_bits(0x8001).bits(), 0x8001);
        assert_eq!(LaneMask::from_lanes([true, false, true, true]).bits(), 0b1101);
        assert_eq!(LaneMask::from_lanes([true, false, true, true]).count(), 3);
    }

    #[test]
    fn a_packet_gives_back_the_rays_put_into_it() {
        let ray = Ray::new([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]).between(7.0, 8.0);
        let mut packet = RayPacket::<4>::new();
        packet.set(2, &ray);
        assert_eq!(packet.get(2), ray);
        assert_ne!(packet.get(1), ray);
    }
}
