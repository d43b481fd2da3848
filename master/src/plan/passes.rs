//! Passes without end: which component is next, and how many passes a task has.
//!
//! Each component is swept again and again, all groups alike, so that what is counted never depends on
//! what was seen there: to stop where it looks good is to choose the light. Sweeps are of 1, 2, 4, …
//! passes, a pair of equal length after the other, one for each half of the samples.

use std::{
    collections::{BTreeMap, VecDeque},
    time::Duration,
};

use render::{
    pixel_group::chunks_per_group,
    settings::Settings,
    task::{Component, Task},
};

use super::{Noise, Outlook};

/// Passes of each component that come before any choice: they tell its noise and its cost.
const PILOT_PASSES: u32 = 2;
/// Work in one task: long beside what a message costs, short beside a deadline.
const TASK_TIME_S: f64 = 0.1;
/// Work in one chunk of a task, which a slot cannot interrupt.
const CHUNK_TIME_S: f64 = 0.004;
/// So many sweeps as long as the next one must still fit before the cut-off.
const SWEEPS_LEFT: f64 = 4.0;
/// Most passes in a task.
const SPAN_MAX: u32 = 64;
/// Passes in a task when time is of no importance, so that each frame has the same tasks.
const SPAN_WITHOUT_DEADLINE: u32 = 8;
/// What a new measurement of the cost counts beside those before.
const COST_NEW: f64 = 0.125;

/// The tasks of a frame that goes on until the cut-off.
#[derive(Debug, Clone)]
pub(super) struct Passes {
    groups: u32,
    /// Of each component, in all.
    count: u32,
    chunks_per_group: f64,
    sweeps: [Sweep; 2],
    /// Lost and to be handed out again.
    returned: VecDeque<Task>,
}

/// The passes of one component. The next task is `span` passes from `first` on for `group`.
#[derive(Debug, Clone)]
struct Sweep {
    component: Component,
    first: u32,
    span: u32,
    group: u32,
    /// Seconds for one pass of one group, once it is known.
    cost_s: Option<f64>,
    /// See [`Noise`].
    variance: f64,
}

impl Passes {
    pub(super) fn new(settings: &Settings) -> Self {
        let sweep = |component| Sweep {
            component,
            first: 0,
            span: 1,
            group: 0,
            cost_s: None,
            variance: 1.0,
        };
        Self {
            groups: settings.groups,
            count: settings.spp,
            chunks_per_group: chunks_per_group(settings),
            sweeps: [Component::Direct, Component::Indirect].map(sweep),
            returned: VecDeque::new(),
        }
    }

    pub(super) fn next_task(&mut self, outlook: &Outlook) -> Option<Task> {
        if let Some(task) = self.returned.pop_front() {
            return Some(task);
        }
        let open = self.sweeps.iter().filter(|sweep| sweep.first < self.count);
        let next = open
            .max_by(|a, b| self.urgency(a).total_cmp(&self.urgency(b)))?
            .component;
        let Self {
            groups,
            count,
            chunks_per_group,
            ..
        } = *self;
        let sweep = self.sweep(next);
        let task = Task {
            component: next,
            group: sweep.group,
            index: sweep.first,
            passes: sweep.span,
        };
        sweep.group += 1;
        if sweep.group == groups {
            sweep.group = 0;
            sweep.first += sweep.span;
            let wanted = sweep.span_wanted(outlook, groups, chunks_per_group);
            sweep.span = sweep.span_possible(wanted, count - sweep.first);
        }
        Some(task)
    }

    pub(super) fn put_back(&mut self, task: Task) {
        self.returned.push_front(task);
    }

    pub(super) fn took(&mut self, task: Task, busy: Duration) {
        let cost_s = busy.as_secs_f64() / f64::from(task.passes);
        let sweep = self.sweep(task.component);
        let known = sweep.cost_s.unwrap_or(cost_s);
        sweep.cost_s = Some(known + COST_NEW * (cost_s - known));
    }

