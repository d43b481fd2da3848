//! `eval compare` as a person or a script calls it.

use std::path::{Path, PathBuf};
use std::process::Command;

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, ImageAttributes, IntegerBounds};
use exr::prelude::{Encoding, Layer, LayerAttributes, WritableImage};
use serde_json::Value;
use tempfile::TempDir;

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

type Pixels = Vec<[f32; 3]>;

/// A soft gradient of light.
fn gold() -> Pixels {
    let pixel = |i: usize| {
        let (x, y) = (
            (i % WIDTH) as f32 / WIDTH as f32,
            (i / WIDTH) as f32 / HEIGHT as f32,
        );
        [0.2 + 0.3 * x, 0.3 + 0.2 * y, 0.25]
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

/// The gradient with a chequered patch in the left half.
fn patched() -> Pixels {
    let mut pixels = gold();
    for (i, pixel) in pixels.iter_mut().enumerate() {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let inside = (8..24).contains(&x) && (16..32).contains(&y);
        if inside && (x / 2 + y / 2).is_multiple_of(2) {
            *pixel = [0.9; 3];
        }
    }
    pixels
}

/// A folder with pictures in it, and the program to run there.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder for pictures"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).expect("writing a file");
    }

    /// Writes layers of a multi-layer EXR file, each with the prefix of its channels' names.
    fn write_layers(&self, name: &str, size: (usize, usize), layers: &[(&str, Pixels)]) {
        let channel = |prefix: &str, index: usize, pixels: &Pixels| {
            let samples = pixels.iter().map(|pixel| pixel[index]).collect();
            let name = format!("{prefix}{}", ["R", "G", "B"][index]);
            AnyChannel::new(name.as_str(), FlatSamples::F32(samples))
        };
        let channels = layers
            .iter()
            .flat_map(|(prefix, pixels)| [0, 1, 2].map(|index| channel(prefix, index, pixels)));
        let channels = AnyChannels::sort(channels.collect());
        let part = Layer::new(
            size,
            LayerAttributes::default(),
            Encoding::FAST_LOSSLESS,
            channels,
        );
        let image = Image::new(ImageAttributes::new(IntegerBounds::from_dimensions(size)), part);
        image
            .write()
            .to_file(self.path(name))
            .expect("writing an EXR file");
    }

    fn write_exr(&self, name: &str, pixels: &Pixels) {
        self.write_layers(name, (WIDTH, HEIGHT), &[("", pixels.clone())]);
    }

    fn write_pfm(&self, name: &str, pixels: &Pixels) {
        let rows = pixels.chunks_exact(WIDTH).rev().flatten().flatten();
        let floats = rows.flat_map(|value| value.to_le_bytes());
        let bytes: Vec<u8> = format!("PF\n{WIDTH} {HEIGHT}\n-1.0\n")
            .bytes()
            .chain(floats)
            .collect();
        self.write(name, &bytes);
    }

    fn write_png(&self, name: &str, pixels: &Pixels) {
        let encode = |value: f32| (eval::color::linear_to_srgb(value.into()) * 255.0).round() as u8;
        let codes: Vec<_> = pixels.iter().map(|pixel| pixel.map(encode)).collect();
        let written = eval::image_io::write_png(&self.path(name), WIDTH, HEIGHT, &codes);
        written.expect("writing a PNG file");
    }

    /// Exit code, stdout and stderr of `eval compare` with these arguments, divided by spaces.
    fn compare(&self, args: &str) -> (Option<i32>, String, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_eval"));
        command
            .current_dir(self.0.path())
            .arg("compare")
            .args(args.split(' '));
        let output = command.output().expect("starting eval");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
        (output.status.code(), text(output.stdout), text(output.stderr))
    }

    /// Stdout of a call that has to succeed, in silence on stderr.
    fn table(&self, args: &str) -> String {
        let (code, stdout, stderr) = self.compare(args);
        assert_eq!((code, stderr.as_str()), (Some(0), ""), "{args}");
        stdout
    }

    fn json(&self, args: &str) -> Value {
        serde_json::from_str(&self.table(&format!("{args} --json"))).expect("JSON")
    }

    /// Demands that a call fails with code 2, prints nothing on stdout, and says these words.
    fn check_refused(&self, args: &str, words: &[&str]) {
        let (code, stdout, stderr) = self.compare(args);
        assert_eq!((code, stdout.as_str()), (Some(2), ""), "{args}: {stderr}");
        for word in words {
            assert!(stderr.contains(word), "{args}: no {word:?} in {stderr}");
        }
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
}

fn number(value: &Value, pointer: &str) -> f64 {
    value
        .pointer(pointer)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("no {pointer} in {value}"))
}

