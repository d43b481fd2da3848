//! The samples of a pixel: a place within it, and with the same number a point on the lights.
//!
//! Each pixel has an Owen-scrambled sequence of its own, of which every pass takes the next sample. So the
//! passes of a pixel are spread evenly over it and over the lights, and pixels do not resemble each other.

use glam::Vec2;

use super::{Stream, hash, sobol::fold_seed};

/// Sets the places' and light points' numbers apart from those of other purposes.
const SEED_PURPOSE: u32 = 0x7069_7865;

/// One pass over all pixels.
#[derive(Debug, Clone, Copy)]
pub struct PixelSamples {
    pass: u32,
    seed: u32,
}

impl PixelSamples {
    /// The samples of a pass in a frame with this seed.
    pub fn new(seed: u64, pass: u32) -> Self {
        Self {
            pass,
            seed: fold_seed(seed, SEED_PURPOSE),
        }
    }

    /// The place within a pixel, given by its row-major index, from its upper left corner.
    pub fn place(self, pixel: u32) -> Vec2 {
        self.stream(pixel).next_2d()
    }

    /// A number for the choice of a light, and a place on it.
    pub fn light(self, pixel: u32) -> (f32, Vec2) {
        let mut stream = self.stream(pixel).skip(1);
        let place = stream.next_2d();
        (stream.next_1d(), place)
    }

    fn stream(self, pixel: u32) -> Stream {
        Stream::new(self.pass, hash(self.seed, pixel))
    }
}
