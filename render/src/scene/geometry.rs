//! What a worker needs of a scene, as bytes: the camera, the triangles with their normals, the emitters.
//!
//! Results are per unit albedo, so neither materials nor textures are part of it, and no file of the
//! scene is needed on the worker's machine. Little-endian, in this order: eight bytes [`MAGIC`]; eye,
//! look-at and up (9 f32), vertical field of view in degrees (f32); numbers of vertices, triangles and
//! emitters (3 u32); for each vertex position and normal (6 f32); for each triangle three vertex indices
//! (3 u32); for each emitter 0 for a triangle or 1 for a parallelogram (u32), corner, both edges and
//! radiance (12 f32).

use glam::Vec3;

use super::{CameraPose, Emitter, EmitterShape, ImageSize, Material, Scene, TriangleMesh};

/// Begins the bytes; the last of them is the version of the layout.
pub const MAGIC: [u8; 8] = *b"glscene\x01";

/// Why bytes are no scene.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// Something else, or another version of the layout.
    #[error("the bytes are not a scene of this version")]
    Magic,
    /// The numbers at the start do not fit the length.
    #[error(
        "the scene has {found} bytes where its numbers of vertices, triangles and emitters ask for {expected}"
    )]
    Length {
        /// Bytes that came.
        found: usize,
        /// Bytes that there should be.
        expected: u64,
    },
    /// A number that is infinite or NaN.
    #[error("{0} of the scene has a coordinate that is not finite")]
    NotFinite(&'static str),
    /// A triangle of a vertex that is not there.
    #[error("a triangle of the scene has vertex {index} of {vertices}")]
    Index {
        /// The index.
        index: u32,
        /// How many there are.
        vertices: u32,
    },
    /// No shape of emitter has this number.
    #[error("an emitter of the scene has the unknown shape {0}")]
    Shape(u32),
    /// The camera looks nowhere, or its field of view is none.
    #[error("the camera of the scene is impossible")]
    Camera,
}

const CAMERA_FLOATS: usize = 10;
const HEADER_BYTES: usize = MAGIC.len() + 4 * (CAMERA_FLOATS + 3);
const VERTEX_BYTES: usize = 4 * 6;
const TRIANGLE_BYTES: usize = 4 * 3;
const EMITTER_BYTES: usize = 4 * 13;

/// The bytes of a scene.
pub fn to_bytes(scene: &Scene) -> Vec<u8> {
    let mesh = &scene.mesh;
    let counts = [mesh.positions.len(), mesh.triangles.len(), scene.emitters.len()];
    let mut bytes = Vec::with_capacity(length(counts.map(|count| count as u32)) as usize);
    let camera = &scene.camera;
    bytes.extend(MAGIC);
    put_vectors(&mut bytes, [camera.eye, camera.look_at, camera.up]);
    bytes.extend(camera.vertical_fov_degrees.to_le_bytes());
    put_integers(&mut bytes, counts.map(|count| count as u32));
    for (&position, &normal) in mesh.positions.iter().zip(&mesh.normals) {
        put_vectors(&mut bytes, [position, normal]);
    }
    for &triangle in &mesh.triangles {
        put_integers(&mut bytes, triangle);
    }
    for emitter in &scene.emitters {
        let shape = match emitter.shape {
            EmitterShape::Triangle => 0,
            EmitterShape::Parallelogram => 1,
        };
        put_integers(&mut bytes, [shape]);
        let Emitter {
            corner,
            edge_u,
            edge_v,
            radiance,
            ..
        } = *emitter;
        put_vectors(&mut bytes, [corner, edge_u, edge_v, radiance]);
    }
    bytes
}

