//! Records which version and revision the programs are built from, and says in
//! words when Embree 4 is missing. `master`, `worker` and `eval` run it too
//! (`build = "../build.rs"`). It depends on nothing, so a machine without Embree
//! hears of it in seconds, not after the bindings' own build script was built.
#[path = "embree-sys/discover.rs"]
mod discover;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use discover::Embree;

fn main() {
    match discover::find() {
        Ok(embree) => record(&embree),
        Err(message) => discover::report(&message),
    }
}

fn record(embree: &Embree) {
    println!("cargo:rerun-if-changed={}", embree.version_header().display());
    println!("cargo:rerun-if-changed={}", embree.library.display());

    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let root = package
        .ancestors()
        .find(|folder| folder.join("embree-sys/discover.rs").exists())
        .unwrap_or(&package);
    println!("cargo:rerun-if-changed={}", root.join("build.rs").display());
    println!(
        "cargo:rerun-if-changed={}",
        root.join("embree-sys/discover.rs").display()
    );

    println!("cargo:rustc-env=GRIDLIGHT_VERSION={}", env!("CARGO_PKG_VERSION"));
    println!("cargo:rustc-env=GRIDLIGHT_REVISION={}", revision(root));
    watch_revision(root, &package);
}

/// The commit's short hash, with `-dirty` if files differ from it; `unknown`
/// outside of a git work tree of Gridlight's own.
fn revision(root: &Path) -> String {
    // A source archive unpacked inside another repository has not that one's
    // revision.
    if !root.join(".git").exists() {
        return "unknown".to_owned();
    }
    git(
        root,
        &["describe", "--always", "--dirty", "--exclude=*", "--abbrev=9"],
    )
    .unwrap_or_else(|| "unknown".to_owned())
}

/// Asks cargo to come again when the revision may have changed: after a commit,
/// a checkout or a reset, all of which write to HEAD's log, and after an edit
/// that makes this package be compiled anyway. Names only files that exist,
/// because cargo takes a missing one for changed, every time.
fn watch_revision(root: &Path, package: &Path) {
    let logged = ["HEAD", "logs/HEAD"]
        .iter()
        .filter_map(|name| git(root, &["rev-parse", "--git-path", name]))
        .map(|path| root.join(path));
    let sources = ["src", "../render/src", "../protocol/src"].map(|folder| package.join(folder));
    for path in logged
        .chain(sources)
        .filter(|path| fs::exists(path).unwrap_or(false))
    {
        println!("cargo:rerun-if-changed={}", path.display());
    }
}

/// What git prints, if it works and prints something.
fn git(root: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .args(arguments)
        .current_dir(root)
        // A build must not hold a lock that the user's own git needs.
        .env("GIT_OPTIONAL_LOCKS", "0")
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let text = text.trim();
    (output.status.success() && !text.is_empty()).then(|| text.to_owned())
}
