//! Everything that can be wrong with what people give: one clear message, an exit code, no debris.

use std::{fs, net::TcpListener, path::Path, process::Command, time::Duration};

use gridlight::{
    master::{Finished, Master},
    oiio::assert_finite,
    programs::skipped,
    scenes::{LIT_TRIANGLE, MATERIAL, SceneFolder, TRIANGLE, TRIANGLE_HEAD},
};

const USAGE: i32 = 2;
const SCENE: i32 = 3;
const OUTPUT: i32 = 4;
const LISTEN: i32 = 5;

/// A small frame with all the time it needs.
const SMALL: &str = "--deadline 20 --size 32x24 --spp 2 --vpls 4 --vpl-sets 1 --local-slots 1";

/// Refused with this code and one message that has these words; nothing is left of it.
#[track_caller]
fn assert_refused(what: &str, refused: &Finished, code: i32, words: &[&str]) {
    let log = &refused.log;
    assert_eq!(refused.code, Some(code), "{what}: {log}");
    for word in words {
        assert!(log.contains(word), "{what}: {word:?} is not in {log}");
    }
    assert_one_message(what, log);
    assert_eq!(refused.left_behind(), [""; 0], "{what}: {log}");
    assert_eq!(refused.stdout, "", "{what}");
}

/// Our own errors are one line; the command line parser adds what may be given instead.
#[track_caller]
fn assert_one_message(what: &str, log: &str) {
    let errors = log.lines().filter(|line| line.starts_with("error: ")).count();
    assert_eq!(errors, 1, "{what}: {errors} messages in {log}");
    for word in ["panicked", "stack backtrace", "RUST_BACKTRACE"] {
        assert!(!log.contains(word), "{what}: {log}");
    }
}

#[track_caller]
fn refuse_flags(flags: &str, words: &[&str]) {
    assert_refused(flags, &Master::new(flags).run(), USAGE, words);
}

/// Renders `a.toml` of a folder.
fn render(folder: &SceneFolder) -> Finished {
    Master::new(SMALL).scene(folder.path("a.toml")).run()
}

/// The lit triangle with one file changed.
#[track_caller]
fn refuse_file(what: &str, name: &str, contents: impl AsRef<[u8]>, words: &[&str]) {
    let folder = SceneFolder::new().with(name, contents);
    assert_refused(what, &render(&folder), SCENE, words);
}

/// The lit triangle with one text of the scene file changed.
#[track_caller]
fn refuse_scene(what: &str, old: &str, new: &str, words: &[&str]) {
    let folder = SceneFolder::new().replacing("a.toml", old, new);
    assert_refused(what, &render(&folder), SCENE, words);
}

/// Rendered all the same, with a warning that has these words.
#[track_caller]
fn assert_warned(what: &str, folder: &SceneFolder, words: &[&str]) -> Finished {
    let picture = render(folder);
    picture.assert_code(0);
    let warns = |line: &&str| line.contains("WARN") && words.iter().all(|word| line.contains(word));
    assert_eq!(
        picture.log.lines().filter(warns).count(),
        1,
        "{what}: {words:?} once in {}",
        picture.log
    );
    assert_finite(picture.exr());
    assert_eq!(picture.left_behind(), ["picture.exr", "picture.png"]);
    picture
}

#[test]
fn the_triangle_of_these_tests_is_accepted_as_it_is() {
    let picture = render(&SceneFolder::new());
    picture.assert_in_time(Duration::from_secs(20));
    assert!(!picture.log.contains("WARN"), "{}", picture.log);
    assert!(picture.pixels().count_positive("direct.G") > 10);
}

