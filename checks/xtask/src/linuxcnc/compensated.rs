//! The configuration's program with its loads as comments, compensated by the program and run as any other: by whoever has no compensation in
//! the control.

use std::ffi::OsStr;
use std::path::Path;

use pkm_host::cli;
use serde_json::Value;

use super::replay::Row;
use crate::Outcome;

/// What is run.
pub const PROGRAM: &str = "compensated.ngc";
/// How far LinuxCNC may pass a point by (`G64 P0.001`), and the recorded periods beside it, mm.
const WITHIN_MM: f64 = 2e-3;

/// Writes it, and says where it cuts: X Y Z in mm, A B in degrees.
pub fn write(machine: &Path, out: &Path) -> Result<Vec<[f64; 5]>, String> {
    let path = |name: &str| out.join(name);
    let read = |name: &str| std::fs::read_to_string(path(name)).map_err(|e| format!("{name}: {e}"));
    let plain = with_comments(&read("holes.ngc")?)?;
    std::fs::write(path("plain.ngc"), plain).map_err(|e| e.to_string())?;
    let (from, table, to) = (path("plain.ngc"), path("coefficients.json"), path(PROGRAM));
    let options = [("--machine", machine), ("--path", &from), ("--table", &table), ("--out", &to)];
    let options = options.into_iter().flat_map(|(name, value)| [OsStr::new(name), value.as_os_str()]);
    let said = cli::run([OsStr::new("compensate"), OsStr::new("--json")].into_iter().chain(options));
    let said: Value = serde_json::from_str(&said.map_err(|e| e.to_string())?.text).map_err(|e| e.to_string())?;
    println!("{said:#}");
    Ok(cuts(&read(PROGRAM)?))
}

/// The loads that go to the compensation, as comments.
fn with_comments(program: &str) -> Result<String, String> {
    let mut load = [0.0; 6];
    let mut text = String::new();
    for line in program.lines() {
        match line.strip_prefix("M67 E").or(line.strip_prefix("M68 E")).and_then(|l| l.split_once(" Q")) {
            Some((component, value)) => {
                let component: usize = component.parse().map_err(|e| format!("{line}: {e}"))?;
                load[component] = value.parse().map_err(|e| format!("{line}: {e}"))?;
                text += &format!("(wrench {})\n", load.map(|v: f64| v.to_string()).join(","));
            }
            None => text += &format!("{line}\n"),
        }
    }
    Ok(text)
}

/// Where a program of straight moves cuts.
fn cuts(program: &str) -> Vec<[f64; 5]> {
    let (mut at, mut all, mut is_cut) = ([f64::NAN; 5], Vec::new(), false);
    for line in program.lines().filter(|l| !l.starts_with(['(', '%'])) {
        let mut moves = false;
        for word in line.split_whitespace() {
            let (letter, value) = word.split_at(1);
            match (word, "XYZAB".find(letter), value.parse()) {
                ("G0", ..) => is_cut = false,
                ("G1", ..) => is_cut = true,
                (_, Some(axis), Ok(value)) => (at[axis], moves) = (value, true),
                _ => {}
            }
        }
        all.extend((moves && is_cut).then_some(at));
    }
    all
}

/// LinuxCNC went by all these places.
pub fn judge(cuts: &[[f64; 5]], rows: &[Vec<f64>]) -> Outcome {
    let asked: Vec<&[f64]> = rows.iter().map(|row| Row::of(row).asked).collect();
    let off = |cut: &[f64; 5]| {
        let from = |asked: &&[f64]| cut.iter().zip(*asked).map(|(c, a)| (c - a).abs()).fold(0.0, f64::max);
        asked.iter().map(from).fold(f64::INFINITY, f64::min)
    };
    let worst = cuts.iter().map(off).fold(0.0, f64::max);
    println!("  {} places of cuts of the compensated program passed within {:.1} µm", cuts.len(), worst * 1e3);
    if cuts.len() < 10 || worst > WITHIN_MM {
        return Err(format!("the compensated program's cuts are {worst} mm off"));
    }
    Ok(())
}
