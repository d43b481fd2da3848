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
        match self.scene.packet_width() {
            embree::PacketWidth::W4 => self.add_by::<4>(points, vpls, radiance),
            embree::PacketWidth::W8 => self.add_by::<8>(points, vpls, radiance),
            embree::PacketWidth::W16 => self.add_by::<16>(points, vpls, radiance),
        }
    }

    /// Number of pairs of a VPL and a point that see each other: the rays of [`Gather::add`] without
    /// its light.
    pub fn count_visible(&self, points: &GBuffer, vpls: &[Vpl]) -> u64 {
        match self.scene.packet_width() {
            embree::PacketWidth::W4 => self.count_visible_by::<4>(points, vpls),
            embree::PacketWidth::W8 => self.count_visible_by::<8>(points, vpls),
            embree::PacketWidth::W16 => self.count_visible_by::<16>(points, vpls),
        }
    }

    fn count_visible_by<const N: usize>(&self, points: &GBuffer, vpls: &[Vpl]) -> u64
    where
        embree::Lanes<N>: embree::PacketSize,
    {
        let (mut visible, mut rays) = (0, 0);
        for vpl in vpls {
            let mut packet = rays_from::<N>(vpl.position);
            for index in 0..points.len.div_ceil(N) {
                let weights = connect(
                    &mut packet,
                    points,
                    index,
                    |_| (vpl.position, vpl.normal),
                    self.bound,
                );
                let weights = visible_weights(self.scene, &mut packet, weights, &mut rays);
                visible += weights.iter().filter(|&&weight| weight > 0.0).count() as u64;
            }
        }
        visible
    }

    fn add_by<const N: usize>(&self, points: &GBuffer, vpls: &[Vpl], radiance: &mut Vec3Lanes) -> u64
    where
        embree::Lanes<N>: embree::PacketSize,
    {
        let packets = points.len.div_ceil(N);
        let mut rays = 0;
        for vpl in vpls {
            // The receiver's BSDF per unit albedo is 1/π.
            let [r, g, b] = (vpl.intensity / std::f32::consts::PI).to_array();
            let mut packet = rays_from::<N>(vpl.position);
            for index in 0..packets {
                let weights = connect(
                    &mut packet,
                    points,
                    index,
                    |_| (vpl.position, vpl.normal),
                    self.bound,
                );
                let visible = visible_weights(self.scene, &mut packet, weights, &mut rays);
                add_scaled(&mut radiance.x, index, &visible, r);
                add_scaled(&mut radiance.y, index, &visible, g);
                add_scaled(&mut radiance.z, index, &visible, b);
            }
        }
        rays
    }
}

/// A packet of rays that start at one point and do not go anywhere yet.
fn rays_from<const N: usize>(origin: Vec3) -> embree::RayPacket<N> {
    let mut packet = embree::RayPacket::new();
    [packet.org_x, packet.org_y, packet.org_z] = origin.to_array().map(|coordinate| [coordinate; N]);
    packet
}

/// Points the rays of a packet from the lights at the points of packet `index`, and returns the
/// geometry term of each pair; zero where light or point turns away.
#[inline(always)]
pub(crate) fn connect<const N: usize>(
    packet: &mut embree::RayPacket<N>,
    points: &GBuffer,
    index: usize,
    light: impl Fn(usize) -> (Vec3, Vec3),
    bound: GeometryBound,
) -> [f32; N] {
    let [px, py, pz] = points.position.packet::<N>(index);
    let [sx, sy, sz] = points.shading_normal.packet::<N>(index);
    let [gx, gy, gz] = points.geometric_normal.packet::<N>(index);
    let mut terms = [0.0; N];
    for lane in 0..N {
        let (position, normal) = light(lane);
        let (dx, dy, dz) = (
            px[lane] - position.x,
            py[lane] - position.y,
            pz[lane] - position.z,
        );
        let squared = dx * dx + dy * dy + dz * dz;
        let at_light = dx * normal.x + dy * normal.y + dz * normal.z;
        let shading = -(dx * sx[lane] + dy * sy[lane] + dz * sz[lane]);
        let geometric = -(dx * gx[lane] + dy * gy[lane] + dz * gz[lane]);
        // Both cosines carry a factor of the distance.
        let term = (at_light * shading / (squared * squared)).min(bound.0);
        // The smallest decides, without a branch.
        let facing = at_light.min(shading).min(geometric);
        terms[lane] = if facing > 0.0 { term } else { 0.0 };
        packet.dir_x[lane] = dx;
        packet.dir_y[lane] = dy;
        packet.dir_z[lane] = dz;
        packet.tfar[lane] = 1.0;
    }
    terms
}

/// Keeps the weights whose rays reach their point; only rays with weight are traced.
#[inline(always)]
pub(crate) fn visible_weights<const N: usize>(
    scene: &TracedScene,
    packet: &mut embree::RayPacket<N>,
    mut weights: [f32; N],
    rays: &mut u64,
) -> [f32; N]
where
    embree::Lanes<N>: embree::PacketSize,
{
    let valid = embree::LaneMask::from_lanes(weights.map(|weight| weight > 0.0));
    let count = valid.count();
    if count == 0 {
        return weights;
    }
    *rays += u64::from(count);
    scene
        .accelerated()
        .occluded(&valid, packet, embree::Coherence::Incoherent);
    for (weight, end) in weights.iter_mut().zip(packet.tfar) {
        // Embree marks an occluded ray by a negative end.
        *weight = if end < 0.0 { 0.0 } else { *weight };
    }
    weights
}

#[inline(always)]
fn add_scaled<const N: usize>(channel: &mut [f32], index: usize, weights: &[f32; N], scale: f32) {
    let lanes = &mut channel.as_chunks_mut::<N>().0[index];
    for lane in 0..N {
        lanes[lane] += weights[lane] * scale;
    }
}
