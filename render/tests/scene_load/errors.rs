//! Every error names the file, the line and the remedy.

use crate::{CAMERA, Folder, SCENE, TRIANGLE, png};

/// A whole scene with one line of `text` in the place of the line that begins like it.
fn check(text: &str, parts: &[&str]) {
    let scene = "\
[camera]
eye = [0, 0, 5]
look_at = [0, 0, 0]
up = [0, 1, 0]
vertical_fov_degrees = 40
[image]
width = 64
height = 48
[[mesh]]
path = \"a.obj\"
scale = 2
translate = [0, 0, 0]
rotate_degrees = [0, 0, 0]
[[light.quad]]
corner = [0, 2, 0]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [1, 2, 3]
";
    let key = text.split(" =").next().expect("a key");
    let replaced = |line: &str| line.starts_with(&format!("{key} ="));
    let line = scene.lines().position(replaced).expect("a known key") + 1;
    let lines = scene.lines();
    let lines: Vec<&str> = lines.map(|l| if replaced(l) { text } else { l }).collect();
    let folder = Folder::new().with("a.obj", TRIANGLE);
    folder.load_ok(scene);
    let error = folder.with("a.toml", lines.join("\n")).error("a.toml");
    assert!(error.starts_with(&format!("a.toml:{line}:")), "{error}");
    expect(&error, parts);
}

impl Folder {
    fn load_ok(&self, scene: &str) {
        std::fs::write(self.path("ok.toml"), scene).expect("written");
        self.load("ok.toml").expect("the scene itself is valid");
    }
}

fn expect(error: &str, parts: &[&str]) {
    for part in parts {
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
}

/// The error of a scene file, all of it.
fn check_scene(scene: &str, parts: &[&str]) {
    let folder = Folder::new().with("a.obj", TRIANGLE);
    expect(&folder.with("a.toml", scene).error("a.toml"), parts);
}

/// The error of a mesh, all of it.
fn check_obj(obj: &str, parts: &[&str]) {
    let folder = Folder::new().with("a.obj", obj).with("a.toml", SCENE);
    expect(&folder.error("a.toml"), parts);
}

/// The error of an MTL file, all of it.
fn check_mtl(mtl: &str, parts: &[&str]) {
    let obj = format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}");
    let folder = Folder::new().with("a.obj", obj).with("a.mtl", mtl);
    expect(&folder.with("a.toml", SCENE).error("a.toml"), parts);
}

#[test]
fn a_scene_file_that_is_not_there() {
    let error = Folder::new().error("none.toml");
    expect(
        &error,
        &["cannot read none.toml", "No such file", "check the path"],
    );
    let error = Folder::new().error("none.obj");
    expect(&error, &["cannot read none.obj", "check the path"]);
}

#[test]
fn a_scene_that_is_neither_toml_nor_obj() {
    for name in ["a.gltf", "toml", "a"] {
        expect(&Folder::new().error(name), &[name, ".toml", ".obj"]);
    }
}

#[test]
fn a_scene_file_that_is_a_folder() {
    let folder = Folder::new().with("a.toml/b", "");
    expect(&folder.error("a.toml"), &["a.toml", "not a regular file"]);
}

#[test]
fn a_scene_file_that_is_not_utf_8() {
    let folder = Folder::new().with("a.toml", b"# ok\n# \xff\n");
    expect(
        &folder.error("a.toml"),
        &["a.toml:2:", "not UTF-8", "save the file"],
    );
}

#[test]
fn a_scene_file_that_is_too_large() {
    let folder = Folder::new().with("a.toml", "");
    let file = std::fs::File::options().write(true).open(folder.path("a.toml"));
    file.expect("opened").set_len(1 << 30).expect("a sparse file");
    expect(
        &folder.error("a.toml"),
        &["a.toml: 1073741824 bytes", "limit of 16777216"],
    );
}

#[test]
fn text_that_is_not_toml() {
    check_scene("[image]\nwidth 4\n", &["a.toml:2:7: ", "expected `=`"]);
    check_scene("[camera]\n[camera]\n", &["a.toml:2:"]);
    check_scene("[image]\nwidth = 1\nwidth = 2\n", &["a.toml:3:1: duplicate key"]);
}

