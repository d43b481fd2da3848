//! The colour spaces of FLIP: opponent colours for filtering, Hunt-adjusted L\*a\*b\* for distances.

/// Linear Rec. 709 RGB to XYZ, and back (IEC 61966-2-1, D65).
const RGB_TO_XYZ: [[f32; 3]; 3] = [
    [0.412_391, 0.357_584, 0.180_481],
    [0.212_639, 0.715_169, 0.072_192],
    [0.019_331, 0.119_195, 0.950_532],
];
const XYZ_TO_RGB: [[f32; 3]; 3] = [
    [3.240_97, -1.537_383, -0.498_611],
    [-0.969_244, 1.875_968, 0.041_555],
    [0.055_63, -0.203_977, 1.056_972],
];

/// XYZ of RGB (1, 1, 1).
const WHITE: [f32; 3] = [0.950_456, 1.0, 1.089_058];

/// Achromatic, red-green and blue-yellow of linear RGB: `YCxCz` of \[A20\] without the factors 116,
/// 500 and 200 and the offset, which a filter that sums to 1 does not touch.
pub(super) fn opponent(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = relative_xyz(rgb);
    [y, x - y, y - z]
}

/// Linear RGB of opponent colours, clipped to what a display can show.
pub(super) fn displayable_rgb([y, red_green, blue_yellow]: [f32; 3]) -> [f32; 3] {
    let relative = [y + red_green, y, y - blue_yellow];
    let xyz = [0, 1, 2].map(|i| relative[i] * WHITE[i]);
    XYZ_TO_RGB.map(|row| dot(row, xyz).clamp(0.0, 1.0))
}

/// CIE L\*a\*b\* of linear RGB, with chroma shrunk in the dark as Hunt observed.
pub(super) fn hunt_lab(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = relative_xyz(rgb).map(|t| {
        const DELTA: f32 = 6.0 / 29.0;
        if t > DELTA.powi(3) {
            t.cbrt()
        } else {
            t / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    });
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    [lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z)]
}

/// The `HyAB` distance: lightness and chroma apart, since large differences do not add as squares.
pub(super) fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

fn relative_xyz(rgb: [f32; 3]) -> [f32; 3] {
    let xyz = RGB_TO_XYZ.map(|row| dot(row, rgb));
    [0, 1, 2].map(|i| xyz[i] / WHITE[i])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(values: [f32; 3], expected: [f32; 3], tolerance: f32) {
        for (value, expected) in values.into_iter().zip(expected) {
            assert!((value - expected).abs() < tolerance, "{values:?}");
        }
    }

    #[test]
    fn greys_have_no_chroma() {
        check(opponent([0.3; 3]), [0.3, 0.0, 0.0], 1e-5);
        check(hunt_lab([1.0; 3]), [100.0, 0.0, 0.0], 1e-2);
    }

    #[test]
    fn opponent_colours_lead_back_to_rgb() {
        for rgb in [[0.2, 0.9, 0.4], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]] {
            check(displayable_rgb(opponent(rgb)), rgb, 1e-5);
        }
        check(displayable_rgb(opponent([2.0, -1.0, 0.5])), [1.0, 0.0, 0.5], 1e-5);
    }

    #[test]
    fn red_has_its_known_lab_scaled_by_lightness() {
        // CIE L*a*b* of sRGB red: 53.24, 80.09, 67.20.
        check(
            hunt_lab([1.0, 0.0, 0.0]),
            [53.24, 0.5324 * 80.09, 0.5324 * 67.20],
            0.02,
        );
    }

    #[test]
    fn distances_add_lightness_to_chroma() {
        assert!((hyab([10.0, 3.0, 0.0], [8.0, 0.0, 4.0]) - 7.0).abs() < 1e-6);
    }
}
