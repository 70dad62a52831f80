//! Instructions of the core on a Cortex-M, counted in QEMU and compared with limits.
//!
//! Instructions, not clock cycles: QEMU knows no pipeline, cache or flash.

use std::collections::BTreeMap;

use crate::Outcome;
use crate::proofs::{budget, image};
use crate::qemu::boot;

/// Machine of QEMU, processor, `target-cpu`, width of its hardware's floating point.
const RUNS: [(&str, &str, Option<&str>, &str); 2] = [
    ("mps2-an386", "Cortex-M4F", None, "f32"),
    ("mps2-an500", "Cortex-M7 with f64 in hardware", Some("cortex-m7"), "f64"),
];

/// What has a limit: its name in the firmware and in `checks/budgets.toml`, and what it is.
const LIMITED: [(&str, &str); 11] = [
    ("cycle", "a cycle"),
    ("tool", "the next point of a path for five axes"),
    ("rates", "velocities and accelerations of five joints"),
    ("compensate", "an update of the compensator, three screws"),
    ("compensate_tool", "an update of the compensator, five axes"),
    ("compensated_tool", "the compensated command for a tool, at worst"),
    ("absorb", "a reading of three components for six amplitudes"),
    ("u95", "what six amplitudes add to a tip's deflection, and its uncertainty"),
    ("table_u95", "the uncertainty of a cycle's deflection by its table"),
    ("known", "the same in an update of the compensator"),
    ("watch", "a look at eight numbers of the table in service"),
];

pub fn run() -> Outcome {
    let mut within = true;
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
