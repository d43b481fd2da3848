//! What is shown in spite of a fault, and how it is said.

use glam::Vec3;

use crate::{CAMERA, Folder, SCENE, TRIANGLE, png};

/// The notes on a mesh with a camera and a light.
fn notes(folder: Folder) -> (render::scene::Scene, Vec<String>) {
    let (loaded, notes) = folder.with("a.toml", format!("{CAMERA}{SCENE}")).loaded("a.toml");
    (loaded.scene, notes)
}

fn with_material(mtl: &str) -> Folder {
    let obj = format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}");
    Folder::new().with("a.obj", obj).with("a.mtl", mtl)
}

const GREY: Vec3 = Vec3::splat(0.5);

#[test]
fn a_missing_mtl_file_is_named_and_shows_grey() {
    // Some programs name it before every part.
    let obj = format!("\nmtllib b.mtl\nusemtl a\n{TRIANGLE}mtllib b.mtl\n");
    let (scene, notes) = notes(Folder::new().with("a.obj", obj));
    assert_eq!(
        notes,
        ["a.obj:2: b.mtl is missing; its materials show as grey 0.5"]
    );
    assert_eq!(scene.materials[0].name, "a");
    assert_eq!(scene.materials[0].kd, GREY);
}

#[test]
fn a_missing_texture_is_named_and_shows_grey() {
    let (scene, notes) = notes(with_material("newmtl a\nKd 1 0 0\nmap_Kd wood.png\n"));
    assert_eq!(
        notes,
        ["a.mtl:3: texture wood.png is missing; material `a` shows as grey 0.5"]
    );
    assert_eq!(scene.materials[0].kd, GREY);
    assert_eq!(scene.materials[0].kd_map, None);
    assert!(scene.textures.is_empty());
}

#[test]
fn an_mtl_file_without_materials_is_no_error() {
    let (_, notes) = notes(with_material("# Material Count: 0\n\n"));
    assert_eq!(notes, ["a.obj:6: no MTL file has `a`; shown as grey 0.5"]);
}

#[test]
fn unknown_materials_are_named_and_show_grey() {
    let obj = format!("{TRIANGLE}mtllib a.mtl\nusemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n");
    let folder = Folder::new().with("a.obj", obj);
    let (scene, notes) = notes(folder.with("a.mtl", "newmtl a\nKd 1 1 1\n"));
    assert_eq!(
        notes,
        [
            "a.obj: 1 triangles have no material; shown as grey 0.5",
            "a.obj:7: no MTL file has `b`, `c`; shown as grey 0.5"
        ]
    );
    let grey = |material: &render::scene::Material| material.kd == GREY;
    assert!(scene.materials[..3].iter().all(grey));
    assert_eq!(scene.mesh.material_of[..3], [2, 0, 1]);
}

#[test]
fn a_file_with_other_capitals_is_taken_and_named() {
    let obj = format!("mtllib A.MTL\nusemtl a\n{TRIANGLE}");
    let folder = Folder::new()
        .with("a.obj", obj)
        .with("a.mtl", "newmtl a\nmap_Kd tex\\Wood.PNG\n")
        .with("Tex/wood.png", png(1, 1, [255, 0, 0]));
    let (scene, notes) = notes(folder);
    assert_eq!(
        notes,
        [
            "a.obj:1: there is no file of exactly this name; a.mtl was taken",
            "a.mtl:2: there is no file of exactly this name; Tex/wood.png was taken"
        ]
    );
    assert_eq!(scene.textures[0].texels, [[255, 0, 0]]);
}

#[test]
fn a_mesh_with_other_capitals_is_taken_and_named_once() {
    let text = "[[mesh]]\npath = 'A.obj'\n".repeat(2);
    let folder = Folder::new().with("a.obj", TRIANGLE);
    let (_, notes) = folder
        .with("a.toml", format!("{CAMERA}{text}{SCENE}"))
        .loaded("a.toml");
    assert_eq!(
        notes,
        [
            "a.toml:5:8: there is no file of exactly this name; a.obj was taken",
            "a.obj: 1 triangles have no material; shown as grey 0.5"
        ]
    );
}

#[test]
fn what_is_shown_as_diffuse_is_said_once_for_each_mtl_file() {
    let names = ["m1", "m2", "m3", "m4", "m5"];
    let faces = names.map(|name| format!("usemtl {name}\nf 1 2 3\n"));
    let obj = TRIANGLE.replace("f 1 2 3\n", "mtllib a.mtl\n") + &faces.concat();
    let mirrors = names.map(|name| format!("newmtl {name}\nKd 0 0 0\nKs 0.9 0.9 0.9\nillum 3\n"));
    let mtl = mirrors.concat() + "newmtl unused\nKd 2 2 2\n";
    let (scene, notes) = notes(Folder::new().with("a.obj", obj).with("a.mtl", mtl));
    assert_eq!(
        notes,
        ["a.mtl: mirrors are not rendered, shown as diffuse: `m1`, `m2`, `m3`, `m4` and 1 more"]
    );
    assert_eq!(scene.materials[4].kd, Vec3::splat(0.9));
}

