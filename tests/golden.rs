//! Whole pictures against what they should be: references, known answers, and each other.

use std::path::Path;

use gridlight::{
    master::{Finished, Master},
    oiio::{Limits, assert_finite, differ, edit, pixel_hash},
    pixels::Pixels,
    programs::root,
    scenes::{SceneFolder, scene},
    worker::Worker,
};

/// The full workload of the paper.
const FULL: &str = "--paper --no-deadline";
/// The size of the reference.
const REFERENCE_SIZE: &str = "--size 256x256";

/// Two machines with packets of other widths may see a shadow's edge on either side of a pixel, and
/// the reference has half the bits: so much may differ, and no mistake in this file gets through.
const SAME: Limits = Limits {
    pixel: 0.002,
    percent: 0.1,
    worst: 0.2,
    // The lamp is so bright that 16 bits are too coarse for it.
    brightest: 2.0,
};

fn reference() -> std::path::PathBuf {
    root().join("tests/references/cornell-box.exr")
}

fn cornell_box(flags: &str) -> Finished {
    Master::new(&format!("{FULL} {flags}")).deliver()
}

#[track_caller]
fn assert_same(picture: &Path, reference: &Path) {
    assert_finite(picture);
    if let Some(difference) = differ(picture, reference, SAME) {
        panic!(
            "{} is not as {}:\n{difference}",
            picture.display(),
            reference.display()
        );
    }
}

#[test]
fn the_cornell_box_is_as_its_reference_by_both_algorithms() {
    for algorithm in ["component", "straightforward"] {
        let picture = cornell_box(&format!("{REFERENCE_SIZE} --algorithm {algorithm}"));
        assert_same(picture.exr(), &reference());
        assert!(picture.is_whole(), "{algorithm}");
    }
}

/// Section 4.2 of the paper: with nothing missing the two algorithms compute the same samples.
#[test]
fn straightforward_and_component_based_agree_when_nothing_is_missing() {
    let flags = "--size 96x64 --vpls 64 --vpl-sets 4 --spp 4";
    let one = cornell_box(flags);
    let other = cornell_box(&format!("{flags} --algorithm straightforward"));
    assert_eq!(one.count("/tasks/direct/total"), 64 * 4);
    assert_eq!(other.count("/tasks/full/total"), 2048);
    assert_eq!(pixel_hash_of_light(&one), pixel_hash_of_light(&other));
}

/// The hash of all that is light; the counts of samples differ between the algorithms.
fn pixel_hash_of_light(picture: &Finished) -> String {
    let light = picture.beside("light.exr");
    let channels = "R,G,B,direct.R,direct.G,direct.B,indirect.R,indirect.G,indirect.B";
    edit(picture.exr(), &format!("--ch {channels}"), &light);
    pixel_hash(&light)
}

/// With Kd = Le = 0.5 everywhere radiance is 1: emitted 0.5, direct 0.25, indirect 0.25.
#[test]
fn the_furnace_has_radiance_one() {
    assert_radiance_one("--spp 256");
    assert_radiance_one("--algorithm component --spp 256 --vpls 8192 --vpl-sets 32");
}

#[track_caller]
fn assert_radiance_one(flags: &str) {
    let flags = format!("--no-deadline --size 64x64 --clamp none {flags}");
    let picture = Master::new(&flags).scene(scene("furnace")).deliver();
    assert_finite(picture.exr());
    let pixels = picture.pixels();
    for channel in ["R", "G", "B"] {
        assert_near(&pixels, channel, 1.0, 0.005);
        assert_near(&pixels, &format!("direct.{channel}"), 0.25, 0.01);
        assert_near(&pixels, &format!("indirect.{channel}"), 0.25, 0.015);
    }
    // It is so everywhere: in each of 8×8 parts of the picture, within the noise of samples and VPLs.
    let parts = picture.beside("parts.exr");
    edit(picture.exr(), "--ch R,G,B --resize:filter=box 8x8", &parts);
    let one = picture.beside("one.exr");
    edit(&parts, "--mulc 0 --addc 1", &one);
    let near_one = Limits {
        pixel: 0.05,
        percent: 5.0,
        worst: 0.12,
        brightest: 2.0,
    };
    assert_eq!(differ(&parts, &one, near_one), None);
}

