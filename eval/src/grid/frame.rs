//! Scenes and frames of the virtual grid: tasks that are rendered when they are first asked for, and
//! pictures of any selection of them.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Arc, OnceLock},
};

use anyhow::Context;
use rayon::prelude::*;
use render::{
    buffer::FrameBuffers,
    frame::{FrameRenderer, TaskOutput},
    gbuffer::{Aovs, trace_aovs},
    image::Picture,
    intersect::TracedScene,
    pixel_group::PixelGroups,
    reconstruct::{Reconstruction, assemble},
    scene::load::{LoadOptions, load},
    settings::{Algorithm, LightPoints, Settings},
    task::{Component, Task},
    vpl::{VplSet, trace_sets},
};

use super::{
    parameters::Parameters,
    simulate::{TaskCost, Workload},
};
use master::plan::{Outlook, TaskQueues};

/// Tasks that are rendered together: enough for all cores, few enough not to render many in vain.
const BATCH: usize = 64;

/// A scene that is ready for frames of one size.
#[derive(Debug)]
pub struct PreparedScene {
    scene: Arc<TracedScene>,
    aovs: Arc<Aovs>,
    vpl_sets: Vec<VplSet>,
    parameters: Parameters,
}

impl PreparedScene {
    /// Loads a scene and traces what all its frames share.
    ///
    /// # Errors
    /// If the scene cannot be loaded or its BVH cannot be built.
    pub fn load(file: &Path, scenes_dir: &Path, parameters: &Parameters) -> anyhow::Result<Self> {
        let options = LoadOptions {
            scenes_dir: scenes_dir.to_owned(),
        };
        let loaded = load(file, &options)?;
        let scene = TracedScene::build(loaded.scene)
            .with_context(|| format!("cannot build the BVH of {}", file.display()))?;
        let settings = parameters.settings(Algorithm::Component, scene.scene().extent());
        settings.validate()?;
        Ok(Self {
            aovs: Arc::new(trace_aovs(&scene, settings.size)),
            // The same for both algorithms.
            vpl_sets: trace_sets(&scene, &settings),
            scene: Arc::new(scene),
            parameters: parameters.clone(),
        })
    }

    /// The paper's workload in this scene.
    pub fn settings(&self, algorithm: Algorithm) -> Settings {
        self.parameters.settings(algorithm, self.scene.scene().extent())
    }

    /// A frame whose tasks are not rendered yet.
    ///
    /// # Errors
    /// If the settings are impossible.
    pub fn frame(&self, algorithm: Algorithm) -> anyhow::Result<VirtualFrame<'_>> {
        self.frame_of(self.settings(algorithm), 1)
    }

    /// A frame whose passes of direct light take the mean over so many points of the lights, which are
    /// spread over all of them by power; each pass is still one task per group.
    ///
    /// # Errors
    /// If the settings are impossible.
    pub fn frame_with_points_per_pass(
        &self,
        algorithm: Algorithm,
        points: u32,
    ) -> anyhow::Result<VirtualFrame<'_>> {
        self.frame_of(self.settings(algorithm), points)
    }

    /// A frame whose direct light is sampled at other points for each pixel, which the paper's is not.
    ///
    /// # Errors
    /// If the settings are impossible.
    pub fn frame_with_points_per_pixel(&self, algorithm: Algorithm) -> anyhow::Result<VirtualFrame<'_>> {
        let settings = Settings {
            light_points: LightPoints::PerPixel,
            ..self.settings(algorithm)
        };
        self.frame_of(settings, 1)
    }

    fn frame_of(&self, settings: Settings, points_per_pass: u32) -> anyhow::Result<VirtualFrame<'_>> {
        let mut queues = TaskQueues::new(&settings);
        let order: Vec<Task> = std::iter::from_fn(|| queues.next_task(&Outlook::default())).collect();
        let rendered = Settings {
            spp: settings.spp * points_per_pass,
            ..settings
        };
        Ok(VirtualFrame {
            renderer: FrameRenderer::new(Arc::clone(&self.scene), rendered, self.vpl_sets.clone())?,
            points_per_pass,
            // The renderer's own: how it orders a group's pixels depends on the rays of each.
            groups: Arc::new(PixelGroups::new(&rendered)),
            places: order
                .iter()
                .enumerate()
                .map(|(place, &task)| (task, place))
                .collect(),
            outputs: order.iter().map(|_| OnceLock::new()).collect(),
            order,
            scene: self,
            settings,
        })
    }
}

