//! Colour arithmetic shared by the metrics: sRGB code values, luminance, the magma colours.

/// Weights of red, green and blue in luminance (linear values) or luma (encoded values), Rec. 709.
pub const LUMINANCE_WEIGHTS: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Decodes an sRGB code value (0..1) into linear light, IEC 61966-2-1.
#[must_use]
pub fn srgb_to_linear(code: f64) -> f64 {
    if code <= 0.04045 {
        code / 12.92
    } else {
        ((code + 0.055) / 1.055).powf(2.4)
    }
}

/// Encodes linear light (0..1) as an sRGB code value, IEC 61966-2-1.
#[must_use]
pub fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        linear * 12.92
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// Clips light to what a display can show, 0..1; NaN becomes 0.
#[must_use]
pub fn displayable(light: f64) -> f64 {
    if light > 0.0 { light.min(1.0) } else { 0.0 }
}

/// Luminance of linear RGB, luma of encoded RGB.
#[must_use]
pub fn luminance(rgb: [f32; 3]) -> f64 {
    rgb.into_iter()
        .zip(LUMINANCE_WEIGHTS)
        .map(|(value, weight)| f64::from(value) * weight)
        .sum()
}

/// Every sixteenth colour of magma, made by van der Walt and Smith for matplotlib (CC0).
///
/// Straight lines between them stay within 3/255 of the full table.
const MAGMA: [[u8; 3]; 17] = [
    [0, 0, 4],
    [10, 8, 34],
    [29, 17, 71],
    [54, 16, 107],
    [81, 18, 124],
    [106, 28, 129],
    [131, 38, 129],
    [156, 46, 127],
    [183, 55, 121],
    [207, 64, 112],
    [229, 80, 100],
    [244, 105, 92],
    [251, 135, 97],
    [254, 165, 113],
    [254, 194, 135],
    [253, 224, 161],
    [252, 253, 191],
];

/// The magma colour, as 8-bit sRGB, of a value; below 0 and above 1 the end colours, black for NaN.
#[must_use]
pub fn magma(value: f32) -> [u8; 3] {
    let position = f64::from(value.clamp(0.0, 1.0)) * (MAGMA.len() - 1) as f64;
    let index = (position as usize).min(MAGMA.len() - 2);
    let t = position - index as f64;
    std::array::from_fn(|c| {
        let (low, high) = (f64::from(MAGMA[index][c]), f64::from(MAGMA[index + 1][c]));
        (low + (high - low) * t).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_code_128_is_the_light_that_the_standard_says() {
        assert!((srgb_to_linear(128.0 / 255.0) - 0.215_861).abs() < 1e-6);
    }

    #[test]
    fn every_code_survives_decoding_and_encoding() {
        for code in 0..=255 {
            let value = f64::from(code) / 255.0;
            assert!(
                (linear_to_srgb(srgb_to_linear(value)) - value).abs() < 1e-7,
                "code {code}"
            );
        }
    }

    #[test]
    fn luminance_of_white_is_one() {
        assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn magma_runs_from_black_to_pale_yellow_and_takes_any_value() {
        assert_eq!(magma(-1.0), [0, 0, 4]);
        assert_eq!(magma(0.5), [183, 55, 121]);
        assert_eq!(magma(7.0), [252, 253, 191]);
        assert_eq!(magma(f32::NAN), [0, 0, 0]);
    }
}
