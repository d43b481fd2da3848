//! The page: tables, figures and claims, from the results.

use render::settings::Algorithm;

use super::{
    claims::{CLAIMS, Source, Verdict},
    document::{Block, Document, Figure, Table},
    experiment::{ALGORITHMS, Attempt, RowResult, SceneResult},
    figures::{Part, part, whole},
    judge::{FLIP, METRICS, VDP},
    plot::{Plot, Series},
    published::{GROWING_VDP, ROWS, SHRINKING_VDP},
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

/// What the page says besides the results.
#[derive(Debug, Clone, Copy)]
pub struct Circumstances<'a> {
    /// The command that makes the page.
    pub command: &'a str,
    /// Size of the pictures.
    pub size: (u32, u32),
    /// Scenes that could not be found.
    pub missing: &'a [String],
}

/// Makes the page.
///
/// # Errors
/// If a figure cannot be encoded.
pub fn report(scenes: &[SceneResult], circumstances: &Circumstances<'_>) -> anyhow::Result<Document> {
    let mut blocks = introduction(scenes, circumstances);
    blocks.push(Block::Heading(
        "What the paper claims, and what holds here".into(),
    ));
    blocks.extend(claims(scenes));
    blocks.push(Block::Heading(
        "Table 1: tasks completed and pixels reconstructed".into(),
    ));
    blocks.extend(table_1(scenes));
    blocks.push(Block::Heading("Table 2: VDP(P > 75 %)".into()));
    blocks.extend(table_2(scenes));
    blocks.push(Block::Heading("Every metric, every setting".into()));
    blocks.extend(scenes.iter().map(|scene| Block::Table(all_metrics(scene))));
    blocks.push(Block::Heading("Figures 2 to 4".into()));
    blocks.extend(figures(scenes)?);
    if scenes.iter().any(|scene| !scene.curve.is_empty()) {
        blocks.push(Block::Heading("Error over deadline".into()));
        blocks.push(Block::Figures(scenes.iter().flat_map(curves).collect()));
    }
    if let Some(scene) = scenes.iter().find(|scene| !scene.faults.is_empty()) {
        blocks.push(Block::Heading("Machines that come and go (section 4.2)".into()));
        blocks.extend(faults(scene));
    }
    Ok(Document {
        title: "The paper's results, reproduced".into(),
        blocks,
    })
}

fn introduction(scenes: &[SceneResult], circumstances: &Circumstances<'_>) -> Vec<Block> {
    let Circumstances {
        command,
        size: (width, height),
        missing,
    } = circumstances;
    let mut blocks = vec![
        Block::Text(
            "Aggarwal, Debattista, Dubla, Bashford-Rogers and Chalmers, “Time-constrained High-fidelity \
             Rendering on Local Desktop Grids”, compare two ways to divide a frame into tasks. Here are \
             their tables and figures beside ours."
                .into(),
        ),
        Block::Text(format!(
            "Made by `{command}`, at {width} × {height} pixels. The same command gives the same page."
        )),
        Block::Text(
            "Two kinds of runs stand side by side. On the virtual grid the real scheduler hands out real \
             tasks, but time is simulated: 24 machines with 4 cores of 2009 each; all its parameters and \
             their derivation are in `eval/paper.toml`. One number per scene, the speed of a core, is fitted \
             to one row of Table 1; the other rows are predictions. With the paper's counts, no grid is \
             simulated: the first tasks of each queue, as many as the paper reports, make the picture."
                .into(),
        ),
        Block::Text(
            "VDP(P > 75 %) is the percentage of pixels that are seen as different from the picture without \
             a deadline with more than 75 % probability. Its slope of masking is not settled in the \
             literature; the default is 1.0, and all published settings are below."
                .into(),
        ),
    ];
    if !missing.is_empty() {
        blocks.push(Block::Text(format!(
            "Not on this page, since their files were not found: {}.",
            missing.join(", ")
        )));
    }
    let golds = scenes.iter().map(|scene| {
        let [component, straightforward] = scene.full_workload.map(|time| time.as_secs_f64());
        format!(
            "{}: the full workload takes {component:.2} s component-based and {straightforward:.2} s \
             straightforward on the virtual grid (the paper: “almost the same”); the two gold pictures \
             differ by at most {:.0e} in linear light.",
            scene.scene.name, scene.gold_difference
        )
    });
    blocks.push(Block::List(golds.collect()));
    blocks
}

