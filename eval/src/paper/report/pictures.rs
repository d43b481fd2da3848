//! Figures 2 to 4, error over deadline, and the runs of section 4.2.

use render::settings::Algorithm;

use super::{algorithm_name, rows};
use crate::paper::{
    document::{Block, Figure, Table},
    experiment::{ALGORITHMS, SceneResult},
    figures::{Part, part, whole},
    judge::{FLIP, METRICS, VDP},
    plot::{Plot, Series},
    published::{GROWING_VDP, SHRINKING_VDP},
};

/// Width of the figures in pixels.
const FIGURE_WIDTH: u32 = 512;
/// Scene and deadline of figure 3; its caption says 10 s, the text that refers to it 5 s.
const FIGURE_3: (&str, u32) = ("Sibenik", 5);
/// Scene and deadline of figure 4.
const FIGURE_4: (&str, u32) = ("Cornell Box", 2);
/// The part of the Cornell box in figure 4: the bunny's head, wall and shadow.
const FIGURE_4_PART: Part = Part {
    x: 0.38,
    y: 0.42,
    side: 0.3,
};

pub(super) fn figures(scenes: &[SceneResult]) -> anyhow::Result<Vec<Block>> {
    let mut blocks = Vec::new();
    let golds = scenes.iter().map(|scene| {
        anyhow::Ok(Figure {
            file: format!("figure-2-{}.jpg", file_name(&scene.scene.name)),
            caption: format!("Figure 2. {}: the picture without a deadline.", scene.scene.name),
            bytes: whole(&scene.gold, FIGURE_WIDTH)?,
        })
    });
    blocks.push(Block::Figures(golds.collect::<anyhow::Result<_>>()?));

    // Both at the paper's counts, so that nothing depends on the grid's parameters.
    let find = |(name, deadline_s)| {
        rows(scenes)
            .find(move |(scene, row)| scene.scene.name == name && row.published.deadline_s == deadline_s)
    };
    if let Some((_, row)) = find(FIGURE_3) {
        let mut figures = Vec::new();
        for (algorithm, attempt) in ALGORITHMS.into_iter().zip(&row.counts) {
            let name = algorithm_name(algorithm);
            figures.push(Figure {
                file: format!("figure-3-{name}.jpg"),
                caption: format!("Figure 3. Sibenik, {name}, at the paper's counts for 5 s."),
                bytes: whole(&attempt.shown, FIGURE_WIDTH)?,
            });
            figures.push(Figure {
                file: format!("figure-3-{name}-vdp.jpg"),
                caption: format!(
                    "Its differences: grey none perceivable, green low and red high probability. \
                     VDP(P > 75 %) = {:.2} % (the paper: {:.2} %).",
                    attempt.scores.0[VDP],
                    [row.published.component_vdp, row.published.straightforward_vdp]
                        [usize::from(algorithm == Algorithm::Straightforward)]
                ),
                bytes: whole(&attempt.map, FIGURE_WIDTH)?,
            });
        }
        let straightforward = figures.split_off(2);
        blocks.push(Block::Figures(figures));
        blocks.push(Block::Figures(straightforward));
    }
    if let Some((scene, row)) = find(FIGURE_4) {
        let gold = Figure {
            file: "figure-4-gold.jpg".into(),
            caption: "Figure 4. A part of the Cornell Box without a deadline.".into(),
            bytes: part(&scene.gold, FIGURE_4_PART, FIGURE_WIDTH)?,
        };
        let mut figures = vec![gold];
        for (algorithm, attempt) in ALGORITHMS.into_iter().zip(&row.counts) {
            let name = algorithm_name(algorithm);
            let [vdp, flip] = [VDP, FLIP].map(|metric| METRICS[metric].format(attempt.scores.0[metric]));
            figures.push(Figure {
                file: format!("figure-4-{name}.jpg"),
                caption: format!(
                    "The same part, {name}, at the paper's counts for 2 s: VDP {vdp} %, FLIP {flip}."
                ),
                bytes: part(&attempt.shown, FIGURE_4_PART, FIGURE_WIDTH)?,
            });
        }
        blocks.push(Block::Figures(figures));
    }
    Ok(blocks)
}

