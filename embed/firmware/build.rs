//! Puts the board's memory and the machine's table where the build finds them.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-env-changed=PKM_COEFFICIENTS");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    // a `coefficients.rs` of one's own
    let given = env::var("PKM_COEFFICIENTS");
    if given.is_err() {
        println!("cargo::warning=PKM_COEFFICIENTS is not set: cyclic and parity have the reference machine, not yours");
    }
    let table = given.unwrap_or("../../pkm-core/src/tables/reference.rs".into());
    let has = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let memory = if has("STM32F405") { "src/board/stm32f405.x" } else { "../../memory.x" };
    for (from, to) in [(memory, "memory.x"), (table.as_str(), "coefficients.rs")] {
        if let Err(e) = fs::copy(from, out.join(to)) {
            let whose = if from == table { "PKM_COEFFICIENTS: " } else { "" };
            println!("cargo::error={whose}{from}: {e} (a relative path counts from the folder embed/firmware)");
        }
        println!("cargo::rerun-if-changed={from}");
    }
    println!("cargo::rustc-link-search={}", out.display());
    if has("LOG") {
        println!("cargo::rustc-link-arg-bin=cyclic=-Tdefmt.x");
    }
}