fn claims(scenes: &[SceneResult]) -> Vec<Block> {
    let table = |source: Source, caption: &str| {
        let mut header = vec!["Claim".to_owned()];
        if source == Source::Grid {
            header.push("The paper's numbers".into());
        }
        header.extend(METRICS.map(|metric| metric.name.to_owned()));
        let cell = |verdict: Option<Verdict>| match verdict {
            None => "–".to_owned(),
            Some(Verdict { holds: true, figure }) => format!("yes, {figure}"),
            Some(Verdict { holds: false, figure }) => format!("no, {figure}"),
        };
        let rows = CLAIMS.into_iter().map(|claim| {
            let mut row = vec![claim.text().to_owned()];
            if source == Source::Grid {
                row.push(cell(claim.weigh(scenes, Source::Paper, VDP)));
            }
            row.extend((0..METRICS.len()).map(|metric| cell(claim.weigh(scenes, source, metric))));
            row
        });
        Block::Table(Table {
            caption: caption.to_owned(),
            header,
            rows: rows
                .filter(|row| row[1..].iter().any(|cell| cell != "–"))
                .collect(),
        })
    };
    vec![
        table(Source::Grid, "On the virtual grid"),
        table(Source::Counts, "With the paper's counts of tasks"),
    ]
}

fn rows(scenes: &[SceneResult]) -> impl Iterator<Item = (&SceneResult, &RowResult)> {
    scenes
        .iter()
        .flat_map(|scene| scene.rows.iter().map(move |row| (scene, row)))
}

fn name(row: &RowResult) -> String {
    format!("{}, {} s", row.published.scene, row.published.deadline_s)
}

fn table_1(scenes: &[SceneResult]) -> Vec<Block> {
    let component = rows(scenes).map(|(scene, row)| {
        let (paper, ours) = (&row.published, &row.grid[0]);
        let total = |[direct, indirect]: [u32; 2]| f64::from(direct + indirect);
        vec![
            name(row),
            format!("{} + {}", paper.direct_tasks, paper.indirect_tasks),
            format!("{} + {}", ours.tasks[0], ours.tasks[1]),
            ratio(
                total(ours.tasks),
                total([paper.direct_tasks, paper.indirect_tasks]),
            ),
            format!("{:.2}, {:.2}", paper.direct_percent, paper.indirect_percent),
            percent_pair(ours.formula_percent),
            percent_pair(ours.reconstructed_percent),
            percent_pair(row.counts[0].reconstructed_percent),
            component_comment(scene, row),
        ]
    });
    let straightforward = rows(scenes).map(|(_, row)| {
        let (paper, ours) = (&row.published, &row.grid[1]);
        vec![
            name(row),
            paper.straightforward_tasks.to_string(),
            ours.tasks[0].to_string(),
            ratio(ours.tasks[0].into(), paper.straightforward_tasks.into()),
            format!("{:.2}", paper.straightforward_percent),
            format!("{:.2}", ours.formula_percent[0]),
            format!("{:.2}", ours.reconstructed_percent[0]),
            format!("{:.2}", row.counts[1].reconstructed_percent[0]),
            agreement(
                row.counts[1].reconstructed_percent[0],
                paper.straightforward_percent,
            ),
        ]
    });
    let header = [
        "Row",
        "Tasks, paper",
        "Tasks, grid",
        "Ratio",
        "Reconstructed %, paper",
        "by formula from the grid's tasks",
        "measured on the grid",
        "measured with the paper's counts",
        "Comment",
    ];
    let table = |caption: &str, rows: Vec<Vec<String>>| {
        Block::Table(Table {
            caption: caption.to_owned(),
            header: header.map(str::to_owned).to_vec(),
            rows,
        })
    };
    vec![
        table(
            "Component-based: direct + indirect tasks; reconstructed pixels of direct, indirect light",
            component.collect(),
        ),
        table("Straightforward", straightforward.collect()),
        Block::Text(
            "The formulas: straightforward (2048 − n) / 2048; direct (64 − n) / 64, and 0 from 64 tasks on; \
             indirect with n up to 512 tasks (64 b − n) / (64 b) with b = ⌈n / 32⌉ open buffers, above that \
             (1024 − n) / 1024. What is measured on the grid is less, since workers send what they have of \
             a task when time is up, and may be more where a task in the middle of the queue was not done."
                .into(),
        ),
        Block::Text(check_formulas(scenes)),
    ]
}