#[test]
fn scenes_that_are_missing_or_unreadable() {
    for name in ["nowhere.toml", "nowhere.obj", "no/where.toml"] {
        let refused = Master::new(SMALL).scene(name).run();
        assert_refused(name, &refused, SCENE, &[name, "check the path"]);
    }
    // A folder cannot be read as a file, not even by root.
    let folder = SceneFolder::new();
    fs::create_dir(folder.path("b.toml")).expect("a folder");
    let refused = Master::new(SMALL).scene(folder.path("b.toml")).run();
    assert_refused("a folder", &refused, SCENE, &["b.toml", "not a regular file"]);
    let folder = folder.with("a.gltf", "");
    let refused = Master::new(SMALL).scene(folder.path("a.gltf")).run();
    assert_refused("another format", &refused, SCENE, &["a.gltf", ".toml", ".obj"]);
}

#[test]
fn malformed_scene_files() {
    refuse_file("no TOML", "a.toml", "[camera\neye = 3", &["a.toml:1"]);
    refuse_file(
        "an unknown key",
        "a.toml",
        format!("{LIT_TRIANGLE}color = 1\n"),
        &["a.toml:", "`color`", "did you mean"],
    );
    refuse_file("no text", "a.toml", b"\xff\xfe\x00", &["a.toml:1", "UTF-8"]);
    refuse_file("an empty file", "a.toml", "", &["a.toml", "[[mesh]]"]);
    refuse_scene(
        "a mesh that is not there",
        "a.obj",
        "b.obj",
        &["a.toml:5", "b.obj", "check the path"],
    );
    refuse_scene(
        "NaN",
        "[2, 0, 2]",
        "[2, nan, 2]",
        &["a.toml:", "`corner`", "not finite"],
    );
}

#[test]
fn malformed_meshes() {
    refuse_file(
        "letters",
        "a.obj",
        "v 0 0 zero\n",
        &["a.obj:1", "`zero` is not a number"],
    );
    refuse_file(
        "NaN",
        "a.obj",
        TRIANGLE.replace("v 1 0 0", "v nan 0 0"),
        &["a.obj:2", "not finite"],
    );
    refuse_file(
        "infinity",
        "a.obj",
        TRIANGLE.replace("v 1 0 0", "v 1 -inf 0"),
        &["a.obj:2", "not finite"],
    );
    refuse_file(
        "index too high",
        "a.obj",
        TRIANGLE.replace("f 1 2 3", "f 1 2 4"),
        &["a.obj:4", "out of range"],
    );
    refuse_file(
        "index zero",
        "a.obj",
        TRIANGLE.replace("f 1 2 3", "f 0 1 2"),
        &["a.obj:4", "index 0"],
    );
    refuse_file(
        "index too low",
        "a.obj",
        TRIANGLE.replace("f 1 2 3", "f 1 2 -4"),
        &["a.obj:4", "out of range"],
    );
    refuse_file(
        "two corners",
        "a.obj",
        TRIANGLE.replace("f 1 2 3", "f 1 2"),
        &["a.obj:4", "three"],
    );
    refuse_file("no triangles", "a.obj", "v 0 0 0\n", &["no mesh has a triangle"]);
    refuse_file(
        "only degenerate ones",
        "a.obj",
        "v 0 0 0\nv 1 0 0\nf 1 2 2\n",
        &["no area"],
    );
}

#[test]
fn malformed_materials_and_textures() {
    let refuse = |what: &str, mtl: &str, texture: &[u8], words: &[&str]| {
        let folder = SceneFolder::new().with("a.mtl", mtl).with("a.png", texture);
        assert_refused(what, &render(&folder), SCENE, words);
    };
    refuse("too few numbers", "newmtl a\nKd 1 0\n", b"", &["a.mtl:2", "`Kd`"]);
    refuse("NaN", "newmtl a\nKe nan 0 0\n", b"", &["a.mtl:2", "not finite"]);
    refuse("no material", "what is this\n", b"", &["a.mtl:1", "newmtl"]);
    let textured = "newmtl a\nKd 1 1 1\nmap_Kd a.png\n";
    refuse(
        "no picture",
        textured,
        b"\x89PNG\r\n\x1a\nnot really",
        &["a.mtl:3", "a.png", "save it anew"],
    );
    refuse(
        "an empty picture",
        textured,
        b"",
        &["a.mtl:3", "a.png", "save it anew"],
    );
}

