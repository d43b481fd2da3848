//! The choice of VPLs among candidates, and how they are dealt out to sets.

use super::{Vpl, VplSet};

/// Systematic resampling: `count` candidates, each expected in proportion to its weight, their
/// intensities scaled so that the expected sum stays that of all candidates.
///
/// `offset` in [0, 1) is where the even steps through the sum of the weights begin. Without weight there
/// is nothing to choose.
pub(super) fn choose(candidates: &[Vpl], weights: &[f64], count: u32, offset: f32) -> Vec<Vpl> {
    let total: f64 = weights.iter().sum();
    if total <= 0.0 {
        return Vec::new();
    }
    let step = total / f64::from(count);
    let mut next = f64::from(offset) * step;
    let mut sum = 0.0;
    let mut chosen = Vec::with_capacity(count as usize);
    for (candidate, weight) in candidates.iter().zip(weights) {
        sum += weight;
        while next < sum && chosen.len() < count as usize {
            chosen.push(Vpl {
                intensity: candidate.intensity * (step / weight) as f32,
                ..*candidate
            });
            next += step;
        }
    }
    chosen
}

/// Weights in proportion to the candidates' light, but for a `share` that goes by light times merit; their
/// sum is that of the light.
pub(super) fn mix(light: &[f64], merit: &[f64], share: f64) -> Vec<f64> {
    let total: f64 = light.iter().sum();
    let merits: f64 = light.iter().zip(merit).map(|(light, merit)| light * merit).sum();
    // A share that nobody could claim goes by the light too.
    let share = if merits > 0.0 { share } else { 0.0 };
    let scale = if merits > 0.0 { share * total / merits } else { 0.0 };
    light
        .iter()
        .zip(merit)
        .map(|(light, merit)| light * (1.0 - share + scale * merit))
        .collect()
}

/// Deals VPLs out to sets, every `sets`-th one to the same set, and makes each set an estimate of all
/// light by itself.
///
/// `turn` in [0, 1) decides which set begins, so that no set prefers the beginning of a step. Sets that
/// follow each other are far apart within a step: the first few of them are spread evenly too.
pub(super) fn deal(vpls: &[Vpl], sets: u32, turn: f32) -> Vec<VplSet> {
    let first = (f64::from(turn) * f64::from(sets)) as u32;
    let of_set = |place: u32| {
        let every = vpls
            .iter()
            .skip(((place + first) % sets) as usize)
            .step_by(sets as usize);
        VplSet {
            vpls: every
                .map(|vpl| Vpl {
                    intensity: vpl.intensity * sets as f32,
                    ..*vpl
                })
                .collect(),
        }
    };
    spread_order(sets).into_iter().map(of_set).collect()
}

/// The numbers below `count` in the order of their reversed bits.
fn spread_order(count: u32) -> Vec<u32> {
    let bits = count.next_power_of_two().trailing_zeros();
    (0..1u32 << bits)
        .map(|index| {
            if bits == 0 {
                0
            } else {
                index.reverse_bits() >> (32 - bits)
            }
        })
        .filter(|&place| place < count)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::luminance;
    use glam::Vec3;

    fn candidates() -> Vec<Vpl> {
        (1u8..40)
            .map(|i| Vpl {
                position: Vec3::splat(f32::from(i)),
                normal: Vec3::Y,
                intensity: Vec3::new(f32::from(i), f32::from(i % 7), 1.0),
            })
            .collect()
    }

    fn weights() -> Vec<f64> {
        candidates()
            .iter()
            .map(|vpl| f64::from(luminance(vpl.intensity)))
            .collect()
    }

    fn light(vpls: &[Vpl]) -> Vec3 {
        vpls.iter().map(|vpl| vpl.intensity).sum()
    }

    /// The mean of `light` over even offsets is the light of all candidates.
    #[track_caller]
    fn assert_unbiased(estimate: impl Fn(f32) -> Vec3) {
        let (n, expected) = (20_000, light(&candidates()));
        let mean: Vec3 = (0..n)
            .map(|i| estimate((i as f32 + 0.5) / n as f32) / n as f32)
            .sum();
        assert!(
            ((mean - expected) / expected).abs().max_element() < 2e-3,
            "{mean} is not {expected}"
        );
    }

    #[test]
    fn choosing_keeps_the_expected_sum_of_every_channel() {
        assert_unbiased(|offset| light(&choose(&candidates(), &weights(), 5, offset)));
        // Whatever the weights are.
        let weights: Vec<f64> = (1..40).map(|i| 1.0 + f64::from(i % 5)).collect();
        assert_unbiased(|offset| light(&choose(&candidates(), &weights, 5, offset)));
    }

    #[test]
    fn chosen_vpls_are_as_many_as_asked_for_and_equally_bright() {
        for count in [1, 5, 39, 200] {
            let chosen = choose(&candidates(), &weights(), count, 0.3);
            assert_eq!(chosen.len(), count as usize);
            let first = luminance(chosen[0].intensity);
            assert!(
                chosen
                    .iter()
                    .all(|vpl| (luminance(vpl.intensity) / first - 1.0).abs() < 1e-4)
            );
        }
    }

    #[test]
    fn no_candidates_make_empty_sets() {
        assert_eq!(choose(&[], &[], 16, 0.5), []);
        assert_eq!(deal(&[], 2, 0.5), [VplSet::default(), VplSet::default()]);
    }

    #[test]
    fn every_set_alone_keeps_the_expected_sum() {
        for set in 0..5 {
            assert_unbiased(|place| {
                // Two numbers out of one: the turn, and the offset within it.
                let turns = place * 5.0;
                let vpls = choose(&candidates(), &weights(), 10, turns.fract());
                light(&deal(&vpls, 5, turns.floor() / 5.0)[set].vpls)
            });
        }
    }

    #[test]
    fn sets_share_out_all_vpls_evenly() {
        for sets in [1, 2, 3, 16] {
            let vpls = choose(&candidates(), &weights(), 48, 0.7);
            let dealt = deal(&vpls, sets, 0.6);
            assert_eq!(dealt.len(), sets as usize);
            assert!(dealt.iter().all(|set| set.vpls.len() == 48 / sets as usize));
            let mut positions: Vec<f32> = dealt
                .iter()
                .flat_map(|set| &set.vpls)
                .map(|vpl| vpl.position.x)
                .collect();
            positions.sort_by(f32::total_cmp);
            let expected: Vec<f32> = vpls.iter().map(|vpl| vpl.position.x).collect();
            assert_eq!(positions, expected);
        }
    }

    #[test]
    fn sets_that_follow_each_other_are_far_apart() {
        assert_eq!(spread_order(8), [0, 4, 2, 6, 1, 5, 3, 7]);
        assert_eq!(spread_order(3), [0, 2, 1]);
        assert_eq!(spread_order(1), [0]);
    }

    #[test]
    fn merit_moves_weight_and_keeps_the_sum() {
        let light = [1.0, 1.0, 5.0, 2.0];
        let weights = mix(&light, &[3.0, 1.0, 0.0, 0.5], 0.5);
        assert!((weights.iter().sum::<f64>() - light.iter().sum::<f64>()).abs() < 1e-12);
        assert!(weights[0] > light[0] && weights[0] > weights[1]);
        assert!((weights[2] - 0.5 * light[2]).abs() < 1e-12);
    }

    #[test]
    fn where_nothing_has_merit_light_alone_decides() {
        assert_eq!(mix(&[1.0, 4.0], &[0.0, 0.0], 0.5), [1.0, 4.0]);
        assert_eq!(mix(&[], &[], 0.5), [] as [f64; 0]);
    }
}
