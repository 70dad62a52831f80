//! Instructions of the core on a Cortex-M, counted in QEMU and held against limits.
//!
//! Instructions, not clock cycles: QEMU knows no pipeline, cache or flash.

use crate::Outcome;
use crate::proofs::{budget, image};
use crate::qemu::boot;

/// Machine of QEMU, processor, `target-cpu`, width of its hardware's floating point.
const RUNS: [(&str, &str, Option<&str>, &str); 2] = [
    ("mps2-an386", "Cortex-M4F", None, "f32"),
    ("mps2-an500", "Cortex-M7 with f64 in hardware", Some("cortex-m7"), "f64"),
];

pub fn run() -> Outcome {
    for (board, processor, cpu, width) in RUNS {
        let elf = image("cycle", cpu)?;
        // one instruction takes 2^7 ns of the board's time
        let text = boot(board, &elf, &["-icount", "shift=7,sleep=off"])?;
        let mut cycle = None;
        for line in text.lines() {
            let (name, count) = line.split_once(' ').ok_or_else(|| format!("not a line of the firmware: {line}"))?;
            let count: u64 = count.parse().map_err(|e| format!("{line}: {e}"))?;
            if let Some(function) = name.strip_suffix(width) {
                println!("{processor} ({board}): {function}{width} at most {count} instructions");
                cycle = (function == "cycle_").then_some(count);
            }
        }
        let cycle = cycle.ok_or_else(|| format!("{board}: the firmware stopped early"))?;
        if !budget(&format!("cycle_{width}_instructions"), cycle, &format!("{processor}, a cycle in {width}"))? {
            return Err("a cycle takes more instructions than its limit".into());
        }
    }
    Ok(())
}
