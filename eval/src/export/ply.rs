//! Triangles as a binary PLY, each with corners of its own.

use glam::{Vec2, Vec3};
use render::scene::TriangleMesh;

/// Bytes of a corner: position, normal, texture coordinates.
const CORNER_BYTES: usize = 8 * 4;
/// Bytes of a face: how many corners, and which.
const FACE_BYTES: usize = 1 + 3 * 4;

/// A little-endian PLY with `x y z nx ny nz s t` for each corner; t upwards.
///
/// Corners without a normal get that of their triangle, and all normals point to its front: then every
/// reader agrees on which side shines.
pub(super) fn of_triangles(mesh: &TriangleMesh, triangles: &[usize]) -> Vec<u8> {
    let corners = 3 * triangles.len();
    let mut bytes = header(corners, triangles.len()).into_bytes();
    bytes.reserve_exact(corners * CORNER_BYTES + triangles.len() * FACE_BYTES);
    for &triangle in triangles {
        let [a, b, c] = mesh.corners(triangle);
        let front = (b - a).cross(c - a).normalize_or_zero();
        for vertex in mesh.triangles[triangle].map(|vertex| vertex as usize) {
            let normal = facing(mesh.normals[vertex], front);
            put_corner(&mut bytes, mesh.positions[vertex], normal, mesh.uvs[vertex]);
        }
    }
    for face in 0..triangles.len() as u32 {
        bytes.push(3);
        bytes.extend(
            [0, 1, 2]
                .into_iter()
                .flat_map(|corner| (3 * face + corner).to_le_bytes()),
        );
    }
    bytes
}

fn header(corners: usize, faces: usize) -> String {
    let properties = ["x", "y", "z", "nx", "ny", "nz", "s", "t"]
        .map(|name| format!("property float {name}\n"))
        .concat();
    format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {corners}\n{properties}\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

fn facing(normal: Vec3, front: Vec3) -> Vec3 {
    match normal.try_normalize() {
        Some(normal) if normal.dot(front) < 0.0 => -normal,
        Some(normal) => normal,
        None => front,
    }
}

fn put_corner(bytes: &mut Vec<u8>, position: Vec3, normal: Vec3, uv: Vec2) {
    let numbers = [position.to_array(), normal.to_array()].concat().into_iter();
    bytes.extend(numbers.chain(uv.to_array()).flat_map(f32::to_le_bytes));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_triangle_has_three_corners_of_its_own_with_normals_to_the_front() {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::ZERO, -Vec3::Z, Vec3::Z],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y],
            triangles: vec![[0, 1, 2], [2, 0, 1]],
            material_of: vec![0, 0],
        };
        let bytes = of_triangles(&mesh, &[1]);
        let header = header(3, 1);
        assert!(bytes.starts_with(header.as_bytes()));
        assert_eq!(bytes.len(), header.len() + 3 * CORNER_BYTES + FACE_BYTES);
        let body = &bytes[header.len()..];
        let floats: Vec<f32> = body[..3 * CORNER_BYTES]
            .as_chunks()
            .0
            .iter()
            .map(|&chunk| f32::from_le_bytes(chunk))
            .collect();
        assert_eq!(floats[..8], [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        assert!(floats.chunks(8).all(|corner| corner[5] > 0.0), "{floats:?}");
        assert_eq!(body[3 * CORNER_BYTES..], [3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    }
}