pub(super) fn curves(scene: &SceneResult) -> Vec<Figure> {
    if scene.curve.is_empty() {
        return Vec::new();
    }
    let lines = |metric: usize| {
        ALGORITHMS
            .into_iter()
            .enumerate()
            .map(move |(place, algorithm)| Series {
                name: algorithm_name(algorithm).to_owned(),
                style: place,
                points_only: false,
                points: (scene.curve.iter())
                    .map(|point| (f64::from(point.deadline_s), point.scores[place].0[metric]))
                    .collect(),
            })
    };
    let published = [0, 1].map(|algorithm| Series {
        name: format!("paper, {}", algorithm_name(ALGORITHMS[algorithm])),
        style: algorithm,
        points_only: true,
        points: (scene.rows.iter().map(|row| row.published))
            .map(|row| {
                let vdp = [row.component_vdp, row.straightforward_vdp][algorithm];
                (f64::from(row.deadline_s), vdp)
            })
            .collect(),
    });
    let plot = |title: &str, short: &str, series: Vec<Series>| Figure {
        file: format!("curve-{}-{short}.svg", file_name(&scene.scene.name)),
        caption: format!(
            "{}: {title} over the deadline, on the virtual grid.",
            scene.scene.name
        ),
        bytes: Plot {
            title: format!("{}: {title}", scene.scene.name),
            x_label: "deadline, seconds",
            series,
        }
        .to_svg()
        .into_bytes(),
    };
    vec![
        plot("VDP(P > 75 %), %", "vdp", lines(VDP).chain(published).collect()),
        plot("mean FLIP", "flip", lines(FLIP).collect()),
    ]
}

pub(super) fn faults(scene: &SceneResult) -> Vec<Block> {
    let published = [9.55, GROWING_VDP, SHRINKING_VDP];
    let mut header = ["Run", "Tasks", "VDP, paper"].map(str::to_owned).to_vec();
    header.extend(METRICS.map(|metric| metric.name.to_owned()));
    let rows = scene.faults.iter().zip(published).map(|(run, published)| {
        let attempt = &run.attempt;
        let mut cells = vec![
            run.name.to_owned(),
            format!("{} + {}", attempt.tasks[0], attempt.tasks[1]),
            format!("{published:.2}"),
        ];
        cells.extend(attempt.scores.cells());
        cells
    });
    let table = Table {
        caption: format!("{}, 10 s, component-based", scene.scene.name),
        header,
        rows: rows.collect(),
    };
    let tenths = || (0..=100).map(|tenth| f64::from(tenth) / 10.0);
    let series = |values: &dyn Fn(usize, f64) -> f64| {
        (scene.faults.iter().enumerate())
            .map(|(place, run)| Series {
                name: run.name.to_owned(),
                style: place,
                points_only: false,
                points: tenths().map(|second| (second, values(place, second))).collect(),
            })
            .collect::<Vec<_>>()
    };
    let time = std::time::Duration::from_secs_f64;
    let tasks = series(&|place, second| scene.faults[place].run.completed_by(time(second)).into());
    let cores = series(&|place, second| {
        let cores = scene.faults[place].run.cores.iter();
        let now = cores.take_while(|(at, _)| *at <= time(second)).last();
        now.map_or(0.0, |&(_, cores)| cores.into())
    });
    let plot = |title: &str, file: &str, series: Vec<Series>| Figure {
        file: format!("{file}.svg"),
        caption: format!("{title}, over time, in the runs of section 4.2."),
        bytes: Plot {
            title: title.to_owned(),
            x_label: "seconds",
            series,
        }
        .to_svg()
        .into_bytes(),
    };
    vec![
        Block::Table(table),
        Block::Figures(vec![
            plot("Tasks completed", "faults-tasks", tasks),
            plot("Cores", "faults-cores", cores),
        ]),
    ]
}

fn file_name(scene: &str) -> String {
    scene.to_lowercase().replace(' ', "-")
}