/// A frame, with the results of all tasks that were asked for so far.
#[derive(Debug)]
pub struct VirtualFrame<'a> {
    scene: &'a PreparedScene,
    settings: Settings,
    renderer: FrameRenderer,
    points_per_pass: u32,
    groups: Arc<PixelGroups>,
    /// All tasks, as they are handed out.
    order: Vec<Task>,
    places: BTreeMap<Task, usize>,
    /// As `order`.
    outputs: Vec<OnceLock<TaskOutput>>,
}

impl VirtualFrame<'_> {
    /// The workload.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// All tasks in the order in which they are handed out.
    pub fn order(&self) -> &[Task] {
        &self.order
    }

    /// Pixels of a task's group.
    pub fn pixels(&self, task: Task) -> u32 {
        self.groups.pixels(task.group).len() as u32
    }

    /// The picture that results from the given beginnings of tasks' groups.
    ///
    /// # Errors
    /// For a task that the frame does not have, or that comes twice.
    pub fn picture(&self, results: impl IntoIterator<Item = (Task, u32)>) -> anyhow::Result<Picture> {
        let mut buffers = FrameBuffers::new(&self.settings, Arc::clone(&self.groups));
        for (task, pixels) in results {
            let floats = task.component.floats_per_pixel() * pixels as usize;
            buffers.add(task, &self.output(task).radiance[..floats])?;
        }
        let percent = self.scene.parameters.picture.min_set_percent;
        Ok(assemble(
            &mut buffers,
            &self.scene.aovs,
            Reconstruction::Nearest,
            percent,
        ))
    }

    /// The picture of the full workload.
    ///
    /// # Errors
    /// Never for a frame's own tasks.
    pub fn gold(&self) -> anyhow::Result<Picture> {
        self.picture(self.order.iter().map(|&task| (task, self.pixels(task))))
    }

    /// The result of a task. The first time it is asked for, it and its successors are rendered with
    /// all cores.
    fn output(&self, task: Task) -> &TaskOutput {
        let place = self.places[&task];
        if self.outputs[place].get().is_none() {
            let end = (place + BATCH).min(self.order.len());
            (place..end).into_par_iter().for_each(|place| {
                self.outputs[place].get_or_init(|| self.render(self.order[place]));
            });
        }
        self.outputs[place].get_or_init(|| self.render(task))
    }

    /// A pass of several points is the mean over as many of the renderer's passes.
    fn render(&self, task: Task) -> TaskOutput {
        let count = match task.component {
            Component::Direct => self.points_per_pass,
            _ => 1,
        };
        let pass = |point| Task {
            index: task.index * count + point,
            ..task
        };
        let mut sum = self.renderer.render(pass(0), &mut |left| left);
        for point in 1..count {
            let output = self.renderer.render(pass(point), &mut |left| left);
            sum.rays.shadow += output.rays.shadow;
            sum.radiance
                .iter_mut()
                .zip(&output.radiance)
                .for_each(|(sum, value)| *sum += value);
        }
        let share = 1.0 / count as f32;
        sum.radiance.iter_mut().for_each(|value| *value *= share);
        sum
    }
}

impl Workload for VirtualFrame<'_> {
    /// The paper's workers kept no first hits, so each pixel of each task has one ray more than its
    /// shadow rays, however many this renderer traces.
    fn cost(&self, task: Task) -> TaskCost {
        let pixels = self.pixels(task);
        TaskCost {
            pixels,
            chunk_pixels: self.groups.chunk_pixels() as u32,
            rays: u64::from(pixels) + self.output(task).rays.shadow,
            floats_per_pixel: task.component.floats_per_pixel(),
        }
    }
}