/// Two EXR files that differ.
fn folder_with_pair() -> Folder {
    let folder = Folder::new();
    folder.write_exr("gold.exr", &gold());
    folder.write_exr("image.exr", &patched());
    folder
}

#[test]
fn equal_pictures_have_no_difference_by_any_metric() {
    let json = folder_with_pair().json("gold.exr gold.exr");
    for zero in [
        "vdp/0/percent",
        "vdp/0/percent_zero_identical",
        "flip",
        "rmse",
        "relmse",
    ] {
        assert!(
            number(&json, &format!("/images/0/{zero}")).abs() < f64::MIN_POSITIVE,
            "{zero}"
        );
    }
    assert!((number(&json, "/images/0/ssim") - 1.0).abs() < 1e-6);
    assert!(json.pointer("/images/0/psnr_db").is_some_and(Value::is_null));
}

#[test]
fn every_metric_sees_a_patch() {
    let json = folder_with_pair().json("gold.exr image.exr");
    assert_eq!((number(&json, "/width"), number(&json, "/height")), (64.0, 48.0));
    let changed = 100.0 * 128.0 / 3072.0;
    assert!(number(&json, "/images/0/vdp/0/percent") > changed);
    assert!((number(&json, "/images/0/vdp/0/percent_zero_identical") - changed).abs() < 0.5);
    for (metric, range) in [
        ("flip", 0.01..0.5),
        ("rmse", 0.05..0.3),
        ("relmse", 0.01..1.0),
        ("ssim", 0.1..0.97),
        ("psnr_db", 5.0..35.0),
    ] {
        let value = number(&json, &format!("/images/0/{metric}"));
        assert!(range.contains(&value), "{metric} {value}");
    }
}

#[test]
fn people_get_a_table_with_a_line_for_each_picture() {
    let table = folder_with_pair().table("gold.exr gold.exr image.exr");
    let lines: Vec<_> = table.lines().collect();
    assert_eq!(
        lines[0],
        "reference gold.exr, 64 × 48 pixels; all settings are the defaults"
    );
    let head = "image      VDP>75%  zero id.     FLIP       RMSE     relMSE     SSIM   PSNR dB  values";
    assert_eq!(lines[2], head);
    assert!(
        lines[3].starts_with("gold.exr    0.00 %    0.00 %  0.00000  0.0000000"),
        "{table}"
    );
    assert!(lines[4].starts_with("image.exr"), "{table}");
    assert!(
        lines
            .iter()
            .all(|line| line.chars().count() <= head.chars().count()),
        "{table}"
    );
}

#[test]
fn exr_and_pfm_files_of_one_picture_are_judged_alike() {
    let folder = folder_with_pair();
    folder.write_pfm("gold.pfm", &gold());
    folder.write_pfm("image.pfm", &patched());
    let from_exr = folder.json("gold.exr image.exr");
    let from_pfm = folder.json("gold.pfm image.pfm");
    for metric in ["vdp", "flip", "rmse", "ssim"] {
        assert_eq!(
            from_exr["images"][0][metric], from_pfm["images"][0][metric],
            "{metric}"
        );
    }
}

#[test]
fn png_files_are_compared_as_codes() {
    let folder = folder_with_pair();
    folder.write_png("gold.png", &gold());
    folder.write_png("image.png", &patched());
    let json = folder.json("gold.png image.png");
    assert_eq!(json["images"][0]["values"], "srgb");
    assert!(json["images"][0]["flip_exposures"].is_null());
    let linear = folder.json("gold.exr image.exr");
    assert_eq!(linear["images"][0]["values"], "linear");
    let percent = |json| number(json, "/images/0/vdp/0/percent");
    assert!(
        (percent(&json) - percent(&linear)).abs() < 1.0,
        "{} {}",
        percent(&json),
        percent(&linear)
    );
}

