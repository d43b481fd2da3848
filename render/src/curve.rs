//! A curve through the surfaces of a scene: what is near on it is near in space and faces the same way.

use glam::Vec3;

/// Bits of each coordinate on the curve.
const BITS: u32 = 10;
/// Highest coordinate of a cell.
const CELL_MAX: f32 = (1 << BITS) as f32 - 1.0;

/// A Hilbert curve through a box, once for each side that a surface can face: a run of it is a piece of
/// one wall, also where two walls meet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Curve {
    min: Vec3,
    /// Cells per scene unit.
    scale: f32,
}

impl Curve {
    /// The curve through the box between two corners.
    pub(crate) fn through(min: Vec3, max: Vec3) -> Self {
        Self {
            min,
            scale: CELL_MAX / (max - min).max_element().max(f32::MIN_POSITIVE),
        }
    }

    /// How far along the curve a surface lies: on which side, then where in space.
    pub(crate) fn place(self, position: Vec3, normal: Vec3) -> (u8, u32) {
        let cell = ((position - self.min) * self.scale).clamp(Vec3::ZERO, Vec3::splat(CELL_MAX));
        (side_of_cube(normal), hilbert(cell.as_uvec3().to_array()))
    }
}

/// Which side of a cube a direction points through, 0 to 5.
fn side_of_cube(direction: Vec3) -> u8 {
    let size = direction.abs();
    let (axis, along) = if size.x >= size.y && size.x >= size.z {
        (0, direction.x)
    } else if size.y >= size.z {
        (1, direction.y)
    } else {
        (2, direction.z)
    };
    2 * axis + u8::from(along < 0.0)
}

/// The place of a cell along the Hilbert curve, by Skilling's transform ("Programming the Hilbert
/// curve", 2004): each level of bits turns and mirrors the axes of the levels below it.
fn hilbert(cell: [u32; 3]) -> u32 {
    let mut axes = cell;
    for level in (1..BITS).rev() {
        let bit = 1 << level;
        let below = bit - 1;
        for axis in 0..axes.len() {
            if axes[axis] & bit == 0 {
                let differing = (axes[0] ^ axes[axis]) & below;
                axes[0] ^= differing;
                axes[axis] ^= differing;
            } else {
                axes[0] ^= below;
            }
        }
    }
    // Gray code: from the corner of a subcube to its place in the order of visits.
    axes[1] ^= axes[0];
    axes[2] ^= axes[1];
    let turns = (1..BITS)
        .filter(|level| axes[2] >> level & 1 == 1)
        .fold(0, |turns, level| turns ^ ((1 << level) - 1));
    interleave(axes.map(|axis| axis ^ turns))
}

/// Interleaves the bits of three coordinates, the first one highest.
fn interleave(axes: [u32; 3]) -> u32 {
    (0..BITS)
        .rev()
        .flat_map(|level| axes.map(|axis| axis >> level & 1))
        .fold(0, |place, bit| place << 1 | bit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_every_cell_of_a_cube_and_goes_to_a_neighbour_each_time() {
        const SIDE: u32 = 16;
        let mut cells: Vec<[u32; 3]> = (0..SIDE.pow(3))
            .map(|cell| [cell % SIDE, cell / SIDE % SIDE, cell / SIDE / SIDE])
            .collect();
        cells.sort_by_key(|&cell| hilbert(cell));
        for pair in cells.windows(2) {
            let step: u32 = (0..3).map(|axis| pair[0][axis].abs_diff(pair[1][axis])).sum();
            assert_eq!(step, 1, "from {:?} to {:?}", pair[0], pair[1]);
        }
    }

    #[test]
    fn walls_that_meet_come_one_after_the_other() {
        let curve = Curve::through(Vec3::ZERO, Vec3::splat(20.0));
        let mut normals: Vec<(f32, Vec3)> = (0..20u8)
            .map(|i| (f32::from(i), if i % 2 == 0 { Vec3::X } else { Vec3::NEG_Y }))
            .collect();
        normals.sort_by_key(|&(x, normal)| curve.place(Vec3::new(x, x, 0.0), normal));
        assert!(normals[..10].iter().all(|&(_, normal)| normal == Vec3::X));
    }
}
