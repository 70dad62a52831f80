//! Plants small mistakes in the core and in the statistics of the diagnosis, one at a time, and counts those that a test finds.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use crate::{Outcome, root};

/// Least share of the viable ones that must be caught, %.
const MIN_CAUGHT_PERCENT: usize = 90;

/// What is changed and the tests that run against it.
const PARTS: [(&str, &[&str]); 2] = [
    ("core", &["-p", "pkm-core", "-C=--package=pkm-tests", "-C=--test=core"]),
    ("statistics", &["-p", "pkm-diagnosis", "-f", "{noise,whitening,fit,solve,screening,validation}.rs"]),
];

/// By what became of them: caught, not in time, missed, not Rust.
const ENDS: [&str; 4] = ["caught", "timeout", "missed", "unviable"];

/// Both parts with a few hundredths of the random cases; options go to cargo-mutants, such as `--shard 0/8` for a sample.
pub fn run(options: &[String]) -> Outcome {
    let jobs = std::thread::available_parallelism().map_or(1, usize::from);
    let (mut low, mut survivors) = (Vec::new(), String::new());
    println!("{:<34}{:>8}{:>8}{:>8}{:>10}{:>8}", "file", ENDS[0], ENDS[1], ENDS[2], ENDS[3], "%");
    for (name, arguments) in PARTS {
        let out = root().join("out/mutants").join(name);
        std::fs::create_dir_all(&out).map_err(|e| format!("{}: {e}", out.display()))?;
        let mut command = Command::new(env!("CARGO"));
        command.arg("mutants").args(arguments).args(options).arg(format!("-j={jobs}")).arg("-o").arg(&out);
        let status = command.env("PKM_SHARE", "0.005").current_dir(root()).status();
        let status = status.map_err(|e| format!("cargo: {e}"))?;
        // 2 and 3: some were missed, or not in time
        if !matches!(status.code(), Some(0 | 2 | 3)) {
            return Err(format!("cargo mutants: {status}\ncargo install cargo-mutants --version 27.1.0 --locked"));
        }
        let mut files: BTreeMap<String, [usize; 4]> = BTreeMap::new();
        for (i, end) in ENDS.iter().enumerate() {
            for mutant in read(&out.join(format!("mutants.out/{end}.txt")))?.lines() {
                let file = mutant.split(':').next().unwrap_or_default().to_owned();
                files.entry(file).or_default()[i] += 1;
                files.entry(name.to_owned()).or_default()[i] += 1;
                if ENDS[i] == "missed" {
                    survivors += &format!("{mutant}\n");
                }
            }
        }
        for (file, ends) in &files {
            let [caught, late, missed, unviable] = *ends;
            // one that never ends is found as well
            let percent = 100 * (caught + late) / (caught + late + missed).max(1);
            println!("{file:<34}{caught:>8}{late:>8}{missed:>8}{unviable:>10}{percent:>8}");
            if file == name && percent < MIN_CAUGHT_PERCENT {
                low.push(format!("{name}: {percent} % caught, expected {MIN_CAUGHT_PERCENT} %"));
            }
        }
    }
    println!("\n{survivors}");
    if low.is_empty() { Ok(()) } else { Err(low.join("\n")) }
}

fn read(file: &Path) -> Result<String, String> {
    std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))
}
