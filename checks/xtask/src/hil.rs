//! The cyclic firmware on the boards that QEMU has, driven by `pkm-host hil`: poses asked for one by one, and on the processor
//! with f64 in hardware many more (`--swept`) in sweeps. Then what it does with faults of the line and of the host.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use pkm_core::compensator::Weight;
use pkm_core::nalgebra::Vector3;
use pkm_core::tables::reference::{PARAMETERS, TABLE_F64};
use pkm_core::{Basis, CorrectionTable, Pose};
use pkm_host::cli;
use pkm_protocol::{ABORT, Carried, Command as Asked, Counters, crc32};

use crate::carried::{CARRIED, transfer};
use crate::learning::counters_of;
use crate::line::{HELLO, Line};
use crate::proofs::firmware;
use crate::{Outcome, output, root};

/// Machine of QEMU, processor, `target-cpu`, feature of `pkm-fw`.
const BOARDS: [(&str, &str, Option<&str>, Option<&str>); 3] = [
    ("mps2-an386", "Cortex-M4F", None, None),
    ("mps2-an500", "Cortex-M7 with f64 in hardware", Some("cortex-m7"), None),
    ("netduinoplus2", "STM32F405", None, Some("stm32f405")),
];
/// Of the same machine, with 33 terms.
pub const OTHER_TABLE: &str = "fixtures/jobs/wide-table.json";
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
        faults(board, &elf)?;
        let other = root().join(OTHER_TABLE).display().to_string();
        drive(&[&in_qemu[..], &["--send-table", "--table", &other]].concat(), POSES_OVER_PORT, 1)?;
        if (cpu, feature) == (None, None) {
            let board = OverPort::start(board, &elf)?;
            drive(&["--port", &board.port], POSES_OVER_PORT, 1)?;
        }
    }
    Ok(())
}

const CYCLE: &str = r#""arithmetic":"f32","theta_rad":0.1,"sigma_rad":-0.05,"z0_m":0.53,"force_n":[0,0,-400],"moment_nm":[0,0,5],"tip_m":[0,0,0.3]}"#;