#[track_caller]
fn assert_near(pixels: &Pixels, channel: &str, expected: f64, relative: f64) {
    let mean = pixels.mean(channel);
    assert!(
        (mean / expected - 1.0).abs() < relative,
        "the mean of {channel} is {mean}, not {expected} within {} %",
        100.0 * relative
    );
}

#[test]
fn slots_and_workers_do_not_change_a_bit() {
    let flags = "--size 200x150 --vpls 64 --vpl-sets 8 --spp 8";
    let one = pixel_hash(cornell_box(&format!("{flags} --local-slots 1")).exr());
    for slots in [2, 4] {
        let picture = cornell_box(&format!("{flags} --local-slots {slots}"));
        assert_eq!(picture.count("/slots"), slots);
        assert_eq!(pixel_hash(picture.exr()), one, "{slots} slots");
    }
    let picture = by_two_workers(flags);
    for name in ["ann", "bob"] {
        assert!(
            picture.worker(name)["tasks"].as_u64() > Some(0),
            "{name} has done nothing"
        );
    }
    assert_eq!(pixel_hash(picture.exr()), one, "two workers");
}

fn by_two_workers(flags: &str) -> Finished {
    let master = Master::new(&format!("{FULL} {flags} --local-slots 0")).start();
    let address = master.address();
    let _workers = [Worker::start("ann", address, 2), Worker::start("bob", address, 1)];
    let picture = master.finish();
    picture.assert_code(0);
    picture
}

#[test]
fn another_seed_is_another_picture_and_the_same_seed_the_same() {
    let hash = |seed: u32| {
        let flags = format!("--size 64x64 --vpls 32 --vpl-sets 2 --spp 2 --seed {seed}");
        pixel_hash(cornell_box(&flags).exr())
    };
    let (zero, one) = (hash(0), hash(1));
    assert_ne!(zero, one);
    assert_eq!(hash(1), one);
}

/// A diff that lets mistakes pass is none: each of the common ones is made on purpose.
#[test]
fn each_mistake_is_beyond_the_limits() {
    let right = cornell_box(REFERENCE_SIZE);
    let caught = |what: &str, wrong: &Path| {
        assert_finite(wrong);
        assert!(differ(wrong, &reference(), SAME).is_some(), "{what} gets through");
    };
    let edits = [
        ("gamma of sRGB", "--ch R,G,B --powc 0.4545"),
        ("a gamma that is slightly wrong", "--ch R,G,B --powc 0.98"),
        (
            "one pixel to the right",
            "--ch R,G,B --origin +1+0 --cut 256x256+0+0",
        ),
        ("one pixel down", "--ch R,G,B --origin +0+1 --cut 256x256+0+0"),
        ("red for blue", "--ch R=B,G,B=R"),
        ("1 % too bright", "--ch R,G,B --mulc 1.01"),
    ];
    for (what, operations) in edits {
        let wrong = right.beside("wrong.exr");
        edit(right.exr(), operations, &wrong);
        caught(what, &wrong);
    }
    // One of 16 sets is missing from the sum.
    let wrong = right.beside("wrong.exr");
    lose_a_set(right.exr(), &wrong);
    caught("a lost VPL set", &wrong);
    // One of 16 sets is missing, and the others make up for it.
    caught(
        "15 sets for 16",
        cornell_box(&format!("{REFERENCE_SIZE} --vpls 240 --vpl-sets 15")).exr(),
    );
    caught(
        "15 passes for 16",
        cornell_box(&format!("{REFERENCE_SIZE} --spp 15")).exr(),
    );
    caught(
        "a wrong light",
        with_another_light("213.0 548.8 227.0", "233.0 548.8 227.0").exr(),
    );
}

fn lose_a_set(picture: &Path, wrong: &Path) {
    let operations = "--ch R,G,B --dup";
    let lost = wrong.with_file_name("lost.exr");
    edit(
        picture,
        "--ch R=indirect.R,G=indirect.G,B=indirect.B --mulc 0.0625",
        &lost,
    );
    edit(
        picture,
        &format!("{operations} --pop {} --sub", lost.display()),
        wrong,
    );
}

fn with_another_light(corner: &str, moved: &str) -> Finished {
    let copy = SceneFolder::copy_of("cornell-box").replacing("cornell-box.obj", corner, moved);
    Master::new(FULL).scene(copy.path("cornell-box.toml")).deliver()
}
