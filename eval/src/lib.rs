//! Judges pictures: files → images → a pair of one size and encoding → metrics → table, JSON, maps.
//! Judges schedulers: a virtual grid → pictures of what came back in time → the paper's experiments.

pub mod image_io;

pub mod image;

pub mod color;
pub mod plane;

pub mod metrics;

pub mod compare;

pub mod export;

pub mod grid;
pub mod paper;

pub mod cli;
