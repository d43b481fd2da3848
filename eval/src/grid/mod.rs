//! A grid of machines that exists only as numbers: the real scheduler hands out real tasks, which are
//! really rendered, but time is simulated.
//!
//! [`parameters`] say what the machines and the network are like, a [`script`] says who comes and goes,
//! [`simulate`] drives `master`'s scheduler through one frame, and [`frame`] renders the tasks it hands
//! out and makes the picture of what came back in time.

pub mod command;
pub mod frame;
pub mod parameters;
pub mod places;
pub mod script;
pub mod simulate;

mod cores;
mod link;
