//! The files of a picture, as another program reads them.

use gridlight::{
    master::{Finished, Master},
    oiio::{Limits, assert_finite, differ, edit, info},
};

/// A picture of which some tasks are missing by the number of workers that come: none.
const SMALL: &str = "--paper --no-deadline --size 80x60 --vpls 32 --vpl-sets 4 --spp 4";

fn small(flags: &str) -> Finished {
    Master::new(&format!("{SMALL} {flags}")).deliver()
}

#[test]
fn the_exr_has_every_layer_in_the_right_type() {
    let picture = small("");
    assert_finite(picture.exr());
    let info = info(picture.exr());
    let line = info
        .lines()
        .find_map(|line| line.trim().strip_prefix("channel list: "));
    let mut channels: Vec<&str> = line.expect("a list of channels").split(", ").collect();
    channels.sort_unstable();
    let expected = [
        "B (float)",
        "G (float)",
        "R (float)",
        "albedo.B (half)",
        "albedo.G (half)",
        "albedo.R (half)",
        "depth.Z (float)",
        "direct.B (float)",
        "direct.G (float)",
        "direct.R (float)",
        "indirect.B (float)",
        "indirect.G (float)",
        "indirect.R (float)",
        "normal.X (half)",
        "normal.Y (half)",
        "normal.Z (half)",
        "samples.direct (uint)",
        "samples.indirect (uint)",
    ];
    assert_eq!(channels, expected, "{info}");
    assert!(info.contains("80 x   60"), "{info}");
}

#[test]
fn the_metadata_has_settings_and_report() {
    let picture = small("--seed 42 --clamp none");
    let info = info(picture.exr());
    for (name, value) in [
        ("seed", "42"),
        ("tasks", "completed"),
        ("reconstructed_percent", "indirect"),
        ("settings", "cornell-box.toml"),
        ("settings", "geometry_clamp"),
        ("seconds", "bvh"),
        ("workers", "local"),
        ("version", env!("CARGO_PKG_VERSION")),
    ] {
        let name = format!("gridlight.{name}:");
        let line = info.lines().find(|line| line.trim().starts_with(&name));
        let line = line.unwrap_or_else(|| panic!("{name} is not in {info}"));
        assert!(line.contains(value), "{value} is not in {line}");
    }
}

#[test]
fn the_beauty_is_the_sum_of_emission_direct_and_indirect_light() {
    let picture = small("");
    let pixels = picture.pixels();
    let [beauty, direct, indirect] = ["R", "direct.R", "indirect.R"].map(|name| pixels.channel(name));
    let emitted = (0..beauty.len()).map(|pixel| beauty[pixel] - direct[pixel] - indirect[pixel]);
    let (lamp, elsewhere): (Vec<f32>, Vec<f32>) = emitted.partition(|&emitted| emitted > 1.0);
    assert!(
        !lamp.is_empty() && lamp.len() < 100,
        "{} pixels shine",
        lamp.len()
    );
    // The lamp's Ke, see cornell-box.mtl.
    assert!(
        lamp.iter().all(|emitted| (emitted - 47.6).abs() < 1e-3),
        "{lamp:?}"
    );
    assert!(elsewhere.iter().all(|emitted| emitted.abs() < 1e-5));
}

#[test]
fn the_samples_say_what_is_real() {
    let whole = small("").pixels();
    for (name, samples) in [("samples.direct", 4), ("samples.indirect", 4)] {
        assert!(whole.counts(name).iter().all(|&count| count == samples), "{name}");
    }
}

#[test]
fn albedo_normal_and_depth_are_those_of_the_cornell_box() {
    let pixels = small("").pixels();
    // A pixel on the left wall in the picture, at middle height: red, facing right.
    let wall = 30 * pixels.width + 11;
    let at = |name: &str| pixels.channel(name)[wall];
    let near = |value: f32, expected: f32| (value - expected).abs() < 0.01;
    let albedo = ["albedo.R", "albedo.G", "albedo.B"].map(at);
    assert!(
        near(albedo[0], 0.63) && near(albedo[1], 0.065) && near(albedo[2], 0.05),
        "{albedo:?}"
    );
    assert!(at("normal.X").abs() > 0.99, "{}", at("normal.X"));
    assert!((800.0..1500.0).contains(&at("depth.Z")), "{}", at("depth.Z"));
}

#[test]
fn the_png_is_the_beauty_in_srgb_one_stop_brighter_when_asked() {
    let one_code = Limits {
        pixel: 1.01 / 255.0,
        percent: 0.0,
        worst: 1.01 / 255.0,
        brightest: 1.0,
    };
    for (flags, scale) in [("", 1.0), ("--exposure 1", 2.0)] {
        let picture = small(flags);
        let expected = picture.beside("expected.exr");
        let shown = format!("--ch R,G,B --mulc {scale} --clamp:min=0:max=1 --colorconvert linear sRGB");
        edit(picture.exr(), &shown, &expected);
        assert_eq!(differ(&picture.png(), &expected, one_code), None, "{flags}");
    }
}

#[test]
fn either_file_alone_is_made_when_asked() {
    let exr_only = small("--no-png");
    assert_eq!(exr_only.left_behind(), ["picture.exr"]);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let png = folder.path().join("alone.png");
    let png_only = Master::new(SMALL).out(&png).deliver();
    assert_eq!(png_only.left_behind(), ["alone.png"]);
    assert_finite(&png);
}

#[test]
fn without_reconstruction_what_is_missing_is_black() {
    // Far too much work for the time.
    let flags = "--algorithm component --deadline 1.5 --vpls 65536 --vpl-sets 4 --reconstruction none";
    let picture = Master::new(flags).deliver();
    assert_finite(picture.exr());
    let pixels = picture.pixels();
    let (light, samples) = (pixels.channel("indirect.G"), pixels.counts("samples.indirect"));
    let missing: Vec<f32> = (0..light.len())
        .filter(|&pixel| samples[pixel] == 0)
        .map(|pixel| light[pixel])
        .collect();
    assert!(!missing.is_empty() && missing.iter().all(|light| light.abs() < f32::MIN_POSITIVE));
}

#[test]
fn a_picture_with_fewer_pixels_than_groups_is_whole() {
    for algorithm in ["component", "straightforward", "progressive"] {
        for size in ["1x1", "5x3"] {
            let flags = format!("--paper --no-deadline --size {size} --algorithm {algorithm}");
            let picture = Master::new(&flags).deliver();
            assert!(picture.is_whole(), "{flags}: {}", picture.log);
            assert_finite(picture.exr());
        }
    }
}
