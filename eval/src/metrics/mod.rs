//! Measures of how unlike two pictures are.

pub mod flip;
pub mod rmse;
pub mod ssim;
pub mod vdp;

mod convolve;
