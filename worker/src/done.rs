//! What the threads tell the client's loop: the one channel between light and bytes.

use std::any::Any;
use std::sync::Arc;

use protocol::message::Prepared;
use protocol::{Digest, FrameId, Task};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};

use crate::renderer::Frame;
use crate::scene_cache::Found;
use crate::state::Outcome;

/// Something that was asked for is done.
#[derive(Debug)]
pub enum Done {
    /// What there is of a scene, or why it is none.
    Found(anyhow::Result<Found>),
    /// A chunk of this scene was taken, or why not.
    Chunk(Digest, anyhow::Result<()>),
    /// A scene is in memory, or why not.
    Scene(anyhow::Result<Prepared>),
    /// A frame is set up, or why not.
    Frame(FrameId, anyhow::Result<Arc<dyn Frame>>),
    /// A slot has finished a task.
    Task(FrameId, Task, Outcome),
}

/// The threads' end of a session's channel. What is done for a session that is over goes nowhere.
/// It needs no bound of its own: only as much can be done as was asked for.
pub type DoneSender = UnboundedSender<Done>;

/// The loop's end.
pub type DoneReceiver = UnboundedReceiver<Done>;

/// What a panic said.
pub(crate) fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("the renderer panicked: {}", text.unwrap_or("no text"))
}
