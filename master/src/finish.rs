//! The finish phase: from buffers to files, with all cores.

use std::{
    error::Error,
    fs::File,
    io::{self, BufWriter, Write},
    mem,
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
    /// Assembles the picture; the buffers are used up by it.
    pub fn reconstruct(&mut self) -> Picture {
        assemble(&mut self.buffers, &self.aovs, self.method, self.min_set_percent)
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
        || write_to(exr.as_mut(), |out| encode_exr(picture, metadata, out)),
        || write_to(png.as_mut(), |out| encode_png(picture, exposure_stops, out)),
    );
    exr.and(png)
}

/// Encodes the EXR.
pub fn encode_exr(picture: &Picture, metadata: &[(String, String)], out: &mut File) -> anyhow::Result<()> {
    buffered(out, |out| Ok(image::write_exr(picture, metadata, out)?))
}

/// Encodes the PNG.
pub fn encode_png(picture: &Picture, exposure_stops: f32, out: &mut File) -> anyhow::Result<()> {
    buffered(out, |out| Ok(image::write_png(picture, exposure_stops, out)?))
}

fn buffered(
    out: &mut File,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut out = BufWriter::with_capacity(WRITE_BYTES, out);
    write(&mut out)?;
    Ok(out.flush()?)
}

fn write_to(
    staged: Option<&mut StagedFile>,
    encode: impl FnOnce(&mut File) -> anyhow::Result<()>,
) -> Result<(), Failure> {
    let Some(staged) = staged else {
        return Ok(());
    };
    encode(staged.file()).map_err(|error| {
        let is_full = |cause: &(dyn Error + 'static)| {
            let cause = cause.downcast_ref::<io::Error>();
            cause.is_some_and(|cause| cause.kind() == io::ErrorKind::StorageFull)
        };
        let what = if error.chain().any(is_full) {
            "the disk is full: free some space, or choose another --out"
        } else {
            "free some space, or choose another --out"
        };
        let error = error.context(format!("cannot write {} ({what})", staged.path().display()));
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
    mut material: Material,
    mut staged: StagedPicture,
    exposure_stops: f32,
    clock: Clock,
    metadata: impl FnOnce(&Coverage, Duration) -> Vec<(String, String)>,
) -> Result<Finished, Failure> {
    let (picture, reconstruct) = clock.time(|| material.reconstruct());
    let metadata = metadata(&picture.coverage, reconstruct);
    let (encoded, encode) = clock.time(|| encode(&picture, &mut staged, &metadata, exposure_stops));
    encoded?;
    let coverage = picture.coverage;
    // The process is about to end: giving back memory piece by piece would be paid out of the deadline.
    mem::forget((material, picture));
    Ok(Finished {
        staged,
        coverage,
        reconstruct,
        encode,
    })
}