/// The scene of such bytes: white, without textures, and of the smallest size.
///
/// # Errors
/// When a worker could not trace it, whoever made the bytes.
pub fn from_bytes(bytes: &[u8]) -> Result<Scene, GeometryError> {
    let (header, rest) = bytes.split_at_checked(HEADER_BYTES).ok_or(GeometryError::Magic)?;
    let (magic, header) = header.split_at(MAGIC.len());
    if magic != MAGIC {
        return Err(GeometryError::Magic);
    }
    let (camera, counts) = header.split_at(4 * CAMERA_FLOATS);
    let counts: [u32; 3] = integers(counts);
    let [vertices, triangles, emitters] = counts;
    if length(counts) != bytes.len() as u64 {
        return Err(GeometryError::Length {
            found: bytes.len(),
            expected: length(counts),
        });
    }
    let (vertex_bytes, rest) = rest.split_at(vertices as usize * VERTEX_BYTES);
    let (triangle_bytes, emitter_bytes) = rest.split_at(triangles as usize * TRIANGLE_BYTES);
    let mesh = mesh(vertex_bytes, triangle_bytes)?;
    debug_assert_eq!(emitter_bytes.len(), emitters as usize * EMITTER_BYTES);
    Ok(Scene {
        camera: camera_pose(camera)?,
        image: ImageSize { width: 1, height: 1 },
        mesh,
        materials: vec![Material {
            name: String::new(),
            kd: Vec3::ONE,
            kd_map: None,
            emission: Vec3::ZERO,
        }],
        textures: Vec::new(),
        emitters: emitter_bytes
            .as_chunks()
            .0
            .iter()
            .map(emitter)
            .collect::<Result<_, _>>()?,
    })
}

/// Bytes of a scene with so many vertices, triangles and emitters.
fn length([vertices, triangles, emitters]: [u32; 3]) -> u64 {
    HEADER_BYTES as u64
        + u64::from(vertices) * VERTEX_BYTES as u64
        + u64::from(triangles) * TRIANGLE_BYTES as u64
        + u64::from(emitters) * EMITTER_BYTES as u64
}

fn camera_pose(bytes: &[u8]) -> Result<CameraPose, GeometryError> {
    let (vectors, fov) = bytes.split_at(4 * 9);
    let [eye, look_at, up] = vectors_of(vectors);
    let [fov] = integers(fov).map(f32::from_bits);
    finite("the camera", [eye, look_at, up])?;
    let axis = (look_at - eye).try_normalize();
    let is_upright = axis.is_some_and(|axis| axis.cross(up).try_normalize().is_some());
    if !(is_upright && fov > 0.0 && fov < 180.0) {
        return Err(GeometryError::Camera);
    }
    Ok(CameraPose {
        eye,
        look_at,
        up,
        vertical_fov_degrees: fov,
    })
}

fn mesh(vertices: &[u8], triangles: &[u8]) -> Result<TriangleMesh, GeometryError> {
    let vertices = vertices.as_chunks::<VERTEX_BYTES>().0;
    let mut mesh = TriangleMesh {
        positions: Vec::with_capacity(vertices.len()),
        normals: Vec::with_capacity(vertices.len()),
        ..TriangleMesh::default()
    };
    for vertex in vertices {
        let [position, normal] = vectors_of(vertex);
        finite("a vertex", [position, normal])?;
        mesh.positions.push(position);
        mesh.normals.push(normal);
    }
    let count = vertices.len() as u32;
    let triangles = triangles.as_chunks::<TRIANGLE_BYTES>().0;
    mesh.triangles = triangles.iter().map(|bytes| integers(bytes)).collect();
    if let Some(&index) = mesh.triangles.iter().flatten().find(|&&index| index >= count) {
        return Err(GeometryError::Index {
            index,
            vertices: count,
        });
    }
    mesh.material_of = vec![0; triangles.len()];
    Ok(mesh)
}

fn emitter(bytes: &[u8; EMITTER_BYTES]) -> Result<Emitter, GeometryError> {
    let (shape, vectors) = bytes.split_at(4);
    let [shape] = integers(shape);
    let shape = match shape {
        0 => EmitterShape::Triangle,
        1 => EmitterShape::Parallelogram,
        other => return Err(GeometryError::Shape(other)),
    };
    let [corner, edge_u, edge_v, radiance] = vectors_of(vectors);
    finite("an emitter", [corner, edge_u, edge_v, radiance])?;
    Ok(Emitter {
        shape,
        corner,
        edge_u,
        edge_v,
        radiance,
    })
}

fn finite<const N: usize>(what: &'static str, vectors: [Vec3; N]) -> Result<(), GeometryError> {
    if vectors.iter().all(|vector| vector.is_finite()) {
        Ok(())
    } else {
        Err(GeometryError::NotFinite(what))
    }
}

fn put_vectors<const N: usize>(bytes: &mut Vec<u8>, vectors: [Vec3; N]) {
    for coordinate in vectors.into_iter().flat_map(|vector| vector.to_array()) {
        bytes.extend(coordinate.to_le_bytes());
    }
}

fn put_integers<const N: usize>(bytes: &mut Vec<u8>, integers: [u32; N]) {
    for integer in integers {
        bytes.extend(integer.to_le_bytes());
    }
}

