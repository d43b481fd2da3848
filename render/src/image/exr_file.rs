//! The multi-layer EXR: beauty, components, G-buffer and sample counts in linear light.

use std::io::{Seek, Write};

use exr::{
    block::lines::LineRefMut,
    image::write::samples::{SamplesWriter, WritableSamples},
    math::RoundingMode,
    meta::{
        attribute::{LevelMode, SampleType},
        header::Header,
    },
    prelude::{
        AnyChannel, AnyChannels, Encoding, Image, Layer, LayerAttributes, Text, WritableImage,
        attribute::AttributeValue,
    },
};
use glam::Vec3;
use half::f16;

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

/// One channel, read from the picture while it is written: a copy would take more time than the file.
#[derive(Debug, Clone, Copy)]
enum Plane<'a> {
    /// One axis of vectors, as 32-bit floats.
    Single(&'a [Vec3], usize),
    /// One axis of vectors, as 16-bit floats.
    Half(&'a [Vec3], usize),
    /// Distances, of which infinity is written as 0.
    Depth(&'a [f32]),
    /// Integers.
    Count(&'a [u32]),
}

/// A plane and the length of its rows.
#[derive(Debug)]
struct PlaneRows<'a> {
    plane: Plane<'a>,
    width: usize,
}

impl<'a> WritableSamples<'a> for Plane<'_> {
    type Writer = PlaneRows<'a>;

    fn sample_type(&self) -> SampleType {
        match self {
            Self::Single(..) | Self::Depth(_) => SampleType::F32,
            Self::Half(..) => SampleType::F16,
            Self::Count(_) => SampleType::U32,
        }
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&'a self, header: &Header) -> PlaneRows<'a> {
        PlaneRows {
            plane: *self,
            width: header.layer_size.width(),
        }
    }
}

impl SamplesWriter for PlaneRows<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let begin = line.location.position.y() * self.width + line.location.position.x();
        let here = begin..begin + line.location.sample_count;
        let bytes = line.value;
        match self.plane {
            Plane::Single(vectors, axis) => {
                put(
                    bytes,
                    vectors[here].iter().map(|vector| vector[axis].to_le_bytes()),
                );
            }
            Plane::Half(vectors, axis) => {
                let halves = vectors[here].iter().map(|vector| f16::from_f32(vector[axis]));
                put(bytes, halves.map(f16::to_le_bytes));
            }
            Plane::Depth(depths) => {
                let seen = |&depth: &f32| if depth.is_finite() { depth } else { 0.0 };
                put(bytes, depths[here].iter().map(|depth| seen(depth).to_le_bytes()));
            }
            Plane::Count(counts) => put(bytes, counts[here].iter().map(|count| count.to_le_bytes())),
        }
    }
}

fn put<const N: usize>(bytes: &mut [u8], samples: impl Iterator<Item = [u8; N]>) {
    for (place, sample) in bytes.as_chunks_mut().0.iter_mut().zip(samples) {
        *place = sample;
    }
}

fn channels<'a>(picture: &'a Picture) -> Vec<AnyChannel<Plane<'a>>> {
    let aovs = &*picture.aovs;
    let mut channels = Vec::new();
    let mut add = |names: [&str; 3], plane: fn(&'a [Vec3], usize) -> Plane<'a>, vectors: &'a [Vec3]| {
        let planes = (0..).map(|axis| plane(vectors, axis));
        channels.extend(
            names
                .into_iter()
                .zip(planes)
                .map(|(name, plane)| AnyChannel::new(name, plane)),
        );
    };
    add(["R", "G", "B"], Plane::Single, &picture.beauty);
    add(
        ["direct.R", "direct.G", "direct.B"],
        Plane::Single,
        &picture.direct,
    );
    add(
        ["indirect.R", "indirect.G", "indirect.B"],
        Plane::Single,
        &picture.indirect,
    );
    add(["albedo.R", "albedo.G", "albedo.B"], Plane::Half, &aovs.albedo);
    add(["normal.X", "normal.Y", "normal.Z"], Plane::Half, &aovs.normal);
    channels.push(AnyChannel::new("depth.Z", Plane::Depth(&aovs.depth)));
    let counts = [
        ("samples.direct", &picture.samples_direct),
        ("samples.indirect", &picture.samples_indirect),
    ];
    channels.extend(counts.map(|(name, counts)| AnyChannel::new(name, Plane::Count(counts))));
    channels
}

/// EXR texts are Latin-1: other characters become question marks.
fn latin_text(text: &str) -> Text {
    let latin = |c: char| if u32::from(c) < 256 { c } else { '?' };
    let replaced: String = text.chars().map(latin).collect();
    Text::new_or_none(replaced).unwrap_or_default()
}
