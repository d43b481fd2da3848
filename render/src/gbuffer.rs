//! The G-buffer: what each pixel sees first, as structure of arrays for packets of rays.

use bytemuck::zeroed_vec;
use embree4_sys as embree;
use glam::Vec3;
use rayon::prelude::*;

use crate::{
    camera::Camera,
    intersect::{SurfacePoint, TracedScene},
    scene::ImageSize,
};

/// Points are padded to a multiple of this, the widest packet.
pub const LANES_MAX: usize = 16;

/// Vectors as three arrays, so that neighbouring points lie in neighbouring lanes.
#[derive(Debug, Clone, Default)]
pub struct Vec3Lanes {
    /// First coordinates.
    pub x: Vec<f32>,
    /// Second coordinates.
    pub y: Vec<f32>,
    /// Third coordinates.
    pub z: Vec<f32>,
}

impl Vec3Lanes {
    /// Zeros.
    pub fn zeros(len: usize) -> Self {
        Self {
            x: vec![0.0; len],
            y: vec![0.0; len],
            z: vec![0.0; len],
        }
    }

    /// The vector in one lane.
    pub fn get(&self, lane: usize) -> Vec3 {
        Vec3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    fn set(&mut self, lane: usize, vector: Vec3) {
        [self.x[lane], self.y[lane], self.z[lane]] = vector.to_array();
    }

    /// The lanes of packet number `packet`, as arrays.
    #[inline]
    pub(crate) fn packet<const N: usize>(&self, packet: usize) -> [&[f32; N]; 3] {
        [&self.x, &self.y, &self.z].map(|axis| &axis.as_chunks::<N>().0[packet])
    }
}

/// The first surfaces behind a run of pixels. Pixels that see nothing have zero normals, and so do the
/// lanes of padding: no light reaches either.
#[derive(Debug, Clone)]
pub struct GBuffer {
    /// Number of pixels, without the padding.
    pub len: usize,
    /// World positions, lifted off their surfaces towards the eye; scene units.
    pub position: Vec3Lanes,
    /// Unit shading normals towards the eye.
    pub shading_normal: Vec3Lanes,
    /// Unit geometric normals towards the eye.
    pub geometric_normal: Vec3Lanes,
}

impl GBuffer {
    /// Traces the centres of the given pixels (row-major indices).
    pub fn trace(scene: &TracedScene, size: ImageSize, pixels: &[u32]) -> Self {
        let padded = pixels.len().next_multiple_of(LANES_MAX);
        let mut buffer = Self {
            len: pixels.len(),
            position: Vec3Lanes::zeros(padded),
            shading_normal: Vec3Lanes::zeros(padded),
            geometric_normal: Vec3Lanes::zeros(padded),
        };
        let mut lane = 0;
        trace_pixels(scene, size, pixels, |hit| {
            if let Some((point, _)) = hit {
                buffer.position.set(lane, point.lifted(scene.ray_offset()));
                buffer.shading_normal.set(lane, point.shading_normal);
                buffer.geometric_normal.set(lane, point.geometric_normal);
            }
            lane += 1;
        });
        buffer
    }
}

/// What the whole picture shows at the first surfaces, each `[height][width]`, rows from the top.
#[derive(Debug, Clone)]
pub struct Aovs {
    /// Picture size.
    pub size: ImageSize,
    /// Diffuse albedo per channel; 0 where nothing is seen.
    pub albedo: Vec<Vec3>,
    /// Unit shading normals, world space, towards the eye; 0 where nothing is seen.
    pub normal: Vec<Vec3>,
    /// Distance from the eye in scene units; infinite where nothing is seen.
    pub depth: Vec<f32>,
    /// Radiance emitted towards the eye, W·m⁻²·sr⁻¹.
    pub emission: Vec<Vec3>,
}

/// Traces the centres of all pixels, with all cores.
pub fn trace_aovs(scene: &TracedScene, size: ImageSize) -> Aovs {
    let count = size.pixel_count();
    let mut aovs = Aovs {
        size,
        // Pages of memory are taken by the threads that fill them.
        albedo: zeroed_vec(count),
        normal: zeroed_vec(count),
        depth: vec![0.0; count],
        emission: zeroed_vec(count),
    };
    let width = size.width as usize;
    let rows = (aovs.albedo.par_chunks_mut(width))
        .zip(aovs.normal.par_chunks_mut(width))
        .zip(aovs.depth.par_chunks_mut(width))
        .zip(aovs.emission.par_chunks_mut(width));
    rows.enumerate()
        .for_each(|(row, (((albedo, normal), depth), emission))| {
            let first = row * width;
            let pixels: Vec<u32> = (first..first + width).map(|pixel| pixel as u32).collect();
            let mut column = 0;
            trace_pixels(scene, size, &pixels, |hit| {
                depth[column] = match hit {
                    Some((point, distance)) => {
                        albedo[column] = point.albedo;
                        normal[column] = point.shading_normal;
                        emission[column] = point.emission;
                        distance
                    }
                    None => f32::INFINITY,
                };
                column += 1;
            });
        });
    aovs
}

/// Calls `visit` once per pixel, in order, with the first surface and its distance from the eye.
fn trace_pixels(
    scene: &TracedScene,
    size: ImageSize,
    pixels: &[u32],
    visit: impl FnMut(Option<(SurfacePoint, f32)>),
) {
    match scene.packet_width() {
        embree::PacketWidth::W4 => trace_packets::<4>(scene, size, pixels, visit),
        embree::PacketWidth::W8 => trace_packets::<8>(scene, size, pixels, visit),
        embree::PacketWidth::W16 => trace_packets::<16>(scene, size, pixels, visit),
    }
}

fn trace_packets<const N: usize>(
    scene: &TracedScene,
    size: ImageSize,
    pixels: &[u32],
    mut visit: impl FnMut(Option<(SurfacePoint, f32)>),
) where
    embree::Lanes<N>: embree::PacketSize,
{
    let camera = Camera::new(&scene.scene().camera, size);
    let direction = |pixel: u32| {
        let (x, y) = (pixel % size.width, pixel / size.width);
        camera.direction(x as f32 + 0.5, y as f32 + 0.5)
    };
    for pixels in pixels.chunks(N) {
        let mut rays = embree::RayPacket::<N>::new();
        for (lane, &pixel) in pixels.iter().enumerate() {
            rays.set(
                lane,
                &embree::Ray::new(camera.eye().to_array(), direction(pixel).to_array()),
            );
        }
        let mut packet = embree::RayHitPacket::new(rays);
        let valid = embree::LaneMask::first(pixels.len());
        scene
            .accelerated()
            .intersect(&valid, &mut packet, embree::Coherence::Coherent);
        for (lane, &pixel) in pixels.iter().enumerate() {
            visit(packet.hit(lane).map(|hit| {
                let triangle = hit.primitive as usize;
                let point = SurfacePoint::new(scene.scene(), triangle, camera.eye(), direction(pixel));
                (point, point.position.distance(camera.eye()))
            }));
        }
    }
}
