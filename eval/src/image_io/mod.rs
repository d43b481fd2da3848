//! Pictures from files and back: `OpenEXR` and PFM as linear light, PNG as sRGB codes.
//!
//! The format is told by a file's first bytes, never by its name.

mod exr;
mod pfm;
mod png;

use std::path::{Path, PathBuf};

use crate::image::ImageRgb;

pub use self::png::write_png;

/// The largest picture that is read, in pixels; checked before memory is taken.
pub const PIXELS_MAX: usize = 1 << 27;

/// Why a file gives no picture.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read at all.
    #[error("cannot read {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The first bytes are of none of the formats.
    #[error(
        "{} is no picture in a format known here; give an OpenEXR, PFM or PNG file",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file begins well, but cannot be decoded.
    #[error("{} is a damaged or unusual {format} file: {reason}; write it again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The format of its first bytes.
        format: &'static str,
        /// What the decoder said.
        reason: String,
    },
    /// There are more pixels than [`PIXELS_MAX`].
    #[error("{} has {width} × {height} pixels; at most {PIXELS_MAX} in all are read", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The pixels do not begin where the picture does, so that no pixel has its own place.
    #[error(
        "{} begins at column {}, row {} of its display window: cut or fill it to the whole picture, as by \
         `oiiotool IN --croptofull -o OUT`",
        path.display(), offset.0, offset.1
    )]
    Offset {
        /// The file.
        path: PathBuf,
        /// From the display window's corner to that of the data.
        offset: (i32, i32),
    },
    /// The layer is not there, or not all of its red, green and blue.
    #[error("{} lacks {}; {}", path.display(), missing.join(", "), choice(layers, present))]
    Channels {
        /// The file.
        path: PathBuf,
        /// Full names of the channels that were wanted in vain.
        missing: Vec<String>,
        /// Layers that have all three, "" for the picture itself.
        layers: Vec<String>,
        /// Full names of all channels.
        present: Vec<String>,
    },
    /// A layer was asked for in a format that has none.
    #[error("{} is a {format} file, which has no layers: leave out --layer {layer}", path.display())]
    NoLayers {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: &'static str,
        /// The layer.
        layer: String,
    },
}

/// What is wrong with the bytes of a file; the path is added by [`read`].
enum Fault {
    Damaged(String),
    TooLarge(usize, usize),
    Offset(i32, i32),
    Channels {
        missing: Vec<String>,
        layers: Vec<String>,
        present: Vec<String>,
    },
}

impl Fault {
    #[expect(clippy::needless_pass_by_value, reason = "map_err passes errors by value")]
    fn damaged(reason: impl ToString) -> Self {
        Self::Damaged(reason.to_string())
    }
}

/// Reads a picture; of a multi-layer EXR file the channels R, G, B or, for the layer `direct`,
/// `direct.R`, `direct.G`, `direct.B`.
///
/// Values may be NaN or infinite, see [`ImageRgb::non_finite`]. Alpha is left aside.
pub fn read(path: &Path, layer: Option<&str>) -> Result<ImageRgb, ReadError> {
    let bytes = std::fs::read(path).map_err(|source| ReadError::File {
        path: path.into(),
        source,
    })?;
    let Some((format, decode)) = decoder(&bytes) else {
        return Err(ReadError::UnknownFormat { path: path.into() });
    };
    if let (Some(layer), false) = (layer, format == exr::NAME) {
        return Err(ReadError::NoLayers {
            path: path.into(),
            format,
            layer: layer.into(),
        });
    }
    decode(&bytes, layer).map_err(|fault| {
        let path = path.into();
        match fault {
            Fault::Damaged(reason) => ReadError::Damaged { path, format, reason },
            Fault::TooLarge(width, height) => ReadError::TooLarge { path, width, height },
            Fault::Offset(x, y) => ReadError::Offset { path, offset: (x, y) },
            Fault::Channels {
                missing,
                layers,
                present,
            } => ReadError::Channels {
                path,
                missing,
                layers,
                present,
            },
        }
    })
}

/// What can be compared instead of a layer that is not there.
fn choice(layers: &[String], present: &[String]) -> String {
    if layers.is_empty() {
        return format!("it has {}, and no layer with R, G and B", present.join(", "));
    }
    let flag = |layer: &String| match layer.as_str() {
        "" => "no --layer for the picture itself".to_owned(),
        layer => format!("--layer {layer}"),
    };
    let flags: Vec<String> = layers.iter().map(flag).collect();
    format!("it can be compared with {}", flags.join(", "))
}

type Decode = fn(&[u8], Option<&str>) -> Result<ImageRgb, Fault>;

/// The name and decoder of the format that the first bytes belong to.
fn decoder(bytes: &[u8]) -> Option<(&'static str, Decode)> {
    match bytes {
        [0x76, 0x2f, 0x31, 0x01, ..] => Some((exr::NAME, exr::decode)),
        [b'P', b'F' | b'f', b'\n' | b' ' | b'\r', ..] => Some((pfm::NAME, |b, _| pfm::decode(b))),
        [0x89, b'P', b'N', b'G', ..] => Some((png::NAME, |b, _| png::decode(b))),
        _ => None,
    }
}

/// Refuses a picture that is too large, before memory is taken for it.
fn check_size(width: usize, height: usize) -> Result<(), Fault> {
    match width.checked_mul(height) {
        Some(1..=PIXELS_MAX) => Ok(()),
        Some(0) => Err(Fault::damaged("it has no pixels")),
        _ => Err(Fault::TooLarge(width, height)),
    }
}
