//! How weak a grating the eye still sees: the contrast sensitivity function \[D93\] (section 3).

use super::display::Viewing;

/// Bandwidth constant ε of \[D93\].
const EPS: f64 = 0.9;

/// Sensitivity at the best frequency.
const PEAK: f64 = 250.0;

/// Loss of sensitivity in oblique directions.
const OBLIQUE: f64 = 0.78;

/// Sensitivity S of an eye in one state of adaptation and accommodation, for an image of one area.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContrastSensitivity {
    a: f64,
    b: f64,
    area: f64,
    accommodation: f64,
}

impl ContrastSensitivity {
    /// For an eye adapted to a luminance (cd/m²), `viewing` an image of `area` square degrees.
    pub(super) fn new(adaptation: f64, area: f64, viewing: &Viewing) -> Self {
        Self {
            a: 0.801 * (1.0 + 0.7 / adaptation).powf(-0.2),
            b: 0.3 * (1.0 + 100.0 / adaptation).powf(0.15),
            area,
            accommodation: 0.856 * viewing.distance.powf(0.14),
        }
    }

    /// Sensitivity to a grating of `rho` cycles per degree whose wave vector has this angle.
    ///
    /// Zero at zero frequency.
    pub(super) fn at(&self, rho: f64, degrees: f64) -> f64 {
        if rho <= 0.0 {
            return 0.0;
        }
        let orientation = 0.5 * ((1.0 - OBLIQUE) * (4.0 * degrees.to_radians()).cos() + (1.0 + OBLIQUE));
        let scaled = rho / (self.accommodation * orientation);
        PEAK * self.along_axis(scaled).min(self.along_axis(rho))
    }

    /// S1 of the specification.
    fn along_axis(&self, r: f64) -> f64 {
        let r = r.max(1e-12);
        let falloff = (-self.b * EPS * r).exp();
        let size = ((3.23 * (r * r * self.area).powf(-0.3)).powi(5) + 1.0).powf(-0.2);
        // exp(-x) sqrt(1 + 0.06 exp(x)), written so that it cannot overflow.
        size * self.a * EPS * r * (falloff * (falloff + 0.06)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(value: f64, expected: f64) {
        assert!(
            (value / expected - 1.0).abs() < 5e-6,
            "{value} instead of {expected}"
        );
    }

    #[test]
    fn sensitivities_have_the_values_of_section_9() {
        let csf = ContrastSensitivity::new(25.0, 100.0, &Viewing::default());
        check(csf.accommodation, 0.776_836);
        for (rho, degrees, expected) in [
            (1.0, 0.0, 124.626),
            (5.0, 0.0, 157.057),
            (5.0, 45.0, 123.346),
            (10.0, 0.0, 67.7440),
            (15.0, 30.0, 19.1358),
        ] {
            check(csf.at(rho, degrees), expected);
        }
    }

    #[test]
    fn sensitivity_is_zero_at_zero_frequency_and_finite_at_absurd_ones() {
        let csf = ContrastSensitivity::new(25.0, 100.0, &Viewing::default());
        assert!(csf.at(0.0, 0.0).abs() < f64::MIN_POSITIVE);
        assert!(csf.at(1e9, 0.3).abs() < 1e-300);
    }
}
