//! What a scene file can say, and what comes of it.

use glam::{Vec2, Vec3};
use image::{DynamicImage, ImageFormat};
use render::scene::{EmitterShape, Scene, TriangleMesh, Wrap};

use crate::{CAMERA, Folder, SCENE, TRIANGLE, encoded, png};

fn scene(folder: Folder, text: &str) -> Scene {
    folder.with("a.toml", text).loaded("a.toml").0.scene
}

fn normal(mesh: &TriangleMesh, triangle: usize) -> Vec3 {
    let [a, b, c] = mesh.corners(triangle);
    (b - a).cross(c - a).normalize()
}

#[test]
fn all_keys_arrive_where_they_belong() {
    let text = format!(
        "[camera]\neye = [1, 2, 3]\nlook_at = [4.5, 5, 6]\nup = [0, 0, 1]\nvertical_fov_degrees = 33\n[image]\nwidth = 0x40\nheight = 48\n{SCENE}"
    );
    let scene = scene(Folder::new().with("a.obj", TRIANGLE), &text);
    assert_eq!(scene.camera.eye, Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(scene.camera.look_at, Vec3::new(4.5, 5.0, 6.0));
    assert_eq!(scene.camera.up, Vec3::Z);
    assert!((scene.camera.vertical_fov_degrees - 33.0).abs() < 1e-6);
    assert_eq!((scene.image.width, scene.image.height), (64, 48));
    assert_eq!(scene.mesh.triangles.len(), 3);
}

#[test]
fn keys_that_are_left_out_have_the_documented_defaults() {
    let scene = scene(Folder::new().with("a.obj", TRIANGLE), &format!("{CAMERA}{SCENE}"));
    assert_eq!(scene.camera.up, Vec3::Y);
    assert!((scene.camera.vertical_fov_degrees - 45.0).abs() < 1e-6);
    assert_eq!((scene.image.width, scene.image.height), (1024, 768));
}

#[test]
fn a_quad_light_is_one_emitter_and_two_black_triangles_that_face_its_way() {
    let scene = scene(Folder::new().with("a.obj", TRIANGLE), SCENE);
    let [emitter] = scene.emitters[..] else {
        panic!("{:?}", scene.emitters)
    };
    assert_eq!(emitter.shape, EmitterShape::Parallelogram);
    assert_eq!(emitter.corner, Vec3::new(0.0, 2.0, 0.0));
    assert_eq!(emitter.radiance, Vec3::new(1.0, 2.0, 3.0));
    // edge_u × edge_v = x × z = -y.
    assert_eq!(emitter.normal(), Vec3::NEG_Y);
    let mut area = 0.0;
    for triangle in 1..3 {
        let material = &scene.materials[scene.mesh.material_of[triangle] as usize];
        assert_eq!(material.kd, Vec3::ZERO);
        assert_eq!(material.emission, emitter.radiance);
        assert_eq!(normal(&scene.mesh, triangle), Vec3::NEG_Y);
        let [a, b, c] = scene.mesh.corners(triangle);
        area += 0.5 * (b - a).cross(c - a).length();
    }
    assert!((area - emitter.area()).abs() < 1e-6);
}

#[test]
fn a_dark_quad_light_is_no_emitter_beside_another() {
    let text = format!("{SCENE}{}", &SCENE[SCENE.find("[[light").expect("a light")..]);
    let text = text.replacen("[1, 2, 3]", "[0, 0, 0]", 1);
    let scene = scene(Folder::new().with("a.obj", TRIANGLE), &text);
    assert_eq!(scene.emitters.len(), 1);
    assert_eq!(scene.mesh.triangles.len(), 5);
}

#[test]
fn each_triangle_of_an_emissive_material_shines_to_its_front() {
    let obj =
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl lamp\nf 1 2 3 4\nusemtl wall\nf 1 2 3\n";
    let folder = Folder::new()
        .with("a.obj", obj)
        .with("a.mtl", "newmtl lamp\nKe 5 6 7\nnewmtl wall\nKd 0.5 0.5 0.5\n");
    let scene = scene(folder, "mesh = [{ path = 'a.obj' }]");
    assert_eq!(scene.emitters.len(), 2);
    for (index, emitter) in scene.emitters.iter().enumerate() {
        assert_eq!(emitter.shape, EmitterShape::Triangle);
        assert_eq!(emitter.normal(), Vec3::Z);
        assert_eq!(emitter.radiance, Vec3::new(5.0, 6.0, 7.0));
        let [a, b, c] = scene.mesh.corners(index);
        assert_eq!(
            [emitter.corner, emitter.edge_u, emitter.edge_v],
            [a, b - a, c - a]
        );
    }
}

#[test]
fn a_mirrored_lamp_still_shines_out_of_its_front() {
    let obj =
        format!("mtllib a.mtl\nusemtl lamp\nvn 0 0 1\n{TRIANGLE}").replace("f 1 2 3", "f 1//1 2//1 3//1");
    // The front of the triangle faces +z; mirrored along z it must face -z, along x still +z.
    for (scale, front) in [
        ("[1, 1, -2]", Vec3::NEG_Z),
        ("[-1, 1, 1]", Vec3::Z),
        ("-1", Vec3::NEG_Z),
    ] {
        let folder = Folder::new()
            .with("a.obj", &obj)
            .with("a.mtl", "newmtl lamp\nKe 5 6 7\n");
        let text = format!("{CAMERA}[[mesh]]\npath = 'a.obj'\nscale = {scale}\n");
        let scene = scene(folder, &text);
        assert_eq!(scene.emitters[0].normal(), front, "{scale}");
        assert_eq!(normal(&scene.mesh, 0), front, "{scale}");
        assert_eq!(scene.mesh.normals[0], front, "{scale}");
    }
}

#[test]
fn meshes_are_scaled_then_turned_then_moved() {
    let text = format!(
        "{CAMERA}{}",
        SCENE.replace(
            "\"a.obj\"",
            "\"a.obj\"\nscale = [1, 2, 1]\nrotate_degrees = [0, 0, 90]\ntranslate = [10, 0, 0]"
        )
    );
    let scene = scene(Folder::new().with("a.obj", TRIANGLE), &text);
    assert_eq!(
        scene.mesh.corners(0),
        [
            Vec3::new(10.0, 0.0, 0.0),
            Vec3::new(10.0, 1.0, 0.0),
            Vec3::new(8.0, 0.0, 0.0)
        ]
    );
}

#[test]
fn a_mesh_that_is_named_often_is_read_once_and_shares_its_materials() {
    let folder = Folder::new()
        .with("a.obj", format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}"))
        .with("a.mtl", "newmtl a\nmap_Kd a.png\n")
        .with("a.png", png(2, 2, [9, 9, 9]))
        .with("sub/x", "")
        .with(
            "a.toml",
            format!("{CAMERA}{SCENE}[[mesh]]\npath = './sub/../a.obj'\ntranslate = [0, 0, 1]\n[[mesh]]\npath = 'a.obj'\n"),
        );
    let (loaded, _) = folder.loaded("a.toml");
    let names: Vec<_> = loaded
        .files
        .iter()
        .map(|p| folder.cut(&p.display().to_string()))
        .collect();
    assert_eq!(names, ["a.toml", "a.obj", "a.mtl", "a.png"]);
    assert_eq!(loaded.scene.materials.len(), 2);
    assert_eq!(loaded.scene.textures.len(), 1);
    assert_eq!(loaded.scene.mesh.triangles.len(), 5);
    assert_eq!(loaded.scene.mesh.corners(1)[0], Vec3::Z);
}

#[test]
fn paths_may_begin_with_the_folder_of_scenes() {
    for path in ["$GRIDLIGHT_SCENES/x/b.obj", "${GRIDLIGHT_SCENES}/x/b.obj"] {
        let folder = Folder::new().with("scenes/x/b.obj", TRIANGLE);
        let scene = scene(folder, &SCENE.replace("a.obj", path));
        assert_eq!(scene.mesh.triangles.len(), 3);
    }
}

#[test]
fn an_mtllib_line_may_name_several_files_or_one_with_spaces() {
    let obj = format!(
        "mtllib my a.mtl\nmtllib b.mtl c.mtl\nusemtl a\n{TRIANGLE}usemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n"
    );
    let folder = Folder::new()
        .with("a.obj", obj)
        .with("my a.mtl", "newmtl a\nKd 0.1 0.1 0.1\n")
        .with("b.mtl", "newmtl b\nKd 0.2 0.2 0.2\nnewmtl c\nKd 1 1 1\n")
        .with("c.mtl", "newmtl c\nKd 0.3 0.3 0.3\n");
    let scene = scene(folder, SCENE);
    let albedo: Vec<f32> = scene.materials[..3].iter().map(|m| m.kd.x).collect();
    assert_eq!(albedo, [0.1, 0.2, 0.3]);
}

#[test]
fn texture_options_place_and_wrap_the_picture() {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.25\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n";
    let mtl = "newmtl a\nmap_Kd -s 2 4 -o 0.5 0 a.png\nnewmtl b\nmap_Kd -clamp on a.png\n";
    let folder = Folder::new().with("a.obj", obj).with("a.mtl", mtl);
    let scene = scene(folder.with("a.png", png(3, 2, [1, 2, 3])), SCENE);
    let uv = |triangle: usize| scene.mesh.uvs[scene.mesh.triangles[triangle][0] as usize];
    assert_eq!(uv(0), Vec2::new(1.5, 1.0));
    assert_eq!(uv(1), Vec2::new(0.5, 0.25));
    let wraps: Vec<Wrap> = scene.textures.iter().map(|t| t.wrap).collect();
    assert_eq!(wraps, [Wrap::Repeat, Wrap::Clamp]);
    for texture in &scene.textures {
        assert_eq!((texture.width, texture.height), (3, 2));
        assert_eq!(texture.texels, [[1, 2, 3]; 6]);
    }
}

#[test]
fn pictures_of_every_colour_type_become_rgb() {
    let obj = format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}");
    let grey = DynamicImage::new_luma8(2, 1);
    let check = |picture: &DynamicImage, format, expected: [u8; 3]| {
        let folder = Folder::new()
            .with("a.obj", &obj)
            .with("a.mtl", "newmtl a\nmap_Kd a.png\n")
            .with("a.png", encoded(picture, format));
        let scene = scene(folder, SCENE);
        assert_eq!(scene.textures[0].texels, [expected; 2], "{:?}", picture.color());
    };
    check(&grey, ImageFormat::Png, [0; 3]);
    check(&grey, ImageFormat::Jpeg, [0; 3]);
    let rgba = image::RgbaImage::from_pixel(2, 1, image::Rgba([10, 20, 30, 0]));
    check(&rgba.into(), ImageFormat::Png, [10, 20, 30]);
    let deep = image::ImageBuffer::from_pixel(2, 1, image::Rgb([65535u16, 0, 257]));
    check(&DynamicImage::ImageRgb16(deep), ImageFormat::Png, [255, 0, 1]);
    let luma_alpha = image::ImageBuffer::from_pixel(2, 1, image::LumaA([7u8, 9]));
    check(&DynamicImage::ImageLumaA8(luma_alpha), ImageFormat::Png, [7; 3]);
}

