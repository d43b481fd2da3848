//! The master's buffers: what has arrived, added up so that the order of arrival leaves no trace.
//!
//! One buffer for direct light and one for each VPL set (section 3.2.2), or a single one for the
//! straightforward algorithm (section 3.1.1). All keep their numbers in the order of the pixel groups,
//! so that a result is added in one sweep.

use std::{collections::BTreeMap, sync::Arc};

use glam::{DVec3, Vec3};

use crate::{
    pixel_group::PixelGroups,
    settings::Settings,
    task::{Component, Task},
};

/// All light that has come back from the workers of a frame.
#[derive(Debug)]
pub struct FrameBuffers {
    settings: Settings,
    groups: Arc<PixelGroups>,
    direct: Vec<DirectGroup>,
    /// `[set][group]`.
    indirect: Vec<Vec<Option<Box<[Vec3]>>>>,
    /// `[group]`, direct and indirect light of each pixel.
    full: Vec<Option<Box<[[Vec3; 2]]>>>,
}

/// Direct light of one group: a running sum over its passes.
#[derive(Debug, Default, Clone)]
struct DirectGroup {
    /// Sums over the passes below `next`.
    sums: Vec<DVec3>,
    /// Passes in each sum.
    counts: Vec<u32>,
    next: u32,
    /// Passes that came before one of their predecessors.
    waiting: BTreeMap<u32, Box<[Vec3]>>,
}

/// Why a result was not added. The frame goes on without it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BufferError {
    /// No such task.
    #[error("{0:?} is not a task of this frame")]
    NoSuchTask(Task),
    /// The numbers are no beginning of the group.
    #[error("the result of {task:?} has {floats} numbers, which is no whole number of chunks")]
    Length {
        /// The task.
        task: Task,
        /// Numbers in the result.
        floats: usize,
    },
    /// The task has been added before.
    #[error("{0:?} has come twice")]
    Twice(Task),
    /// Not light.
    #[error(
        "the result of {task:?} has a number that is negative or not finite at pixel {pixel} of its group"
    )]
    NotLight {
        /// The task.
        task: Task,
        /// Place in the group.
        pixel: usize,
    },
}

impl FrameBuffers {
    /// Empty buffers. Memory is taken when light arrives.
    pub fn new(settings: &Settings, groups: Arc<PixelGroups>) -> Self {
        let count = settings.groups as usize;
        Self {
            settings: *settings,
            direct: vec![DirectGroup::default(); count],
            indirect: vec![vec![None; count]; settings.vpl_sets as usize],
            full: vec![None; count],
            groups,
        }
    }

    /// Adds what a task yielded: radiance per unit albedo of a beginning of its group, laid out as in
    /// [`TaskOutput::radiance`](crate::frame::TaskOutput::radiance).
    ///
    /// # Errors
    /// When the numbers cannot be this task's; nothing is added then.
    pub fn add(&mut self, task: Task, radiance: &[f32]) -> Result<(), BufferError> {
        if !task.is_within(&self.settings) {
            return Err(BufferError::NoSuchTask(task));
        }
        let per_pixel = task.component.floats_per_pixel();
        let pixels = radiance.len() / per_pixel;
        if !radiance.len().is_multiple_of(per_pixel) || !self.groups.is_prefix(task.group, pixels) {
            return Err(BufferError::Length {
                task,
                floats: radiance.len(),
            });
        }
        if let Some(place) = first_that_is_not_light(radiance) {
            return Err(BufferError::NotLight {
                task,
                pixel: place / per_pixel,
            });
        }
        if self.has(task) {
            return Err(BufferError::Twice(task));
        }
        let group = task.group as usize;
        match task.component {
            Component::Direct => self.direct[group].add(task.index, vectors(radiance).collect()),
            Component::Indirect => {
                self.indirect[task.index as usize][group] = Some(vectors(radiance).collect());
            }
            Component::Full => {
                let pairs = radiance.as_chunks::<6>().0.iter();
                let split = |&[a, b, c, d, e, f]: &[f32; 6]| [Vec3::new(a, b, c), Vec3::new(d, e, f)];
                self.full[group] = Some(pairs.map(split).collect());
            }
        }
        Ok(())
    }

    fn has(&self, task: Task) -> bool {
        let group = task.group as usize;
        match task.component {
            Component::Direct => self.direct[group].has(task.index),
            Component::Indirect => self.indirect[task.index as usize][group].is_some(),
            Component::Full => self.full[group].is_some(),
        }
    }

    /// Adds up what still waited for a pass that never came. To be called once, before reading.
    pub(crate) fn settle(&mut self) {
        for group in &mut self.direct {
            group.add_waiting_while(|_, _| true);
        }
    }

    pub(crate) fn settings(&self) -> &Settings {
        &self.settings
    }

    pub(crate) fn groups(&self) -> &PixelGroups {
        &self.groups
    }

    /// The direct light of a group: means and numbers of samples, of a beginning of its pixels.
    pub(crate) fn direct_group(&self, group: u32) -> (impl ExactSizeIterator<Item = Vec3>, &[u32]) {
        let DirectGroup { sums, counts, .. } = &self.direct[group as usize];
        let means = sums.iter().zip(counts);
        (
            means.map(|(sum, &count)| (sum / f64::from(count)).as_vec3()),
            counts,
        )
    }

