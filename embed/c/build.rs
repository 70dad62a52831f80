//! Tells the library where the machine's table is.

use std::{env, fs};

const REFERENCE: &str = "../../pkm-core/src/tables/reference.rs";

fn main() {
    println!("cargo::rerun-if-env-changed=PKM_COEFFICIENTS");
    println!("cargo::rustc-check-cfg=cfg(table_uncertainty)");
    let given = env::var("PKM_COEFFICIENTS");
    if given.is_err() {
        println!("cargo::warning=PKM_COEFFICIENTS is not set: this library has the reference machine, not yours");
    }
    match path(given.as_deref().unwrap_or(REFERENCE)) {
        Ok(path) => {
            println!("cargo::rustc-env=PKM_COEFFICIENTS={path}");
            if fs::read_to_string(&path).is_ok_and(|text| text.contains("UNCERTAINTY_F64")) {
                println!("cargo::rustc-cfg=table_uncertainty");
            }
            println!("cargo::rerun-if-changed={path}");
        }
        Err(message) => println!("cargo::error=PKM_COEFFICIENTS: {message}"),
    }
}

/// Of a `coefficients.rs` that can be compiled in, absolute.
fn path(table: &str) -> Result<String, String> {
    let relative = |e| format!("{table}: {e} (a relative path counts from the folder embed/c)");
    let path = fs::canonicalize(table).map_err(relative)?;
    let text = fs::read_to_string(&path).map_err(relative)?;
    if !text.contains("PARAMETERS") {
        return Err(format!("{table} is not the coefficients.rs that pkm-host fit writes"));
    }
    // a wrist that is singular at home is left out
    if !text.contains("WRIST_F64") {
        return Err(format!("{table} has no wrist: the machine file's is singular at home, or the file is old"));
    }
    path.to_str().map(str::to_owned).ok_or_else(|| format!("{table}: the path is not UTF-8"))
}
