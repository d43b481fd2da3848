//! The buffers of the progressive algorithm: passes of both components, each in two halves.

use std::collections::BTreeMap;

use super::HalfBuffers;
use crate::{
    settings::Settings,
    task::{Component, Task},
};

/// Direct and indirect light of all passes that have come.
#[derive(Debug)]
pub(crate) struct PassBuffers {
    pub(crate) direct: HalfBuffers,
    pub(crate) indirect: HalfBuffers,
    /// Which passes of each component and group have come.
    come: BTreeMap<(Component, u32), Ranges>,
}

/// A set of numbers, as ranges that do not touch: from each beginning to its end.
#[derive(Debug, Default)]
struct Ranges(BTreeMap<u32, u32>);

impl PassBuffers {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            direct: HalfBuffers::new(settings.size),
            indirect: HalfBuffers::new(settings.size),
            come: BTreeMap::new(),
        }
    }

    /// Adds the sums of a task's passes at the first pixels of its group.
    pub(super) fn add(&mut self, task: Task, pixels: &[u32], light: &[[f32; 3]]) {
        let buffers = match task.component {
            Component::Direct => &mut self.direct,
            _ => &mut self.indirect,
        };
        buffers.add(task.half(), pixels, light, task.passes);
        let come = self.come.entry((task.component, task.group)).or_default();
        come.insert(task.index, task.index + task.passes);
    }

    /// Whether any pass of the task has come before.
    pub(super) fn has(&self, task: Task) -> bool {
        let come = self.come.get(&(task.component, task.group));
        come.is_some_and(|come| come.meets(task.index, task.index + task.passes))
    }
}

impl Ranges {
    /// Whether any number from `first` to below `end` is in the set.
    fn meets(&self, first: u32, end: u32) -> bool {
        let last = self.0.range(..end).next_back();
        last.is_some_and(|(_, &last_end)| last_end > first)
    }

    /// Puts in what is not there yet; ranges that now touch become one.
    fn insert(&mut self, first: u32, end: u32) {
        let end = self.0.remove(&end).unwrap_or(end);
        match self.0.range_mut(..first).next_back() {
            Some((_, before)) if *before == first => *before = end,
            _ => drop(self.0.insert(first, end)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_know_what_is_in_them_and_grow_together() {
        let mut ranges = Ranges::default();
        for (first, end) in [(4, 8), (0, 2), (10, 11)] {
            ranges.insert(first, end);
        }
        for ((first, end), meets) in [((2, 4), false), ((1, 2), true), ((8, 10), false), ((3, 5), true)] {
            assert_eq!(ranges.meets(first, end), meets, "{first}..{end}");
        }
        ranges.insert(2, 4);
        ranges.insert(8, 10);
        assert_eq!(ranges.0, [(0, 11)].into());
    }
}
