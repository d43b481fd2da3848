//! Loads a scene: a TOML file that names meshes, lights and the camera, or a bare OBJ file.

mod assemble;
mod description;
mod error;
mod files;
mod framing;
pub mod limits;
mod meshes;
mod model;
mod mtl;
mod note;
mod obj;
mod parallel;
mod text;
mod texture_file;
mod textures;
mod transform;

use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use self::assemble::{Assembly, Part};
use self::description::{Description, IMAGE_SIZE_DEFAULT, MeshEntry};
pub use self::error::{Place, SceneError};
use self::files::FileList;
pub use self::framing::Framing;
use self::meshes::{MeshFile, Meshes};
use self::model::Model;
use self::mtl::GREY;
pub use self::note::{Note, Simplification};
use self::parallel::in_parallel;
use self::texture_file::{Picture, TextureFile};
use self::textures::Textures;
use self::transform::Transform;
use super::{Material, Scene};

/// What the caller knows and a scene file does not.
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// The folder that a leading `$GRIDLIGHT_SCENES` in a path stands for.
    pub scenes_dir: PathBuf,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            scenes_dir: PathBuf::from("../shared/scenes"),
        }
    }
}

/// A scene, and how it came about.
#[derive(Debug, Clone)]
pub struct LoadedScene {
    /// The scene, ready to be rendered.
    pub scene: Scene,
    /// Warnings for people, in a fixed order.
    pub notes: Vec<Note>,
    /// Every file that was read: the scene file, then each mesh with its MTL files, then textures.
    pub files: Vec<PathBuf>,
    /// BLAKE3 over the names (relative to the scene file) and the bytes of these files. It does not
    /// depend on where the folders are, but changes when a missing file appears.
    pub digest: [u8; 32],
}

/// Loads a `.toml` scene, or an `.obj` mesh with a camera and, if need be, a light chosen for it.
///
/// The same files give the same scene, bit for bit.
///
/// # Errors
/// Whatever [`SceneError`] lists. What can be shown in spite of a fault (a missing texture, say) is
/// a [`Note`] instead.
pub fn load(path: &Path, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    let mut files = FileList::default();
    let mut notes = Vec::new();

    // What the scene file says.
    let kind = Kind::of(path)?;
    let description = kind.description(path, &mut files)?;

    // The meshes' files, each once.
    let meshes = Meshes::find(path, &description.meshes, options, &mut notes)?;
    let objs = all(in_parallel(&meshes.files, MeshFile::read))?;
    let models = all(in_parallel(&objs, Model::open))?;
    let mut known_notes = HashSet::new();
    for (obj, model) in objs.iter().zip(&models) {
        files.add(&obj.name, &obj.file, Some(obj.hash));
        for library in &model.libraries {
            files.add(&library.name, &library.path, library.hash);
        }
        // Models that share an MTL file have some notes in common.
        let new = |note: &&Note| known_notes.insert(note.to_string());
        notes.extend(model.notes.iter().filter(new).cloned());
    }

    // The textures' files, each once; then triangles and pictures side by side.
    let textures = Textures::find(&models, &mut files)?;
    let (parts, pictures) = decode(&models, &textures.files)?;

    // All in one.
    let mut assembly = Assembly::default();
    let dropped = assemble(&mut assembly, &models, &parts, &textures, &description, &meshes)?;
    if !dropped.is_empty() {
        notes.push(Note::DegenerateDropped { counts: dropped });
    }
    if assembly.mesh.triangles.is_empty() {
        return Err(no_triangles(path, &kind, &models));
    }
    for (index, quad) in description.quads.iter().enumerate() {
        assembly.add_quad(*quad, format!("light.quad {}", index + 1));
    }

    // A camera and a light where there are none.
    if assembly.emitters.is_empty() && kind == Kind::Toml {
        return Err(SceneError::NoLight {
            path: path.to_owned(),
        });
    }
    let camera = description.camera.unwrap_or_else(|| {
        let framing = Framing::of(&assembly.mesh, &assembly.emitters, description.image);
        if let Some(light) = framing.light {
            assembly.add_quad(light, "light of the framing".into());
        }
        let path = path.to_owned();
        notes.push(Note::Framed { path, framing });
        framing.camera
    });

    Ok(LoadedScene {
        scene: Scene {
            camera,
            image: description.image,
            mesh: assembly.mesh,
            materials: assembly.materials,
            textures: textures.pictured(pictures),
            emitters: assembly.emitters,
        },
        notes,
        digest: files.digest(),
        files: files.into_paths(),
    })
}

/// What kind of file a scene is.
#[derive(Debug, PartialEq, Eq)]
enum Kind {
    Toml,
    BareObj,
}

