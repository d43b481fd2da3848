//! Where samples lie: Owen-scrambled Sobol points and the warps that turn them into directions.

pub mod pixel;
pub mod sobol;
pub mod warp;

pub use sobol::{Stream, hash};
