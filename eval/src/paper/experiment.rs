//! Renders every row of the paper's tables, twice: as the virtual grid would have it, and with exactly
//! the paper's own numbers of tasks.

use std::{path::Path, time::Duration};

use rayon::prelude::*;
use render::{
    image::{Picture, display_code},
    settings::Algorithm,
    task::{Component, Task},
};

use super::{
    arithmetic::{direct_percent, indirect_percent, straightforward_percent},
    judge::{Scores, judge, linear, vdp_from},
    published::{ROWS, Row},
};
use crate::{
    grid::{
        frame::{PreparedScene, VirtualFrame},
        parameters::{Parameters, SceneParameters},
        script::Script,
        simulate::{Circumstances, Run, simulate},
    },
    image::ImageRgb,
    metrics::vdp,
};

/// Both algorithms, in the paper's order.
pub const ALGORITHMS: [Algorithm; 2] = [Algorithm::Component, Algorithm::Straightforward];
/// The scene and deadline of section 4.2.
const FAULTS: (&str, u32) = ("Conference Room", 10);
/// Machines at the two ends of the runs of section 4.2.
const FAULT_MACHINES: [u32; 2] = [14, 24];

/// More than the sums of two algorithms differ in f32, and less than a shadow ray.
const ROUNDING: f32 = 1e-5;
/// Points of the lights in each pass of the variation that spreads them over all lamps: the Conference
/// Room has 24, and a Sobol sequence is even over powers of two.
const POINTS_PER_PASS: u32 = 32;

/// The variation in which each pass of direct light sees all lamps.
pub const ALL_LAMPS: &str = "32 light points on all lamps in each pass";
/// The variation in which the component-based algorithm has done all direct tasks.
pub const ALL_DIRECT: &str = "all direct tasks of component-based";
/// The variation in which the component-based algorithm has done all indirect tasks.
pub const ALL_INDIRECT: &str = "all indirect tasks of component-based";

/// What is to be done.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The grid, at the size of the pictures.
    pub parameters: Parameters,
    /// Which rows of the paper.
    pub rows: Vec<Row>,
    /// Further deadlines for the curves of each scene, seconds.
    pub curve_s: Vec<u32>,
}

impl Plan {
    /// Every row, and curves.
    pub fn full(parameters: Parameters) -> Self {
        Self {
            parameters,
            rows: ROWS.to_vec(),
            curve_s: (1..=10).collect(),
        }
    }

    /// The shortest and the longest deadline of each scene.
    pub fn quick(parameters: Parameters) -> Self {
        let at_an_end = |row: &Row| {
            let of_scene = || ROWS.iter().filter(|other| other.scene == row.scene);
            let deadlines = || of_scene().map(|row| row.deadline_s);
            [deadlines().min(), deadlines().max()].contains(&Some(row.deadline_s))
        };
        Self {
            parameters,
            rows: ROWS.into_iter().filter(at_an_end).collect(),
            curve_s: Vec::new(),
        }
    }
}

/// An 8-bit sRGB picture for people.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `[height][width]`.
    pub codes: Vec<[u8; 3]>,
}

/// One algorithm in one row.
#[derive(Debug, Clone)]
pub struct Attempt {
    /// Whole tasks: direct and indirect, or those of the straightforward algorithm and 0.
    pub tasks: [u32; 2],
    /// Results that were stopped half-way.
    pub partial: u32,
    /// Reconstructed pixels of direct and indirect light, percent, with what stopped tasks had done.
    pub reconstructed_percent: [f64; 2],
    /// The same by Table 1's arithmetic from `tasks`.
    pub formula_percent: [f64; 2],
    /// Distance from the gold picture.
    pub scores: Scores,
    /// The picture.
    pub shown: Shown,
    /// Where differences are seen.
    pub map: Shown,
}

/// Both algorithms in one row, as the grid has it and with the paper's numbers of tasks.
#[derive(Debug, Clone)]
pub struct RowResult {
    /// What the paper has.
    pub published: Row,
    /// On the virtual grid.
    pub grid: [Attempt; 2],
    /// With the paper's numbers of whole tasks.
    pub counts: [Attempt; 2],
}

/// The error at one deadline.
#[derive(Debug, Clone, Copy)]
pub struct CurvePoint {
    /// Seconds.
    pub deadline_s: u32,
    /// Of each algorithm.
    pub scores: [Scores; 2],
}

/// A run of section 4.2.
#[derive(Debug, Clone)]
pub struct FaultRun {
    /// For people.
    pub name: &'static str,
    /// What came of it.
    pub attempt: Attempt,
    /// How it went.
    pub run: Run,
    /// VDP(P > 75 %), slope 1.0, percent, if all direct tasks had been done.
    pub all_direct_vdp: f64,
    /// VDP(P > 75 %), slope 1.0, percent, if each pass of direct light saw all lamps.
    pub all_lamps_vdp: f64,
}

