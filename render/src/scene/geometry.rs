//! What a worker needs of a scene, as bytes: the camera, the triangles, their diffuse materials with their
//! textures, the emitters.
//!
//! No file of the scene is needed on the worker's machine. Little-endian, in this order: eight bytes
//! [`MAGIC`]; eye, look-at and up (9 f32), vertical field of view in degrees (f32); numbers of vertices,
//! triangles, emitters, materials and textures (5 u32); for each vertex position, normal and texture
//! coordinates (8 f32); for each triangle three vertex indices and its material (4 u32); for each emitter 0
//! for a triangle or 1 for a parallelogram (u32), corner, both edges and radiance (12 f32); for each
//! material its albedo (3 f32) and 0 or the number of its texture, counted from 1 (u32); for each texture
//! width, height (2 u32), 0 for repeated or 1 for clamped (u32), and its sRGB texels, three bytes each, with
//! up to three bytes of zeros that make their number a multiple of four. The emission of surfaces is not
//! part of it: the master sees it itself.

use glam::{Vec2, Vec3};

use super::{
    CameraPose, Emitter, EmitterShape, ImageSize, Material, Scene, Texture, TriangleMesh, Wrap,
    load::limits::TEXTURE_SIDE_MAX,
};

/// Begins the bytes; the last of them is the version of the layout.
pub const MAGIC: [u8; 8] = *b"glscene\x02";

/// Why bytes are no scene.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// Something else, or another version of the layout.
    #[error("the bytes are not a scene of this version")]
    Magic,
    /// The numbers at the start do not fit the length.
    #[error(
        "the scene has {found} bytes where its numbers of vertices, triangles and the like ask for {expected}"
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
    /// Something that is not there is referred to.
    #[error("{what} of the scene has the number {index} of {count}")]
    Index {
        /// What the number is of.
        what: &'static str,
        /// The number.
        index: u32,
        /// How many there are.
        count: u32,
    },
    /// A texture without texels, or too large, or of an unknown kind.
    #[error("a texture of the scene is impossible")]
    Texture,
    /// An albedo that is not from 0 to 1.
    #[error("a material of the scene has an impossible albedo")]
    Albedo,
    /// No shape of emitter has this number.
    #[error("an emitter of the scene has the unknown shape {0}")]
    Shape(u32),
    /// The camera looks nowhere, or its field of view is none.
    #[error("the camera of the scene is impossible")]
    Camera,
}

const CAMERA_FLOATS: usize = 10;
const HEADER_BYTES: usize = MAGIC.len() + 4 * (CAMERA_FLOATS + COUNTS);
const COUNTS: usize = 5;
const VERTEX_BYTES: usize = 4 * 8;
const TRIANGLE_BYTES: usize = 4 * 4;
const EMITTER_BYTES: usize = 4 * 13;
const MATERIAL_BYTES: usize = 4 * 4;
const TEXTURE_HEADER_BYTES: usize = 4 * 3;

/// The bytes of a scene.
pub fn to_bytes(scene: &Scene) -> Vec<u8> {
    let mesh = &scene.mesh;
    let counts = [
        mesh.positions.len(),
        mesh.triangles.len(),
        scene.emitters.len(),
        scene.materials.len(),
        scene.textures.len(),
    ]
    .map(|count| count as u32);
    let texels: usize = scene.textures.iter().map(texture_bytes).sum();
    let mut bytes = Vec::with_capacity(fixed_length(counts) as usize + texels);
    let camera = &scene.camera;
    bytes.extend(MAGIC);
    put_vectors(&mut bytes, [camera.eye, camera.look_at, camera.up]);
    bytes.extend(camera.vertical_fov_degrees.to_le_bytes());
    put_integers(&mut bytes, counts);
    for ((&position, &normal), uv) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.uvs) {
        put_vectors(&mut bytes, [position, normal]);
        put_integers(&mut bytes, uv.to_array().map(f32::to_bits));
    }
    for (&[a, b, c], &material) in mesh.triangles.iter().zip(&mesh.material_of) {
        put_integers(&mut bytes, [a, b, c, material]);
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
    for material in &scene.materials {
        put_vectors(&mut bytes, [material.kd]);
        put_integers(&mut bytes, [material.kd_map.map_or(0, |map| map + 1)]);
    }
    for texture in &scene.textures {
        let wrap = match texture.wrap {
            Wrap::Repeat => 0,
            Wrap::Clamp => 1,
        };
        put_integers(&mut bytes, [texture.width, texture.height, wrap]);
        let end = (bytes.len() + texture.texels.len() * 3).next_multiple_of(4);
        bytes.extend_from_slice(texture.texels.as_flattened());
        bytes.resize(end, 0);
    }
    bytes
}