    /// The data of a VPL set for a group: a beginning of its pixels.
    pub(crate) fn set_group(&self, set: u32, group: u32) -> &[Vec3] {
        self.indirect[set as usize][group as usize]
            .as_deref()
            .unwrap_or_default()
    }

    /// Direct and indirect light of a group in the single buffer of the straightforward algorithm.
    pub(crate) fn full_group(&self, group: u32) -> &[[Vec3; 2]] {
        self.full[group as usize].as_deref().unwrap_or_default()
    }
}

impl DirectGroup {
    fn has(&self, pass: u32) -> bool {
        pass < self.next || self.waiting.contains_key(&pass)
    }

    /// Sums are taken in the order of the passes, so that any order of arrival gives the same bits.
    fn add(&mut self, pass: u32, radiance: Box<[Vec3]>) {
        self.waiting.insert(pass, radiance);
        self.add_waiting_while(|pass, next| pass == next);
    }

    fn add_waiting_while(&mut self, may_add: impl Fn(u32, u32) -> bool) {
        while let Some(entry) = self.waiting.first_entry()
            && may_add(*entry.key(), self.next)
        {
            let (pass, radiance) = entry.remove_entry();
            self.next = pass + 1;
            self.add_now(&radiance);
        }
    }

    fn add_now(&mut self, radiance: &[Vec3]) {
        if self.sums.len() < radiance.len() {
            self.sums.resize(radiance.len(), DVec3::ZERO);
            self.counts.resize(radiance.len(), 0);
        }
        for ((sum, count), light) in self.sums.iter_mut().zip(&mut self.counts).zip(radiance) {
            *sum += light.as_dvec3();
            *count += 1;
        }
    }
}

/// Negative numbers, NaN and infinity are not light. In blocks without early exit, which vectorise.
fn first_that_is_not_light(radiance: &[f32]) -> Option<usize> {
    let is_light = |value: f32| (0.0..f32::INFINITY).contains(&value);
    let block = 1024;
    let spoilt = |values: &[f32]| !values.iter().fold(true, |all, &value| all & is_light(value));
    let first = radiance.chunks(block).position(spoilt)? * block;
    Some(first + radiance[first..].iter().position(|&value| !is_light(value))?)
}

fn vectors(floats: &[f32]) -> impl Iterator<Item = Vec3> {
    floats.as_chunks::<3>().0.iter().map(|&rgb| Vec3::from_array(rgb))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{scene::ImageSize, settings::Algorithm};

    fn buffers() -> FrameBuffers {
        let settings = Settings {
            groups: 4,
            spp: 8,
            ..Settings::paper(
                Algorithm::Component,
                ImageSize {
                    width: 64,
                    height: 64,
                },
            )
        };
        FrameBuffers::new(&settings, Arc::new(PixelGroups::new(&settings)))
    }

    fn first_pixel(buffers: &FrameBuffers) -> (Vec3, u32) {
        let (mut means, counts) = buffers.direct_group(1);
        (means.next().unwrap(), counts[0])
    }

    fn direct(index: u32) -> Task {
        Task {
            component: Component::Direct,
            group: 1,
            index,
        }
    }

    #[test]
    fn passes_add_up_to_the_same_bits_in_any_order() {
        let light = |pass: u32| vec![0.1f32.powi(pass as i32) * 1.7; 1024 * 3];
        let mean = |order: &[u32]| {
            let mut buffers = buffers();
            for &pass in order {
                buffers.add(direct(pass), &light(pass)).unwrap();
            }
            buffers.settle();
            first_pixel(&buffers)
        };
        let forward = mean(&[0, 1, 2, 4, 5, 6, 7]);
        assert_eq!(forward.1, 7);
        assert_eq!(mean(&[7, 2, 5, 0, 6, 4, 1]), forward);
        assert_eq!(mean(&[1, 0, 7, 6, 5, 4, 2]), forward);
    }

    #[test]
    fn results_that_cannot_be_a_tasks_are_refused_and_leave_nothing() {
        let mut buffers = buffers();
        let whole = vec![1.0; 1024 * 3];
        let mut spoilt = whole.clone();
        spoilt[7] = f32::NAN;
        let negative = vec![-1.0; 1024 * 3];
        assert!(matches!(
            buffers.add(direct(8), &whole),
            Err(BufferError::NoSuchTask(_))
        ));
        assert!(matches!(
            buffers.add(direct(0), &whole[..3000]),
            Err(BufferError::Length { .. })
        ));
        assert!(matches!(
            buffers.add(direct(0), &spoilt),
            Err(BufferError::NotLight { pixel: 2, .. })
        ));
        assert!(matches!(
            buffers.add(direct(0), &negative),
            Err(BufferError::NotLight { pixel: 0, .. })
        ));
        buffers.add(direct(0), &whole).unwrap();
        assert!(matches!(
            buffers.add(direct(0), &whole),
            Err(BufferError::Twice(_))
        ));
        assert_eq!(first_pixel(&buffers), (Vec3::ONE, 1));
    }
}
