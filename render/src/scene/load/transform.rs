//! Where a mesh is put: scaled, then turned, then moved.

use glam::{Mat3, Vec3};

/// Scale, then rotation about x, y and z in this order, then translation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Transform {
    linear: Mat3,
    /// Inverse transpose of `linear`.
    normal: Mat3,
    translation: Vec3,
    mirrors: bool,
}

impl Transform {
    /// No factor of `scale` may be zero.
    pub(super) fn new(scale: Vec3, rotate_degrees: Vec3, translation: Vec3) -> Self {
        let [x, y, z] = rotate_degrees.to_array().map(sin_cos_degrees);
        let about_x = Mat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, x.1, x.0, 0.0, -x.0, x.1]);
        let about_y = Mat3::from_cols_array(&[y.1, 0.0, -y.0, 0.0, 1.0, 0.0, y.0, 0.0, y.1]);
        let about_z = Mat3::from_cols_array(&[z.1, z.0, 0.0, -z.0, z.1, 0.0, 0.0, 0.0, 1.0]);
        let rotation = about_z * about_y * about_x;
        Self {
            linear: rotation * Mat3::from_diagonal(scale),
            normal: rotation * Mat3::from_diagonal(scale.recip()),
            translation,
            mirrors: scale.is_negative_bitmask().count_ones() % 2 == 1,
        }
    }

    /// A point of the mesh in world space.
    pub(super) fn point(&self, point: Vec3) -> Vec3 {
        self.linear * point + self.translation
    }

    /// A unit normal in world space; zero stays zero.
    pub(super) fn normal(&self, normal: Vec3) -> Vec3 {
        (self.normal * normal).normalize_or_zero()
    }

    /// Whether the winding of triangles turns around, so that two corners must be swapped to keep
    /// the front side in front.
    pub(super) fn mirrors(&self) -> bool {
        self.mirrors
    }
}

impl Default for Transform {
    fn default() -> Self {
        Self::new(Vec3::ONE, Vec3::ZERO, Vec3::ZERO)
    }
}

/// Sine and cosine, exact at multiples of 90°: turned boxes stay parallel to the axes.
fn sin_cos_degrees(degrees: f32) -> (f32, f32) {
    let degrees = f64::from(degrees).rem_euclid(360.0);
    let quarter = (degrees / 90.0).round();
    let (sin, cos) = (degrees - 90.0 * quarter).to_radians().sin_cos();
    let (sin, cos) = match quarter as u8 % 4 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    };
    (sin as f32, cos as f32)
}

#[cfg(test)]
mod tests {
    use super::Transform;
    use glam::Vec3;

    #[test]
    fn scale_comes_first_then_x_then_y_then_z_then_translation() {
        let transform = Transform::new(
            Vec3::new(2.0, 1.0, 1.0),
            Vec3::new(90.0, 90.0, 90.0),
            Vec3::new(10.0, 0.0, 0.0),
        );
        // x: scaled to 2x, kept by the turn about x, to -2z by y, kept by z.
        assert_eq!(transform.point(Vec3::X), Vec3::new(10.0, 0.0, -2.0));
        // y: to z by the turn about x, to x by y, to y by z.
        assert_eq!(transform.point(Vec3::Y), Vec3::new(10.0, 1.0, 0.0));
    }

    #[test]
    fn turns_of_30_degrees_agree_with_glam() {
        let transform = Transform::new(Vec3::ONE, Vec3::new(30.0, -45.0, 400.0), Vec3::ZERO);
        let expected = glam::Mat3::from_rotation_z(400f32.to_radians())
            * glam::Mat3::from_rotation_y((-45f32).to_radians())
            * glam::Mat3::from_rotation_x(30f32.to_radians());
        let point = Vec3::new(0.3, -2.0, 1.7);
        assert!(transform.point(point).abs_diff_eq(expected * point, 1e-5));
    }

    #[test]
    fn normals_stay_perpendicular_to_a_stretched_surface() {
        let transform = Transform::new(Vec3::new(3.0, 1.0, 0.5), Vec3::new(20.0, 30.0, 40.0), Vec3::ONE);
        let (edge_u, edge_v) = (Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, -1.0));
        let normal = transform.normal(edge_u.cross(edge_v).normalize());
        let moved = |edge: Vec3| transform.point(edge) - transform.point(Vec3::ZERO);
        assert!(normal.is_normalized());
        assert!(normal.dot(moved(edge_u)).abs() < 1e-5);
        assert!(normal.dot(moved(edge_v)).abs() < 1e-5);
    }

    #[test]
    fn only_an_odd_number_of_negative_factors_mirrors() {
        let mirrors = |x, y, z| Transform::new(Vec3::new(x, y, z), Vec3::ZERO, Vec3::ZERO).mirrors();
        assert!(mirrors(-1.0, 1.0, 1.0));
        assert!(!mirrors(-1.0, -1.0, 1.0));
        assert!(mirrors(-1.0, -1.0, -1.0));
        assert!(!mirrors(1.0, 1.0, 1.0));
    }
}
