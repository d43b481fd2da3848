//! The triangles of a scene, as one indexed mesh.

use glam::{Vec2, Vec3};

/// An indexed triangle mesh in world space; all vertex arrays have the same length.
#[derive(Debug, Clone, Default)]
pub struct TriangleMesh {
    /// Vertex positions in scene units.
    pub positions: Vec<Vec3>,
    /// Unit shading normals per vertex; zero where the file gave none (then the geometric normal serves).
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex, v upwards as in OBJ; zero where the file gave none.
    pub uvs: Vec<Vec2>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Scene::materials`](super::Scene::materials), one per triangle.
    pub material_of: Vec<u32>,
}

impl TriangleMesh {
    /// The three corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|vertex| self.positions[vertex as usize])
    }

    /// The smallest and the largest corner of the bounding box; `None` without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut corners = self
            .triangles
            .iter()
            .flatten()
            .map(|&vertex| self.positions[vertex as usize]);
        let first = corners.next()?;
        Some(corners.fold((first, first), |(min, max), p| (min.min(p), max.max(p))))
    }
}
