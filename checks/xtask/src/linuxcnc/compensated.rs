//! The configuration's program with its loads as comments, compensated by `pkm-host` and run as any other program: for whoever has
//! no compensation in the control.

use std::ffi::OsStr;
use std::path::Path;

use pkm_core::nalgebra::Vector3;
use pkm_host::cli;

use super::replay::{Host, Row, held, wrench_of};
use crate::Outcome;

/// What is run.
pub const PROGRAM: &str = "compensated.ngc";
/// How far LinuxCNC may pass a place by, mm or degrees.
const WITHIN: f64 = 1e-5;
/// Shorter than any cut, mm, and longer than any offset, which are up to 0.06 mm here and 0.17 mm on the softer machine. Where a load
/// comes the offset is a corner, which `G64 P0.001` rounds, by 2.6 µm at the most that was seen.
const OFFSET_MM: f64 = 0.5;

/// Of its deflection a load may leave so much where a compensated program takes the tool.
const LEFT: f64 = 0.01;

/// X Y Z in mm, A B in degrees.
type Place = [f64; 5];

/// The end of a move that cuts.
pub struct Cut {
    place: Place,
    /// On the tool at its tip, in its axes, N and N m.
    load: [f64; 6],
}

/// Writes it, and says where the program cuts as it was, and where compensated.
pub fn write(machine: &Path, out: &Path) -> Result<[Vec<Cut>; 2], String> {
    let path = |name: &str| out.join(name);
    let read = |name: &str| std::fs::read_to_string(path(name)).map_err(|e| format!("{name}: {e}"));
    let plain = with_comments(&read("holes.ngc")?)?;
    std::fs::write(path("plain.ngc"), plain).map_err(|e| e.to_string())?;
    let (from, table, to) = (path("plain.ngc"), path("coefficients.json"), path(PROGRAM));
    let options = [("--machine", machine), ("--path", &from), ("--table", &table), ("--out", &to)];
    let options = options.into_iter().flat_map(|(name, value)| [OsStr::new(name), value.as_os_str()]);
    cli::run([OsStr::new("compensate")].into_iter().chain(options)).map_err(|e| e.to_string())?;
    Ok([cuts(&read("plain.ngc")?)?, cuts(&read(PROGRAM)?)?])
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
fn cuts(program: &str) -> Result<Vec<Cut>, String> {
    let (mut place, mut load, mut all, mut is_cut) = ([f64::NAN; 5], [0.0; 6], Vec::new(), false);
    for line in program.lines() {
        if let Some(given) = line.strip_prefix("(wrench ").and_then(|l| l.strip_suffix(')')) {
            let components: Result<Vec<f64>, _> = given.split(',').map(str::parse).collect();
            let components = components.map_err(|e| format!("{line}: {e}"))?;
            load = components.try_into().map_err(|_| format!("{line}: not six components"))?;
        }
        if line.starts_with(['(', '%']) {
            continue;
        }
        let before = place;
        for word in line.split_whitespace() {
            let (letter, value) = word.split_at(1);
            match (word, "XYZAB".find(letter), value.parse()) {
                ("G0", ..) => is_cut = false,
                ("G1", ..) => is_cut = true,
                (_, Some(axis), Ok(value)) => place[axis] = value,
                _ => {}
            }
        }
        if is_cut && (tip_mm(&place) - tip_mm(&before)).norm() > OFFSET_MM {
            all.push(Cut { place, load });
        }
    }
    Ok(all)
}

fn tip_mm(place: &Place) -> Vector3<f64> {
    Vector3::new(place[0], place[1], place[2])
}

/// LinuxCNC went by all these places, in a period or between two, and there the load takes the tip to where the program as it was
/// has it.
pub fn judge(host: &Host, [plain, compensated]: &[Vec<Cut>; 2], rows: &[Vec<f64>]) -> Outcome {
    if compensated.len() < 10 || compensated.len() != plain.len() {
        return Err(format!("{} cuts, compensated {}", plain.len(), compensated.len()));
    }
    let asked: Vec<&[f64]> = rows.iter().map(|row| Row::of(row).asked).collect();
    let off =
        |cut: &Cut| asked.windows(2).map(|ends| beside(&cut.place, ends[0], ends[1])).fold(f64::INFINITY, f64::min);
    let furthest = |cuts: &[Cut]| cuts.iter().map(off).fold(0.0, f64::max);
    let (before, after) = (furthest(plain), furthest(compensated));
    let mut left = 0.0_f64;
    for (asked, told) in plain.iter().zip(compensated) {
        left = left.max(share_left(host, asked, told)?);
    }
    println!(
        "  {} places of cuts passed within {after:.1e} mm in the compensated program, {before:.1e} in the program as it was; \
         {left:.1e} of the deflection is left",
        compensated.len()
    );
    if after > WITHIN {
        return Err(format!("the compensated program's cuts are {after} mm or degrees off"));
    }
    if left <= LEFT { Ok(()) } else { Err(format!("{left} of the deflection is left")) }
}

/// How far the load leaves the tip from where it is asked, when it is told to go elsewhere, as a share of what the load moves it by.
fn share_left(host: &Host, asked: &Cut, told: &Cut) -> Result<f64, String> {
    let (five, table) = (host.five()?, host.table()?);
    let stands = held(&five, &told.place)?.configuration;
    let moved = five.deflection(Some(&table), &stands, &wrench_of(&asked.load)?).map_err(|e| e.to_string())?;
    let moved_mm = moved.translation_m * 1e3;
    Ok((tip_mm(&told.place) + moved_mm - tip_mm(&asked.place)).norm() / moved_mm.norm())
}

/// How far off a place the straight way from one to another passes it, at its nearest along X Y Z: the greatest of the five.
fn beside(place: &Place, from: &[f64], to: &[f64]) -> f64 {
    let way = |i: usize| to[i] - from[i];
    let length: f64 = (0..3).map(|i| way(i) * way(i)).sum();
    let along: f64 = (0..3).map(|i| way(i) * (place[i] - from[i])).sum();
    let share = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    (0..5).map(|i| (from[i] + share * way(i) - place[i]).abs()).fold(0.0, f64::max)
}
