//! From points of the unit square to directions.

use glam::{Vec2, Vec3};

/// An orthonormal basis around a unit normal (Duff et al., "Building an orthonormal basis, revisited",
/// JCGT 2017).
#[derive(Debug, Clone, Copy)]
pub struct Basis {
    tangent: Vec3,
    bitangent: Vec3,
    normal: Vec3,
}

impl Basis {
    /// The basis whose third axis is `normal`.
    pub fn around(normal: Vec3) -> Self {
        let sign = 1f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// From the basis' coordinates to world space.
    pub fn to_world(self, local: Vec3) -> Vec3 {
        local.x * self.tangent + local.y * self.bitangent + local.z * self.normal
    }
}

/// A direction about `normal` with density `cos / π`, by the concentric map (Shirley and Chiu 1997).
pub fn cosine_direction(normal: Vec3, square: Vec2) -> Vec3 {
    let disk = concentric_disk(square);
    let z = (1.0 - disk.length_squared()).max(0.0).sqrt();
    Basis::around(normal).to_world(disk.extend(z)).normalize()
}

fn concentric_disk(square: Vec2) -> Vec2 {
    let offset = 2.0 * square - Vec2::ONE;
    if offset == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (radius, angle) = if offset.x.abs() > offset.y.abs() {
        (offset.x, std::f32::consts::FRAC_PI_4 * (offset.y / offset.x))
    } else {
        (
            offset.y,
            std::f32::consts::FRAC_PI_2 - std::f32::consts::FRAC_PI_4 * (offset.x / offset.y),
        )
    };
    radius * Vec2::from_angle(angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::Stream;

    #[test]
    fn cosine_directions_have_the_moments_of_their_density() {
        let normal = Vec3::new(0.36, -0.48, 0.8);
        let n = 1 << 14;
        let directions = (0..n).map(|i| cosine_direction(normal, Stream::new(i, 3).next_2d()));
        let (mut mean, mut mean_square) = (0.0, 0.0);
        for direction in directions {
            assert!((direction.length() - 1.0).abs() < 1e-5);
            let cos = direction.dot(normal);
            assert!(cos >= -1e-6);
            mean += cos / n as f32;
            mean_square += cos * cos / n as f32;
        }
        // ∫ cos · cos/π dω = 2/3 and ∫ cos² · cos/π dω = 1/2.
        assert!((mean - 2.0 / 3.0).abs() < 1e-3, "{mean}");
        assert!((mean_square - 0.5).abs() < 1e-3, "{mean_square}");
    }

    #[test]
    fn a_basis_is_orthonormal_and_right_handed_for_every_normal() {
        for i in 0..1000 {
            let mut stream = Stream::new(i, 11);
            let flip = if i % 2 == 0 { 1.0 } else { -1.0 };
            let normal = flip * cosine_direction(Vec3::Z, stream.next_2d());
            let basis = Basis::around(normal);
            assert!(basis.tangent.dot(basis.bitangent).abs() < 1e-5);
            assert!(
                (basis.tangent.cross(basis.bitangent) - normal).length() < 1e-5,
                "{normal}"
            );
        }
    }
}
