//! Maps of the differences as PNG files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;

use super::Judgement;
use crate::color::magma;
use crate::image::Pair;
use crate::image_io::write_png;
use crate::metrics::rmse::relative_error_map;
use crate::metrics::vdp;
use crate::plane::Plane;

/// What the maps of each image are called: its file's name without the extension, with its place
/// before it where several have the same.
pub(super) fn names(images: &[PathBuf]) -> Vec<String> {
    let stem = |path: &PathBuf| {
        path.file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let mut counts = BTreeMap::new();
    for image in images {
        *counts.entry(stem(image)).or_insert(0) += 1;
    }
    let name = |(index, path): (usize, &PathBuf)| match stem(path) {
        stem if counts[&stem] > 1 => format!("{}-{stem}", index + 1),
        stem => stem,
    };
    images.iter().enumerate().map(name).collect()
}

/// Writes the maps of one image into a folder, which is made if it is missing.
///
/// VDP in the colours of its definition; FLIP, the relative error and 1 - SSIM in magma, where black
/// is 0 and pale yellow 1 or more.
pub(super) fn write(folder: &Path, name: &str, pair: &Pair<'_>, judgement: &Judgement) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {} for maps", folder.display()))?;
    let write = |metric: &str, pixels: &[[u8; 3]]| {
        let path = folder.join(format!("{name}.{metric}.png"));
        let written = write_png(&path, pair.width(), pair.height(), pixels);
        written.with_context(|| format!("cannot write {}", path.display()))
    };
    if let Some(vdp) = judgement.vdp.first() {
        write(
            "vdp",
            &vdp::picture(&vdp.probability, pair.reference(), pair.gain()),
        )?;
    }
    write("flip", &in_magma(&judgement.flip.map))?;
    write("error", &in_magma(&relative_error_map(pair)))?;
    if let Some(ssim) = &judgement.ssim {
        write("ssim", &in_magma(&ssim.map.map(|similarity| 1.0 - similarity)))?;
    }
    Ok(())
}

fn in_magma(plane: &Plane) -> Vec<[u8; 3]> {
    plane.data.iter().map(|&value| magma(value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_one_name_are_told_apart_by_their_place() {
        let images = ["a/render.exr", "other.png", "b/render.exr"].map(PathBuf::from);
        assert_eq!(names(&images), ["1-render", "other", "3-render"]);
    }
}