/// With the paper's counts nothing is half done, so that measured and computed percentages must agree.
fn check_formulas(scenes: &[SceneResult]) -> String {
    let attempts = || rows(scenes).flat_map(|(_, row)| &row.counts);
    let difference = |attempt: &Attempt| {
        let [a, b] = [0, 1].map(|c| (attempt.reconstructed_percent[c] - attempt.formula_percent[c]).abs());
        a.max(b)
    };
    let largest = attempts().map(difference).fold(0.0, f64::max);
    format!(
        "Check: with the paper's counts, the percentages measured in our buffers differ from the formulas by \
         at most {largest:.3} in {} cases.",
        attempts().count()
    )
}

fn component_comment(scene: &SceneResult, row: &RowResult) -> String {
    let longest = ROWS.iter().filter(|other| other.scene == row.published.scene);
    let is_calibration = longest.map(|row| row.deadline_s).max() == Some(row.published.deadline_s);
    let mut comments = Vec::new();
    if is_calibration {
        comments.push(format!(
            "a core's speed of {:.0} rays/s is fitted to this row",
            scene.scene.core_rays_per_s
        ));
    }
    comments.push(agreement(
        row.counts[0].reconstructed_percent[1],
        row.published.indirect_percent,
    ));
    comments.join("; ")
}

fn agreement(ours: f64, theirs: f64) -> String {
    let difference = (ours - theirs).abs();
    if difference < 0.06 {
        "with the paper's counts the same percentage".into()
    } else if difference < 1.0 {
        format!(
            "with the paper's counts {difference:.2} off, as if a task or two were missing from its count"
        )
    } else {
        format!("the paper's percentage cannot come from its count, which gives {ours:.2} %")
    }
}

fn table_2(scenes: &[SceneResult]) -> Vec<Block> {
    let vdp = |attempt: &Attempt| attempt.scores.0[VDP];
    let table = rows(scenes).map(|(_, row)| {
        let paper = [row.published.component_vdp, row.published.straightforward_vdp];
        let grid = [0, 1].map(|algorithm| vdp(&row.grid[algorithm]));
        let counts = [0, 1].map(|algorithm| vdp(&row.counts[algorithm]));
        let mut cells = vec![name(row)];
        for algorithm in [0, 1] {
            cells.push(format!("{:.2}", paper[algorithm]));
            cells.push(format!("{:.2}", grid[algorithm]));
            cells.push(ratio(grid[algorithm], paper[algorithm]));
            cells.push(format!("{:.2}", counts[algorithm]));
            cells.push(ratio(counts[algorithm], paper[algorithm]));
        }
        cells.push(vdp_comment(grid, counts));
        cells
    });
    let header = [
        "Row",
        "Component: paper",
        "grid",
        "ratio",
        "paper's counts",
        "ratio",
        "Straightforward: paper",
        "grid",
        "ratio",
        "paper's counts",
        "ratio",
        "Comment",
    ];
    vec![
        Block::Table(Table {
            caption: "VDP(P > 75 %), slope 1.0, in percent".into(),
            header: header.map(str::to_owned).to_vec(),
            rows: table.collect(),
        }),
        Block::Table(variations(scenes)),
    ]
}

