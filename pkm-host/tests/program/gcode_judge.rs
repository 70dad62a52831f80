//! LinuxCNC's interpreter alone, `rs274`, as the judge of what a program means.

use std::process::Command;

use pkm_host::files::path::{Move, Toward};

use crate::common::Folder;
use crate::gcode::{apart, mm, rewritten};
use crate::gcode_programs::{Case, Direction, cases};

/// What LinuxCNC's interpreter says of a move.
struct Canonical {
    end_mm: [f64; 3],
    angles_deg: [f64; 3],
    /// Centre in the plane's axes, for an arc.
    arc: Option<([usize; 2], [f64; 2])>,
    rapid: bool,
    /// How far the interpreter's figures may be off, mm.
    within_mm: f64,
}

/// What LinuxCNC's interpreter prints of a program.
fn judge(folder: &Folder, text: &str) -> String {
    let offsets = "G21 G90\nG10 L2 P1 X-205 Y0 Z1130\nG10 L2 P2 X-195 Y10 Z1132\n";
    let without: String = text.lines().filter(|l| l.trim() != "%").map(|l| format!("{l}\n")).collect();
    let program = folder.write("judge.ngc", &(offsets.to_owned() + &without));
    let length = |mm: f64| mm / 25.4;
    let tools = format!("T1 P1 Z{} D0\nT2 P2 Z{} D0\n", length(10.0), length(25.5));
    let tools = folder.write("judge.tbl", &tools);
    let rs274 = std::env::var("RS274").unwrap_or("rs274".to_owned());
    // its copy of the tool table goes to the user's folder, where another would write over it
    let call = ["-g", "-t", &tools, &program];
    let said = Command::new(rs274).args(call).env("HOME", folder.path("")).output().expect("rs274 is installed");
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.contains("PROGRAM_END"), "{said}\n{text}");
    said
}

/// The program, with a line after each that has the interpreter print where the tool is: it says so to four decimals otherwise.
fn telling(text: &str) -> String {
    let tells = |line: &str| !line.trim_start().starts_with(['O', 'o', '%', '/', '(']) && !line.contains("M98");
    let told = |line: &str| if tells(line) { "(debug,%.9f#5420 %.9f#5421 %.9f#5422)\n" } else { "" };
    text.lines().map(|line| format!("{line}\n{}", told(line))).collect()
}

/// The moves that LinuxCNC's interpreter makes. Its lengths have four decimals in the program's unit, its tool table is in inches.
fn canonical(folder: &Folder, text: &str) -> Vec<Canonical> {
    let said = judge(folder, &telling(text));
    let (mut moves, mut unit) = (Vec::<Canonical>::new(), 1.0);
    let (mut frame, mut shift) = ([0.0; 3], [0.0; 3]);
    let mut plane = [0, 1, 2];
    for line in said.lines() {
        let Some((name, rest)) = line.split_once('(') else {
            continue;
        };
        let name = name.split_whitespace().last().unwrap_or("");
        let cells = rest.trim_end_matches(')');
        let numbers: Vec<f64> = cells.split(',').filter_map(|c| c.trim().parse().ok()).collect();
        let three = |from: usize| [numbers[from], numbers[from + 1], numbers[from + 2]].map(|v| v * unit);
        let placed = |v: [f64; 3]| std::array::from_fn(|i| v[i] + frame[i] + shift[i]);
        match name {
            "USE_LENGTH_UNITS" => unit = if cells.contains("INCH") { 25.4 } else { 1.0 },
            "SET_G5X_OFFSET" => frame = three(1),
            "SET_G92_OFFSET" => shift = three(0),
            "SELECT_PLANE" if cells.contains("XY") => plane = [0, 1, 2],
            "SELECT_PLANE" if cells.contains("XZ") => plane = [2, 0, 1],
            "SELECT_PLANE" => plane = [1, 2, 0],
            "STRAIGHT_TRAVERSE" | "STRAIGHT_FEED" => {
                let angles_deg = [numbers[3], numbers[4], numbers[5]];
                let rapid = name == "STRAIGHT_TRAVERSE";
                moves.push(Canonical {
                    end_mm: placed(three(0)),
                    angles_deg,
                    arc: None,
                    rapid,
                    within_mm: 6e-5 * unit,
                });
            }
            "ARC_FEED" => {
                let [a, b, along] = plane;
                let (mut end, mut center) = ([0.0; 3], [0.0; 3]);
                (end[a], end[b], end[along]) = (numbers[0] * unit, numbers[1] * unit, numbers[5] * unit);
                (center[a], center[b]) = (numbers[2] * unit, numbers[3] * unit);
                let (end_mm, center) = (placed(end), placed(center));
                let angles_deg = [numbers[6], numbers[7], numbers[8]];
                let arc = Some(([a, b], [center[a], center[b]]));
                moves.push(Canonical { end_mm, angles_deg, arc, rapid: false, within_mm: 6e-5 * unit });
            }
            // offsets have four decimals too
            "MESSAGE" if unit == 1.0 && shift == [0.0; 3] => {
                let words = cells.trim_matches('"').split_whitespace();
                let told: Vec<f64> = words.filter_map(|w| w.parse().ok()).collect();
                if let (Some(last), &[x, y, z]) = (moves.last_mut(), &told[..]) {
                    let end_mm = placed([x, y, z]);
                    assert!(apart(&end_mm, &last.end_mm) < last.within_mm, "{line}");
                    (last.end_mm, last.within_mm) = (end_mm, 1e-6);
                }
            }
            _ => {}
        }
    }
    moves
}

