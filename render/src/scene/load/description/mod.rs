//! What a TOML scene file says, checked but with no other file opened.

mod table;

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use toml::de::DeTable;

use self::table::{Document, Table};
use super::assemble::has_area;
use super::error::{Place, SceneError};
use super::limits::{self, COORDINATE_MAX, RADIANCE_MAX};
use super::transform::Transform;
use crate::scene::{CameraPose, Emitter, EmitterShape, ImageSize};

/// The picture's size when the scene file gives none.
pub(super) const IMAGE_SIZE_DEFAULT: ImageSize = ImageSize {
    width: 1024,
    height: 768,
};
/// Vertical field of view when the scene file gives none, in degrees.
pub(super) const FOV_DEFAULT: f32 = 45.0;

const FILE_KEYS: &[&str] = &["camera", "image", "mesh", "light"];
const CAMERA_KEYS: &[&str] = &["eye", "look_at", "up", "vertical_fov_degrees"];
const IMAGE_KEYS: &[&str] = &["width", "height"];
const MESH_KEYS: &[&str] = &["path", "translate", "scale", "rotate_degrees"];
const LIGHT_KEYS: &[&str] = &["quad"];
const QUAD_KEYS: &[&str] = &["corner", "edge_u", "edge_v", "radiance"];

/// The contents of a scene file.
#[derive(Debug)]
pub(super) struct Description {
    /// `None`: to be framed from the bounding box.
    pub(super) camera: Option<CameraPose>,
    pub(super) image: ImageSize,
    pub(super) meshes: Vec<MeshEntry>,
    /// Parallelograms.
    pub(super) quads: Vec<Emitter>,
}

/// One `[[mesh]]`.
#[derive(Debug)]
pub(super) struct MeshEntry {
    /// The path as it is written.
    pub(super) path: String,
    /// Where the path is written; `None` for a bare `.obj`.
    pub(super) named_at: Option<Place>,
    pub(super) transform: Transform,
}

/// Reads the text of a scene file.
pub(super) fn parse(file: &Arc<Path>, text: &str) -> Result<Description, SceneError> {
    let document = Document::new(file, text);
    let root = DeTable::parse(text).map_err(|error| SceneError::Toml {
        place: document.place(error.span().map_or(0, |span| span.start)),
        problem: error.message().trim_end().replace('\n', "; "),
    })?;
    let root = Table::new(
        &document,
        "the scene file",
        root.get_ref(),
        root.span(),
        FILE_KEYS,
    )?;
    let camera = root.table("camera", "[camera]", CAMERA_KEYS)?;
    let image = root.table("image", "[image]", IMAGE_KEYS)?;
    let meshes = root.tables("mesh", "[[mesh]]", MESH_KEYS)?;
    let quads = match root.table("light", "[light]", LIGHT_KEYS)? {
        Some(light) => light.tables("quad", "[[light.quad]]", QUAD_KEYS)?,
        None => Vec::new(),
    };
    check_count(file, "[[mesh]] entries", meshes.len(), limits::MESHES_MAX)?;
    let quads_max = limits::QUAD_LIGHTS_MAX;
    check_count(file, "[[light.quad]] entries", quads.len(), quads_max)?;
    Ok(Description {
        camera: camera.map(camera_pose).transpose()?,
        image: image.map_or(Ok(IMAGE_SIZE_DEFAULT), image_size)?,
        meshes: meshes.into_iter().map(mesh_entry).collect::<Result<_, _>>()?,
        quads: quads.into_iter().map(quad_light).collect::<Result<_, _>>()?,
    })
}

fn camera_pose(table: Table<'_>) -> Result<CameraPose, SceneError> {
    let eye = table.required("eye", "[0, 1, 4]", point(table, "eye")?)?;
    let look_at = table.required("look_at", "[0, 1, 0]", point(table, "look_at")?)?;
    let up = table.vector("up")?.unwrap_or(Vec3::Y);
    let fov = table.number("vertical_fov_degrees")?.unwrap_or(FOV_DEFAULT);
    let Some(axis) = (look_at - eye).try_normalize() else {
        return Err(table.bad_value(
            "look_at",
            "is the same point as `eye`; give a point in front of the camera",
        ));
    };
    let Some(upwards) = up.try_normalize() else {
        return Err(table.bad_value("up", "has no length; give a direction such as [0, 1, 0]"));
    };
    if axis.cross(upwards).length() < 1e-5 {
        return Err(table.bad_value(
            "up",
            "is parallel to the view from `eye` to `look_at`; give another direction, such as [0, 0, 1] for a view straight down",
        ));
    }
    if !(fov > 0.0 && fov < 180.0) {
        let problem = format!("is {fov}; give an angle between 0 and 180, such as {FOV_DEFAULT}");
        return Err(table.bad_value("vertical_fov_degrees", problem));
    }
    Ok(CameraPose {
        eye,
        look_at,
        up,
        vertical_fov_degrees: fov,
    })
}

