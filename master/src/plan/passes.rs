//! Passes without end: which component is next, and how many passes a task has.
//!
//! Each component is swept again and again, all groups alike, so that what is counted never depends on
//! what was seen there: to stop where it looks good is to choose the light. In a sweep every group gets
//! 2, 4, 8, … passes, in runs of equal length that go in turn to the two halves of the samples. How long the
//! runs of a group are is up to the worker that begins it: as long as it likes its leases, but not longer than
//! half of the sweep. Others leave runs alone that are much too short for them, or too long, and are at most
//! one sweep ahead when they do.

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
const PILOT_PASSES: f64 = 2.0;
/// Work in one chunk of a task, which a slot cannot interrupt.
const CHUNK_TIME_S: f64 = 0.004;
/// So many halves of sweeps as long as those of the next one must still fit before the cut-off.
const SWEEPS_LEFT: f64 = 4.0;
/// Who has no group to begin takes short runs that are so many times shorter than he wants at most.
const SHORTEST_PART: u32 = 2;
/// Most passes in a task.
const SPAN_MAX: u32 = 64;
/// Passes in a task when time is of no importance, so that each frame has the same tasks, and the same bits.
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

/// The sweeps of one component.
#[derive(Debug, Clone)]
struct Sweep {
    component: Component,
    /// The passes that every group gets in the present sweep.
    first: u32,
    end: u32,
    /// Its longest run. There are two of them, but if there are too few passes left: then one.
    span: u32,
    /// The next group to be begun.
    group: u32,
    /// What is left of groups that were begun, also of the sweep before.
    begun: VecDeque<Run>,
    /// Passes handed out, of all groups and sweeps.
    dealt: u64,
    /// Passes in the longest lease that a worker wanted since the sweep began.
    wanted: u32,
    /// Seconds for one pass of one group, the mean of all workers, once it is known.
    cost_s: Option<f64>,
    /// See [`Noise`].
    variance: f64,
}

/// What is left of a group in a sweep: the passes from `next` to `end`, in runs of `span`.
#[derive(Debug, Clone, Copy)]
struct Run {
    group: u32,
    next: u32,
    end: u32,
    span: u32,
    /// Shorter than others of its sweep.
    is_short: bool,
}

impl Passes {
    pub(super) fn new(settings: &Settings) -> Self {
        let sweep = |component| Sweep {
            component,
            first: 0,
            end: settings.spp.min(2),
            span: 1,
            group: 0,
            begun: VecDeque::new(),
            dealt: 0,
            wanted: 0,
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
        let open = self
            .sweeps
            .iter()
            .filter(|sweep| !sweep.is_dealt(self.groups, self.count));
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
        let wanted = sweep.lease_wanted(outlook, chunks_per_group);
        sweep.wanted = sweep.wanted.max(wanted);
        let run = sweep.begun_that_suits(wanted, groups);
        let run = run.or_else(|| sweep.begin_group(wanted, groups));
        let run = run.or_else(|| {
            sweep.begin_next(outlook, groups, count);
            sweep.begin_group(wanted, groups)
        });
        let run = run.or_else(|| sweep.begun_that_suits_least_ill(wanted))?;
        Some(sweep.task_of(run))
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
        self.returned.is_empty()
            && self
                .sweeps
                .iter()
                .all(|sweep| sweep.is_dealt(self.groups, self.count))
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
        let done = sweep.dealt as f64 / f64::from(self.groups);
        let costs_are_known = self.sweeps.iter().all(|sweep| sweep.cost_s.is_some());
        match sweep.cost_s {
            Some(cost_s) if costs_are_known && done >= PILOT_PASSES => {
                // From variance / n to variance / (n + 1), for each second.
                sweep.variance / (done * (done + 1.0) * cost_s)
            }
            _ => f64::MAX / (1.0 + done),
        }
    }
}

impl Sweep {
    /// Whether there is nothing left to hand out.
    fn is_dealt(&self, groups: u32, count: u32) -> bool {
        self.begun.is_empty() && self.group >= groups && self.end >= count
    }