#[test]
fn unknown_keys_name_the_nearest_known_one() {
    let unknown = |scene, place, nearest| {
        check_scene(
            scene,
            &[place, "unknown key", &format!("did you mean `{nearest}`?")],
        );
    };
    unknown(
        "[camera]\neye = [0, 0, 0]\nlookat = [0, 0, 0]\n",
        "a.toml:3:1",
        "look_at",
    );
    unknown("[camera]\nfov = 40\n", "a.toml:2:1", "vertical_fov_degrees");
    unknown("[image]\n\nheigth = 40\n", "a.toml:3:1", "height");
    unknown("[[mesh]]\nrotation = [0, 0, 0]\n", "a.toml:2:1", "rotate_degrees");
    unknown("[[mesh]]\npaht = 'a.obj'\n", "a.toml:2:1", "path");
    unknown("[[light.quad]]\nRadiance = [0, 0, 0]\n", "a.toml:2:1", "radiance");
    unknown("[[light.quads]]\ncorner = 1\n", "a.toml:1:9", "quad");
    unknown("[[meshes]]\npath = 'a.obj'\n", "a.toml:1:3", "mesh");
    unknown("\n[cam]\n", "a.toml:2:2", "camera");
    unknown(
        "# é\ncamera = { eye = [0, 0, 0], 'éye' = 1, lokat = 2 }\n",
        "a.toml:2:29",
        "eye",
    );
}

#[test]
fn unknown_keys_show_all_known_ones() {
    check_scene(
        "[camera]\nposition = [0, 0, 0]\n",
        &[
            "unknown key `position` in [camera]",
            "([camera] knows eye, look_at, up, vertical_fov_degrees)",
        ],
    );
}

#[test]
fn values_of_the_wrong_type() {
    check(
        "eye = \"here\"",
        &[":2:7: `eye` must be an array of three numbers", "not a string"],
    );
    check(
        "eye = [1, 2]",
        &[
            ":2:7: `eye` must be an array of three numbers",
            "not an array of 2",
        ],
    );
    check(
        "look_at = [1, 2, true]",
        &[":3:18: `look_at` must be", "not a boolean"],
    );
    check(
        "vertical_fov_degrees = '40'",
        &["must be a number such as", "not a string"],
    );
    check("width = 64.0", &["`width` must be a whole number", "not a float"]);
    check("path = 3", &["`path` must be a string", "not a whole number"]);
    check(
        "scale = '2'",
        &["`scale` must be a number such as 2 or an array of three"],
    );
    check("scale = [1, 2]", &["`scale` must be", "not an array of 2"]);
    check_scene(
        "camera = 1\n",
        &["a.toml:1:10: `camera` must be one table", "single brackets"],
    );
    check_scene("[[camera]]\n", &["a.toml:1:", "`camera` must be one table"]);
    check_scene(
        "[mesh]\npath = 'a.obj'\n",
        &["a.toml:1:", "`mesh` must be a list of tables", "[[ ]]"],
    );
    check_scene(
        "mesh = ['a.obj']\n",
        &["a.toml:1:9: `mesh` must be a list of tables"],
    );
    check_scene("[light.quad]\ncorner = 1\n", &["`quad` must be a list of tables"]);
}

#[test]
fn keys_that_must_be_given() {
    let missing = |scene, place, key| {
        check_scene(
            scene,
            &[place, &format!("lacks `{key}`; add for example `{key} = ")],
        );
    };
    missing("\n[camera]\nlook_at = [0, 0, 0]\n", "a.toml:2:", "eye");
    missing("[camera]\neye = [0, 0, 0]\n", "a.toml:1:", "look_at");
    missing("[image]\nheight = 3\n", "a.toml:1:", "width");
    missing("[image]\nwidth = 3\n", "a.toml:1:", "height");
    missing("[[mesh]]\nscale = 3\n", "a.toml:1:", "path");
    missing("[[light.quad]]\n", "a.toml:1:", "corner");
    missing("[[light.quad]]\ncorner = [0, 0, 0]\n", "a.toml:1:", "edge_u");
}

#[test]
fn numbers_that_are_not_finite() {
    for number in ["nan", "-inf", "1e39", "1e400"] {
        check(
            &format!("eye = [0, {number}, 0]"),
            &[":2:11: `eye` is not finite"],
        );
        check(&format!("vertical_fov_degrees = {number}"), &["is not finite"]);
        check(&format!("radiance = [0, 0, {number}]"), &["is not finite"]);
        check(&format!("scale = {number}"), &["is not finite"]);
    }
}