#[test]
fn a_png_beside_an_exr_differs_by_rounding_alone() {
    let folder = folder_with_pair();
    folder.write_png("gold.png", &gold());
    let json = folder.json("gold.exr gold.png");
    assert_eq!(json["images"][0]["values"], "srgb");
    assert!(number(&json, "/images/0/vdp/0/percent").abs() < f64::MIN_POSITIVE);
    assert!(number(&json, "/images/0/rmse") < 0.5 / 255.0);
}

#[test]
fn a_layer_is_compared_instead_of_the_picture() {
    let folder = Folder::new();
    let size = (WIDTH, HEIGHT);
    folder.write_layers("gold.exr", size, &[("", gold()), ("direct.", gold())]);
    folder.write_layers("image.exr", size, &[("", gold()), ("direct.", patched())]);
    let rmse = |args| number(&folder.json(args), "/images/0/rmse");
    assert!(rmse("gold.exr image.exr").abs() < f64::MIN_POSITIVE);
    assert!(rmse("gold.exr image.exr --layer direct") > 0.05);
}

#[test]
fn exposure_decides_what_an_eye_sees_and_not_the_plain_error() {
    let folder = folder_with_pair();
    let seen = folder.json("gold.exr image.exr");
    let burnt_out = folder.json("gold.exr image.exr --exposure 3");
    let dark = folder.json("gold.exr image.exr --exposure -12");
    for json in [&burnt_out, &dark] {
        assert!(number(json, "/images/0/vdp/0/percent") < 1.0);
        assert_eq!(json["images"][0]["rmse"], seen["images"][0]["rmse"]);
        assert_eq!(json["images"][0]["flip"], seen["images"][0]["flip"]);
    }
}

#[test]
fn published_slopes_stand_side_by_side() {
    let folder = folder_with_pair();
    let json = folder.json("gold.exr image.exr --vdp-slopes all");
    let slopes = |index: usize| json["images"][0]["vdp"][index]["slopes"].to_string();
    let expected = [
        "[1.0,1.0,1.0,1.0,1.0,1.0]",
        "[0.9,0.9,0.9,0.9,0.9,0.9]",
        "[1.0,1.0,1.0,0.8,0.8,0.7]",
    ];
    assert_eq!([0, 1, 2].map(slopes), expected);
    let table = folder.table("gold.exr image.exr --vdp-slopes all");
    let heads = [
        "1.0  zero id.",
        "0.9  zero id.",
        "1.0,1.0,1.0,0.8,0.8,0.7  zero id.",
    ];
    assert!(heads.iter().all(|head| table.contains(head)), "{table}");
    assert_eq!(
        table.lines().filter(|line| line.starts_with("image.exr")).count(),
        2,
        "{table}"
    );
}

#[test]
fn settings_that_are_not_the_defaults_are_printed() {
    let folder = folder_with_pair();
    let flags = "--exposure 1.5 --vdp-peak 200 --vdp-black 0.5 --vdp-distance 0.6 --vdp-ppd 40 \
                 --vdp-slopes 0.9 --vdp-no-phase-uncertainty --vdp-zero-identical --flip-ppd 50 --allow-nan";
    let table = folder.table(&format!("gold.exr image.exr {flags}"));
    let expected = "settings: exposure 1.5 stops, VDP peak 200 cd/m², VDP black 0.5 cd/m², \
                    VDP distance 0.6 m, VDP 40 pixels per degree, VDP phase uncertainty off, \
                    VDP zero identical, VDP slope of masking 0.9, FLIP 50 pixels per degree, NaN allowed";
    assert!(table.contains(expected), "{table}");
}

