//! Plans a frame, hands out its tasks and delivers the picture by the deadline.
//!
//! Deciding is apart from doing: [`plan`] orders the tasks, [`scheduler`] decides who gets which and
//! what counts; neither knows a socket, a thread or a clock.

pub mod frame_time;
pub mod plan;
pub mod scheduler;
