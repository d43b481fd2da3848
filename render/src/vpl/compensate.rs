//! What the bound of the geometry term takes away, put back by short rays (Kollig and Keller,
//! "Illumination in the presence of weak singularities", 2004).
//!
//! Where a VPL and a point are so near that their geometry term `G` exceeds the bound `b`, the gather
//! takes `b` in its place: no VPL leaves a bright spot, but corners are too dark. What is missing is light
//! that nearby surfaces reflect, each with a share of `1 − b/G`. A ray from the point with density
//! `cos / π` finds such a surface, and where it does the radiance that comes back is estimated like the
//! light at any point: one light sample, the same VPLs bounded, and what their bound took away there.

use glam::{UVec2, Vec3};

use super::{Gather, GeometryBound, Vpl, VplSet};
use crate::{
    direct::DirectPass,
    gbuffer::{GBuffer, Receiver, Vec3Lanes},
    intersect::TracedScene,
    light::{LightSampler, luminance},
    sample::{
        Stream,
        sobol::{fold_seed, hash},
        warp::cosine_direction,
    },
    settings::{LightPoints, Settings},
    task::RayCounts,
};

/// So many times as bright as a usual point of the picture is by all VPLs may a usual VPL make its
/// surroundings ([`automatic_bound`]).
const BRIGHTEST: f32 = 16.0;
/// Cells of the picture whose brightness is looked at for that.
const CELLS: UVec2 = UVec2::new(64, 48);
/// Largest probability of going on after a hit, so that paths end in corners of pure white too.
const SURVIVAL_MAX: f32 = 0.95;
/// A path that has not ended after so many hits is cut; at a survival of 0.95 one in 10²² gets here.
const HITS_MAX: usize = 1_000;
/// Sets the short rays' numbers apart from those of other purposes.
const SEED_PURPOSE: u32 = 0x636f_6d70;

/// A bound that keeps both noise and cost low, in 1/(scene unit)²; a function of the frame's first set.
///
/// At the bound, the mean VPL of a set is 16 times as bright as the median point of the picture is lit, in
/// a picture that averages many sets. Lower bounds give more of the light to short rays, which cost more
/// than VPLs; with higher ones VPLs leave bright spots. `cargo bench -p render --bench compensation`
/// compares bounds; docs/performance.md has its table. `None` where no VPL lights the picture: nothing
/// needs a bound.
pub fn automatic_bound(scene: &TracedScene, settings: &Settings, set: &VplSet) -> Option<f32> {
    let points = GBuffer::overview(scene, settings.size, CELLS);
    let mut radiance = Vec3Lanes::zeros(points.position.x.len());
    Gather::new(scene, GeometryBound::new(None)).add(&points, &set.vpls, &mut radiance);
    let mut lit: Vec<f32> = (0..points.len)
        .map(|lane| luminance(radiance.get(lane)))
        .filter(|&luminance| luminance > 0.0)
        .collect();
    let middle = lit.len() / 2;
    let (_, &mut median, _) =
        (!lit.is_empty()).then(|| lit.select_nth_unstable_by(middle, f32::total_cmp))?;
    let intensity: Vec3 = set.vpls.iter().map(|vpl| vpl.intensity).sum();
    let bound = BRIGHTEST * std::f32::consts::PI * median * set.vpls.len() as f32 / luminance(intensity);
    (bound.is_finite() && bound > 0.0).then_some(bound)
}

/// Puts back what [`Gather`] leaves out because of its bound.
#[derive(Debug, Clone, Copy)]
pub struct Compensation<'a> {
    scene: &'a TracedScene,
    lights: &'a LightSampler,
    bound: f32,
    seed: u32,
    /// The light samples where short rays hit: a point of the lights for each path.
    direct: Settings,
}

