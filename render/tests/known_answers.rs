//! Scenes whose light is known from formulas, and one way of computing judged by another.

mod rooms;

use std::{f32::consts::PI, sync::Arc};

use glam::Vec3;
use render::{
    frame::FrameRenderer,
    gbuffer::{GBuffer, Vec3Lanes, trace_aovs},
    image::Picture,
    intersect::{BruteForce, TracedScene},
    light::LightSampler,
    path::{Through, path_trace},
    sample::{Stream, warp::cosine_direction},
    scene::ImageSize,
    settings::{Algorithm, LightPoints, Settings},
    task::{Component, Task},
    vpl::{Compensation, Gather, GeometryBound, automatic_bound, trace_sets, trace_sets_thoroughly},
};
use rooms::{Room, all_tasks, mean, picture, picture_of, room_with_lamp};

const SIZE: ImageSize = ImageSize {
    width: 64,
    height: 64,
};

fn settings(algorithm: Algorithm) -> Settings {
    Settings {
        groups: 8,
        ..Settings::paper(algorithm, SIZE)
    }
}

fn furnace() -> Arc<TracedScene> {
    let half = Vec3::splat(0.5);
    Room::new(Vec3::splat(0.5), Vec3::new(0.9, 0.4, 0.7), 80.0)
        .cube(half, half)
        .build()
}

fn gold(scene: &TracedScene, spp: u32) -> Picture {
    path_trace(
        scene,
        &Arc::new(trace_aovs(scene, SIZE)),
        Through::Centre,
        spp,
        0,
        &|_| (),
    )
}

fn assert_near(what: &str, value: f32, expected: f32, relative: f32) {
    assert!(
        (value / expected - 1.0).abs() < relative,
        "{what} is {value}, not {expected} within {relative}"
    );
}

fn assert_same_bits(a: &[Vec3], b: &[Vec3]) {
    let differing = a.iter().zip(b).filter(|(a, b)| a != b).count();
    assert!(
        a.len() == b.len() && differing == 0,
        "{differing} of {} pixels differ",
        a.len()
    );
}

#[test]
fn the_furnace_has_radiance_one_by_the_path_tracer() {
    let picture = gold(&furnace(), 256);
    assert_near("direct light", mean(&picture.direct).x, 0.25, 0.005);
    assert_near("indirect light", mean(&picture.indirect).x, 0.25, 0.005);
}

#[test]
fn the_furnace_has_radiance_one_by_vpls() {
    let many = Settings {
        spp: 256,
        vpls: 4096,
        light_points: LightPoints::PerPixel,
        ..settings(Algorithm::Component)
    };
    let picture = picture(&furnace(), &many);
    assert_near("direct light", mean(&picture.direct).x, 0.25, 0.01);
    assert_near("indirect light", mean(&picture.indirect).x, 0.25, 0.01);
    assert_near("all light", mean(&picture.beauty).x, 1.0, 0.01);
}

/// Irradiance below the centre of a square light of half side `a` at height `h`, per radiance: four
/// times the configuration factor of one quarter (Howell, factor B-4), times π.
fn irradiance_below_square(a: f32, h: f32) -> f32 {
    let r = (a * a + h * h).sqrt();
    4.0 * 0.5 * (2.0 * a / r * (a / r).atan())
}

fn floor_below_lamp() -> Arc<TracedScene> {
    // The eye looks down past the lamp at a patch of the floor so small that it is one point.
    Room::new(Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO, 0.2)
        .quad(
            Vec3::new(-5.0, 0.0, -5.0),
            10.0 * Vec3::Z,
            10.0 * Vec3::X,
            Vec3::splat(0.6),
            Vec3::ZERO,
        )
        .quad(
            Vec3::new(-0.5, 1.0, -0.5),
            Vec3::X,
            Vec3::Z,
            Vec3::ZERO,
            Vec3::new(1.0, 2.0, 3.0),
        )
        .build()
}