#[test]
fn a_missing_mtl_is_named_and_shows_as_grey() {
    let folder = SceneFolder::new().replacing("a.obj", "a.mtl", "lost.mtl");
    let picture = assert_warned("a missing MTL", &folder, &["lost.mtl", "missing", "grey"]);
    assert_shows_grey(&picture);
}

#[test]
fn a_missing_texture_is_named_and_shows_as_grey() {
    let folder = SceneFolder::new().with("a.mtl", format!("{MATERIAL}map_Kd lost.png\n"));
    let picture = assert_warned(
        "a missing texture",
        &folder,
        &["lost.png", "`a`", "missing", "grey"],
    );
    assert_shows_grey(&picture);
}

/// Somewhere there is a surface, it is grey 0.5, and there is light on it.
#[track_caller]
fn assert_shows_grey(picture: &Finished) {
    let pixels = picture.pixels();
    let [red, green, blue, light] =
        ["albedo.R", "albedo.G", "albedo.B", "direct.G"].map(|name| pixels.channel(name));
    let grey = |&pixel: &usize| {
        [red, green, blue]
            .iter()
            .all(|albedo| (albedo[pixel] - 0.5).abs() < 0.01)
    };
    let shown = (0..red.len())
        .filter(grey)
        .filter(|&pixel| light[pixel] > 0.0)
        .count();
    assert!(shown > 10, "{shown} grey pixels");
}

#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let folder = SceneFolder::new().with("a.obj", format!("{TRIANGLE_HEAD}{TRIANGLE}f 1 1 2\nf 3 3 3\n"));
    assert_warned(
        "degenerate triangles",
        &folder,
        &["2 triangles without area were dropped", "a.obj"],
    );
}

#[test]
fn a_scene_without_light() {
    let dark = LIT_TRIANGLE
        .split("[[light")
        .next()
        .expect("text before the light");
    refuse_file(
        "no light",
        "a.toml",
        dark,
        &["a.toml", "nothing emits light", "[[light.quad]]"],
    );
    refuse_scene(
        "a light of zero",
        "[9, 9, 9]",
        "[0, 0, 0]",
        &["nothing emits light"],
    );
}

#[test]
fn a_camera_that_looks_at_itself() {
    refuse_scene(
        "eye = look_at",
        "[0.3, 0.3, 3]",
        "[0.3, 0.3, 0]",
        &["a.toml:3", "`look_at`", "`eye`"],
    );
}

#[test]
fn sizes_that_cannot_be() {
    for size in ["0x24", "32x0", "0x0", "1000000x1000000", "32", "axb"] {
        refuse_flags(&format!("--size {size}"), &["--size", size]);
    }
    let image = |size: &str| format!("[image]\n{size}\n{LIT_TRIANGLE}");
    refuse_file(
        "width 0",
        "a.toml",
        image("width = 0\nheight = 24"),
        &["a.toml:2", "`width`", "16384"],
    );
    refuse_file(
        "a huge height",
        "a.toml",
        image("width = 32\nheight = 1000000"),
        &["a.toml:3", "`height`"],
    );
}

#[test]
fn deadlines_that_cannot_be() {
    for deadline in ["0", "-1", "NaN", "inf", "0.01", "1e9", "1000000000"] {
        refuse_flags(
            &format!("--deadline {deadline}"),
            &["--deadline", deadline, "0.1 to 86400"],
        );
    }
}

#[test]
fn workloads_that_cannot_be() {
    refuse_flags("--spp 0", &["spp", "0", "1 to"]);
    refuse_flags("--vpls 0", &["VPLs", "0", "1 to"]);
    refuse_flags("--vpl-sets 0", &["VPL sets", "0", "1 to"]);
    refuse_flags("--groups 0", &["groups", "0", "1 to"]);
    refuse_flags("--vpls 100 --vpl-sets 16", &["100", "16", "divide"]);
    refuse_flags(
        "--groups 1 --size 2048x2048",
        &["1 groups", "2097152 pixels per group", "use more"],
    );
}

