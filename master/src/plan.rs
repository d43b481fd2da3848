//! The order in which tasks are handed out: section 3.2.3 of the paper, or passes without end.

mod passes;

use std::{
    collections::{BTreeMap, VecDeque},
    time::Duration,
};

use render::{
    settings::{Algorithm, Settings},
    task::{Component, Task},
};

use crate::lease::Pace;
use passes::Passes;

/// All tasks of a frame that have not been handed out.
#[derive(Debug, Clone)]
pub struct TaskQueues {
    order: Order,
}

/// In which order they are handed out.
#[derive(Debug, Clone)]
enum Order {
    /// One queue per component. They are served in turn, one task each; when one is empty the other goes
    /// on.
    InTurn {
        queues: Vec<VecDeque<Task>>,
        turn: usize,
    },
    /// The progressive algorithm.
    Passes(Passes),
}

/// What lies ahead of a worker that is to get a task, as far as it is known.
#[derive(Debug, Clone, Copy, Default)]
pub struct Outlook {
    /// Time until it must send what it has.
    pub left: Option<Duration>,
    /// Slots of all workers.
    pub slots: u32,
    /// How fast it is.
    pub pace: Pace,
}

/// How noisy one pass of each component is: squared error in shares of the squared radiance; `None`:
/// not known yet.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Noise {
    /// Direct light.
    pub direct: Option<f64>,
    /// Indirect light.
    pub indirect: Option<f64>,
}

impl TaskQueues {
    /// The full workload of a frame.
    pub fn new(settings: &Settings) -> Self {
        let queues = match settings.algorithm {
            Algorithm::Component => vec![direct_order(settings), indirect_order(settings)],
            Algorithm::Straightforward => vec![full_order(settings)],
            Algorithm::Progressive => {
                let order = Order::Passes(Passes::new(settings));
                return Self { order };
            }
        };
        let order = Order::InTurn { queues, turn: 0 };
        Self { order }
    }

    /// Takes the next task.
    pub fn next_task(&mut self, outlook: &Outlook) -> Option<Task> {
        let (queues, turn) = match &mut self.order {
            Order::InTurn { queues, turn } => (queues, turn),
            Order::Passes(passes) => return passes.next_task(outlook),
        };
        for _ in 0..queues.len() {
            let queue = *turn;
            *turn = (queue + 1) % queues.len();
            if let Some(task) = queues[queue].pop_front() {
                return Some(task);
            }
        }
        None
    }

    /// Puts a task back whose result was lost, to be the next of its component.
    pub fn put_back(&mut self, task: Task) {
        match &mut self.order {
            Order::InTurn { queues, .. } => {
                let queue = usize::from(task.component == Component::Indirect);
                queues[queue].push_front(task);
            }
            Order::Passes(passes) => passes.put_back(task),
        }
    }

    /// A slot spent so long on a whole task.
    pub fn took(&mut self, task: Task, busy: Duration) {
        if let Order::Passes(passes) = &mut self.order {
            passes.took(task, busy);
        }
    }

    /// The noise has been estimated anew.
    pub fn noise(&mut self, noise: Noise) {
        if let Order::Passes(passes) = &mut self.order {
            passes.noise(noise);
        }
    }

    /// Whether every task has been handed out.
    pub fn is_empty(&self) -> bool {
        match &self.order {
            Order::InTurn { queues, .. } => queues.iter().all(VecDeque::is_empty),
            Order::Passes(passes) => passes.is_empty(),
        }
    }

    /// How many tasks of each component are still to be handed out; of several passes they count as so
    /// many.
    pub fn totals(&self) -> BTreeMap<Component, u32> {
        match &self.order {
            Order::InTurn { queues, .. } => {
                let mut totals = BTreeMap::new();
                for task in queues.iter().flatten() {
                    *totals.entry(task.component).or_default() += task.passes;
                }
                totals
            }
            Order::Passes(passes) => passes.totals(),
        }
    }
}

/// One light sample for the whole image after the other: "a set of tasks computing the direct
/// lighting for different groups of pixels by sampling the same point on the area light sources
/// are queued together".
fn direct_order(settings: &Settings) -> VecDeque<Task> {
    tasks(Component::Direct, settings.spp, |_| 0..settings.groups)
}

