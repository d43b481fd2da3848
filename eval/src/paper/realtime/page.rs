//! The part of the page that tells what was measured by the clock.

use render::settings::Algorithm;

use super::measured::{Case, Measured, name};
use crate::paper::{
    document::{Block, Document, Figure, Table, replace_part},
    experiment::ALGORITHMS,
    judge::{FLIP, METRICS, VDP},
    plot::{Plot, Series},
};

/// The paper's light samples per pixel and VPLs.
const PAPER_WORKLOAD: (u32, u32) = (16, 256);

/// The part's name in the page.
pub const PART: &str = "realtime";

/// The part, or what stands in its place as long as nothing was measured.
pub fn part(measured: Option<&Measured>) -> Block {
    let mut blocks = vec![Block::Heading("By the clock, on a machine of today".into())];
    match measured {
        None => blocks.push(Block::Text(
            "Not measured here yet: `cargo run -p eval -- realtime` runs both algorithms by the clock and puts \
             the result in this place."
                .into(),
        )),
        Some(measured) => blocks.extend(results(measured)),
    }
    Block::Part { name: PART, blocks }
}

/// A page that was made earlier, as HTML or as Markdown, with this part in place of its own.
pub(super) fn insert(page: &str, measured: &Measured, render: fn(&Document) -> String) -> Option<String> {
    let alone = Document {
        title: String::new(),
        blocks: vec![part(Some(measured))],
    };
    replace_part(page, PART, &render(&alone))
}

fn results(measured: &Measured) -> Vec<Block> {
    let Measured {
        version,
        processor,
        cores,
        size,
        spp,
        vpls,
        vpl_sets,
        cases,
    } = measured;
    let runs = cases.iter().map(|case| case.runs.len()).max().unwrap_or(0);
    let workload = if (*spp, *vpls) == PAPER_WORKLOAD {
        ", the paper's own workload"
    } else {
        ""
    };
    vec![
        Block::Text(format!(
            "Nothing is simulated here: the `master` program ({version}) with its local worker, on {cores} \
             cores ({processor}), at {size}. It has {spp} light samples per pixel and {vpls} VPLs in {vpl_sets} \
             sets{workload}, and otherwise the settings of `master --paper`. Each cell is the median of {runs} \
             runs with the range; pictures are compared with the one that the same program makes without a \
             deadline. Made by `cargo run -p eval -- realtime`; times depend on the machine and its load."
        )),
        Block::Text(wins(measured)),
        Block::Text(lateness(cases)),
        Block::Table(table(cases)),
        Block::Figures(
            measured
                .scenes()
                .into_iter()
                .flat_map(|scene| [VDP, FLIP].map(|metric| plot(measured, scene, metric)))
                .collect(),
        ),
    ]
}

/// In how many cases the component-based algorithm has the smaller median, by every metric.
fn wins(measured: &Measured) -> String {
    let count = |(place, metric): (usize, &crate::paper::judge::Metric)| {
        let pairs = measured.pairs(place);
        let better = pairs.iter().filter(|[component, other]| component < other);
        format!("{} {} of {}", metric.name, better.count(), pairs.len())
    };
    let counts: Vec<String> = METRICS.iter().enumerate().map(count).collect();
    format!(
        "Cases in which the component-based picture has the smaller error (median): {}.",
        counts.join("; ")
    )
}

/// How many pictures came after their deadline, and by how much at most.
fn lateness(cases: &[Case]) -> String {
    let late = |case: &Case| -> Vec<f64> {
        let runs = case.runs.iter().map(|run| run.elapsed_s - case.deadline_s);
        runs.filter(|late_s| *late_s > 0.0).collect()
    };
    let runs: usize = cases.iter().map(|case| case.runs.len()).sum();
    let late: Vec<f64> = cases.iter().flat_map(late).collect();
    let worst = late.iter().copied().fold(0.0, f64::max);
    match late.len() {
        0 => format!("All of the {runs} pictures were delivered before their deadline."),
        count => format!(
            "{count} of the {runs} pictures came after their deadline, by {:.0} ms at most.",
            worst * 1000.0
        ),
    }
}

