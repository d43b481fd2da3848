//! Tables 1 and 2, and every metric in every setting.

use super::{algorithm_name, name, rows};
use crate::paper::{
    document::{Block, Table},
    experiment::{ALGORITHMS, Attempt, RowResult, SceneResult},
    judge::{METRICS, VDP},
    published::ROWS,
};

pub(super) fn table_1(scenes: &[SceneResult]) -> Vec<Block> {
    let component = rows(scenes).map(|(scene, row)| {
        let (paper, ours) = (&row.published, &row.grid[0]);
        let total = |[direct, indirect]: [u32; 2]| f64::from(direct + indirect);
        vec![
            name(row),
            format!("{} + {}", paper.direct_tasks, paper.indirect_tasks),
            format!("{} + {} and {} parts", ours.tasks[0], ours.tasks[1], ours.partial),
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
            format!("{} and {} parts", ours.tasks[0], ours.partial),
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
             (1024 − n) / 1024. Parts are results of tasks that were stopped when time was up; the ratio leaves \
             them out. The paper's counts of direct and indirect tasks differ by one at most. Ours differ by the \
             indirect tasks under way at the end, which have up to 8.5 times the rays of direct ones, though \
             both are handed out in turn. What is measured on the grid differs from the formula, since workers \
             send what they have of a task when time is up: such parts add pixels, but those of a set that no \
             whole task has reached open its buffer, nearly empty, which raises the mean."
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

pub(super) fn table_2(scenes: &[SceneResult]) -> Vec<Block> {
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

pub(super) fn all_metrics(scene: &SceneResult) -> Table {
    let mut header = vec!["Picture".to_owned()];
    header.extend(METRICS.map(|metric| metric.name.to_owned()));
    let line = |name: String, attempt: &Attempt| {
        let mut cells = vec![name];
        cells.extend(attempt.scores.cells());
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

fn ratio(ours: f64, theirs: f64) -> String {
    format!("{:.2}", ours / theirs)
}

fn percent_pair([direct, indirect]: [f64; 2]) -> String {
    format!("{direct:.2}, {indirect:.2}")
}
