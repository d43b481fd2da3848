//! Where rays meet the scene: Embree's answer, made into surface points.

mod brute_force;
mod surface;

pub use brute_force::BruteForce;
pub use surface::SurfacePoint;

use embree4_sys as embree;
use glam::Vec3;

use crate::scene::Scene;

/// A scene with its acceleration structure, ready for rays from any number of threads.
#[derive(Debug)]
pub struct TracedScene {
    scene: Scene,
    accelerated: embree::Scene,
    packet_width: embree::PacketWidth,
    ray_offset: f32,
}

/// Offset of ray origins from their surface, as a share of the scene's extent: well above the rounding
/// of hit points, well below anything visible.
const RAY_OFFSET_SHARE: f32 = 2e-5;

impl TracedScene {
    /// Builds the acceleration structure.
    ///
    /// # Errors
    /// When Embree cannot be started or refuses the geometry.
    pub fn build(scene: Scene) -> Result<Self, embree::Error> {
        let device = embree::Device::new(&embree::DeviceConfig::default())?;
        let positions = scene.mesh.positions.iter().map(Vec3::to_array).collect();
        let mut builder = embree::SceneBuilder::new(&device).build_quality(embree::BuildQuality::Medium);
        builder.attach_triangles(positions, scene.mesh.triangles.clone())?;
        let accelerated = builder.commit()?;
        let extent = scene.extent();
        Ok(Self {
            accelerated,
            packet_width: device.native_packet_width(),
            ray_offset: RAY_OFFSET_SHARE * extent,
            scene,
        })
    }

    /// The scene as data.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Embree's scene, for packets of rays.
    pub fn accelerated(&self) -> &embree::Scene {
        &self.accelerated
    }

    /// Rays in the packets that this machine traces best.
    pub fn packet_width(&self) -> embree::PacketWidth {
        self.packet_width
    }

    /// Distance between a surface and the origin of rays that leave it, in scene units.
    pub fn ray_offset(&self) -> f32 {
        self.ray_offset
    }

    /// The nearest surface along a ray, oriented against it; `direction` has unit length.
    pub fn nearest(&self, origin: Vec3, direction: Vec3) -> Option<SurfacePoint> {
        self.nearest_within(origin, direction, f32::INFINITY)
    }

    /// The nearest surface along a ray, if it is no farther than `reach`; `direction` has unit length.
    pub fn nearest_within(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<SurfacePoint> {
        let ray = embree::Ray::new(origin.to_array(), direction.to_array()).between(0.0, reach);
        let hit = self.accelerated.intersect1(&ray)?;
        Some(SurfacePoint::new(
            &self.scene,
            hit.primitive as usize,
            origin,
            direction,
        ))
    }

    /// Whether nothing lies between two points, both already off their surfaces.
    pub fn visible(&self, from: Vec3, to: Vec3) -> bool {
        let ray = embree::Ray::new(from.to_array(), (to - from).to_array()).between(0.0, 1.0);
        !self.accelerated.occluded1(&ray)
    }
}
