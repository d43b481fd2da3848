//! Scenes and rays through the safe wrapper alone.

use embree4_sys::{
    Bounds, BuildQuality, Coherence, Device, DeviceConfig, Error, Hit, LaneMask, Lanes, PacketSize, Ray,
    RayHitPacket, RayPacket, Scene, SceneBuilder,
};

/// One triangle in the plane z = 0, its normal along +z.
const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
const TOWARDS_IT: Ray = Ray {
    origin: [0.5, 0.25, 3.0],
    dir: [0.0, 0.0, -2.0],
    tnear: 0.0,
    tfar: f32::INFINITY,
};
const PAST_IT: Ray = Ray {
    origin: [1.5, 1.5, 3.0],
    ..TOWARDS_IT
};

fn device() -> Device {
    Device::new(&DeviceConfig::default()).expect("Embree starts")
}

fn scene_of(positions: Vec<[f32; 3]>, indices: Vec<[u32; 3]>) -> Scene {
    let mut builder = SceneBuilder::new(&device());
    builder
        .attach_triangles(positions, indices)
        .expect("a valid mesh");
    builder.commit().expect("a scene")
}

fn one_triangle() -> Scene {
    scene_of(TRIANGLE.to_vec(), vec![[0, 1, 2]])
}

#[test]
fn a_hit_says_where_and_what() {
    let hit = one_triangle()
        .intersect1(&TOWARDS_IT)
        .expect("the ray goes through the triangle");
    // Distances count in lengths of the direction, which is 2 long here. Embree
    // divides by approximation, so the last bit may be off.
    for (found, expected) in [(hit.t, 1.5), (hit.u, 0.25), (hit.v, 0.125)] {
        assert!((found - expected).abs() < 1e-6, "{hit:?}");
    }
    assert_eq!((hit.primitive, hit.geometry.0), (0, 0));
    assert!(
        hit.ng[0].abs() + hit.ng[1].abs() + (hit.ng[2] - 4.0).abs() < 1e-5,
        "{hit:?}"
    );
}

#[test]
fn a_ray_that_misses_hits_nothing() {
    assert_eq!(one_triangle().intersect1(&PAST_IT), None);
    assert!(!one_triangle().occluded1(&PAST_IT));
}

#[test]
fn only_the_segment_between_tnear_and_tfar_counts() {
    let scene = one_triangle();
    for (tnear, tfar, meets) in [
        (0.0, 1.4, false),
        (0.0, 1.6, true),
        (1.4, 1.6, true),
        (1.6, 9.0, false),
    ] {
        let ray = TOWARDS_IT.between(tnear, tfar);
        assert_eq!(scene.intersect1(&ray).is_some(), meets, "{ray:?}");
        assert_eq!(scene.occluded1(&ray), meets, "{ray:?}");
    }
}

#[test]
fn meshes_are_numbered_in_the_order_of_attaching() {
    let mut builder = SceneBuilder::new(&device());
    let empty = builder.attach_triangles(vec![], vec![]).expect("an empty mesh");
    let far = builder
        .attach_triangles(TRIANGLE.to_vec(), vec![[0, 1, 2]])
        .expect("a mesh");
    let near = builder.attach_triangles(TRIANGLE.map(|[x, y, _]| [x, y, 1.0]).to_vec(), vec![[0, 1, 2]]);
    let scene = builder.commit().expect("a scene");
    assert_eq!((empty.0, far.0), (0, 1));
    assert_eq!(scene.intersect1(&TOWARDS_IT).map(|hit| hit.geometry), near.ok());
    assert_eq!(scene.meshes()[far.0 as usize].positions(), TRIANGLE);
}

#[test]
fn an_empty_scene_is_a_scene() {
    let scene = SceneBuilder::new(&device()).commit().expect("an empty scene");
    assert_eq!(scene.intersect1(&TOWARDS_IT), None);
    assert!(!scene.occluded1(&TOWARDS_IT));
    assert_eq!(scene.bounds(), None);
}

#[test]
fn the_bounds_enclose_the_triangles_and_no_more() {
    let flat = Bounds {
        min: [0.0; 3],
        max: [2.0, 2.0, 0.0],
    };
    assert_eq!(one_triangle().bounds(), Some(flat));
}

#[test]
fn a_mesh_that_would_mislead_embree_is_refused() {
    let mut builder = SceneBuilder::new(&device());
    let nan = builder.attach_triangles(vec![[0.0; 3], [f32::NAN; 3], [1.0; 3]], vec![[0, 1, 2]]);
    assert!(matches!(nan, Err(Error::Position { vertex: 1, .. })), "{nan:?}");
    let outside = builder.attach_triangles(TRIANGLE.to_vec(), vec![[0, 1, 3]]);
    assert!(
        matches!(outside, Err(Error::Index { index: 3, .. })),
        "{outside:?}"
    );
}

#[test]
fn a_scene_outlives_the_handles_it_was_made_from() {
    // `device()` is dropped inside.
    let scene = one_triangle();
    let copy = scene.clone();
    drop(scene);
    assert!(copy.occluded1(&TOWARDS_IT));
}

