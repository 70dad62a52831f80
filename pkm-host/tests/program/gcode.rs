//! Programs as posts write them: 44 of our own, in five dialects. Each is read with checked moves, or refused for a reason.

use std::path::Path;

use pkm_core::Wrench;
use pkm_host::files::gcode::{Program, Setup};
use pkm_host::files::job_program::ProgramJob;
use pkm_host::files::path::Place;
use pkm_host::files::source::Source;
use pkm_host::files::tools::Tools;
use serde_json::Value;

use crate::common::{Folder, fixture, json, refused};
use crate::gcode_programs::{CASES, Case, Direction, Says, cases};

const OFFSETS: &str = "[offsets]\nG54 = [-205, 0, 1130]\nG55 = [-195, 10, 1132]\nG28 = [-205, 0, 1110, 0, 0]\n";
const TOOLS: &str =
    "format = 1\n[[tool]]\nnumber = 1\nlength_mm = 10\ndiameter_mm = 6\n[[tool]]\nnumber = 2\nlength_mm = 25.5\n";
const WRENCH: &str = "20,-10,-60,0,0,0.5";

impl Case {
    fn job(&self) -> String {
        let direction = match self.direction {
            Direction::Wrist => "",
            Direction::Fixed => "tool_axis = [0, 0, 1]\n",
            Direction::Ac => "head = \"AC\"\n",
            Direction::Bc => "head = \"BC\"\n",
        };
        format!("format = 1\n{direction}{OFFSETS}")
    }

    pub fn setup(&self) -> Setup {
        let ProgramJob { offsets, axes, head } = ProgramJob::parse(&Source::from_text("job.toml", self.job())).unwrap();
        let tools = Tools::parse(&Source::from_text("tools.toml", TOOLS.to_owned())).unwrap();
        Setup { offsets, axes, head, tools, ..Setup::default() }
    }

    pub fn read(&self, text: &str) -> pkm_host::error::Result<Program> {
        let source = Source::from_text("p.ngc", text.to_owned());
        Program::parse_with(&source, Some(Wrench::ZERO), &self.setup())
    }
}

pub fn mm(place: &Place) -> [f64; 3] {
    place.tip_m.map(|m| m * 1e3)
}

pub fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A program that is written with the places that were asked for.
pub fn rewritten(program: &Program) -> String {
    let mut writer = program.writer();
    program.moves.iter().for_each(|m| writer.push(vec![m.to], false));
    writer.finish(&[])
}

/// A direction in the program beside the job's is refused for what the job says, which may be `head` or `tool_axis`.
#[test]
fn a_direction_beside_the_jobs_is_refused_with_the_jobs_key() {
    let of_a_fixed = "the job says the tool's direction for all of the program with `tool_axis`";
    let of_a_head = "this program's rotary axes are \"AC\", as the job's `head` says";
    for (direction, line, says) in [
        (Direction::Fixed, "A0 B0", of_a_fixed),
        (Direction::Fixed, "G0 X1 C5", of_a_fixed),
        (Direction::Fixed, "G1 X1 I0 J0 K1", of_a_fixed),
        (Direction::Fixed, "G17 G2 X1 Z0 I0.5 K1", "K is not in the arc's plane"),
        (Direction::Fixed, "G98 G81 Z-5 R1 I1", "known are G M"),
        (Direction::Ac, "X1 B3", of_a_head),
        (Direction::Ac, "G1 X1 I0 J0 K1", "the tool's direction is given by \"AC\", as the job's `head` says"),
    ] {
        let case = Case { name: "", direction, for_linuxcnc: false, text: "", says: Says::Moves(0, [0.0; 3]) };
        let angles = if matches!(direction, Direction::Ac) { "A0 C0" } else { "" };
        let refused = case.read(&format!("G54 G0 X0 Y0 Z0 {angles}\n{line}\n")).err().expect(line);
        assert!(refused.message.contains(says) && refused.line == Some(2), "{line}: {refused:?}");
    }
}