/// Each variation beside the plain result, with the paper's counts.
fn variations(scenes: &[SceneResult]) -> Table {
    let names = scenes.first().map_or(&[][..], |scene| &scene.variations);
    let mut header = vec!["Row".to_owned(), "The paper".into(), "As above".into()];
    header.extend(names.iter().map(|variation| variation.name.to_owned()));
    let pair = |[component, straightforward]: [f64; 2]| {
        let sign = if component < straightforward { '<' } else { '≥' };
        format!("{component:.2} {sign} {straightforward:.2}")
    };
    let line = |scene: &SceneResult, place: usize, row: &RowResult| {
        let published = &row.published;
        let mut cells = vec![
            name(row),
            pair([published.component_vdp, published.straightforward_vdp]),
            pair([0, 1].map(|algorithm| row.counts[algorithm].scores.0[VDP])),
        ];
        cells.extend(
            scene
                .variations
                .iter()
                .map(|variation| pair(variation.vdp[place])),
        );
        cells
    };
    let rows = scenes.iter().flat_map(|scene| {
        let rows = scene.rows.iter().enumerate();
        rows.map(move |(place, row)| line(scene, place, row))
    });
    Table {
        caption: "VDP(P > 75 %), slope 1.0, component-based against straightforward, with the paper's \
                  counts, if one thing is different"
            .into(),
        header,
        rows: rows.collect(),
    }
}

fn vdp_comment(grid: [f64; 2], counts: [f64; 2]) -> String {
    let better = |[component, straightforward]: [f64; 2]| component < straightforward;
    match (better(grid), better(counts)) {
        (true, true) => "component-based is better, as in the paper",
        (true, false) => "better on the grid, worse with the paper's counts",
        (false, true) => "worse on the grid, better with the paper's counts",
        (false, false) => "straightforward is better, unlike in the paper",
    }
    .into()
}

fn all_metrics(scene: &SceneResult) -> Table {
    let mut header = vec!["Picture".to_owned()];
    header.extend(METRICS.map(|metric| metric.name.to_owned()));
    let line = |name: String, attempt: &Attempt| {
        let mut cells = vec![name];
        cells.extend(
            METRICS
                .iter()
                .zip(attempt.scores.0)
                .map(|(metric, value)| metric.format(value)),
        );
        cells
    };
    let mut rows = Vec::new();
    for row in &scene.rows {
        for (attempts, kind) in [(&row.grid, "grid"), (&row.counts, "paper's counts")] {
            for (algorithm, attempt) in ALGORITHMS.into_iter().zip(attempts) {
                let name = format!(
                    "{} s, {}, {kind}",
                    row.published.deadline_s,
                    algorithm_name(algorithm)
                );
                rows.push(line(name, attempt));
            }
        }
    }
    Table {
        caption: format!("{}: VDP in percent of pixels", scene.scene.name),
        header,
        rows,
    }
}

fn algorithm_name(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::Component => "component-based",
        Algorithm::Straightforward => "straightforward",
    }
}

fn figures(scenes: &[SceneResult]) -> anyhow::Result<Vec<Block>> {
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

fn curves(scene: &SceneResult) -> Vec<Figure> {
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
        name: format!("the paper, {}", algorithm_name(ALGORITHMS[algorithm])),
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

fn faults(scene: &SceneResult) -> Vec<Block> {
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
        cells.extend(
            METRICS
                .iter()
                .zip(attempt.scores.0)
                .map(|(metric, value)| metric.format(value)),
        );
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

fn ratio(ours: f64, theirs: f64) -> String {
    format!("{:.2}", ours / theirs)
}

fn percent_pair([direct, indirect]: [f64; 2]) -> String {
    format!("{direct:.2}, {indirect:.2}")
}

fn file_name(scene: &str) -> String {
    scene.to_lowercase().replace(' ', "-")
}
