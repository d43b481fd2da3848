//! `OpenEXR`: three channels out of however many layers and parts.

use std::io::Cursor;

use exr::meta::MetaData;
use exr::meta::attribute::Text;
use exr::meta::header::Header;
use exr::prelude::{AnyChannels, FlatSamples, Layer, ReadChannels, ReadLayers, read};

use super::{Fault, check_size};
use crate::image::{Encoding, ImageRgb};

pub(super) const NAME: &str = "OpenEXR";

const RGB: [&str; 3] = ["R", "G", "B"];

/// Reads R, G, B of the picture, or of one layer.
pub(super) fn decode(bytes: &[u8], layer: Option<&str>) -> Result<ImageRgb, Fault> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(Fault::damaged)?;
    for header in &meta.headers {
        check_size(header.layer_size.x(), header.layer_size.y())?;
    }
    let (part, channels) = find(&meta.headers, layer)?;
    check_offset(&meta.headers[part])?;

    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(Fault::damaged)?;
    let part = image.layer_data.get(part);
    part.and_then(|part| rgb(part, &channels))
        .ok_or_else(|| Fault::damaged("its channels are subsampled or differ from what its header says"))
}

/// Refuses a part that begins elsewhere than the picture: its pixels would be compared with others.
fn check_offset(header: &Header) -> Result<(), Fault> {
    let whole = header.shared_attributes.display_window.position;
    let part = header.own_attributes.layer_position;
    // A damaged file may have any numbers here.
    let (x, y) = (
        part.x().saturating_sub(whole.x()),
        part.y().saturating_sub(whole.y()),
    );
    if (x, y) == (0, 0) {
        Ok(())
    } else {
        Err(Fault::Offset(x, y))
    }
}

/// The first part that has all three channels, and their names in it.
fn find(headers: &[Header], layer: Option<&str>) -> Result<(usize, [String; 3]), Fault> {
    for (part, header) in headers.iter().enumerate() {
        let has = |name: &String| header.channels.list.iter().any(|c| c.name == *name.as_str());
        for prefix in prefixes(header, layer) {
            let names = RGB.map(|channel| format!("{prefix}{channel}"));
            if names.iter().all(has) {
                return Ok((part, names));
            }
        }
    }
    let present: Vec<_> = headers.iter().flat_map(full_names).collect();
    let wanted = RGB.map(|channel| layer.map_or(channel.into(), |l| format!("{l}.{channel}")));
    let missing: Vec<_> = wanted
        .iter()
        .filter(|name| !present.contains(name))
        .cloned()
        .collect();
    let scattered = missing.is_empty();
    Err(Fault::Channels {
        missing: if scattered { wanted.into() } else { missing },
        layers: layers(&present),
        present,
    })
}

/// The layers that have red, green and blue, by the full names of all channels.
fn layers(present: &[String]) -> Vec<String> {
    let reds = present.iter().filter_map(|name| name.strip_suffix('R'));
    let prefixes = reds.filter(|prefix| prefix.is_empty() || prefix.ends_with('.'));
    let whole = prefixes.filter(|prefix| {
        let names = ["G", "B"].map(|channel| format!("{prefix}{channel}"));
        names.iter().all(|name| present.contains(name))
    });
    whole
        .map(|prefix| prefix.trim_end_matches('.').to_owned())
        .collect()
}

/// What may stand before R, G and B in a part: the layer's name, or nothing in the layer's own part.
fn prefixes(header: &Header, layer: Option<&str>) -> Vec<String> {
    let Some(layer) = layer else {
        return vec![String::new()];
    };
    let own_part = part_name(header).is_some_and(|name| name == layer);
    let mut prefixes = vec![format!("{layer}.")];
    prefixes.extend(own_part.then(String::new));
    prefixes
}

fn part_name(header: &Header) -> Option<String> {
    header.own_attributes.layer_name.as_ref().map(Text::to_string)
}

/// Channel names with the name of their part, if it has one and the channel no layer of its own.
fn full_names(header: &Header) -> Vec<String> {
    let part = part_name(header);
    let full = |name: &Text| match &part {
        Some(part) if !name.to_string().contains('.') => format!("{part}.{name}"),
        _ => name.to_string(),
    };
    header
        .channels
        .list
        .iter()
        .map(|channel| full(&channel.name))
        .collect()
}

