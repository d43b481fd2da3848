//! Puts the meshes of all models, and the quad lights, into one scene.

use std::path::PathBuf;

use glam::{Vec2, Vec3};

use super::error::SceneError;
use super::limits::{COORDINATE_MAX, TRIANGLES_MAX, VERTICES_MAX};
use super::mtl::TextureReference;
use super::transform::Transform;
use crate::scene::{Emitter, EmitterShape, Material, TriangleMesh};

/// One run of faces of one material.
#[derive(Debug)]
pub(super) struct Part<'a> {
    pub(super) mesh: &'a tobj::Mesh,
    /// Index into [`Assembly::materials`].
    pub(super) material: u32,
    /// How the texture lies on it.
    pub(super) map: Option<&'a TextureReference>,
}

/// Everything put in so far.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    pub(super) mesh: TriangleMesh,
    pub(super) materials: Vec<Material>,
    pub(super) emitters: Vec<Emitter>,
}

impl Assembly {
    /// Adds a part of a model at its place in the world; gives the number of triangles that were
    /// dropped because they have no area.
    pub(super) fn add(&mut self, part: &Part<'_>, transform: &Transform) -> u64 {
        let mesh = part.mesh;
        let base = self.mesh.positions.len() as u32;
        let (positions, _) = mesh.positions.as_chunks::<3>();
        let (normals, _) = mesh.normals.as_chunks::<3>();
        let (uvs, _) = mesh.texcoords.as_chunks::<2>();
        let count = positions.len();

        // Vertices.
        let target = &mut self.mesh;
        let points = positions.iter().map(|&p| transform.point(Vec3::from(p)));
        target.positions.extend(points);
        let normals = normals.iter().map(|&n| transform.normal(Vec3::from(n)));
        target.normals.extend(normals.take(count));
        target.normals.resize(target.positions.len(), Vec3::ZERO);
        let uvs = uvs.iter().map(|&uv| placed(Vec2::from(uv), part.map));
        target.uvs.extend(uvs.take(count));
        target.uvs.resize(target.positions.len(), Vec2::ZERO);

        // Triangles.
        let mut dropped = 0;
        let (triangles, _) = mesh.indices.as_chunks::<3>();
        for triangle in triangles {
            let [a, b, c] = triangle.map(|index| base + index);
            let triangle = if transform.mirrors() { [a, c, b] } else { [a, b, c] };
            dropped += u64::from(!self.add_triangle(triangle, part.material));
        }
        dropped
    }

    /// Adds a quad light: two triangles of a black material of its own, and an emitter.
    pub(super) fn add_quad(&mut self, quad: Emitter, name: String) {
        let material = self.materials.len() as u32;
        self.materials.push(Material {
            name,
            kd: Vec3::ZERO,
            kd_map: None,
            emission: quad.radiance,
        });
        let mesh = &mut self.mesh;
        let base = mesh.positions.len() as u32;
        let Emitter {
            corner,
            edge_u,
            edge_v,
            ..
        } = quad;
        let offsets = [Vec3::ZERO, edge_u, edge_u + edge_v, edge_v];
        mesh.positions.extend(offsets.map(|offset| corner + offset));
        mesh.normals.resize(mesh.positions.len(), Vec3::ZERO);
        mesh.uvs.resize(mesh.positions.len(), Vec2::ZERO);
        for triangle in [[0, 1, 2], [0, 2, 3]] {
            mesh.triangles.push(triangle.map(|index| base + index));
            mesh.material_of.push(material);
        }
        if quad.radiance != Vec3::ZERO {
            self.emitters.push(quad);
        }
    }

    /// An error if `vertices` and `triangles` more are too many for one scene.
    pub(super) fn check_room(
        &self,
        path: &std::path::Path,
        vertices: usize,
        triangles: usize,
    ) -> Result<(), SceneError> {
        for (what, count, limit) in [
            (
                "vertices with the meshes before",
                self.mesh.positions.len() + vertices,
                VERTICES_MAX,
            ),
            (
                "triangles with the meshes before",
                self.mesh.triangles.len() + triangles,
                TRIANGLES_MAX,
            ),
        ] {
            if count as u64 > limit {
                return Err(SceneError::Limit {
                    path: PathBuf::from(path),
                    what,
                    count: count as u64,
                    limit,
                });
            }
        }
        Ok(())
    }

    /// Whether all vertices from index `first` on are within the limit for coordinates.
    pub(super) fn is_within_limits(&self, first: usize) -> bool {
        let range = -COORDINATE_MAX..=COORDINATE_MAX;
        let within = |p: &Vec3| p.to_array().iter().all(|c| range.contains(c));
        self.mesh.positions[first..].iter().all(within)
    }

    /// Whether the triangle has an area and was added.
    fn add_triangle(&mut self, triangle: [u32; 3], material: u32) -> bool {
        let [a, b, c] = triangle.map(|index| self.mesh.positions[index as usize]);
        let (edge_u, edge_v) = (b - a, c - a);
        if !has_area(edge_u, edge_v) {
            return false;
        }
        self.mesh.triangles.push(triangle);
        self.mesh.material_of.push(material);
        let radiance = self.materials[material as usize].emission;
        if radiance != Vec3::ZERO {
            self.emitters.push(Emitter {
                shape: EmitterShape::Triangle,
                corner: a,
                edge_u,
                edge_v,
                radiance,
            });
        }
        true
    }
}

/// Whether two edges span an area whose normal can be told in `f32`.
pub(super) fn has_area(edge_u: Vec3, edge_v: Vec3) -> bool {
    let length_squared = edge_u.cross(edge_v).length_squared();
    length_squared.is_finite() && length_squared >= f32::MIN_POSITIVE
}

/// A texture coordinate as the material's map wants it; zero where that is not finite.
fn placed(uv: Vec2, map: Option<&TextureReference>) -> Vec2 {
    let uv = map.map_or(uv, |map| map.scale * uv + map.offset);
    if uv.is_finite() { uv } else { Vec2::ZERO }
}
