//! The progressive algorithm: right on the average, whatever has come of it, and better the longer it goes on.

mod rooms;

use std::sync::Arc;

use glam::Vec3;
use render::{
    frame::FrameRenderer,
    gbuffer::{antialias_aovs, trace_aovs},
    intersect::TracedScene,
    path::{Through, path_trace},
    sample::{hash, pixel::PixelSamples},
    scene::ImageSize,
    settings::Settings,
    task::{Component, Task},
    vpl::trace_sets,
};
use rooms::{Room, all_tasks, mean, picture, picture_of, room_with_lamp};

const SIZE: ImageSize = ImageSize {
    width: 32,
    height: 32,
};

fn settings(passes: u32) -> Settings {
    Settings {
        groups: 8,
        spp: passes,
        ..Settings::progressive(SIZE)
    }
}

fn furnace() -> Arc<TracedScene> {
    let half = Vec3::splat(0.5);
    Room::new(Vec3::splat(0.5), Vec3::new(0.9, 0.4, 0.7), 80.0)
        .cube(half, half)
        .build()
}

#[track_caller]
fn assert_near(what: &str, value: f32, expected: f32, relative: f32) {
    assert!(
        (value / expected - 1.0).abs() < relative,
        "{what} is {value}, not {expected} within {relative}"
    );
}

/// Emitted 0.5, direct 0.25, indirect 0.25.
#[test]
fn the_furnace_has_radiance_one() {
    let size = ImageSize {
        width: 64,
        height: 64,
    };
    let picture = picture(
        &furnace(),
        &Settings {
            size,
            ..settings(256)
        },
    );
    assert_near("direct light", mean(&picture.direct).x, 0.25, 0.01);
    assert_near("indirect light", mean(&picture.indirect).x, 0.25, 0.02);
    assert_near("all light", mean(&picture.beauty).x, 1.0, 0.01);
    assert_eq!(picture.samples_direct, [256; 64 * 64]);
    assert!((picture.coverage.indirect_samples - 256.0).abs() < 1e-9);
}

/// The error that half of the pixels stay below: near corners VPLs have now and then a very large one.
fn median_error(light: &[Vec3], gold: &[Vec3]) -> f32 {
    let mut errors: Vec<f32> = light
        .iter()
        .zip(gold)
        .filter(|(_, gold)| gold.y > 0.0)
        .map(|(light, gold)| ((light.y - gold.y) / gold.y).abs())
        .collect();
    errors.sort_by(f32::total_cmp);
    errors[errors.len() / 2]
}

#[test]
fn four_times_the_passes_halve_the_error_and_no_floor_is_in_sight() {
    let scene = room_with_lamp();
    let aovs = Arc::new(trace_aovs(&scene, SIZE));
    let gold = path_trace(&scene, &aovs, Through::WholePixel, 4096, 1, &|_| ());
    let errors: Vec<[f32; 2]> = [8, 32, 128]
        .map(|passes| {
            let picture = picture(&scene, &settings(passes));
            [
                median_error(&picture.direct, &gold.direct),
                median_error(&picture.indirect, &gold.indirect),
            ]
        })
        .into();
    for (component, what) in ["direct", "indirect"].into_iter().enumerate() {
        for pair in errors.windows(2) {
            let ratio = pair[0][component] / pair[1][component];
            // The paths of the reference have an error, too.
            assert!(ratio > 1.6, "{what}: {errors:?}");
        }
    }
}

#[test]
fn any_random_share_of_the_tasks_is_right_on_the_average() {
    let scene = room_with_lamp();
    let settings = settings(32);
    let tasks = all_tasks(&settings);
    let whole = picture_of(&scene, &settings, &tasks);
    for percent in [10, 30, 50, 70, 90] {
        let chance = |task: &Task| {
            let number = hash(
                hash(percent, task.group),
                2 * task.index + u32::from(task.component == Component::Direct),
            );
            number % 100 < percent
        };
        let some: Vec<Task> = tasks.iter().copied().filter(chance).collect();
        let picture = picture_of(&scene, &settings, &some);
        assert_near(
            "direct light",
            mean(&picture.direct).y,
            mean(&whole.direct).y,
            0.03,
        );
        assert_near(
            "indirect light",
            mean(&picture.indirect).y,
            mean(&whole.indirect).y,
            0.05,
        );
    }
    let nothing = picture_of(&scene, &settings, &[]);
    assert_eq!(mean(&nothing.indirect), Vec3::ZERO);
    assert!((nothing.coverage.direct_reconstructed_percent - 100.0).abs() < 1e-9);
}