    /// Passes in a task that suit the worker which asks for one.
    fn lease_wanted(&self, outlook: &Outlook, chunks_per_group: f64) -> u32 {
        let Some(left) = outlook.left else {
            return SPAN_WITHOUT_DEADLINE;
        };
        // Of a worker that is new the best guess is that it is like the others.
        let Some(pass_s) = outlook.pace.pass_s(self.component).or(self.cost_s) else {
            return 1;
        };
        let in_chunks = CHUNK_TIME_S * chunks_per_group / pass_s;
        let wanted = outlook.pace.passes(pass_s, left).min(in_chunks as u32);
        floor_power_of_two(wanted.min(SPAN_MAX))
    }

    /// A group to go on with: one in short runs that are just right, else, when there is none to begin, and
    /// before that in what is left of the sweep before, one whose runs are not too long, nor much too short.
    fn begun_that_suits(&mut self, wanted: u32, groups: u32) -> Option<Run> {
        let is_last = self.group >= groups;
        let suits = |run: &Run| {
            let is_of_before = run.end <= self.first;
            let is_worth_it = !run.is_short || SHORTEST_PART * run.span >= wanted;
            let is_right = run.is_short && run.span == wanted;
            is_right || (is_of_before || is_last) && is_worth_it && run.span <= wanted
        };
        let place = self.begun.iter().position(suits)?;
        self.begun.remove(place)
    }

    /// A new group of the present sweep.
    fn begin_group(&mut self, wanted: u32, groups: u32) -> Option<Run> {
        let run = Run {
            group: self.group,
            next: self.first,
            end: self.end,
            span: wanted.min(self.span),
            is_short: wanted < self.span,
        };
        let is_there = self.group < groups && run.next < run.end;
        is_there.then(|| {
            self.group += 1;
            run
        })
    }

    /// What is left in the end: what is not too long, and of that the longest, or what is least too long.
    fn begun_that_suits_least_ill(&mut self, wanted: u32) -> Option<Run> {
        let misfit = |&place: &usize| {
            let span = self.begun[place].span;
            (span > wanted, span.abs_diff(wanted))
        };
        let place = (0..self.begun.len()).min_by_key(misfit)?;
        self.begun.remove(place)
    }

    /// The next task of a run, whose rest is kept.
    fn task_of(&mut self, mut run: Run) -> Task {
        let task = Task {
            component: self.component,
            group: run.group,
            index: run.next,
            passes: run.span,
        };
        self.dealt += u64::from(run.span);
        run.next += run.span;
        if run.next < run.end {
            self.begun.push_back(run);
        }
        task
    }

