//! A frame as a worker renders it: any task of it, run after run.

use std::{
    borrow::Cow,
    ops::Range,
    sync::{Arc, OnceLock},
};

use glam::{DVec3, Vec3};

use crate::{
    direct::DirectPass,
    gbuffer::{Footprint, GBuffer, Vec3Lanes},
    intersect::TracedScene,
    light::LightSampler,
    pixel_group::PixelGroups,
    sample::{hash, pixel::PixelSamples},
    section::Section,
    settings::{Algorithm, Settings, SettingsError},
    task::{Component, RayCounts, Task},
    vpl::{Gather, GeometryBound, VplSet},
};

/// Everything that the tasks of a frame share. Tasks may run on any number of threads at once.
#[derive(Debug)]
pub struct FrameRenderer {
    scene: Arc<TracedScene>,
    settings: Settings,
    groups: PixelGroups,
    lights: LightSampler,
    vpl_sets: Vec<VplSet>,
    /// The first surfaces of each section of each group: the same for every task of the group. None in the
    /// progressive algorithm, whose passes look elsewhere each time.
    sections: Vec<Vec<OnceLock<Section>>>,
}

/// Why a frame cannot be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// The workload is impossible.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The VPLs do not belong to the settings.
    #[error("the frame has {found} VPL sets, but its settings speak of {expected}")]
    VplSets {
        /// Sets that came.
        found: usize,
        /// Sets in the settings.
        expected: u32,
    },
}

/// Sets the groups' beginnings among the VPL sets apart from other numbers.
const SET_ORDER: u32 = 0x7365_7473;

/// What a task yielded before it was done or stopped.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TaskOutput {
    /// Length of the finished beginning of [`PixelGroups::pixels`].
    pub pixels_done: u32,
    /// Radiance per unit albedo in W·m⁻²·sr⁻¹, [`Component::floats_per_pixel`] numbers for each of these;
    /// progressive: radiance, its albedo included, summed over the task's passes.
    pub radiance: Vec<f32>,
    /// Rays traced.
    pub rays: RayCounts,
}

impl FrameRenderer {
    /// Prepares a frame.
    ///
    /// # Errors
    /// For settings outside their limits, and for VPL sets that are not as many as the settings say.
    pub fn new(
        scene: Arc<TracedScene>,
        settings: Settings,
        vpl_sets: Vec<VplSet>,
    ) -> Result<Self, FrameError> {
        settings.validate()?;
        if vpl_sets.len() != settings.vpl_sets as usize {
            return Err(FrameError::VplSets {
                found: vpl_sets.len(),
                expected: settings.vpl_sets,
            });
        }
        let groups = PixelGroups::new(&settings);
        let sections = |group| groups.pixels(group).len().div_ceil(groups.section_pixels());
        let kept = match settings.algorithm {
            Algorithm::Progressive => 0,
            _ => settings.groups,
        };
        let sections = (0..kept)
            .map(|group| {
                std::iter::repeat_with(OnceLock::new)
                    .take(sections(group))
                    .collect()
            })
            .collect();
        let lights = LightSampler::new(&scene.scene().emitters);
        Ok(Self {
            scene,
            settings,
            groups,
            lights,
            vpl_sets,
            sections,
        })
    }

    /// Whether the frame has such a task.
    pub fn has(&self, task: Task) -> bool {
        task.is_within(&self.settings)
    }

    /// Row-major indices of the pixels of a group, in the order in which they are rendered.
    ///
    /// # Panics
    /// If there is no such group.
    pub fn pixels(&self, group: u32) -> &[u32] {
        self.groups.pixels(group)
    }

    /// Renders a task in runs of whole chunks, the more at once the faster. `chunks` is asked before each
    /// run how many of the chunks at hand it shall have; none ends the task.
    ///
    /// # Panics
    /// If the frame has no such task.
    pub fn render(&self, task: Task, chunks: &mut dyn FnMut(usize) -> usize) -> TaskOutput {
        assert!(self.has(task), "{task:?} is not a task of this frame");
        let pixels = self.groups.pixels(task.group);
        let chunk_pixels = self.groups.chunk_pixels();
        let floats = task.component.floats_per_pixel();
        let mut output = TaskOutput::default();
        output.radiance.reserve_exact(pixels.len() * floats);
        for (number, pixels) in pixels.chunks(self.groups.section_pixels()).enumerate() {
            let mut section = None;
            let mut done = 0;
            while done < pixels.len() {
                let count = chunks((pixels.len() - done).div_ceil(chunk_pixels));
                if count == 0 {
                    return output;
                }
                let run = done..pixels
                    .len()
                    .min(done.saturating_add(count.saturating_mul(chunk_pixels)));
                done = run.end;
                if self.settings.algorithm == Algorithm::Progressive {
                    // Near as they are, and the cache holds what a chunk needs.
                    let chunks = pixels[run].chunks(chunk_pixels);
                    chunks.for_each(|pixels| self.render_passes(task, pixels, &mut output));
                    continue;
                }
                let section =
                    section.get_or_insert_with(|| self.section(task, number, pixels, &mut output.rays));
                self.render_run(task, section, run, pixels, &mut output);
            }
        }
        output
    }

