//! A point on a surface, seen from one side.

use glam::{DVec3, Vec2, Vec3};

use crate::scene::Scene;

/// What shading needs to know of a point on a triangle. Both normals point to the side it is seen from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// World position, scene units.
    pub position: Vec3,
    /// Unit normal of the triangle.
    pub geometric_normal: Vec3,
    /// Unit normal interpolated from the vertices, or the geometric one.
    pub shading_normal: Vec3,
    /// Diffuse albedo per channel.
    pub albedo: Vec3,
    /// Radiance emitted towards the viewer, W·m⁻²·sr⁻¹.
    pub emission: Vec3,
}

impl SurfacePoint {
    /// The point where a ray meets a triangle that Embree has found.
    ///
    /// Where on the triangle is computed here, not taken from Embree: its single rays, packets of each
    /// width and instruction sets round differently, and a picture must not depend on who traced it.
    pub(crate) fn new(scene: &Scene, triangle: usize, origin: Vec3, direction: Vec3) -> Self {
        let mesh = &scene.mesh;
        let [a, b, c] = mesh.corners(triangle);
        let (u, v) = barycentric([a, b, c], origin, direction);
        let vertices = mesh.triangles[triangle].map(|vertex| vertex as usize);
        let front = (b - a).cross(c - a).normalize_or_zero();
        let faces_viewer = front.dot(direction) <= 0.0;
        let geometric_normal = if faces_viewer { front } else { -front };
        let material = &scene.materials[mesh.material_of[triangle] as usize];
        let interpolate = |values: &[Vec3]| {
            let [p, q, r] = vertices.map(|vertex| values[vertex]);
            (1.0 - u - v) * p + u * q + v * r
        };
        Self {
            // From the corners, since origin + t·direction loses digits far away.
            position: (1.0 - u - v) * a + u * b + v * c,
            geometric_normal,
            shading_normal: shading_normal(interpolate(&mesh.normals), geometric_normal),
            albedo: material.kd
                * material.kd_map.map_or(Vec3::ONE, |map| {
                    let [p, q, r]: [Vec2; 3] = vertices.map(|vertex| mesh.uvs[vertex]);
                    scene.textures[map as usize].lookup((1.0 - u - v) * p + u * q + v * r)
                }),
            emission: if faces_viewer {
                material.emission
            } else {
                Vec3::ZERO
            },
        }
    }

    /// The origin for rays that leave the surface on the side it is seen from.
    pub fn lifted(&self, offset: f32) -> Vec3 {
        self.position + offset * self.geometric_normal
    }
}

/// Weights of the second and third corner where a line meets the plane of a triangle (Möller and
/// Trumbore 1997), kept within the triangle.
fn barycentric([a, b, c]: [Vec3; 3], origin: Vec3, direction: Vec3) -> (f32, f32) {
    let [a, b, c, origin, direction] = [a, b, c, origin, direction].map(Vec3::as_dvec3);
    let (edge_u, edge_v): (DVec3, DVec3) = (b - a, c - a);
    let p = direction.cross(edge_v);
    let scale = 1.0 / edge_u.dot(p);
    let to_origin = origin - a;
    let u = (scale * to_origin.dot(p)).clamp(0.0, 1.0);
    let v = (scale * direction.dot(to_origin.cross(edge_u))).clamp(0.0, 1.0 - u);
    // A ray within the plane of its triangle: any corner is as good.
    if u.is_nan() || v.is_nan() {
        (0.0, 0.0)
    } else {
        (u as f32, v as f32)
    }
}

/// Turns the interpolated normal to the side of the geometric one, which serves where there is none.
fn shading_normal(interpolated: Vec3, geometric_normal: Vec3) -> Vec3 {
    let Some(normal) = interpolated.try_normalize() else {
        return geometric_normal;
    };
    if normal.dot(geometric_normal) < 0.0 {
        -normal
    } else {
        normal
    }
}
