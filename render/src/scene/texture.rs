//! Albedo maps: sRGB texels, bilinear lookup in linear light.

use glam::{Vec2, Vec3};

/// What lies outside the unit square of texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
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
    /// Linear albedo at `uv` (v upwards), bilinear between texel centres. Coordinates that are not
    /// finite count as 0.
    pub fn lookup(&self, uv: Vec2) -> Vec3 {
        let uv = self.wrap.in_unit_square(uv);
        let x = uv.x * self.width as f32 - 0.5;
        let y = (1.0 - uv.y) * self.height as f32 - 0.5;
        let (left, right) = self.wrap.neighbours(x.floor(), self.width);
        let (above, below) = self.wrap.neighbours(y.floor(), self.height);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let top = self.texel(left, above).lerp(self.texel(right, above), fx);
        let bottom = self.texel(left, below).lerp(self.texel(right, below), fx);
        top.lerp(bottom, fy)
    }

    fn texel(&self, x: usize, y: usize) -> Vec3 {
        let [r, g, b] = self.texels[y * self.width as usize + x];
        Vec3::new(srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b))
    }
}

impl Wrap {
    /// The coordinates within [0, 1] at which the same texels are; of huge ones little is left.
    fn in_unit_square(self, uv: Vec2) -> Vec2 {
        uv.map(|coordinate| match self {
            _ if !coordinate.is_finite() => 0.0,
            Self::Repeat => coordinate - coordinate.floor(),
            Self::Clamp => coordinate.clamp(0.0, 1.0),
        })
    }

    /// A texel, which may lie one before the first, and the next one, as indices below `count`.
    fn neighbours(self, texel: f32, count: u32) -> (usize, usize) {
        let last = count as usize - 1;
        let before_first = texel < 0.0;
        let texel = (texel as usize).min(last);
        match self {
            Self::Repeat if before_first => (last, 0),
            Self::Clamp if before_first => (0, 0),
            _ if texel < last => (texel, texel + 1),
            Self::Repeat => (last, 0),
            Self::Clamp => (last, last),
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two texels side by side over two others: black, white / red, green.
    fn quartet(wrap: Wrap) -> Texture {
        Texture {
            width: 2,
            height: 2,
            texels: vec![[0; 3], [255; 3], [255, 0, 0], [0, 255, 0]],
            wrap,
        }
    }

    fn check(wrap: Wrap, uv: [f32; 2], expected: [f32; 3]) {
        let found = quartet(wrap).lookup(Vec2::from(uv));
        let expected = Vec3::from(expected);
        assert!(
            found.abs_diff_eq(expected, 1e-5),
            "{uv:?} {wrap:?}: {found} is not {expected}"
        );
    }

    #[test]
    fn texel_centres_give_the_texels_with_v_upwards() {
        for wrap in [Wrap::Repeat, Wrap::Clamp] {
            check(wrap, [0.25, 0.75], [0.0; 3]);
            check(wrap, [0.75, 0.75], [1.0; 3]);
            check(wrap, [0.25, 0.25], [1.0, 0.0, 0.0]);
            check(wrap, [0.75, 0.25], [0.0, 1.0, 0.0]);
        }
    }

    #[test]
    fn midpoints_are_means_in_linear_light() {
        check(Wrap::Clamp, [0.5, 0.75], [0.5; 3]);
        check(Wrap::Clamp, [0.25, 0.5], [0.5, 0.0, 0.0]);
        check(Wrap::Clamp, [0.5, 0.5], [0.5, 0.5, 0.25]);
    }

    #[test]
    fn codes_are_decoded_as_srgb() {
        let grey = |code| Texture {
            width: 1,
            height: 1,
            texels: vec![[code; 3]],
            wrap: Wrap::Repeat,
        };
        // 188 is the code of half the light; below 11 the curve is a straight line.
        let half = grey(188).lookup(Vec2::splat(0.3)).x;
        assert!((half - 0.502_886).abs() < 1e-5, "{half}");
        let dark = grey(10).lookup(Vec2::splat(0.3)).x;
        assert!((dark - 10.0 / 255.0 / 12.92).abs() < 1e-7, "{dark}");
    }

    #[test]
    fn repeat_goes_round() {
        check(Wrap::Repeat, [1.25, -0.25], [0.0; 3]);
        check(Wrap::Repeat, [-0.25, 1.75], [1.0; 3]);
        check(Wrap::Repeat, [0.0, 0.75], [0.5; 3]);
        check(Wrap::Repeat, [1.0, 0.75], [0.5; 3]);
        check(Wrap::Repeat, [0.25, 0.0], [0.5, 0.0, 0.0]);
    }

    #[test]
    fn clamp_goes_on_with_the_edge() {
        check(Wrap::Clamp, [-7.0, 0.75], [0.0; 3]);
        check(Wrap::Clamp, [7.0, 9.0], [1.0; 3]);
        check(Wrap::Clamp, [0.0, 0.75], [0.0; 3]);
        check(Wrap::Clamp, [1.0, -3.0], [0.0, 1.0, 0.0]);
    }

    #[test]
    fn any_coordinates_give_a_colour_between_the_texels() {
        let numbers = [
            0.0,
            -0.0,
            -1e-9,
            1.0 - f32::EPSILON,
            1e9,
            -1e9,
            f32::MAX,
            f32::MIN,
            f32::MIN_POSITIVE,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
        ];
        for wrap in [Wrap::Repeat, Wrap::Clamp] {
            for (u, v) in numbers.iter().flat_map(|&u| numbers.map(|v| (u, v))) {
                let colour = quartet(wrap).lookup(Vec2::new(u, v));
                let is_within = colour.min_element() >= 0.0 && colour.max_element() <= 1.0;
                assert!(is_within, "{u} {v} {wrap:?}: {colour}");
            }
        }
    }
}
