//! Rehearses the finish phase on fewer pixels of made-up light, to know how long it will take.
//!
//! On the same threads, into the same file system, again and again while the frame is traced: so the
//! cores, their contention and the priority of the threads are those of the real thing.

use std::{path::Path, sync::Arc, time::Duration};

use glam::Vec3;
use rayon::ThreadPool;
use render::{
    buffer::FrameBuffers,
    camera::Camera,
    gbuffer::Aovs,
    image::Picture,
    pixel_group::PixelGroups,
    reconstruct::Reconstruction,
    scene::{CameraPose, ImageSize},
    settings::{Algorithm, Settings},
};

use crate::{
    clock::{self, Clock},
    cpu_share::CpuTime,
    deadline::{FinishWork, Rehearsed},
    deliver::PictureFiles,
    exit::{Exit, Failure, OrExit},
    finish::{self, Material},
    job::Job,
    plan::{Outlook, TaskQueues},
};

/// Processor time that a rehearsal may take, as a share of the deadline.
const BUDGET_SHARE: f64 = 0.006;
/// What a rehearsal takes for each of its pixels on an ordinary machine.
const COST_PER_PIXEL: Duration = Duration::from_nanos(200);
/// The same for each set of virtual point lights.
const COST_PER_PIXEL_AND_SET: Duration = Duration::from_nanos(10);
/// Fewer pixels than this tell nothing.
const PIXELS_MIN: f64 = 65_536.0;
/// What filtering a picture costs for each pixel, compared with the flat wall of a rehearsal. Measured: 1.1
/// for the Cornell box, 1.1 to 1.6 for sibenik, most where half of the pixels are missing.
const FILTER_REAL_SURFACES: f64 = 1.5;
/// How much of the work is done at the cut-off.
const DONE_SHARE: f64 = 0.45;
/// Results at the end that cover a part of their pixels.
const CUT_TASKS: usize = 4;
/// A view of no interest.
const POSE: CameraPose = CameraPose {
    eye: Vec3::ZERO,
    look_at: Vec3::X,
    up: Vec3::Y,
    vertical_fov_degrees: 45.0,
};
/// Light of no interest.
const LIGHT: f32 = 0.5;
/// Freeing a mebibyte of a file that is replaced, on an ordinary machine.
const FREE_PER_MIB: Duration = Duration::from_micros(400);
/// Tearing down a process, at least.
const LEAVE_MIN: Duration = Duration::from_millis(8);
/// Tearing down the memory that is left, for each pixel.
const LEAVE_PER_PIXEL: Duration = Duration::from_nanos(15);

/// A small stage for the play.
#[derive(Debug)]
pub struct Rehearsal {
    settings: Settings,
    groups: Arc<PixelGroups>,
    aovs: Arc<Aovs>,
    method: Reconstruction,
    files: PictureFiles,
    clock: Clock,
}

impl Rehearsal {
    /// Sets the stage for a job with this deadline.
    pub fn new(job: &Job, deadline: Duration, clock: Clock) -> Self {
        let size = job.size_expected();
        let settings = job.settings_at(size);
        let sets = match settings.algorithm {
            Algorithm::Progressive => 0,
            _ => settings.vpl_sets,
        };
        let settings = job.settings_at(small(size, sets, deadline));
        let count = settings.size.pixel_count();
        Self {
            groups: Arc::new(PixelGroups::new(&settings)),
            aovs: Arc::new(Aovs {
                size: settings.size,
                camera: Camera::new(&POSE, settings.size),
                albedo: vec![Vec3::splat(LIGHT); count],
                normal: vec![Vec3::X; count],
                depth: vec![1.0; count],
                emission: vec![Vec3::ZERO; count],
            }),
            settings,
            method: job.reconstruction,
            files: job.files.clone(),
            clock,
        }
    }

    /// Plays the finish phase through on these threads.
    pub fn play(&self, threads: &ThreadPool) -> Result<Rehearsed, Failure> {
        let mut material = self.material();
        // Processor time, since what others take of the cores meanwhile is not our work.
        let before = processor_time(threads);
        let picture = threads.install(|| material.reconstruct());
        let assemble = processor_time(threads).saturating_sub(before) / threads.current_num_threads() as u32;
        let (encode, share) = threads.install(|| self.encode(&picture))?;
        Ok(Rehearsed {
            work: FinishWork {
                pixels: self.settings.size.pixel_count(),
                assemble: assemble.mul_f64(self.real_surfaces()),
                encode,
            },
            share,
        })
    }

    /// How much longer the reconstruction takes where there are surfaces with edges and holes.
    fn real_surfaces(&self) -> f64 {
        match self.method {
            Reconstruction::Guided | Reconstruction::Quick => FILTER_REAL_SURFACES,
            Reconstruction::Nearest | Reconstruction::None => 1.0,
        }
    }

