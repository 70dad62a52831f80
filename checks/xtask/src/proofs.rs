//! What is claimed of the core's code, shown on images: no panic, no allocator, no memory, so much flash, these targets.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::Command;

use serde_json::Value;

use crate::image::{sections, symbols};
use crate::{Outcome, output, root};

const FIRMWARE_TARGET: &str = "thumbv7em-none-eabihf";

/// Targets that core and C library are built for.
const TARGETS: [&str; 3] = [FIRMWARE_TARGET, "thumbv8m.main-none-eabihf", "riscv32imafc-unknown-none-elf"];

/// A command that builds a firmware for a `target-cpu` (any Cortex-M4F when none), and where the image will be.
pub fn firmware(name: &str, cpu: Option<&str>) -> (Command, PathBuf) {
    let folder = root().join("embed/firmware");
    let target_dir = folder.join("target").join(cpu.unwrap_or("plain"));
    let mut command = Command::new("cargo");
    command.current_dir(folder).args(["build", "--release", "--locked", "--quiet", "--bin", name]);
    command.arg("--target-dir").arg(&target_dir).env_remove("PKM_COEFFICIENTS");
    // no debugger looks for sources here, and an image is built in two thirds of the time
    command.env("CARGO_PROFILE_RELEASE_DEBUG", "false");
    if let Some(cpu) = cpu {
        command.env("RUSTFLAGS", format!("-C link-arg=-Tlink.x -C link-arg=--nmagic -C target-cpu={cpu}"));
    }
    (command, target_dir.join(FIRMWARE_TARGET).join("release").join(name))
}

/// Builds a firmware.
pub fn image(name: &str, cpu: Option<&str>) -> Result<PathBuf, String> {
    let (mut build, path) = firmware(name, cpu);
    output(&mut build)?;
    Ok(path)
}

/// Prints a figure and its limit in `checks/budgets.toml`, whose name ends with the unit; true when it is kept.
pub fn budget(key: &str, figure: u64, what: &str) -> Result<bool, String> {
    let text =
        std::fs::read_to_string(root().join("checks/budgets.toml")).map_err(|e| format!("checks/budgets.toml: {e}"))?;
    let budgets: toml::Table = text.parse().map_err(|e| format!("checks/budgets.toml: {e}"))?;
    let limit = budgets.get(key).and_then(toml::Value::as_integer).and_then(|v| u64::try_from(v).ok());
    let limit = limit.ok_or_else(|| format!("checks/budgets.toml has no {key}"))?;
    let kept = figure <= limit;
    let unit = key.rsplit('_').next().unwrap_or_default();
    println!("{what}: {figure} of {limit} {unit}{}", if kept { "" } else { ": TOO MUCH" });
    Ok(kept)
}

pub fn no_panic() -> Outcome {
    every_function_is_called()?;
    image("no_panic", None).map_err(|e| format!("the core has a reachable panic:\n{e}"))?;
    let (mut planted, _) = firmware("planted_panic", None);
    match output(planted.args(["--features", "planted-panic"])) {
        Err(message) if message.contains("a_panic_is_reachable") => {}
        other => return Err(format!("a planted panic was not caught:\n{other:?}")),
    }
    println!("no panic is reachable from the core's public functions, f64 and f32; a planted one is caught");
    Ok(())
}

