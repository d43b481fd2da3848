//! Area lights: flat pieces of surface that shine to one side.

use glam::Vec3;

/// Which part of the plane spanned by the two edges shines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EmitterShape {
    /// `corner + s·edge_u + t·edge_v` with `s, t ≥ 0` and `s + t ≤ 1`.
    Triangle,
    /// The same with `s, t` in [0, 1].
    Parallelogram,
}

/// A one-sided Lambertian area light, shining to the side of `edge_u × edge_v`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emitter {
    /// Triangle or parallelogram.
    pub shape: EmitterShape,
    /// One corner, world space.
    pub corner: Vec3,
    /// Edge from the corner.
    pub edge_u: Vec3,
    /// The other edge from the corner.
    pub edge_v: Vec3,
    /// Emitted radiance in W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
}

impl Emitter {
    /// Unit normal on the shining side.
    pub fn normal(&self) -> Vec3 {
        self.edge_u.cross(self.edge_v).normalize_or_zero()
    }

    /// Area in square scene units.
    pub fn area(&self) -> f32 {
        let parallelogram = self.edge_u.cross(self.edge_v).length();
        match self.shape {
            EmitterShape::Parallelogram => parallelogram,
            EmitterShape::Triangle => 0.5 * parallelogram,
        }
    }

    /// Maps the unit square uniformly onto the shining surface (Heitz 2019 for the triangle, which
    /// keeps the strata of the square).
    pub fn point(&self, s: f32, t: f32) -> Vec3 {
        let (s, t) = match self.shape {
            EmitterShape::Parallelogram => (s, t),
            EmitterShape::Triangle if t > s => (0.5 * s, t - 0.5 * s),
            EmitterShape::Triangle => (s - 0.5 * t, 0.5 * t),
        };
        self.corner + s * self.edge_u + t * self.edge_v
    }

    /// Emitted power in W·(scene unit)²·m⁻², per channel: `π · area · radiance`.
    pub fn power(&self) -> Vec3 {
        std::f32::consts::PI * self.area() * self.radiance
    }
}