#[test]
fn a_square_light_lights_the_floor_as_the_formula_says() {
    let scene = floor_below_lamp();
    let expected = irradiance_below_square(0.5, 1.0) * 0.6 / PI;
    let by_paths = gold(&scene, 64).direct;
    assert_near("the path tracer's light", mean(&by_paths).x, expected, 0.002);
    assert_near("the path tracer's blue", mean(&by_paths).z, 3.0 * expected, 0.002);
    for light_points in [LightPoints::PerPass, LightPoints::PerPixel] {
        let settings = Settings {
            spp: 256,
            light_points,
            ..settings(Algorithm::Component)
        };
        let picture = picture(&scene, &settings);
        assert_near("the tasks' light", mean(&picture.direct).x, expected, 0.002);
        assert_near("the tasks' blue", mean(&picture.direct).z, 3.0 * expected, 0.002);
    }
}

#[test]
fn many_vpls_converge_to_the_path_tracer() {
    let scene = room_with_lamp();
    let gold = gold(&scene, 512);
    let many = Settings {
        spp: 512,
        vpls: 16_384,
        light_points: LightPoints::PerPixel,
        ..settings(Algorithm::Component)
    };
    let picture = picture(&scene, &many);
    for (what, light, gold) in [
        ("direct", &picture.direct, &gold.direct),
        ("indirect", &picture.indirect, &gold.indirect),
    ] {
        let ratio = mean(light) / mean(gold);
        assert!(
            (ratio - 1.0).abs().max_element() < 0.01,
            "{what} light is {ratio} of the path tracer's"
        );
    }
}

/// Two rooms with a lamp each; the eye is in the first.
#[test]
fn vpls_stand_where_the_picture_sees_their_light() {
    let mut room = Room::new(Vec3::new(0.5, 0.5, 0.05), Vec3::new(0.5, 0.45, 1.0), 70.0);
    for corner in [Vec3::ZERO, 2.0 * Vec3::X] {
        let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
        let wall = Vec3::splat(0.6);
        for (at, edge_u, edge_v) in [
            (corner, x, y),
            (corner, y, z),
            (corner, z, x),
            (corner + Vec3::ONE, -y, -x),
            (corner + Vec3::ONE, -z, -y),
            (corner + Vec3::ONE, -x, -z),
        ] {
            room = room.quad(at, edge_u, edge_v, wall, Vec3::ZERO);
        }
        let lamp = corner + Vec3::new(0.4, 0.98, 0.4);
        room = room.quad(lamp, 0.2 * x, 0.2 * z, Vec3::ZERO, Vec3::ONE);
    }
    let scene = room.build();
    let share_seen = |vpls| {
        let settings = Settings {
            vpls,
            ..settings(Algorithm::Component)
        };
        let sets = trace_sets_thoroughly(&scene, &settings);
        let vpls: Vec<_> = sets.into_iter().flat_map(|set| set.vpls).collect();
        vpls.iter().filter(|vpl| vpl.position.x < 1.5).count() as f32 / vpls.len() as f32
    };
    assert_near("the share of a few VPLs by light", share_seen(1_024), 0.5, 0.05);
    let many = share_seen(4_096);
    assert!(
        many > 0.7,
        "only {many} of many VPLs are where their light is seen"
    );
}

#[test]
fn both_algorithms_agree_to_the_bit_when_nothing_is_missing() {
    let scene = room_with_lamp();
    let component = picture(&scene, &settings(Algorithm::Component));
    let straightforward = picture(
        &scene,
        &Settings {
            groups: 32,
            ..settings(Algorithm::Straightforward)
        },
    );
    assert_same_bits(&component.beauty, &straightforward.beauty);
    assert_same_bits(&component.indirect, &straightforward.indirect);
}

#[test]
fn any_order_of_arrival_gives_the_same_bits() {
    let scene = room_with_lamp();
    let settings = settings(Algorithm::Component);
    let mut tasks = all_tasks(&settings);
    // A subset, so that reconstruction takes part.
    tasks.retain(|task| (task.group * 7 + task.index * 3) % 5 != 0);
    let forward = picture_of(&scene, &settings, &tasks);
    tasks.reverse();
    let backward = picture_of(&scene, &settings, &tasks);
    tasks.sort_by_key(|task| (task.group * 5 + task.index * 11) % 13);
    let shuffled = picture_of(&scene, &settings, &tasks);
    assert_same_bits(&forward.beauty, &backward.beauty);
    assert_same_bits(&forward.beauty, &shuffled.beauty);
}

