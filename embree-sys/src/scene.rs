//! Scenes: built once, then only traced.

use std::{ffi::c_void, ptr, sync::Arc};

use crate::{
    device::Device,
    error::Error,
    geometry::{GeometryId, TriangleMesh},
    packet::{LaneMask, Lanes, PacketSize, RayHitPacket, RayPacket, sealed::Calls},
    raw::{
        self, RTCBounds, RTCBuildQuality, RTCFeatureFlags, RTCIntersectArguments, RTCOccludedArguments,
        RTCRayHit, RTCScene, RTCSceneFlags,
    },
    ray::{Coherence, Hit, Ray},
};

/// Collects triangles and settings. Nothing of it reaches Embree before
/// [`commit`](Self::commit), which ends in a [`Scene`] that can no longer change.
#[derive(Debug)]
pub struct SceneBuilder {
    device: Device,
    meshes: Vec<TriangleMesh>,
    quality: BuildQuality,
    robust: bool,
    compact: bool,
}

/// How much time goes into the tree that rays are traced through.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BuildQuality {
    /// Quickest to build.
    Low,
    /// The balance that most scenes want.
    #[default]
    Medium,
    /// About four times slower to build, quicker to trace where triangles are
    /// long and thin.
    High,
}

/// A scene that is ready and never changes; clones are the same scene. May be
/// traced from any number of threads at the same time.
#[derive(Debug, Clone)]
pub struct Scene {
    /// A copy of the shared handle, one indirection nearer to the rays.
    handle: RTCScene,
    shared: Arc<Shared>,
}

/// A box around a scene, in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least coordinates.
    pub min: [f32; 3],
    /// Greatest coordinates.
    pub max: [f32; 3],
}

#[derive(Debug)]
struct Shared {
    handle: RTCScene,
    /// Read by Embree through the handle; Rust drops fields after `Shared`
    /// itself, so they outlive it.
    meshes: Vec<TriangleMesh>,
    bounds: Option<Bounds>,
    device: Device,
}

// SAFETY: rays may be traced through a committed scene from any number of threads
// at the same time ("Embree API", introduction), and nothing here changes it
// after `commit`.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}
// SAFETY: as above; releasing may happen in any thread ("Embree API",
// rtcReleaseScene).
unsafe impl Send for Shared {}
// SAFETY: as above.
unsafe impl Sync for Shared {}

impl SceneBuilder {
    /// An empty scene.
    pub fn new(device: &Device) -> Self {
        Self {
            device: device.clone(),
            meshes: Vec::new(),
            quality: BuildQuality::default(),
            robust: false,
            compact: false,
        }
    }

    /// How much time the build may take.
    #[must_use]
    pub fn build_quality(self, quality: BuildQuality) -> Self {
        Self { quality, ..self }
    }

    /// Whether rays may not slip through edges that triangles share; costs some
    /// speed.
    #[must_use]
    pub fn robust(self, robust: bool) -> Self {
        Self { robust, ..self }
    }

    /// Whether to save memory at the cost of some speed.
    #[must_use]
    pub fn compact(self, compact: bool) -> Self {
        Self { compact, ..self }
    }

    /// Adds a mesh; see [`TriangleMesh::new`] for what it takes.
    ///
    /// # Errors
    /// Those of [`TriangleMesh::new`], or [`Error::TooLarge`] for too many meshes.
    pub fn attach_triangles(
        &mut self,
        positions: Vec<[f32; 3]>,
        indices: Vec<[u32; 3]>,
    ) -> Result<GeometryId, Error> {
        let id = u32::try_from(self.meshes.len()).map_err(|_too_many| Error::TooLarge {
            what: "meshes",
            count: self.meshes.len(),
            count_max: u32::MAX as usize,
        })?;
        self.meshes.push(TriangleMesh::new(positions, indices)?);
        Ok(GeometryId(id))
    }

    /// Builds the scene, in Embree's own threads, and waits for it. Scenes of one
    /// device are built one after the other.
    ///
    /// # Errors
    /// [`Error::Embree`], usually for want of memory.
    pub fn commit(self) -> Result<Scene, Error> {
        let device = self.device.clone();
        let _alone = device.build_alone();

        // SAFETY: the device is live ("Embree API", rtcNewScene); NULL is
        // handled next.
        let handle = unsafe { raw::rtcNewScene(self.device.handle()) };
        if handle.is_null() {
            return Err(self.device.failure("making a scene"));
        }
        // From here on an early return releases the scene.
        let mut shared = Shared {
            handle,
            meshes: self.meshes,
            bounds: None,
            device: self.device,
        };

        // SAFETY: the scene is live and not yet seen by another thread ("Embree
        // API", rtcSetSceneBuildQuality and rtcSetSceneFlags).
        unsafe {
            raw::rtcSetSceneBuildQuality(handle, self.quality.to_raw());
            raw::rtcSetSceneFlags(handle, scene_flags(self.robust, self.compact));
        }
        for (mesh, id) in shared.meshes.iter().zip(0..) {
            // SAFETY: the scene is live, and `shared` keeps the meshes unchanged
            // until after it has released the scene.
            unsafe { mesh.attach(&shared.device, handle, GeometryId(id)) }?;
        }
        // SAFETY: the scene is live and no other thread uses it yet ("Embree
        // API", rtcCommitScene).
        unsafe { raw::rtcCommitScene(handle) };
        shared.device.check("building the scene")?;
        shared.bounds = bounds_of(handle);
        Ok(Scene {
            handle,
            shared: Arc::new(shared),
        })
    }
}

