//! `eval export`: a scene as other renderers read it, so that pictures can be compared with theirs.
//!
//! The folder holds `scene.json`, one PLY for each material and one PNG for each texture of a material.
//! All of it is what the renderer itself has after loading: world space, Lambertian, quad lights as
//! triangles. Nothing has to be read again from OBJ, MTL or TOML, where programs differ.

mod ply;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::Context;
use clap::Args;
use glam::Vec3;
use render::scene::{LoadOptions, Material, Scene, Texture, Wrap, load};
use serde::Serialize;

use crate::{
    color::{linear_to_srgb, srgb_to_linear},
    grid::places,
    image_io,
};

/// The flags of `eval export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The scene: TOML, or a bare OBJ
    scene: PathBuf,
    /// The folder to write into; it is made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The folder of scenes that are not in this repository [default: `$GRIDLIGHT_SCENES`, else
    /// ../shared/scenes]
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
}

/// The content of `scene.json`.
#[derive(Debug, Serialize)]
struct Description {
    camera: CameraDescription,
    image: [u32; 2],
    meshes: Vec<MeshDescription>,
}

#[derive(Debug, Serialize)]
struct CameraDescription {
    eye: [f32; 3],
    look_at: [f32; 3],
    up: [f32; 3],
    vertical_fov_degrees: f32,
}

/// All triangles of one material.
#[derive(Debug, Serialize)]
struct MeshDescription {
    material: String,
    file: String,
    albedo: Albedo,
    /// Radiance to the side of the geometric normal, W·m⁻²·sr⁻¹; all zero for most.
    emission: [f32; 3],
}

/// What a surface reflects.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
enum Albedo {
    /// The same everywhere, linear.
    Constant([f32; 3]),
    /// An sRGB picture, bilinear, into which the material's `Kd` has been multiplied.
    Texture { file: String, clamp: bool },
}

/// Writes the scene; says where.
pub fn run(args: &ExportArgs) -> anyhow::Result<String> {
    let scenes_dir = places::shared_scenes(args.scenes.as_deref());
    let loaded = load(&args.scene, &LoadOptions { scenes_dir })?;
    fs::create_dir_all(&args.out).with_context(|| format!("cannot make {}", args.out.display()))?;
    let description = describe(&loaded.scene, &args.out)?;
    let path = args.out.join("scene.json");
    let text = serde_json::to_string_pretty(&description)?;
    fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(format!(
        "{}: {} triangles, {} materials",
        path.display(),
        loaded.scene.mesh.triangles.len(),
        description.meshes.len()
    ))
}

/// Writes the meshes and textures of a scene, and says what they are.
fn describe(scene: &Scene, folder: &Path) -> anyhow::Result<Description> {
    let pose = &scene.camera;
    let mut meshes = Vec::new();
    for (index, material) in scene.materials.iter().enumerate() {
        let triangles: Vec<usize> = (0..scene.mesh.triangles.len())
            .filter(|&triangle| scene.mesh.material_of[triangle] as usize == index)
            .collect();
        if triangles.is_empty() {
            continue;
        }
        let file = format!("mesh-{index:04}.ply");
        let path = folder.join(&file);
        fs::write(&path, ply::of_triangles(&scene.mesh, &triangles))
            .with_context(|| format!("cannot write {}", path.display()))?;
        meshes.push(MeshDescription {
            material: material.name.clone(),
            file,
            albedo: albedo(scene, material, index, folder)?,
            emission: material.emission.to_array(),
        });
    }
    Ok(Description {
        camera: CameraDescription {
            eye: pose.eye.to_array(),
            look_at: pose.look_at.to_array(),
            up: pose.up.to_array(),
            vertical_fov_degrees: pose.vertical_fov_degrees,
        },
        image: [scene.image.width, scene.image.height],
        meshes,
    })
}

fn albedo(scene: &Scene, material: &Material, index: usize, folder: &Path) -> anyhow::Result<Albedo> {
    let Some(map) = material.kd_map else {
        return Ok(Albedo::Constant(material.kd.to_array()));
    };
    let texture = &scene.textures[map as usize];
    let file = format!("texture-{index:04}.png");
    let path = folder.join(&file);
    let (width, height) = (texture.width as usize, texture.height as usize);
    image_io::write_png(&path, width, height, &multiplied(texture, material.kd))
        .with_context(|| format!("cannot write {}", path.display()))?;
    Ok(Albedo::Texture {
        file,
        clamp: texture.wrap == Wrap::Clamp,
    })
}

/// The texels times `Kd`, encoded again: most programs know a colour or a picture, not their product.
fn multiplied(texture: &Texture, kd: Vec3) -> Vec<[u8; 3]> {
    let product = |code: u8, factor: f32| {
        let linear = srgb_to_linear(f64::from(code) / 255.0) * f64::from(factor);
        (255.0 * linear_to_srgb(linear.clamp(0.0, 1.0))).round() as u8
    };
    let texel = |&[r, g, b]: &[u8; 3]| [product(r, kd.x), product(g, kd.y), product(b, kd.z)];
    texture.texels.iter().map(texel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_take_the_colour_of_their_material_in_linear_light() {
        let texture = Texture {
            width: 2,
            height: 1,
            texels: vec![[255, 128, 0], [17, 17, 17]],
            wrap: Wrap::Repeat,
        };
        assert_eq!(multiplied(&texture, Vec3::ONE), texture.texels);
        let half = multiplied(&texture, Vec3::splat(0.5));
        assert_eq!(half[0], [188, 92, 0]);
    }

    #[test]
    fn a_scene_becomes_a_folder_that_describes_itself() {
        let folder = tempfile::tempdir().unwrap();
        let args = ExportArgs {
            scene: places::scene_file("cornell-box/cornell-box.toml"),
            out: folder.path().join("new/folder"),
            scenes: None,
        };
        run(&args).unwrap();
        let text = fs::read_to_string(args.out.join("scene.json")).unwrap();
        let description: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(description["image"], serde_json::json!([512, 512]));
        let meshes = description["meshes"].as_array().unwrap();
        for mesh in meshes {
            let file = args.out.join(mesh["file"].as_str().unwrap());
            assert!(
                fs::read(&file).unwrap().starts_with(b"ply\n"),
                "{}",
                file.display()
            );
        }
        let lamps = meshes
            .iter()
            .filter(|mesh| mesh["emission"][0].as_f64() > Some(0.0));
        assert_eq!(lamps.count(), 1);
    }

    #[test]
    fn a_scene_that_is_not_there_is_named() {
        let args = ExportArgs {
            scene: "no/such/scene.toml".into(),
            out: "no/such/folder".into(),
            scenes: None,
        };
        let error = run(&args).unwrap_err().to_string();
        assert!(error.contains("no/such/scene.toml"), "{error}");
        assert!(!args.out.exists());
    }
}