#[test]
fn meshes_that_share_an_mtl_file_say_the_same_once() {
    let obj = format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}");
    let folder = Folder::new()
        .with("a.obj", &obj)
        .with("b.obj", &obj)
        .with("a.mtl", "newmtl a\nKd 2 2 2\n");
    let text = format!("{CAMERA}{SCENE}[[mesh]]\npath = 'b.obj'\n");
    let (_, notes) = folder.with("a.toml", text).loaded("a.toml");
    assert_eq!(notes, ["a.mtl: albedo (Kd) clamped into 0 to 1: `a`"]);
}

#[test]
fn albedo_beyond_one_is_clamped_and_said() {
    let (scene, notes) = notes(with_material("newmtl a\nKd 1.2 0.5 -0.1\n"));
    assert_eq!(notes, ["a.mtl: albedo (Kd) clamped into 0 to 1: `a`"]);
    assert_eq!(scene.materials[0].kd, Vec3::new(1.0, 0.5, 0.0));
}

#[test]
fn degenerate_triangles_are_dropped_and_counted_in_one_note() {
    let obj = format!("usemtl a\nmtllib a.mtl\n{TRIANGLE}f 1 1 2\nv 2 0 0\nf 1 2 4\n");
    let folder = Folder::new()
        .with("a.obj", &obj)
        .with("b.obj", format!("{obj}f 3 3 3\n"))
        .with("a.mtl", "newmtl a\nKd 1 1 1\nKe 1 1 1\n")
        .with(
            "a.toml",
            format!("{CAMERA}[[mesh]]\npath = 'a.obj'\n[[mesh]]\npath = 'b.obj'\n[[mesh]]\npath = 'a.obj'"),
        );
    let (loaded, notes) = folder.loaded("a.toml");
    assert_eq!(
        notes,
        ["7 triangles without area were dropped: 4 of a.obj, 3 of b.obj"]
    );
    assert_eq!(loaded.scene.mesh.triangles.len(), 3);
    assert_eq!(loaded.scene.mesh.material_of.len(), 3);
    assert_eq!(loaded.scene.emitters.len(), 3);
}

#[test]
fn normals_and_texture_coordinates_that_are_not_finite_become_zero() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt nan 0\nvn inf 0 0\nvn 0 0 1\nvt 0.5 0.5\nf 1/1/1 2/2/2 3/1/2\n";
    let (scene, notes) = notes(Folder::new().with("a.obj", obj));
    assert_eq!(
        notes[0],
        "a.obj:4: 2 normals or texture coordinates are not finite (this is the first); zero was taken"
    );
    assert_eq!(scene.mesh.normals[..3], [Vec3::ZERO, Vec3::Z, Vec3::Z]);
    assert!(scene.mesh.uvs.iter().all(|uv| uv.is_finite()));
}

#[test]
fn lines_that_are_not_obj_are_ignored_and_said() {
    let (_, notes) = notes(Folder::new().with("a.obj", format!("hello\n{TRIANGLE}hello again\n")));
    assert_eq!(
        notes[0],
        "a.obj:1: 2 lines are not OBJ (the first begins with `hello`); ignored"
    );
}

#[test]
fn a_bare_mesh_gets_a_camera_and_a_light_in_one_note() {
    let folder = Folder::new().with("a.obj", TRIANGLE);
    let (loaded, notes) = folder.loaded("a.obj");
    let [.., framed] = &notes[..] else {
        panic!("no notes")
    };
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(
        framed.starts_with("a.obj: no camera is given, framed"),
        "{framed}"
    );
    assert!(
        framed.contains("nothing emits, a quad light is put near the top"),
        "{framed}"
    );
    let scene = loaded.scene;
    assert_eq!(scene.mesh.triangles.len(), 3);
    assert_eq!(scene.emitters.len(), 1);
    assert_eq!((scene.image.width, scene.image.height), (1024, 768));
}

#[test]
fn a_bare_mesh_that_emits_gets_a_camera_only() {
    let (loaded, notes) = with_material("newmtl a\nKd 1 1 1\nKe 1 1 1\n").loaded("a.obj");
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert!(!notes[0].contains("light"), "{notes:?}");
    assert_eq!(loaded.scene.emitters.len(), 1);
    assert_eq!(loaded.scene.mesh.triangles.len(), 1);
}

#[test]
fn a_scene_without_a_camera_is_framed() {
    let folder = Folder::new().with("a.obj", TRIANGLE).with("a.toml", SCENE);
    let (_, notes) = folder.loaded("a.toml");
    let framed = notes.last().expect("a note");
    assert!(
        framed.starts_with("a.toml: no camera is given, framed"),
        "{framed}"
    );
}
