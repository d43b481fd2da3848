//! What the filter keeps, what it crosses, and what it fills.

use glam::Vec3;
use rayon::ThreadPoolBuilder;

use super::Guided;
use crate::{
    buffer::HalfBuffers,
    camera::Camera,
    gbuffer::Aovs,
    sample::hash,
    scene::{CameraPose, ImageSize},
};

const SIZE: ImageSize = ImageSize {
    width: 96,
    height: 80,
};
const LEVELS: u32 = Guided::LEVELS_MAX;

/// A wall in front of the eye, and what comes from it.
struct Wall {
    aovs: Aovs,
    direct: HalfBuffers,
    indirect: HalfBuffers,
}

impl Wall {
    fn new(albedo: Vec3) -> Self {
        let camera = camera();
        let pixels = SIZE.pixel_count();
        let depth = |pixel: usize| {
            let (x, y) = (pixel % SIZE.width as usize, pixel / SIZE.width as usize);
            1.0 / camera.direction(x as f32 + 0.5, y as f32 + 0.5).z
        };
        Self {
            aovs: Aovs {
                size: SIZE,
                camera,
                albedo: vec![albedo; pixels],
                normal: vec![-Vec3::Z; pixels],
                depth: (0..pixels).map(depth).collect(),
                emission: vec![Vec3::ZERO; pixels],
            },
            direct: HalfBuffers::new(SIZE),
            indirect: HalfBuffers::new(SIZE),
        }
    }

    /// Adds a sample to each half of both components at each pixel: irradiance by column, row and sample.
    fn lit(mut self, samples: u32, irradiance: impl Fn(usize, usize, u32) -> f32) -> Self {
        let width = SIZE.width as usize;
        for pixel in 0..SIZE.pixel_count() {
            for sample in 0..2 * samples {
                let light = self.aovs.albedo[pixel] * irradiance(pixel % width, pixel / width, sample);
                for buffers in [&mut self.direct, &mut self.indirect] {
                    buffers.add(sample as usize % 2, &[pixel as u32], &[light.to_array()], 1);
                }
            }
        }
        self
    }

    fn filtered(&self, levels: u32) -> Vec<Vec3> {
        let guided = Guided::new([&self.direct, &self.indirect], &self.aovs, levels);
        let [direct, indirect] = [0, 1].map(|component| -> Vec<_> {
            (0..SIZE.height as usize)
                .flat_map(|y| guided.light(component, y))
                .collect()
        });
        assert_eq!(direct, indirect);
        direct
            .into_iter()
            .map(|light| light.unwrap_or(Vec3::NAN))
            .collect()
    }

    fn unfiltered(&self) -> Vec<Vec3> {
        let mean = |pixel| self.direct.mean(pixel).map(glam::DVec3::as_vec3);
        (0..SIZE.pixel_count()).filter_map(mean).collect()
    }
}

fn camera() -> Camera {
    let pose = CameraPose {
        eye: Vec3::ZERO,
        look_at: Vec3::Z,
        up: Vec3::Y,
        vertical_fov_degrees: 60.0,
    };
    Camera::new(&pose, SIZE)
}

/// Between 0 and 2, another number for each argument.
fn noise(x: usize, y: usize, sample: u32) -> f32 {
    hash(hash(x as u32, y as u32), sample) as f32 / 2.0_f32.powi(31)
}

const GREY: Vec3 = Vec3::splat(0.5);

fn rms(light: &[Vec3], truth: impl Fn(usize) -> f32) -> f32 {
    let squares = light
        .iter()
        .enumerate()
        .map(|(pixel, light)| (light.x - truth(pixel)).powi(2));
    (squares.sum::<f32>() / light.len() as f32).sqrt()
}

#[test]
fn light_without_noise_stays_as_it_is_to_the_bit() {
    let wall = Wall::new(Vec3::new(0.7, 0.02, 0.0)).lit(3, |x, y, _| noise(x, y, 7));
    assert_eq!(wall.filtered(LEVELS), wall.unfiltered());
}

