//! Files with bytes changed at random: refused or shown, but never a panic, and nothing in a scene
//! that the renderer could stumble over.

use std::path::Path;

use proptest::prelude::*;
use render::scene::{LoadOptions, Scene, load};

use crate::png;

const TOML: &str = r#"# A small scene.
[camera]
eye = [0, 1.5, 4e0]
look_at = [0, 1, 0]
up = [0.0, 1, 0]
vertical_fov_degrees = 40
[image]
width = 0x40
height = 1_0
[[mesh]]
path = "a.obj"
translate = [1, -2, 3]
scale = [-1, 2, 1.5]
rotate_degrees = [10, 20, 30]
[[light.quad]]
corner = [0, 2, 0]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [10, 10, 10]
"#;
const OBJ: &str = "# obj\nmtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0 1\nv 0 1 0 0.1 0.2 0.3\nv 1 1 1.5e-1\nvt 0 0\nvt 1 0.5\nvn 0 0 1\nvn 0 1 0\ng part\nusemtl a\nf 1/1/1 2/2/1 3/1/2\nf -1//-1 -2//-1 -3//-2\nusemtl b\nf 1 2 3 \\\n4\nl 1 2 3\ns off\n";
const MTL: &str = "# mtl\nnewmtl a\nKd 0.5 0.5 0.5\nKs 0 0 0\nKe 1 2 3\nNs 10\nd 1.0\nillum 2\nmap_Kd -s 1 2 3 -o 0.5 -clamp on a.png\nnewmtl b\nKd 0 0 0\nTf 0.5 0.5 0.5\nillum 7\nmap_Kd a.jpg\n";

/// Words that are worth a try at any place.
const WORDS: &[&str] = &[
    "nan",
    "-inf",
    "1e39",
    "-1",
    "0",
    "99999999999999999999",
    "9223372036854775807",
    "/",
    "//",
    "\\\n",
    "\r",
    "\t",
    "\u{b}",
    "\u{a0}",
    "\u{0}",
    "#",
    "f 1 2 3\n",
    "v 1\n",
    "[[",
    "]",
    "=",
    "\"",
    "usemtl ",
    "newmtl ",
    "mtllib ",
    "map_Kd ",
    "$X/",
    "-s ",
    "é",
];

/// One change to a file.
#[derive(Debug, Clone)]
enum Change {
    Byte(u8),
    Insert(&'static str),
    Remove(usize),
    Repeat(usize),
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        any::<u8>().prop_map(Change::Byte),
        prop::sample::select(WORDS).prop_map(Change::Insert),
        (1usize..20).prop_map(Change::Remove),
        (1usize..40).prop_map(Change::Repeat),
    ]
}

/// Changes at places given as a part of the file's length.
fn changes() -> impl Strategy<Value = Vec<(f64, Change)>> {
    prop::collection::vec((0.0..1.0, change()), 1..6)
}

fn changed(original: &[u8], changes: &[(f64, Change)]) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for (place, change) in changes {
        let at = (place * bytes.len() as f64) as usize;
        let end = |length: usize| (at + length).min(bytes.len());
        match *change {
            Change::Byte(byte) => {
                if let Some(slot) = bytes.get_mut(at) {
                    *slot = byte;
                }
            }
            Change::Insert(word) => drop(bytes.splice(at..at, word.bytes())),
            Change::Remove(length) => drop(bytes.drain(at..end(length))),
            Change::Repeat(length) => {
                let piece = bytes[at..end(length)].to_vec();
                drop(bytes.splice(at..at, piece));
            }
        }
    }
    bytes
}