impl Scene {
    /// The first thing that a ray meets.
    #[inline]
    pub fn intersect1(&self, ray: &Ray) -> Option<Hit> {
        debug_assert!(ray.is_valid(), "Embree cannot trace {ray:?}");
        let mut ray_hit = RTCRayHit {
            ray: ray.to_raw(),
            hit: Hit::none(),
        };
        // SAFETY: the scene is committed; the ray is on our stack, aligned by
        // its type, with geomID and instID set to "none"; NULL asks for the
        // usual arguments ("Embree API", rtcIntersect1).
        unsafe { raw::rtcIntersect1(self.handle, &raw mut ray_hit, ptr::null_mut()) };
        Hit::from_raw(&ray_hit)
    }

    /// Whether a ray meets anything.
    #[inline]
    pub fn occluded1(&self, ray: &Ray) -> bool {
        debug_assert!(ray.is_valid(), "Embree cannot trace {ray:?}");
        let mut ray = ray.to_raw();
        // SAFETY: the scene is committed; the ray is on our stack, aligned by
        // its type; NULL asks for the usual arguments ("Embree API",
        // rtcOccluded1).
        unsafe { raw::rtcOccluded1(self.handle, &raw mut ray, ptr::null_mut()) };
        ray.tfar < 0.0
    }

    /// The first things that the rays of a packet meet, in the lanes of `valid`.
    /// Hits of other lanes are forgotten too.
    #[inline]
    pub fn intersect<const N: usize>(
        &self,
        valid: &LaneMask<N>,
        packet: &mut RayHitPacket<N>,
        coherence: Coherence,
    ) where
        Lanes<N>: PacketSize,
    {
        debug_assert!(
            packet.rays.is_valid(valid),
            "Embree cannot trace {:?}",
            packet.rays
        );
        packet.forget_hits();
        let mut arguments = RTCIntersectArguments {
            flags: coherence.flags(),
            feature_mask: RTCFeatureFlags::RTC_FEATURE_FLAG_ALL,
            ..RTCIntersectArguments::default()
        };
        let packet = ptr::from_mut(packet).cast::<c_void>();
        // SAFETY: the scene is committed; mask and packet are aligned by their
        // types and laid out as Embree expects; geomID and instID are set to
        // "none" ("Embree API", rtcIntersect4/8/16 and
        // rtcInitIntersectArguments).
        unsafe { Lanes::<N>::intersect(valid.as_ptr(), self.handle, packet, &raw mut arguments) };
    }

    /// Whether the rays of a packet meet anything, in the lanes of `valid`: their
    /// `tfar` becomes −∞ if so, see [`RayPacket::occluded_bits`].
    #[inline]
    pub fn occluded<const N: usize>(
        &self,
        valid: &LaneMask<N>,
        packet: &mut RayPacket<N>,
        coherence: Coherence,
    ) where
        Lanes<N>: PacketSize,
    {
        debug_assert!(packet.is_valid(valid), "Embree cannot trace {packet:?}");
        let mut arguments = RTCOccludedArguments {
            flags: coherence.flags(),
            feature_mask: RTCFeatureFlags::RTC_FEATURE_FLAG_ALL,
            ..RTCOccludedArguments::default()
        };
        let packet = ptr::from_mut(packet).cast::<c_void>();
        // SAFETY: the scene is committed; mask and packet are aligned by their
        // types and laid out as Embree expects ("Embree API",
        // rtcOccluded4/8/16 and rtcInitOccludedArguments).
        unsafe { Lanes::<N>::occluded(valid.as_ptr(), self.handle, packet, &raw mut arguments) };
    }

    /// The box around all triangles; `None` if there are none.
    pub fn bounds(&self) -> Option<Bounds> {
        self.shared.bounds
    }

    /// The meshes, in the order of their [`GeometryId`]s.
    pub fn meshes(&self) -> &[TriangleMesh] {
        &self.shared.meshes
    }

    /// The device that the scene belongs to.
    pub fn device(&self) -> &Device {
        &self.shared.device
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // SAFETY: the handle is live and this is its last use ("Embree API",
        // rtcReleaseScene).
        unsafe { raw::rtcReleaseScene(self.handle) };
    }
}

impl BuildQuality {
    fn to_raw(self) -> RTCBuildQuality {
        match self {
            Self::Low => RTCBuildQuality::RTC_BUILD_QUALITY_LOW,
            Self::Medium => RTCBuildQuality::RTC_BUILD_QUALITY_MEDIUM,
            Self::High => RTCBuildQuality::RTC_BUILD_QUALITY_HIGH,
        }
    }
}

fn bounds_of(committed: RTCScene) -> Option<Bounds> {
    let mut bounds = RTCBounds::default();
    // SAFETY: the caller's scene is live, committed and not yet seen by another
    // thread; the result is on our stack and aligned by its type ("Embree API",
    // rtcGetSceneBounds).
    unsafe { raw::rtcGetSceneBounds(committed, &raw mut bounds) };
    let min = [bounds.lower_x, bounds.lower_y, bounds.lower_z];
    let max = [bounds.upper_x, bounds.upper_y, bounds.upper_z];
    // Embree turns the bounds of nothing inside out.
    (min[0] <= max[0]).then_some(Bounds { min, max })
}

fn scene_flags(robust: bool, compact: bool) -> RTCSceneFlags {
    let robust = if robust {
        RTCSceneFlags::RTC_SCENE_FLAG_ROBUST.0
    } else {
        0
    };
    let compact = if compact {
        RTCSceneFlags::RTC_SCENE_FLAG_COMPACT.0
    } else {
        0
    };
    RTCSceneFlags(robust | compact)
}