#[test]
fn cameras_that_see_nothing() {
    check(
        "look_at = [0, 0, 5]",
        &["`look_at` is the same point as `eye`", "give a point"],
    );
    check(
        "look_at = [0, 0, 5.0000000001]",
        &["`look_at` is the same point as `eye`"],
    );
    check("up = [0, 0, 0]", &["`up` has no length", "such as [0, 1, 0]"]);
    check(
        "up = [0, 0, -2]",
        &["`up` is parallel to the view", "give another direction"],
    );
    for fov in ["0", "180", "-20", "360"] {
        let line = format!("vertical_fov_degrees = {fov}");
        check(&line, &[&format!("is {fov}"), "between 0 and 180"]);
    }
    check("eye = [0, 0, 2e9]", &["`eye` is", "at most"]);
}

#[test]
fn a_camera_without_up_that_looks_straight_down() {
    let scene = format!("[camera]\neye = [0, 5, 0]\nlook_at = [0, 0, 0]\n{SCENE}");
    check_scene(&scene, &["a.toml:1:", "`up` is parallel", "[0, 0, 1]"]);
}

#[test]
fn pictures_of_impossible_size() {
    check("width = 0", &[":7:9: `width` is 0; give 1 to 16384"]);
    check("height = -5", &[":8:10: `height` is -5; give 1 to 16384"]);
    check("width = 1000000", &["`width` is 1000000; give 1 to 16384"]);
    check("height = 99999999999999999999", &["a.toml:8:10"]);
    let scene = format!("[image]\nwidth = 16384\nheight = 16384\n{SCENE}");
    check_scene(
        &scene,
        &["a.toml:2:9: `width` and `height` make 268435456 pixels", "limit"],
    );
}

#[test]
fn lights_that_cannot_be() {
    check(
        "radiance = [1, -0.1, 1]",
        &["`radiance` is", "give values from 0"],
    );
    check(
        "radiance = [1, 1e13, 1]",
        &["`radiance` is", "give values from 0"],
    );
    check(
        "edge_u = [0, 0, 2]",
        &["`edge_u` and `edge_v` span no area", "not parallel"],
    );
    let flat = SCENE.replace("edge_v = [0, 0, 1]", "edge_v = [0, 0, 0]");
    check_scene(&flat, &["a.toml:6:10: `edge_u` and `edge_v` span no area"]);
    check("corner = [1e10, 0, 0]", &["`corner` is", "at most"]);
}

#[test]
fn transforms_that_lose_the_mesh() {
    check("scale = 0", &["`scale` is", "give factors"]);
    check("scale = [1, 0, 1]", &["`scale` is", "give factors"]);
    check("scale = 1e10", &["`scale` is", "give factors"]);
    check("translate = [0, 0, 3e9]", &["`translate` is", "at most"]);
    let scene = SCENE.replace("\"a.obj\"", "\"a.obj\"\nscale = 1e8\ntranslate = [1e9, 0, 0]");
    check_scene(
        &scene,
        &["a.toml:3:8: `path` is a mesh that", "make them smaller"],
    );
}

#[test]
fn meshes_that_are_not_there() {
    check(
        "path = \"b.obj\"",
        &[":10:8: cannot read b.obj: No such file", "check the path"],
    );
    check("path = \"\"", &["`path` is empty", ".obj"]);
    check(
        "path = \"$GRIDLIGHT_SCENES/b.obj\"",
        &[
            "cannot read scenes/b.obj",
            "$GRIDLIGHT_SCENES stands for scenes",
            "set this environment",
        ],
    );
}

#[test]
fn variables_that_are_not_known() {
    for path in [
        "$HOME/a.obj",
        "${HOME}/a.obj",
        "x/$GRIDLIGHT_SCENES/a.obj",
        "$GRIDLIGHT_SCENES/$X/a.obj",
    ] {
        check(
            &format!("path = \"{path}\""),
            &[":10:8: unknown variable `$", "only $GRIDLIGHT_SCENES is known"],
        );
    }
}

#[test]
fn scenes_without_triangles() {
    check_scene("", &["a.toml: there is no mesh; add `[[mesh]]`"]);
    let lit = SCENE.replace("[[mesh]]\npath = \"a.obj\"", "");
    check_scene(&lit, &["a.toml: there is no mesh"]);
    check_obj("v 0 0 0\n", &["a.toml: no mesh has a triangle", "`f` lines"]);
    check_obj("", &["no mesh has a triangle"]);
    check_obj("\0\u{1}\u{2}garbage", &["no mesh has a triangle"]);
    check_obj(
        "v 0 0 0\nv 1 1 1\nf 1 2 1\nf 1 1 1\n",
        &["all 2 triangles have no area"],
    );
    let folder = Folder::new().with("a.obj", "# nothing\n");
    expect(
        &folder.error("a.obj"),
        &["a.obj: there is no triangle in it", "`f` lines"],
    );
}

