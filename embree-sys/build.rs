//! Finds Embree 4, generates the bindings to it and says how to link it.
mod discover;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use discover::Embree;

const HEADER: &str = "#include <embree4/rtcore.h>\n";

fn main() {
    if let Err(message) = build() {
        discover::report(&message);
    }
}

fn build() -> Result<(), String> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=discover.rs");
    let out = PathBuf::from(
        env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR for build scripts; run this through cargo")?,
    );
    let embree = discover::find()?;
    println!("cargo:rerun-if-changed={}", embree.version_header().display());
    let bindings = generate_bindings(&embree)?;
    fs::write(out.join("bindings.rs"), &bindings).map_err(|error| format!("{}: {error}", out.display()))?;
    link(&embree, &out, &bindings)
}

fn generate_bindings(embree: &Embree) -> Result<String, String> {
    // bindgen panics without libclang; asked first, it is a sentence.
    clang_sys::load().map_err(|error| {
        format!(
            "Gridlight's build reads Embree's headers with libclang, and it could not be loaded.\n\
             Run ./setup in Gridlight's folder: it installs libclang and all else the build needs.\n\
             The reason given: {error}"
        )
    })?;
    let bindings = bindgen::Builder::default()
        .header_contents("wrapper.h", HEADER)
        .clang_arg(format!("-I{}", embree.include.display()))
        .allowlist_function("rtc.*")
        .allowlist_type("RTC.*")
        .allowlist_var("RTC.*")
        // Newtypes, because a C enum may hold numbers its header does not name.
        .default_enum_style(bindgen::EnumVariation::NewType {
            is_bitfield: false,
            is_global: false,
        })
        .derive_default(true)
        .use_core()
        .generate()
        .map_err(|error| {
            format!(
                "Embree's headers in {} could not be read: {error}\n\
                 If a header of the C compiler is missing, run ./setup in Gridlight's folder.",
                embree.include.display()
            )
        })?;
    Ok(bindings.to_string())
}

/// Links Embree by name if the loader finds it by itself, else by its full path.
///
/// A run path (`-rpath`) would be the usual way to the full path, but a library
/// crate's build script cannot give one to what is built from it: each program,
/// test, benchmark and shared library would need a build script of its own, and
/// documentation tests would have no way at all. So we link an *import library*:
/// an empty shared object with Embree's function names whose SONAME is Embree's
/// full path. The linker copies a SONAME as it is, and the loader opens a name
/// with a slash as a path; so whatever links this crate finds Embree without
/// any flag. Nothing of the import library itself is used at run time.
fn link(embree: &Embree, out: &Path, bindings: &str) -> Result<(), String> {
    let folder = embree.library.parent().unwrap_or(Path::new("/"));
    if folder.starts_with("/usr/lib") || folder.starts_with("/usr/lib64") {
        println!("cargo:rustc-link-search=native={}", folder.display());
        println!("cargo:rustc-link-lib=dylib=embree4");
        return Ok(());
    }
    make_import_library(&embree.library, out, bindings)?;
    println!("cargo:rustc-link-search=native={}", out.display());
    println!("cargo:rustc-link-lib=dylib=embree4_import");
    Ok(())
}

fn make_import_library(library: &Path, out: &Path, bindings: &str) -> Result<(), String> {
    println!("cargo:rerun-if-env-changed=CC");
    let names = bindings
        .lines()
        .filter_map(|line| line.trim().strip_prefix("pub fn ")?.split('(').next());
    let functions: Vec<String> = names.map(|name| format!("void {name}(void) {{}}\n")).collect();
    let source = out.join("embree4_import.c");
    fs::write(&source, functions.concat()).map_err(|error| format!("{}: {error}", source.display()))?;

    let compiler = env::var("CC").unwrap_or_else(|_unset| "cc".to_owned());
    let status = Command::new(&compiler)
        .args(["-shared", "-fPIC", "-nostdlib", "-Xlinker", "-soname", "-Xlinker"])
        .arg(library)
        .arg("-o")
        .arg(out.join("libembree4_import.so"))
        .arg(&source)
        .status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!(
            "the C compiler {compiler} failed on {} ({status}).",
            source.display()
        )),
        Err(error) => Err(format!(
            "the C compiler {compiler} does not run ({error}).\n\
             Run ./setup in Gridlight's folder: it installs one and all else the build needs."
        )),
    }
}
