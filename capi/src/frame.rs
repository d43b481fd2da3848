//! `gridlight_frame`: a frame of which tasks can be rendered.

use std::sync::Arc;

use render::{frame::FrameRenderer, settings::Settings as SettingsInside, vpl::trace_sets};

use crate::{
    boundary::{Output, free, guard, object},
    outcome::{Failure, Outcome},
    scene::Scene,
    settings::Settings,
    task::component,
};

/// A frame: a scene, settings, and the virtual point lights that belong to both.
#[derive(Debug)]
pub struct Frame {
    pub(crate) renderer: Arc<FrameRenderer>,
    pub(crate) settings: SettingsInside,
    pub(crate) scene: Arc<render::intersect::TracedScene>,
}

/// Makes a frame: divides the pixels into groups and traces the virtual point lights, on all cores.
///
/// Processors of different kinds may find lights that differ a little. Machines that render parts of one
/// picture must have the same ones: there, be a worker of a master, which sends them.
///
/// @param scene The scene. The frame keeps what it needs of it.
/// @param settings The settings, which may be changed for the next frame afterwards.
/// @param frame_out Receives the frame; free it by gridlight_frame_free.
/// @return GRIDLIGHT_RESULT_SETTINGS if no frame can have such settings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_frame_new(
    scene: *const Scene,
    settings: *const Settings,
    frame_out: *mut *mut Frame,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live scene.
        let scene = unsafe { object(scene, "scene") }?;
        // SAFETY: the caller passes live settings.
        let settings = unsafe { object(settings, "settings") }?;
        // SAFETY: the caller passes the place of a pointer.
        let output = unsafe { Output::at(frame_out, "frame_out") }?;
        output.give(Frame::new(scene, settings.0)?);
        Ok(())
    })
}

/// Frees a frame. Tasks and G-buffers that were made of it stay usable.
///
/// @param frame May be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_frame_free(frame: *mut Frame) {
    // SAFETY: the caller gives the frame back.
    unsafe { free(frame) };
}

/// How many tasks the frame has of a component: one for each pair of a group and an index.
///
/// @param frame The frame.
/// @param component A gridlight_component.
/// @param groups_out Receives the number of groups.
/// @param indices_out Receives the number of tasks for each group: passes, or VPL sets; 0 if the frame's
///     algorithm has no such component.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_frame_count_tasks(
    frame: *const Frame,
    component: u32,
    groups_out: *mut u32,
    indices_out: *mut u32,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live frame.
        let frame = unsafe { object(frame, "frame") }?;
        // SAFETY: the caller passes the place of a number.
        let groups = unsafe { Output::at(groups_out, "groups_out") }?;
        // SAFETY: as above.
        let indices = unsafe { Output::at(indices_out, "indices_out") }?;
        let component = self::component(component)?;
        groups.write(frame.settings.groups);
        indices.write(component.tasks_per_group(&frame.settings));
        Ok(())
    })
}

impl Frame {
    fn new(scene: &Scene, settings: SettingsInside) -> Result<Self, Failure> {
        let impossible = |text: String| Failure::new(Outcome::Settings, text);
        settings
            .validate()
            .map_err(|error| impossible(error.to_string()))?;
        let scene = Arc::clone(&scene.traced);
        let vpl_sets = trace_sets(&scene, &settings);
        let renderer = FrameRenderer::new(Arc::clone(&scene), settings, vpl_sets)
            .map_err(|error| impossible(error.to_string()))?;
        Ok(Self {
            renderer: Arc::new(renderer),
            settings,
            scene,
        })
    }
}
