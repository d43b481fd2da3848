//! `gridlight_task`: the unit of work, rendered into the caller's memory.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use embree4_sys::FlushDenormals;
use render::{
    frame::FrameRenderer,
    task::{Component as ComponentInside, Task as TaskInside},
};

use crate::{
    boundary::{Output, OutputArray, free, guard, object},
    frame::Frame,
    outcome::{Failure, Outcome},
};

/// Chunks that are rendered before a cancelled task is noticed. More at once are faster, and this is most of
/// what there is to gain.
const CHUNKS_AT_ONCE: usize = 4;

/// One task of a frame: a component of the light for one group of pixels.
#[derive(Debug)]
pub struct Task {
    renderer: Arc<FrameRenderer>,
    id: TaskInside,
    is_cancelled: AtomicBool,
}

/// A part of the light that is computed apart from the others.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Component {
    /// Light that comes straight from the emitters: one pass. 3 numbers for each pixel: R, G, B.
    Direct = 0,
    /// Diffuse light from one set of virtual point lights. 3 numbers for each pixel: R, G, B.
    Indirect = 1,
    /// Both at once, of all passes and sets, for GRIDLIGHT_ALGORITHM_STRAIGHTFORWARD. 6 numbers for each
    /// pixel: direct R, G, B, then indirect.
    Full = 2,
}

/// Makes a task. Nothing is rendered yet.
///
/// @param frame The frame. The task keeps what it needs of it.
/// @param component A gridlight_component.
/// @param group Which pixels; see gridlight_frame_count_tasks.
/// @param index Direct: which pass. Indirect: which VPL set. Full: 0.
/// @param task_out Receives the task; free it by gridlight_task_free.
/// @return GRIDLIGHT_RESULT_TASK if the frame has no such task.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_task_new(
    frame: *const Frame,
    component: u32,
    group: u32,
    index: u32,
    task_out: *mut *mut Task,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live frame.
        let frame = unsafe { object(frame, "frame") }?;
        // SAFETY: the caller passes the place of a pointer.
        let output = unsafe { Output::at(task_out, "task_out") }?;
        let id = TaskInside {
            component: self::component(component)?,
            group,
            index,
            passes: 1,
        };
        output.give(Task::new(frame, id)?);
        Ok(())
    })
}

/// Frees a task, which must not be running.
///
/// @param task May be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_task_free(task: *mut Task) {
    // SAFETY: the caller gives the task back.
    unsafe { free(task) };
}

/// The size of a task's result.
///
/// @param task The task.
/// @param pixels_out Receives the number of its pixels.
/// @param floats_per_pixel_out Receives how many numbers each of them gets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_task_get_shape(
    task: *const Task,
    pixels_out: *mut usize,
    floats_per_pixel_out: *mut usize,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live task.
        let task = unsafe { object(task, "task") }?;
        // SAFETY: the caller passes the place of a number.
        let pixels = unsafe { Output::at(pixels_out, "pixels_out") }?;
        // SAFETY: as above.
        let floats = unsafe { Output::at(floats_per_pixel_out, "floats_per_pixel_out") }?;
        pixels.write(task.pixels().len());
        floats.write(task.id.component.floats_per_pixel());
        Ok(())
    })
}

/// The pixels of a task, in the order in which they are rendered. They are spread over the whole image,
/// and so is every beginning of them.
///
/// @param task The task.
/// @param room Number of elements that `pixels_out` has room for.
/// @param pixels_out Receives for each pixel its index y * width + x, rows from the top.
/// @return GRIDLIGHT_RESULT_TOO_LITTLE_ROOM if the task has more pixels than that.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_task_get_pixels(
    task: *const Task,
    room: usize,
    pixels_out: *mut u32,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live task.
        let task = unsafe { object(task, "task") }?;
        // SAFETY: the caller passes the place of an array.
        let output = unsafe { OutputArray::at(pixels_out, room, "pixels_out") }?;
        output.fill(task.pixels())
    })
}

/// Renders a task in this thread, until it is done or cancelled. Tasks of one frame may run in any number
/// of threads at once.
///
/// What comes out is the same for the same scene, settings and task, bit for bit, and what a worker of a
/// master would send. It is radiance in W/(m^2 sr) per unit albedo: multiplied by the albedo of the
/// G-buffer it is what the pixel shows.
///
/// @param task The task.
/// @param room Number of elements that `radiance_out` has room for: all that gridlight_task_get_shape
///     says, pixels times numbers per pixel.
/// @param radiance_out Receives the numbers of the finished pixels, one pixel after the other.
/// @param pixels_done_out Receives how many these are: the first so many of gridlight_task_get_pixels. All
///     of them, unless the task was cancelled.
/// @return GRIDLIGHT_RESULT_OK also for a task that was cancelled.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_task_run(
    task: *const Task,
    room: usize,
    radiance_out: *mut f32,
    pixels_done_out: *mut usize,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live task.
        let task = unsafe { object(task, "task") }?;
        // SAFETY: the caller passes the place of an array.
        let radiance = unsafe { OutputArray::at(radiance_out, room, "radiance_out") }?;
        // SAFETY: the caller passes the place of a number.
        let pixels_done = unsafe { Output::at(pixels_done_out, "pixels_done_out") }?;
        radiance.has_room_for(task.pixels().len() * task.id.component.floats_per_pixel())?;
        let _mode = FlushDenormals::in_this_thread();
        let output = task.renderer.render(task.id, &mut |left| {
            if task.is_cancelled() {
                return 0;
            }
            left.min(CHUNKS_AT_ONCE)
        });
        radiance.fill(&output.radiance)?;
        pixels_done.write(output.pixels_done as usize);
        Ok(())
    })
}

/// Cancels a task, from any thread: if it runs, it returns within a few milliseconds with what it has;
/// if it is run later, it returns at once with nothing. It stays cancelled.
///
/// @param task The task.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_task_cancel(task: *const Task) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live task.
        let task = unsafe { object(task, "task") }?;
        task.is_cancelled.store(true, Ordering::Relaxed);
        Ok(())
    })
}

/// A component by the number that C has for it.
pub(crate) fn component(number: u32) -> Result<ComponentInside, Failure> {
    match number {
        _ if number == Component::Direct as u32 => Ok(ComponentInside::Direct),
        _ if number == Component::Indirect as u32 => Ok(ComponentInside::Indirect),
        _ if number == Component::Full as u32 => Ok(ComponentInside::Full),
        _ => Err(Failure::invalid(format!("there is no component {number}"))),
    }
}

impl Task {
    fn new(frame: &Frame, id: TaskInside) -> Result<Self, Failure> {
        if !frame.renderer.has(id) {
            let text = format!("the frame has no task {id:?}");
            return Err(Failure::new(Outcome::Task, text));
        }
        Ok(Self {
            renderer: Arc::clone(&frame.renderer),
            id,
            is_cancelled: AtomicBool::new(false),
        })
    }

    fn pixels(&self) -> &[u32] {
        self.renderer.pixels(self.id.group)
    }

    fn is_cancelled(&self) -> bool {
        // Nothing else is published through this flag, so no order is needed.
        self.is_cancelled.load(Ordering::Relaxed)
    }
}
