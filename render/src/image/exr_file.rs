//! The multi-layer EXR: beauty, components, G-buffer and sample counts in linear light.

use std::io::{Seek, Write};

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text, WritableImage,
    attribute::AttributeValue,
};
use glam::Vec3;
use half::f16;
use rayon::prelude::*;

use super::{Picture, WriteError};

/// Writes all layers, with the given names and texts as metadata.
///
/// Channels: `R G B`, `direct.*`, `indirect.*` and `depth.Z` as 32-bit floats, `albedo.*` and
/// `normal.*` as 16-bit floats, `samples.direct` and `samples.indirect` as 32-bit integers. Depth is 0
/// where nothing is seen, since other programs stumble over infinity. Not compressed: a deadline has no
/// time for it.
///
/// # Errors
/// When `out` cannot be written to.
pub fn write_exr(
    picture: &Picture,
    metadata: &[(String, String)],
    out: impl Write + Seek,
) -> Result<(), WriteError> {
    let size = (picture.size.width as usize, picture.size.height as usize);
    let mut attributes = LayerAttributes::default();
    for (name, text) in metadata {
        attributes
            .other
            .insert(latin_text(name), AttributeValue::Text(latin_text(text)));
    }
    let channels = AnyChannels::sort(channels(picture).into());
    let layer = Layer::new(size, attributes, Encoding::UNCOMPRESSED, channels);
    Image::from_layer(layer).write().non_parallel().to_buffered(out)?;
    Ok(())
}

fn channels(picture: &Picture) -> Vec<AnyChannel<FlatSamples>> {
    let mut channels = Vec::new();
    let single = |values: Vec<f32>| FlatSamples::F32(values);
    let half = |values: Vec<f32>| FlatSamples::F16(values.into_par_iter().map(f16::from_f32).collect());
    let mut add = |names: [&str; 3], vectors: &[Vec3], samples: &dyn Fn(Vec<f32>) -> FlatSamples| {
        for (axis, name) in names.into_iter().enumerate() {
            let values = vectors.par_iter().map(|vector| vector[axis]).collect();
            channels.push(AnyChannel::new(name, samples(values)));
        }
    };
    add(["R", "G", "B"], &picture.beauty, &single);
    add(["direct.R", "direct.G", "direct.B"], &picture.direct, &single);
    add(
        ["indirect.R", "indirect.G", "indirect.B"],
        &picture.indirect,
        &single,
    );
    add(["albedo.R", "albedo.G", "albedo.B"], &picture.albedo, &half);
    add(["normal.X", "normal.Y", "normal.Z"], &picture.normal, &half);
    let seen = |&depth: &f32| if depth.is_finite() { depth } else { 0.0 };
    let depth = picture.depth.par_iter().map(seen).collect();
    channels.push(AnyChannel::new("depth.Z", FlatSamples::F32(depth)));
    channels.push(AnyChannel::new(
        "samples.direct",
        FlatSamples::U32(picture.samples_direct.clone()),
    ));
    channels.push(AnyChannel::new(
        "samples.indirect",
        FlatSamples::U32(picture.samples_indirect.clone()),
    ));
    channels
}

/// EXR texts are Latin-1: other characters become question marks.
fn latin_text(text: &str) -> Text {
    let latin = |c: char| if u32::from(c) < 256 { c } else { '?' };
    let replaced: String = text.chars().map(latin).collect();
    Text::new_or_none(replaced).unwrap_or_default()
}