#[test]
fn noise_is_averaged_and_the_mean_stays() {
    let wall = Wall::new(GREY).lit(1, noise);
    let (noisy, filtered) = (wall.unfiltered(), wall.filtered(LEVELS));
    assert!(rms(&filtered, |_| 0.5) < 0.15 * rms(&noisy, |_| 0.5));
    let mean = |light: &[Vec3]| light.iter().map(|light| light.x).sum::<f32>() / light.len() as f32;
    assert!(
        (mean(&filtered) / mean(&noisy) - 1.0).abs() < 2e-3,
        "{} {}",
        mean(&filtered),
        mean(&noisy)
    );
}

#[test]
fn a_rare_bright_sample_neither_stays_nor_makes_the_picture_darker() {
    let spark = |x: usize, y: usize, sample: u32| if noise(x, y, sample) < 0.004 { 50.0 } else { 0.5 };
    let wall = Wall::new(GREY).lit(2, spark);
    let (noisy, filtered) = (wall.unfiltered(), wall.filtered(LEVELS));
    let sum = |light: &[Vec3]| light.iter().map(|light| light.x).sum::<f32>();
    assert!(
        (sum(&filtered) / sum(&noisy) - 1.0).abs() < 0.02,
        "{} {}",
        sum(&filtered),
        sum(&noisy)
    );
    let brightest = |light: &[Vec3]| light.iter().map(|light| light.x).fold(0.0, f32::max);
    assert!(
        brightest(&filtered) < 0.25 * brightest(&noisy),
        "{}",
        brightest(&filtered)
    );
}

#[test]
fn more_samples_leave_less_error_and_the_edge_of_a_shadow_stays_sharp() {
    let shadow = |x: usize| if x < 40 { 0.1 } else { 1.0 };
    let errors = [1, 16, 256].map(|samples| {
        let wall = Wall::new(Vec3::ONE).lit(samples, |x, y, sample| shadow(x) * noise(x, y, sample));
        let filtered = wall.filtered(LEVELS);
        let truth = |pixel: usize| shadow(pixel % SIZE.width as usize);
        [rms(&filtered, truth), rms(&wall.unfiltered(), truth)]
    });
    for [filtered, unfiltered] in errors {
        assert!(filtered < 0.6 * unfiltered, "{errors:?}");
    }
    assert!(errors[2][0] < 0.15 * errors[0][0], "{errors:?}");
}

/// A step between columns 47 and 48, told by `mark`; the light on both sides differs and is noisy.
#[track_caller]
fn assert_not_crossed(mark: impl Fn(&mut Aovs, usize)) {
    let side = |x: usize| if x < 48 { 0.0 } else { 1.0 };
    let mut wall = Wall::new(GREY);
    for pixel in (0..SIZE.pixel_count()).filter(|pixel| pixel % 96 >= 48) {
        mark(&mut wall.aovs, pixel);
    }
    let filtered = wall
        .lit(1, |x, y, sample| side(x) * noise(x, y, sample))
        .filtered(LEVELS);
    let leaked = |(pixel, light): (usize, &Vec3)| pixel % 96 < 48 && *light != Vec3::ZERO;
    assert!(!filtered.iter().enumerate().any(leaked));
}

#[test]
fn light_does_not_cross_edges_of_normals_and_steps_of_depth() {
    assert_not_crossed(|aovs, pixel| aovs.normal[pixel] = Vec3::X);
    assert_not_crossed(|aovs, pixel| aovs.depth[pixel] *= 2.0);
}

#[test]
fn a_texture_stays_sharp_while_the_light_on_it_is_averaged() {
    let mut wall = Wall::new(GREY);
    for (pixel, albedo) in wall.aovs.albedo.iter_mut().enumerate() {
        *albedo = if pixel % 2 == 0 {
            Vec3::new(0.8, 0.4, 0.2)
        } else {
            Vec3::new(0.1, 0.0, 0.6)
        };
    }
    let albedo = wall.aovs.albedo.clone();
    let filtered = wall.lit(1, noise).filtered(LEVELS);
    for (light, albedo) in filtered.iter().zip(albedo) {
        assert!(
            (*light - albedo).abs().max_element() < 0.5 * albedo.max_element(),
            "{light} {albedo}"
        );
    }
}