/// The scene of such bytes: without emission, and of the smallest size.
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
    let counts: [u32; COUNTS] = integers(counts);
    if fixed_length(counts) > bytes.len() as u64 {
        return Err(GeometryError::Length {
            found: bytes.len(),
            expected: fixed_length(counts),
        });
    }
    let [vertices, triangles, emitters, materials, textures] = counts;
    let (vertex_bytes, rest) = rest.split_at(vertices as usize * VERTEX_BYTES);
    let (triangle_bytes, rest) = rest.split_at(triangles as usize * TRIANGLE_BYTES);
    let (emitter_bytes, rest) = rest.split_at(emitters as usize * EMITTER_BYTES);
    let (material_bytes, texture_bytes) = rest.split_at(materials as usize * MATERIAL_BYTES);
    Ok(Scene {
        camera: camera_pose(camera)?,
        image: ImageSize { width: 1, height: 1 },
        mesh: mesh(vertex_bytes, triangle_bytes, materials)?,
        materials: all(material_bytes, |bytes| material(bytes, textures))?,
        textures: read_textures(texture_bytes, textures, bytes.len())?,
        emitters: all(emitter_bytes, emitter)?,
    })
}

/// Bytes of a scene with such counts, its textures' texels left out.
fn fixed_length([vertices, triangles, emitters, materials, textures]: [u32; COUNTS]) -> u64 {
    let parts = [
        (vertices, VERTEX_BYTES),
        (triangles, TRIANGLE_BYTES),
        (emitters, EMITTER_BYTES),
        (materials, MATERIAL_BYTES),
        (textures, TEXTURE_HEADER_BYTES),
    ];
    let length = parts
        .iter()
        .map(|&(count, bytes)| u64::from(count) * bytes as u64);
    HEADER_BYTES as u64 + length.sum::<u64>()
}

/// Bytes of a texture's texels.
fn texture_bytes(texture: &Texture) -> usize {
    (texture.texels.len() * 3).next_multiple_of(4)
}

/// Reads records of equal length, one after the other.
fn all<const N: usize, T>(
    bytes: &[u8],
    read: impl Fn(&[u8; N]) -> Result<T, GeometryError>,
) -> Result<Vec<T>, GeometryError> {
    bytes.as_chunks().0.iter().map(read).collect()
}

fn material(bytes: &[u8; MATERIAL_BYTES], textures: u32) -> Result<Material, GeometryError> {
    let (kd, map) = bytes.split_at(4 * 3);
    let ([kd], [map]) = (vectors_of(kd), integers(map));
    // NaN is not within either.
    if !(kd.cmpge(Vec3::ZERO).all() && kd.cmple(Vec3::ONE).all()) {
        return Err(GeometryError::Albedo);
    }
    // Counted from 1, since 0 is none.
    if map > textures {
        return Err(GeometryError::Index {
            what: "a texture",
            index: map,
            count: textures,
        });
    }
    Ok(Material {
        name: String::new(),
        kd,
        kd_map: map.checked_sub(1),
        emission: Vec3::ZERO,
    })
}

