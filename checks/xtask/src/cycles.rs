//! Instructions of the core on a Cortex-M, counted in QEMU, and of the compensator on this computer, counted by callgrind, compared
//! with limits.
//!
//! Instructions, not clock cycles: QEMU knows no pipeline, cache or flash.

use std::collections::BTreeMap;
use std::process::Command;

use serde_json::Value;

use crate::proofs::{budget, image};
use crate::qemu::boot;
use crate::{Outcome, output, root};

/// Machine of QEMU, processor, `target-cpu`, width of its hardware's floating point.
const RUNS: [(&str, &str, Option<&str>, &str); 2] = [
    ("mps2-an386", "Cortex-M4F", None, "f32"),
    ("mps2-an500", "Cortex-M7 with f64 in hardware", Some("cortex-m7"), "f64"),
];

/// What has a limit: its name in the firmware and in `checks/budgets.toml`, and what it is.
const LIMITED: [(&str, &str); 13] = [
    ("cycle", "a cycle"),
    ("tool", "the next point of a path for five axes"),
    ("rates", "velocities and accelerations of five joints"),
    ("compensate", "an update of the compensator, three screws"),
    ("compensate_tool", "an update of the compensator, five axes"),
    ("compensate_weight", "the same with a weight, three screws"),
    ("compensate_tool_weight", "the same with weights, five axes"),
    ("compensated_tool", "the compensated command for a tool, at worst"),
    ("absorb", "a reading of three components for six amplitudes"),
    ("u95", "what six amplitudes add to a tip's deflection, and its uncertainty"),
    ("table_u95", "the uncertainty of a cycle's deflection by its table"),
    ("known", "the same in an update of the compensator"),
    ("watch", "a look at eight numbers of the table in service"),
];

/// Updates on this computer: of the bench, and its limit's name in `checks/budgets.toml` without and with a weight.
const UPDATES: [(&str, [&str; 2], &str); 2] = [
    ("counted_screws", ["compensate", "compensate_weight"], "three screws"),
    ("counted_axes", ["compensate_tool", "compensate_tool_weight"], "five axes"),
];

/// Updates of the compensator that are counted on x86-64 in a row, each 26 kB of callgrind's output.
const IN_A_ROW: u64 = 1000;

/// `--updates N`: of the compensator on x86-64, for each width.
pub fn run(options: &[String]) -> Outcome {
    let updates = match options {
        [] => IN_A_ROW,
        [name, number] if name == "--updates" => number.parse().map_err(|e| format!("{number}: {e}"))?,
        _ => return Err("cargo xtask cycles [--updates N]".into()),
    };
    let mut within = updates_here(updates)?;
    for (board, processor, cpu, width) in RUNS {
        let elf = image("cycle", cpu)?;
        // one instruction takes 2^7 ns of the board's time
        let text = boot(board, &elf, &["-icount", "shift=7,sleep=off"])?;
        let mut counts = BTreeMap::new();
        for line in text.lines() {
            let (name, count) = line.split_once(' ').ok_or_else(|| format!("not a line of the firmware: {line}"))?;
            let count: u64 = count.parse().map_err(|e| format!("{line}: {e}"))?;
            if let Some(function) = name.strip_suffix(width) {
                println!("{processor} ({board}): {function}{width} at most {count} instructions");
                counts.insert(function.trim_end_matches('_'), count);
            }
        }
        for (name, what) in LIMITED {
            let count = counts.get(name).ok_or_else(|| format!("{board}: the firmware stopped early"))?;
            let key = format!("{name}_{width}_instructions");
            within &= budget(&key, *count, &format!("{processor}, {what} in {width}"))?;
        }
    }
    if within { Ok(()) } else { Err("a function takes more instructions than its limit".into()) }
}

/// The costliest update of the compensator on x86-64 of each kind within its limit, built as the benches are.
fn updates_here(updates: u64) -> Result<bool, String> {
    let build =
        ["bench", "--quiet", "--locked", "--no-run", "-p", "pkm-bench", "--bench", "worst", "--message-format=json"];
    let built = output(Command::new(env!("CARGO")).args(build).current_dir(root()))?;
    let program = built.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let program = program.filter_map(|message| message["executable"].as_str().map(str::to_owned)).next_back();
    let program = program.ok_or("cargo named no executable of the bench worst")?;
    let mut within = true;
    for (width, carried) in [("f64", ""), ("f64", "weight"), ("f32", ""), ("f32", "weight")] {
        let mut worst = [0; UPDATES.len()];
        for seed in 1..=updates.div_ceil(IN_A_ROW) {
            let found = counted(&program, &[width, &seed.to_string(), &IN_A_ROW.to_string(), carried])?;
            worst = std::array::from_fn(|i| found[i].max(worst[i]));
        }
        for ((_, names, what), count) in UPDATES.into_iter().zip(worst) {
            let key = format!("{}_x86_64_{width}_instructions", names[usize::from(!carried.is_empty())]);
            let with = if carried.is_empty() { "" } else { " with a weight" };
            within &= budget(&key, count, &format!("x86-64, an update of the compensator, {what}{with} in {width}"))?;
        }
    }
    Ok(within)
}

/// The greatest count of each kind in a row of updates.
fn counted(program: &str, arguments: &[&str]) -> Result<[u64; UPDATES.len()], String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let file = folder.path().join("counts");
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--quiet", "--tool=callgrind", "--demangle=no", "--combine-dumps=yes"]);
    valgrind.args(["--zero-before=*count_from_here*", "--dump-after=*counted_*"]);
    valgrind.arg(format!("--callgrind-out-file={}", file.display()));
    output(valgrind.arg(program).args(arguments))?;
    let text = std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    let (mut worst, mut parts, mut function) = ([0; UPDATES.len()], 0, None);
    for line in text.lines() {
        if let Some(trigger) = line.strip_prefix("desc: Trigger: ") {
            function = UPDATES.iter().position(|(name, ..)| trigger.contains(name));
        } else if let (Some(total), Some(function)) = (line.strip_prefix("totals: "), function) {
            let total: u64 = total.trim().parse().map_err(|e| format!("{line}: {e}"))?;
            worst[function] = total.max(worst[function]);
            parts += 1;
        }
    }
    let expected = UPDATES.len() as u64 * IN_A_ROW;
    if parts == expected { Ok(worst) } else { Err(format!("callgrind counted {parts} updates of {expected}")) }
}
