//! Scenes, tasks, samples, buffers, reconstruction and images: a library without sockets or clocks.

pub mod scene;
