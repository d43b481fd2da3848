//! Where a claim does not hold, and why: from the numbers, in words.

use super::{name, rows};
use crate::paper::{
    document::Block,
    experiment::{ALL_DIRECT, ALL_INDIRECT, RowResult, SceneResult, Variation},
    judge::{FLIP, METRICS, VDP},
};

/// A paragraph for what concerns all rows, and a point for each row that disagrees with the paper.
pub(super) fn reasons(scenes: &[SceneResult]) -> Vec<Block> {
    let mut blocks = vec![Block::Text(
        "What the metric asks decides the first claim. The straightforward algorithm leaves a part of the \
         pixels exactly as they are without a deadline and copies them into the others; the component-based \
         one leaves hardly any pixel exact and none far off. Metrics that count exact pixels as good, \
         whatever stands beside them (“zero identical”, and the means over pixels: FLIP and RMSE), favour \
         the first. The VDP without that rule also sees the edges and the texture that copying destroys, as \
         the paper says of the eye (its figure 4)."
            .into(),
    )];
    blocks.push(Block::Text(disagreement_of_metrics(scenes)));
    let points: Vec<String> = scenes
        .iter()
        .flat_map(|scene| {
            let rows = scene.rows.iter().enumerate();
            rows.filter_map(move |(place, row)| reason(&scene.variations, place, row))
        })
        .collect();
    if points.is_empty() {
        blocks.push(Block::Text(
            "With the paper's counts the component-based picture is better in every row, by VDP with slope 1.0."
                .into(),
        ));
    } else {
        blocks.push(Block::List(points));
    }
    blocks.push(Block::Text(
        "One reading may differ from theirs. Here a pass of direct light samples one point on one lamp, the \
         same for every pixel: with 24 lamps (Conference Room) three or four passes leave most lamps dark in \
         the whole picture. The paper speaks of “the same point on the area light sources”; if its passes \
         sampled every lamp, its first passes held almost all direct light, as in the column “all direct \
         tasks” below Table 2."
            .into(),
    ));
    blocks
}

/// In how many rows each kind of metric prefers the component-based picture.
fn disagreement_of_metrics(scenes: &[SceneResult]) -> String {
    let better = |metric: usize| {
        let wins = rows(scenes).filter(|(_, row)| {
            let [component, straightforward] = &row.counts;
            component.scores.0[metric] < straightforward.scores.0[metric]
        });
        wins.count()
    };
    let wins: Vec<String> = [VDP, VDP + 1, FLIP, FLIP + 1]
        .map(|metric| format!("{} {}", METRICS[metric].name, better(metric)))
        .to_vec();
    format!(
        "Rows of {} in which the component-based picture is better with the paper's counts: {}.",
        rows(scenes).count(),
        wins.join("; ")
    )
}

/// What is missing in a row where the straightforward picture is better.
fn reason(variations: &[Variation], place: usize, row: &RowResult) -> Option<String> {
    let [component, straightforward] = [0, 1].map(|algorithm| row.counts[algorithm].scores.0[VDP]);
    if component < straightforward {
        return None;
    }
    let with = |name: &str| {
        let variation = variations.iter().find(|variation| variation.name == name)?;
        Some(variation.vdp.get(place)?[0])
    };
    let (direct, indirect) = (with(ALL_DIRECT)?, with(ALL_INDIRECT)?);
    let missing = if direct < indirect { "direct" } else { "indirect" };
    Some(format!(
        "{}: the component-based picture is worse with the paper's counts ({component:.2} against \
         {straightforward:.2} %). With all direct tasks it would have {direct:.2} %, with all indirect tasks \
         {indirect:.2} %: it is {missing} light that is missing.",
        name(row)
    ))
}
