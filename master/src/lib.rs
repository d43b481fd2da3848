//! Plans a frame, hands out its tasks and delivers the picture by the deadline.
//!
//! Deciding is apart from doing: [`plan`] orders the tasks, [`scheduler`] decides who gets which and
//! what counts, [`lease`] how much of it at once, [`deadline`] decides when tracing must end, [`link`] and
//! [`flush`] when each worker must send; none of them knows a socket, a thread or a clock. Around them is the shell: [`run`] is the program's
//! table of contents, [`session`] its one loop, [`frame`] makes events of what happens and does what
//! the scheduler decides.

pub mod frame_time;
pub mod lease;
pub mod plan;
pub mod scheduler;

pub mod deadline;
pub mod flush;
pub mod link;

pub mod cli;
pub mod exit;
pub mod job;
pub mod run;

pub mod frame;
pub mod roster;
pub mod session;

pub mod admission;
pub mod connection;
pub mod doorway;
pub mod meter;
pub mod server;
pub mod wire;

pub mod warm;

pub mod local_worker;
pub mod prepare;
pub mod reference;

pub mod deliver;
pub mod finish;
pub mod rehearsal;
pub mod rehearsals;
pub mod report;
pub mod reporting;

pub mod clock;
pub mod cores;
pub mod cpu_share;
pub mod logging;
pub mod process_age;
pub mod progress;
pub mod scene_bytes;
pub mod scene_path;