#[test]
fn a_stopped_task_gives_the_beginning_of_the_whole_one() {
    let scene = room_with_lamp();
    let settings = Settings {
        groups: 1,
        ..settings(Algorithm::Component)
    };
    let renderer = FrameRenderer::new(scene.clone(), settings, trace_sets(&scene, &settings)).unwrap();
    let task = Task {
        component: Component::Indirect,
        group: 0,
        index: 3,
        passes: 1,
    };
    let whole = renderer.render(task, &mut |left| left);
    let mut asked = 0;
    let part = renderer.render(task, &mut |_| {
        asked += 1;
        [1, 2, 0][asked - 1]
    });
    assert_eq!(part.pixels_done, 3 * 1024);
    assert!(part.radiance == whole.radiance[..3 * 1024 * 3]);
}

#[test]
fn any_subset_of_results_gives_a_picture_of_the_same_brightness() {
    let scene = room_with_lamp();
    let settings = settings(Algorithm::Component);
    let tasks = all_tasks(&settings);
    let whole = mean(&picture(&scene, &settings).indirect).y;
    let some: Vec<Task> = tasks
        .iter()
        .copied()
        .filter(|task| (task.group + task.index) % 2 == 0)
        .collect();
    assert_near(
        "half of all tasks",
        mean(&picture_of(&scene, &settings, &some).indirect).y,
        whole,
        0.05,
    );
    let nothing: Picture = picture_of(&scene, &settings, &[]);
    assert_eq!(mean(&nothing.indirect), Vec3::ZERO);
    assert!(mean(&nothing.beauty).x >= 0.0);
    assert!((nothing.coverage.direct_reconstructed_percent - 100.0).abs() < 1e-9);
    assert!((nothing.coverage.indirect_reconstructed_percent - 100.0).abs() < 1e-9);
}

#[test]
fn embree_finds_the_same_triangles_as_trying_them_all() {
    let mut room = Room::new(Vec3::ZERO, Vec3::Z, 60.0);
    let point = |i: u32, scale: f32| {
        let mut stream = Stream::new(i, 5);
        let xy = stream.next_2d();
        scale * (xy.extend(stream.next_1d()) - 0.5)
    };
    for i in 0..100 {
        room = room.quad(
            point(3 * i, 2.0),
            point(3 * i + 1, 0.7),
            point(3 * i + 2, 0.7),
            Vec3::ONE,
            Vec3::ZERO,
        );
    }
    let scene = room.build();
    let brute_force = BruteForce::new(&scene.scene().mesh);
    let mut hits = 0;
    for i in 0..2_000 {
        let origin = point(1_000 + i, 2.0);
        let direction = cosine_direction(Vec3::Y, Stream::new(i, 9).next_2d());
        let (fast, slow) = (
            scene.nearest(origin, direction),
            brute_force.nearest(origin, direction),
        );
        assert_eq!(fast.is_some(), slow.is_some(), "ray {i}");
        if let (Some(fast), Some((distance, _))) = (fast, slow) {
            hits += 1;
            let expected = origin + distance as f32 * direction;
            assert!(
                (fast.position - expected).length() < 1e-5,
                "ray {i}: {} is not {expected}",
                fast.position
            );
            assert!(fast.geometric_normal.dot(direction) <= 0.0);
        }
        let target = point(5_000 + i, 2.0);
        assert_eq!(
            scene.visible(origin, target),
            !brute_force.occluded(origin, target),
            "shadow ray {i}"
        );
    }
    assert!((500..1_900).contains(&hits), "{hits} hits tell nothing");
}

