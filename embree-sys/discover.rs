//! Finds Embree 4 on this machine. Shared by the build scripts of this crate and
//! of the programs, so that both say the same when it is missing.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

/// Where `./setup` puts Embree on systems that have no package of it.
const SETUP_PREFIX: &str = "/opt/embree4";

/// An installed Embree 4.
pub(crate) struct Embree {
    /// Folder that holds `embree4/rtcore.h`.
    pub(crate) include: PathBuf,
    /// The shared library under the name that stays when its patches change.
    pub(crate) library: PathBuf,
}

impl Embree {
    /// The header that says which version this is.
    pub(crate) fn version_header(&self) -> PathBuf {
        version_header(&self.include, 4)
    }
}

/// Looks in `$EMBREE_DIR`, then asks pkg-config, then looks where `./setup`
/// installs, then in the system's own folders. A set `EMBREE_DIR` is the only
/// place looked in: who names a folder does not want another one used silently.
///
/// # Errors
/// A message for a person, naming what was found instead and `./setup`.
pub(crate) fn find() -> Result<Embree, String> {
    println!("cargo:rerun-if-env-changed=EMBREE_DIR");
    println!("cargo:rerun-if-env-changed=PKG_CONFIG_PATH");
    if let Some(prefix) = env::var_os("EMBREE_DIR").filter(|prefix| !prefix.is_empty()) {
        let prefix = PathBuf::from(prefix);
        return at(&prefix).map_err(|found| {
            let why = found.unwrap_or_else(|| "no include/embree4".to_owned());
            message(&format!("EMBREE_DIR is {}, which has {why}", prefix.display()))
        });
    }

    let mut seen_instead = None;
    for prefix in prefixes() {
        match at(&prefix) {
            Ok(embree) => return Ok(embree),
            Err(found) => {
                let seen = found.map(|found| format!("{} has {found}", prefix.display()));
                seen_instead = seen_instead.or(seen);
            }
        }
    }
    let why = seen_instead.unwrap_or_else(|| "it is not on this machine".to_owned());
    Err(message(&why))
}

/// Fails the build with a message for a person. Cargo does it for us: a script
/// that exits with an error itself gets its whole output shown around the words.
pub(crate) fn report(message: &str) {
    for line in message.lines() {
        println!("cargo::error={line}");
    }
}

fn message(why: &str) -> String {
    format!(
        "Gridlight needs Embree 4, and {why}.\n\
         Run ./setup in Gridlight's folder: it installs Embree 4 and all else the build needs.\n\
         If you have Embree 4 elsewhere, set EMBREE_DIR to the folder that holds its include/embree4 and lib."
    )
}

fn prefixes() -> Vec<PathBuf> {
    let asked = Command::new("pkg-config")
        .args(["--variable=prefix", "embree4"])
        .output()
        .ok()
        .filter(|output| output.status.success())
        .map(|output| PathBuf::from(String::from_utf8_lossy(&output.stdout).trim()));
    asked
        .into_iter()
        .chain([SETUP_PREFIX, "/usr/local", "/usr"].map(PathBuf::from))
        .collect()
}

/// Embree 4 under `prefix`; if it is not there, what is there instead, if
/// anything.
fn at(prefix: &Path) -> Result<Embree, Option<String>> {
    // Absolute, because the library's path is written into what is built.
    let prefix = fs::canonicalize(prefix).map_err(|_absent| None)?;
    let include = prefix.join("include");
    let Some(version) = version(&version_header(&include, 4)) else {
        let old = version(&version_header(&include, 3));
        return Err(old.map(|old| format!("only Embree {old}")));
    };
    if !version.starts_with("4.") {
        return Err(Some(format!("Embree {version}")));
    }
    let library = library(&prefix)
        .ok_or_else(|| Some(format!("the headers of Embree {version}, but not libembree4.so")))?;
    Ok(Embree { include, library })
}

fn version_header(include: &Path, major: u32) -> PathBuf {
    include.join(format!("embree{major}/rtcore_config.h"))
}

/// The version as Embree's own header says it: `#define RTC_VERSION_STRING "4.3.3"`.
fn version(header: &Path) -> Option<String> {
    let text = fs::read_to_string(header).ok()?;
    let line = text.lines().find(|line| line.contains("RTC_VERSION_STRING"))?;
    line.split('"').nth(1).map(str::to_owned)
}

fn library(prefix: &Path) -> Option<PathBuf> {
    let arch = env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let folders = [
        "lib".to_owned(),
        "lib64".to_owned(),
        format!("lib/{arch}-linux-gnu"),
    ];
    folders
        .iter()
        .flat_map(|folder| ["libembree4.so.4", "libembree4.so"].map(|name| prefix.join(folder).join(name)))
        .find(|library| library.exists())
}
