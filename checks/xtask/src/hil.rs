//! The cyclic firmware on the boards that QEMU has, driven by `pkm-host hil`: poses asked for one by one, and on the processor
//! with f64 in hardware many more (`--swept`) in sweeps.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use pkm_host::cli;

use crate::proofs::firmware;
use crate::{Outcome, output};

/// Machine of QEMU, processor, `target-cpu`, feature of `pkm-fw`.
const BOARDS: [(&str, &str, Option<&str>, Option<&str>); 3] = [
    ("mps2-an386", "Cortex-M4F", None, None),
    ("mps2-an500", "Cortex-M7 with f64 in hardware", Some("cortex-m7"), None),
    ("netduinoplus2", "STM32F405", None, Some("stm32f405")),
];
/// Enough to see that the port works.
const POSES_OVER_PORT: u64 = 100;

pub fn run(options: &[String]) -> Outcome {
    let (mut poses, mut swept, mut seed) = (2000, 40_000, 1);
    for pair in options.chunks(2) {
        let value = pair.get(1).and_then(|v| v.parse().ok()).ok_or("expected --poses N, --swept N or --seed N")?;
        match pair[0].as_str() {
            "--poses" => poses = value,
            "--swept" => swept = value,
            "--seed" => seed = value,
            other => return Err(format!("unknown option {other}")),
        }
    }
    let drive = |target: &[&str], poses: u64, steps: u32| {
        let numbers = [("--seed", seed), ("--poses", poses), ("--steps", steps.into())];
        let numbers = numbers.map(|(option, n)| format!("{option}={n}"));
        let args = ["hil"].iter().chain(target).map(|a| (*a).to_owned()).chain(numbers);
        let output = cli::run(args).map_err(|e| e.to_string())?;
        print!("{}", output.text);
        Ok::<(), String>(())
    };
    for (board, processor, cpu, feature) in BOARDS {
        println!("== {processor}");
        let (mut build, elf) = firmware("cyclic", cpu);
        output(build.args(feature.iter().flat_map(|f| ["--features", f])))?;
        let file = elf.display().to_string();
        let in_qemu = ["--qemu", "--board", board, "--elf", &file];
        drive(&in_qemu, poses, 1)?;
        if cpu.is_some() {
            drive(&in_qemu, swept, 1000)?;
        }
        if (cpu, feature) == (None, None) {
            let board = OverPort::start(board, &elf)?;
            drive(&["--port", &board.port], POSES_OVER_PORT, 1)?;
        }
    }
    Ok(())
}

/// A board of QEMU behind a pseudo terminal, which is as good as a serial port.
struct OverPort {
    child: Child,
    port: String,
}

impl Drop for OverPort {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl OverPort {
    fn start(board: &str, elf: &Path) -> Result<Self, String> {
        let mut child = Command::new("qemu-system-arm")
            .args(["-M", board, "-nographic", "-monitor", "none", "-serial", "pty"])
            .args(["-icount", "shift=4,sleep=off", "-kernel"])
            .arg(elf)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| format!("qemu-system-arm: {e}"))?;
        let mut line = String::new();
        if let Some(stdout) = child.stdout.take() {
            BufReader::new(stdout).read_line(&mut line).map_err(|e| e.to_string())?;
        }
        let port = line.split_whitespace().find(|w| w.starts_with("/dev/")).unwrap_or_default().to_owned();
        let over = Self { child, port };
        if over.port.is_empty() { Err(format!("QEMU names no terminal: {line}")) } else { Ok(over) }
    }
}
