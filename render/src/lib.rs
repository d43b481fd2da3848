//! Scenes, tasks, samples, buffers, reconstruction and images: a library without sockets or clocks.
//!
//! The modules stand in the order of the data's way: a [`scene`] is made ready for rays ([`intersect`]),
//! its [`camera`]'s pixels are spread over groups ([`pixel_group`]), each [`task`] of a frame
//! ([`settings`], [`frame`]) samples one component of the light ([`gbuffer`], [`section`], [`direct`], [`vpl`]), the
//! samples are added up ([`buffer`]), what is missing is filled in ([`reconstruct`]) and an [`image`]
//! comes out.

pub mod scene;

pub mod camera;
mod curve;
pub mod intersect;
pub mod light;
pub mod path;
pub mod sample;

pub mod pixel_group;
pub mod settings;
pub mod task;

pub mod direct;
pub mod frame;
pub mod gbuffer;
pub mod section;
pub mod vpl;

pub mod buffer;
pub mod image;
pub mod reconstruct;
