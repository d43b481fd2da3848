//! Triangle meshes in memory that Embree may read while it builds and traces.

use std::ffi::c_void;

use crate::{
    device::Device,
    error::Error,
    raw::{self, RTCBufferType, RTCFormat, RTCGeometryType, RTCScene},
};

/// The number of a mesh in its scene, in the order of attaching, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GeometryId(pub u32);

/// Coordinates beyond this are outside of what Embree traces.
pub const COORDINATE_MAX: f32 = 1.844e18;

/// Embree reads 16 bytes at a time, so the last 12-byte element of a buffer
/// must be followed by four readable bytes ("Embree API",
/// rtcSetSharedGeometryBuffer): one element too many is kept at the end.
const PADDING: usize = 1;

/// The vertex buffer may have at most 16 GB ("Embree API",
/// `RTC_GEOMETRY_TYPE_TRIANGLE`).
const VERTICES_MAX: usize = (16 << 30) / 12 - PADDING;

/// Embree numbers triangles with 32 bits and keeps the highest number for
/// "none".
const TRIANGLES_MAX: usize = u32::MAX as usize - 1;

/// Triangles that were checked: every index names a vertex, and every vertex is
/// at a finite place. Never changes, so a scene can share the memory.
pub struct TriangleMesh {
    positions: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// Takes vertices (`[vertex][xyz]`, in scene units) and triangles
    /// (`[triangle][corner]`, counted from 0); a triangle's normal points to
    /// where its corners are seen counter-clockwise.
    ///
    /// # Errors
    /// [`Error::Position`], [`Error::Index`] or [`Error::TooLarge`] for the first
    /// thing that is wrong.
    pub fn new(mut positions: Vec<[f32; 3]>, mut indices: Vec<[u32; 3]>) -> Result<Self, Error> {
        check_count("vertices", positions.len(), VERTICES_MAX)?;
        check_count("triangles", indices.len(), TRIANGLES_MAX)?;
        check_positions(&positions)?;
        check_indices(&indices, positions.len())?;
        positions.push([0.0; 3]);
        indices.push([0; 3]);
        Ok(Self { positions, indices })
    }

    /// Vertices, `[vertex][xyz]`, in scene units.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions[..self.positions.len() - PADDING]
    }

    /// Triangles, `[triangle][corner]`.
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.indices[..self.indices.len() - PADDING]
    }

    /// Gives this mesh to a scene that is being built.
    ///
    /// # Safety
    /// `scene` is a live scene of `device`, and this mesh lives unchanged for as
    /// long as it.
    pub(crate) unsafe fn attach(
        &self,
        device: &Device,
        scene: RTCScene,
        id: GeometryId,
    ) -> Result<(), Error> {
        // Embree refuses buffers without elements; an empty mesh is never hit.
        if self.indices().is_empty() {
            return Ok(());
        }
        // SAFETY: the device is live ("Embree API", rtcNewGeometry); NULL is
        // handled next.
        let geometry =
            unsafe { raw::rtcNewGeometry(device.handle(), RTCGeometryType::RTC_GEOMETRY_TYPE_TRIANGLE) };
        if geometry.is_null() {
            return Err(device.failure("making a mesh"));
        }
        // SAFETY: both buffers hold the number of 12-byte elements said here and
        // one more as padding, are aligned to 4 bytes, are not changed and live
        // as long as the scene, as the caller promises ("Embree API",
        // rtcSetSharedGeometryBuffer). Indices are within the vertices (checked
        // in `new`). The scene holds a count of the geometry after
        // rtcAttachGeometryByID, so ours is given back ("Embree API",
        // rtcReleaseGeometry).
        unsafe {
            raw::rtcSetSharedGeometryBuffer(
                geometry,
                RTCBufferType::RTC_BUFFER_TYPE_VERTEX,
                0,
                RTCFormat::RTC_FORMAT_FLOAT3,
                self.positions.as_ptr().cast::<c_void>(),
                0,
                size_of::<[f32; 3]>(),
                self.positions().len(),
            );
            raw::rtcSetSharedGeometryBuffer(
                geometry,
                RTCBufferType::RTC_BUFFER_TYPE_INDEX,
                0,
                RTCFormat::RTC_FORMAT_UINT3,
                self.indices.as_ptr().cast::<c_void>(),
                0,
                size_of::<[u32; 3]>(),
                self.indices().len(),
            );
            raw::rtcCommitGeometry(geometry);
            raw::rtcAttachGeometryByID(scene, geometry, id.0);
            raw::rtcReleaseGeometry(geometry);
        }
        device.check("attaching a mesh")
    }
}

impl std::fmt::Debug for TriangleMesh {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("TriangleMesh")
            .field("vertices", &self.positions().len())
            .field("triangles", &self.indices().len())
            .finish()
    }
}

fn check_count(what: &'static str, count: usize, count_max: usize) -> Result<(), Error> {
    if count <= count_max {
        Ok(())
    } else {
        Err(Error::TooLarge {
            what,
            count,
            count_max,
        })
    }
}

fn check_positions(positions: &[[f32; 3]]) -> Result<(), Error> {
    // Written so that a coordinate that is not a number fails too.
    let is_valid = |position: &[f32; 3]| {
        position
            .iter()
            .all(|coordinate| coordinate.abs() <= COORDINATE_MAX)
    };
    match positions.iter().position(|position| !is_valid(position)) {
        None => Ok(()),
        Some(vertex) => Err(Error::Position {
            vertex,
            position: positions[vertex],
        }),
    }
}

fn check_indices(indices: &[[u32; 3]], vertices: usize) -> Result<(), Error> {
    let outside = indices.iter().enumerate().find_map(|(triangle, corners)| {
        let index = corners.iter().find(|&&index| index as usize >= vertices)?;
        Some((triangle, *index))
    });
    match outside {
        None => Ok(()),
        Some((triangle, index)) => Err(Error::Index {
            triangle,
            index,
            vertices,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn the_padding_is_not_part_of_the_mesh() {
        let mesh = TriangleMesh::new(CORNERS.to_vec(), vec![[0, 1, 2]]).expect("a valid mesh");
        assert_eq!(mesh.positions(), CORNERS);
        assert_eq!(mesh.indices(), [[0, 1, 2]]);
    }

    #[test]
    fn a_vertex_at_no_finite_place_is_refused() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2.0e18] {
            let mut corners = CORNERS.to_vec();
            corners[2][1] = bad;
            let error = TriangleMesh::new(corners, vec![[0, 1, 2]]).expect_err("refused");
            assert!(matches!(error, Error::Position { vertex: 2, .. }), "{error}");
        }
    }

    #[test]
    fn an_index_without_a_vertex_is_refused() {
        let error = TriangleMesh::new(CORNERS.to_vec(), vec![[0, 1, 2], [0, 3, 1]]).expect_err("refused");
        assert_eq!(
            error,
            Error::Index {
                triangle: 1,
                index: 3,
                vertices: 3
            }
        );
    }
}