#[test]
fn an_output_folder_that_is_missing_or_read_only() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let missing = folder.path().join("missing");
    let refused = Master::new(SMALL).out(missing.join("a.exr")).run();
    assert_refused(
        "a missing folder",
        &refused,
        OUTPUT,
        &["--out", "missing", "create it"],
    );
    assert!(!missing.exists());
    // Nobody may create files there, not even root.
    let refused = Master::new(SMALL).out("/proc/a.exr").run();
    assert_eq!(refused.code, Some(OUTPUT), "{}", refused.log);
    assert!(
        refused.log.contains("cannot write into the folder /proc"),
        "{}",
        refused.log
    );
    assert_one_message("a read-only folder", &refused.log);
    let refused = Master::new(SMALL).out(folder.path().join("a.jpg")).run();
    assert_refused("an unknown format", &refused, USAGE, &["a.jpg", ".exr"]);
}

#[test]
fn a_disk_that_is_full() {
    // By a limit on files: works for everyone.
    let refused = Master::new(SMALL).with_files_up_to(16).run();
    assert_refused(
        "files of up to 16 KiB",
        &refused,
        OUTPUT,
        &["cannot write", "picture.exr", "free"],
    );
    // By a disk that is really full: for root only.
    let disk = tempfile::tempdir().expect("a temporary folder");
    let Some(_disk) = SmallDisk::mount(disk.path()) else {
        return skipped("a disk that is full", "a small one can be mounted only by root");
    };
    let refused = Master::new(&SMALL.replace("32x24", "128x96"))
        .out(disk.path().join("picture.exr"))
        .run();
    assert_refused(
        "a full disk",
        &refused,
        OUTPUT,
        &["cannot write", "picture.exr", "the disk is full"],
    );
}

/// A mounted file system of 64 KiB.
struct SmallDisk<'a>(&'a Path);

impl<'a> SmallDisk<'a> {
    fn mount(folder: &'a Path) -> Option<Self> {
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=64k", "tmpfs"])
            .arg(folder)
            .output();
        mount
            .is_ok_and(|output| output.status.success())
            .then_some(Self(folder))
    }
}

impl Drop for SmallDisk<'_> {
    fn drop(&mut self) {
        // Left behind it would be in the way of the folder's removal, which says so.
        let _ = Command::new("umount").arg(self.0).output();
    }
}

#[test]
fn an_old_picture_stays_when_the_new_one_fails() {
    let folder = SceneFolder::new()
        .with("picture.exr", "old")
        .with("picture.png", "old");
    let out = folder.path("picture.exr");
    let refused = Master::new(SMALL).out(&out).with_files_up_to(16).run();
    refused.assert_code(OUTPUT);
    assert_eq!(fs::read(&out).expect("the old picture"), b"old");
    assert_eq!(
        refused.left_behind(),
        ["a.mtl", "a.obj", "a.toml", "picture.exr", "picture.png"]
    );
}

#[test]
fn an_address_in_use() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("an address").to_string();
    let refused = Master::new(&format!("{SMALL} --listen {address}")).run();
    assert_refused(
        "an address in use",
        &refused,
        LISTEN,
        &[&address, "in use", "--listen"],
    );
}

/// The peers of the list (garbage, half an envelope, 4 GB, a wrong version, nothing) are in
/// `hostile.rs`; here is a worker that finds nobody to talk to like that.
#[test]
fn a_worker_that_is_given_nonsense() {
    let worker = gridlight::programs::program("worker");
    let refuse = |arguments: &[&str], word: &str| {
        let output = Command::new(&worker)
            .args(arguments)
            .output()
            .expect("the program starts");
        let log = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(USAGE), "{log}");
        assert!(log.contains(word), "{word} is not in {log}");
        assert_one_message(&arguments.join(" "), &log);
    };
    refuse(&[], "--connect");
    refuse(&["--connect", "nowhere"], "lab-1:7420");
    refuse(&["--connect", "127.0.0.1:1", "--slots", "0"], "1 to 1024");
}
