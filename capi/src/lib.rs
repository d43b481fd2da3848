//! The C library: renders tasks into the caller's memory, and runs a worker inside the caller's process.
//!
//! `include/gridlight.h` is made of this by cbindgen, and what each function promises is said there; this
//! side holds the promises. `boundary` is all that touches foreign pointers: it refuses NULL, writes
//! outputs only when nothing can fail any more, and makes a result of a panic.
#![expect(
    unsafe_code,
    reason = "this crate is the place where C meets Rust; each block says on what it rests"
)]
#![expect(
    clippy::missing_safety_doc,
    reason = "callers are in C, and their header says once what pointers must be"
)]
#![expect(
    clippy::doc_markdown,
    reason = "the comments become those of a C header, where a name is a name"
)]

mod boundary;
pub mod outcome;

pub mod scene;
pub mod settings;

pub mod frame;
pub mod gbuffer;
pub mod task;

pub mod worker;
