//! `gridlight_gbuffer`: what each pixel of a frame sees first.

use bytemuck::cast_slice;
use render::gbuffer::{Aovs, trace_aovs};

use crate::{
    boundary::{Output, OutputArray, free, guard, object},
    frame::Frame,
    outcome::Outcome,
};

/// What each pixel sees first, row after row from the top.
#[derive(Debug)]
pub struct GBuffer(Aovs);

/// Traces the centres of all pixels of a frame, on all cores.
///
/// @param frame The frame.
/// @param gbuffer_out Receives the G-buffer; free it by gridlight_gbuffer_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_gbuffer_trace(
    frame: *const Frame,
    gbuffer_out: *mut *mut GBuffer,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live frame.
        let frame = unsafe { object(frame, "frame") }?;
        // SAFETY: the caller passes the place of a pointer.
        let output = unsafe { Output::at(gbuffer_out, "gbuffer_out") }?;
        output.give(GBuffer(trace_aovs(&frame.scene, frame.settings.size)));
        Ok(())
    })
}

/// Frees a G-buffer.
///
/// @param gbuffer May be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_gbuffer_free(gbuffer: *mut GBuffer) {
    // SAFETY: the caller gives the G-buffer back.
    unsafe { free(gbuffer) };
}

/// The diffuse albedo: R, G, B for each pixel, 0 where nothing is seen.
///
/// @param gbuffer The G-buffer.
/// @param room Number of elements that `albedo_out` has room for; 3 * width * height are needed.
/// @param albedo_out Receives the albedo.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_gbuffer_get_albedo(
    gbuffer: *const GBuffer,
    room: usize,
    albedo_out: *mut f32,
) -> Outcome {
    // SAFETY: the caller passes a live G-buffer and the place of an array.
    unsafe {
        get(gbuffer, room, albedo_out, "albedo_out", |aovs| {
            cast_slice(&aovs.albedo)
        })
    }
}

/// The radiance that surfaces emit towards the eye: R, G, B for each pixel, in W/(m^2 sr). It is no part
/// of any task's light.
///
/// @param gbuffer The G-buffer.
/// @param room Number of elements that `emission_out` has room for; 3 * width * height are needed.
/// @param emission_out Receives the emission.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_gbuffer_get_emission(
    gbuffer: *const GBuffer,
    room: usize,
    emission_out: *mut f32,
) -> Outcome {
    // SAFETY: the caller passes a live G-buffer and the place of an array.
    unsafe {
        get(gbuffer, room, emission_out, "emission_out", |aovs| {
            cast_slice(&aovs.emission)
        })
    }
}

/// The shading normals: X, Y, Z for each pixel, of unit length, in world space, towards the eye; 0 where
/// nothing is seen.
///
/// @param gbuffer The G-buffer.
/// @param room Number of elements that `normal_out` has room for; 3 * width * height are needed.
/// @param normal_out Receives the normals.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_gbuffer_get_normal(
    gbuffer: *const GBuffer,
    room: usize,
    normal_out: *mut f32,
) -> Outcome {
    // SAFETY: the caller passes a live G-buffer and the place of an array.
    unsafe {
        get(gbuffer, room, normal_out, "normal_out", |aovs| {
            cast_slice(&aovs.normal)
        })
    }
}

/// The distance from the eye: a number for each pixel, in scene units; infinite where nothing is seen.
///
/// @param gbuffer The G-buffer.
/// @param room Number of elements that `depth_out` has room for; width * height are needed.
/// @param depth_out Receives the distances.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_gbuffer_get_depth(
    gbuffer: *const GBuffer,
    room: usize,
    depth_out: *mut f32,
) -> Outcome {
    // SAFETY: the caller passes a live G-buffer and the place of an array.
    unsafe { get(gbuffer, room, depth_out, "depth_out", |aovs| &aovs.depth) }
}

/// Copies one layer.
///
/// # Safety
/// As for [`object`] and [`OutputArray::at`].
unsafe fn get(
    gbuffer: *const GBuffer,
    room: usize,
    values_out: *mut f32,
    name: &str,
    layer: impl FnOnce(&Aovs) -> &[f32],
) -> Outcome {
    guard(|| {
        // SAFETY: by this function's contract.
        let gbuffer = unsafe { object(gbuffer, "gbuffer") }?;
        // SAFETY: as above.
        let output = unsafe { OutputArray::at(values_out, room, name) }?;
        output.fill(layer(&gbuffer.0))
    })
}
