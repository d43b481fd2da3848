//! Shared pieces of the end-to-end tests: the programs as processes, their pictures, and peers that misbehave.
//!
//! The tests meet Gridlight as people and other programs do: by command lines, signals, sockets and
//! files. Nothing here looks inside, but for [`peer`], which speaks the protocol.

#![expect(
    clippy::disallowed_methods,
    reason = "wall time from outside is what a deadline means"
)]

pub mod c_program;
pub mod key;
pub mod log;
pub mod master;
pub mod network;
pub mod peer;
pub mod programs;
pub mod worker;

pub mod metrics;
pub mod oiio;
pub mod pixels;

pub mod scenes;
