//! Scenes, tasks, samples, buffers, reconstruction and images: a library without sockets or clocks.

pub mod pixel_group;
pub mod sample;
pub mod scene;
pub mod settings;
pub mod task;
