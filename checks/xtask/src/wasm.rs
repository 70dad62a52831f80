//! The core as WebAssembly: built from `embed/wasm`, and committed where `pkm-host` embeds it.

use std::path::PathBuf;
use std::process::Command;

use crate::{Outcome, output, root};

const TARGET: &str = "wasm32-unknown-unknown";
const COMMITTED: &str = "pkm-host/src/report/view/core.wasm";

/// Builds the module, and writes it to its place or, with `--check`, compares it with what is there.
pub fn run(options: &[String]) -> Outcome {
    let check = match options {
        [] => false,
        [option] if option == "--check" => true,
        _ => return Err("cargo xtask wasm [--check]".into()),
    };
    let built = std::fs::read(build()?).map_err(|e| e.to_string())?;
    let place = root().join(COMMITTED);
    if !check {
        std::fs::write(&place, &built).map_err(|e| format!("{COMMITTED}: {e}"))?;
        println!("wrote {COMMITTED}: {} bytes", built.len());
        return Ok(());
    }
    let committed = std::fs::read(&place).map_err(|e| format!("{COMMITTED}: {e}"))?;
    if built != committed {
        return Err(format!("{COMMITTED} is not what the sources build: run cargo xtask wasm"));
    }
    println!("{COMMITTED} is what the sources build: {} bytes", built.len());
    Ok(())
}

/// The same bytes wherever the repository and cargo's folders are: no path of them is left in the module.
fn build() -> Result<PathBuf, String> {
    let home = std::env::var("CARGO_HOME").or_else(|_| std::env::var("HOME").map(|home| format!("{home}/.cargo")));
    let home = home.map_err(|e| format!("HOME: {e}"))?;
    let sysroot = output(Command::new("rustc").args(["--print", "sysroot"]).current_dir(root()))?;
    let own = root().display().to_string();
    let prefixes = [(home.as_str(), "/cargo"), (sysroot.trim(), "/rust"), (own.as_str(), "/pkm")];
    let flags: Vec<String> = prefixes.iter().map(|(from, to)| format!("--remap-path-prefix={from}={to}")).collect();
    let mut build = Command::new("cargo");
    build.current_dir(root()).args(["build", "--locked", "--quiet", "-p", "pkm-wasm", "--profile", "wasm"]);
    build.args(["--target", TARGET, "--target-dir", "target"]);
    // spaces in a path would divide a flag of RUSTFLAGS
    output(build.env_remove("RUSTFLAGS").env("CARGO_ENCODED_RUSTFLAGS", flags.join("\u{1f}")))?;
    Ok(root().join("target").join(TARGET).join("wasm/pkm_wasm.wasm"))
}
