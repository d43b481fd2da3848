//! `eval paper` from the command line: what happens without scenes, and, where the scenes are, that
//! the page is whole and the same twice.

#![expect(clippy::unwrap_used, reason = "a failure shows where it happened")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

fn eval(args: &[&str], out: &Path, scenes: Option<&Path>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_eval"));
    command
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(".."))
        .args(args)
        .arg("--out")
        .arg(out);
    if let Some(scenes) = scenes {
        command.arg("--scenes").arg(scenes);
    }
    command.output().unwrap()
}

#[test]
fn without_scenes_it_says_which_are_missing_and_how_to_get_them() {
    let folder = tempfile::tempdir().unwrap();
    for flags in [
        &["paper", "--quick"][..],
        &["paper", "--quick", "--allow-missing"],
    ] {
        let output = eval(flags, folder.path(), Some(folder.path()));
        assert_eq!(output.status.code(), Some(2));
        let message = String::from_utf8(output.stderr).unwrap();
        for part in [
            "Conference Room",
            "Sibenik",
            "Cornell Box",
            "scenes/README.md",
            "--scenes",
        ] {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
    }
}

#[test]
fn a_grid_needs_a_picture_format_before_it_begins() {
    let output = eval(
        &["grid", "--scene", "nowhere.toml", "--deadline", "1"],
        Path::new("picture.bmp"),
        None,
    );
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains(".png or .exr"));
}

#[test]
fn one_frame_on_the_grid_leaves_a_picture_and_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("picture.png");
    let frame = || {
        let flags = "grid --scene scenes/cornell-box/cornell-box.toml --deadline 3 --size 64x48 --json";
        let flags: Vec<&str> = flags.split(' ').collect();
        let output = eval(&flags, &picture, None);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{message}");
        (output.stdout, fs::read(&picture).unwrap())
    };
    let (report, bytes) = frame();
    let json: serde_json::Value = serde_json::from_slice(&report).unwrap();
    let completed = json["tasks"][1]["completed"].as_u64().unwrap();
    assert!((20..500).contains(&completed), "{json}");
    assert_eq!((report, bytes), frame());
}

/// The scenes are not part of the repository; where they are not, there is nothing to test.
fn scenes() -> Option<PathBuf> {
    let folder = master::scene_path::scenes_dir();
    folder
        .join("cornell/CornellBox-Bunny.obj")
        .is_file()
        .then_some(folder)
}

#[test]
fn the_quick_page_is_whole_and_the_same_twice() {
    let Some(scenes) = scenes() else {
        return;
    };
    // One scene is enough here.
    let one = tempfile::tempdir().unwrap();
    let parameters = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("paper.toml")).unwrap();
    let (common, rest) = parameters.split_once("[[scene]]").unwrap();
    let cornell = rest
        .split("[[scene]]")
        .find(|scene| scene.contains("Cornell"))
        .unwrap();
    let file = one.path().join("cornell.toml");
    fs::write(&file, format!("{common}[[scene]]{cornell}")).unwrap();
    let page = || {
        let out = one.path().join("page");
        let flags = ["paper", "--quick", "--parameters", file.to_str().unwrap()];
        let output = eval(&flags, &out, Some(&scenes));
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{message}");
        let [html, markdown] =
            ["paper.html", "README.md"].map(|name| fs::read_to_string(out.join(name)).unwrap());
        assert!(html.contains("Table 2") && html.contains("data:image/jpeg;base64,"));
        for line in markdown.lines().filter(|line| line.contains("![")) {
            for name in line.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
                assert!(out.join(name).is_file(), "{name}");
            }
        }
        (html, markdown)
    };
    assert!(page() == page(), "the page differs when it is made again");
}