    /// All groups are begun, and nothing is left of the sweep before: the next passes, in runs as long as
    /// anybody wanted of late, as far as they leave time for more sweeps. Where runs of such a length begin: at
    /// a multiple of twice that, as both halves of the sweep are to be of one kind.
    fn begin_next(&mut self, outlook: &Outlook, groups: u32, count: u32) {
        let is_ahead = self.begun.iter().any(|run| run.end <= self.first);
        if is_ahead || self.end >= count {
            return;
        }
        self.first = self.end;
        let left = count - self.first;
        let in_time = match (outlook.left, self.cost_s) {
            (Some(left), Some(cost_s)) => {
                let half_s = cost_s * f64::from(groups) / f64::from(outlook.slots.max(1));
                (left.as_secs_f64() / (SWEEPS_LEFT * half_s)) as u32
            }
            _ => u32::MAX,
        };
        let mut span = floor_power_of_two(self.wanted.min(in_time));
        while span > 1 && (span > left || !self.first.is_multiple_of(2 * span)) {
            span /= 2;
        }
        let runs = if 2 * span <= left { 2 } else { 1 };
        self.span = span;
        self.end = self.first + runs * span;
        (self.group, self.wanted) = (0, 0);
    }
}

/// The largest power of two that is not above; 1 for 0.
fn floor_power_of_two(number: u32) -> u32 {
    1 << number.max(1).ilog2()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;
    use render::scene::ImageSize;

    use super::*;
    use crate::lease::Pace;

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
            pace: Pace::default(),
        }
    }

    /// Hands out tasks as long as there is time, each done at once at these costs for a pass.
    fn play(passes: &mut Passes, costs_ms: [u64; 2], seconds: u64) -> Vec<Task> {
        let mut left = Duration::from_secs(seconds);
        let mut tasks = Vec::new();
        while let Some(task) = passes.next_task(&Outlook {
            left: Some(left),
            slots: 1,
            pace: Pace::default(),
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

    /// Slots of machines that take so many milliseconds for a pass of either component, until the cut-off:
    /// which slot did what, and how long before the cut-off it began.
    fn share(passes: &mut Passes, costs_ms: &[u64], seconds: u64) -> Vec<(usize, Task, Duration)> {
        let all = Duration::from_secs(seconds);
        let mut slots = vec![(Duration::ZERO, Pace::default()); costs_ms.len()];
        let mut done = Vec::new();
        loop {
            let next = (0..slots.len()).min_by_key(|&slot| slots[slot].0).unwrap();
            let (now, pace) = slots[next];
            let left = all.saturating_sub(now);
            let outlook = Outlook {
                left: Some(left),
                slots: slots.len() as u32,
                pace,
            };
            let Some(task) = passes.next_task(&outlook).filter(|_| !left.is_zero()) else {
                return done;
            };
            let busy = Duration::from_millis(costs_ms[next]) * task.passes;
            passes.took(task, busy);
            slots[next].0 += busy;
            slots[next].1.took(task, busy);
            done.push((next, task, left));
        }
    }

    #[test]
    fn each_machine_gets_leases_of_its_own_length() {
        for costs_ms in [[2, 8, 32], [32, 2, 2], [2, 30, 30], [5, 5, 5]] {
            let mut passes = Passes::new(&settings(16, 65_536));
            let leases = share(&mut passes, &costs_ms, 60);
            for (slot, &cost_ms) in costs_ms.iter().enumerate() {
                let mut times_ms = leases
                    .iter()
                    .filter(|(by, _, left)| *by == slot && *left > Duration::from_secs(2))
                    .map(|(_, task, _)| cost_ms * u64::from(task.passes))
                    .collect::<Vec<_>>();
                let of_all: u64 = times_ms.iter().sum();
                times_ms.retain(|time| (50..=200).contains(time));
                let of_these: u64 = times_ms.iter().sum();
                assert!(
                    5 * of_these > 4 * of_all,
                    "slot {slot} of {costs_ms:?}: {of_these} of {of_all} ms in leases of 50 to 200 ms"
                );
            }
        }
    }

    #[test]
    fn groups_and_halves_stay_even_when_machines_differ_and_one_of_them_goes() {
        let mut passes = Passes::new(&settings(16, 65_536));
        let mut leases = share(&mut passes, &[2, 8, 32], 30);
        leases.extend(share(&mut passes, &[32, 32], 30));
        let mut halves = BTreeMap::<_, [u32; 2]>::new();
        for (_, task, _) in &leases {
            halves.entry((task.component, task.group)).or_default()[task.half()] += task.passes;
        }
        let totals: Vec<u32> = halves.values().map(|[a, b]| a + b).collect();
        let (least, most) = (*totals.iter().min().unwrap(), *totals.iter().max().unwrap());
        let longest = leases.iter().map(|(_, task, _)| task.passes).max().unwrap();
        // Sweeps are of two runs: the present one, the one before, and no more.
        assert!(most - least <= 4 * longest && least > 8 * longest, "{totals:?}");
        for (group, [a, b]) in halves {
            assert!(a.abs_diff(b) <= 2 * longest, "{group:?}: {a} and {b}");
        }
    }

    #[test]
    fn a_slow_network_makes_leases_longer() {
        let longest = |on_the_wire| {
            let mut passes = Passes::new(&settings(16, 65_536));
            passes.took(
                Task {
                    component: Component::Direct,
                    group: 0,
                    index: 0,
                    passes: 1,
                },
                Duration::from_millis(10),
            );
            let pace = Pace {
                on_the_wire,
                ..Pace::default()
            };
            let outlook = Outlook {
                pace,
                ..outlook(1000)
            };
            let tasks = (0..16 * 64).filter_map(|_| passes.next_task(&outlook));
            tasks.map(|task| task.passes).max()
        };
        assert_eq!(longest(Duration::ZERO), Some(8));
        assert_eq!(longest(Duration::from_millis(20)), Some(16));
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
