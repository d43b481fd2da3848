//! The order in which tasks are handed out: section 3.2.3 of the paper.

use std::collections::VecDeque;

use render::{
    settings::{Algorithm, Settings},
    task::{Component, Task},
};

/// All tasks of a frame that have not been handed out, in one queue per component.
///
/// The queues are served in turn, one task each; when one is empty the other goes on.
#[derive(Debug, Clone)]
pub struct TaskQueues {
    queues: Vec<VecDeque<Task>>,
    turn: usize,
}

impl TaskQueues {
    /// The full workload of a frame.
    pub fn new(settings: &Settings) -> Self {
        let queues = match settings.algorithm {
            Algorithm::Component => vec![direct_order(settings), indirect_order(settings)],
            Algorithm::Straightforward => vec![full_order(settings)],
        };
        Self { queues, turn: 0 }
    }

    /// Takes the next task.
    pub fn next_task(&mut self) -> Option<Task> {
        for _ in 0..self.queues.len() {
            let turn = self.turn;
            self.turn = (turn + 1) % self.queues.len();
            if let Some(task) = self.queues[turn].pop_front() {
                return Some(task);
            }
        }
        None
    }

    /// Puts a task back whose result was lost, to be the next of its component.
    pub fn put_back(&mut self, task: Task) {
        let queue = usize::from(task.component == Component::Indirect);
        self.queues[queue].push_front(task);
    }

    /// Whether every task has been handed out.
    pub fn is_empty(&self) -> bool {
        self.queues.iter().all(VecDeque::is_empty)
    }

    /// The tasks of each component that are still to be handed out, in order.
    pub fn iter(&self) -> impl Iterator<Item = Task> {
        self.queues.iter().flatten().copied()
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
        std::iter::from_fn(|| queues.next_task())
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
        let first: Vec<_> = (0..4).filter_map(|_| queues.next_task()).collect();
        queues.put_back(first[3]);
        assert_eq!(
            queues.next_task().map(|task| task.component),
            Some(Component::Direct)
        );
        assert_eq!(queues.next_task(), Some(first[3]));
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