#[test]
fn a_scene_may_be_traced_from_many_threads() {
    fn is_send_and_sync<T: Send + Sync>(_: &T) {}
    let scene = one_triangle();
    is_send_and_sync(&scene);
    is_send_and_sync(scene.device());
    std::thread::scope(|threads| {
        for _ in 0..4 {
            threads.spawn(|| assert!(scene.occluded1(&TOWARDS_IT)));
        }
    });
}

#[test]
fn every_build_quality_finds_the_same_hits() {
    let rays = random_rays(1_000);
    let hits = |quality, robust, compact| -> Vec<Option<(u32, u32)>> {
        let (positions, indices) = random_triangles(500);
        let mut builder = SceneBuilder::new(&device())
            .build_quality(quality)
            .robust(robust)
            .compact(compact);
        builder
            .attach_triangles(positions, indices)
            .expect("a valid mesh");
        let scene = builder.commit().expect("a scene");
        rays.iter()
            .map(|ray| scene.intersect1(ray).map(|hit| (hit.geometry.0, hit.primitive)))
            .collect()
    };
    let expected = hits(BuildQuality::Medium, false, false);
    assert_eq!(hits(BuildQuality::Low, false, false), expected);
    assert_eq!(hits(BuildQuality::High, false, false), expected);
    assert_eq!(hits(BuildQuality::Medium, true, true), expected);
}

#[test]
fn packets_of_4_agree_with_single_rays() {
    check_packets::<4>();
}

#[test]
fn packets_of_8_agree_with_single_rays() {
    check_packets::<8>();
}

#[test]
fn packets_of_16_agree_with_single_rays() {
    check_packets::<16>();
}

#[test]
fn lanes_outside_of_the_mask_are_left_alone() {
    let scene = one_triangle();
    let mut packet = RayPacket::<8>::new();
    for lane in 0..8 {
        packet.set(lane, &TOWARDS_IT);
    }
    scene.occluded(
        &LaneMask::from_bits(0b1010_0110),
        &mut packet,
        Coherence::Incoherent,
    );
    assert_eq!(packet.occluded_bits(), 0b1010_0110);
}

fn check_packets<const N: usize>()
where
    Lanes<N>: PacketSize,
{
    let (positions, indices) = random_triangles(500);
    let scene = scene_of(positions, indices);
    let rays = random_rays(1_600);
    let (hits, misses): (Vec<&Ray>, _) = rays.iter().partition(|ray| scene.occluded1(ray));
    assert!(hits.len() > 100 && misses.len() > 100, "rays that test nothing");

    for coherence in [Coherence::Incoherent, Coherence::Coherent] {
        for rays in rays.chunks(N) {
            let valid = LaneMask::<N>::first(rays.len());
            let mut packet = RayPacket::<N>::new();
            for (lane, ray) in rays.iter().enumerate() {
                packet.set(lane, ray);
            }
            let mut with_hits = RayHitPacket::new(packet);
            scene.occluded(&valid, &mut packet, coherence);
            scene.intersect(&valid, &mut with_hits, coherence);
            for (lane, ray) in rays.iter().enumerate() {
                assert_eq!(
                    packet.occluded_bits() >> lane & 1 == 1,
                    scene.occluded1(ray),
                    "{ray:?}"
                );
                check_same_hit(with_hits.hit(lane), scene.intersect1(ray), ray);
            }
        }
    }
}

/// Packets and single rays take different ways through the same sums, so the
/// last bits may differ.
fn check_same_hit(packet: Option<Hit>, single: Option<Hit>, ray: &Ray) {
    let (Some(packet), Some(single)) = (packet, single) else {
        assert_eq!(packet, single, "{ray:?}");
        return;
    };
    assert_eq!(
        (packet.geometry, packet.primitive),
        (single.geometry, single.primitive),
        "{ray:?}"
    );
    for (a, b) in [(packet.t, single.t), (packet.u, single.u), (packet.v, single.v)] {
        assert!(
            (a - b).abs() < 1e-4 * (1.0 + b.abs()),
            "{ray:?}: {packet:?} and {single:?}"
        );
    }
    let apart = |axis: usize| (packet.ng[axis] - single.ng[axis]).abs();
    assert!(
        apart(0) + apart(1) + apart(2) < 1e-6,
        "{ray:?}: {packet:?} and {single:?}"
    );
}

/// Small triangles in the unit cube, so that about half of the rays pass.
fn random_triangles(count: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut random = Random(1);
    let mut positions = Vec::new();
    for _ in 0..count {
        let centre = random.point();
        for _ in 0..3 {
            let corner = random.point();
            positions.push([0, 1, 2].map(|axis| centre[axis] + 0.1 * (corner[axis] - 0.5)));
        }
    }
    (
        positions,
        (0..count)
            .map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner))
            .collect(),
    )
}

fn random_rays(count: u32) -> Vec<Ray> {
    let mut random = Random(2);
    (0..count)
        .map(|_| {
            let (from, to) = (random.point(), random.point());
            Ray::new(from, [0, 1, 2].map(|axis| to[axis] - from[axis])).between(0.0, 1.0)
        })
        .collect()
}

/// Knuth's linear congruential generator: enough to scatter rays.
struct Random(u64);

impl Random {
    fn point(&mut self) -> [f32; 3] {
        [(); 3].map(|()| {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f32 / (1 << 24) as f32
        })
    }
}