/// The same moves one after the other, but for those that go nowhere.
fn agrees(name: &str, case: &Case, moves: &[Move], judged: &[Canonical]) {
    let letters = case.setup().head.map_or("AB", |h| h.letters());
    let goes = |i: &usize| *i == 0 || moves[*i].to != moves[i - 1].to;
    let mut own = (0..moves.len()).filter(goes).map(|i| &moves[i]).peekable();
    let mut at = Some(([0.0; 3], [0.0; 3]));
    for canonical in judged {
        let (end, allowed_mm) = ((canonical.end_mm, canonical.angles_deg), canonical.within_mm);
        let stays = at.is_some_and(|at| apart(&at.0, &end.0) < 1e-9 && apart(&at.1, &end.1) < 1e-9);
        if stays && canonical.arc.is_none() {
            continue;
        }
        let Some(mut mv) = own.next() else { panic!("{name}: no move to {:?}", canonical.end_mm) };
        if let Some(([a, b], center)) = canonical.arc {
            let radius = |p: &[f64; 3]| (p[a] - center[0]).hypot(p[b] - center[1]);
            let of_arc = radius(&canonical.end_mm);
            let line = mv.line;
            while own.peek().is_some_and(|next| next.line == line && !next.is_rapid) {
                assert!(
                    (radius(&mm(&mv.to)) - of_arc).abs() < 3.0 * allowed_mm,
                    "{name}: {:?} off the arc",
                    mm(&mv.to)
                );
                mv = own.next().unwrap();
            }
        }
        let found = mm(&mv.to);
        let off = apart(&found, &canonical.end_mm);
        assert!(off <= allowed_mm, "{name}, line {}: {found:?} is {off} mm from {:?}", mv.line, canonical.end_mm);
        assert_eq!(mv.is_rapid, canonical.rapid, "{name}, line {}", mv.line);
        if let Toward::Wrist(angles) | Toward::Head(_, angles) = mv.to.toward {
            for (letter, angle) in letters.chars().zip(angles) {
                let said = canonical.angles_deg["ABC".find(letter).unwrap()];
                assert!((angle.to_degrees() - said).abs() <= 6e-5, "{name}: {letter}");
            }
        }
        at = Some(end);
    }
    assert!(own.next().is_none(), "{name}: more moves than LinuxCNC makes");
}

#[test]
#[ignore = "needs LinuxCNC's interpreter, rs274 (Debian: linuxcnc-uspace)"]
fn linuxcnc_makes_the_same_moves() {
    let folder = Folder::new();
    let judged: Vec<&Case> = cases().filter(|c| c.for_linuxcnc).collect();
    assert!(judged.len() >= 25);
    for case in judged {
        let program = case.read(case.text).unwrap();
        agrees(case.name, case, &program.moves, &canonical(&folder, case.text));
        // and of what is written: straight moves alone
        let written = rewritten(&program);
        let judged = canonical(&folder, &written);
        assert!(judged.iter().all(|c| c.arc.is_none()));
        agrees(&format!("{} as written", case.name), case, &program.moves, &judged);
    }
}

/// A random expression in brackets, with functions that have a value everywhere and some that have not.
fn expression(rng: &mut fastrand::Rng, depth: u32) -> String {
    if depth == 0 || rng.u32(..4) == 0 {
        return match rng.u32(..4) {
            0 => "#1".to_owned(),
            1 => "#<name>".to_owned(),
            2 => format!("-{}", rng.u32(..9)),
            _ => format!("{:.2}", rng.f64() * 9.0),
        };
    }
    let operators = ["**", "*", "/", "mod", "+", "-", "eq", "ne", "gt", "ge", "lt", "le", "and", "or", "xor"];
    let functions = ["abs", "acos", "asin", "cos", "exp", "fix", "fup", "ln", "round", "sin", "sqrt", "tan"];
    let inner = |rng: &mut fastrand::Rng| expression(rng, depth - 1);
    match rng.u32(..6) {
        0 => format!("{}[{}]", rng.choice(functions).unwrap(), inner(rng)),
        1 => format!("atan[{}]/[{}]", inner(rng), inner(rng)),
        2 => format!("[{}]", inner(rng)),
        _ => format!("{} {} {}", inner(rng), rng.choice(operators).unwrap(), inner(rng)),
    }
}

/// Random expressions have the values that LinuxCNC gives them: order of operators, functions, tolerance of EQ.
#[test]
#[ignore = "needs LinuxCNC's interpreter, rs274 (Debian: linuxcnc-uspace)"]
fn linuxcnc_computes_the_same() {
    let folder = Folder::new();
    let mut rng = fastrand::Rng::with_seed(274);
    let (start, case) = ("G21 G90 G54\n#1=2.5\n#<name>=-3\nG0 X0 Y0 Z0\n", cases().next().unwrap());
    let case = Case { direction: Direction::Fixed, ..*case };
    let mut text = start.to_owned();
    let mut tried = 0;
    while tried < 400 {
        let line = format!("G0 X[{}]\n", expression(&mut rng, 4));
        // one that has no value is refused here, and a place that is nowhere has too few digits
        let Ok(program) = case.read(&format!("{start}{line}")) else { continue };
        if mm(&program.moves.last().unwrap().to)[0].abs() < 1e4 {
            text += &line;
            tried += 1;
        }
    }
    text += "M2\n";
    agrees("random expressions", &case, &case.read(&text).unwrap().moves, &canonical(&folder, &text));
}
