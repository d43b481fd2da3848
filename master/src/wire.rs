//! Between the words of the wire and our own.

use protocol::{message::Frame, radiance::Encoding};
use render::{
    settings::{Algorithm, LightPoints, Settings},
    task::{Component, Task},
    vpl::VplSet,
};

/// A task as the worker reads it.
pub fn task_to_wire(task: Task) -> protocol::Task {
    let component = match task.component {
        Component::Direct => protocol::Component::Direct,
        Component::Indirect => protocol::Component::Indirect,
        Component::Full => protocol::Component::Full,
    };
    protocol::Task {
        component,
        group: task.group,
        index: task.index,
        passes: task.passes,
    }
}

/// A task as a worker names it; whether there is such a task is for the scheduler to say.
pub fn task_from_wire(task: protocol::Task) -> Task {
    let component = match task.component {
        protocol::Component::Direct => Component::Direct,
        protocol::Component::Indirect => Component::Indirect,
        protocol::Component::Full => Component::Full,
    };
    Task {
        component,
        group: task.group,
        index: task.index,
        passes: task.passes,
    }
}

/// All that a worker must know of a frame, and how it is to write its results.
pub fn frame_to_wire(
    frame: protocol::FrameId,
    settings: &Settings,
    vpl_sets: &[VplSet],
    radiance: Encoding,
) -> Frame {
    Frame {
        frame,
        settings: settings_to_wire(settings),
        vpl_sets: vpl_sets.iter().map(|set| set.to_bytes().into()).collect(),
        radiance,
    }
}

/// The workload as the worker reads it.
pub fn settings_to_wire(settings: &Settings) -> protocol::settings::Settings {
    protocol::settings::Settings {
        algorithm: match settings.algorithm {
            Algorithm::Progressive => protocol::settings::Algorithm::Progressive,
            Algorithm::Component => protocol::settings::Algorithm::Component,
            Algorithm::Straightforward => protocol::settings::Algorithm::Straightforward,
        },
        width: settings.size.width,
        height: settings.size.height,
        groups: settings.groups,
        spp: settings.spp,
        vpls: settings.vpls,
        vpl_sets: settings.vpl_sets,
        seed: settings.seed,
        geometry_clamp: settings.geometry_clamp,
        light_points: match settings.light_points {
            LightPoints::PerPass => protocol::settings::LightPoints::PerPass,
            LightPoints::PerPixel => protocol::settings::LightPoints::PerPixel,
        },
    }
}