/// VDP in each row with the paper's numbers of tasks, when one thing is different.
#[derive(Debug, Clone)]
pub struct Variation {
    /// What is different.
    pub name: &'static str,
    /// Of both algorithms in each row.
    pub vdp: Vec<[f64; 2]>,
}

/// All results of one scene.
#[derive(Debug, Clone)]
pub struct SceneResult {
    /// The scene.
    pub scene: SceneParameters,
    /// The picture without a deadline.
    pub gold: Shown,
    /// Largest difference between the two algorithms' gold pictures, as linear light, and the pixels
    /// that differ by more than rounding.
    pub gold_difference: (f32, usize),
    /// Simulated time of the full workload for each algorithm.
    pub full_workload: [Duration; 2],
    /// Rows of the tables.
    pub rows: Vec<RowResult>,
    /// What the result would be if one thing were different.
    pub variations: Vec<Variation>,
    /// Error over deadline.
    pub curve: Vec<CurvePoint>,
    /// The runs of section 4.2, the one without changes first; none in most scenes.
    pub faults: Vec<FaultRun>,
}

/// Does everything for one scene; `tell` hears of each step.
///
/// # Errors
/// If the scene cannot be loaded.
pub fn run_scene(
    plan: &Plan,
    scene: &SceneParameters,
    file: &Path,
    scenes_dir: &Path,
    tell: &(dyn Fn(&str) + Sync),
) -> anyhow::Result<SceneResult> {
    let prepared = PreparedScene::load(file, scenes_dir, &plan.parameters)?;
    let [component, straightforward] = ALGORITHMS.map(|algorithm| prepared.frame(algorithm));
    let frames = [component?, straightforward?];
    tell("rendering the full workload of both algorithms");
    let gold = frames[0].gold()?;
    let other_gold = frames[1].gold()?;
    let laboratory = Laboratory {
        plan,
        scene,
        frames,
        gold: linear(&gold),
    };

    tell("rendering and judging the rows");
    let published: Vec<Row> = plan
        .rows
        .iter()
        .copied()
        .filter(|row| row.scene == scene.name)
        .collect();
    let rows = (published.par_iter())
        .map(|&row| laboratory.row(row))
        .collect::<anyhow::Result<Vec<_>>>()?;
    tell("what would be if one thing were different");
    let all_lamps =
        laboratory
            .with([0, 1].map(|algorithm| {
                prepared.frame_with_points_per_pass(ALGORITHMS[algorithm], POINTS_PER_PASS)
            }))?;
    let per_pixel = laboratory
        .with([0, 1].map(|algorithm| prepared.frame_with_points_per_pixel(ALGORITHMS[algorithm])))?;
    let variations = variations(&laboratory, &all_lamps, &per_pixel, &published)?;
    drop(per_pixel);
    tell("the error over the deadline");
    let curve = laboratory.curve(&rows)?;
    let faults = if rows
        .iter()
        .any(|row| (row.published.scene, row.published.deadline_s) == FAULTS)
    {
        tell("the runs with machines that come and go");
        laboratory.faults(&all_lamps)?
    } else {
        Vec::new()
    };
    Ok(SceneResult {
        scene: scene.clone(),
        gold: laboratory.shown(&gold),
        gold_difference: difference(&gold, &other_gold),
        full_workload: [0, 1].map(|algorithm| laboratory.full_workload(algorithm)),
        rows,
        variations,
        curve,
        faults,
    })
}

/// What the paper does not say, or what this renderer may do unlike theirs.
fn variations(
    laboratory: &Laboratory<'_>,
    all_lamps: &Laboratory<'_>,
    per_pixel: &Laboratory<'_>,
    rows: &[Row],
) -> anyhow::Result<Vec<Variation>> {
    let default = vdp::Viewing::default().distance;
    let variation = |name, laboratory: &Laboratory<'_>, distance, tasks| {
        anyhow::Ok(Variation {
            name,
            vdp: laboratory.vdp_of_counts(rows, distance, tasks)?,
        })
    };
    Ok(vec![
        variation("from 1 m instead of 0.5 m", laboratory, 2.0 * default, tasks_of)?,
        variation("other light points for each pixel", per_pixel, default, tasks_of)?,
        variation(ALL_LAMPS, all_lamps, default, tasks_of)?,
        variation(ALL_DIRECT, laboratory, default, all_direct)?,
        variation(ALL_INDIRECT, laboratory, default, all_indirect)?,
    ])
}

/// One scene with everything that its experiments share.
struct Laboratory<'a> {
    plan: &'a Plan,
    scene: &'a SceneParameters,
    /// As [`ALGORITHMS`].
    frames: [VirtualFrame<'a>; 2],
    gold: ImageRgb,
}

