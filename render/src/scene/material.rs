//! What a surface does with light: Lambertian reflection and emission.

use glam::Vec3;

/// A two-sided diffuse surface that may emit on its front side.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name in the MTL file, for messages.
    pub name: String,
    /// Diffuse albedo per channel, in [0, 1]; multiplied by the map where there is one.
    pub kd: Vec3,
    /// Index of the albedo map in [`Scene::textures`](super::Scene::textures).
    pub kd_map: Option<u32>,
    /// Emitted radiance in W·m⁻²·sr⁻¹ to the side of the geometric normal.
    pub emission: Vec3,
}
