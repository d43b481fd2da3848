//! A scene as plain data: triangles, materials, textures, emitters and the camera's pose.

mod emitter;
pub mod geometry;
pub mod load;
mod material;
mod mesh;
mod texture;

pub use emitter::{Emitter, EmitterShape};
pub use load::{LoadOptions, LoadedScene, Note, SceneError, load};
pub use material::Material;
pub use mesh::TriangleMesh;
pub use texture::{Texture, Wrap};

use glam::Vec3;

/// Everything that is needed to make a picture, in world space.
///
/// Lengths are scene units. A scene that [`load`](fn@load) accepted has at least one triangle and
/// one emitter, only finite numbers, and only indices in range.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Where the eye is and what it looks at.
    pub camera: CameraPose,
    /// The picture's size, unless the command line says otherwise.
    pub image: ImageSize,
    /// All triangles of all meshes, and of the quad lights.
    pub mesh: TriangleMesh,
    /// Materials, indexed by [`TriangleMesh::material_of`].
    pub materials: Vec<Material>,
    /// Textures, indexed by [`Material::kd_map`].
    pub textures: Vec<Texture>,
    /// Every area light: the quad lights and each triangle of an emissive material.
    pub emitters: Vec<Emitter>,
}

impl Scene {
    /// The longest side of the bounding box in scene units; 0 without triangles.
    pub fn extent(&self) -> f32 {
        self.mesh
            .bounds()
            .map_or(0.0, |(min, max)| (max - min).max_element())
    }
}

/// The camera as the scene file gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraPose {
    /// Position of the eye, world space.
    pub eye: Vec3,
    /// A point on the optical axis, different from `eye`.
    pub look_at: Vec3,
    /// Upward direction, not parallel to the optical axis.
    pub up: Vec3,
    /// Vertical field of view in degrees, in (0, 180).
    pub vertical_fov_degrees: f32,
}

/// Width and height of the picture in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageSize {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl ImageSize {
    /// The largest side that is accepted, in pixels.
    pub const SIDE_MAX: u32 = 16_384;
    /// The largest `width × height` that is accepted.
    pub const PIXELS_MAX: usize = 1 << 26;

    /// Number of pixels.
    pub fn pixel_count(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Whether both sides are at least 1 and the limits hold.
    pub fn is_valid(self) -> bool {
        let side = 1..=Self::SIDE_MAX;
        side.contains(&self.width) && side.contains(&self.height) && self.pixel_count() <= Self::PIXELS_MAX
    }
}
