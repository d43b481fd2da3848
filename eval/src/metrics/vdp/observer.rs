//! An eye before two pictures: its channels run one after the other.

use rustfft::num_complex::Complex32;

use super::Settings;
use super::cortex::{BANDS, Cortex};
use super::csf::ContrastSensitivity;
use super::detect::Detection;
use super::display::{Viewing, contrast};
use super::masking::{Elevation, Slopes};
use super::transform::{Filter, Frequency, Transform, frequencies};

/// An eye adapted to the mean luminance of the reference, and what it looks at.
pub(super) struct Observer {
    transform: Transform,
    cortex: Cortex,
    phase_uncertainty: bool,
    /// Spectra in units of the threshold: of the reference, and of test minus reference.
    reference: Vec<Complex32>,
    difference: Vec<Complex32>,
    signals: Signals,
}

/// Images of one channel; the memory is used again for the next.
struct Signals {
    reference: Vec<f32>,
    difference: Vec<f32>,
    reference_threshold: Vec<f32>,
    test_threshold: Vec<f32>,
}

impl Observer {
    /// Shows luminances (cd/m²) of `reference` and `test` to an eye.
    pub(super) fn new(
        (width, height): (usize, usize),
        settings: &Settings,
        reference: &[f64],
        test: &[f64],
    ) -> Self {
        let adaptation = reference.iter().sum::<f64>() / reference.len() as f64;
        let contrast = contrast(adaptation);
        // The difference is formed in f64, before anything rounds: equal pictures differ by 0.
        let seen = |(reference, test): (&f64, &f64)| {
            let reference = contrast(*reference);
            (reference as f32, (contrast(*test) - reference) as f32)
        };
        let (reference, difference): (Vec<_>, Vec<_>) = reference.iter().zip(test).map(seen).unzip();

        let mut transform = Transform::new(width, height);
        let frequencies = frequencies(width, height);
        let sensitivities = sensitivities(&frequencies, reference.len(), adaptation, &settings.viewing);
        let mut weighted_spectrum = |image: &[f32]| {
            let mut spectrum = transform.spectrum(image);
            spectrum
                .iter_mut()
                .zip(&sensitivities)
                .for_each(|(value, s)| *value *= s);
            spectrum
        };
        Self {
            reference: weighted_spectrum(&reference),
            difference: weighted_spectrum(&difference),
            signals: Signals {
                reference_threshold: vec![0.0; reference.len()],
                test_threshold: vec![0.0; reference.len()],
                reference,
                difference,
            },
            cortex: Cortex::new(height, &frequencies),
            phase_uncertainty: settings.phase_uncertainty,
            transform,
        }
    }

    /// Runs all channels; one result for each of `slopes`, in their order.
    pub(super) fn detect(&mut self, slopes: &[Slopes]) -> Vec<Detection> {
        let Self {
            transform,
            cortex,
            signals,
            ..
        } = self;
        let pixels = signals.reference.len();
        let mut detections: Vec<_> = slopes.iter().map(|_| Detection::nothing(pixels)).collect();
        for band in 0..BANDS {
            let elevations = elevations(slopes, band);
            let blur = self.phase_uncertainty.then(|| cortex.phase_uncertainty(band));
            for channel in cortex.channels(band) {
                transform.channel(&self.reference, &channel, &mut signals.reference);
                transform.channel(&self.difference, &channel, &mut signals.difference);
                for (elevation, users) in &elevations {
                    signals.raise_thresholds(elevation, blur, transform);
                    for &user in users {
                        signals.add_to(&mut detections[user]);
                    }
                }
            }
        }
        detections
    }
}

impl Signals {
    fn raise_thresholds(&mut self, elevation: &Elevation, blur: Option<&Filter>, transform: &mut Transform) {
        let reference = self.reference.iter().copied();
        let test = reference
            .clone()
            .zip(&self.difference)
            .map(|(signal, change)| signal + change);
        elevation.thresholds(reference, &mut self.reference_threshold);
        elevation.thresholds(test, &mut self.test_threshold);
        if let Some(blur) = blur {
            transform.filter(&mut self.reference_threshold, blur);
            transform.filter(&mut self.test_threshold, blur);
        }
    }

    fn add_to(&self, detection: &mut Detection) {
        let thresholds = [&*self.reference_threshold, &*self.test_threshold];
        detection.add_channel(&self.difference, thresholds);
    }
}

/// Sensitivity at every frequency of a spectrum.
fn sensitivities(frequencies: &[Frequency], pixels: usize, adaptation: f64, viewing: &Viewing) -> Vec<f32> {
    let ppd = viewing.pixels_per_degree();
    let csf = ContrastSensitivity::new(adaptation, pixels as f64 / (ppd * ppd), viewing);
    let at = |frequency: &Frequency| csf.at(frequency.radius * ppd, frequency.degrees) as f32;
    frequencies.iter().map(at).collect()
}

/// The different slopes of one band, each with the places in `slopes` where it is.
fn elevations(slopes: &[Slopes], band: usize) -> Vec<(Elevation, Vec<usize>)> {
    let mut places: Vec<(f64, Vec<usize>)> = Vec::new();
    for (place, slopes) in slopes.iter().enumerate() {
        let slope = slopes.0[band];
        match places
            .iter_mut()
            .find(|(known, _)| known.to_bits() == slope.to_bits())
        {
            Some((_, users)) => users.push(place),
            None => places.push((slope, vec![place])),
        }
    }
    places
        .into_iter()
        .map(|(slope, users)| (Elevation::new(slope), users))
        .collect()
}
