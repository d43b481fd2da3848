//! More VPLs where they matter to the picture.
//!
//! What a VPL of unit intensity adds to a pixel is its geometry term `G` there, if nothing is between. The
//! variance summed over the pixels is least when VPLs are drawn in proportion to their light times
//! √(ΣG²) over all pixels: one that the picture never sees the light of is hardly needed, and where a
//! VPL shines closely on what is seen, in a corner, many dim ones must stand in place of a bright one.
//! Georgiev and Slusallek ("Simple and robust iterative importance sampling of virtual point lights",
//! 2010) go by the sum itself and estimate it from pixels; here rays from the VPL find the pixels that
//! are near, too.

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use super::{
    Gather, GeometryBound, Vpl,
    choose::{choose, mix},
};
use crate::{
    camera::Camera,
    gbuffer::{GBuffer, Vec3Lanes},
    intersect::TracedScene,
    light::luminance,
    sample::{Stream, sobol::fold_seed, warp::cosine_direction},
    scene::ImageSize,
    settings::Settings,
};

/// Share of the VPLs that go by importance; so no VPL is brighter than twice what it would be if all were
/// chosen by their light alone.
const SHARE: f64 = 0.5;
/// Candidates on either side along the curve that share the results of their rays.
const NEIGHBOURS: usize = 16;
/// Largest geometry term that counts, in pixels per area: of what is nearer than a tenth of the pixels'
/// spacing, a pixel's centre is hardly ever met.
const TERM_PER_DENSITY_MAX: f32 = 100.0;
/// Cells of the picture whose brightness is looked at first.
const CELLS: UVec2 = UVec2::new(64, 48);
/// VPLs that light this first look, and the distance, as a share of the scene's extent, below which they
/// get no brighter.
const GLANCE_VPLS: u32 = 128;
const GLANCE_DISTANCE_SHARE: f32 = 0.05;
/// What is darker than this share of the mean brightness need not be as exact.
const DARKEST: f32 = 0.1;
/// Sets the rays' numbers apart from those of other purposes.
const SEED_PURPOSE: u32 = 0x696d_706f;

/// The weights of all candidates, in their order along the curve; their sum is the candidates' luminance.
pub(super) fn weights(scene: &TracedScene, settings: &Settings, candidates: &[Vpl]) -> Vec<f64> {
    let light: Vec<f64> = candidates
        .iter()
        .map(|vpl| f64::from(luminance(vpl.intensity)))
        .collect();
    let camera = Camera::new(&scene.scene().camera, settings.size);
    let seed = fold_seed(settings.seed, SEED_PURPOSE);
    let glance = Glance::new(scene, settings.size, candidates, &light);
    let squares: Vec<f32> = candidates
        .par_iter()
        .enumerate()
        .map(|(index, vpl)| {
            let square = Stream::new(index as u32, seed).next_2d();
            sum_of_squares(scene, &camera, &glance, vpl, square)
        })
        .collect();
    let importance: Vec<f64> = (0..candidates.len())
        .map(|index| {
            let first = index.saturating_sub(NEIGHBOURS);
            let last = (index + NEIGHBOURS + 1).min(squares.len());
            let near = &squares[first..last];
            f64::from(near.iter().sum::<f32>() / near.len() as f32).sqrt()
        })
        .collect();
    mix(&light, &importance, SHARE)
}

/// How much a VPL of unit intensity matters, by one ray.
///
/// Σ(G / brightness)² over all pixels is an integral over surfaces, in which `G dA` is drawn by rays with
/// density `cos / π`.
fn sum_of_squares(scene: &TracedScene, camera: &Camera, glance: &Glance, vpl: &Vpl, square: Vec2) -> f32 {
    let direction = cosine_direction(vpl.normal, square);
    let Some(point) = scene.nearest(vpl.position, direction) else {
        return 0.0;
    };
    let Some(pixel) = camera.project(point.position) else {
        return 0.0;
    };
    let density = camera.pixel_density(point.position, point.geometric_normal);
    if density == 0.0 || !scene.visible(point.lifted(scene.ray_offset()), camera.eye()) {
        return 0.0;
    }
    let cosines = direction.dot(vpl.normal) * -direction.dot(point.geometric_normal);
    let term = cosines / point.position.distance_squared(vpl.position);
    density * term.clamp(0.0, TERM_PER_DENSITY_MAX * density) / glance.brightness(pixel).powi(2)
}

/// A first look at how bright the parts of the picture are.
struct Glance {
    size: ImageSize,
    cells: Vec<f32>,
}

impl Glance {
    /// Light from a few of the candidates, so few that the picture is hardly recognised.
    fn new(scene: &TracedScene, size: ImageSize, candidates: &[Vpl], light: &[f64]) -> Self {
        let points = GBuffer::overview(scene, size, CELLS);
        let bound = GeometryBound::new(Some((GLANCE_DISTANCE_SHARE * scene.scene().extent()).powi(-2)));
        let mut radiance = Vec3Lanes::zeros(points.position.x.len());
        Gather::new(scene, bound).add(
            &points,
            &choose(candidates, light, GLANCE_VPLS, 0.5),
            &mut radiance,
        );
        let mut cells: Vec<f32> = (0..points.len)
            .map(|lane| luminance(radiance.get(lane)))
            .collect();
        let least = DARKEST * cells.iter().sum::<f32>() / cells.len() as f32;
        for cell in &mut cells {
            *cell = cell.max(least).max(f32::MIN_POSITIVE);
        }
        Self { size, cells }
    }

    /// Brightness near a place in the picture.
    fn brightness(&self, pixel: Vec2) -> f32 {
        let size = Vec2::new(self.size.width as f32, self.size.height as f32);
        let cell = (pixel / size * CELLS.as_vec2()).as_uvec2().min(CELLS - 1);
        self.cells[(cell.y * CELLS.x + cell.x) as usize]
    }
}
