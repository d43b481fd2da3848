//! The command line: what it refuses, with which exit code and which words.
#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot start its program has failed"
)]

use std::{
    fs,
    net::TcpListener,
    path::Path,
    process::{Command, Output},
};

/// The master in an empty folder; nothing may stay behind there.
fn master(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_master"))
        .args(arguments)
        .current_dir(folder)
        .env_remove("RUST_LOG")
        .output()
        .unwrap()
}

/// Runs with these flags, which must be refused with this code and a message that has all these words.
#[track_caller]
fn refused(arguments: &str, code: i32, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    refused_in(folder.path(), arguments, code, words);
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert!(left.is_empty(), "{arguments}: left behind {left:?}");
}

#[track_caller]
fn refused_in(folder: &Path, arguments: &str, code: i32, words: &[&str]) {
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let output = master(folder, &arguments);
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    for word in words {
        assert!(text.contains(word), "{arguments:?}: {word:?} is not in {text:?}");
    }
    assert!(!text.contains("panicked"), "{text}");
    assert!(output.stdout.is_empty(), "{arguments:?}: something on stdout");
}

#[test]
fn deadlines_out_of_range_are_refused_with_flag_value_and_range() {
    for deadline in ["0", "-1", "NaN", "inf", "0.01", "1e9", "86400.1", "soon"] {
        let flags = format!("--deadline {deadline}");
        let range: &[&str] = if deadline == "soon" {
            &["not a number"]
        } else {
            &["0.1", "86400"]
        };
        refused(&flags, 2, &[&["--deadline", deadline], range].concat());
    }
}

#[test]
fn sizes_that_cannot_be_are_refused() {
    for size in ["0x768", "1024x0", "1000000x1000000", "1024", "ax3", "-4x4"] {
        refused(&format!("--size {size}"), 2, &["--size", size]);
    }
}

#[test]
fn workloads_that_cannot_be_are_refused() {
    refused("--spp 0", 2, &["spp", "0"]);
    refused("--vpls 0", 2, &["VPLs", "0"]);
    refused("--groups 0", 2, &["groups", "0"]);
    refused("--vpl-sets 0", 2, &["VPL sets", "0"]);
    refused("--vpls 256 --vpl-sets 15", 2, &["256", "15", "divide"]);
    refused("--vpls 99999999999", 2, &["--vpls"]);
}

#[test]
fn values_that_make_no_sense_are_refused() {
    for flags in [
        "--clamp 0",
        "--clamp -1",
        "--clamp NaN",
        "--delta-t -1",
        "--delta-t soon",
        "--min-set-percent 101",
        "--exposure inf",
        "--local-slots 2000",
        "--local-slots -1",
        "--listen nowhere",
        "--reconstruction magic",
        "--algorithm magic",
        "--no-such-flag 1",
    ] {
        let flag = flags.split_whitespace().next().unwrap();
        refused(flags, 2, &[flag]);
    }
}

#[test]
fn flags_that_contradict_each_other_are_refused() {
    refused("--deadline 4 --no-deadline", 2, &["--deadline", "--no-deadline"]);
    refused("--integrator path", 2, &["--no-deadline"]);
    refused(
        "--paper --integrator path --no-deadline",
        2,
        &["--paper", "--integrator"],
    );
    refused("-q -v", 2, &["--quiet", "--verbose"]);
}

#[test]
fn an_output_that_cannot_be_written_is_refused_at_once() {
    refused("--out nowhere/a.exr", 4, &["nowhere", "does not exist"]);
    refused("--out a.jpg", 2, &["a.jpg", ".exr"]);
    refused("--report nowhere/a.json", 4, &["--report", "nowhere"]);
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("a.exr")).unwrap();
    refused_in(folder.path(), "--out a.exr", 4, &["a.exr", "folder"]);
}

#[test]
fn an_address_in_use_is_refused_by_name() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    refused(
        &format!("--listen {address}"),
        5,
        &[&address, "in use", "--listen"],
    );
}

#[test]
fn a_scene_that_is_not_there_is_refused_by_name() {
    refused("--scene nowhere.toml --deadline 5", 3, &["nowhere.toml"]);
    refused("--scene nowhere.obj --deadline 5", 3, &["nowhere.obj"]);
}

#[test]
fn the_help_names_every_flag_with_unit_and_default_and_every_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let output = master(folder.path(), &["--help"]);
    let help = String::from_utf8(output.stdout).unwrap();
    for words in [
        "--deadline <SECONDS>",
        "[default: 8]",
        "--scene <FILE>",
        "[default: the Cornell box]",
        "--out <FILE>",
        "[default: render.exr]",
        "--size <WxH>",
        "--algorithm <NAME>",
        "component",
        "straightforward",
        "--paper",
        "--groups <COUNT>",
        "--spp <COUNT>",
        "--vpls <COUNT>",
        "--vpl-sets <COUNT>",
        "--seed <NUMBER>",
        "--clamp <BOUND>",
        "--reconstruction <NAME>",
        "--min-set-percent <PERCENT>",
        "--delta-t <SECONDS>",
        "--no-deadline",
        "--listen <ADDRESS>",
        "--local-slots <COUNT>",
        "--exposure <STOPS>",
        "--json",
        "--report <FILE>",
        "--quiet",
        "--verbose",
        "Exit codes:",
        "130",
    ] {
        assert!(help.contains(words), "{words:?} is not in the help:\n{help}");
    }
    assert!(!help.contains("worker --"), "the hidden subcommand shows");
}

#[test]
fn the_version_has_a_revision() {
    let folder = tempfile::tempdir().unwrap();
    let output = master(folder.path(), &["--version"]);
    let version = String::from_utf8(output.stdout).unwrap();
    assert!(
        version.starts_with(concat!("master ", env!("CARGO_PKG_VERSION"), " (")),
        "{version}"
    );
}
