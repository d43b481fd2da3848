//! Gathering: light from point lights to G-buffer points, with a shadow ray for each pair.
//!
//! The light is the outer loop and each packet holds near points, so that a packet's rays start at one
//! place and stay close together; of the forms we measured this is the fastest (docs/performance.md).

#![expect(
    clippy::inline_always,
    reason = "the kernel must become one loop over constant lanes for the compiler to vectorise it"
)]

use embree4_sys as embree;
use glam::Vec3;

use super::Vpl;
use crate::{
    gbuffer::{GBuffer, Vec3Lanes},
    intersect::TracedScene,
};

/// Upper bound of the geometry term `cos·cos/d²`, in 1/(scene unit)².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometryBound(f32);

impl GeometryBound {
    /// Bounded, or not at all.
    pub fn new(bound: Option<f32>) -> Self {
        Self(bound.unwrap_or(f32::INFINITY))
    }
}

/// Carries light from point lights to points, testing visibility.
#[derive(Debug, Clone, Copy)]
pub struct Gather<'a> {
    scene: &'a TracedScene,
    bound: GeometryBound,
}

impl<'a> Gather<'a> {
    /// A gather through a scene.
    pub fn new(scene: &'a TracedScene, bound: GeometryBound) -> Self {
        Self { scene, bound }
    }

    /// Adds the light of all VPLs to `radiance`, one lane per point: radiance per unit albedo,
    /// W·m⁻²·sr⁻¹. Returns the number of shadow rays.
    pub fn add(&self, points: &GBuffer, vpls: &[Vpl], radiance: &mut Vec3Lanes) -> u64 {
        embree::with_wide_vectors(Add {
            gather: self,
            points,
            vpls,
            radiance,
        })
    }

    /// Number of pairs of a VPL and a point that see each other: the rays of [`Gather::add`] without
    /// its light.
    pub fn count_visible(&self, points: &GBuffer, vpls: &[Vpl]) -> u64 {
        embree::with_wide_vectors(CountVisible {
            gather: self,
            points,
            vpls,
        })
    }

    #[inline(always)]
    fn count_visible_by<const N: usize>(&self, points: &GBuffer, vpls: &[Vpl]) -> u64
    where
        embree::Lanes<N>: embree::PacketSize,
    {
        let mut visible = [0_u32; N];
        self.trace_all::<N>(points, vpls, |_, _, _, seen| {
            for lane in 0..N {
                visible[lane] += u32::from(seen[lane] > 0.0);
            }
        });
        visible.into_iter().map(u64::from).sum()
    }

    #[inline(always)]
    fn add_by<const N: usize>(&self, points: &GBuffer, vpls: &[Vpl], radiance: &mut Vec3Lanes) -> u64
    where
        embree::Lanes<N>: embree::PacketSize,
    {
        self.trace_all::<N>(points, vpls, |vpl, index, packet, seen| {
            // The receiver's BSDF per unit albedo is 1/π.
            let [r, g, b] = (vpl.intensity / std::f32::consts::PI).to_array();
            let terms = geometry_terms(packet, points, index, |_| vpl.normal, self.bound, seen);
            add_scaled(&mut radiance.x, index, &terms, r);
            add_scaled(&mut radiance.y, index, &terms, g);
            add_scaled(&mut radiance.z, index, &terms, b);
        })
    }

    /// Traces the rays from all VPLs to all points that they face, and shows each packet of rays that has
    /// any: its VPL, the number of its points' packet, and which lanes are [`seen`]. Returns the number of
    /// rays.
    #[inline(always)]
    fn trace_all<const N: usize>(
        &self,
        points: &GBuffer,
        vpls: &[Vpl],
        mut show: impl FnMut(&Vpl, usize, &embree::RayPacket<N>, [f32; N]),
    ) -> u64
    where
        embree::Lanes<N>: embree::PacketSize,
    {
        let packets = points.len.div_ceil(N);
        let mut batch: [Aimed<N>; BATCH] = std::array::from_fn(|_| Aimed::new());
        let mut rays = 0;
        for first in (0..packets).step_by(BATCH) {
            for vpl in vpls {
                let mut count = 0;
                for index in first..packets.min(first + BATCH) {
                    let aimed = &mut batch[count];
                    aimed.index = index;
                    aimed.start_at(vpl.position);
                    aimed.facing = aim(&mut aimed.packet, points, index, |_| (vpl.position, vpl.normal));
                    // A packet of which no lane faces the light is overwritten by the next one.
                    count += usize::from(any_positive(&aimed.facing));
                }
                for aimed in &mut batch[..count] {
                    rays += trace(self.scene, &mut aimed.packet, &aimed.facing);
                }
                for aimed in &batch[..count] {
                    show(
                        vpl,
                        aimed.index,
                        &aimed.packet,
                        seen(&aimed.packet, &aimed.facing),
                    );
                }
            }
        }
        rays
    }
}

/// [`Gather::add`], for the vectors of the processor.
struct Add<'a> {
    gather: &'a Gather<'a>,
    points: &'a GBuffer,
    vpls: &'a [Vpl],
    radiance: &'a mut Vec3Lanes,
}

impl embree::WideKernel for Add<'_> {
    type Output = u64;

    #[inline(always)]
    fn run(self) -> u64 {
        match self.gather.scene.packet_width() {
            embree::PacketWidth::W4 => self.gather.add_by::<4>(self.points, self.vpls, self.radiance),
            embree::PacketWidth::W8 => self.gather.add_by::<8>(self.points, self.vpls, self.radiance),
            embree::PacketWidth::W16 => self.gather.add_by::<16>(self.points, self.vpls, self.radiance),
        }
    }
}

