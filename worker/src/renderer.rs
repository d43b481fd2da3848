//! What a worker needs of a renderer. The real one is in [`crate::traced`]; tests bring their own.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use protocol::message::Frame as FrameMessage;
use protocol::{Radiance, Task};

/// Makes scenes.
pub trait Renderer: Send + fmt::Debug + 'static {
    /// Makes a scene of the bytes that a master sent, which may be wrong, and builds its BVH.
    fn load(&self, bytes: &[u8]) -> anyhow::Result<LoadedScene>;
}

/// A scene in memory.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// Makes frames.
    pub scene: Arc<dyn Scene>,
    /// Time to decode it.
    pub load: Duration,
    /// Time to build the BVH.
    pub bvh: Duration,
}

/// A scene of which frames can be rendered.
pub trait Scene: Send + Sync + fmt::Debug {
    /// Sets up a frame as a master wants it, who may be wrong.
    fn set_up(&self, frame: &FrameMessage) -> anyhow::Result<Arc<dyn Frame>>;
}

/// A frame of which tasks can be rendered, from many threads at once.
pub trait Frame: Send + Sync + fmt::Debug {
    /// Whether the frame has this task.
    fn has(&self, task: Task) -> bool;

    /// Renders a task that the frame has. `chunks` is asked again and again how many of the chunks that are
    /// left to render next; none ends the task.
    fn render(&self, task: Task, chunks: &mut dyn FnMut(usize) -> usize) -> Output;
}

/// What a task yielded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Output {
    /// The first so many pixels of the group were done.
    pub pixels: u32,
    /// Their radiance, packed as the frame wants it.
    pub radiance: Radiance,
    /// Camera rays traced.
    pub primary_rays: u64,
    /// Shadow rays traced.
    pub shadow_rays: u64,
}
