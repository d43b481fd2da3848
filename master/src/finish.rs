//! The finish phase: from buffers to files, with all cores.

use std::{
    io::{self, BufWriter, Write},
    sync::Arc,
    time::Duration,
};

use render::{
    buffer::FrameBuffers,
    gbuffer::Aovs,
    image::{self, Picture},
    reconstruct::{Coverage, Reconstruction, assemble},
};

use crate::{
    clock::Clock,
    deliver::{StagedFile, StagedPicture},
    exit::{Exit, Failure},
};

/// Bytes that go to the file system in one call.
const WRITE_BYTES: usize = 1 << 20;

/// What the finish phase works on.
#[derive(Debug)]
pub struct Material {
    /// All light that has come.
    pub buffers: FrameBuffers,
    /// What the eye sees first.
    pub aovs: Arc<Aovs>,
    /// How missing pixels are filled in.
    pub method: Reconstruction,
    /// Share of pixels under which a set is left out.
    pub min_set_percent: f32,
}

impl Material {
    /// Assembles the picture.
    pub fn reconstruct(self) -> Picture {
        assemble(self.buffers, &self.aovs, self.method, self.min_set_percent)
    }
}

/// Encodes both files side by side into their temporary places.
pub fn encode(
    picture: &Picture,
    staged: &mut StagedPicture,
    metadata: &[(String, String)],
    exposure_stops: f32,
) -> Result<(), Failure> {
    let StagedPicture { exr, png } = staged;
    let (exr, png) = rayon::join(
        || encode_exr(picture, exr.as_mut(), metadata),
        || encode_png(picture, png.as_mut(), exposure_stops),
    );
    exr.and(png)
}

/// Encodes the EXR, if it is wanted.
pub fn encode_exr(
    picture: &Picture,
    staged: Option<&mut StagedFile>,
    metadata: &[(String, String)],
) -> Result<(), Failure> {
    write_to(staged, |out| Ok(image::write_exr(picture, metadata, out)?))
}

/// Encodes the PNG, if it is wanted.
pub fn encode_png(
    picture: &Picture,
    staged: Option<&mut StagedFile>,
    exposure_stops: f32,
) -> Result<(), Failure> {
    write_to(staged, |out| Ok(image::write_png(picture, exposure_stops, out)?))
}

fn write_to(
    staged: Option<&mut StagedFile>,
    write: impl FnOnce(&mut BufWriter<&mut std::fs::File>) -> anyhow::Result<()>,
) -> Result<(), Failure> {
    let Some(staged) = staged else {
        return Ok(());
    };
    let path = staged.path().to_owned();
    let mut out = BufWriter::with_capacity(WRITE_BYTES, staged.file());
    let written = write(&mut out).and_then(|()| Ok(out.flush()?));
    written.map_err(|error| {
        let what = match error.downcast_ref::<io::Error>() {
            Some(error) if error.kind() == io::ErrorKind::StorageFull => "the disk is full",
            _ => "free some space, or choose another --out",
        };
        let error = error.context(format!("cannot write {} ({what})", path.display()));
        Failure::new(Exit::Output, error)
    })
}

/// How a finish phase went.
#[derive(Debug)]
pub struct Finished {
    /// The files, ready to be put in their places.
    pub staged: StagedPicture,
    /// How much was real data.
    pub coverage: Coverage,
    /// Time to assemble.
    pub reconstruct: Duration,
    /// Time to encode.
    pub encode: Duration,
}

/// Runs the finish phase up to the files under temporary names.
///
/// `metadata` is asked for when the coverage is known.
pub fn finish(
    material: Material,
    mut staged: StagedPicture,
    exposure_stops: f32,
    clock: Clock,
    metadata: impl FnOnce(&Coverage, Duration) -> Vec<(String, String)>,
) -> Result<Finished, Failure> {
    let (picture, reconstruct) = clock.time(|| material.reconstruct());
    let metadata = metadata(&picture.coverage, reconstruct);
    let (encoded, encode) = clock.time(|| encode(&picture, &mut staged, &metadata, exposure_stops));
    encoded?;
    Ok(Finished {
        staged,
        coverage: picture.coverage,
        reconstruct,
        encode,
    })
}