#[test]
fn every_setting_of_the_vdp_changes_its_result() {
    let folder = folder_with_pair();
    let mut noise = 1_u32;
    let mut noisy = gold();
    for value in noisy.iter_mut().flatten() {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value += 0.03 * (f64::from(noise) / f64::from(u32::MAX) - 0.5) as f32;
    }
    folder.write_exr("noisy.exr", &noisy);
    let score = |flags: &str| folder.json(&format!("gold.exr noisy.exr{flags}"))["images"][0]["vdp"].clone();
    let default = score("");
    for flags in [
        " --exposure 0.5",
        " --vdp-peak 200",
        " --vdp-black 5",
        " --vdp-distance 0.6",
        " --vdp-ppd 40",
        " --vdp-slopes 0.7",
        " --vdp-no-phase-uncertainty",
    ] {
        assert_ne!(
            score(flags)[0]["mean_probability"],
            default[0]["mean_probability"],
            "{flags}"
        );
    }
    let patch = folder.json("gold.exr image.exr --vdp-zero-identical");
    let vdp = &patch["images"][0]["vdp"][0];
    assert_eq!(vdp["percent"], vdp["percent_zero_identical"]);
}

fn png_pixel(path: &Path, x: usize, y: usize) -> [f32; 3] {
    let image = eval::image_io::read(path, None).expect("a map");
    assert_eq!((image.width, image.height), (WIDTH, HEIGHT));
    image.data[y * WIDTH + x]
}

#[test]
fn maps_show_the_patch_and_nothing_else() {
    let folder = folder_with_pair();
    // The rule keeps the coarse bands from spreading the patch all over so small a picture.
    folder.table("gold.exr image.exr --maps maps/new --vdp-zero-identical");
    let (patch, far) = ((16, 24), (48, 0));
    let pixel = |map: &str, (x, y): (usize, usize)| {
        png_pixel(&folder.path(&format!("maps/new/image.{map}.png")), x, y)
    };
    let [red, green, blue] = pixel("vdp", patch);
    assert!(red > 0.3 && green.max(blue) < 0.01, "red is a high probability");
    let [red, green, blue] = pixel("vdp", far);
    assert!(
        red > 0.2 && (red - green).abs().max((red - blue).abs()) < 0.01,
        "grey is none"
    );
    for map in ["flip", "error", "ssim"] {
        let [near, far] = [patch, far].map(|place| pixel(map, place)[0]);
        assert!(
            near > 0.3 && far < 0.05,
            "{map}: {near} in the patch, {far} far from it"
        );
    }
}

#[test]
fn maps_of_pictures_with_one_name_do_not_overwrite_each_other() {
    let folder = folder_with_pair();
    std::fs::create_dir(folder.path("other")).expect("a folder");
    folder.write_exr("other/image.exr", &gold());
    folder.table("gold.exr image.exr other/image.exr --maps maps");
    let names = ["1-image.vdp.png", "2-image.vdp.png"];
    assert!(names.iter().all(|name| folder.path("maps").join(name).exists()));
}

#[test]
fn files_that_are_not_pictures_are_refused() {
    let folder = folder_with_pair();
    folder.write("notes.exr", b"not a picture at all");
    folder.write("empty.exr", b"");
    folder.check_refused("gold.exr absent.exr", &["cannot read absent.exr", "No such file"]);
    folder.check_refused("absent.exr gold.exr", &["cannot read absent.exr"]);
    folder.check_refused("gold.exr notes.exr", &["notes.exr", "OpenEXR, PFM or PNG"]);
    folder.check_refused("gold.exr empty.exr", &["empty.exr", "OpenEXR, PFM or PNG"]);
    folder.check_refused("gold.exr .", &["cannot read .", "directory"]);
}

#[test]
fn damaged_files_are_refused() {
    let folder = folder_with_pair();
    folder.write_png("good.png", &gold());
    folder.write_pfm("good.pfm", &gold());
    std::fs::copy(folder.path("gold.exr"), folder.path("good.exr")).expect("a copy");
    for format in ["exr", "png", "pfm"] {
        let whole = std::fs::read(folder.path(&format!("good.{format}"))).expect("a file");
        let name = format!("half.{format}");
        folder.write(&name, &whole[..whole.len() / 2]);
        folder.check_refused(&format!("gold.exr {name}"), &[&name, "damaged"]);
    }
    folder.write("huge.pfm", b"PF\n1000000 1000000\n-1\n");
    folder.check_refused("gold.exr huge.pfm", &["huge.pfm", "1000000 × 1000000", "at most"]);
}

