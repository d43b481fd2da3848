//! Every triangle against every ray: slow, simple, and the judge of the fast way.

use glam::Vec3;

use crate::scene::TriangleMesh;

/// Intersection by trying all triangles (Möller and Trumbore 1997), in double precision.
#[derive(Debug, Clone, Copy)]
pub struct BruteForce<'a> {
    mesh: &'a TriangleMesh,
}

impl<'a> BruteForce<'a> {
    /// Takes the mesh as it is.
    pub fn new(mesh: &'a TriangleMesh) -> Self {
        Self { mesh }
    }

    /// Distance along the ray, in lengths of `direction`, and index of the nearest triangle.
    pub fn nearest(self, origin: Vec3, direction: Vec3) -> Option<(f64, usize)> {
        (0..self.mesh.triangles.len())
            .filter_map(|triangle| Some((self.distance(triangle, origin, direction)?, triangle)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Whether any triangle lies between the two points.
    pub fn occluded(self, from: Vec3, to: Vec3) -> bool {
        (0..self.mesh.triangles.len())
            .any(|triangle| self.distance(triangle, from, to - from).is_some_and(|t| t <= 1.0))
    }

    fn distance(self, triangle: usize, origin: Vec3, direction: Vec3) -> Option<f64> {
        let [a, b, c] = self.mesh.corners(triangle).map(Vec3::as_dvec3);
        let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
        let (edge_u, edge_v) = (b - a, c - a);
        let p = direction.cross(edge_v);
        let determinant = edge_u.dot(p);
        if determinant == 0.0 {
            return None;
        }
        let to_origin = origin - a;
        let u = to_origin.dot(p) / determinant;
        let q = to_origin.cross(edge_u);
        let v = direction.dot(q) / determinant;
        let t = edge_v.dot(q) / determinant;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some(t)
    }
}