fn image_size(table: Table<'_>) -> Result<ImageSize, SceneError> {
    let side = |key, example| {
        let value = table.count(key, ImageSize::SIDE_MAX)?;
        table.required(key, example, value)
    };
    let size = ImageSize {
        width: side("width", "1024")?,
        height: side("height", "768")?,
    };
    if size.is_valid() {
        return Ok(size);
    }
    let problem = format!(
        "and `height` make {} pixels; the limit is {}",
        size.pixel_count(),
        ImageSize::PIXELS_MAX
    );
    Err(table.bad_value("width", problem))
}

fn mesh_entry(table: Table<'_>) -> Result<MeshEntry, SceneError> {
    let path = table.required("path", "\"room.obj\"", table.text("path")?)?;
    if path.trim().is_empty() {
        return Err(table.bad_value("path", "is empty; name an .obj file"));
    }
    let scale = table.factors("scale")?.unwrap_or(Vec3::ONE);
    let sizes = limits::SCALE_MIN..=limits::SCALE_MAX;
    if !scale.abs().to_array().iter().all(|s| sizes.contains(s)) {
        let problem = format!(
            "is {scale}; give factors of a size between {:e} and {:e}",
            limits::SCALE_MIN,
            limits::SCALE_MAX
        );
        return Err(table.bad_value("scale", problem));
    }
    let rotate_degrees = table.vector("rotate_degrees")?.unwrap_or(Vec3::ZERO);
    let translate = point(table, "translate")?.unwrap_or(Vec3::ZERO);
    Ok(MeshEntry {
        path: path.to_owned(),
        named_at: Some(table.place_of("path")),
        transform: Transform::new(scale, rotate_degrees, translate),
    })
}

fn quad_light(table: Table<'_>) -> Result<Emitter, SceneError> {
    let corner = table.required("corner", "[-0.5, 2, -0.5]", point(table, "corner")?)?;
    let edge_u = table.required("edge_u", "[1, 0, 0]", point(table, "edge_u")?)?;
    let edge_v = table.required("edge_v", "[0, 0, 1]", point(table, "edge_v")?)?;
    let radiance = table.required("radiance", "[10, 10, 10]", table.vector("radiance")?)?;
    if radiance.min_element() < 0.0 || radiance.max_element() > RADIANCE_MAX {
        let problem = format!("is {radiance}; give values from 0 to {RADIANCE_MAX:e}");
        return Err(table.bad_value("radiance", problem));
    }
    let quad = Emitter {
        shape: EmitterShape::Parallelogram,
        corner,
        edge_u,
        edge_v,
        radiance,
    };
    if !has_area(edge_u, edge_v) {
        return Err(table.bad_value(
            "edge_u",
            "and `edge_v` span no area; give two edges that are not parallel",
        ));
    }
    Ok(quad)
}

/// A vector whose components are within the limit for coordinates.
fn point(table: Table<'_>, key: &'static str) -> Result<Option<Vec3>, SceneError> {
    let value = table.vector(key)?;
    match value {
        Some(value) if value.abs().max_element() > COORDINATE_MAX => Err(table.bad_value(
            key,
            format!("is {value}; coordinates may be {COORDINATE_MAX:e} at most"),
        )),
        _ => Ok(value),
    }
}

fn check_count(file: &Arc<Path>, what: &'static str, count: usize, limit: usize) -> Result<(), SceneError> {
    if count <= limit {
        return Ok(());
    }
    Err(SceneError::Limit {
        path: file.to_path_buf(),
        what,
        count: count as u64,
        limit: limit as u64,
    })
}
