//! The pinhole camera: from pixels to rays.

use glam::Vec3;

use crate::scene::{CameraPose, ImageSize};

/// A pinhole camera for one picture size.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    eye: Vec3,
    /// Direction through the upper left corner of the picture, not normalised.
    corner: Vec3,
    /// Step to the next pixel of a row.
    right: Vec3,
    /// Step to the next row.
    down: Vec3,
}

impl Camera {
    /// A camera with square pixels; the vertical field of view spans the rows.
    pub fn new(pose: &CameraPose, size: ImageSize) -> Self {
        let forward = (pose.look_at - pose.eye).normalize();
        let right = forward.cross(pose.up).normalize();
        let up = right.cross(forward);
        let half_height = (0.5 * pose.vertical_fov_degrees).to_radians().tan();
        let pixel = 2.0 * half_height / size.height as f32;
        let half_width = 0.5 * pixel * size.width as f32;
        Self {
            eye: pose.eye,
            corner: forward - half_width * right + half_height * up,
            right: pixel * right,
            down: -pixel * up,
        }
    }

    /// Position of the eye, world space.
    pub fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Width of a pixel at unit distance, measured along the optical axis.
    pub fn pixel_width(&self) -> f32 {
        self.right.length()
    }

    /// Unit direction through a point of the picture, in pixels from its upper left corner; the centre
    /// of the first pixel is (0.5, 0.5).
    pub fn direction(&self, x: f32, y: f32) -> Vec3 {
        (self.corner + x * self.right + y * self.down).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_is_upright_and_spans_the_field_of_view() {
        let pose = CameraPose {
            eye: Vec3::ZERO,
            look_at: -Vec3::Z,
            up: Vec3::Y,
            vertical_fov_degrees: 90.0,
        };
        let camera = Camera::new(
            &pose,
            ImageSize {
                width: 200,
                height: 100,
            },
        );
        let near = |a: Vec3, b: Vec3| assert!((a - b.normalize()).length() < 1e-5, "{a} is not {b}");
        near(camera.direction(100.0, 50.0), Vec3::new(0.0, 0.0, -1.0));
        near(camera.direction(100.0, 0.0), Vec3::new(0.0, 1.0, -1.0));
        near(camera.direction(0.0, 50.0), Vec3::new(-2.0, 0.0, -1.0));
        near(camera.direction(200.0, 100.0), Vec3::new(2.0, -1.0, -1.0));
    }
}