#[test]
fn scenes_without_light() {
    let unlit = format!("{CAMERA}[[mesh]]\npath = \"a.obj\"\n");
    let parts = ["a.toml: nothing emits light", "[[light.quad]]", "`Ke`"];
    check_scene(&unlit, &parts);
    check_scene(&SCENE.replace("[1, 2, 3]", "[0, 0, 0]"), &parts);
}

#[test]
fn malformed_meshes_name_the_line() {
    check_obj("v 0 0 0\nv 1 x 0\n", &["a.obj:2: `x` is not a number"]);
    check_obj(
        &format!("{TRIANGLE}f 1 2\n"),
        &["a.obj:5: a face needs at least three"],
    );
    check_obj(
        &format!("{TRIANGLE}f 1 2 4\n"),
        &["a.obj:5: vertex index 4 is out of range: 3"],
    );
    check_obj(
        &format!("{TRIANGLE}f 1 2 -4\n"),
        &["a.obj:5: vertex index -4 is out of range"],
    );
    check_obj(
        "v 0 0 0\n\nv 0 nan 0\n",
        &["a.obj:3: the vertex is not finite", "export"],
    );
    check_obj("v 0 inf 0\n", &["a.obj:1: the vertex is not finite"]);
    check_obj("v 0 1e30 0\n", &["a.obj:1: the vertex lies beyond", "scale"]);
}

#[test]
fn malformed_materials_name_the_line() {
    check_mtl(
        "newmtl a\nKd 1 0\n",
        &["a.mtl:2: `Kd` must be three numbers (RGB), not `1 0`"],
    );
    check_mtl("newmtl a\nKd\n", &["a.mtl:2: `Kd` must be three numbers"]);
    check_mtl("newmtl a\n\nKs 1 x 0\n", &["a.mtl:3: `Ks`: `x` is not a number"]);
    check_mtl(
        "newmtl a\nKd spectral a.rfl 1\n",
        &["a.mtl:2: `Kd`: `spectral` is not a number"],
    );
    check_mtl("newmtl a\nKd nan 0 0\n", &["a.mtl:2: `Kd` is not finite"]);
    check_mtl(
        "newmtl a\nKe -1 0 0\n",
        &["a.mtl:2: `Ke` is -1; give values from 0"],
    );
    check_mtl("newmtl a\nKe inf 0 0\n", &["a.mtl:2: `Ke` is not finite"]);
    check_mtl(
        "newmtl a\nillum x\n",
        &["a.mtl:2: `illum` must be a whole number"],
    );
    check_mtl("newmtl a\nd x\n", &["a.mtl:2: `d`: `x` is not a number"]);
    check_mtl("newmtl a\nmap_Kd\n", &["a.mtl:2: `map_Kd` without a file name"]);
    check_mtl(
        "newmtl a\nmap_Kd -s x a.png\n",
        &["a.mtl:2: `-s` of `map_Kd` lacks its value"],
    );
    check_mtl(
        "newmtl a\nmap_Kd -x 1 a.png\n",
        &["a.mtl:2: `map_Kd` has no option `-x`"],
    );
    check_mtl("Kd 1 1 1\n", &["a.mtl:1: `Kd` before the first `newmtl`"]);
    check_mtl("newmtl\n", &["a.mtl:1: `newmtl` without a name"]);
    check_mtl("what is this\n", &["a.mtl:1: there is no `newmtl`"]);
}

#[test]
fn textures_that_cannot_be_decoded() {
    let check = |texture: &[u8], parts: &[&str]| {
        let obj = format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}");
        let mtl = "newmtl a\nKd 1 1 1\nmap_Kd a.png\n";
        let folder = Folder::new().with("a.obj", obj).with("a.mtl", mtl);
        let folder = folder.with("a.png", texture).with("a.toml", SCENE);
        let error = folder.error("a.toml");
        expect(
            &error,
            &["a.mtl:3: texture a.png: ", "save it anew as PNG or JPEG"],
        );
        expect(&error, parts);
        assert!(!error.contains('\n'), "{error}");
    };
    check(b"", &[]);
    check(b"not a picture", &[]);
    check(b"GIF89a\x01\0\x01\0\x80\0\0", &["Gif"]);
    let whole = png(64, 64, [1, 2, 3]);
    check(&whole[..whole.len() / 2], &[]);
    // A header that claims 100,000 × 100,000 pixels, with the checksum that belongs to it.
    let mut huge = whole;
    huge[16..24].copy_from_slice(&[0, 1, 0x86, 0xa0, 0, 1, 0x86, 0xa0]);
    check(&huge, &["16384"]);
}
