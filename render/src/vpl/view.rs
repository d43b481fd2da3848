//! More VPLs where the camera looks closely.
//!
//! A VPL leaves its mark on what is near to it, and the mark is as large in the picture as its
//! surroundings are: the nearer to the eye, the denser VPLs must stand. What is far from the picture
//! needs only as many as its light asks for. With few VPLs it is the light from afar that is noisy, and
//! they all go by their light alone.

use glam::Vec3;

use super::{Vpl, choose::mix};
use crate::{
    light::luminance,
    scene::{CameraPose, Scene},
    settings::Settings,
};

/// Fewest VPLs that are chosen by the view too.
pub(super) const VPLS_MIN: u32 = 4_096;
/// Share of the VPLs that go where the camera looks; so no VPL is brighter than twice what it would be
/// if all were chosen by their light alone.
const SHARE: f64 = 0.5;
/// Nearer to the eye than this share of the scene's extent, VPLs do not get denser.
const NEAR_SHARE: f32 = 0.02;
/// Width of the border, in cosines, over which the view fades out around the picture's circumcircle.
const BORDER: f32 = 0.15;

/// Weighs candidates by their light and by the solid angle that their surroundings fill in the picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// Share of the VPLs that follow the view.
    share: f64,
    eye: Vec3,
    axis: Vec3,
    /// Cosine of the angle between the axis and the corners of the picture.
    corner: f32,
    near_squared: f32,
}

impl View {
    /// The view of a frame's camera, if the frame has many VPLs.
    pub(super) fn for_settings(scene: &Scene, settings: &Settings) -> Self {
        let CameraPose {
            eye,
            look_at,
            vertical_fov_degrees,
            ..
        } = scene.camera;
        let half_height = (0.5 * vertical_fov_degrees).to_radians().tan();
        let aspect = settings.size.width as f32 / settings.size.height as f32;
        let half_diagonal = half_height * aspect.hypot(1.0);
        Self {
            share: if settings.vpls < VPLS_MIN { 0.0 } else { SHARE },
            eye,
            axis: (look_at - eye).normalize_or_zero(),
            corner: half_diagonal.hypot(1.0).recip(),
            near_squared: (NEAR_SHARE * scene.extent()).powi(2),
        }
    }

    /// The weights of all candidates, in their order; their sum is the candidates' luminance.
    pub(super) fn weights(&self, candidates: &[Vpl]) -> Vec<f64> {
        let light: Vec<f64> = candidates
            .iter()
            .map(|vpl| f64::from(luminance(vpl.intensity)))
            .collect();
        let closeness: Vec<f64> = candidates
            .iter()
            .map(|vpl| f64::from(self.closeness(vpl.position)))
            .collect();
        mix(&light, &closeness, self.share)
    }

    /// Solid angle of a small sphere around the point, up to a factor; none outside the picture.
    fn closeness(&self, position: Vec3) -> f32 {
        let from_eye = position - self.eye;
        let cosine = from_eye.normalize_or_zero().dot(self.axis);
        let inside = ((cosine - self.corner) / BORDER + 1.0).clamp(0.0, 1.0);
        inside / (from_eye.length_squared() + self.near_squared)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(share: f64) -> View {
        View {
            share,
            eye: Vec3::ZERO,
            axis: Vec3::Z,
            corner: 0.8,
            near_squared: 0.01,
        }
    }

    fn vpls() -> Vec<Vpl> {
        let vpl = |position, intensity| Vpl {
            position,
            normal: Vec3::Y,
            intensity: Vec3::splat(intensity),
        };
        vec![
            vpl(Vec3::Z, 1.0),
            vpl(3.0 * Vec3::Z, 1.0),
            vpl(Vec3::X, 1.0),
            vpl(-2.0 * Vec3::Z, 5.0),
        ]
    }

    #[test]
    fn the_view_moves_weight_to_what_is_near_in_the_picture_and_keeps_the_sum() {
        let (with, without) = (view(0.5).weights(&vpls()), view(0.0).weights(&vpls()));
        assert!((with.iter().sum::<f64>() - without.iter().sum::<f64>()).abs() < 1e-6);
        assert!(with[0] > with[1] && with[1] > with[2]);
        for behind in [2, 3] {
            assert!((with[behind] - 0.5 * without[behind]).abs() < 1e-6);
        }
    }

    #[test]
    fn where_nothing_is_in_view_light_alone_decides() {
        let behind = &vpls()[2..];
        assert_eq!(view(0.5).weights(behind), view(0.0).weights(behind));
    }
}