/// Half of the pixels of each VPL set, neighbours in the queue taking complementary halves; "the
/// second part of the group … is scheduled after one half of all the tasks have been scheduled".
/// So the first half of the queue has met every set, and every pixel half of them.
fn indirect_order(settings: &Settings) -> VecDeque<Task> {
    let half = settings.groups / 2;
    let half_of_groups = |lower: bool| if lower { 0..half } else { half..settings.groups };
    let sets = settings.vpl_sets;
    let mut order = tasks(Component::Indirect, sets, |set| half_of_groups(set % 2 == 0));
    order.extend(tasks(Component::Indirect, sets, |set| {
        half_of_groups(set % 2 == 1)
    }));
    order
}

/// Section 3.1.2: groups from the front of one queue.
fn full_order(settings: &Settings) -> VecDeque<Task> {
    tasks(Component::Full, 1, |_| 0..settings.groups)
}

fn tasks(component: Component, indices: u32, groups: impl Fn(u32) -> std::ops::Range<u32>) -> VecDeque<Task> {
    (0..indices)
        .flat_map(|index| {
            groups(index).map(move |group| Task {
                component,
                group,
                index,
                passes: 1,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;
    use render::scene::ImageSize;

    use super::*;

    fn settings(algorithm: Algorithm, groups: u32, spp: u32, vpl_sets: u32) -> Settings {
        let size = ImageSize {
            width: 64,
            height: 48,
        };
        Settings {
            groups,
            spp,
            vpls: vpl_sets,
            vpl_sets,
            ..Settings::paper(algorithm, size)
        }
    }

    fn drain(mut queues: TaskQueues) -> Vec<(Component, u32, u32)> {
        std::iter::from_fn(|| queues.next_task(&Outlook::default()))
            .map(|task| (task.component, task.index, task.group))
            .collect()
    }

    #[test]
    fn direct_and_indirect_tasks_alternate_and_halves_of_sets_complement_each_other() {
        use Component::{Direct, Indirect};
        let order = drain(TaskQueues::new(&settings(Algorithm::Component, 4, 1, 2)));
        let expected = [
            (Direct, 0, 0),
            (Indirect, 0, 0),
            (Direct, 0, 1),
            (Indirect, 0, 1),
            (Direct, 0, 2),
            (Indirect, 1, 2),
            (Direct, 0, 3),
            (Indirect, 1, 3),
            // Direct light is done; the second halves of the sets go on alone.
            (Indirect, 0, 2),
            (Indirect, 0, 3),
            (Indirect, 1, 0),
            (Indirect, 1, 1),
        ];
        assert_eq!(order, expected);
    }

    #[test]
    fn direct_light_finishes_one_pass_before_it_begins_the_next() {
        let order = drain(TaskQueues::new(&settings(Algorithm::Component, 3, 2, 1)));
        let direct: Vec<_> = order
            .iter()
            .filter(|(component, ..)| *component == Component::Direct)
            .map(|&(_, pass, group)| (pass, group))
            .collect();
        assert_eq!(direct, [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]);
    }

    #[test]
    fn the_straightforward_queue_holds_the_groups_in_order() {
        let order = drain(TaskQueues::new(&settings(Algorithm::Straightforward, 3, 2, 4)));
        assert_eq!(order, [0, 1, 2].map(|group| (Component::Full, 0, group)));
    }

    #[test]
    fn a_task_that_was_put_back_is_the_next_of_its_component() {
        let mut queues = TaskQueues::new(&settings(Algorithm::Component, 4, 1, 2));
        let first: Vec<_> = (0..4)
            .filter_map(|_| queues.next_task(&Outlook::default()))
            .collect();
        queues.put_back(first[3]);
        assert_eq!(
            queues.next_task(&Outlook::default()).map(|task| task.component),
            Some(Component::Direct)
        );
        assert_eq!(queues.next_task(&Outlook::default()), Some(first[3]));
    }

    proptest! {
        #[test]
        fn every_task_of_the_workload_is_queued_exactly_once(groups in 1u32..20, spp in 1u32..9, sets in 1u32..9) {
            let order = drain(TaskQueues::new(&settings(Algorithm::Component, groups, spp, sets)));
            let distinct: BTreeSet<_> = order.iter().collect();
            prop_assert_eq!(order.len(), distinct.len());
            prop_assert_eq!(order.len() as u32, groups * (spp + sets));
        }
    }
}