    pub(super) fn noise(&mut self, noise: Noise) {
        for (sweep, variance) in self.sweeps.iter_mut().zip([noise.direct, noise.indirect]) {
            sweep.variance = variance.unwrap_or(sweep.variance);
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.returned.is_empty() && self.sweeps.iter().all(|sweep| sweep.first >= self.count)
    }

    pub(super) fn totals(&self) -> BTreeMap<Component, u32> {
        let total = self.groups.saturating_mul(self.count);
        self.sweeps.iter().map(|sweep| (sweep.component, total)).collect()
    }

    fn sweep(&mut self, component: Component) -> &mut Sweep {
        let [direct, indirect] = &mut self.sweeps;
        if component == Component::Direct {
            direct
        } else {
            indirect
        }
    }

    /// How much a component gains by its next task; most of all while its pilot passes are missing.
    fn urgency(&self, sweep: &Sweep) -> f64 {
        let done = f64::from(sweep.first) + f64::from(sweep.group) / f64::from(self.groups);
        let costs_are_known = self.sweeps.iter().all(|sweep| sweep.cost_s.is_some());
        match sweep.cost_s {
            Some(cost_s) if costs_are_known && sweep.first >= PILOT_PASSES => {
                // From variance / n to variance / (n + 1), for each second.
                sweep.variance / (done * (done + 1.0) * cost_s)
            }
            _ => f64::MAX / (1.0 + done),
        }
    }
}

impl Sweep {
    /// Passes in a task that are worth its messages and leave time for more sweeps.
    fn span_wanted(&self, outlook: &Outlook, groups: u32, chunks_per_group: f64) -> u32 {
        let Some(left) = outlook.left else {
            return SPAN_WITHOUT_DEADLINE;
        };
        let Some(cost_s) = self.cost_s else {
            return 1;
        };
        let sweep_s = cost_s * f64::from(groups) / f64::from(outlook.slots.max(1));
        let spans = [
            TASK_TIME_S / cost_s,
            CHUNK_TIME_S * chunks_per_group / cost_s,
            left.as_secs_f64() / (SWEEPS_LEFT * sweep_s),
        ];
        spans.into_iter().fold(f64::INFINITY, f64::min) as u32
    }