#[test]
fn holes_are_filled_from_the_same_surface_or_stay_open() {
    let mut wall = Wall::new(GREY).lit(1, |_, _, _| 1.0);
    let lacks = |pixel: usize| pixel % 96 >= 90 || noise(pixel, 0, 0) < 1.0;
    let (whole, halves) = (wall.unfiltered(), [&mut wall.direct, &mut wall.indirect]);
    for buffers in halves {
        *buffers = HalfBuffers::new(SIZE);
        for pixel in (0..SIZE.pixel_count()).filter(|&pixel| !lacks(pixel)) {
            // Halves of a pixel are missing, too.
            buffers.add(pixel % 2, &[pixel as u32], &[whole[pixel].to_array()], 1);
        }
    }
    let near = |light: &Vec3| (*light - GREY).abs().max_element() < 1e-5;
    assert!(wall.filtered(LEVELS).iter().all(near));

    let none = Wall::new(GREY);
    assert!(none.filtered(LEVELS).iter().all(|light| light.is_nan()));
}

/// As when the deadline falls into the second pass.
#[test]
fn a_second_half_of_few_pixels_does_not_stop_the_filter() {
    let mut wall = Wall::new(GREY);
    for pixel in 0..SIZE.pixel_count() {
        let (x, y) = (pixel % 96, pixel / 96);
        let light = GREY * noise(x, y, 0);
        for buffers in [&mut wall.direct, &mut wall.indirect] {
            buffers.add(0, &[pixel as u32], &[light.to_array()], 1);
            // Some pixels, which see the same as before.
            if (x + 3 * y) % 8 == 0 {
                buffers.add(1, &[pixel as u32], &[light.to_array()], 1);
            }
        }
    }
    let (noisy, filtered) = (wall.unfiltered(), wall.filtered(LEVELS));
    assert!(rms(&filtered, |_| 0.5) < 0.4 * rms(&noisy, |_| 0.5));
}

#[test]
fn any_light_and_any_surface_give_finite_light() {
    let mut wall = Wall::new(GREY);
    for pixel in 0..SIZE.pixel_count() {
        let random = noise(pixel, 1, 1);
        wall.aovs.albedo[pixel] = [Vec3::ZERO, Vec3::splat(1e-30), Vec3::ONE][pixel % 3];
        wall.aovs.normal[pixel] *= random;
        if random < 0.3 {
            wall.aovs.depth[pixel] = [f32::INFINITY, 0.0, 1e-30, 1e30][pixel % 4];
        }
    }
    let wall = wall.lit(1, |x, y, sample| {
        10.0_f32.powf(40.0 * (noise(x, y, sample) - 1.0)).min(1e30)
    });
    assert!(
        wall.filtered(LEVELS)
            .iter()
            .all(|light| light.is_finite() && light.min_element() >= 0.0)
    );
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let wall = Wall::new(GREY).lit(2, noise);
    let with = |threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| wall.filtered(LEVELS))
    };
    let one = with(1);
    assert!([2, 8].into_iter().all(|threads| with(threads) == one));
}

#[test]
fn the_mirrored_picture_is_filtered_to_the_mirrored_light() {
    let last = SIZE.width as usize - 1;
    let wall = Wall::new(GREY).lit(1, noise).filtered(3);
    let mirrored = Wall::new(GREY)
        .lit(1, |x, y, sample| noise(last - x, y, sample))
        .filtered(3);
    for (pixel, light) in wall.iter().enumerate() {
        let (x, y) = (pixel % 96, pixel / 96);
        assert!((*light - mirrored[y * 96 + last - x]).abs().max_element() < 1e-4);
    }
}
