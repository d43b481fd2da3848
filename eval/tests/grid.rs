//! The virtual grid as a whole: counts against Table 1's arithmetic, machines that come and go, late
//! results, and the same run twice.

#![expect(clippy::unwrap_used, reason = "a failure shows where it happened")]

use std::{collections::BTreeSet, path::Path, time::Duration};

use eval::{
    grid::{
        frame::PreparedScene,
        parameters::Parameters,
        script::{Change, Script},
        simulate::{Circumstances, Run, TaskCost, Workload, simulate},
    },
    paper::arithmetic::{direct_percent, indirect_percent, straightforward_percent},
};
use master::scheduler::Closing;
use render::{
    scene::ImageSize,
    settings::{Algorithm, Settings},
    task::{Component, Task},
};

/// The rays of a scene in which every pixel sees every light.
struct AllVisible(Settings);

impl Workload for AllVisible {
    fn cost(&self, task: Task) -> TaskCost {
        let pixels = self.0.size.pixel_count() as u32 / self.0.groups;
        let shadow_rays = match task.component {
            Component::Direct => 1,
            Component::Indirect => self.0.vpls_per_set(),
            Component::Full => self.0.spp + self.0.vpls,
        };
        TaskCost {
            pixels,
            chunk_pixels: 64,
            rays: u64::from(pixels * (1 + shadow_rays)),
            floats_per_pixel: task.component.floats_per_pixel(),
        }
    }
}

fn run(
    algorithm: Algorithm,
    deadline_s: Option<f64>,
    script: &Script,
    change: impl Fn(&mut Parameters),
) -> Run {
    let mut parameters = Parameters::load(None).unwrap();
    change(&mut parameters);
    let settings = parameters.settings(algorithm, 1.0);
    let circumstances = Circumstances {
        grid: &parameters.grid,
        network: &parameters.network,
        core_rays_per_s: 300e3,
        script,
        deadline: deadline_s.map(Duration::from_secs_f64),
    };
    simulate(&circumstances, &settings, &AllVisible(settings))
}

/// One core that is there from the start and loses nothing to the network.
fn one_core(parameters: &mut Parameters) {
    parameters.grid.machines = 1;
    parameters.grid.cores_per_machine = 1;
    parameters.grid.first_request_s = [0.0, 0.0];
    parameters.network.latency_s = 0.0;
    parameters.network.bandwidth_bytes_per_s = 1e15;
}

/// Percentage of pixels without data, averaged over the buffers that have whole results.
fn open_percent(run: &Run, component: Component, groups: u32) -> f64 {
    let tasks = run
        .results
        .iter()
        .filter(|result| result.whole)
        .map(|result| result.task);
    let tasks: Vec<Task> = tasks.filter(|task| task.component == component).collect();
    let buffers: BTreeSet<u32> = tasks.iter().map(|task| task.index).collect();
    100.0 - 100.0 * tasks.len() as f64 / f64::from(groups * buffers.len() as u32)
}

#[test]
fn with_tasks_done_in_order_table_1_follows_from_the_counts_exactly() {
    for deadline_s in [3.0, 40.0, 80.0, 150.0, 250.0, 300.0] {
        let run = run(
            Algorithm::Component,
            Some(deadline_s),
            &Script::default(),
            one_core,
        );
        let [direct, indirect] = [Component::Direct, Component::Indirect].map(|c| run.completed(c));
        assert!(direct.abs_diff(indirect) <= 1, "{direct} and {indirect} tasks");
        let groups: BTreeSet<u32> = run
            .results
            .iter()
            .filter(|result| result.whole && result.task.component == Component::Direct)
            .map(|result| result.task.group)
            .collect();
        let missing = 100.0 * (64 - groups.len()) as f64 / 64.0;
        assert!(
            (missing - direct_percent(direct)).abs() < 1e-9,
            "direct, {direct} tasks"
        );
        let missing = open_percent(&run, Component::Indirect, 64);
        assert!(
            (missing - indirect_percent(indirect)).abs() < 1e-9,
            "indirect, {indirect} tasks: {missing}"
        );
    }
    let run = run(
        Algorithm::Straightforward,
        Some(100.0),
        &Script::default(),
        one_core,
    );
    let missing = open_percent(&run, Component::Full, 2_048);
    assert!((missing - straightforward_percent(run.completed(Component::Full))).abs() < 1e-9);
}

