//! The header that C programs include is the one that the code makes. That this test is here also makes
//! cargo build the libraries, which the end-to-end tests need.

use std::{env, fs, path::Path};

/// If it is set, the header is written instead of compared.
const UPDATE: &str = "GRIDLIGHT_UPDATE_HEADER";

#[test]
fn the_header_is_what_cbindgen_makes_of_the_code() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let committed = package.join("../include/gridlight.h");
    let bindings = cbindgen::generate(package).expect("cbindgen understands the code");
    let mut made = Vec::new();
    bindings.write(&mut made);
    if env::var_os(UPDATE).is_some() {
        return fs::write(&committed, made).expect("the header can be written");
    }
    assert!(
        fs::read(&committed).is_ok_and(|header| header == made),
        "include/gridlight.h is not what capi/src says; make it anew by\n\
         {UPDATE}=1 cargo test -p capi --test header"
    );
}