/// Everything that the documentation of [`Scene`] promises.
fn check(scene: &Scene) {
    let mesh = &scene.mesh;
    let vertices = mesh.positions.len();
    assert!(!mesh.triangles.is_empty() && !scene.emitters.is_empty());
    assert_eq!((mesh.normals.len(), mesh.uvs.len()), (vertices, vertices));
    assert_eq!(mesh.material_of.len(), mesh.triangles.len());
    assert!(
        mesh.triangles
            .iter()
            .flatten()
            .all(|&index| (index as usize) < vertices)
    );
    let in_range = |&material: &u32| (material as usize) < scene.materials.len();
    assert!(mesh.material_of.iter().all(in_range));
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
    assert!(
        mesh.normals
            .iter()
            .all(|n| n.is_normalized() || *n == glam::Vec3::ZERO)
    );
    assert!(mesh.uvs.iter().all(|uv| uv.is_finite()));
    for material in &scene.materials {
        assert!(material.kd.cmpge(glam::Vec3::ZERO).all() && material.kd.cmple(glam::Vec3::ONE).all());
        assert!(material.emission.is_finite() && material.emission.min_element() >= 0.0);
        assert!(
            material
                .kd_map
                .is_none_or(|map| (map as usize) < scene.textures.len())
        );
    }
    for texture in &scene.textures {
        let texels = texture.width as usize * texture.height as usize;
        assert!(texels > 0 && texture.texels.len() == texels);
    }
    for emitter in &scene.emitters {
        assert!(
            emitter.area() > 0.0 && emitter.normal().is_normalized(),
            "{emitter:?}"
        );
        assert!(
            emitter.power().is_finite() && emitter.power().max_element() > 0.0,
            "{emitter:?}"
        );
    }
    assert!(
        (scene.camera.look_at - scene.camera.eye)
            .try_normalize()
            .is_some()
    );
    assert!(scene.image.is_valid());
}

/// Writes the files, loads both ways, and checks what comes.
fn try_files(folder: &Path, files: &[(&str, &[u8])]) {
    for (name, bytes) in files {
        std::fs::write(folder.join(name), bytes).expect("written");
    }
    for name in ["a.toml", "a.obj"] {
        match load(&folder.join(name), &LoadOptions::default()) {
            Ok(loaded) => {
                check(&loaded.scene);
                assert!(loaded.notes.iter().all(|note| !note.to_string().is_empty()));
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn a_changed_scene_is_refused_or_shown(
        toml in changes(),
        obj in changes(),
        mtl in changes(),
        which in 1u8..8,
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        let pick = |bit: u8, original: &str, changes: &[(f64, Change)]| {
            if which & bit == 0 { original.as_bytes().to_vec() } else { changed(original.as_bytes(), changes) }
        };
        let jpeg = crate::encoded(&image::DynamicImage::new_rgb8(9, 9), image::ImageFormat::Jpeg);
        try_files(folder.path(), &[
            ("a.toml", &pick(1, TOML, &toml)),
            ("a.obj", &pick(2, OBJ, &obj)),
            ("a.mtl", &pick(4, MTL, &mtl)),
            ("a.png", &png(3, 3, [1, 2, 3])),
            ("a.jpg", &jpeg),
        ]);
    }

    #[test]
    fn a_changed_picture_is_refused_or_shown(png_changes in changes(), jpeg_changes in changes()) {
        let folder = tempfile::tempdir().expect("a folder");
        let noise = image::RgbImage::from_fn(24, 24, |x, y| image::Rgb([(x * 37 + y * 91) as u8; 3]));
        let noise = image::DynamicImage::from(noise);
        let png = crate::encoded(&noise, image::ImageFormat::Png);
        let jpeg = crate::encoded(&noise, image::ImageFormat::Jpeg);
        try_files(folder.path(), &[
            ("a.toml", TOML.as_bytes()),
            ("a.obj", OBJ.as_bytes()),
            ("a.mtl", MTL.as_bytes()),
            ("a.png", &changed(&png, &png_changes)),
            ("a.jpg", &changed(&jpeg, &jpeg_changes)),
        ]);
    }
}

#[test]
fn the_unchanged_scene_is_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let jpeg = crate::encoded(&image::DynamicImage::new_rgb8(9, 9), image::ImageFormat::Jpeg);
    try_files(
        folder.path(),
        &[
            ("a.toml", TOML.as_bytes()),
            ("a.obj", OBJ.as_bytes()),
            ("a.mtl", MTL.as_bytes()),
            ("a.png", &png(3, 3, [1, 2, 3])),
            ("a.jpg", &jpeg),
        ],
    );
    let scene = load(&folder.path().join("a.toml"), &LoadOptions::default());
    assert_eq!(scene.expect("valid").scene.mesh.triangles.len(), 6);
}

#[test]
fn nesting_without_end_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let deep = |piece: &str| piece.repeat(100_000);
    for scene in [
        format!("a = {}", deep("[")),
        format!("a = {}", deep("{a=")),
        format!("{}a = 1", deep("a.")),
        format!("[{}a]", deep("a.")),
        format!("[[{}a]]", deep("a.")),
        format!("a = {{ {}a = 1 }}", deep("a.")),
        deep("[a]\n"),
        deep("[[mesh]]\n"),
    ] {
        try_files(folder.path(), &[("a.toml", scene.as_bytes())]);
    }
}
