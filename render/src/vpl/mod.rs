//! Virtual point lights (Keller, "Instant radiosity", 1997): indirect diffuse light as many small lamps.

mod choose;
mod compensate;
mod curve;
mod gather;
mod importance;
mod trace;
mod view;

pub use compensate::{Compensation, automatic_bound};
pub use gather::{Gather, GeometryBound};
pub(crate) use gather::{aim, any_positive, geometry_terms, seen, trace};
pub use trace::{trace_sets, trace_sets_thoroughly};

use glam::Vec3;

/// A one-sided Lambertian point light: light that has arrived at a surface and is reflected from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vpl {
    /// World position, already lifted off its surface.
    pub position: Vec3,
    /// Unit geometric normal on the side that reflects.
    pub normal: Vec3,
    /// Radiant intensity along the normal per channel, as a share of the set's estimate:
    /// W·m⁻²·sr⁻¹ · (scene unit)².
    pub intensity: Vec3,
}

/// VPLs that are used together; each set is an unbiased estimate by itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct VplSet {
    /// The lights, their intensities already divided by the number of paths.
    pub vpls: Vec<Vpl>,
}

impl VplSet {
    /// Size of one VPL in [`VplSet::to_bytes`].
    pub const VPL_BYTES: usize = 36;

    /// Position, normal and intensity of each VPL as nine little-endian floats.
    pub fn to_bytes(&self) -> Vec<u8> {
        let floats = |vpl: &Vpl| [vpl.position, vpl.normal, vpl.intensity].map(|v| v.to_array());
        self.vpls
            .iter()
            .flat_map(floats)
            .flatten()
            .flat_map(f32::to_le_bytes)
            .collect()
    }

    /// The inverse of [`VplSet::to_bytes`]; `None` for a broken length or numbers that are not finite.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (records, rest) = bytes.as_chunks::<{ Self::VPL_BYTES }>();
        if !rest.is_empty() {
            return None;
        }
        let vpls = records.iter().map(read_vpl).collect::<Option<_>>()?;
        Some(Self { vpls })
    }
}

fn read_vpl(record: &[u8; VplSet::VPL_BYTES]) -> Option<Vpl> {
    let (words, _) = record.as_chunks::<4>();
    let vector = |first: usize| {
        let [x, y, z] = [0, 1, 2].map(|axis| f32::from_le_bytes(words[first + axis]));
        Vec3::new(x, y, z)
    };
    let vpl = Vpl {
        position: vector(0),
        normal: vector(3),
        intensity: vector(6),
    };
    [vpl.position, vpl.normal, vpl.intensity]
        .iter()
        .all(|v| v.is_finite())
        .then_some(vpl)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set() -> VplSet {
        let vpl = |x| Vpl {
            position: Vec3::new(x, 2.0, 3.0),
            normal: Vec3::Y,
            intensity: Vec3::splat(0.5),
        };
        VplSet {
            vpls: vec![vpl(1.0), vpl(-7.25)],
        }
    }

    #[test]
    fn bytes_bring_back_the_same_set() {
        assert_eq!(VplSet::from_bytes(&set().to_bytes()), Some(set()));
    }

    #[test]
    fn broken_lengths_and_numbers_are_refused() {
        let mut bytes = set().to_bytes();
        assert_eq!(VplSet::from_bytes(&bytes[1..]), None);
        bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert_eq!(VplSet::from_bytes(&bytes), None);
    }
}
