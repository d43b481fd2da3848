//! `gridlight_settings`: the workload of a frame.

use render::{
    scene::ImageSize,
    settings::{Algorithm as AlgorithmInside, LightPoints as LightPointsInside, Settings as SettingsInside},
};

use crate::{
    boundary::{Output, free, guard, object, object_mut},
    outcome::{Failure, Outcome},
    scene::Scene,
};

/// The workload of a frame. Equal settings and scenes give equal light, bit for bit.
#[derive(Debug)]
pub struct Settings(pub(crate) SettingsInside);

/// How the work is divided into tasks.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Algorithm {
    /// Direct and indirect light are tasks of their own.
    Component = 0,
    /// A task is all light of its pixels.
    Straightforward = 1,
}

/// How a pass of direct light chooses its points on the emitters.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightPoints {
    /// The same point for every pixel.
    PerPass = 0,
    /// Another point for each pixel.
    PerPixel = 1,
}

/// Makes settings with the defaults of `master --paper` for the scene's own picture size: component by
/// component, 64 groups, 16 passes of direct light, 256 VPLs in 16 sets, an unbounded geometry term.
///
/// @param scene The scene; only its size is taken.
/// @param settings_out Receives the settings; free them by gridlight_settings_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_new(
    scene: *const Scene,
    settings_out: *mut *mut Settings,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live scene.
        let scene = unsafe { object(scene, "scene") }?;
        // SAFETY: the caller passes the place of a pointer.
        let output = unsafe { Output::at(settings_out, "settings_out") }?;
        let size = scene.traced.scene().image;
        output.give(Settings(SettingsInside::paper(AlgorithmInside::Component, size)));
        Ok(())
    })
}

/// Frees settings. Frames that were made of them stay usable.
///
/// @param settings May be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_free(settings: *mut Settings) {
    // SAFETY: the caller gives the settings back.
    unsafe { free(settings) };
}

/// Sets how the work is divided, and the number of groups to what the paper has for that.
///
/// @param settings The settings.
/// @param algorithm A gridlight_algorithm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_set_algorithm(
    settings: *mut Settings,
    algorithm: u32,
) -> Outcome {
    let change = |settings: &mut SettingsInside| {
        settings.algorithm = match algorithm {
            _ if algorithm == Algorithm::Component as u32 => AlgorithmInside::Component,
            _ if algorithm == Algorithm::Straightforward as u32 => AlgorithmInside::Straightforward,
            _ => return Err(Failure::invalid(format!("there is no algorithm {algorithm}"))),
        };
        settings.groups = SettingsInside::paper(settings.algorithm, settings.size).groups;
        Ok(())
    };
    // SAFETY: the caller passes live settings.
    unsafe { set(settings, change) }
}

/// Sets the picture's size in pixels: each side up to 16384, both together up to 2^26.
///
/// @param settings The settings.
/// @param width Pixels per row.
/// @param height Rows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_set_size(
    settings: *mut Settings,
    width: u32,
    height: u32,
) -> Outcome {
    let change = |settings: &mut SettingsInside| {
        settings.size = ImageSize { width, height };
        Ok(())
    };
    // SAFETY: the caller passes live settings.
    unsafe { set(settings, change) }
}

/// Sets the number of pixel groups, 1 to 65536; a task covers one of them.
///
/// @param settings The settings.
/// @param groups Number of groups.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_set_groups(settings: *mut Settings, groups: u32) -> Outcome {
    let change = |settings: &mut SettingsInside| {
        settings.groups = groups;
        Ok(())
    };
    // SAFETY: the caller passes live settings.
    unsafe { set(settings, change) }
}

/// Sets the number of passes of direct light, that is light samples per pixel, 1 to 65536.
///
/// @param settings The settings.
/// @param spp Number of passes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_set_spp(settings: *mut Settings, spp: u32) -> Outcome {
    let change = |settings: &mut SettingsInside| {
        settings.spp = spp;
        Ok(())
    };
    // SAFETY: the caller passes live settings.
    unsafe { set(settings, change) }
}

/// Sets the virtual point lights of indirect light.
///
/// @param settings The settings.
/// @param vpls VPLs in all sets together, 1 to 2^20.
/// @param vpl_sets Sets of equal size that they are divided into, 1 to 4096; divides `vpls`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_set_vpls(
    settings: *mut Settings,
    vpls: u32,
    vpl_sets: u32,
) -> Outcome {
    let change = |settings: &mut SettingsInside| {
        (settings.vpls, settings.vpl_sets) = (vpls, vpl_sets);
        Ok(())
    };
    // SAFETY: the caller passes live settings.
    unsafe { set(settings, change) }
}

/// Sets the seed of every random number.
///
/// @param settings The settings.
/// @param seed Any number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_set_seed(settings: *mut Settings, seed: u64) -> Outcome {
    let change = |settings: &mut SettingsInside| {
        settings.seed = seed;
        Ok(())
    };
    // SAFETY: the caller passes live settings.
    unsafe { set(settings, change) }
}

/// Sets the upper bound of the geometry term cos*cos/d^2 of virtual point lights.
///
/// @param settings The settings.
/// @param bound The bound in 1/(scene unit)^2; INFINITY for none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_set_geometry_bound(
    settings: *mut Settings,
    bound: f32,
) -> Outcome {
    let change = |settings: &mut SettingsInside| {
        settings.geometry_clamp = (bound != f32::INFINITY).then_some(bound);
        Ok(())
    };
    // SAFETY: the caller passes live settings.
    unsafe { set(settings, change) }
}

/// Sets how a pass of direct light chooses its points on the emitters.
///
/// @param settings The settings.
/// @param light_points A gridlight_light_points.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_settings_set_light_points(
    settings: *mut Settings,
    light_points: u32,
) -> Outcome {
    let change = |settings: &mut SettingsInside| {
        settings.light_points = match light_points {
            _ if light_points == LightPoints::PerPass as u32 => LightPointsInside::PerPass,
            _ if light_points == LightPoints::PerPixel as u32 => LightPointsInside::PerPixel,
            _ => {
                let text = format!("there is no choice of light points {light_points}");
                return Err(Failure::invalid(text));
            }
        };
        Ok(())
    };
    // SAFETY: the caller passes live settings.
    unsafe { set(settings, change) }
}

/// Changes settings; whether they make sense together is asked when a frame is made of them.
///
/// # Safety
/// As for [`object_mut`].
unsafe fn set(
    settings: *mut Settings,
    change: impl FnOnce(&mut SettingsInside) -> Result<(), Failure>,
) -> Outcome {
    guard(|| {
        // SAFETY: by this function's contract.
        let settings = unsafe { object_mut(settings, "settings") }?;
        change(&mut settings.0)
    })
}