/// What the firmware does with a damaged line, when the host gives up, and when it is gone.
fn faults(board: &str, elf: &Path) -> Outcome {
    let mut line = Line::start(board, elf, &[])?;
    let status = r#"{"v":2,"id":1,"cmd":"status"}"#;
    line.greet()?;
    line.asks(
        "a damaged line",
        status.replace("status", "statue"),
        crc32(status.as_bytes()),
        r#"{"error":"checksum"}"#,
    )?;
    let sweep = format!(r#"{{"v":2,"id":2,"cmd":"sweep","to":[0.2,0.1,0.55],"steps":10000,{CYCLE}"#);
    line.send(&sweep, crc32(sweep.as_bytes()))?;
    std::thread::sleep(Duration::from_millis(200));
    line.write(&[ABORT])?;
    line.hears("a sweep that is given up", r#"{"error":"aborted"}"#)?;
    let cycle = format!(r#"{{"v":2,"id":3,"cmd":"cycle",{CYCLE}"#);
    line.asks("a cycle", cycle.clone(), crc32(cycle.as_bytes()), r#""status":"ok""#)?;
    bad_tables(&mut line)?;
    bad_weights(&mut line)?;
    let dropped = |line: &mut Line, demands: u32| {
        // QEMU's second is shorter than ours
        for _ in 0..10_000 {
            let status = counters(line)?;
            if status.dropped_demands == demands {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Err(format!("the task goes on with a demand that nothing follows: not {demands} dropped"))
    };
    let before = dropped(&mut line, 2)?;
    // in software f64 takes many periods a cycle: the second is one of periods and not of cycles
    let cycle = cycle.replace(r#""f32""#, r#""f64""#);
    line.asks("a cycle in f64", cycle.clone(), crc32(cycle.as_bytes()), r#""status":"ok""#)?;
    let after = dropped(&mut line, 3)?;
    let periods = after.cycles + after.overruns - before.cycles - before.overruns;
    if !(900..=1100).contains(&periods) {
        return Err(format!("a demand of a second was dropped after {periods} periods"));
    }
    println!("a damaged line, an aborted sweep, damaged tables, bad weights, a host that is gone: as they should");
    Ok(())
}

/// What a firmware has counted since its start that has not stopped before.
fn counters(line: &mut Line) -> Result<Counters, String> {
    let counters = counters_of(&line.request(Asked::Status)?)?;
    match counters.last_fault {
        None => Ok(counters),
        Some(fault) => Err(format!("expected no fault: {fault:?}")),
    }
}

/// Tables that must not be put into service, while the task runs on.
fn bad_tables(line: &mut Line) -> Outcome {
    let table_with = |machine: u64, terms: u8, factor_form: bool| {
        let sum = TABLE_F64.checksum();
        format!(
            r#"{{"v":2,"id":4,"cmd":"table","machine":"{machine:016x}","table":"{sum:016x}","terms":{terms},"factor_form":{factor_form}}}"#
        )
    };
    let table = |machine, terms| table_with(machine, terms, true);
    let numbers = |numbers: &[f64], first: usize| {
        format!(r#"{{"v":2,"id":5,"cmd":"numbers","first":{first},"numbers":{numbers:?}}}"#)
    };
    let swap = || r#"{"v":2,"id":6,"cmd":"swap"}"#.to_owned();
    let mut asks = |what: &str, json: String, expected: &str| {
        let crc = crc32(json.as_bytes());
        line.asks(what, json, crc, expected)
    };
    let machine = PARAMETERS.checksum();
    asks("a swap without a table", swap(), r#"{"error":"order"}"#)?;
    asks("the table of another machine", table(machine + 1, 9), r#"{"error":"other_machine"}"#)?;
    asks("a table of too many terms", table(machine, 64), r#"{"error":"table"}"#)?;
    asks("a table without the factor form", table_with(machine, 9, false), r#"{"error":"table"}"#)?;
    let all: Vec<f64> = TABLE_F64.numbers().collect();
    // one number is its neighbour, one piece is missing
    for (changed, missing, expected) in [(Some(100), None, "table"), (None, Some(48), "order"), (None, None, "swapped")]
    {
        asks("a table", table(machine, 9), r#"{"received":{"numbers":0,"of":276}}"#)?;
        for first in (0..all.len()).step_by(24).filter(|first| Some(*first) != missing) {
            let mut piece = all[first..all.len().min(first + 24)].to_vec();
            if let Some(number) = changed.and_then(|at: usize| piece.get_mut(at.checked_sub(first)?)) {
                *number = number.next_up();
            }
            let late = missing.is_some_and(|missing| first > missing);
            asks("numbers", numbers(&piece, first), if late { r#"{"error":"order"}"# } else { "received" })?;
        }
        asks("a swap", swap(), expected)?;
    }
    Ok(())
}

/// Weights that are refused, and a table that has no reference of the one that was taken: what was before stays.
fn bad_weights(line: &mut Line) -> Outcome {
    let sum = format!(r#"{{"carried":"{:016x}"}}"#, TABLE_F64.checksum());
    let [heavy, far, away] = [CARRIED; 3];
    let heavy = Carried { weight: Weight { force_n: Vector3::repeat(1e5), ..heavy.weight }, ..heavy };
    let far = Carried { weight: Weight { centre_m: Vector3::repeat(10.0), ..far.weight }, ..far };
    let away = Carried { zeroed_at: Pose { theta_rad: 1.0, ..away.zeroed_at }, ..away };
    for (carried, expected) in [
        (heavy, r#"{"error":"too_heavy"}"#),
        (far, r#"{"error":"too_far"}"#),
        (away, r#"{"error":"no_reference"}"#),
        (CARRIED, &sum),
    ] {
        let reply = line.request(Asked::Weight(carried))?;
        if !reply.contains(expected) {
            return Err(format!("a weight: {reply}expected {expected}"));
        }
    }
    // the same table, with a box that does not have the zero
    let mut numbers = TABLE_F64.numbers();
    let mut take = |count: usize| numbers.by_ref().take(count).collect::<Vec<_>>();
    let (limits, terms) = (take(6), usize::from(TABLE_F64.header(0).terms));
    let exponents: Vec<[u8; 3]> =
        take(3 * terms).chunks_exact(3).map(|of| [of[0], of[1], of[2]].map(|exponent| exponent as u8)).collect();
    let (diagonal, factor) = (take(6 * terms), take(21 * terms));
    let basis =
        Basis::<f64>::new([limits[0] + 0.3, limits[1], limits[2]], [limits[3], limits[4], limits[5]], &exponents);
    let moved = CorrectionTable::<f64>::new(basis.map_err(|e| e.to_string())?, &diagonal, Some(&factor));
    transfer(line, &moved.map_err(|e| e.to_string())?)?;
    let reply = line.request(Asked::Swap)?;
    if !reply.contains(r#"{"error":"no_reference"}"#) {
        return Err(format!("a table without a reference of the weight: {reply}"));
    }
    line.ask("the table in service", HELLO, &format!(r#""table":"{:016x}""#, TABLE_F64.checksum())).map(drop)
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
