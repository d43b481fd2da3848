//! Albedo maps: sRGB texels, bilinear lookup in linear light.

use glam::{Vec2, Vec3};

/// What lies outside the unit square of texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The picture is repeated (the default of MTL).
    #[default]
    Repeat,
    /// The edge texel goes on (`-clamp on`).
    Clamp,
}

/// An 8-bit sRGB picture, rows from the top, `[height][width][3]`.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Texels per row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// sRGB-encoded texels, `width × height` of them.
    pub texels: Vec<[u8; 3]>,
    /// Treatment of coordinates outside [0, 1].
    pub wrap: Wrap,
}

impl Texture {
    /// Linear albedo at `uv` (v upwards), bilinear between texel centres.
    pub fn lookup(&self, uv: Vec2) -> Vec3 {
        let x = uv.x * self.width as f32 - 0.5;
        let y = (1.0 - uv.y) * self.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let texel = |dx: i64, dy: i64| self.texel(x0 as i64 + dx, y0 as i64 + dy);
        let top = texel(0, 0).lerp(texel(1, 0), fx);
        let bottom = texel(0, 1).lerp(texel(1, 1), fx);
        top.lerp(bottom, fy)
    }

    fn texel(&self, x: i64, y: i64) -> Vec3 {
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        let (x, y) = match self.wrap {
            Wrap::Repeat => (x.rem_euclid(width), y.rem_euclid(height)),
            Wrap::Clamp => (x.clamp(0, width - 1), y.clamp(0, height - 1)),
        };
        let [r, g, b] = self.texels[(y * width + x) as usize];
        Vec3::new(srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b))
    }
}

/// Decodes one 8-bit sRGB code to linear light in [0, 1] (IEC 61966-2-1).
fn srgb_to_linear(code: u8) -> f32 {
    use std::sync::LazyLock;
    static TABLE: LazyLock<[f32; 256]> = LazyLock::new(|| {
        std::array::from_fn(|code| {
            let v = code as f32 / 255.0;
            if v <= 0.04045 {
                v / 12.92
            } else {
                ((v + 0.055) / 1.055).powf(2.4)
            }
        })
    });
    TABLE[usize::from(code)]
}
