//! What the paper claims, weighed for each metric: its own numbers, the virtual grid, and our pictures
//! with the paper's numbers of tasks.

use std::collections::BTreeMap;

use super::{
    experiment::{Attempt, RowResult, SceneResult},
    judge::{METRICS, VDP},
    published::{GROWING_VDP, Row, SHRINKING_VDP},
};

/// Whose errors are weighed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Table 2 and section 4.2 as printed.
    Paper,
    /// Ours on the virtual grid.
    Grid,
    /// Ours with the paper's numbers of tasks.
    Counts,
}

/// What is claimed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Claim {
    /// "The error … has been found to be always less for the images computed using component-based
    /// approach".
    ComponentIsBetter,
    /// "The difference between the two approaches is considerably higher for a shorter
    /// time-constraint".
    ShortDeadlinesDiffer,
    /// "This variation is more evident for the Sibenik Model than the Cornell Box".
    ComplexScenesDiffer,
    /// "The visual quality of the two approaches appears to converge".
    Converges,
    /// Both algorithms' errors fall with the deadline, as in Table 2.
    ErrorFalls,
    /// "This is close to VDP (P>75%) value … generated without varying the resources".
    FaultsAreClose,
}

/// Every claim that is weighed by a metric.
pub const CLAIMS: [Claim; 6] = [
    Claim::ComponentIsBetter,
    Claim::ShortDeadlinesDiffer,
    Claim::ComplexScenesDiffer,
    Claim::Converges,
    Claim::ErrorFalls,
    Claim::FaultsAreClose,
];

/// How a claim fares.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Whether it holds in every case.
    pub holds: bool,
    /// The figure behind that.
    pub figure: String,
}

/// The fault runs are close to the constant one if their error is at most this many times as large. In
/// the paper it is 1.17 and 1.18 times as large.
const CLOSE: f64 = 1.25;
/// The algorithms converge if their difference at the longest deadline is at most this share of that at
/// the shortest.
const CONVERGED: f64 = 0.5;

/// Two times are almost the same if they differ by at most this share.
const ALMOST: f64 = 0.1;

impl Claim {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::ComponentIsBetter => "Component-based has less error than straightforward in every row",
            Self::ShortDeadlinesDiffer => {
                "The difference between the two is larger at the shortest deadline than at the longest (scenes)"
            }
            Self::ComplexScenesDiffer => {
                "The difference is larger in Sibenik than in the Cornell Box (mean over rows)"
            }
            Self::Converges => {
                "The two converge: at the longest deadline they differ by at most half as much as at the shortest (scenes)"
            }
            Self::ErrorFalls => "The error falls with every longer deadline (scenes × algorithms)",
            Self::FaultsAreClose => {
                "With machines that come or go the error is at most 1.25 times that of the constant grid (growing, shrinking)"
            }
        }
    }

    /// Weighs the claim; `None` where there are no numbers for it.
    pub fn weigh(self, scenes: &[SceneResult], source: Source, metric: usize) -> Option<Verdict> {
        if source == Source::Paper && metric != VDP {
            return None;
        }
        let errors: BTreeMap<&str, Vec<[f64; 2]>> = scenes
            .iter()
            .map(|scene| (scene.scene.name.as_str(), errors(&scene.rows, source, metric)))
            .filter(|(_, errors)| !errors.is_empty())
            .collect();
        match self {
            Self::FaultsAreClose => faults(scenes, source, metric),
            _ => self.weigh_errors(&errors, metric),
        }
    }

    /// Weighs the claim by VDP with slope 1.0 and the paper's counts in a variation, by its place.
    pub fn weigh_variation(self, scenes: &[SceneResult], place: usize) -> Option<Verdict> {
        let of = |scene: &'_ SceneResult| Some(scene.variations.get(place)?.vdp.clone());
        let errors = scenes
            .iter()
            .filter_map(|scene| Some((scene.scene.name.as_str(), of(scene)?)))
            .filter(|(_, errors)| !errors.is_empty());
        self.weigh_errors(&errors.collect(), VDP)
    }

    /// `errors` of both algorithms by scene and ascending deadline.
    fn weigh_errors(self, errors: &BTreeMap<&str, Vec<[f64; 2]>>, metric: usize) -> Option<Verdict> {
        let gap = |[component, straightforward]: [f64; 2]| straightforward - component;
        let ends = || {
            errors
                .values()
                .filter_map(|rows| Some((gap(*rows.first()?), gap(*rows.last()?))))
        };
        match self {
            Self::ComponentIsBetter => share(errors.values().flatten().map(|&row| gap(row) > 0.0)),
            Self::ShortDeadlinesDiffer => share(ends().map(|(shortest, longest)| shortest > longest)),
            Self::Converges => {
                share(ends().map(|(shortest, longest)| longest.abs() <= CONVERGED * shortest.abs()))
            }
            Self::ErrorFalls => share(errors.values().flat_map(|rows| {
                [0, 1].map(|algorithm| rows.is_sorted_by(|a, b| a[algorithm] > b[algorithm]))
            })),
            Self::ComplexScenesDiffer => {
                let mean = |scene| {
                    let rows: &Vec<[f64; 2]> = errors.get(scene)?;
                    Some(rows.iter().map(|&row| gap(row)).sum::<f64>() / rows.len() as f64)
                };
                let (sibenik, cornell) = (mean("Sibenik")?, mean("Cornell Box")?);
                let format = |value| METRICS[metric].format(value);
                Some(Verdict {
                    holds: sibenik > cornell,
                    figure: format!("{} against {}", format(sibenik), format(cornell)),
                })
            }
            Self::FaultsAreClose => None,
        }
    }
}