    /// The longest span that is not longer than that, nor than what is left, and begins a new pair or ends
    /// the present one.
    fn span_possible(&self, wanted: u32, left: u32) -> u32 {
        let mut span = 1 << wanted.clamp(1, SPAN_MAX).ilog2();
        let fits = |span: u32| {
            let begins = self.first.is_multiple_of(2 * span);
            let ends = span == self.span && self.first.is_multiple_of(span);
            span <= left && (begins || ends)
        };
        while span > 1 && !fits(span) {
            span /= 2;
        }
        span
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;
    use render::scene::ImageSize;

    use super::*;

    fn settings(groups: u32, passes: u32) -> Settings {
        let size = ImageSize {
            width: 1024,
            height: 768,
        };
        Settings {
            groups,
            spp: passes,
            ..Settings::progressive(size)
        }
    }

    fn outlook(left_s: u64) -> Outlook {
        Outlook {
            left: Some(Duration::from_secs(left_s)),
            slots: 2,
        }
    }

    /// Hands out tasks as long as there is time, each done at once at these costs for a pass.
    fn play(passes: &mut Passes, costs_ms: [u64; 2], seconds: u64) -> Vec<Task> {
        let mut left = Duration::from_secs(seconds);
        let mut tasks = Vec::new();
        while let Some(task) = passes.next_task(&Outlook {
            left: Some(left),
            slots: 1,
        }) {
            let cost_ms = costs_ms[usize::from(task.component == Component::Indirect)];
            let busy = Duration::from_millis(cost_ms) * task.passes;
            passes.took(task, busy);
            tasks.push(task);
            left = left.saturating_sub(busy);
            if left.is_zero() {
                break;
            }
        }
        tasks
    }

    fn passes_of(tasks: &[Task], component: Component) -> u32 {
        let of = tasks.iter().filter(|task| task.component == component);
        of.map(|task| task.passes).sum()
    }

    #[test]
    fn both_components_cover_all_groups_before_anything_else() {
        let mut passes = Passes::new(&settings(3, 100));
        let first: Vec<Task> = (0..6).filter_map(|_| passes.next_task(&outlook(8))).collect();
        let distinct: BTreeSet<_> = first.iter().map(|task| (task.component, task.group)).collect();
        assert_eq!(distinct.len(), 6);
        assert!(first.iter().all(|task| (task.index, task.passes) == (0, 1)));
    }

    #[test]
    fn tasks_grow_to_a_tenth_of_a_second_and_shrink_before_the_cut_off() {
        let mut passes = Passes::new(&settings(8, 65_536));
        let tasks = play(&mut passes, [2, 6], 20);
        let longest = |tasks: &[Task]| tasks.iter().map(|task| task.passes).max();
        assert_eq!(longest(&tasks), Some(32));
        assert!(
            longest(&tasks[tasks.len() - 10..]) < Some(4),
            "{:?}",
            &tasks[tasks.len() - 10..]
        );
    }

    #[test]
    fn more_passes_go_to_the_component_that_is_noisier_or_cheaper() {
        let count = |noise: [f64; 2], costs_ms| {
            let mut passes = Passes::new(&settings(8, 65_536));
            let [direct, indirect] = noise.map(Some);
            passes.noise(Noise { direct, indirect });
            let tasks = play(&mut passes, costs_ms, 60);
            let [direct, indirect] =
                [Component::Direct, Component::Indirect].map(|component| passes_of(&tasks, component));
            f64::from(direct) / f64::from(indirect)
        };
        // The best shares go by the root of variance over cost.
        for (ratio, expected) in [
            (count([1.0, 1.0], [5, 5]), 1.0),
            (count([1.0, 1.0], [5, 20]), 2.0),
            (count([9.0, 1.0], [5, 5]), 3.0),
        ] {
            assert!((ratio / expected - 1.0).abs() < 0.25, "{ratio} is not {expected}");
        }
    }

    #[test]
    fn without_a_deadline_the_tasks_do_not_depend_on_time() {
        let tasks = |busy| {
            let mut passes = Passes::new(&settings(2, 21));
            let mut tasks: Vec<Task> = std::iter::from_fn(|| {
                let task = passes.next_task(&Outlook::default())?;
                passes.took(task, busy);
                Some(task)
            })
            .collect();
            tasks.sort_unstable();
            tasks
        };
        assert_eq!(tasks(Duration::from_millis(1)), tasks(Duration::from_secs(9)));
    }

    proptest! {
        #[test]
        fn every_pass_of_every_group_comes_once_and_half_of_them_are_in_each_half(
            groups in 1u32..5, count in 1u32..70, costs_ms: [u8; 2], seconds in 0u64..30,
        ) {
            let mut passes = Passes::new(&settings(groups, count));
            let mut come = BTreeSet::new();
            let mut halves = [0_i64; 2];
            while let Some(task) = passes.next_task(&outlook(seconds)) {
                prop_assert!(task.passes.is_power_of_two() && task.index % task.passes == 0);
                for pass in task.index..task.index + task.passes {
                    prop_assert!(come.insert((task.component, task.group, pass)));
                }
                if task.component == Component::Direct && task.group == 0 {
                    halves[task.half()] += i64::from(task.passes);
                }
                let cost_ms = costs_ms[usize::from(task.component == Component::Indirect)];
                passes.took(task, Duration::from_millis(cost_ms.into()) * task.passes);
            }
            prop_assert_eq!(come.len() as u32, 2 * groups * count);
            // Where the last pair is not whole, the halves differ by as much.
            prop_assert!((halves[0] - halves[1]).abs() <= i64::from(count) / 2 + 1, "{halves:?}");
            prop_assert!(passes.is_empty());
        }
    }
}
