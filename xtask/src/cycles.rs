//! Instructions of the core on a Cortex-M, counted in QEMU and held against limits.
//!
//! Instructions, not clock cycles: QEMU knows no pipeline, cache or flash.

use crate::{Outcome, qemu};

/// Machine of QEMU, processor, `target-cpu`, width of its hardware's floating point, most instructions of a controller's
/// cycle.
const RUNS: [(&str, &str, Option<&str>, &str, u32); 2] = [
    ("mps2-an386", "Cortex-M4F", None, "f32", 6000),
    ("mps2-an500", "Cortex-M7 with f64 in hardware", Some("cortex-m7"), "f64", 8000),
];

pub fn run() -> Outcome {
    for (board, processor, cpu, width, limit) in RUNS {
        let elf = qemu::build("cycle", None, cpu)?;
        // one instruction takes 2^7 ns of the board's time
        let text = qemu::boot(board, &elf, &["-icount", "shift=7,sleep=off"])?;
        let mut cycle = None;
        for line in text.lines() {
            let (name, count) = line.split_once(' ').ok_or_else(|| format!("not a line of the firmware: {line}"))?;
            let count: u32 = count.parse().map_err(|e| format!("{line}: {e}"))?;
            if let Some(function) = name.strip_suffix(width) {
                println!("{processor} ({board}): {function}{width} at most {count} instructions");
                cycle = (function == "cycle_").then_some(count);
            }
        }
        match cycle {
            Some(count) if count <= limit => {}
            Some(count) => return Err(format!("{processor}: {count} instructions a cycle, allowed are {limit}")),
            None => return Err(format!("{board}: the firmware stopped early")),
        }
    }
    Ok(())
}