/// "The component-based approach … is less dependent on image reconstruction techniques" (section 5).
pub fn less_reconstruction(scenes: &[SceneResult], source: Source) -> Option<Verdict> {
    let mean = |[direct, indirect]: [f64; 2]| f64::midpoint(direct, indirect);
    let of = |attempts: &[Attempt; 2]| {
        let [component, straightforward] = attempts;
        mean(component.reconstructed_percent) < straightforward.reconstructed_percent[0]
    };
    let holds = |row: &RowResult| match source {
        Source::Paper => {
            let Row {
                direct_percent,
                indirect_percent,
                straightforward_percent,
                ..
            } = row.published;
            mean([direct_percent, indirect_percent]) < straightforward_percent
        }
        Source::Grid => of(&row.grid),
        Source::Counts => of(&row.counts),
    };
    share(scenes.iter().flat_map(|scene| &scene.rows).map(holds))
}

/// "The time needed for generating the gold standard images for both approaches was almost the same"
/// (section 4.1), on the virtual grid.
pub fn equal_times(scenes: &[SceneResult]) -> Option<Verdict> {
    let ratio = |scene: &SceneResult| {
        let [component, straightforward] = scene.full_workload.map(|time| time.as_secs_f64());
        component / straightforward
    };
    let ratios: Vec<f64> = scenes.iter().map(ratio).collect();
    let texts: Vec<String> = ratios.iter().map(|ratio| format!("{ratio:.2}")).collect();
    (!ratios.is_empty()).then(|| Verdict {
        holds: ratios.iter().all(|ratio| (ratio - 1.0).abs() <= ALMOST),
        figure: format!("{} times", texts.join(", ")),
    })
}

/// Errors of both algorithms in each row.
fn errors(rows: &[RowResult], source: Source, metric: usize) -> Vec<[f64; 2]> {
    let of = |attempts: &[Attempt; 2]| [0, 1].map(|algorithm| attempts[algorithm].scores.0[metric]);
    let published = |row: &Row| [row.component_vdp, row.straightforward_vdp];
    rows.iter()
        .map(|row| match source {
            Source::Paper => published(&row.published),
            Source::Grid => of(&row.grid),
            Source::Counts => of(&row.counts),
        })
        .collect()
}

fn faults(scenes: &[SceneResult], source: Source, metric: usize) -> Option<Verdict> {
    let runs = &scenes.iter().find(|scene| !scene.faults.is_empty())?.faults;
    let [constant, growing, shrinking] = match source {
        Source::Paper => [9.55, GROWING_VDP, SHRINKING_VDP],
        Source::Grid => {
            let mut values = runs.iter().map(|run| run.attempt.scores.0[metric]);
            [values.next()?, values.next()?, values.next()?]
        }
        Source::Counts => return None,
    };
    let ratios = [growing / constant, shrinking / constant];
    Some(Verdict {
        holds: ratios.iter().all(|&ratio| ratio <= CLOSE),
        figure: format!("{:.2} and {:.2} times", ratios[0], ratios[1]),
    })
}

fn share(cases: impl Iterator<Item = bool>) -> Option<Verdict> {
    let (mut holding, mut all) = (0, 0);
    for case in cases {
        holding += u32::from(case);
        all += 1;
    }
    (all > 0).then(|| Verdict {
        holds: holding == all,
        figure: format!("{holding} of {all}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::published::ROWS;

    fn weigh(claim: Claim, change: impl Fn(usize, &mut [f64; 2])) -> Verdict {
        let mut errors: BTreeMap<&str, Vec<[f64; 2]>> = BTreeMap::new();
        for (number, row) in ROWS.iter().enumerate() {
            let mut error = [row.component_vdp, row.straightforward_vdp];
            change(number, &mut error);
            errors.entry(row.scene).or_default().push(error);
        }
        claim.weigh_errors(&errors, VDP).unwrap()
    }

    #[test]
    fn the_papers_own_numbers_bear_out_its_claims() {
        for claim in [
            Claim::ComponentIsBetter,
            Claim::ShortDeadlinesDiffer,
            Claim::ComplexScenesDiffer,
            Claim::Converges,
            Claim::ErrorFalls,
        ] {
            let verdict = weigh(claim, |_, _| {});
            assert!(verdict.holds, "{claim:?}: {verdict:?}");
        }
        assert_eq!(weigh(Claim::ComponentIsBetter, |_, _| {}).figure, "9 of 9");
    }

    #[test]
    fn one_row_that_disagrees_is_enough() {
        let swapped = |number, error: &mut [f64; 2]| {
            if number == 8 {
                error.swap(0, 1);
            }
        };
        let verdict = weigh(Claim::ComponentIsBetter, swapped);
        assert_eq!((verdict.holds, verdict.figure.as_str()), (false, "8 of 9"));
        let worse_later = |number, error: &mut [f64; 2]| {
            if number == 2 {
                error[0] = 30.0;
            }
        };
        assert_eq!(weigh(Claim::ErrorFalls, worse_later).figure, "5 of 6");
        let simple = |number, error: &mut [f64; 2]| {
            if number > 5 {
                error[1] += 100.0;
            }
        };
        assert!(!weigh(Claim::ComplexScenesDiffer, simple).holds);
    }
}