#[test]
fn the_number_of_tasks_is_what_the_cores_can_do() {
    let run = run(Algorithm::Component, Some(20.0), &Script::default(), one_core);
    // A pair of a direct and an indirect task: 12,288 pixels with 2 and with 17 rays, and overheads.
    // The core's own speed deviates by up to 5 %.
    let rays = 12_288.0 * 19.0 / 300e3;
    let pair_s = rays + 2.0 * (0.02 + 12_288.0 * 4e-6);
    let pairs = (20.0 - 0.15) / pair_s;
    let done = run.completed(Component::Indirect);
    assert!(
        (f64::from(done) - pairs).abs() < 1.0 + 0.05 * pairs,
        "{done} pairs, expected {pairs:.1}"
    );
}

#[test]
fn the_same_circumstances_give_the_same_run_and_another_seed_another() {
    let paper = |seed| {
        run(
            Algorithm::Component,
            Some(5.0),
            &Script::default(),
            |parameters| {
                parameters.grid.seed = seed;
            },
        )
    };
    assert_eq!(paper(1), paper(1));
    assert_ne!(paper(1).results, paper(2).results);
}

#[test]
fn without_a_deadline_every_task_is_done_once() {
    for (algorithm, tasks) in [(Algorithm::Component, 2_048), (Algorithm::Straightforward, 2_048)] {
        let run = run(algorithm, None, &Script::default(), |_| {});
        let distinct: BTreeSet<Task> = run.results.iter().map(|result| result.task).collect();
        assert_eq!((run.results.len(), distinct.len()), (tasks, tasks));
        assert!(matches!(run.closed, Some((_, Closing::WorkDone))));
    }
}

#[test]
fn machines_that_join_bring_their_cores_and_do_more() {
    let few = Script {
        machines: Some(14),
        changes: vec![],
    };
    let growing = Script::growing(14, 24);
    let [few, growing, all] = [&few, &growing, &Script::default()]
        .map(|script| run(Algorithm::Component, Some(10.0), script, |_| {}));
    assert_eq!(growing.cores.first(), Some(&(Duration::ZERO, 56)));
    assert_eq!(growing.cores.last(), Some(&(Duration::from_secs(10), 96)));
    let done = |run: &Run| run.completed_by(Duration::from_secs(10));
    assert!(done(&few) < done(&growing) && done(&growing) < done(&all));
}

#[test]
fn tasks_of_machines_that_leave_are_lost_and_not_done_again() {
    let shrinking = run(
        Algorithm::Component,
        Some(10.0),
        &Script::shrinking(24, 14),
        |_| {},
    );
    assert_eq!(shrinking.cores.last(), Some(&(Duration::from_secs(10), 56)));
    let issued: u32 = shrinking.tallies.values().map(|tally| tally.issued).sum();
    let arrived = shrinking.results.len() as u32;
    // Each of the 36 cores that left before the last second was at work.
    assert!(
        issued - arrived >= 30,
        "{issued} tasks were handed out and {arrived} came back"
    );
    let distinct: BTreeSet<Task> = shrinking.results.iter().map(|result| result.task).collect();
    assert_eq!(distinct.len(), shrinking.results.len());
}

#[test]
fn a_grid_that_dies_leaves_what_it_had_sent() {
    let script = Script {
        machines: None,
        changes: vec![Change {
            at_s: 4.0,
            join: 0,
            leave: 24,
        }],
    };
    let run = run(Algorithm::Straightforward, Some(10.0), &script, |_| {});
    assert!(run.completed_by(Duration::from_secs(4)) > 100);
    assert!(run.completed_by(Duration::from_secs(5)) == run.completed_by(Duration::from_secs(10)));
    assert!(run.closed.is_some());
}

