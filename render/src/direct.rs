//! Direct light: one sample of the area lights per pixel and pass.

use embree4_sys as embree;
use glam::{Vec2, Vec3};

use crate::{
    gbuffer::{GBuffer, Vec3Lanes},
    intersect::TracedScene,
    light::{LightPoint, LightSampler},
    sample::{
        Stream,
        pixel::PixelSamples,
        sobol::{fold_seed, hash},
    },
    settings::{Algorithm, LightPoints, Settings},
    vpl::{Gather, GeometryBound, Vpl, aim, any_positive, geometry_terms, seen, trace},
};

/// Sets the light samples' numbers apart from those of other purposes.
const SEED_PURPOSE: u32 = 0x6469_7265;

/// One pass of direct light over the picture.
#[derive(Debug, Clone, Copy)]
pub struct DirectPass {
    choice: f32,
    place: Vec2,
    seed: u32,
    light_points: LightPoints,
    /// The pixels' own sequences, if they have any.
    samples: Option<PixelSamples>,
}

impl DirectPass {
    /// The pass with the given number; all passes together are a Sobol sequence over the lights.
    pub fn new(settings: &Settings, pass: u32) -> Self {
        let seed = fold_seed(settings.seed, SEED_PURPOSE);
        let mut stream = Stream::new(pass, seed);
        let choice = stream.next_1d();
        Self {
            choice,
            place: stream.next_2d(),
            seed,
            light_points: settings.light_points,
            samples: match settings.algorithm {
                Algorithm::Progressive => Some(PixelSamples::new(settings.seed, pass)),
                _ => None,
            },
        }
    }

    /// Writes the light of this pass to `radiance`, one lane per point: radiance per unit albedo,
    /// W·m⁻²·sr⁻¹. `pixels` are the row-major indices of the points. Returns the number of shadow rays.
    pub fn add(
        &self,
        scene: &TracedScene,
        lights: &LightSampler,
        pixels: &[u32],
        points: &GBuffer,
        radiance: &mut Vec3Lanes,
    ) -> u64 {
        match self.light_points {
            LightPoints::PerPass => self.add_from_one_point(scene, lights, points, radiance),
            LightPoints::PerPixel => match scene.packet_width() {
                embree::PacketWidth::W4 => self.add_by::<4>(scene, lights, pixels, points, radiance),
                embree::PacketWidth::W8 => self.add_by::<8>(scene, lights, pixels, points, radiance),
                embree::PacketWidth::W16 => self.add_by::<16>(scene, lights, pixels, points, radiance),
            },
        }
    }

    /// A point of an area light is a point light, and its geometry term is never bounded.
    fn add_from_one_point(
        &self,
        scene: &TracedScene,
        lights: &LightSampler,
        points: &GBuffer,
        radiance: &mut Vec3Lanes,
    ) -> u64 {
        let Some(light) = lights.sample(self.choice, self.place) else {
            return 0;
        };
        let light = Vpl {
            position: light.position + scene.ray_offset() * light.normal,
            normal: light.normal,
            intensity: light.radiance_over_pdf,
        };
        Gather::new(scene, GeometryBound::new(None)).add(points, &[light], radiance)
    }

    fn add_by<const N: usize>(
        &self,
        scene: &TracedScene,
        lights: &LightSampler,
        pixels: &[u32],
        points: &GBuffer,
        radiance: &mut Vec3Lanes,
    ) -> u64
    where
        embree::Lanes<N>: embree::PacketSize,
    {
        let mut rays = 0;
        let mut packet = embree::RayPacket::<N>::new();
        for (index, pixels) in pixels.chunks(N).enumerate() {
            let mut positions = [Vec3::ZERO; N];
            let mut normals = [Vec3::ZERO; N];
            let mut emitted = [Vec3::ZERO; N];
            for (lane, &pixel) in pixels.iter().enumerate() {
                let Some(light) = self.point_for(lights, pixel) else {
                    return rays;
                };
                positions[lane] = light.position + scene.ray_offset() * light.normal;
                normals[lane] = light.normal;
                emitted[lane] = light.radiance_over_pdf / std::f32::consts::PI;
                [packet.org_x[lane], packet.org_y[lane], packet.org_z[lane]] = positions[lane].to_array();
            }
            let facing = aim(&mut packet, points, index, |lane| {
                (positions[lane], normals[lane])
            });
            if !any_positive(&facing) {
                continue;
            }
            rays += trace(scene, &mut packet, &facing);
            let seen = seen(&packet, &facing);
            let unbounded = GeometryBound::new(None);
            let terms = geometry_terms(&packet, points, index, |lane| normals[lane], unbounded, seen);
            for (lane, weight) in terms.into_iter().enumerate().take(pixels.len()) {
                radiance.add(index * N + lane, weight * emitted[lane]);
            }
        }
        rays
    }

    /// The next of the pixel's own sequence; or the pass's point, shifted around the torus by an offset
    /// of the pixel's own (Cranley and Patterson 1976): each pixel keeps the even spread of the passes.
    fn point_for(&self, lights: &LightSampler, pixel: u32) -> Option<LightPoint> {
        if let Some(samples) = self.samples {
            let (choice, place) = samples.light(pixel);
            return lights.sample(choice, place);
        }
        let offset = |dimension| unit(hash(self.seed ^ dimension, pixel));
        let place = (self.place + Vec2::new(offset(2), offset(3))).fract();
        lights.sample((self.choice + offset(1)).fract(), place)
    }
}

fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}
