//! Gives the shared library the name by which programs that are linked to it find it.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // Raised with every change that breaks a program built before.
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libgridlight.so.0");
}