#[test]
fn kd_and_its_map_are_both_kept() {
    let obj = format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}");
    let folder = Folder::new()
        .with("a.obj", obj)
        .with("a.mtl", "newmtl a\nKd 0.5 0.25 1\nmap_Kd a.png\n")
        .with("a.png", png(1, 1, [255; 3]));
    let scene = scene(folder, SCENE);
    assert_eq!(scene.materials[0].kd, Vec3::new(0.5, 0.25, 1.0));
    assert_eq!(scene.materials[0].kd_map, Some(0));
}

#[test]
fn the_same_files_give_the_same_scene_and_digest_wherever_they_are() {
    let folder = || {
        let mut folder = Folder::new();
        for index in 0..8 {
            let obj = format!("mtllib m.mtl\nusemtl a\n{TRIANGLE}usemtl b{index}\nf 1 2 3\n");
            folder = folder.with(&format!("m{index}.obj"), obj);
            folder = folder.with(&format!("t{index}.png"), png(8, 8, [index; 3]));
        }
        let mesh = |index| format!("[[mesh]]\npath = 'm{index}.obj'\n");
        let meshes: Vec<String> = (0..8).map(mesh).collect();
        let text = format!("{CAMERA}{SCENE}{}", meshes.concat());
        let material = |index| format!("newmtl b{index}\nKe 1 1 1\nmap_Kd t{index}.png\n");
        let materials: Vec<String> = (0..8).rev().map(material).collect();
        let mtl = format!("newmtl a\nmap_Kd t0.png\n{}", materials.concat());
        folder
            .with("a.obj", TRIANGLE)
            .with("m.mtl", mtl)
            .with("a.toml", text)
    };
    let (first, second) = (folder(), folder());
    let (one, two) = (first.loaded("a.toml"), second.loaded("a.toml"));
    assert_eq!(one.1, two.1);
    assert_eq!(one.0.digest, two.0.digest);
    assert_eq!(format!("{:?}", one.0.scene), format!("{:?}", two.0.scene));
    let cut = |folder: &Folder, files: &[std::path::PathBuf]| -> Vec<String> {
        files
            .iter()
            .map(|p| folder.cut(&p.display().to_string()))
            .collect()
    };
    assert_eq!(cut(&first, &one.0.files), cut(&second, &two.0.files));

    // Any byte of any file counts, and so does a file that is missing.
    let digest = |folder: Folder| folder.loaded("a.toml").0.digest;
    assert_ne!(digest(folder().with("t3.png", png(8, 8, [77; 3]))), one.0.digest);
    assert_ne!(digest(folder().with("m3.obj", TRIANGLE)), one.0.digest);
    let without = folder();
    std::fs::remove_file(without.path("t5.png")).expect("removed");
    assert_ne!(digest(without), one.0.digest);
}