#[test]
fn stopped_tasks_send_a_beginning_and_late_results_do_not_count() {
    let in_time = run(Algorithm::Component, Some(5.0), &Script::default(), |_| {});
    let partial: u32 = in_time.tallies.values().map(|tally| tally.partial).sum();
    assert!(
        partial > 40,
        "{partial} of 96 cores were at work on the last task"
    );
    assert_eq!(in_time.late, 0);

    // All cores send at once, and the link takes longer than Δt to carry that.
    let crowded = run(
        Algorithm::Component,
        Some(5.0),
        &Script::default(),
        |parameters| {
            parameters.network.delta_t_s = 0.01;
        },
    );
    assert!(crowded.late > 20, "{} results were late", crowded.late);
    let deadline = Duration::from_secs(5);
    assert!(crowded.results.iter().all(|result| result.at < deadline));
}

#[test]
fn an_empty_grid_closes_at_the_deadline_with_nothing() {
    let empty = Script {
        machines: Some(0),
        changes: vec![],
    };
    let run = run(Algorithm::Component, Some(2.0), &empty, |_| {});
    assert_eq!(run.closed, Some((Duration::from_secs(2), Closing::CutOff)));
    assert!(run.results.is_empty());
}

fn cornell_box() -> PreparedScene {
    let parameters = Parameters::load(None).unwrap().at_size(ImageSize {
        width: 64,
        height: 48,
    });
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell-box/cornell-box.toml");
    PreparedScene::load(&file, Path::new(""), &parameters).unwrap()
}

#[test]
fn a_picture_of_all_tasks_is_the_same_for_both_algorithms_and_has_no_holes() {
    let scene = cornell_box();
    let [component, straightforward] = [Algorithm::Component, Algorithm::Straightforward]
        .map(|algorithm| scene.frame(algorithm).unwrap().gold().unwrap());
    assert!(component.coverage.indirect_reconstructed_percent.abs() < 1e-9);
    let pairs = component.beauty.iter().zip(&straightforward.beauty);
    let largest = pairs
        .map(|(a, b)| (*a - *b).abs().max_element())
        .fold(0.0, f32::max);
    assert!(largest < 1e-4, "the algorithms differ by {largest}");
}

#[test]
fn a_picture_of_beginnings_has_as_many_pixels_as_they_have() {
    let scene = cornell_box();
    let frame = scene.frame(Algorithm::Straightforward).unwrap();
    let [first, second, ..] = *frame.order() else {
        panic!("two tasks at least");
    };
    let picture = frame
        .picture([(first, frame.pixels(first)), (second, 0)])
        .unwrap();
    let known = picture
        .samples_direct
        .iter()
        .filter(|&&samples| samples > 0)
        .count();
    assert_eq!(known as u32, frame.pixels(first));
}

/// Groups must be large enough to be cut into chunks, whose order depends on the rays of a pixel.
#[test]
fn passes_of_several_light_points_give_both_algorithms_the_same_picture() {
    let mut parameters = Parameters::load(None).unwrap();
    parameters = parameters.at_size(ImageSize {
        width: 384,
        height: 288,
    });
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let file = root.join("scenes/cornell-box/cornell-box.toml");
    let scene = PreparedScene::load(&file, &root, &parameters).unwrap();
    let [component, straightforward] = [Algorithm::Component, Algorithm::Straightforward].map(|algorithm| {
        scene
            .frame_with_points_per_pass(algorithm, 16)
            .unwrap()
            .gold()
            .unwrap()
    });
    let pairs = component.beauty.iter().zip(&straightforward.beauty);
    let different = pairs.filter(|(a, b)| (**a - **b).abs().max_element() > 0.01);
    let count = different.count();
    assert!(count < 10, "{count} pixels differ");
}
