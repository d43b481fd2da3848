//! The master's buffers: what has arrived, added up so that the order of arrival leaves no trace.
//!
//! One buffer for direct light and one for each VPL set (section 3.2.2), or a single one for the
//! straightforward algorithm (section 3.1.1). All are `[height][width]`: a result, whose pixels lie all
//! over the image, is scattered when it comes, beside the tracing, so that after the cut-off everything
//! is read in its order.

mod halves;
mod passes;

pub use halves::{Half, HalfBuffers};
pub(crate) use passes::PassBuffers;

use std::{collections::BTreeMap, mem, sync::Arc};

use glam::{DVec3, Vec3};

use crate::{
    pixel_group::PixelGroups,
    settings::{Algorithm, Settings},
    task::{Component, Task},
};

/// All light that has come back from the workers of a frame.
#[derive(Debug)]
pub struct FrameBuffers {
    settings: Settings,
    groups: Arc<PixelGroups>,
    direct: DirectBuffer,
    /// One for each VPL set of which anything has come.
    sets: Vec<Option<Buffer<3>>>,
    /// Direct and indirect light of each pixel.
    full: Option<Buffer<6>>,
    /// All light of the progressive algorithm.
    passes: Option<PassBuffers>,
}

/// Radiance per unit albedo of the beginnings of groups, `N` numbers for each pixel.
#[derive(Debug)]
pub(crate) struct Buffer<const N: usize> {
    /// `[height][width][N]`. Memory is taken where light arrives.
    pub(crate) light: Vec<[f32; N]>,
    /// Pixels of each group that have come, if any task of it has.
    done: Vec<Option<usize>>,
}

/// Direct light: running sums over the passes.
#[derive(Debug)]
pub(crate) struct DirectBuffer {
    /// Sums of radiance per unit albedo, `[height][width][3]`.
    pub(crate) sums: Vec<[f64; 3]>,
    /// Passes in each sum.
    pub(crate) counts: Vec<u32>,
    queues: Vec<PassQueue>,
}

/// Which passes of a group are in its sums.
#[derive(Debug, Default, Clone)]
struct PassQueue {
    /// All below are, unless they never came.
    next: u32,
    /// Passes that came before one of their predecessors.
    waiting: BTreeMap<u32, Box<[[f32; 3]]>>,
    /// Pixels of the longest result.
    done: usize,
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
        Self {
            settings: *settings,
            direct: DirectBuffer::new(&groups),
            sets: (0..settings.vpl_sets).map(|_| None).collect(),
            full: None,
            passes: match settings.algorithm {
                Algorithm::Progressive => Some(PassBuffers::new(settings)),
                _ => None,
            },
            groups,
        }
    }

    /// Adds what a task yielded of a beginning of its group, laid out as in
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
        let groups = &self.groups;
        let pixels = groups.pixels(task.group);
        if let Some(passes) = &mut self.passes {
            passes.add(task, pixels, radiance.as_chunks().0);
            return Ok(());
        }
        match task.component {
            Component::Direct => {
                let (light, _) = radiance.as_chunks();
                self.direct.add(task.group, pixels, task.index, light);
            }
            Component::Indirect => self.sets[task.index as usize]
                .get_or_insert_with(|| Buffer::new(groups))
                .add(task.group, pixels, radiance),
            Component::Full => self
                .full
                .get_or_insert_with(|| Buffer::new(groups))
                .add(task.group, pixels, radiance),
        }
        Ok(())
    }

    fn has(&self, task: Task) -> bool {
        if let Some(passes) = &self.passes {
            return passes.has(task);
        }
        match task.component {
            Component::Direct => self.direct.queues[task.group as usize].has(task.index),
            Component::Indirect => self.sets[task.index as usize]
                .as_ref()
                .is_some_and(|set| set.has(task.group)),
            Component::Full => self.full.as_ref().is_some_and(|full| full.has(task.group)),
        }
    }

    /// Adds up what still waited for a pass that never came. To be called once, before reading.
    pub(crate) fn settle(&mut self) {
        for group in 0..self.settings.groups {
            self.direct.settle(group, self.groups.pixels(group));
        }
    }

    pub(crate) fn settings(&self) -> &Settings {
        &self.settings
    }

    pub(crate) fn groups(&self) -> &PixelGroups {
        &self.groups
    }

    pub(crate) fn direct(&self) -> &DirectBuffer {
        &self.direct
    }

    /// What has come of a VPL set.
    pub(crate) fn set(&self, set: u32) -> Option<&Buffer<3>> {
        self.sets[set as usize].as_ref()
    }

    /// The same, to be changed or taken away.
    pub(crate) fn set_mut(&mut self, set: u32) -> &mut Option<Buffer<3>> {
        &mut self.sets[set as usize]
    }

    /// All light of the progressive algorithm.
    pub(crate) fn passes(&self) -> Option<&PassBuffers> {
        self.passes.as_ref()
    }

    /// Progressive: how noisy a pass of direct and of indirect light is, as far as that is known. See
    /// [`HalfBuffers::relative_variance`].
    pub fn relative_variances(&self) -> [Option<f64>; 2] {
        match &self.passes {
            Some(passes) => [&passes.direct, &passes.indirect].map(HalfBuffers::relative_variance),
            None => [None; 2],
        }
    }

    /// The single buffer of the straightforward algorithm.
    pub(crate) fn full(&self) -> Option<&Buffer<6>> {
        self.full.as_ref()
    }
}