fn rgb(part: &Layer<AnyChannels<FlatSamples>>, names: &[String; 3]) -> Option<ImageRgb> {
    let (width, height) = (part.size.x(), part.size.y());
    let mut data = vec![[0.0; 3]; width * height];
    for (index, name) in names.iter().enumerate() {
        let mut channels = part.channel_data.list.iter();
        let samples = &channels
            .find(|channel| channel.name == *name.as_str())?
            .sample_data;
        if samples.len() != data.len() {
            return None;
        }
        data.iter_mut()
            .zip(samples.values_as_f32())
            .for_each(|(rgb, value)| rgb[index] = value);
    }
    Some(ImageRgb {
        width,
        height,
        data,
        encoding: Encoding::Linear,
    })
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "half floats come back as they went")]
mod tests {
    use super::*;
    use exr::prelude::{AnyChannel, Encoding as ExrEncoding, Image, LayerAttributes, WritableImage};
    use exr::prelude::{ImageAttributes, IntegerBounds, f16};

    /// A part of 2 × 1 pixels whose channels hold their place in the list, and that plus 0.5.
    fn part(name: Option<&str>, channels: &[&str]) -> Layer<AnyChannels<FlatSamples>> {
        let channel = |(index, name): (usize, &&str)| {
            let value = index as f32;
            let samples = vec![f16::from_f32(value), f16::from_f32(value + 0.5)];
            AnyChannel::new(*name, FlatSamples::F16(samples))
        };
        let list = channels.iter().enumerate().map(channel).collect();
        let attributes = match name {
            Some(name) => LayerAttributes::named(name),
            None => LayerAttributes::default(),
        };
        Layer::new(
            (2, 1),
            attributes,
            ExrEncoding::UNCOMPRESSED,
            AnyChannels::sort(list),
        )
    }

    fn file(parts: Vec<Layer<AnyChannels<FlatSamples>>>) -> Vec<u8> {
        let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((2, 1)));
        let mut bytes = Cursor::new(Vec::new());
        let image = Image::from_layers(attributes, parts);
        image.write().to_buffered(&mut bytes).expect("writing to memory");
        bytes.into_inner()
    }

    fn first_pixel(bytes: &[u8], layer: Option<&str>) -> [f32; 3] {
        let Ok(image) = decode(bytes, layer) else {
            panic!("no picture of layer {layer:?}")
        };
        assert_eq!(
            (image.width, image.height, image.encoding),
            (2, 1, Encoding::Linear)
        );
        assert_eq!(image.data[1], image.data[0].map(|value| value + 0.5));
        image.data[0]
    }

    #[test]
    fn layers_of_one_part_are_told_apart_by_their_prefix() {
        let names = ["R", "G", "B", "direct.R", "direct.G", "direct.B", "depth.Z"];
        let bytes = file(vec![part(None, &names)]);
        assert_eq!(first_pixel(&bytes, None), [0.0, 1.0, 2.0]);
        assert_eq!(first_pixel(&bytes, Some("direct")), [3.0, 4.0, 5.0]);
    }

    #[test]
    fn layers_in_parts_of_their_own_are_found_by_the_name_of_the_part() {
        let parts = vec![
            part(Some("albedo"), &["R", "G", "B"]),
            part(Some("direct"), &["Z", "R", "G", "B"]),
        ];
        let bytes = file(parts);
        assert_eq!(first_pixel(&bytes, None), [0.0, 1.0, 2.0]);
        assert_eq!(first_pixel(&bytes, Some("direct")), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_missing_layer_is_named_together_with_those_that_exist() {
        let bytes = file(vec![part(None, &["B", "G", "R", "direct.R"])]);
        let Err(Fault::Channels {
            missing,
            layers,
            present,
        }) = decode(&bytes, Some("direct"))
        else {
            panic!("direct.G and direct.B are missing");
        };
        assert_eq!(missing, ["direct.G", "direct.B"]);
        assert_eq!(layers, [""]);
        assert_eq!(present, ["B", "G", "R", "direct.R"]);
    }

    #[test]
    fn a_part_that_begins_elsewhere_than_the_picture_is_refused() {
        let mut moved = part(None, &["B", "G", "R"]);
        moved.attributes.layer_position = (1, 0).into();
        assert!(matches!(
            decode(&file(vec![moved]), None),
            Err(Fault::Offset(1, 0))
        ));
    }

    #[test]
    fn damaged_files_are_refused_or_read_but_never_panic() {
        let bytes = file(vec![part(None, &["B", "G", "R"])]);
        for end in 0..bytes.len() {
            assert!(decode(&bytes[..end], None).is_err(), "only {end} bytes");
        }
        for place in 8..bytes.len() {
            for flip in [1, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[place] ^= flip;
                let _ = decode(&damaged, None);
            }
        }
    }
}
