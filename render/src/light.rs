//! Choosing points on the emitters.

use glam::{Vec2, Vec3};

use crate::{sample::Stream, scene::Emitter};

/// A point drawn on an emitter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightPoint {
    /// World position, scene units.
    pub position: Vec3,
    /// Unit normal on the shining side.
    pub normal: Vec3,
    /// Emitted radiance divided by the density of the point over all emitters' area:
    /// W·m⁻²·sr⁻¹ · (scene unit)².
    pub radiance_over_pdf: Vec3,
    /// The density of the point over all emitters' area, 1/(scene unit)².
    pub pdf: f32,
}

/// Draws emitters in proportion to their power, and points uniformly on them.
#[derive(Debug, Clone)]
pub struct LightSampler {
    emitters: Vec<Emitter>,
    /// Running sum of each emitter's share of the power, ending in 1.
    cumulative: Vec<f32>,
    /// Sum of the powers' luminances.
    power: f32,
}

impl LightSampler {
    /// Prepares a scene's emitters. Emitters without power are never drawn.
    pub fn new(emitters: &[Emitter]) -> Self {
        let emitters: Vec<Emitter> = emitters
            .iter()
            .copied()
            .filter(|emitter| luminance(emitter.power()) > 0.0)
            .collect();
        let total: f64 = emitters
            .iter()
            .map(|emitter| f64::from(luminance(emitter.power())))
            .sum();
        let mut sum = 0.0;
        let mut cumulative: Vec<f32> = emitters
            .iter()
            .map(|emitter| {
                sum += f64::from(luminance(emitter.power()));
                (sum / total) as f32
            })
            .collect();
        if let Some(last) = cumulative.last_mut() {
            *last = 1.0;
        }
        Self {
            emitters,
            cumulative,
            power: total as f32,
        }
    }

    /// Draws a point with one number for the emitter and two for its place; `None` when nothing shines.
    pub fn sample(&self, choice: f32, place: Vec2) -> Option<LightPoint> {
        let index = self.cumulative.partition_point(|&sum| sum <= choice);
        let emitter = self.emitters.get(index)?;
        let pdf = self.pdf(emitter.radiance);
        Some(LightPoint {
            position: emitter.point(place.x, place.y),
            normal: emitter.normal(),
            radiance_over_pdf: emitter.radiance / pdf,
            pdf,
        })
    }

    /// The density with which points are drawn where the emitted radiance is this, over all emitters'
    /// area, 1/(scene unit)². Choosing by power, it does not depend on the emitter's size.
    pub fn pdf(&self, radiance: Vec3) -> f32 {
        std::f32::consts::PI * luminance(radiance) / self.power
    }

    /// Draws a point with the next three dimensions of a stream.
    pub fn sample_stream(&self, stream: &mut Stream) -> Option<LightPoint> {
        let choice = stream.next_1d();
        self.sample(choice, stream.next_2d())
    }
}

/// Relative luminance of linear Rec. 709 primaries.
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::EmitterShape;

    fn emitter(radiance: f32, edge: f32) -> Emitter {
        Emitter {
            shape: EmitterShape::Parallelogram,
            corner: Vec3::ZERO,
            edge_u: edge * Vec3::X,
            edge_v: edge * Vec3::Y,
            radiance: Vec3::splat(radiance),
        }
    }

    fn sampler(emitters: &[Emitter]) -> LightSampler {
        LightSampler::new(emitters)
    }

    #[test]
    fn the_mean_of_the_weights_is_the_integral_of_radiance_over_area() {
        let emitters = [emitter(1.0, 1.0), emitter(0.0, 5.0), emitter(3.0, 2.0)];
        let sampler = sampler(&emitters);
        let n = 4096;
        let mean: f32 = (0..n)
            .map(|i| {
                sampler
                    .sample_stream(&mut Stream::new(i, 1))
                    .unwrap()
                    .radiance_over_pdf
                    .x
                    / n as f32
            })
            .sum();
        assert!((mean - 13.0).abs() < 0.01, "{mean}");
    }

    #[test]
    fn a_dark_scene_yields_no_point() {
        assert_eq!(sampler(&[]).sample(0.5, Vec2::ZERO), None);
    }
}
