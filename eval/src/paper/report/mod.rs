//! The page: tables, figures and claims, from the results.

mod pictures;
mod reasons;
mod tables;

use render::settings::Algorithm;

use super::{
    claims::{CLAIMS, Claim, Source, Verdict, equal_times, less_reconstruction},
    document::{Block, Document, Table},
    experiment::{RowResult, SceneResult},
    judge::{METRICS, VDP},
    realtime::{self, measured::Measured},
};
use pictures::{curves, faults, figures};
use reasons::reasons;
use tables::{all_metrics, table_1, table_2};

/// What the page says besides the results.
#[derive(Debug, Clone, Copy)]
pub struct Circumstances<'a> {
    /// The command that makes the page.
    pub command: &'a str,
    /// Size of the pictures.
    pub size: (u32, u32),
    /// Scenes that could not be found.
    pub missing: &'a [String],
    /// What runs by the clock have measured.
    pub realtime: Option<&'a Measured>,
}

/// Makes the page.
///
/// # Errors
/// If a figure cannot be encoded.
pub fn report(scenes: &[SceneResult], circumstances: &Circumstances<'_>) -> anyhow::Result<Document> {
    let mut blocks = introduction(circumstances);
    blocks.push(Block::Heading(
        "What the paper claims, and what holds here".into(),
    ));
    blocks.extend(claims(scenes));
    blocks.push(Block::Heading("Where a claim does not hold, and why".into()));
    blocks.extend(reasons(scenes));
    blocks.push(Block::Heading(
        "Table 1: tasks completed and pixels reconstructed".into(),
    ));
    blocks.extend(table_1(scenes));
    blocks.push(Block::Heading("Table 2: VDP(P > 75 %)".into()));
    blocks.extend(table_2(scenes));
    blocks.push(Block::Heading("Every metric, every setting".into()));
    blocks.extend(scenes.iter().map(|scene| Block::Table(all_metrics(scene))));
    blocks.push(Block::Heading("The whole workload".into()));
    blocks.push(whole_workload(scenes));
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
    blocks.push(realtime::page::part(circumstances.realtime));
    Ok(Document {
        title: "The paper's results, reproduced".into(),
        blocks,
    })
}

fn introduction(circumstances: &Circumstances<'_>) -> Vec<Block> {
    let Circumstances {
        command,
        size: (width, height),
        missing,
        ..
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
    blocks
}

/// How long the pictures without a deadline take, and whether both algorithms make the same.
fn whole_workload(scenes: &[SceneResult]) -> Block {
    let golds = scenes.iter().map(|scene| {
        let [component, straightforward] = scene.full_workload.map(|time| time.as_secs_f64());
        let (largest, pixels) = scene.gold_difference;
        format!(
            "{}: {component:.2} s component-based and {straightforward:.2} s straightforward on the virtual \
             grid. The two gold pictures differ in {pixels} pixels by more than rounding, and nowhere by more \
             than {largest:.0e} in linear light.",
            scene.scene.name
        )
    });
    Block::List(golds.collect())
}

fn claims(scenes: &[SceneResult]) -> Vec<Block> {
    let table = |source: Source, caption: &str| {
        let mut header = vec!["Claim".to_owned()];
        if source == Source::Grid {
            header.push("The paper's numbers".into());
        }
        header.extend(METRICS.map(|metric| metric.name.to_owned()));
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
        Block::Table(claims_of_variations(scenes)),
        Block::Table(claims_without_metric(scenes)),
    ]
}

/// What is claimed of times and shares, by no metric of pictures.
fn claims_without_metric(scenes: &[SceneResult]) -> Table {
    let header = [
        "Claim",
        "The paper's numbers",
        "On the virtual grid",
        "With the paper's counts",
    ];
    let row = |claim: &str, verdicts: [Option<Verdict>; 3]| {
        [claim.to_owned()].into_iter().chain(verdicts.map(cell)).collect()
    };
    Table {
        caption: "Claims that need no metric".into(),
        header: header.map(str::to_owned).to_vec(),
        rows: vec![
            row(
                "Component-based depends less on reconstruction: fewer reconstructed pixels, as the mean of \
                 direct and indirect light, in every row",
                [Source::Paper, Source::Grid, Source::Counts]
                    .map(|source| less_reconstruction(scenes, source)),
            ),
            row(
                "The gold pictures of both take almost the same time (within 10 %; component-based against \
                 straightforward)",
                [None, equal_times(scenes), None],
            ),
        ],
    }
}

fn cell(verdict: Option<Verdict>) -> String {
    match verdict {
        None => "–".to_owned(),
        Some(Verdict { holds: true, figure }) => format!("yes, {figure}"),
        Some(Verdict { holds: false, figure }) => format!("no, {figure}"),
    }
}

/// What would hold if one thing were different.
fn claims_of_variations(scenes: &[SceneResult]) -> Table {
    let names = || scenes.first().into_iter().flat_map(|scene| &scene.variations);
    let row = |claim: Claim| {
        let verdicts = (0..names().count()).map(|place| claim.weigh_variation(scenes, place));
        let plain = claim.weigh(scenes, Source::Counts, VDP);
        let cells = [plain].into_iter().chain(verdicts).map(cell);
        [claim.text().to_owned()].into_iter().chain(cells).collect()
    };
    let header = ["Claim".to_owned(), "As above".into()];
    Table {
        caption: "With the paper's counts of tasks, VDP with slope 1.0, if one thing is different".into(),
        header: (header.into_iter())
            .chain(names().map(|variation| variation.name.to_owned()))
            .collect(),
        rows: CLAIMS
            .into_iter()
            .map(row)
            .filter(|row: &Vec<String>| row[1..].iter().any(|cell| cell != "–"))
            .collect(),
    }
}

fn rows(scenes: &[SceneResult]) -> impl Iterator<Item = (&SceneResult, &RowResult)> {
    scenes
        .iter()
        .flat_map(|scene| scene.rows.iter().map(move |row| (scene, row)))
}

fn name(row: &RowResult) -> String {
    format!("{}, {} s", row.published.scene, row.published.deadline_s)
}

fn algorithm_name(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::Progressive => "progressive",
        Algorithm::Component => "component-based",
        Algorithm::Straightforward => "straightforward",
    }
}
