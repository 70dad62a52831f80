//! Tells the library where the machine's table is.

use std::{env, fs};

fn main() {
    // PKM_COEFFICIENTS names a `coefficients.rs` of one's own; relative to this folder
    let table = env::var("PKM_COEFFICIENTS").unwrap_or("../pkm-core/src/tables/reference.rs".into());
    let path = fs::canonicalize(&table).unwrap_or_else(|e| panic!("{table}: {e}"));
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{table}: {e}"));
    // a wrist that is singular at home is left out
    assert!(
        text.contains("WRIST_F64"),
        "{table} has no wrist: the machine file's is singular at home, or the file is old"
    );
    println!("cargo:rustc-env=PKM_COEFFICIENTS={}", path.display());
    println!("cargo:rerun-if-changed={}", path.display());
    println!("cargo:rerun-if-env-changed=PKM_COEFFICIENTS");
}
