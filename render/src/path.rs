//! The gold integrator: a simple path tracer, the judge of the VPLs.
//!
//! It shares the scene, its surface points and the choice of light points with the tasks, and nothing
//! else. The emission of the first surface is left to the G-buffer, as it is for the tasks.

use std::sync::{
    Arc,
    atomic::{AtomicU32, Ordering},
};

use glam::{DVec3, Vec2, Vec3};

use crate::{
    camera::Camera,
    gbuffer::Aovs,
    image::Picture,
    intersect::{SurfacePoint, TracedScene},
    light::{LightSampler, luminance},
    sample::{
        Stream,
        sobol::{fold_seed, hash},
        warp::cosine_direction,
    },
};

/// Bounces before Russian roulette may end a path.
const BOUNCES_MIN: usize = 2;
/// Bounces after which a path is cut; at a survival of 0.95 one in 10²² gets here.
const BOUNCES_MAX: usize = 1_000;
/// Largest probability of going on.
const SURVIVAL_MAX: f32 = 0.95;
/// Sets the paths' numbers apart from those of other purposes.
const SEED_PURPOSE: u32 = 0x676f_6c64;

/// Where a pixel's paths go through it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Through {
    /// All through its centre, as the paper's samples do.
    Centre,
    /// Evenly spread over it: the picture is antialiased by a box filter.
    WholePixel,
}

/// Light at one pixel, by component; radiance in W·m⁻²·sr⁻¹.
#[derive(Debug, Clone, Copy, Default)]
struct PathRadiance {
    /// One bounce from an emitter to the eye.
    direct: Vec3,
    /// All further bounces.
    indirect: Vec3,
}

/// Renders all pixels with `spp` paths each, with all cores: through their centres, or spread over them.
///
/// `progress` is told the finished share of the rows, from any thread.
pub fn path_trace(
    scene: &TracedScene,
    aovs: &Arc<Aovs>,
    through: Through,
    spp: u32,
    seed: u64,
    progress: &(dyn Fn(f32) + Sync),
) -> Picture {
    let size = aovs.size;
    let tracer = PathTracer {
        scene,
        camera: Camera::new(&scene.scene().camera, size),
        through,
        lights: LightSampler::new(&scene.scene().emitters),
        spp,
        seed: fold_seed(seed, SEED_PURPOSE),
    };
    let rows_done = AtomicU32::new(0);
    Picture::from_rows(aovs, 1, |row| {
        let _flush = embree4_sys::FlushDenormals::in_this_thread();
        let y = row.first as u32 / size.width;
        for (x, (direct, indirect)) in (0..).zip(row.direct.iter_mut().zip(row.indirect)) {
            let light = tracer.pixel(x, y);
            (*direct, *indirect) = (light.direct, light.indirect);
        }
        row.samples_direct.fill(spp);
        row.samples_indirect.fill(spp);
        let done = 1 + rows_done.fetch_add(1, Ordering::Relaxed);
        progress(done as f32 / size.height as f32);
    })
}

struct PathTracer<'a> {
    scene: &'a TracedScene,
    camera: Camera,
    through: Through,
    lights: LightSampler,
    spp: u32,
    seed: u32,
}

impl PathTracer<'_> {
    fn pixel(&self, x: u32, y: u32) -> PathRadiance {
        let first = |place: Vec2| {
            let direction = self.camera.direction(x as f32 + place.x, y as f32 + place.y);
            self.scene.nearest(self.camera.eye(), direction)
        };
        let centre = first(Vec2::splat(0.5));
        let seed = hash(hash(self.seed, x), y);
        let places = hash(seed, 1);
        let (mut direct, mut indirect) = (DVec3::ZERO, DVec3::ZERO);
        for index in 0..self.spp {
            let first = match self.through {
                Through::Centre => centre,
                Through::WholePixel => first(Stream::new(index, places).next_2d()),
            };
            let Some(first) = first else {
                continue;
            };
            let sample = self.path(first, Stream::new(index, seed));
            direct += sample.direct.as_dvec3();
            indirect += sample.indirect.as_dvec3();
        }
        let mean = |sum: DVec3| (sum / f64::from(self.spp)).as_vec3();
        PathRadiance {
            direct: mean(direct),
            indirect: mean(indirect),
        }
    }

    /// At each vertex the emitters are sampled both by area and by the direction in which the path goes
    /// on, weighted by the balance heuristic (Veach 1997, section 9.2): corners of rooms that shine do
    /// not spoil the mean.
    fn path(&self, first: SurfacePoint, mut stream: Stream) -> PathRadiance {
        let mut point = first;
        let mut radiance = PathRadiance::default();
        let mut throughput = Vec3::ONE;
        for bounce in 0..BOUNCES_MAX {
            throughput *= point.albedo;
            let component = if bounce == 0 {
                &mut radiance.direct
            } else {
                &mut radiance.indirect
            };
            *component += throughput * self.light_from_emitters(&point, &mut stream);
            let direction = cosine_direction(point.shading_normal, stream.next_2d());
            if direction.dot(point.geometric_normal) <= 0.0 {
                break;
            }
            let Some(next) = self
                .scene
                .nearest(point.lifted(self.scene.ray_offset()), direction)
            else {
                break;
            };
            *component += throughput * self.emission_met(&point, &next);
            point = next;
            if bounce >= BOUNCES_MIN {
                let survival = luminance(throughput).min(SURVIVAL_MAX);
                if stream.next_1d() >= survival {
                    break;
                }
                throughput /= survival;
            }
        }
        radiance
    }

    /// Radiance per unit albedo from one point of the emitters, weighted against directions.
    fn light_from_emitters(&self, point: &SurfacePoint, stream: &mut Stream) -> Vec3 {
        let Some(light) = self.lights.sample_stream(stream) else {
            return Vec3::ZERO;
        };
        let offset = self.scene.ray_offset();
        let (from, to) = (light.position + offset * light.normal, point.lifted(offset));
        let connection = to - from;
        let squared = connection.length_squared();
        let at_light = connection.dot(light.normal);
        let shading = -connection.dot(point.shading_normal);
        let geometric = -connection.dot(point.geometric_normal);
        if at_light <= 0.0 || shading <= 0.0 || geometric <= 0.0 || !self.scene.visible(from, to) {
            return Vec3::ZERO;
        }
        // Both densities per area of the emitters.
        let by_direction = at_light * shading / (squared * squared) / std::f32::consts::PI;
        let weight = light.pdf / (light.pdf + by_direction);
        light.radiance_over_pdf * (by_direction * weight)
    }

    /// Emission met by a direction drawn with density `cos / π`, weighted against sampling by area.
    fn emission_met(&self, from: &SurfacePoint, met: &SurfacePoint) -> Vec3 {
        if met.emission == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let connection = from.position - met.position;
        let squared = connection.length_squared();
        let at_light = connection.dot(met.geometric_normal);
        let shading = -connection.dot(from.shading_normal);
        let by_direction = at_light * shading / (squared * squared) / std::f32::consts::PI;
        met.emission * (by_direction / (by_direction + self.lights.pdf(met.emission)))
    }
}