/// [`Gather::count_visible`], for the vectors of the processor.
struct CountVisible<'a> {
    gather: &'a Gather<'a>,
    points: &'a GBuffer,
    vpls: &'a [Vpl],
}

impl embree::WideKernel for CountVisible<'_> {
    type Output = u64;

    #[inline(always)]
    fn run(self) -> u64 {
        match self.gather.scene.packet_width() {
            embree::PacketWidth::W4 => self.gather.count_visible_by::<4>(self.points, self.vpls),
            embree::PacketWidth::W8 => self.gather.count_visible_by::<8>(self.points, self.vpls),
            embree::PacketWidth::W16 => self.gather.count_visible_by::<16>(self.points, self.vpls),
        }
    }
}

/// Packets that are aimed, then traced, then shaded together: so Embree need not wait for what has only
/// just been written, nor the shading for Embree's answer.
const BATCH: usize = 16;

/// A packet of rays to the points of packet `index`.
struct Aimed<const N: usize> {
    packet: embree::RayPacket<N>,
    facing: [f32; N],
    index: usize,
}

impl<const N: usize> Aimed<N> {
    fn new() -> Self {
        Self {
            packet: embree::RayPacket::new(),
            facing: [0.0; N],
            index: 0,
        }
    }

    #[inline(always)]
    fn start_at(&mut self, origin: Vec3) {
        let [x, y, z] = origin.to_array();
        let packet = &mut self.packet;
        [packet.org_x, packet.org_y, packet.org_z] = [[x; N], [y; N], [z; N]];
    }
}

/// Points the rays of a packet from the lights at the points of packet `index`. A lane of the result is
/// positive where light and point face each other.
#[inline(always)]
pub(crate) fn aim<const N: usize>(
    packet: &mut embree::RayPacket<N>,
    points: &GBuffer,
    index: usize,
    light: impl Fn(usize) -> (Vec3, Vec3),
) -> [f32; N] {
    let [px, py, pz] = points.position.packet::<N>(index);
    let [sx, sy, sz] = points.shading_normal.packet::<N>(index);
    let [gx, gy, gz] = points.geometric_normal.packet::<N>(index);
    let mut facing = [0.0; N];
    for lane in 0..N {
        let (position, normal) = light(lane);
        let (dx, dy, dz) = (
            px[lane] - position.x,
            py[lane] - position.y,
            pz[lane] - position.z,
        );
        let at_light = dx * normal.x + dy * normal.y + dz * normal.z;
        let shading = -(dx * sx[lane] + dy * sy[lane] + dz * sz[lane]);
        let geometric = -(dx * gx[lane] + dy * gy[lane] + dz * gz[lane]);
        // The smallest decides, without a branch.
        facing[lane] = smaller(smaller(at_light, shading), geometric);
        packet.dir_x[lane] = dx;
        packet.dir_y[lane] = dy;
        packet.dir_z[lane] = dz;
        packet.tfar[lane] = 1.0;
    }
    facing
}

/// Whether any lane is positive, without a branch.
#[inline(always)]
pub(crate) fn any_positive<const N: usize>(lanes: &[f32; N]) -> bool {
    let positive = lanes.map(|lane| lane > 0.0);
    positive.iter().fold(false, |any, positive| any | positive)
}

/// Traces the rays of the lanes that face each other, and returns their number.
#[inline(always)]
pub(crate) fn trace<const N: usize>(
    scene: &TracedScene,
    packet: &mut embree::RayPacket<N>,
    facing: &[f32; N],
) -> u64
where
    embree::Lanes<N>: embree::PacketSize,
{
    let valid = embree::LaneMask::from_lanes(facing.map(|facing| facing > 0.0));
    scene
        .accelerated()
        .occluded(&valid, packet, embree::Coherence::Incoherent);
    u64::from(valid.count())
}

/// Positive in the lanes of a traced packet that face each other and whose ray reaches its point.
#[inline(always)]
pub(crate) fn seen<const N: usize>(packet: &embree::RayPacket<N>, facing: &[f32; N]) -> [f32; N] {
    let mut seen = *facing;
    for (seen, end) in seen.iter_mut().zip(packet.tfar) {
        // Embree marks an occluded ray by a negative end.
        *seen = smaller(*seen, end);
    }
    seen
}

/// The geometry term of each lane that is `seen`, and zero for the others.
#[inline(always)]
pub(crate) fn geometry_terms<const N: usize>(
    packet: &embree::RayPacket<N>,
    points: &GBuffer,
    index: usize,
    light_normal: impl Fn(usize) -> Vec3,
    bound: GeometryBound,
    seen: [f32; N],
) -> [f32; N] {
    let [sx, sy, sz] = points.shading_normal.packet::<N>(index);
    let mut terms = [0.0; N];
    for lane in 0..N {
        let normal = light_normal(lane);
        let (dx, dy, dz) = (packet.dir_x[lane], packet.dir_y[lane], packet.dir_z[lane]);
        let squared = dx * dx + dy * dy + dz * dz;
        let at_light = dx * normal.x + dy * normal.y + dz * normal.z;
        let shading = -(dx * sx[lane] + dy * sy[lane] + dz * sz[lane]);
        // Both cosines carry a factor of the distance.
        let term = smaller(at_light * shading / (squared * squared), bound.0);
        terms[lane] = if seen[lane] > 0.0 { term } else { 0.0 };
    }
    terms
}

/// One instruction, where `f32::min` would look for NaNs first.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn add_scaled<const N: usize>(channel: &mut [f32], index: usize, weights: &[f32; N], scale: f32) {
    let lanes = &mut channel.as_chunks_mut::<N>().0[index];
    for lane in 0..N {
        lanes[lane] += weights[lane] * scale;
    }
}
