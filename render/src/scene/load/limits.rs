//! Limits on what a scene may bring, checked before memory is taken.

/// Bytes of a TOML scene file.
pub const SCENE_FILE_BYTES_MAX: u64 = 16 << 20;
/// Bytes of one OBJ file.
pub const OBJ_BYTES_MAX: u64 = 1 << 30;
/// Bytes of one MTL file.
pub const MTL_BYTES_MAX: u64 = 16 << 20;
/// Bytes of one PNG or JPEG file.
pub const TEXTURE_BYTES_MAX: u64 = 256 << 20;
/// Texels along either side of one texture.
pub const TEXTURE_SIDE_MAX: u32 = 16_384;
/// Texels of all textures together (3 bytes each).
pub const TEXELS_MAX: u64 = 1 << 27;
/// `[[mesh]]` entries.
pub const MESHES_MAX: usize = 65_536;
/// `[[light.quad]]` entries.
pub const QUAD_LIGHTS_MAX: usize = 65_536;
/// Vertices of all meshes together; indices are 32 bits wide.
pub const VERTICES_MAX: u64 = 1 << 26;
/// Triangles of all meshes together.
pub const TRIANGLES_MAX: u64 = 1 << 25;
/// Largest coordinate in scene units: squared areas of edges below it stay finite in `f32`.
pub const COORDINATE_MAX: f32 = 1e9;
/// Largest emitted radiance in W·m⁻²·sr⁻¹: sums over lights and pixels stay finite in `f32`.
pub const RADIANCE_MAX: f32 = 1e12;
/// Smallest factor by which a mesh may be scaled.
pub const SCALE_MIN: f32 = 1e-9;
/// Largest factor by which a mesh may be scaled.
pub const SCALE_MAX: f32 = 1e9;