impl<'a> Compensation<'a> {
    /// A compensation for the bound of these settings; `None` if there is none.
    pub fn new(scene: &'a TracedScene, lights: &'a LightSampler, settings: &Settings) -> Option<Self> {
        let seed = fold_seed(settings.seed, SEED_PURPOSE);
        Some(Self {
            scene,
            lights,
            bound: settings.geometry_clamp?,
            seed,
            direct: Settings {
                light_points: LightPoints::PerPixel,
                seed: seed.into(),
                ..*settings
            },
        })
    }

    /// Adds to `radiance`, one lane per point, what the bounded gather of `vpls` lacks: radiance per unit
    /// albedo, W·m⁻²·sr⁻¹.
    ///
    /// `pixels` are the row-major indices of the points. `vpls` must be an estimate of all indirect light
    /// by themselves, as a [`VplSet`](super::VplSet) is. Each `pass` is another estimate; those that follow
    /// each other are stratified in every pixel.
    pub fn add(
        &self,
        pixels: &[u32],
        points: &GBuffer,
        vpls: &[Vpl],
        pass: u32,
        radiance: &mut Vec3Lanes,
    ) -> RayCounts {
        let direct = DirectPass::new(&self.direct, pass);
        let gather = Gather::new(self.scene, GeometryBound::new(Some(self.bound)));
        let mut rays = RayCounts::default();
        let mut paths: Vec<ShortPath> = (0..points.len)
            .map(|lane| ShortPath {
                lane,
                end: points.receiver(lane),
                throughput: Vec3::ONE,
                stream: Stream::new(pass, hash(self.seed, pixels[lane])),
            })
            .collect();
        for _ in 0..HITS_MAX {
            paths.retain_mut(|path| path.go_on(self.scene, self.bound, &mut rays.shadow));
            if paths.is_empty() {
                break;
            }
            let hits = GBuffer::of_receivers(paths.iter().map(|path| path.end));
            let pixels: Vec<u32> = paths.iter().map(|path| pixels[path.lane]).collect();
            let mut light = Vec3Lanes::zeros(hits.position.x.len());
            rays.shadow += direct.add(self.scene, self.lights, &pixels, &hits, &mut light);
            rays.shadow += gather.add(&hits, vpls, &mut light);
            for (hit, path) in paths.iter().enumerate() {
                radiance.add(path.lane, path.throughput * light.get(hit));
            }
        }
        rays
    }
}

/// A path from a point of the G-buffer along surfaces that are too near for VPLs.
#[derive(Debug)]
struct ShortPath {
    /// Where it began.
    lane: usize,
    /// Where it is.
    end: Receiver,
    /// What the radiance per unit albedo here adds to that of the beginning.
    throughput: Vec3,
    stream: Stream,
}

impl ShortPath {
    /// Goes on to the next hit; false if there is none, or the path ends by Russian roulette.
    fn go_on(&mut self, scene: &TracedScene, bound: f32, rays: &mut u64) -> bool {
        let Receiver {
            position,
            shading_normal,
            geometric_normal,
        } = self.end;
        // Where nothing is seen there are no normals.
        if shading_normal == Vec3::ZERO {
            return false;
        }
        let direction = cosine_direction(shading_normal, self.stream.next_2d());
        let cosine = direction.dot(shading_normal);
        if cosine <= 0.0 || direction.dot(geometric_normal) <= 0.0 {
            return false;
        }
        *rays += 1;
        // Farther away the geometry term cannot exceed the bound.
        let reach = (cosine / bound).sqrt();
        let Some(point) = scene.nearest_within(position, direction, reach) else {
            return false;
        };
        let cosine_there = -direction.dot(point.geometric_normal);
        let term = cosine * cosine_there / point.position.distance_squared(position);
        let removed = (1.0 - bound / term).max(0.0);
        let throughput = removed * point.albedo * self.throughput;
        let survival = throughput.max_element().min(SURVIVAL_MAX);
        if self.stream.next_1d() >= survival {
            return false;
        }
        self.throughput = throughput / survival;
        self.end = Receiver::new(&point, scene.ray_offset());
        true
    }
}