fn table(cases: &[Case]) -> Table {
    let shown = [VDP, VDP + 1, FLIP, FLIP + 1];
    let mut header = [
        "Scene, deadline, algorithm",
        "Delivered after, s",
        "Direct reconstructed, %",
        "Indirect reconstructed, %",
    ]
    .map(str::to_owned)
    .to_vec();
    header.extend(shown.map(|metric| METRICS[metric].name.to_owned()));
    let row = |case: &Case| {
        let mut cells = vec![format!(
            "{}, {} s, {}",
            case.scene, case.deadline_s, case.algorithm
        )];
        let spreads = [
            case.elapsed_s()
                .map(|spread| spread.format(|value| format!("{value:.3}"))),
            case.reconstructed_percent(0)
                .map(|spread| spread.format(|value| format!("{value:.1}"))),
            case.reconstructed_percent(1)
                .map(|spread| spread.format(|value| format!("{value:.1}"))),
        ];
        let scores = shown.map(|metric| {
            case.score(metric)
                .map(|spread| spread.format(|value| METRICS[metric].format(value)))
        });
        cells.extend(spreads.into_iter().chain(scores).map(Option::unwrap_or_default));
        cells
    };
    Table {
        caption: "Distance from the picture without a deadline, median (range)".into(),
        header,
        rows: cases.iter().map(row).collect(),
    }
}

/// Medians as lines, and all runs as points, so that the range is seen.
fn plot(measured: &Measured, scene: &str, metric: usize) -> Figure {
    let of = |algorithm: Algorithm| {
        let cases = measured.cases.iter();
        cases.filter(move |case| case.scene == scene && case.algorithm == name(algorithm))
    };
    let medians = |(style, algorithm): (usize, Algorithm)| Series {
        name: format!("{}, median", name(algorithm)),
        style,
        points_only: false,
        points: of(algorithm)
            .filter_map(|case| Some((case.deadline_s, case.score(metric)?.median)))
            .collect(),
    };
    let runs = |(style, algorithm): (usize, Algorithm)| Series {
        name: "each run".into(),
        style,
        points_only: true,
        points: of(algorithm)
            .flat_map(|case| {
                let value = |run: &super::measured::OneRun| run.scores.get(METRICS[metric].name).copied();
                let values = case.runs.iter().filter_map(value);
                values.map(|value| (case.deadline_s, value)).collect::<Vec<_>>()
            })
            .collect(),
    };
    let styled = || ALGORITHMS.into_iter().enumerate();
    let (title, short) = if metric == VDP {
        ("VDP(P > 75 %), %", "vdp")
    } else {
        ("mean FLIP", "flip")
    };
    Figure {
        file: format!("realtime-{}-{short}.svg", scene.to_lowercase().replace(' ', "-")),
        caption: format!("{scene}: {title} over the deadline, by the clock."),
        bytes: Plot {
            title: format!("{scene}: {title}"),
            x_label: "deadline, seconds",
            series: styled().map(medians).chain(styled().map(runs)).collect(),
        }
        .to_svg()
        .into_bytes(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::realtime::measured::tests::measured;

    fn page(measured: Option<&Measured>) -> Document {
        Document {
            title: "Page".into(),
            blocks: vec![
                Block::Text("before".into()),
                part(measured),
                Block::Text("after".into()),
            ],
        }
    }

    #[test]
    fn a_page_takes_in_what_was_measured_later_as_if_it_had_been_there() {
        let measured = measured();
        for render in [Document::to_html, Document::to_markdown] {
            let early = render(&page(None));
            assert!(early.contains("Not measured here yet"));
            let later = insert(&early, &measured, render).unwrap();
            assert_eq!(later, render(&page(Some(&measured))));
            assert_eq!(insert(&later, &measured, render).as_ref(), Some(&later));
        }
        assert_eq!(insert("no such part", &measured, Document::to_html), None);
    }

    #[test]
    fn late_pictures_are_told() {
        let mut measured = measured();
        assert!(lateness(&measured.cases).starts_with("All of the 12"));
        measured.cases[1].runs[0].elapsed_s = measured.cases[1].deadline_s + 0.025;
        let told = lateness(&measured.cases);
        assert!(
            told.starts_with("1 of the 12") && told.contains("by 25 ms"),
            "{told}"
        );
    }

    #[test]
    fn every_metric_is_counted_and_every_case_has_a_row() {
        let text = page(Some(&measured())).to_markdown();
        for metric in METRICS {
            assert!(text.contains(&format!("{} 1 of 2", metric.name)), "{text}");
        }
        assert!(
            text.contains("| Sibenik, 2 s, component | 1.980 (1.970 to 1.990) | 0.0 (0.0 to 0.0) |"),
            "{text}"
        );
        assert!(
            text.contains(
                "![Sibenik: mean FLIP over the deadline, by the clock.](realtime-sibenik-flip.svg)"
            )
        );
    }
}
