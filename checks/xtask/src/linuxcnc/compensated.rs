//! The configuration's program with its loads as comments, compensated by `pkm-host` and run as any other program: for whoever has
//! no compensation in the control.

use std::ffi::OsStr;
use std::path::Path;

use pkm_host::cli;

use super::replay::Row;
use crate::Outcome;

/// What is run.
pub const PROGRAM: &str = "compensated.ngc";
/// How far LinuxCNC may pass a place by, mm or degrees.
const WITHIN: f64 = 1e-5;
/// Shorter than any cut, mm, and longer than any offset, which are up to 0.06 mm here and 0.17 mm on the softer machine. Where a load
/// comes the offset is a corner, which `G64 P0.001` rounds, by 2.6 µm at the most that was seen.
const OFFSET_MM: f64 = 0.5;

/// X Y Z in mm, A B in degrees.
type Place = [f64; 5];

/// Writes it, and says where the program cuts as it was, and where compensated.
pub fn write(machine: &Path, out: &Path) -> Result<[Vec<Place>; 2], String> {
    let path = |name: &str| out.join(name);
    let read = |name: &str| std::fs::read_to_string(path(name)).map_err(|e| format!("{name}: {e}"));
    let plain = with_comments(&read("holes.ngc")?)?;
    std::fs::write(path("plain.ngc"), plain).map_err(|e| e.to_string())?;
    let (from, table, to) = (path("plain.ngc"), path("coefficients.json"), path(PROGRAM));
    let options = [("--machine", machine), ("--path", &from), ("--table", &table), ("--out", &to)];
    let options = options.into_iter().flat_map(|(name, value)| [OsStr::new(name), value.as_os_str()]);
    cli::run([OsStr::new("compensate")].into_iter().chain(options)).map_err(|e| e.to_string())?;
    Ok([cuts(&read("plain.ngc")?), cuts(&read(PROGRAM)?)])
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

/// Where a program of straight moves cuts: all ends but those of steps by an offset alone.
fn cuts(program: &str) -> Vec<Place> {
    let (mut at, mut all, mut is_cut) = ([f64::NAN; 5], Vec::new(), false);
    for line in program.lines().filter(|l| !l.starts_with(['(', '%'])) {
        let before = at;
        for word in line.split_whitespace() {
            let (letter, value) = word.split_at(1);
            match (word, "XYZAB".find(letter), value.parse()) {
                ("G0", ..) => is_cut = false,
                ("G1", ..) => is_cut = true,
                (_, Some(axis), Ok(value)) => at[axis] = value,
                _ => {}
            }
        }
        let way_mm = (0..3).map(|i| (at[i] - before[i]).powi(2)).sum::<f64>().sqrt();
        all.extend((is_cut && way_mm > OFFSET_MM).then_some(at));
    }
    all
}

/// LinuxCNC went by all these places, in a period or between two.
pub fn judge([plain, compensated]: &[Vec<Place>; 2], rows: &[Vec<f64>]) -> Outcome {
    let asked: Vec<&[f64]> = rows.iter().map(|row| Row::of(row).asked).collect();
    let off = |cut: &Place| asked.windows(2).map(|ends| beside(cut, ends[0], ends[1])).fold(f64::INFINITY, f64::min);
    let furthest = |cuts: &[Place]| cuts.iter().map(off).fold(0.0, f64::max);
    let (before, after) = (furthest(plain), furthest(compensated));
    println!(
        "  {} places of cuts passed within {:.1e} mm in the compensated program, {:.1e} in the program as it was",
        compensated.len(),
        after,
        before
    );
    if compensated.len() < 10 || compensated.len() != plain.len() || after > WITHIN {
        return Err(format!("the compensated program's cuts are {after} mm or degrees off"));
    }
    Ok(())
}

/// How far off a place the straight way from one to another passes it, at its nearest along X Y Z: the greatest of the five.
fn beside(place: &Place, from: &[f64], to: &[f64]) -> f64 {
    let way = |i: usize| to[i] - from[i];
    let length: f64 = (0..3).map(|i| way(i) * way(i)).sum();
    let along: f64 = (0..3).map(|i| way(i) * (place[i] - from[i])).sum();
    let share = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    (0..5).map(|i| (from[i] + share * way(i) - place[i]).abs()).fold(0.0, f64::max)
}
