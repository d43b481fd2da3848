//! The pinhole camera: from pixels to rays.

use glam::{Vec2, Vec3};

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
    size: ImageSize,
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
            size,
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

    /// Where a point lies in the picture, in pixels from its upper left corner; `None` outside.
    pub fn project(&self, point: Vec3) -> Option<Vec2> {
        let to_point = point - self.eye;
        let depth = to_point.dot(self.forward());
        let from_corner = to_point / depth - self.corner;
        let [x, y] = [self.right, self.down].map(|step| from_corner.dot(step) / step.length_squared());
        let inside = depth > 0.0
            && (0.0..self.size.width as f32).contains(&x)
            && (0.0..self.size.height as f32).contains(&y);
        inside.then_some(Vec2::new(x, y))
    }

    /// Pixels per area, 1/(scene unit)², of a surface with this unit normal at a point in front of the
    /// eye; 0 on its far side.
    pub fn pixel_density(&self, point: Vec3, normal: Vec3) -> f32 {
        let to_point = point - self.eye;
        let depth = to_point.dot(self.forward());
        (-to_point.dot(normal) / (depth.powi(3) * self.right.length_squared())).max(0.0)
    }

    fn forward(&self) -> Vec3 {
        self.right.cross(self.down) / self.right.length_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wide() -> Camera {
        let pose = CameraPose {
            eye: Vec3::ZERO,
            look_at: -Vec3::Z,
            up: Vec3::Y,
            vertical_fov_degrees: 90.0,
        };
        let size = ImageSize {
            width: 200,
            height: 100,
        };
        Camera::new(&pose, size)
    }

    #[test]
    fn the_picture_is_upright_and_spans_the_field_of_view() {
        let camera = wide();
        let near = |a: Vec3, b: Vec3| assert!((a - b.normalize()).length() < 1e-5, "{a} is not {b}");
        near(camera.direction(100.0, 50.0), Vec3::new(0.0, 0.0, -1.0));
        near(camera.direction(100.0, 0.0), Vec3::new(0.0, 1.0, -1.0));
        near(camera.direction(0.0, 50.0), Vec3::new(-2.0, 0.0, -1.0));
        near(camera.direction(200.0, 100.0), Vec3::new(2.0, -1.0, -1.0));
    }

    #[test]
    fn what_a_pixel_sees_is_projected_into_it() {
        let camera = wide();
        for pixel in [Vec2::new(0.5, 0.5), Vec2::new(100.0, 50.0), Vec2::new(199.5, 7.0)] {
            let place = camera.project(3.0 * camera.direction(pixel.x, pixel.y));
            assert!(
                place.is_some_and(|place| place.distance(pixel) < 1e-3),
                "{pixel} becomes {place:?}"
            );
        }
        for outside in [
            Vec3::new(21.0, 0.0, -10.0),
            Vec3::new(0.0, -11.0, -10.0),
            Vec3::new(0.0, 0.0, 10.0),
        ] {
            assert_eq!(camera.project(outside), None);
        }
    }

    #[test]
    fn pixels_lie_dense_on_what_is_near_and_faces_the_eye() {
        let camera = wide();
        let density = |point, normal| camera.pixel_density(point, normal);
        // At a distance of 10 the picture's 200×100 pixels cover 40×20.
        assert!((density(Vec3::new(0.0, 0.0, -10.0), Vec3::Z) - 25.0).abs() < 1e-3);
        assert!((density(Vec3::new(19.0, 9.0, -10.0), Vec3::Z) - 25.0).abs() < 1e-3);
        assert!((density(Vec3::new(0.0, 0.0, -5.0), Vec3::Z) - 100.0).abs() < 1e-3);
        let tilted = Vec3::new(0.6, 0.0, 0.8);
        assert!((density(Vec3::new(0.0, 0.0, -10.0), tilted) - 20.0).abs() < 1e-3);
        assert!(density(Vec3::new(0.0, 0.0, -10.0), -Vec3::Z) == 0.0);
    }
}
