//! Pictures as `oiiotool` sees them: a judge that shares no code with us.

use std::{
    ffi::OsStr,
    path::Path,
    process::{Command, Output},
};

/// How much two pictures may differ and still be the same.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// A pixel differs if one of its values does by more than this.
    pub pixel: f32,
    /// Pixels that may differ, in percent.
    pub percent: f32,
    /// No value may differ by more than this.
    pub worst: f32,
    /// Values beyond this count as this.
    pub brightest: f32,
}

/// Runs `oiiotool`; panics if it is not there.
pub fn oiiotool<I: AsRef<OsStr>>(arguments: impl IntoIterator<Item = I>) -> Output {
    let output = Command::new("oiiotool").args(arguments).output();
    output.expect("oiiotool runs: ./setup installs it")
}

/// Runs `oiiotool`, which must succeed, and returns what it says.
#[track_caller]
pub fn must<I: AsRef<OsStr>>(arguments: impl IntoIterator<Item = I>) -> String {
    let output = oiiotool(arguments);
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text).into_owned();
    assert!(output.status.success(), "oiiotool: {text}");
    text
}

/// Makes a picture of another by operations as on `oiiotool`'s command line, separated by spaces.
#[track_caller]
pub fn edit(input: &Path, operations: &str, output: &Path) {
    let operations = operations.split_whitespace().map(OsStr::new);
    let ends = ([input.as_os_str()], ["-o".as_ref(), output.as_os_str()]);
    must(ends.0.into_iter().chain(operations).chain(ends.1));
}

/// Fails if the picture is missing, unreadable, or has a value that is no finite number. To be asked
/// before [`differ`]: a diff passes pictures with several of those.
#[track_caller]
pub fn assert_finite(picture: &Path) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    edit(picture, "--fixnan error", &folder.path().join("checked.exr"));
}

/// What `oiiotool` says if the beauty of two pictures differs by more than the limits.
#[track_caller]
pub fn differ(picture: &Path, reference: &Path, limits: Limits) -> Option<String> {
    let Limits {
        pixel,
        percent,
        worst,
        brightest,
    } = limits;
    let flags = format!("--fail {pixel} --failpercent {percent} --hardfail {worst} --diff");
    let clamp = format!("--clamp:min=-1000:max={brightest}");
    let mut arguments: Vec<&OsStr> = Vec::new();
    for side in [picture, reference] {
        arguments.extend([
            side.as_os_str(),
            "--ch".as_ref(),
            "R,G,B".as_ref(),
            clamp.as_ref(),
        ]);
    }
    arguments.extend(flags.split_whitespace().map(OsStr::new));
    let output = oiiotool(arguments);
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text).into_owned();
    // It also fails if it cannot compare, which says nothing.
    let (same, different) = (output.status.success(), text.contains("FAILURE"));
    assert!(same != different, "oiiotool: {text}");
    different.then_some(text)
}

/// A hash of all pixel data, metadata not included: equal for equal bits only.
#[track_caller]
pub fn pixel_hash(picture: &Path) -> String {
    let text = must([OsStr::new("--info"), "--hash".as_ref(), picture.as_os_str()]);
    let hash = text.lines().find_map(|line| line.trim().strip_prefix("SHA-1: "));
    hash.unwrap_or_else(|| panic!("no hash in {text}")).to_owned()
}

/// All that `oiiotool` knows of a picture: channels with their types, and metadata.
#[track_caller]
pub fn info(picture: &Path) -> String {
    must([OsStr::new("--info"), "-v".as_ref(), picture.as_os_str()])
}
