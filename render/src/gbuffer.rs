//! The G-buffer: what each pixel sees first, as structure of arrays for packets of rays.

use bytemuck::zeroed_vec;
use embree4_sys as embree;
use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;

use crate::{
    camera::Camera,
    intersect::{SurfacePoint, TracedScene},
    sample::pixel::PixelSamples,
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

    /// Adds to the vector in one lane.
    pub(crate) fn add(&mut self, lane: usize, vector: Vec3) {
        self.x[lane] += vector.x;
        self.y[lane] += vector.y;
        self.z[lane] += vector.z;
    }

    /// The vectors in the given lanes, padded by zeros.
    fn select(&self, lanes: &[u32]) -> Self {
        let padded = lanes.len().next_multiple_of(LANES_MAX);
        let [x, y, z] = [&self.x, &self.y, &self.z].map(|axis| {
            let mut selected: Vec<f32> = lanes.iter().map(|&lane| axis[lane as usize]).collect();
            selected.resize(padded, 0.0);
            selected
        });
        Self { x, y, z }
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

/// A point that receives light: one lane of a [`GBuffer`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// World position, lifted off its surface; scene units.
    pub position: Vec3,
    /// Unit shading normal on the side that receives.
    pub shading_normal: Vec3,
    /// Unit geometric normal on the same side.
    pub geometric_normal: Vec3,
}

impl Receiver {
    /// A surface's point, lifted by `offset`.
    pub fn new(point: &SurfacePoint, offset: f32) -> Self {
        Self {
            position: point.lifted(offset),
            shading_normal: point.shading_normal,
            geometric_normal: point.geometric_normal,
        }
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
        let mut buffer = Self::unseen(pixels.len());
        let mut lane = 0;
        trace_pixels(scene, size, pixels, centre, |hit| {
            if let Some((point, _)) = hit {
                buffer.set(lane, Receiver::new(&point, scene.ray_offset()));
            }
            lane += 1;
        });
        buffer
    }

    /// The centres of `cells.x` × `cells.y` cells of the picture, row by row.
    pub fn overview(scene: &TracedScene, size: ImageSize, cells: UVec2) -> Self {
        let centre = |cell: u32, cells: u32, pixels: u32| {
            (u64::from(2 * cell + 1) * u64::from(pixels) / u64::from(2 * cells)) as u32
        };
        let pixels: Vec<u32> = (0..cells.y)
            .flat_map(|row| (0..cells.x).map(move |column| (row, column)))
            .map(|(row, column)| {
                centre(row, cells.y, size.height) * size.width + centre(column, cells.x, size.width)
            })
            .collect();
        Self::trace(scene, size, &pixels)
    }

    /// Points that were found otherwise.
    pub fn of_receivers(receivers: impl ExactSizeIterator<Item = Receiver>) -> Self {
        let mut buffer = Self::unseen(receivers.len());
        for (lane, receiver) in receivers.enumerate() {
            buffer.set(lane, receiver);
        }
        buffer
    }

    /// The point in one lane.
    pub fn receiver(&self, lane: usize) -> Receiver {
        Receiver {
            position: self.position.get(lane),
            shading_normal: self.shading_normal.get(lane),
            geometric_normal: self.geometric_normal.get(lane),
        }
    }

    /// So many pixels that see nothing.
    fn unseen(len: usize) -> Self {
        let padded = len.next_multiple_of(LANES_MAX);
        Self {
            len,
            position: Vec3Lanes::zeros(padded),
            shading_normal: Vec3Lanes::zeros(padded),
            geometric_normal: Vec3Lanes::zeros(padded),
        }
    }

    fn set(&mut self, lane: usize, receiver: Receiver) {
        self.position.set(lane, receiver.position);
        self.shading_normal.set(lane, receiver.shading_normal);
        self.geometric_normal.set(lane, receiver.geometric_normal);
    }

    /// The points in the given lanes, in their order.
    #[must_use]
    pub fn select(&self, lanes: &[u32]) -> Self {
        Self {
            len: lanes.len(),
            position: self.position.select(lanes),
            shading_normal: self.shading_normal.select(lanes),
            geometric_normal: self.geometric_normal.select(lanes),
        }
    }
}

/// What is seen at one place within each of a run of pixels.
#[derive(Debug, Clone)]
pub struct Footprint {
    /// The surfaces.
    pub points: GBuffer,
    /// Their diffuse albedo; 0 where nothing is seen.
    pub albedo: Vec3Lanes,
}

impl Footprint {
    /// Traces the given pixels (row-major indices), each at its `place` from its upper left corner, in
    /// pixels.
    pub fn trace(scene: &TracedScene, size: ImageSize, pixels: &[u32], place: impl Fn(u32) -> Vec2) -> Self {
        let points = GBuffer::unseen(pixels.len());
        let mut footprint = Self {
            albedo: Vec3Lanes::zeros(points.position.x.len()),
            points,
        };
        let mut lane = 0;
        trace_pixels(scene, size, pixels, place, |hit| {
            if let Some((point, _)) = hit {
                footprint
                    .points
                    .set(lane, Receiver::new(&point, scene.ray_offset()));
                footprint.albedo.set(lane, point.albedo);
            }
            lane += 1;
        });
        footprint
    }
}

/// What the whole picture shows at the first surfaces, each `[height][width]`, rows from the top.
#[derive(Debug, Clone)]
pub struct Aovs {
    /// Picture size.
    pub size: ImageSize,
    /// The eye, and where each pixel looks.
    pub camera: Camera,
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
        camera: Camera::new(&scene.scene().camera, size),
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
            trace_pixels(scene, size, &pixels, centre, |hit| {
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

/// The same, antialiased: where a pixel differs from a neighbour, albedo, normal and emission become means
/// over so many places in it, and normals there are shorter than 1. Depth stays that of the centre.
///
/// `None` if `stop`, asked now and then from any thread, says that there is no time for it.
pub fn antialias_aovs(
    scene: &TracedScene,
    aovs: &Aovs,
    samples: u32,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Aovs> {
    let mut smooth = aovs.clone();
    let width = aovs.size.width as usize;
    let rows = (smooth.albedo.par_chunks_mut(width))
        .zip(smooth.normal.par_chunks_mut(width))
        .zip(smooth.emission.par_chunks_mut(width));
    let is_whole = rows.enumerate().all(|(row, ((albedo, normal), emission))| {
        if stop() {
            return false;
        }
        let first = row * width;
        let edges: Vec<u32> = (first..first + width)
            .filter(|&pixel| aovs.has_edge(pixel))
            .map(|pixel| pixel as u32)
            .collect();
        let columns: Vec<usize> = edges.iter().map(|&pixel| pixel as usize - first).collect();
        for &column in &columns {
            (albedo[column], normal[column], emission[column]) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        }
        let weight = 1.0 / samples as f32;
        for sample in 0..samples {
            let places = PixelSamples::new(AOV_SEED, sample);
            let mut columns = columns.iter();
            let place = |pixel| places.place(pixel);
            trace_pixels(scene, aovs.size, &edges, place, |hit| {
                if let (Some(&column), Some((point, _))) = (columns.next(), hit) {
                    albedo[column] += weight * point.albedo;
                    normal[column] += weight * point.shading_normal;
                    emission[column] += weight * point.emission;
                }
            });
        }
        true
    });
    is_whole.then_some(smooth)
}

/// Of no consequence: any seed is as good.
const AOV_SEED: u64 = 0;
/// Neighbouring pixels whose albedos differ by more, in any channel, have an edge between them.
const ALBEDO_STEP: f32 = 0.01;
/// Cosine between the normals of neighbouring pixels below which there is an edge.
const NORMAL_STEP: f32 = 0.98;

impl Aovs {
    /// Whether a pixel shows something else than one of its eight neighbours.
    fn has_edge(&self, pixel: usize) -> bool {
        let (width, height) = (self.size.width as usize, self.size.height as usize);
        let (x, y) = (pixel % width, pixel / width);
        let near = |place: usize, count: usize| place.saturating_sub(1)..(place + 2).min(count);
        near(y, height)
            .flat_map(|y| near(x, width).map(move |x| y * width + x))
            .any(|other| self.differ(pixel, other))
    }

    fn differ(&self, a: usize, b: usize) -> bool {
        let albedo = (self.albedo[a] - self.albedo[b]).abs().max_element() > ALBEDO_STEP;
        let is_seen = self.depth[a].is_finite();
        let normal = is_seen && self.normal[a].dot(self.normal[b]) < NORMAL_STEP;
        albedo || normal || self.emission[a] != self.emission[b] || is_seen != self.depth[b].is_finite()
    }
}

/// The place in the middle of a pixel.
fn centre(_pixel: u32) -> Vec2 {
    Vec2::splat(0.5)
}

/// Calls `visit` once per pixel, in order, with the first surface at the pixel's `place`, from its upper
/// left corner, and the surface's distance from the eye.
fn trace_pixels(
    scene: &TracedScene,
    size: ImageSize,
    pixels: &[u32],
    place: impl Fn(u32) -> Vec2,
    visit: impl FnMut(Option<(SurfacePoint, f32)>),
) {
    match scene.packet_width() {
        embree::PacketWidth::W4 => trace_packets::<4>(scene, size, pixels, place, visit),
        embree::PacketWidth::W8 => trace_packets::<8>(scene, size, pixels, place, visit),
        embree::PacketWidth::W16 => trace_packets::<16>(scene, size, pixels, place, visit),
    }
}

fn trace_packets<const N: usize>(
    scene: &TracedScene,
    size: ImageSize,
    pixels: &[u32],
    place: impl Fn(u32) -> Vec2,
    mut visit: impl FnMut(Option<(SurfacePoint, f32)>),
) where
    embree::Lanes<N>: embree::PacketSize,
{
    let camera = Camera::new(&scene.scene().camera, size);
    for pixels in pixels.chunks(N) {
        let mut rays = embree::RayPacket::<N>::new();
        let mut directions = [Vec3::ZERO; N];
        for (lane, &pixel) in pixels.iter().enumerate() {
            let (x, y, place) = (pixel % size.width, pixel / size.width, place(pixel));
            directions[lane] = camera.direction(x as f32 + place.x, y as f32 + place.y);
            rays.set(
                lane,
                &embree::Ray::new(camera.eye().to_array(), directions[lane].to_array()),
            );
        }
        let mut packet = embree::RayHitPacket::new(rays);
        let valid = embree::LaneMask::first(pixels.len());
        scene
            .accelerated()
            .intersect(&valid, &mut packet, embree::Coherence::Coherent);
        for (lane, &direction) in directions.iter().enumerate().take(pixels.len()) {
            visit(packet.hit(lane).map(|hit| {
                let triangle = hit.primitive as usize;
                let point = SurfacePoint::new(scene.scene(), triangle, camera.eye(), direction);
                (point, point.position.distance(camera.eye()))
            }));
        }
    }
}
