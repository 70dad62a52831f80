//! The guards of the cyclic firmware, each made to act on a board of QEMU with what a debugger does to a running processor: the firmware
//! has nothing for it. And its flash with a bit flipped.

use std::path::{Path, PathBuf};
use std::time::Duration;

use pkm_core::Pose;
use pkm_core::tables::reference::TABLE_F64;
use pkm_protocol::{Answer, Arithmetic, Checksum, Command, Demand, Sweep, SweepReply};
use tempfile::TempDir;

use crate::debugger::{Debugger, PROGRAM_COUNTER, STATUS, options};
use crate::image::place;
use crate::line::{HELLO, Line};
use crate::proofs::image;
use crate::qemu::PROCESSORS;
use crate::{Outcome, carried, learning};

/// What is done to a board, and what it must say of that after it has started again.
struct Guard {
    what: &'static str,
    cause: Cause,
    last_fault: &'static str,
}

pub enum Cause {
    /// `main` goes on with these instructions.
    Instructions(&'static [u16]),
    /// `main` goes on in this function.
    Function(&'static str),
}

const GUARDS: [Guard; 5] = [
    Guard { what: "a panic", cause: Cause::Function("__rustc::rust_begin_unwind"), last_fault: "panic" },
    // udf
    Guard { what: "an undefined instruction", cause: Cause::Instructions(&[0xde00]), last_fault: "exception" },
    // push {r0-r7}, and again
    Guard { what: "a stack without end", cause: Cause::Instructions(&[0xb4ff, 0xe7fd]), last_fault: "stack" },
    // jumps to itself: the task runs on
    Guard { what: "a main that hangs", cause: Cause::Instructions(&[0xe7fe]), last_fault: "restart" },
    // cpsid i, and the same
    Guard { what: "interrupts that stay off", cause: STANDSTILL, last_fault: "restart" },
];

/// Interrupts off, and no other instruction any more.
pub const STANDSTILL: Cause = Cause::Instructions(&[0xb672, 0xe7fe]);

/// Longer than any start takes.
const PATIENCE: usize = 500;
const MOMENT: Duration = Duration::from_millis(20);

pub fn run() -> Outcome {
    for (board, processor, cpu) in PROCESSORS {
        println!("== {processor}");
        let elf = image("cyclic", cpu)?;
        guards(board, &elf, cpu.is_none())?;
        flash(board, &elf)?;
        in_service(board, &elf)?;
        zeros(board, &elf)?;
        learning::run(board, &elf)?;
        carried::run(board, &elf)?;
    }
    Ok(())
}

/// A board that runs, with its line and a debugger.
pub struct Board {
    pub line: Line,
    pub debugger: Debugger,
    elf: PathBuf,
    /// A word that the firmware clears at every start, and that else stays as it is.
    mark: u32,
    _folder: TempDir,
}

impl Board {
    pub fn start(board: &str, elf: &Path) -> Result<Self, String> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let (mut line, mut debugger) = start(&folder, board, elf, &[])?;
        debugger.go()?;
        // what comes before the serial line is on waits in QEMU
        line.ask("hello", HELLO, r#""hello""#)?;
        let (mark, _) = place(elf, "cyclic::LOST_REPLIES::")?;
        Ok(Self { line, debugger, elf: elf.to_owned(), mark, _folder: folder })
    }

    /// Does something to it, and waits until its watchdog has started it again.
    pub fn restart(&mut self, what: &str, cause: &Cause) -> Outcome {
        let Self { debugger, elf, mark, .. } = self;
        interrupt_main(debugger)?;
        debugger.put(*mark, &[0xff; 4])?;
        match cause {
            Cause::Function(name) => debugger.set_register(PROGRAM_COUNTER, place(elf, name)?.0)?,
            Cause::Instructions(all) => {
                let bytes: Vec<u8> = all.iter().flat_map(|half| half.to_le_bytes()).collect();
                let at = debugger.register(PROGRAM_COUNTER)?;
                debugger.put(at, &bytes)?;
            }
        }
        for _ in 0..PATIENCE {
            if debugger.word(*mark)? == 0 {
                return debugger.go();
            }
            debugger.run_for(MOMENT)?;
        }
        Err(format!("{what}: the watchdog does not start the board again"))
    }
}

fn guards(board: &str, elf: &Path, has_soft_f64: bool) -> Outcome {
    let mut board = Board::start(board, elf)?;
    for Guard { what, cause, last_fault } in &GUARDS {
        // a demand, which must not outlive the fault
        board.line.ask("a cycle", &cycle("f32"), r#""status":"ok""#)?;
        board.restart(what, cause)?;
        let status = board.line.ask(what, STATUS_COMMAND, &format!(r#""last_fault":"{last_fault}""#))?;
        if !status.contains(r#"{"cycles":0,"#) {
            return Err(format!("{what}: the task goes on with the demand after the start: {status}"));
        }
        println!("{what}: the board starts again without a demand and says {last_fault}");
    }
    periods(&mut board.line, &mut board.debugger, elf, has_soft_f64)
}

const STATUS_COMMAND: &str = r#"{"v":2,"id":2,"cmd":"status"}"#;

fn cycle(arithmetic: &str) -> String {
    format!(
        r#"{{"v":2,"id":1,"cmd":"cycle","arithmetic":"{arithmetic}","theta_rad":0.1,"sigma_rad":-0.05,"z0_m":0.53,"force_n":[0,0,-400],"moment_nm":[0,0,5],"tip_m":[0,0,0.3]}}"#
    )
}

/// Every period has a run, or counts as one that has none. A cycle in f64 by software takes longer than a period.
fn periods(line: &mut Line, debugger: &mut Debugger, elf: &Path, has_soft_f64: bool) -> Outcome {
    let place_of = |name: &str| Ok::<_, String>(place(elf, &format!("cyclic::{name}::"))?.0);
    let counters = [place_of("PERIODS")?, place_of("CYCLES")?, place_of("OVERRUNS")?];
    let working = place_of("WORKING")?;
    let read = |debugger: &mut Debugger| {
        let [periods, cycles, overruns] = counters.map(|place| debugger.word(place));
        Ok::<_, String>([periods?, cycles?, overruns?])
    };
    for _ in 0..PATIENCE {
        line.ask("a cycle", &cycle("f64"), r#""status":"ok""#)?;
        debugger.stop()?;
        let before = read(debugger)?;
        let mut after = before;
        while after[0].wrapping_sub(before[0]) < 20 {
            debugger.run_for(Duration::from_millis(1))?;
            after = read(debugger)?;
        }
        let has_demand = debugger.read(working, 1)? != [0];
        debugger.go()?;
        // the board's time runs ahead of this computer's, and after a second of it the demand is dropped
        if !has_demand {
            continue;
        }
        let [periods, cycles, overruns] = [0, 1, 2].map(|i| after[i].wrapping_sub(before[i]));
        // one run may be under way at either end
        if periods.abs_diff(cycles + overruns) > 1 {
            return Err(format!("{periods} periods, but {cycles} runs and {overruns} missed ones"));
        }
        if has_soft_f64 != (overruns > 0) {
            return Err(format!("{overruns} of {periods} periods are missed"));
        }
        println!("in f64: {periods} periods, {cycles} runs, {overruns} missed periods");
        return Ok(());
    }
    Err("the demand is always dropped".into())
}

/// Where a start leaves word of itself.
struct Start {
    left: u32,
    periods: u32,
}

impl Start {
    fn of(elf: &Path) -> Result<Self, String> {
        Ok(Self { left: place(elf, "cyclic::board::LEFT::")?.0, periods: place(elf, "cyclic::PERIODS::")?.0 })
    }

    /// Starts a stopped board, with a bit of its flash flipped: whether its self-test refuses to.
    fn is_refused(&self, debugger: &mut Debugger, flip: Option<(u32, u8)>) -> Result<bool, String> {
        debugger.reset()?;
        debugger.put(self.left, &[0; 8])?;
        debugger.put(self.periods, &[0; 4])?;
        if let Some((at, bit)) = flip {
            let byte = debugger.read(at, 1)?[0];
            debugger.put(at, &[byte ^ 1 << bit])?;
        }
        for _ in 0..PATIENCE {
            debugger.run_for(MOMENT)?;
            if debugger.word(self.left)? == SELF_TEST && debugger.word(self.left + 4)? == !SELF_TEST {
                return Ok(true);
            }
            if debugger.word(self.periods)? > 0 {
                return Ok(false);
            }
        }
        Err("neither started nor refused".to_owned())
    }
}

/// Flips of each piece of memory.
const FLIPS: usize = 3;

/// Flips bits of machine, wrist and table in flash, before the start: all have to be refused.
fn flash(board: &str, elf: &Path) -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let (_line, mut debugger) = start(&folder, board, elf, &["-S".to_owned()])?;
    let start = Start::of(elf)?;
    if start.is_refused(&mut debugger, None)? {
        return Err("a board with a whole flash refuses to start".into());
    }
    let mut flips = 0;
    for (what, at, length) in pieces(&mut debugger, elf)? {
        // what is zero may be a place that nothing uses: `zeros`
        let bytes = debugger.read(at, length)?;
        let used: Vec<u32> = (at..).zip(&bytes).filter(|(_, byte)| **byte != 0).map(|(at, _)| at).collect();
        for flip in 0..FLIPS {
            let (at, bit) = (used[(2 * flip + 1) * used.len() / (2 * FLIPS)], (flips * 3 % 8) as u8);
            if !start.is_refused(&mut debugger, Some((at, bit)))? {
                return Err(format!("{what}: a board whose bit {bit} at {at:#x} is flipped starts"));
            }
            flips += 1;
        }
    }
    println!("{flips} flips of a bit of machine, wrist and table in flash: each refused at the start as self_test");
    Ok(())
}

/// Flips bits of the table while the task compensates with it: the firmware has to notice, and to stop.
fn in_service(board: &str, elf: &Path) -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let (_line, mut debugger) = start(&folder, board, elf, &["-S".to_owned()])?;
    let start = Start::of(elf)?;
    let mut flips = 0;
    let pieces = pieces(&mut debugger, elf)?;
    for (what, at, length) in pieces.into_iter().filter(|(what, ..)| what.starts_with("TABLE")) {
        for flip in 0..FLIPS {
            if start.is_refused(&mut debugger, None)? {
                return Err("a board with a whole flash refuses to start".into());
            }
            let (at, bit) = (at + ((2 * flip + 1) * length / (2 * FLIPS)) as u32, flips % 8);
            let byte = debugger.read(at, 1)?[0];
            debugger.put(at, &[byte ^ 1 << bit])?;
            let mut looks = 0;
            while debugger.word(start.left)? != SELF_TEST {
                looks += 1;
                if looks > PATIENCE {
                    return Err(format!("{what}: bit {bit} at {at:#x} is flipped, and the board runs on"));
                }
                debugger.run_for(MOMENT)?;
            }
            flips += 1;
        }
    }
    println!("{flips} flips of a bit of the table in service: each stops the board as self_test");
    Ok(())
}

/// Flips of zeros of each machine.
const ZEROS: usize = 10;

/// Flips bits of zeros of the machines in flash, some of them places of elements that are not there: what is not refused must not be used.
fn zeros(board: &str, elf: &Path) -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let (mut line, mut debugger) = start(&folder, board, elf, &["-S".to_owned()])?;
    let start = Start::of(elf)?;
    if start.is_refused(&mut debugger, None)? {
        return Err("a board with a whole flash refuses to start".into());
    }
    let whole = computed(&mut line, &mut debugger)?;
    let (mut refused, mut unused) = (0, 0);
    for (what, at, length) in pieces(&mut debugger, elf)?.into_iter().filter(|(what, ..)| what.starts_with("MACHINE")) {
        let bytes = debugger.read(at, length)?;
        let zero: Vec<u32> = (at..).zip(&bytes).filter(|(_, byte)| **byte == 0).map(|(at, _)| at).collect();
        for flip in 0..ZEROS {
            let (at, bit) = (zero[(2 * flip + 1) * zero.len() / (2 * ZEROS)], (flip * 3 % 8) as u8);
            if start.is_refused(&mut debugger, Some((at, bit)))? {
                refused += 1;
            } else if computed(&mut line, &mut debugger)? == whole {
                unused += 1;
            } else {
                return Err(format!(
                    "{what}: a board whose bit {bit} at {at:#x} is flipped starts and computes other bits"
                ));
            }
        }
    }
    println!(
        "{} flips of zeros of the machines: {refused} refused, {unused} that change no bit of a sweep",
        refused + unused
    );
    Ok(())
}

/// What a running board computes across the box in both arithmetics, and stops it.
fn computed(line: &mut Line, debugger: &mut Debugger) -> Result<[u64; 2], String> {
    const TO: Pose<f64> = Pose { theta_rad: -0.2, sigma_rad: 0.15, z0_m: 0.51 };
    debugger.go()?;
    let mut results = [0; 2];
    for (results, arithmetic) in results.iter_mut().zip([Arithmetic::F32, Arithmetic::F64]) {
        let from = Demand { arithmetic, ..learning::DEMAND };
        let reply = line.request(Command::Sweep(Sweep { from, to: TO, steps: 10 }))?;
        *results = match learning::parsed(&reply)? {
            Answer::Sweep(SweepReply { ok: 10, results: Checksum(results), .. }) => results,
            _ => return Err(format!("not ten poses: {reply}")),
        };
    }
    debugger.stop()?;
    Ok(results)
}

/// `Fault::SelfTest` as a word that is left.
const SELF_TEST: u32 = pkm_protocol::Fault::SelfTest as u32;

/// Machine, wrist and numbers of the table in flash, in either arithmetic: name, address, length.
fn pieces(debugger: &mut Debugger, elf: &Path) -> Result<Vec<(String, u32, usize)>, String> {
    let mut pieces = Vec::new();
    for name in ["MACHINE_F32", "MACHINE_F64", "WRIST_F32", "WRIST_F64"] {
        let (at, length) = place(elf, &format!("cyclic::coefficients::{name}::"))?;
        pieces.push((name.to_owned(), at, length));
    }
    // six numbers of the box, the exponents, and then what the table points to
    let numbers: Vec<f64> = TABLE_F64.numbers().collect();
    let terms = usize::from(TABLE_F64.header(0).terms);
    let (diagonal, factor) = numbers[6 + 3 * terms..].split_at(6 * terms);
    for name in ["TABLE_F32", "TABLE_F64"] {
        let (at, length) = place(elf, &format!("cyclic::coefficients::{name}::"))?;
        let words: Vec<u32> = debugger.read(at, length)?.chunks_exact(4).map(word).collect();
        for (part, numbers) in [("diagonal", diagonal), ("factor", factor)] {
            let bytes: Vec<u8> = match name {
                "TABLE_F32" => numbers.iter().flat_map(|number| (*number as f32).to_le_bytes()).collect(),
                _ => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
            };
            let mut found = None;
            for at in &words {
                if found.is_none() && debugger.read(*at, bytes.len()).is_ok_and(|there| there == bytes) {
                    found = Some(*at);
                }
            }
            let at = found.ok_or_else(|| format!("{name} points to no numbers of {part}"))?;
            pieces.push((format!("{name}, {part}"), at, bytes.len()));
        }
    }
    Ok(pieces)
}

fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

fn start(folder: &TempDir, board: &str, elf: &Path, more: &[String]) -> Result<(Line, Debugger), String> {
    let socket = folder.path().join("debugger");
    let line = Line::start(board, elf, &[&options(&socket)[..], more].concat())?;
    Ok((line, Debugger::connect(&socket)?))
}

/// Stops a running board where no interrupt is at work.
fn interrupt_main(debugger: &mut Debugger) -> Outcome {
    let mut status = 0;
    for milliseconds in 0..PATIENCE as u64 {
        debugger.stop()?;
        status = debugger.register(STATUS)?;
        if status & 0x1ff == 0 {
            return Ok(());
        }
        debugger.go()?;
        std::thread::sleep(Duration::from_millis(milliseconds % 10));
    }
    Err(format!("interrupts are always at work: xPSR {status:#x}"))
}