/// The textures, which must end where the bytes do. `found` are the bytes of the whole scene.
fn read_textures(mut bytes: &[u8], count: u32, found: usize) -> Result<Vec<Texture>, GeometryError> {
    let mut textures = Vec::new();
    for _ in 0..count {
        let missing = |expected: usize| GeometryError::Length {
            found,
            expected: (found - bytes.len()) as u64 + expected as u64,
        };
        let (header, rest) = bytes
            .split_at_checked(TEXTURE_HEADER_BYTES)
            .ok_or_else(|| missing(TEXTURE_HEADER_BYTES))?;
        let [width, height, wrap] = integers(header);
        let side = 1..=TEXTURE_SIDE_MAX;
        let wrap = match wrap {
            0 if side.contains(&width) && side.contains(&height) => Wrap::Repeat,
            1 if side.contains(&width) && side.contains(&height) => Wrap::Clamp,
            _ => return Err(GeometryError::Texture),
        };
        let texels = width as usize * height as usize;
        let padded = (texels * 3).next_multiple_of(4);
        let (texel_bytes, rest) = rest
            .split_at_checked(padded)
            .ok_or_else(|| missing(TEXTURE_HEADER_BYTES + padded))?;
        if texel_bytes[3 * texels..].iter().any(|&byte| byte != 0) {
            return Err(GeometryError::Texture);
        }
        textures.push(Texture {
            width,
            height,
            texels: texel_bytes.as_chunks().0[..texels].to_vec(),
            wrap,
        });
        bytes = rest;
    }
    if bytes.is_empty() {
        Ok(textures)
    } else {
        Err(GeometryError::Length {
            found,
            expected: (found - bytes.len()) as u64,
        })
    }
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

fn mesh(vertices: &[u8], triangles: &[u8], materials: u32) -> Result<TriangleMesh, GeometryError> {
    let vertices = vertices.as_chunks::<VERTEX_BYTES>().0;
    let mut mesh = TriangleMesh {
        positions: Vec::with_capacity(vertices.len()),
        normals: Vec::with_capacity(vertices.len()),
        uvs: Vec::with_capacity(vertices.len()),
        ..TriangleMesh::default()
    };
    for vertex in vertices {
        let (vectors, uv) = vertex.split_at(4 * 6);
        let [position, normal] = vectors_of(vectors);
        finite("a vertex", [position, normal])?;
        mesh.positions.push(position);
        mesh.normals.push(normal);
        // Any coordinates have a texel: see `Texture::lookup`.
        mesh.uvs.push(Vec2::from_array(integers(uv).map(f32::from_bits)));
    }
    let count = vertices.len() as u32;
    for bytes in triangles.as_chunks::<TRIANGLE_BYTES>().0 {
        let [a, b, c, material] = integers(bytes);
        within("a vertex", a.max(b).max(c), count)?;
        within("a material", material, materials)?;
        mesh.triangles.push([a, b, c]);
        mesh.material_of.push(material);
    }
    Ok(mesh)
}

fn within(what: &'static str, index: u32, count: u32) -> Result<(), GeometryError> {
    if index < count {
        Ok(())
    } else {
        Err(GeometryError::Index { what, index, count })
    }
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
        let material = |kd_map| Material {
            name: String::new(),
            kd: Vec3::new(0.5, 0.25, 1.0),
            kd_map,
            emission: Vec3::ZERO,
        };
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
                uvs: vec![Vec2::new(0.25, 3.0); 4],
                triangles: vec![[0, 1, 2], [1, 2, 3]],
                material_of: vec![1, 0],
            },
            materials: vec![material(Some(0)), material(None)],
            textures: vec![Texture {
                width: 3,
                height: 1,
                texels: vec![[1, 2, 3], [4, 5, 6], [7, 8, 9]],
                wrap: Wrap::Clamp,
            }],
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
        assert_eq!(back.mesh.uvs, scene.mesh.uvs);
        assert_eq!(back.mesh.triangles, scene.mesh.triangles);
        assert_eq!(back.mesh.material_of, scene.mesh.material_of);
        assert_eq!(back.materials, scene.materials);
        assert_eq!(back.textures[0].texels, scene.textures[0].texels);
        assert_eq!(back.textures[0].wrap, scene.textures[0].wrap);
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
        let index = |what, index, count| GeometryError::Index { what, index, count };
        let four = 4u32.to_le_bytes();
        assert_eq!(changed(triangles, four), index("a vertex", 4, 4));
        assert_eq!(changed(triangles + 12, four), index("a material", 4, 2));
        let emitters = triangles + 2 * TRIANGLE_BYTES;
        assert_eq!(changed(emitters, 2u32.to_le_bytes()), GeometryError::Shape(2));
        assert_eq!(changed(emitters + 4, nan), GeometryError::NotFinite("an emitter"));
        let materials = emitters + EMITTER_BYTES;
        assert_eq!(changed(materials, nan), GeometryError::Albedo);
        assert_eq!(changed(materials + 12, four), index("a texture", 4, 1));
        let texture = materials + 2 * MATERIAL_BYTES;
        assert_eq!(changed(texture, [0; 4]), GeometryError::Texture);
        assert_eq!(changed(texture + 8, four), GeometryError::Texture);
        assert!(matches!(
            changed(texture, 5u32.to_le_bytes()),
            GeometryError::Length { .. }
        ));
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