    /// The first surfaces of a section of a task's group.
    fn section(&self, task: Task, number: usize, pixels: &[u32], rays: &mut RayCounts) -> Cow<'_, Section> {
        let mut trace = || {
            rays.primary += pixels.len() as u64;
            Section::trace(&self.scene, self.settings.size, pixels)
        };
        match task.component {
            // Each pixel comes once: nothing to keep.
            Component::Full => Cow::Owned(trace()),
            _ => Cow::Borrowed(self.sections[task.group as usize][number].get_or_init(trace)),
        }
    }

    /// Adds the light of a run of a section to the output; `pixels` are those of the section.
    fn render_run(
        &self,
        task: Task,
        section: &Section,
        run: Range<usize>,
        pixels: &[u32],
        output: &mut TaskOutput,
    ) {
        let first = output.radiance.len();
        let floats = task.component.floats_per_pixel();
        output.radiance.resize(first + run.len() * floats, 0.0);
        output.pixels_done += run.len() as u32;
        let light_of_run = &mut output.radiance[first..];

        let points = section.run(&run);
        let pixels: Vec<u32> = points
            .places()
            .iter()
            .map(|&place| pixels[place as usize])
            .collect();
        let places = points.places().iter().map(|&place| place as usize - run.start);
        let points = points.points();
        let mut radiance = Vec3Lanes::zeros(points.position.x.len());
        output.rays.shadow += match task.component {
            Component::Direct => self.add_direct(task.index, &pixels, points, &mut radiance),
            Component::Indirect => self.add_indirect(task.index, points, &mut radiance),
            Component::Full => {
                let light = self.render_full(&pixels, points, &mut output.rays);
                return put(light, places, light_of_run);
            }
        };
        let light = (0..pixels.len()).map(|lane| radiance.get(lane).to_array());
        put(light, places, light_of_run);
    }

    /// The sum over the task's passes, each through other places of the pixels.
    fn render_passes(&self, task: Task, pixels: &[u32], output: &mut TaskOutput) {
        output.pixels_done += pixels.len() as u32;
        let mut sums = vec![Vec3::ZERO; pixels.len()];
        for pass in task.index..task.index + task.passes {
            let samples = PixelSamples::new(self.settings.seed, pass);
            let place = |pixel| samples.place(pixel);
            let Footprint { points, albedo } =
                Footprint::trace(&self.scene, self.settings.size, pixels, place);
            output.rays.primary += pixels.len() as u64;
            let mut light = Vec3Lanes::zeros(points.position.x.len());
            output.rays.shadow += match task.component {
                Component::Direct => self.add_direct(pass, pixels, &points, &mut light),
                _ => self.add_indirect(self.set_of(task.group, pass), &points, &mut light),
            };
            for (lane, sum) in sums.iter_mut().enumerate() {
                *sum += albedo.get(lane) * light.get(lane);
            }
        }
        output
            .radiance
            .extend(sums.into_iter().flat_map(|sum| sum.to_array()));
    }

    /// The VPL set that a group sees in a pass of the progressive algorithm.
    ///
    /// Sets that follow each other complement each other, and so do aligned runs of them. So do those of a
    /// group's passes, and those of all groups, whose pixels are neighbours, in one pass; and a group meets
    /// every set before it meets one again. In the higher bits each group begins elsewhere.
    fn set_of(&self, group: u32, pass: u32) -> u32 {
        let bits = self.settings.groups.next_power_of_two().trailing_zeros();
        let begin = group | hash(SET_ORDER, group) << bits;
        (pass ^ begin) % self.settings.vpl_sets
    }

    /// All passes and all sets, direct then indirect light of each lane, with the same means as the
    /// component-based buffers have.
    fn render_full(
        &self,
        pixels: &[u32],
        points: &GBuffer,
        rays: &mut RayCounts,
    ) -> impl Iterator<Item = [f32; 6]> + use<> {
        let lanes = points.position.x.len();
        let mut mean = |count: u32, add: &dyn Fn(u32, &mut Vec3Lanes) -> u64| -> Vec<DVec3> {
            let mut sums = vec![DVec3::ZERO; lanes];
            for index in 0..count {
                let mut radiance = Vec3Lanes::zeros(lanes);
                rays.shadow += add(index, &mut radiance);
                for (lane, sum) in sums.iter_mut().enumerate() {
                    *sum += radiance.get(lane).as_dvec3();
                }
            }
            sums.into_iter().map(|sum| sum / f64::from(count)).collect()
        };
        let direct = mean(self.settings.spp, &|pass, radiance| {
            self.add_direct(pass, pixels, points, radiance)
        });
        let indirect = mean(self.settings.vpl_sets, &|set, radiance| {
            self.add_indirect(set, points, radiance)
        });
        direct.into_iter().zip(indirect).map(|(direct, indirect)| {
            let ([r, g, b], [ir, ig, ib]) = (direct.as_vec3().to_array(), indirect.as_vec3().to_array());
            [r, g, b, ir, ig, ib]
        })
    }

    fn add_direct(&self, pass: u32, pixels: &[u32], points: &GBuffer, radiance: &mut Vec3Lanes) -> u64 {
        DirectPass::new(&self.settings, pass).add(&self.scene, &self.lights, pixels, points, radiance)
    }

    fn add_indirect(&self, set: u32, points: &GBuffer, radiance: &mut Vec3Lanes) -> u64 {
        let bound = GeometryBound::new(self.settings.geometry_clamp);
        Gather::new(&self.scene, bound).add(points, &self.vpl_sets[set as usize].vpls, radiance)
    }
}

/// Puts the light of each lane into its place.
fn put<const N: usize>(
    light: impl Iterator<Item = [f32; N]>,
    places: impl Iterator<Item = usize>,
    radiance: &mut [f32],
) {
    let (pixels, _) = radiance.as_chunks_mut::<N>();
    for (light, place) in light.zip(places) {
        pixels[place] = light;
    }
}