/// That `no_panic.rs` forgets no public function, by the names that rustdoc knows.
fn every_function_is_called() -> Outcome {
    let mut document = Command::new("cargo");
    document.current_dir(root()).args(["rustdoc", "--release", "--quiet", "--locked", "-p", "pkm-core"]);
    output(document.args(["--", "-Zunstable-options", "--output-format", "json"]).env("RUSTC_BOOTSTRAP", "1"))?;
    let read = |path: &str| std::fs::read_to_string(root().join(path)).map_err(|e| format!("{path}: {e}"));
    let document: Value = serde_json::from_str(&read("target/doc/pkm_core.json")?).map_err(|e| e.to_string())?;
    let index = document["index"].as_object().ok_or("rustdoc's JSON has no index")?;
    let name_of = |item: &Value| item["name"].as_str().unwrap_or_default().to_owned();
    // by name, the types (none for a free function) that have a function of that name
    let mut functions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut methods = BTreeSet::new();
    for item in index.values() {
        let inner = &item["inner"]["impl"];
        let Some(items) = inner["items"].as_array() else { continue };
        let of = inner["for"]["resolved_path"]["path"].as_str().unwrap_or_default();
        for id in items {
            methods.insert(id.to_string());
            let method = &index.get(&id.to_string()).unwrap_or(&Value::Null);
            if inner["trait"].is_null() && method["inner"]["function"].is_object() && method["visibility"] == "public" {
                functions.entry(name_of(method)).or_default().insert(of.to_owned());
            }
        }
    }
    for (id, item) in index {
        if item["inner"]["function"].is_object() && item["visibility"] == "public" && !methods.contains(id) {
            functions.entry(name_of(item)).or_default();
        }
    }
    let image = read("embed/firmware/src/bin/no_panic.rs")?;
    for (name, types) in &functions {
        let calls = |before: &str| image.matches(&format!("{before}{name}(")).count();
        if calls(".") + calls("::") + calls(" ") + calls("(") < types.len().max(1) {
            let types: Vec<&str> = types.iter().map(String::as_str).collect();
            return Err(format!("no_panic.rs does not call {name} of {}", types.join(", ")));
        }
    }
    println!("no_panic.rs calls every public function, of {} names", functions.len());
    if functions.len() < 30 { Err("rustdoc's JSON was not understood".into()) } else { Ok(()) }
}

pub fn no_alloc() -> Outcome {
    let m7 = Some("cortex-m7");
    for (name, cpu) in
        [("no_panic", None), ("parity", None), ("cycle", None), ("stack", None), ("size", m7), ("size_learning", m7)]
    {
        let symbols = symbols(&image(name, cpu)?)?;
        for symbol in &symbols {
            if symbol.name.contains("alloc") {
                return Err(format!("{name} has an allocator: {}", symbol.name));
            }
            if "bBdD".contains(symbol.kind) && symbol.name.contains("pkm_core") {
                return Err(format!("{name} has memory of the core: {}", symbol.name));
            }
        }
        println!("{name}: no allocator, no memory of the core, among {} symbols", symbols.len());
    }
    Ok(())
}

pub fn size() -> Outcome {
    let mut within = true;
    for (name, key, what) in [
        ("size", "flash_bytes", "flash of kinematics and K_m, f64, Cortex-M7"),
        ("size_learning", "flash_learning_bytes", "flash with compensator, U95 and estimator, f64, Cortex-M7"),
    ] {
        let sections = sections(&image(name, Some("cortex-m7"))?)?;
        let sum = |names: &[&str]| -> u64 { names.iter().filter_map(|name| sections.get(*name)).sum() };
        let ram = sum(&[".data", ".bss", ".uninit"]);
        println!("RAM beside the stack: {ram} bytes");
        // .data lies in flash, too, to be copied from there
        let flash = sum(&[".vector_table", ".text", ".rodata", ".data"]);
        within &= budget(key, flash, what)? && ram == 0;
    }
    if within { Ok(()) } else { Err("an image takes more memory than its limit".into()) }
}

pub fn targets() -> Outcome {
    for target in TARGETS {
        for (folder, features) in [("", ""), ("", "defmt"), ("embed/c", "")] {
            let mut build = Command::new("cargo");
            build.current_dir(root().join(folder)).args(["build", "--release", "--locked", "--quiet"]);
            let package = if folder.is_empty() { "pkm-core" } else { "pkm-ffi" };
            output(build.args(["-p", package, "--target", target, "--features", features]))?;
        }
        println!("{target}: core, core with defmt, C library");
    }
    Ok(())
}
