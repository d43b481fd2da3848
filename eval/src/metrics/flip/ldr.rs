//! LDR-FLIP of two pictures of linear RGB within 0..1 \[A20\].

use super::color::{displayable_rgb, hunt_lab, hyab};
use super::feature::Features;
use super::filter::{Opponent, blur, opponent_planes};
use crate::image::Pair;
use crate::plane::Plane;

/// Exponent of the colour difference.
const QC: f32 = 0.7;

/// Differences below this share of the largest are spread over 0..`PT`, others over the rest.
const PC: f32 = 0.4;
const PT: f32 = 0.95;

/// One of the two pictures as an eye sees it.
struct Seen {
    lab: Vec<[f32; 3]>,
    features: Features,
}

/// FLIP of encoded pictures at each pixel.
pub(super) fn encoded(pair: &Pair<'_>, pixels_per_degree: f64) -> Plane {
    let (reference, image) = (pair.reference().linear(), pair.image().linear());
    difference(pair.width(), &reference.data, &image.data, pixels_per_degree)
}

/// FLIP of pictures of linear RGB at each pixel, 0..1.
pub(super) fn difference(
    width: usize,
    reference: &[[f32; 3]],
    image: &[[f32; 3]],
    pixels_per_degree: f64,
) -> Plane {
    let seen = [reference, image].map(|pixels| Seen::new(width, pixels, pixels_per_degree));
    let [reference, image] = &seen;
    let redistribute = redistribution();
    let mut difference = reference.features.difference(&image.features);
    let colors = reference.lab.iter().zip(&image.lab);
    for (value, (&reference, &image)) in difference.data.iter_mut().zip(colors) {
        *value = redistribute(hyab(reference, image)).powf(1.0 - *value);
    }
    difference
}

impl Seen {
    fn new(width: usize, pixels: &[[f32; 3]], pixels_per_degree: f64) -> Self {
        let planes = opponent_planes(width, pixels);
        let lab = lab(&blur(&planes, pixels_per_degree));
        Self {
            lab,
            features: Features::of(&planes[0], pixels_per_degree),
        }
    }
}

fn lab([achromatic, red_green, blue_yellow]: &Opponent) -> Vec<[f32; 3]> {
    let chroma = red_green.data.iter().zip(&blue_yellow.data);
    let pixels = achromatic.data.iter().zip(chroma);
    pixels
        .map(|(&y, (&rg, &by))| hunt_lab(displayable_rgb([y, rg, by])))
        .collect()
}

/// Maps distances of colour to 0..1, compressing the large ones; the largest is that of green and
/// blue.
fn redistribution() -> impl Fn(f32) -> f32 {
    let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(hunt_lab);
    let largest = hyab(green, blue).powf(QC);
    let knee = PC * largest;
    move |distance| {
        let power = distance.powf(QC);
        if power < knee {
            PT / knee * power
        } else {
            PT + (power - knee) / (largest - knee) * (1.0 - PT)
        }
    }
}