    /// Encodes both files side by side. Says how long that takes on free cores, and the share of a core
    /// that there was for it.
    fn encode(&self, picture: &Picture) -> Result<(Duration, f64), Failure> {
        // The program may end while this goes on: no name, no debris.
        let nameless = || self.files.nameless().or_exit(Exit::Output);
        let mut exr = self.files.exr.as_ref().map(|_| nameless()).transpose()?;
        let mut png = self.files.png.as_ref().map(|_| nameless()).transpose()?;
        let encode_exr = || {
            exr.as_mut()
                .map_or(Ok(()), |out| finish::encode_exr(picture, &[], out))
        };
        let encode_png = || {
            png.as_mut()
                .map_or(Ok(()), |out| finish::encode_png(picture, 0.0, out))
        };
        let ((exr, exr_time), (png, png_time)) =
            rayon::join(|| self.count(encode_exr), || self.count(encode_png));
        exr.and(png).or_exit(Exit::Output)?;
        let alone = if rayon::current_num_threads() > 1 {
            exr_time.ran.max(png_time.ran)
        } else {
            exr_time.ran + png_time.ran
        };
        Ok((alone, [exr_time, png_time].into_iter().sum::<CpuTime>().share()))
    }

    /// Does something without pause, and says how much of the time this thread was on a core.
    fn count<T>(&self, work: impl FnOnce() -> T) -> (T, CpuTime) {
        let begin = clock::thread_cpu_time();
        let (result, wanted) = self.clock.time(work);
        let ran = clock::thread_cpu_time().saturating_sub(begin);
        (result, CpuTime { ran, wanted })
    }

    /// The tasks that come first, as if the cut-off had come then: sets of which half is there, one that
    /// is just being rendered, and a few results that cover a part of their pixels.
    fn material(&self) -> Material {
        let mut buffers = FrameBuffers::new(&self.settings, Arc::clone(&self.groups));
        let mut queues = TaskQueues::new(&self.settings);
        let all: u32 = match self.settings.algorithm {
            // All groups in one component, and half of them in the other: some pixels are missing.
            Algorithm::Progressive => self.settings.groups.saturating_mul(3),
            _ => queues.totals().values().sum(),
        };
        let count = (f64::from(all) * DONE_SHARE) as usize;
        for place in 0..count {
            let Some(task) = queues.next_task(&Outlook::default()) else {
                break;
            };
            let whole = self.groups.pixels(task.group).len();
            let is_cut = place + CUT_TASKS >= count;
            let pixels = if is_cut {
                whole.min(self.groups.chunk_pixels())
            } else {
                whole
            };
            // Refused only if the made-up light were no light; then there is less to fill in.
            let _ = buffers.add(task, &vec![LIGHT; pixels * task.component.floats_per_pixel()]);
        }
        Material {
            buffers,
            aovs: Arc::clone(&self.aovs),
            method: self.method,
            min_set_percent: 0.0,
        }
    }
}

/// What the threads have used up to now.
fn processor_time(threads: &ThreadPool) -> Duration {
    threads.broadcast(|_| clock::thread_cpu_time()).into_iter().sum()
}

/// As many pixels as the budget allows, in the same proportions.
fn small(size: ImageSize, sets: u32, deadline: Duration) -> ImageSize {
    let each = COST_PER_PIXEL + COST_PER_PIXEL_AND_SET * sets;
    let pixels = deadline.mul_f64(BUDGET_SHARE).div_duration_f64(each);
    let shrink = (pixels.max(PIXELS_MIN) / size.pixel_count() as f64)
        .min(1.0)
        .sqrt();
    let side = |side: u32| ((f64::from(side) * shrink) as u32).max(1);
    ImageSize {
        width: side(size.width),
        height: side(size.height),
    }
}

/// From the last byte written to the end of the process: the files that are replaced are freed on the
/// way, then the memory.
pub fn leave(size: ImageSize, files: &PictureFiles) -> Duration {
    let length = |path: &Path| path.metadata().map_or(0, |metadata| metadata.len());
    let replaced: u64 = [&files.exr, &files.png]
        .into_iter()
        .flatten()
        .map(|path| length(path))
        .sum();
    let pixels = size.pixel_count() as f64;
    LEAVE_MIN + LEAVE_PER_PIXEL.mul_f64(pixels) + FREE_PER_MIB.mul_f64(replaced as f64 / f64::from(1 << 20))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::{cli::Cli, cores};

    #[test]
    fn a_rehearsal_leaves_no_file_behind_and_takes_time() {
        let folder = tempfile::tempdir().unwrap();
        let flags = format!("master --size 256x192 --out {}/a.exr", folder.path().display());
        let cli = Cli::try_parse_from(flags.split(' ')).unwrap();
        let job = Job::new(&cli.render).unwrap();
        let rehearsal = Rehearsal::new(&job, Duration::from_secs(1), Clock::new(Duration::ZERO));
        let work = rehearsal.play(&cores::pool().unwrap()).unwrap().work;
        assert!(work.assemble > Duration::ZERO && work.encode > Duration::ZERO);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_long_deadline_buys_a_rehearsal_on_all_pixels() {
        let size = ImageSize {
            width: 1024,
            height: 768,
        };
        assert_eq!(small(size, 16, Duration::from_secs(1_000)), size);
        let small = small(size, 16, Duration::from_secs(1));
        assert!((60_000..70_000).contains(&small.pixel_count()), "{small:?}");
    }
}
