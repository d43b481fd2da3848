//! `gridlight_scene`: a scene in memory, ready for rays.

use std::{
    env,
    ffi::{CString, c_char},
    path::{Path, PathBuf},
    ptr,
    sync::Arc,
};

use render::{
    intersect::TracedScene,
    scene::{LoadOptions, load},
};

use crate::{
    boundary::{Output, free, guard, object, text},
    outcome::{Failure, Outcome, c_string},
};

/// Names the folder that a leading `$GRIDLIGHT_SCENES` in a scene file stands for.
const SCENES_VARIABLE: &str = "GRIDLIGHT_SCENES";

/// A scene in memory, with all that is needed to trace rays in it.
#[derive(Debug)]
pub struct Scene {
    pub(crate) traced: Arc<TracedScene>,
    notes: Vec<CString>,
}

/// Loads a scene and builds its BVH, on all cores: a `.toml` file as docs/scene-format.md has it, or a
/// bare `.obj`, for which a camera and a light are chosen.
///
/// @param path The file.
/// @param scene_out Receives the scene; free it by gridlight_scene_free.
/// @return GRIDLIGHT_RESULT_SCENE if the file, or one that it names, cannot be used.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_scene_load(path: *const c_char, scene_out: *mut *mut Scene) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a string.
        let path = unsafe { text(path, "path") }?;
        // SAFETY: the caller passes the place of a pointer.
        let output = unsafe { Output::at(scene_out, "scene_out") }?;
        output.give(Scene::load(Path::new(path))?);
        Ok(())
    })
}

/// Frees a scene. Frames that were made of it stay usable.
///
/// @param scene May be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_scene_free(scene: *mut Scene) {
    // SAFETY: the caller gives the scene back.
    unsafe { free(scene) };
}

/// The picture's size that the scene file asks for, in pixels.
///
/// @param scene The scene.
/// @param width_out Receives pixels per row.
/// @param height_out Receives rows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_scene_get_size(
    scene: *const Scene,
    width_out: *mut u32,
    height_out: *mut u32,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live scene.
        let scene = unsafe { object(scene, "scene") }?;
        // SAFETY: the caller passes the place of a number.
        let width = unsafe { Output::at(width_out, "width_out") }?;
        // SAFETY: as above.
        let height = unsafe { Output::at(height_out, "height_out") }?;
        let size = scene.traced.scene().image;
        width.write(size.width);
        height.write(size.height);
        Ok(())
    })
}

/// What people should know of a scene that was loaded all the same: a texture that is missing, say.
///
/// @param scene The scene.
/// @param index Which note, from 0.
/// @return The note, which lives as long as the scene; NULL if there are no so many, or `scene` is NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_scene_note(scene: *const Scene, index: usize) -> *const c_char {
    // SAFETY: the caller passes a live scene, or NULL.
    let scene = unsafe { scene.as_ref() };
    let note = scene.and_then(|scene| scene.notes.get(index));
    note.map_or(ptr::null(), |note| note.as_ptr())
}

impl Scene {
    fn load(path: &Path) -> Result<Self, Failure> {
        let unusable = |text: String| Failure::new(Outcome::Scene, text);
        let options = env::var_os(SCENES_VARIABLE).map_or_else(LoadOptions::default, |folder| LoadOptions {
            scenes_dir: PathBuf::from(folder),
        });
        let loaded = load(path, &options).map_err(|error| unusable(error.to_string()))?;
        let traced = TracedScene::build(loaded.scene).map_err(|error| unusable(error.to_string()))?;
        Ok(Self {
            traced: Arc::new(traced),
            notes: loaded
                .notes
                .iter()
                .map(|note| c_string(&note.to_string()))
                .collect(),
        })
    }
}
