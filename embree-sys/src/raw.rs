//! Embree's C interface as bindgen reads it from the installed headers. What it
//! means is written in Embree's own documentation, not here.
#![allow(
    missing_docs,
    unreachable_pub,
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals,
    clippy::all,
    clippy::pedantic,
    clippy::undocumented_unsafe_blocks,
    clippy::allow_attributes_without_reason,
    reason = "generated code keeps the names of the C headers"
)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));