#[test]
fn pictures_of_another_size_are_refused_and_not_resized() {
    let folder = folder_with_pair();
    folder.write_layers("small.exr", (32, 96), &[("", gold())]);
    let words = ["small.exr", "gold.exr", "64 × 48", "32 × 96"];
    folder.check_refused("gold.exr small.exr", &words);
    // Not even the result of the picture before it is printed.
    folder.check_refused("gold.exr image.exr small.exr --json", &words);
}

#[test]
fn values_that_are_not_numbers_are_refused_unless_allowed() {
    let folder = folder_with_pair();
    let mut pixels = gold();
    pixels[3 * WIDTH + 5] = [f32::NAN, 0.0, 0.0];
    pixels[7 * WIDTH + 2] = [0.0, f32::INFINITY, 0.0];
    folder.write_exr("bad.exr", &pixels);
    let words = [
        "bad.exr",
        "1 pixels with NaN",
        "1 with infinite",
        "column 5, row 3",
        "--allow-nan",
    ];
    folder.check_refused("gold.exr bad.exr", &words);
    folder.check_refused("bad.exr gold.exr", &words);
    let json = folder.json("gold.exr bad.exr --allow-nan");
    assert!(number(&json, "/images/0/vdp/0/percent") > 0.0);
    assert!(number(&json, "/images/0/rmse") > 1.0);
}

#[test]
fn missing_layers_and_channels_are_refused_with_a_list_of_those_that_exist() {
    let folder = folder_with_pair();
    let size = (WIDTH, HEIGHT);
    folder.write_layers("layers.exr", size, &[("", gold()), ("albedo.", gold())]);
    let words = [
        "layers.exr",
        "lacks direct.R, direct.G, direct.B",
        "no --layer for the picture itself",
        "--layer albedo",
    ];
    folder.check_refused("layers.exr layers.exr --layer direct", &words);
    folder.write_layers("no-beauty.exr", size, &[("direct.", gold())]);
    folder.check_refused(
        "gold.exr no-beauty.exr",
        &["no-beauty.exr", "lacks R, G, B", "--layer direct"],
    );
    folder.write_png("gold.png", &gold());
    folder.check_refused(
        "gold.png gold.png --layer direct",
        &["gold.png", "PNG", "no layers"],
    );
}

#[test]
fn flags_that_make_no_sense_are_refused() {
    let folder = folder_with_pair();
    for (flags, words) in [
        ("--vdp-slopes 1,2", vec!["--vdp-slopes", "six"]),
        ("--vdp-slopes 3", vec!["slope of masking 3", "0 to 2"]),
        ("--vdp-peak 0.1", vec!["peak 0.1", "black < peak"]),
        ("--vdp-black 0", vec!["black 0", "0 < black"]),
        ("--vdp-distance 0", vec!["distance 0 m"]),
        ("--vdp-ppd NaN", vec!["NaN pixels per degree"]),
        ("--flip-ppd 0", vec!["--flip-ppd", "1 to 10000"]),
        ("--exposure inf", vec!["--exposure", "finite"]),
        ("--colour", vec!["--colour"]),
    ] {
        folder.check_refused(&format!("gold.exr image.exr {flags}"), &words);
    }
    folder.check_refused("gold.exr", &["<IMAGES>"]);
}

#[test]
fn a_folder_for_maps_that_cannot_be_made_is_an_error() {
    let folder = folder_with_pair();
    folder.write("file", b"");
    folder.check_refused("gold.exr image.exr --maps file", &["folder file for maps"]);
}

#[test]
fn pictures_smaller_than_a_window_have_no_ssim() {
    let folder = Folder::new();
    folder.write_layers("tiny.exr", (4, 2), &[("", vec![[0.5; 3]; 8])]);
    let json = folder.json("tiny.exr tiny.exr --maps .");
    assert!(json["images"][0]["ssim"].is_null());
    assert!(folder.table("tiny.exr tiny.exr").contains("too small"));
}