impl<'a> Laboratory<'a> {
    /// The same with other frames, and with their own gold picture.
    fn with(&self, frames: [anyhow::Result<VirtualFrame<'a>>; 2]) -> anyhow::Result<Self> {
        let [component, straightforward] = frames;
        let frames = [component?, straightforward?];
        Ok(Self {
            plan: self.plan,
            scene: self.scene,
            gold: linear(&frames[0].gold()?),
            frames,
        })
    }

    fn row(&self, row: Row) -> anyhow::Result<RowResult> {
        let deadline = Duration::from_secs(row.deadline_s.into());
        let grid = |algorithm| {
            let run = self.simulate(algorithm, Some(deadline), &Script::default());
            self.attempt_of_run(algorithm, &run)
        };
        Ok(RowResult {
            published: row,
            grid: [grid(0)?, grid(1)?],
            counts: [
                self.attempt_of_counts(0, tasks_of(&row)[0])?,
                self.attempt_of_counts(1, tasks_of(&row)[1])?,
            ],
        })
    }

    /// `algorithm` is a place in [`ALGORITHMS`].
    fn simulate(&self, algorithm: usize, deadline: Option<Duration>, script: &Script) -> Run {
        let frame = &self.frames[algorithm];
        let circumstances = Circumstances {
            grid: &self.plan.parameters.grid,
            network: &self.plan.parameters.network,
            core_rays_per_s: self.scene.core_rays_per_s,
            script,
            deadline,
        };
        simulate(&circumstances, frame.settings(), frame)
    }

    fn attempt_of_run(&self, algorithm: usize, run: &Run) -> anyhow::Result<Attempt> {
        let picture = self.frames[algorithm].picture(results_of(run))?;
        let tasks = match ALGORITHMS[algorithm] {
            Algorithm::Component | Algorithm::Progressive => {
                [Component::Direct, Component::Indirect].map(|c| run.completed(c))
            }
            Algorithm::Straightforward => [run.completed(Component::Full), 0],
        };
        let partial = run.tallies.values().map(|tally| tally.partial).sum();
        self.attempt(algorithm, tasks, partial, &picture)
    }

    fn attempt_of_counts(&self, algorithm: usize, tasks: [u32; 2]) -> anyhow::Result<Attempt> {
        let picture = self.picture_of_counts(algorithm, tasks)?;
        self.attempt(algorithm, tasks, 0, &picture)
    }

    /// The first tasks of each queue, all of them whole.
    fn picture_of_counts(&self, algorithm: usize, tasks: [u32; 2]) -> anyhow::Result<Picture> {
        let frame = &self.frames[algorithm];
        let of = |component: Component, count: u32| {
            let queue = frame.order().iter().copied();
            queue
                .filter(move |task: &Task| task.component == component)
                .take(count as usize)
        };
        let first = match ALGORITHMS[algorithm] {
            Algorithm::Component | Algorithm::Progressive => Component::Direct,
            Algorithm::Straightforward => Component::Full,
        };
        let done = of(first, tasks[0]).chain(of(Component::Indirect, tasks[1]));
        frame.picture(done.map(|task| (task, frame.pixels(task))))
    }

    /// VDP with so many tasks, in each row, from a distance in metres.
    fn vdp_of_counts(&self, rows: &[Row], distance: f64, tasks: Tasks) -> anyhow::Result<Vec<[f64; 2]>> {
        let vdp = |row: &Row| {
            let of = |algorithm: usize| {
                let picture = self.picture_of_counts(algorithm, tasks(row)[algorithm])?;
                vdp_from(distance, &self.gold, &linear(&picture), self.scene.exposure_stops)
            };
            Ok([of(0)?, of(1)?])
        };
        rows.par_iter().map(vdp).collect()
    }

    fn attempt(
        &self,
        algorithm: usize,
        tasks: [u32; 2],
        partial: u32,
        picture: &Picture,
    ) -> anyhow::Result<Attempt> {
        let judgement = judge(&self.gold, &linear(picture), self.scene.exposure_stops)?;
        let coverage = picture.coverage;
        Ok(Attempt {
            tasks,
            partial,
            reconstructed_percent: [
                coverage.direct_reconstructed_percent,
                coverage.indirect_reconstructed_percent,
            ],
            formula_percent: match ALGORITHMS[algorithm] {
                Algorithm::Component | Algorithm::Progressive => {
                    [direct_percent(tasks[0]), indirect_percent(tasks[1])]
                }
                Algorithm::Straightforward => [straightforward_percent(tasks[0]); 2],
            },
            scores: judgement.scores,
            shown: self.shown(picture),
            map: Shown {
                codes: judgement.map,
                width: picture.size.width,
                height: picture.size.height,
            },
        })
    }

    fn curve(&self, rows: &[RowResult]) -> anyhow::Result<Vec<CurvePoint>> {
        let known = |deadline_s| rows.iter().find(|row| row.published.deadline_s == deadline_s);
        let point = |&deadline_s: &u32| {
            let scores = |algorithm: usize| {
                if let Some(row) = known(deadline_s) {
                    return anyhow::Ok(row.grid[algorithm].scores);
                }
                let deadline = Duration::from_secs(deadline_s.into());
                let run = self.simulate(algorithm, Some(deadline), &Script::default());
                Ok(self.attempt_of_run(algorithm, &run)?.scores)
            };
            Ok(CurvePoint {
                deadline_s,
                scores: [scores(0)?, scores(1)?],
            })
        };
        self.plan.curve_s.par_iter().map(point).collect()
    }

    /// Section 4.2: "the component-based algorithm was used for these results".
    fn faults(&self, all_lamps: &Self) -> anyhow::Result<Vec<FaultRun>> {
        let [few, many] = FAULT_MACHINES;
        let runs = [
            ("24 machines throughout", Script::default()),
            ("14 growing to 24", Script::growing(few, many)),
            ("24 shrinking to 14", Script::shrinking(many, few)),
        ];
        runs.into_par_iter()
            .map(|(name, script)| {
                let deadline = Duration::from_secs(FAULTS.1.into());
                let run = self.simulate(0, Some(deadline), &script);
                Ok(FaultRun {
                    name,
                    attempt: self.attempt_of_run(0, &run)?,
                    all_direct_vdp: self.vdp_of_picture(&self.picture_with_all_direct(&run)?)?,
                    all_lamps_vdp: all_lamps
                        .vdp_of_picture(&all_lamps.frames[0].picture(results_of(&run))?)?,
                    run,
                })
            })
            .collect()
    }

    /// What a run of the component-based algorithm has done, and all direct tasks besides.
    fn picture_with_all_direct(&self, run: &Run) -> anyhow::Result<Picture> {
        let frame = &self.frames[0];
        let all = frame.order().iter().copied();
        let direct = all.filter(|task| task.component == Component::Direct);
        let indirect = results_of(run).filter(|(task, _)| task.component == Component::Indirect);
        frame.picture(direct.map(|task| (task, frame.pixels(task))).chain(indirect))
    }

    fn vdp_of_picture(&self, picture: &Picture) -> anyhow::Result<f64> {
        let distance = vdp::Viewing::default().distance;
        vdp_from(distance, &self.gold, &linear(picture), self.scene.exposure_stops)
    }

    fn full_workload(&self, algorithm: usize) -> Duration {
        let run = self.simulate(algorithm, None, &Script::default());
        run.closed.map_or(Duration::ZERO, |(at, _)| at)
    }

    fn shown(&self, picture: &Picture) -> Shown {
        let gain = self.scene.exposure_stops.exp2() as f32;
        Shown {
            width: picture.size.width,
            height: picture.size.height,
            codes: picture
                .beauty
                .iter()
                .map(|&light| display_code(gain * light))
                .collect(),
        }
    }
}

/// Numbers of tasks for each algorithm: direct and indirect, or those of the straightforward one and 0.
type Tasks = fn(&Row) -> [[u32; 2]; 2];

/// The results of a run, with the pixels that each has.
fn results_of(run: &Run) -> impl Iterator<Item = (Task, u32)> {
    run.results.iter().map(|result| (result.task, result.pixels))
}

/// The paper's numbers of tasks, but for direct ones, of which all are done.
fn all_direct(row: &Row) -> [[u32; 2]; 2] {
    let [[_, indirect], straightforward] = tasks_of(row);
    [[u32::MAX, indirect], straightforward]
}

/// The paper's numbers of tasks, but for indirect ones, of which all are done.
fn all_indirect(row: &Row) -> [[u32; 2]; 2] {
    let [[direct, _], straightforward] = tasks_of(row);
    [[direct, u32::MAX], straightforward]
}

/// The paper's numbers of tasks for each algorithm.
fn tasks_of(row: &Row) -> [[u32; 2]; 2] {
    [
        [row.direct_tasks, row.indirect_tasks],
        [row.straightforward_tasks, 0],
    ]
}

/// The largest difference of two pictures, and the pixels that differ by more than rounding.
fn difference(a: &Picture, b: &Picture) -> (f32, usize) {
    let pairs = a.beauty.iter().zip(&b.beauty);
    let differences = pairs.map(|(a, b)| (*a - *b).abs().max_element());
    differences.fold((0.0, 0), |(largest, count), difference| {
        (
            largest.max(difference),
            count + usize::from(difference > ROUNDING),
        )
    })
}
