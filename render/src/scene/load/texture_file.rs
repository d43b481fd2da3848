//! PNG and JPEG files as textures.

use std::io::Cursor;
use std::path::PathBuf;

use image::{ImageReader, Limits};

use super::error::{Place, SceneError};
use super::files;
use super::limits::{TEXELS_MAX, TEXTURE_BYTES_MAX, TEXTURE_SIDE_MAX};

/// A picture file that was read but not decoded.
#[derive(Debug)]
pub(super) struct TextureFile {
    named_at: Place,
    path: PathBuf,
    bytes: Vec<u8>,
    /// BLAKE3 of the bytes.
    pub(super) hash: blake3::Hash,
    /// Width times height, as the file's header says.
    pub(super) texels: u64,
}

/// The decoded picture: rows from the top.
#[derive(Debug)]
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    /// sRGB.
    pub(super) texels: Vec<[u8; 3]>,
}

impl TextureFile {
    /// Reads the file and looks at its header.
    pub(super) fn open(path: PathBuf, named_at: Place) -> Result<Self, SceneError> {
        let remedy = "check the permissions of the texture";
        let bytes = files::read(&path, TEXTURE_BYTES_MAX, Some(&named_at), remedy)?;
        let mut file = Self {
            hash: blake3::hash(&bytes),
            named_at,
            path,
            bytes,
            texels: 0,
        };
        let (width, height) = file
            .reader()
            .and_then(ImageReader::into_dimensions)
            .map_err(|error| file.malformed(&error))?;
        file.texels = u64::from(width) * u64::from(height);
        if width == 0 || height == 0 || width.max(height) > TEXTURE_SIDE_MAX {
            return Err(file.error(format!("it has {width} × {height} pixels")));
        }
        Ok(file)
    }

    /// Decodes the picture; any colour type becomes 8-bit RGB without alpha.
    pub(super) fn decode(&self) -> Result<Picture, SceneError> {
        let picture = self
            .reader()
            .and_then(ImageReader::decode)
            .map_err(|error| self.malformed(&error))?
            .into_rgb8();
        let (width, height) = picture.dimensions();
        let (texels, _) = picture.as_raw().as_chunks::<3>();
        if texels.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(self.error("it ends early".into()));
        }
        Ok(Picture {
            width,
            height,
            texels: texels.to_vec(),
        })
    }

    /// An error when all textures together are too large.
    pub(super) fn check_total(files: &[Self]) -> Result<(), SceneError> {
        let mut total = 0;
        for file in files {
            total += file.texels;
            if total > TEXELS_MAX {
                return Err(SceneError::Limit {
                    path: file.path.clone(),
                    what: "texels with the textures before",
                    count: total,
                    limit: TEXELS_MAX,
                });
            }
        }
        Ok(())
    }

    fn reader(&self) -> image::ImageResult<ImageReader<Cursor<&[u8]>>> {
        let mut reader = ImageReader::new(Cursor::new(&self.bytes[..])).with_guessed_format()?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(TEXTURE_SIDE_MAX);
        limits.max_image_height = Some(TEXTURE_SIDE_MAX);
        // 16 bits in four channels, and as much again for the decoder.
        limits.max_alloc = Some(16 * TEXELS_MAX);
        reader.limits(limits);
        Ok(reader)
    }

    fn malformed(&self, error: &image::ImageError) -> SceneError {
        self.error(error.to_string().replace('\n', " "))
    }

    fn error(&self, problem: String) -> SceneError {
        SceneError::Texture {
            named_at: self.named_at.clone(),
            path: self.path.clone(),
            problem,
        }
    }
}