/// The first integers of some bytes; 0 for those that they do not have.
fn integers<const N: usize>(bytes: &[u8]) -> [u32; N] {
    let words = bytes.as_chunks::<4>().0;
    std::array::from_fn(|index| words.get(index).map_or(0, |&word| u32::from_le_bytes(word)))
}

fn vectors_of<const N: usize>(bytes: &[u8]) -> [Vec3; N] {
    let words = bytes.as_chunks::<12>().0;
    std::array::from_fn(|index| {
        words.get(index).map_or(Vec3::ZERO, |word| {
            let coordinates: [u32; 3] = integers(word);
            Vec3::from_array(coordinates.map(f32::from_bits))
        })
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn scene() -> Scene {
        let vertex = |x: u8| Vec3::new(f32::from(x), f32::from(x * x), 1.0);
        Scene {
            camera: CameraPose {
                eye: Vec3::new(1.0, 2.0, 3.0),
                look_at: Vec3::ZERO,
                up: Vec3::Y,
                vertical_fov_degrees: 40.0,
            },
            image: ImageSize {
                width: 64,
                height: 48,
            },
            mesh: TriangleMesh {
                positions: (0..4).map(vertex).collect(),
                normals: vec![Vec3::Z; 4],
                uvs: vec![glam::Vec2::ONE; 4],
                triangles: vec![[0, 1, 2], [1, 2, 3]],
                material_of: vec![0, 0],
            },
            materials: Vec::new(),
            textures: Vec::new(),
            emitters: vec![Emitter {
                shape: EmitterShape::Parallelogram,
                corner: Vec3::X,
                edge_u: Vec3::Y,
                edge_v: Vec3::Z,
                radiance: Vec3::splat(7.0),
            }],
        }
    }

    #[test]
    fn what_a_worker_needs_comes_back_as_it_was() {
        let (scene, bytes) = (scene(), to_bytes(&scene()));
        let back = from_bytes(&bytes).unwrap();
        assert_eq!(back.camera, scene.camera);
        assert_eq!(back.mesh.positions, scene.mesh.positions);
        assert_eq!(back.mesh.normals, scene.mesh.normals);
        assert_eq!(back.mesh.triangles, scene.mesh.triangles);
        assert_eq!(back.emitters, scene.emitters);
        assert_eq!(to_bytes(&back), bytes);
    }

    #[test]
    fn what_is_no_scene_is_refused() {
        let bytes = to_bytes(&scene());
        let changed = |place: usize, word: [u8; 4]| {
            let mut bytes = bytes.clone();
            bytes[place..place + 4].copy_from_slice(&word);
            from_bytes(&bytes).unwrap_err()
        };
        assert_eq!(from_bytes(b"").unwrap_err(), GeometryError::Magic);
        assert_eq!(changed(0, *b"else"), GeometryError::Magic);
        let many = u32::MAX.to_le_bytes();
        assert!(matches!(changed(48, many), GeometryError::Length { .. }));
        assert!(matches!(
            from_bytes(&bytes[..99]),
            Err(GeometryError::Length { .. })
        ));
        let nan = f32::NAN.to_le_bytes();
        assert_eq!(changed(8, nan), GeometryError::NotFinite("the camera"));
        assert_eq!(changed(44, nan), GeometryError::Camera);
        let vertices = HEADER_BYTES;
        assert_eq!(changed(vertices, nan), GeometryError::NotFinite("a vertex"));
        let triangles = vertices + 4 * VERTEX_BYTES;
        let index = GeometryError::Index {
            index: 4,
            vertices: 4,
        };
        assert_eq!(changed(triangles, 4u32.to_le_bytes()), index);
        let emitters = triangles + 2 * TRIANGLE_BYTES;
        assert_eq!(changed(emitters, 2u32.to_le_bytes()), GeometryError::Shape(2));
        assert_eq!(changed(emitters + 4, nan), GeometryError::NotFinite("an emitter"));
    }

    proptest! {
        #[test]
        fn bytes_that_were_tampered_with_never_panic(place: prop::sample::Index, byte: u8) {
            let mut bytes = to_bytes(&scene());
            let place = place.index(bytes.len());
            bytes[place] = byte;
            if let Ok(scene) = from_bytes(&bytes) {
                prop_assert_eq!(to_bytes(&scene), bytes);
            }
        }
    }
}