/// The picture's indirect light by one bounded set, and by its compensation.
///
/// The bound is a sixteenth of the automatic one, so that it takes more; the compensation is the mean of
/// so many passes.
fn bounded_and_put_back(scene: &TracedScene, settings: &Settings, passes: u32) -> [Vec<Vec3>; 2] {
    let set = trace_sets(scene, settings).swap_remove(0);
    let bound = 0.0625 * automatic_bound(scene, settings, &set).expect("light in the picture");
    let settings = Settings {
        geometry_clamp: Some(bound),
        ..*settings
    };
    let pixels: Vec<u32> = (0..SIZE.pixel_count() as u32).collect();
    let points = GBuffer::trace(scene, SIZE, &pixels);
    let albedo = trace_aovs(scene, SIZE).albedo;
    let light = |count: u32, add: &dyn Fn(u32, &mut Vec3Lanes)| {
        let mut radiance = Vec3Lanes::zeros(pixels.len());
        (0..count).for_each(|pass| add(pass, &mut radiance));
        (0..pixels.len())
            .map(|pixel| albedo[pixel] * radiance.get(pixel) / count as f32)
            .collect()
    };
    let lights = LightSampler::new(&scene.scene().emitters);
    let compensation = Compensation::new(scene, &lights, &settings).expect("a bound");
    let gather = Gather::new(scene, GeometryBound::new(Some(bound)));
    [
        light(1, &|_, radiance| {
            gather.add(&points, &set.vpls, radiance);
        }),
        light(passes, &|pass, radiance| {
            compensation.add(&pixels, &points, &set.vpls, pass, radiance);
        }),
    ]
}

/// The mean of independent estimates, and its standard error.
fn mean_and_error(estimates: &[f32]) -> (f32, f32) {
    let n = estimates.len() as f32;
    let mean = estimates.iter().sum::<f32>() / n;
    let squares: f32 = estimates.iter().map(|estimate| (estimate - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0) / n).sqrt())
}

#[test]
fn compensation_puts_back_what_the_bound_takes_and_no_more() {
    for (name, scene, expected) in [
        ("the furnace", furnace(), 0.25),
        (
            "a room with corners",
            room_with_lamp(),
            mean(&gold(&room_with_lamp(), 1024).indirect).y,
        ),
    ] {
        let (bounded, whole): (Vec<f32>, Vec<f32>) = (0..24)
            .map(|seed| {
                let few = Settings {
                    vpls: 64,
                    vpl_sets: 1,
                    seed,
                    ..settings(Algorithm::Component)
                };
                let [bounded, put_back] = bounded_and_put_back(&scene, &few, 1).map(|light| mean(&light).y);
                (bounded, bounded + put_back)
            })
            .unzip();
        let (bounded, _) = mean_and_error(&bounded);
        let (whole, error) = mean_and_error(&whole);
        assert!(
            bounded < 0.98 * expected,
            "in {name} the bound took nothing: {bounded} of {expected}"
        );
        assert!(
            error < 0.01 * expected,
            "{name}: an error of {error} tells nothing"
        );
        assert!(
            (whole - expected).abs() < 3.5 * error.hypot(0.001 * expected),
            "{name}: {whole} ± {error} is not {expected}"
        );
    }
}

#[test]
fn compensated_vpls_leave_no_bright_spots() {
    let scene = room_with_lamp();
    let many = Settings {
        vpls: 256,
        vpl_sets: 1,
        ..settings(Algorithm::Component)
    };
    let gold = gold(&scene, 256).indirect;
    let off = |light: &[Vec3]| {
        let squares = light
            .iter()
            .zip(&gold)
            .map(|(light, gold)| (light.y - gold.y).powi(2));
        (squares.sum::<f32>() / gold.len() as f32).sqrt() / mean(&gold).y
    };
    let unbounded = picture(&scene, &many).indirect;
    let [bounded, put_back] = bounded_and_put_back(&scene, &many, 16);
    let whole: Vec<Vec3> = bounded.iter().zip(put_back).map(|(a, b)| a + b).collect();
    let (before, after) = (off(&unbounded), off(&whole));
    assert!(
        after < 0.5 * before,
        "pixels are off by {after} of the mean, and by {before} without a bound"
    );
}