impl<const N: usize> Buffer<N> {
    fn new(groups: &PixelGroups) -> Self {
        Self {
            light: vec![[0.0; N]; groups.order().len()],
            done: vec![None; groups.len()],
        }
    }

    fn has(&self, group: u32) -> bool {
        self.done[group as usize].is_some()
    }

    fn add(&mut self, group: u32, pixels: &[u32], radiance: &[f32]) {
        let (light, _) = radiance.as_chunks();
        for (&pixel, &light) in pixels.iter().zip(light) {
            self.light[pixel as usize] = light;
        }
        self.done[group as usize] = Some(light.len());
    }

    /// For each group how many of its first pixels have light.
    pub(crate) fn beginnings(&self) -> impl Iterator<Item = usize> {
        self.done.iter().map(|done| done.unwrap_or(0))
    }

    /// Pixels that have light.
    pub(crate) fn pixels(&self) -> usize {
        self.beginnings().sum()
    }
}

impl DirectBuffer {
    fn new(groups: &PixelGroups) -> Self {
        let pixels = groups.order().len();
        Self {
            sums: vec![[0.0; 3]; pixels],
            counts: vec![0; pixels],
            queues: vec![PassQueue::default(); groups.len()],
        }
    }

    /// Sums are taken in the order of the passes, so that any order of arrival gives the same bits.
    fn add(&mut self, group: u32, pixels: &[u32], pass: u32, light: &[[f32; 3]]) {
        let queue = &mut self.queues[group as usize];
        queue.done = queue.done.max(light.len());
        if queue.next != pass {
            queue.waiting.insert(pass, light.into());
            return;
        }
        queue.next += 1;
        add_pass(&mut self.sums, &mut self.counts, pixels, light);
        while let Some(light) = queue.waiting.remove(&queue.next) {
            queue.next += 1;
            add_pass(&mut self.sums, &mut self.counts, pixels, &light);
        }
    }

    fn settle(&mut self, group: u32, pixels: &[u32]) {
        let queue = &mut self.queues[group as usize];
        for (pass, light) in mem::take(&mut queue.waiting) {
            queue.next = pass + 1;
            add_pass(&mut self.sums, &mut self.counts, pixels, &light);
        }
    }

    /// For each group how many of its first pixels have light.
    pub(crate) fn beginnings(&self) -> impl Iterator<Item = usize> {
        self.queues.iter().map(|queue| queue.done)
    }

    /// The mean over the passes at a pixel.
    pub(crate) fn mean(&self, pixel: usize) -> Vec3 {
        (DVec3::from_array(self.sums[pixel]) / f64::from(self.counts[pixel])).as_vec3()
    }
}

impl PassQueue {
    fn has(&self, pass: u32) -> bool {
        pass < self.next || self.waiting.contains_key(&pass)
    }
}

fn add_pass(sums: &mut [[f64; 3]], counts: &mut [u32], pixels: &[u32], light: &[[f32; 3]]) {
    for (&pixel, light) in pixels.iter().zip(light) {
        for (sum, light) in sums[pixel as usize].iter_mut().zip(light) {
            *sum += f64::from(*light);
        }
        counts[pixel as usize] += 1;
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
        let first = buffers.groups.pixels(1)[0] as usize;
        (buffers.direct.mean(first), buffers.direct.counts[first])
    }

    fn direct(index: u32) -> Task {
        Task {
            component: Component::Direct,
            group: 1,
            index,
            passes: 1,
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