#[test]
fn programs_are_read_or_refused_for_a_reason() {
    assert!(CASES.len() >= 40);
    let mut wrong = Vec::new();
    for case in cases() {
        let read = case.read(case.text);
        match (&case.says, read) {
            (Says::Moves(count, last), Ok(program)) => {
                let (moves, end) = (program.moves.len(), mm(&program.moves.last().unwrap().to));
                if moves != *count || apart(&end, last) > 1e-9 {
                    wrong.push(format!("{}: {moves} moves, the last to {end:?}", case.name));
                }
            }
            (Says::Refused(line, words), Err(failure))
                if failure.line == Some(*line) && failure.message.contains(words) => {}
            (_, Err(failure)) => wrong.push(format!("{}: {failure}", case.name)),
            (Says::Refused(..), Ok(_)) => wrong.push(format!("{} is read", case.name)),
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// What is written says the same as what was read: in its own units, frames, and increments.
#[test]
fn what_is_written_is_read_as_the_same_moves() {
    for case in cases().filter(|c| matches!(c.says, Says::Moves(..))) {
        let program = case.read(case.text).unwrap();
        let written = rewritten(&program);
        let again = case.read(&written).unwrap_or_else(|e| panic!("{}: {e}\n{written}", case.name));
        let moves = |p: &Program| p.moves.iter().map(|m| (m.is_rapid, m.longer_m)).collect::<Vec<_>>();
        assert_eq!(moves(&program), moves(&again), "{}\n{written}", case.name);
        for (one, other) in program.moves.iter().zip(&again.moves) {
            let [way, turn] = one.to.apart(&other.to);
            assert!(way < 3e-9 && turn < 1e-9, "{}: {:?} {:?}\n{written}", case.name, one.to, other.to);
        }
    }
}

/// The whole command, with a load: every program that is read is also in reach of the reference machine.
#[test]
fn programs_are_compensated() {
    let folder = Folder::new();
    let (tools, out) = (folder.write("tools.toml", TOOLS), folder.path("out.ngc"));
    for case in cases().filter(|c| matches!(c.says, Says::Moves(..))) {
        let (job, path) = (folder.write("job.toml", &case.job()), folder.write("p.ngc", case.text));
        let step = ["--step-mm", "10", "--chord-mm", "0.05"];
        let args = ["compensate", "--path", &path, "--job", &job, "--tools", &tools, "--wrench", WRENCH, "--out", &out];
        let summary = json(&[&args[..], &step].concat());
        let [before, after] = ["error_before_um", "error_after_um"].map(|key| summary[key]["max"].as_f64().unwrap());
        assert!(before > 0.5 && after < 0.01 && after < 0.01 * before, "{}: {before} µm, {after} µm", case.name);
        // where it is read again it asks for points near those of the program
        let again = case.read(&folder.read("out.ngc").replace("pkm-host compensate", "made")).unwrap();
        let Says::Moves(_, last) = case.says else { unreachable!() };
        let off = apart(&mm(&again.moves.last().unwrap().to), &last);
        assert!(off < 0.2, "{}: {off} mm", case.name);
    }
}

/// The feed that is said to be within the joints' limits is, and one percent more is not.
#[test]
fn feeds_are_held_against_the_limits_of_the_joints() {
    let folder = Folder::new();
    let (limits, out) = (fixture("jobs/limits.toml"), folder.path("out.ngc"));
    let text = std::fs::read_to_string(fixture("jobs/path.ngc")).unwrap();
    let found = |program: &str| {
        let path = folder.write("p.ngc", program);
        json(&["compensate", "--path", &path, "--limits", &limits, "--out", &out])
    };
    let lines = |found: &Value| found["too_fast"].as_array().unwrap().len();
    let slow = found(&text);
    assert_eq!((lines(&slow), slow["feeds_checked"].as_u64()), (0, Some(10)));
    let fast = found(&text.replace("F600", "F60000"));
    assert_eq!(lines(&fast), 8);
    let least = fast["too_fast"].as_array().unwrap().iter().map(|t| t["allowed_per_min"].as_f64().unwrap());
    let least = least.fold(f64::INFINITY, f64::min);
    assert!((600.0..60000.0).contains(&least), "{least}");
    assert_eq!(lines(&found(&text.replace("F600", &format!("F{:.4}", least * 0.9999)))), 0);
    assert!(lines(&found(&text.replace("F600", &format!("F{:.4}", least * 1.01)))) > 0);
    // a coarse step says nearly the same of a long move as a fine one
    let path = folder.write("p.ngc", "G0 X-205 Y0 Z1137 I0 J0 K1\n(wrench 0,0,-400,0,0,5)\nG1 X-150 F50000\n");
    let [coarse, fine] = ["20", "0.5"].map(|step| {
        let found = json(&["compensate", "--path", &path, "--limits", &limits, "--step-mm", step, "--out", &out]);
        found["too_fast"][0]["allowed_per_min"].as_f64().unwrap()
    });
    assert!((coarse / fine - 1.0).abs() < 3e-3, "{coarse} {fine}");
    // the same feeds of a turn of the spindle; without S they are no feeds of a minute
    let of_a_turn = text.replace("G94", "G95").replace("F600", "F10").replace("F200", "F0.03");
    let turning = found(&of_a_turn);
    assert_eq!((turning["too_fast"].clone(), turning["feeds_checked"].as_u64()), (fast["too_fast"].clone(), Some(10)));
    assert!(turning["warnings"].to_string().contains("60000 mm/min (G95: F times S) is too fast"), "{turning}");
    let standing = found(&of_a_turn.replace("S6000 M3", "M3"));
    assert_eq!((lines(&standing), standing["feeds_checked"].as_u64()), (0, Some(0)));
    assert_eq!(standing["feeds_not_checked"].as_u64(), Some(10));

    let path = folder.write("p.ngc", &text);
    let good = std::fs::read_to_string(&limits).unwrap();
    for (from, to, said) in [
        ("3600, 3600", "3600", "wrist_velocity_deg_per_min"),
        ("3600, 3600", "3600, -1", "wrist_velocity_deg_per_min"),
        ("2000, 2000, 2000", "2000, 2000, nan", "screw_acceleration_mm_per_s2"),
        ("format = 1", "format = 2", "expected 1"),
        ("wrist_acc", "wrist_act", "wrist_act"),
    ] {
        let bad = folder.write("limits.toml", &good.replace(from, to));
        let message = refused(&["compensate", "--path", &path, "--limits", &bad, "--out", &out]).to_string();
        assert!(message.contains(said), "{message}");
    }
    let csv = refused(&[
        "compensate",
        "--path",
        &fixture("jobs/path.csv"),
        "--limits",
        &limits,
        "--out",
        &folder.path("o.csv"),
    ])
    .to_string();
    assert!(csv.contains("--limits is for G-code"), "{csv}");
}

#[test]
fn arcs_stay_within_the_chordal_error() {
    let case = Case { direction: Direction::Fixed, ..CASES[0] };
    let text = "G17 G21 G90\nG54 G0 X20 Y0 Z0\nG3 X0 Y20 I-20 J0 F100\n";
    for chord_mm in [0.1, 0.01, 1e-3, 1e-4] {
        let setup = Setup { chord_mm, ..case.setup() };
        let source = Source::from_text("arc.ngc", text.to_owned());
        let program = Program::parse_with(&source, Some(Wrench::ZERO), &setup).unwrap();
        let points: Vec<[f64; 3]> = program.moves.iter().map(|m| mm(&m.to)).collect();
        let mut worst = 0.0_f64;
        for pair in points.windows(2) {
            let middle: [f64; 2] = std::array::from_fn(|i| 0.5 * (pair[0][i] + pair[1][i]));
            worst = worst.max(20.0 - (middle[0] + 205.0).hypot(middle[1]));
            assert!(((pair[1][0] + 205.0).hypot(pair[1][1]) - 20.0).abs() < 1e-9);
        }
        assert!(worst <= chord_mm && worst > 0.9 * chord_mm, "{worst} for {chord_mm}");
    }
}

#[test]
fn block_delete_leaves_lines_out_or_makes_them() {
    let folder = Folder::new();
    let path = folder.write("p.ngc", "G21 G90\nG0 X-205 Y0 Z1130 A0 B0\n/G1 X-200 F100\n/2 M8\nG1 Y1\nM30\n");
    let out = folder.path("out.ngc");
    let args = ["compensate", "--path", &path, "--wrench", WRENCH, "--out", &out];
    let said = json(&args)["warnings"].to_string();
    assert!(
        said.contains("p.ngc:3: begins with `/` (first of 2 such lines): carried out, and written without it"),
        "{said}"
    );
    let made = folder.read("out.ngc");
    let (head, lines) = made.split_once("\nG21").unwrap();
    assert!(head.ends_with("lines with /: 2 carried out, and written without it)"), "{made}");
    assert!(lines.contains("\nG1 F100 X") && lines.contains("\nM8\n") && !lines.contains('/'), "{made}");
    let left_out = json(&[&args[..], &["--block-delete"]].concat());
    // the cut that is left has no F then
    assert!(left_out["warnings"].to_string().contains("p.ngc:5: a cut without F in force"), "{left_out}");
    let left = folder.read("out.ngc");
    assert!(!left.contains("F100") && !left.contains("M8"), "{left}");
}

#[test]
fn a_tools_length_moves_the_flange_away() {
    let folder = Folder::new();
    let toml = folder.write("t.toml", TOOLS);
    let table = folder.write("tool.tbl", "; LinuxCNC\nT1 P1 Z+10.0 D6.0 ;end mill\nT2 P2 Z25.5\n");
    // the same tip with another length asks for another posture
    let path = folder.write("p.ngc", "G21 G90\nG43 H2\nG0 X-205 Y0 Z1130 A0 B0\nG1 X-200 F100\nG49\nG0 Z1120\nM30\n");
    let out = folder.path("out.ngc");
    let run = |tools: &str| {
        let args = ["compensate", "--path", &path, "--tools", tools, "--wrench", WRENCH, "--out", &out];
        (json(&args), folder.read("out.ngc"))
    };
    let (summary, written) = run(&toml);
    assert_eq!(run(&table).1, written);
    let longer = crate::common::reference_machine().replace("flange_mm = 190.0", "flange_mm = 215.5");
    let machine = folder.write("m.toml", &longer);
    let plain = folder.write("q.ngc", "G21 G90\n(G43)\nG0 X-205 Y0 Z1130 A0 B0\nG1 X-200 F100\nM30\n");
    let args = ["compensate", "--machine", &machine, "--path", &plain, "--wrench", WRENCH, "--out", &out];
    let expected = json(&args);
    assert_eq!(summary["error_before_um"], expected["error_before_um"]);
    let cut = |text: &str| {
        text.lines()
            .filter(|l| l.starts_with(['X', 'G']) && l.contains("X-20"))
            .take(5)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(cut(&written)[..4], cut(&folder.read("out.ngc"))[..4]);
    for (name, text, words) in [
        ("a.toml", "format = 1\n[[tool]]\nnumber = 1\nlength_mm = nan\n", "length"),
        (
            "b.toml",
            "format = 1\n[[tool]]\nnumber = 1\nlength_mm = 1\n[[tool]]\nnumber = 1\nlength_mm = 2\n",
            "duplicate tool 1",
        ),
        ("c.toml", "format = 1\n[[tool]]\nnumber = 1\nlength_mm = -200\n", "tool 1: with a length of -200 mm"),
        ("c.tbl", "T1 P1 X3 Z4\n", "along Z"),
        ("d.tbl", "T1 P1 Zlong\n", "Zlong"),
    ] {
        let tools = folder.write(name, text);
        let error = refused(&["compensate", "--path", &path, "--tools", &tools, "--wrench", WRENCH, "--out", &out]);
        assert!(
            error["message"].as_str().unwrap().contains(words)
                && Path::new(error["file"].as_str().unwrap()).ends_with(name),
            "{error}"
        );
    }
}

/// A program of a post whose Z points away from the workpiece, on a machine whose z points into it.
#[test]
fn a_program_with_z_up_is_turned_and_written_with_z_up() {
    let folder = Folder::new();
    let text = "G21 G90 G54\nG0 X0 Y0 Z5\nG98 G81 X3 Y2 Z-3 R1 F100\nG80\nG1 Z0\nG91 G1 X1 Z-1\nG90\nM2\n";
    let path = folder.write("p.ngc", text);
    let up = "format = 1\naxes = [\"x\", \"-y\", \"-z\"]\ntool_axis = [0, 0, 1]\n[offsets]\nG54 = [-205, 0, -1130]\n";
    let job = folder.write("up.toml", up);
    let ProgramJob { offsets, axes, head } = ProgramJob::parse(&Source::from_text("j", up.to_owned())).unwrap();
    let setup = Setup { offsets, axes, head, ..Setup::default() };
    let source = Source::from_text("p.ngc", text.to_owned());
    let program = Program::parse_with(&source, Some(Wrench::ZERO), &setup).unwrap();
    let ends: Vec<[f64; 3]> = program.moves.iter().map(|m| mm(&m.to)).collect();
    let expected = [
        [-205.0, 0.0, 1125.0],
        [-202.0, -2.0, 1125.0],
        [-202.0, -2.0, 1129.0],
        [-202.0, -2.0, 1133.0],
        [-202.0, -2.0, 1125.0],
        [-202.0, -2.0, 1130.0],
        [-201.0, -2.0, 1131.0],
    ];
    assert_eq!(ends.len(), expected.len());
    assert!(ends.iter().zip(&expected).all(|(a, b)| apart(a, b) < 1e-9), "{ends:?}");
    let written = rewritten(&program);
    assert!(written.contains("\nG1 X3 Y2 Z-3\nG0 X3 Y2 Z5\n") && written.contains("\nG91 G1 X1 Y0 Z-1\n"), "{written}");
    let out = folder.path("out.ngc");
    json(&["compensate", "--path", &path, "--job", &job, "--wrench", WRENCH, "--out", &out]);
    for axes in ["[\"x\", \"y\", \"-z\"]", "[\"x\", \"y\"]", "[1, 2, 3]"] {
        let job = folder.write("bad.toml", &format!("format = 1\naxes = {axes}\n"));
        let error = refused(&["compensate", "--path", &path, "--job", &job, "--wrench", WRENCH, "--out", &out]);
        assert_eq!(error["line"], 2, "{error}");
    }
    for (text, key) in [
        ("format = 1\nhead = \"XY\"\n", "head"),
        ("format = 1\ntool_axis = [0, 0, 0]\n", "tool_axis"),
        ("format = 1\n[offsets]\nG54 = [0, 0, inf]\n", "offsets.G54"),
        ("format = 1\n[offsets]\nG60 = [0, 0, 0]\n", "offsets"),
        ("format = 2\n", "format"),
    ] {
        let job = folder.write("bad.toml", text);
        let error = refused(&["compensate", "--path", &path, "--job", &job, "--wrench", WRENCH, "--out", &out]);
        assert!(error["column"].as_str().unwrap().contains(key), "{error}");
    }
}

/// Every line beside its original.
#[test]
fn a_program_is_written_in_the_dialect_it_came_in() {
    let text = "%\nO1000 (PART)\nN10 G20 G90 G54 G17\nN20 G0 X0. Y0. Z.1 S2000 M3\n(HOLE)\nN30 G98 G82 X.1 Z-.1 R.05 P.5 F5.\n\
                N40 G80\nM98 P2 (SUB)\nG93 G91 G1 X.1 F10. M0\nG94 G90\nG0 G53 X-205. Y0. Z1120.\nG91 G28 Z0.\nM30\n\
                O2 (SIDE)\nG1 Y.1 F5.\nM99\n%\n";
    let text = text.replace("X-205. Y0. Z1120.", "X-8. Y0. Z44.");
    let case = Case { direction: Direction::Fixed, ..CASES[0] };
    let written = rewritten(&case.read(&text).unwrap());
    let expected = "%\nO1000 (PART)\nN10 G20 G90 G54 G17\nN20 G0 S2000 M3 X0 Y0 Z0.1\n(HOLE)\nN30 G98 F5. X0.1 Y0 Z0.1\n\
                    X0.1 Y0 Z0.05\nG1 X0.1 Y0 Z-0.1\nG4 P0.5\nG0 X0.1 Y0 Z0.1\nN40 G80\n(M98 P2) (SUB)\nG1 F5. X0.1 Y0.1 Z0.1\n\
                    (M99)\nG93 G91 G1 X0.1 Y0 Z0 F10 M0\nG94 G90\nG0 G53 X-8 Y0 Z44\nG91 G28 Z0.\nM30\n%\n";
    assert_eq!(written, expected);
}

/// Words that are put into the programs at random.
const WORDS: &str = "G0 G1 G2 G3 G10L2P1X1Y2Z3 G10L20P1X0 G17 G18 G19 G20 G21 G28Z0 G30 G43H1 G43H2 G49 G52X1 G53 G54 G55 G73 \
                     G80 G81 G82 G83 G90 G91 G92X0 G92.1 G93 G94 G98 G99 M0 M30 M98P1 M99 X1 Y-2.5 Z3 I1 J-1 K2 A1 B2 C3 F100 R1 \
                     R-3 Q1 L2 L0 P2 H1 T2 N5 / (c) ;d % G90.1 G91.1 I-10 J10 99999999";

/// Lines that are lost, doubled, swapped, or have a word too many: refused, or written as the same moves.
#[test]
fn damaged_programs_are_refused_or_written_as_they_are_read() {
    let words: Vec<&str> = WORDS.split(' ').collect();
    let mut rng = fastrand::Rng::with_seed(21);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..4000 {
        let case = &CASES[rng.usize(..CASES.len())];
        let mut lines: Vec<String> = case.text.lines().map(str::to_owned).collect();
        for _ in 0..rng.usize(1..5) {
            let n = rng.usize(..lines.len());
            match rng.usize(..4) {
                0 if lines.len() > 1 => drop(lines.remove(n)),
                1 => lines.insert(n, lines[n].clone()),
                2 => lines.swap(n, 0),
                _ => lines[n] = format!("{} {}", lines[n], words[rng.usize(..words.len())]),
            }
        }
        let setup = Setup { chord_mm: 0.5, ..case.setup() };
        let parse = |text: &str| {
            let source = Source::from_text("p.ngc", text.to_owned());
            Program::parse_with(&source, Some(Wrench::ZERO), &setup)
        };
        let text = lines.join("\n");
        let Ok(program) = parse(&text) else {
            refused += 1;
            continue;
        };
        read += 1;
        let written = rewritten(&program);
        let again = parse(&written).unwrap_or_else(|e| panic!("{e}\n{text}\n---\n{written}"));
        assert_eq!(program.moves.len(), again.moves.len(), "{text}\n---\n{written}");
        for (one, other) in program.moves.iter().zip(&again.moves) {
            let [way, turn] = one.to.apart(&other.to);
            let same = (one.is_rapid, one.longer_m) == (other.is_rapid, other.longer_m);
            assert!(same && way < 2e-8 && turn < 1e-5, "{one:?}\n{other:?}\n{text}\n---\n{written}");
        }
    }
    assert!(read > 800 && refused > 800, "{read} read, {refused} refused");
}

#[test]
fn places_that_are_not_known_are_not_cut_from() {
    let case = Case { direction: Direction::Fixed, ..CASES[0] };
    let start = "G21 G90 G54\nG0 X0 Y0 Z0\n";
    let read = |rest: &str| case.read(&format!("{start}{rest}\n"));
    for (rest, words) in [
        ("G43 H1\nG1 Z5 F100", "a cut from a place that is not known"),
        ("G43 H1\nG2 X5 Y5 Z1 R5 F100", "an arc from a place that is not known"),
        ("G91 G30 Z0\nG90\nG81 X1 Y1 Z-1 R1 F100", "a cycle from a place that is not known"),
        ("G91 G30 Z0\nG90\nG1 X1 F100", "all of X Y Z"),
        ("G43 H1\nG0 Z5\nG1 G53 X-205 Y0 Z1130", "G49 before this line"),
        ("G52 X1\nG92 X0", "G92 while G52 is in force"),
        ("G91 G30 Z0\nG92 Z0", "where the tool stands is not known"),
        ("G17 G98 G81 X1 Y1 Z-1 R1 F100\nG18 X2", "another plane"),
    ] {
        let failure = read(rest).map(|_| ()).unwrap_err();
        assert!(failure.message.contains(words), "{rest}: {failure}");
    }
    let again = read("G43 H1\nG0 Z5\nG1 Z4 F100\nG49\nG0 Z6\nG92 Z0\nG0 Z1").unwrap();
    let found: Vec<_> = again.moves.iter().map(|m| (m.is_fresh, (m.longer_m * 1e3).round(), mm(&m.to)[2])).collect();
    let z = |z: f64| 1130.0 + z;
    assert_eq!(
        found,
        [(true, 0.0, z(0.0)), (true, 10.0, z(5.0)), (false, 10.0, z(4.0)), (true, 0.0, z(6.0)), (false, 0.0, z(7.0))]
    );
}