/// Tasks of one, two and four passes, which together are all of sixteen.
fn spans(settings: &Settings) -> Vec<Task> {
    let spans = [(0, 1), (1, 1), (2, 2), (4, 4), (8, 4), (12, 2), (14, 2)];
    let components = [Component::Direct, Component::Indirect];
    let groups = 0..settings.groups;
    groups
        .flat_map(|group| {
            components.into_iter().flat_map(move |component| {
                spans.map(|(index, passes)| Task {
                    component,
                    group,
                    index,
                    passes,
                })
            })
        })
        .collect()
}

#[test]
fn any_order_of_arrival_gives_the_same_bits() {
    let scene = room_with_lamp();
    let settings = settings(16);
    let mut tasks = spans(&settings);
    // A subset, so that reconstruction takes part.
    tasks.retain(|task| (task.group * 7 + task.index * 3) % 5 != 0);
    let forward = picture_of(&scene, &settings, &tasks);
    tasks.reverse();
    let backward = picture_of(&scene, &settings, &tasks);
    tasks.sort_by_key(|task| hash(task.group, task.index));
    let shuffled = picture_of(&scene, &settings, &tasks);
    assert!(forward.beauty == backward.beauty && forward.beauty == shuffled.beauty);
}

#[test]
fn a_task_of_several_passes_is_the_sum_of_tasks_of_one() {
    let scene = room_with_lamp();
    let settings = settings(16);
    let one_by_one = picture_of(&scene, &settings, &all_tasks(&settings));
    let together = picture_of(&scene, &settings, &spans(&settings));
    let pairs = one_by_one.beauty.iter().zip(&together.beauty);
    assert!(
        pairs
            .into_iter()
            .all(|(one, other)| one.abs_diff_eq(*other, 1e-5 * one.max_element()))
    );
}

#[test]
fn a_stopped_task_gives_the_beginning_of_the_whole_one() {
    let scene = room_with_lamp();
    let settings = Settings {
        groups: 1,
        ..settings(16)
    };
    let renderer = FrameRenderer::new(scene.clone(), settings, trace_sets(&scene, &settings)).unwrap();
    let task = Task {
        component: Component::Indirect,
        group: 0,
        index: 4,
        passes: 4,
    };
    let whole = renderer.render(task, &mut |chunks| chunks);
    let mut asked = 0;
    let part = renderer.render(task, &mut |_| {
        asked += 1;
        usize::from(asked <= 2)
    });
    assert_eq!(part.pixels_done, 512);
    assert!(part.radiance == whole.radiance[..512 * 3]);
}

#[test]
fn the_passes_of_a_pixel_are_spread_evenly_over_it() {
    for pixel in [0, 7, 900_000] {
        for first in [0, 16, 160] {
            let mut cells = [0; 16];
            for pass in first..first + 16 {
                let place = PixelSamples::new(3, pass).place(pixel);
                cells[(4.0 * place.y) as usize * 4 + (4.0 * place.x) as usize] += 1;
            }
            assert_eq!(cells, [1; 16], "pixel {pixel}, passes from {first}");
        }
    }
}

#[test]
fn an_edge_that_halves_a_pixel_shows_the_mean_of_both_sides() {
    // White left of the middle of the picture, which lies within the middle one of three columns.
    let quad = |room: Room, x: f32, kd: f32| {
        room.quad(
            Vec3::new(x, -9.0, 1.0),
            18.0 * Vec3::Y,
            9.0 * Vec3::X,
            Vec3::splat(kd),
            Vec3::ZERO,
        )
    };
    let room = Room::new(Vec3::ZERO, Vec3::Z, 60.0);
    let scene = quad(quad(room, -9.0, 1.0), 0.0, 0.2).build();
    let size = ImageSize { width: 3, height: 3 };
    let centres = trace_aovs(&scene, size);
    let smooth = antialias_aovs(&scene, &centres, 64, &|| false).unwrap();
    let row = |albedo: &[Vec3]| [3, 4, 5].map(|pixel| albedo[pixel].x);
    assert_near("the middle", row(&smooth.albedo)[1], 0.6, 0.06);
    let [left, _, right] = row(&centres.albedo);
    assert!((row(&smooth.albedo)[0] - left).abs() + (row(&smooth.albedo)[2] - right).abs() < 1e-5);
    assert!(antialias_aovs(&scene, &centres, 64, &|| true).is_none());
}
