//! The golden picture as `eval compare` judges it: within every metric's limit, with room; and a
//! picture with any of the common faults is beyond one of them, with room.
//!
//! The same is shown of `oiiotool`'s limits in `golden.rs`. This says what each metric is good for:
//! `cargo test --test golden_metrics -- --nocapture` prints the table of docs/metrics.md.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use gridlight::{
    master::{Finished, Master},
    metrics::{ScoreLimits, Scores, write_rearranged},
    oiio::edit,
    programs::root,
    scenes::SceneFolder,
};

/// The workload of the reference.
const FULL: &str = "--paper --no-deadline --size 256x256";

/// For light. FLIP and RMSE of the right picture are those of the reference's lamp, whose 16 bits are
/// coarse; relMSE, SSIM and PSNR leave room for some pixels at the edges of shadows.
const LIGHT: ScoreLimits = ScoreLimits(Scores {
    vdp_percent: 0.05,
    flip: 0.003,
    rmse: 0.003,
    relmse: 1e-5,
    ssim: 0.9999,
    psnr_db: 60.0,
});

/// For the PNG beside it, whose codes are rounded to 8 bits.
const CODES: ScoreLimits = ScoreLimits(Scores {
    vdp_percent: 0.05,
    flip: 0.012,
    rmse: 0.0025,
    relmse: 1e-4,
    ssim: 0.9988,
    psnr_db: 52.0,
});

/// Share of a limit that the right picture may use up: another machine's packets of rays may see an
/// edge on the other side of a pixel.
const ROOM: f64 = 0.5;
/// So far beyond the limits a fault has to be.
const CAUGHT: f64 = 2.0;

fn reference() -> PathBuf {
    root().join("tests/references/cornell-box.exr")
}

fn cornell_box(flags: &str) -> Finished {
    Master::new(&format!("{FULL} {flags}")).deliver()
}

fn in_a_room(file: &str, old: &str, new: &str) -> Finished {
    let copy = SceneFolder::copy_of("cornell-box").replacing(file, old, new);
    Master::new(FULL).scene(copy.path("cornell-box.toml")).deliver()
}

#[track_caller]
fn check_right(what: &str, picture: &Path, limits: ScoreLimits) {
    let scores = judged(what, picture, limits);
    assert!(
        limits.worst_excess(&scores) < ROOM,
        "{what}: {scores:?} uses up more than {ROOM} of a limit"
    );
}

#[track_caller]
fn check_caught(what: &str, picture: &Path, limits: ScoreLimits) {
    let scores = judged(what, picture, limits);
    assert!(
        limits.worst_excess(&scores) > CAUGHT,
        "{what}: {scores:?} is not {CAUGHT} times beyond any limit"
    );
}

fn judged(what: &str, picture: &Path, limits: ScoreLimits) -> Scores {
    let scores = Scores::of(picture, &reference());
    let told = writeln!(std::io::stdout(), "{what}:{}\n  {scores:?}", limits.line(&scores));
    told.expect("standard output takes a line");
    scores
}

#[test]
fn the_golden_pictures_are_within_the_limits_of_every_metric() {
    for algorithm in ["component", "straightforward"] {
        let picture = cornell_box(&format!("--algorithm {algorithm}"));
        check_right(algorithm, picture.exr(), LIGHT);
        check_right(&format!("{algorithm}, PNG"), &picture.png(), CODES);
    }
}

#[test]
fn a_wrong_light_is_caught() {
    let brighter = in_a_room("cornell-box.mtl", "Ke 47.6 33.6 11.2", "Ke 48.076 33.936 11.312");
    check_caught("a light 1 % too bright", brighter.exr(), LIGHT);
    let moved = in_a_room("cornell-box.obj", "213.0 548.8 227.0", "218.0 548.8 227.0");
    check_caught("a corner of the light 5 mm aside", moved.exr(), LIGHT);
}

#[test]
fn a_lost_set_of_vpls_is_caught() {
    let right = cornell_box("");
    // Its light is missing from the sum …
    let [lost, wrong] = ["lost.exr", "wrong.exr"].map(|name| right.beside(name));
    let sixteenth = "--ch R=indirect.R,G=indirect.G,B=indirect.B --mulc 0.0625";
    edit(right.exr(), sixteenth, &lost);
    edit(
        right.exr(),
        &format!("--ch R,G,B {} --sub", lost.display()),
        &wrong,
    );
    check_caught("a set missing from the sum", &wrong, LIGHT);
    // … or the others make up for it.
    let fifteen = cornell_box("--vpls 240 --vpl-sets 15");
    check_caught("15 sets for 16", fifteen.exr(), LIGHT);
}

#[test]
fn a_shift_by_one_pixel_is_caught() {
    let right = cornell_box("");
    for (what, origin) in [("right", "+1+0"), ("down", "+0+1")] {
        let wrong = right.beside("wrong.exr");
        let operations = format!("--ch R,G,B --origin {origin} --cut 256x256+0+0");
        edit(right.exr(), &operations, &wrong);
        check_caught(&format!("one pixel {what}"), &wrong, LIGHT);
        let wrong = right.beside("wrong.png");
        edit(&right.png(), &operations, &wrong);
        check_caught(&format!("one pixel {what}, PNG"), &wrong, CODES);
    }
}

#[test]
fn a_wrong_gamma_is_caught() {
    let right = cornell_box("");
    let wrong = right.beside("wrong.exr");
    for (what, operation) in [
        ("encoded twice", "--powc 0.4545"),
        ("a gamma of 0.99", "--powc 0.99"),
    ] {
        edit(right.exr(), &format!("--ch R,G,B {operation}"), &wrong);
        check_caught(what, &wrong, LIGHT);
    }
    // The curve of sRGB is near a gamma of 2.2, and not the same.
    let wrong = right.beside("wrong.png");
    edit(
        right.exr(),
        "--ch R,G,B --clamp:min=0:max=1 --powc 0.4545 -d uint8",
        &wrong,
    );
    check_caught("2.2 in place of sRGB, PNG", &wrong, CODES);
}

#[test]
fn a_dropped_group_is_caught() {
    let right = cornell_box("").pixels();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wrong = folder.path().join("wrong.pfm");
    // One pixel in each block of 8×8, as in a group of 64, holds its neighbour's value.
    let neighbour = |x: usize, y: usize| {
        let (row, column) = (y / 8, x / 8);
        let dropped = (x % 8, y % 8) == ((3 * row + 5 * column) % 7, (5 * row + column) % 8);
        (x + usize::from(dropped), y)
    };
    write_rearranged(&right, neighbour, &wrong);
    check_caught("a dropped group", &wrong, LIGHT);
}

#[test]
fn exchanged_channels_are_caught() {
    let right = cornell_box("");
    let wrong = right.beside("wrong.exr");
    edit(right.exr(), "--ch R=B,G,B=R", &wrong);
    check_caught("red for blue", &wrong, LIGHT);
}