impl Kind {
    fn of(path: &Path) -> Result<Self, SceneError> {
        let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "toml" => Ok(Self::Toml),
            "obj" => Ok(Self::BareObj),
            _ => Err(SceneError::UnknownKind {
                path: path.to_owned(),
            }),
        }
    }

    fn description(&self, path: &Path, files: &mut FileList) -> Result<Description, SceneError> {
        if *self == Self::BareObj {
            return Ok(Description {
                camera: None,
                image: IMAGE_SIZE_DEFAULT,
                meshes: vec![MeshEntry {
                    path: String::new(),
                    named_at: None,
                    transform: Transform::default(),
                }],
                quads: Vec::new(),
            });
        }
        let bytes = files::read(path, limits::SCENE_FILE_BYTES_MAX, None, "check the path")?;
        files.add("", path, Some(blake3::hash(&bytes)));
        let file: Arc<Path> = path.into();
        let text = std::str::from_utf8(&bytes).map_err(|error| {
            let before = &bytes[..error.valid_up_to()];
            let line = before.split(|&byte| byte == b'\n').count() as u32;
            SceneError::Toml {
                place: Place::line(&file, line),
                problem: "this line is not UTF-8 text; save the file as UTF-8".into(),
            }
        })?;
        description::parse(&file, text)
    }
}

/// The triangles of each model, and each picture.
fn decode(
    models: &[Model<'_>],
    textures: &[TextureFile],
) -> Result<(Vec<Vec<tobj::Mesh>>, Vec<Picture>), SceneError> {
    enum Job<'a> {
        Model(&'a Model<'a>),
        Texture(&'a TextureFile),
    }
    enum Done {
        Meshes(Vec<tobj::Mesh>),
        Picture(Picture),
    }
    let models = models.iter().map(Job::Model);
    let jobs: Vec<Job<'_>> = models.chain(textures.iter().map(Job::Texture)).collect();
    let done = all(in_parallel(&jobs, |job| match job {
        Job::Model(model) => {
            obj::triangles(model.file, &model.text.text, &model.text.survey).map(Done::Meshes)
        }
        Job::Texture(texture) => texture.decode().map(Done::Picture),
    }))?;
    let (mut meshes, mut pictures) = (Vec::new(), Vec::new());
    for done in done {
        match done {
            Done::Meshes(parts) => meshes.push(parts),
            Done::Picture(picture) => pictures.push(picture),
        }
    }
    Ok((meshes, pictures))
}

/// Adds all meshes; gives the number of dropped triangles of each file that has some.
fn assemble(
    assembly: &mut Assembly,
    models: &[Model<'_>],
    meshes_of: &[Vec<tobj::Mesh>],
    textures: &Textures,
    description: &Description,
    meshes: &Meshes<'_>,
) -> Result<Vec<(PathBuf, u64)>, SceneError> {
    // The materials of each model, and a grey for its faces without one.
    let mut first_material = Vec::new();
    for model in models {
        first_material.push(assembly.materials.len());
        let applied = model.materials.iter().map(|m| textures.applied(m));
        assembly.materials.extend(applied);
        if model.text.survey.triangles_without_material > 0 {
            assembly.materials.push(Material {
                name: "none".into(),
                kd: GREY,
                kd_map: None,
                emission: glam::Vec3::ZERO,
            });
        }
    }
    let file_of = |model: &Model<'_>| (model.file.to_path_buf(), 0);
    let mut dropped: Vec<(PathBuf, u64)> = models.iter().map(file_of).collect();
    for (entry, &file) in description.meshes.iter().zip(&meshes.file_of) {
        let (model, parts) = (&models[file], &meshes_of[file]);
        let first_vertex = assembly.mesh.positions.len();
        let vertices = parts.iter().map(|mesh| mesh.positions.len() / 3).sum();
        let triangles = parts.iter().map(|mesh| mesh.indices.len() / 3).sum();
        assembly.check_room(model.file, vertices, triangles)?;
        for mesh in parts {
            let material = mesh.material_id.unwrap_or(model.materials.len());
            let appearance = model.materials.get(material).and_then(|m| m.appearance.as_ref());
            let part = Part {
                mesh,
                material: (first_material[file] + material) as u32,
                map: appearance.and_then(|appearance| appearance.kd_map.as_ref()),
            };
            dropped[file].1 += assembly.add(&part, &entry.transform);
        }
        if let Some(place) = &entry.named_at
            && !assembly.is_within_limits(first_vertex)
        {
            return Err(SceneError::BadValue {
                place: place.clone(),
                key: "path",
                problem: format!(
                    "is a mesh that `scale` and `translate` put beyond {:e}; make them smaller",
                    limits::COORDINATE_MAX
                ),
            });
        }
    }
    dropped.retain(|(_, count)| *count > 0);
    Ok(dropped)
}

fn no_triangles(path: &Path, kind: &Kind, models: &[Model<'_>]) -> SceneError {
    let in_files: u64 = models.iter().map(|m| m.text.survey.triangles).sum();
    let reason = match (kind, models.len()) {
        (Kind::Toml, 0) => "there is no mesh; add `[[mesh]]` with `path = \"room.obj\"`".into(),
        _ if in_files > 0 => format!("all {in_files} triangles have no area; check the mesh and its scale"),
        (Kind::Toml, _) => "no mesh has a triangle; are these OBJ files with faces (`f` lines)?".into(),
        (Kind::BareObj, _) => "there is no triangle in it; is it an OBJ file with faces (`f` lines)?".into(),
    };
    SceneError::NoTriangles {
        path: path.to_owned(),
        reason,
    }
}

/// All results, or the first error in the order of the items.
fn all<T>(results: Vec<Result<T, SceneError>>) -> Result<Vec<T>, SceneError> {
    results.into_iter().collect()
}
