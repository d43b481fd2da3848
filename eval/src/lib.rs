//! Judges pictures: files → images → a pair of one size and encoding → metrics → table, JSON, maps.

pub mod image_io;

pub mod image;

pub mod color;
pub mod plane;

pub mod metrics;

pub mod compare;

pub mod cli;
