//! One OBJ file: read and looked through first, turned into triangles by tobj after.

pub(super) mod text;

use std::cell::Cell;
use std::io::{BufRead, Read as _};
use std::path::Path;
use std::sync::Arc;

use self::text::Survey;
use super::error::{Place, SceneError};

/// Turns a text that was looked through into meshes, one for each run of faces of one material; the
/// mesh's material is an index into [`Survey::materials`], or `None` before the first `usemtl`.
pub(super) fn triangles(
    file: &Arc<Path>,
    text: &str,
    survey: &Survey,
) -> Result<Vec<tobj::Mesh>, SceneError> {
    // tobj asks for the materials where a library is named; here it is told all names that are used
    // at once, so that one library that is missing does not merge materials.
    let told = Cell::new(false);
    let materials = |_: &Path| {
        let names = if told.replace(true) {
            &[]
        } else {
            &survey.materials[..]
        };
        let material = |name: &String| tobj::Material {
            name: name.clone(),
            ..tobj::Material::default()
        };
        let indices = names.iter().enumerate();
        Ok((
            names.iter().map(|(name, _)| material(name)).collect(),
            indices.map(|(index, (name, _))| (name.clone(), index)).collect(),
        ))
    };
    let mut reader = (&b"mtllib materials\n"[..]).chain(text.as_bytes());
    read_meshes(&mut reader, materials).map_err(|error| SceneError::Obj {
        place: Place::line(file, 1),
        problem: format!("tobj cannot read this file: {error}"),
    })
}

fn read_meshes(
    reader: &mut impl BufRead,
    materials: impl Fn(&Path) -> tobj::MTLLoadResult,
) -> Result<Vec<tobj::Mesh>, tobj::LoadError> {
    let options = tobj::LoadOptions {
        single_index: true,
        triangulate: true,
        ..tobj::LoadOptions::default()
    };
    let (models, _) = tobj::load_obj_buf(reader, &options, materials)?;
    Ok(models.into_iter().map(|model| model.mesh).collect())
}
