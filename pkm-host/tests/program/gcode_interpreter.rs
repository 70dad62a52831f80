//! Programs that LinuxCNC's interpreter reads for `compensate`.

use std::path::Path;

use pkm_core::Wrench;
use pkm_host::files::gcode::{Program, Setup};
use pkm_host::files::path::{Load, Move};
use pkm_host::files::source::Source;
use pkm_host::files::tools::Tools;

use crate::common::{Folder, json, refused};
use crate::gcode::{apart, mm, rewritten};
use crate::gcode_controls::is_in_g93_and_back;
use crate::gcode_programs::{CASES, Case, Direction, Says, cases};

const JOB: &str = "format = 1\ntool_axis = [0, 0, 1]\n[offsets]\nG54 = [-205, 0, 1130]\nG28 = [-205, 0, 1110, 0, 0]\n";
const TOOLS: &str = "T1 P1 Z10 D6\nT2 P2 Z25.5 D8\n";
const WRENCH: &str = "20,-10,-60,0,0,0.5";

fn rs274() -> String {
    std::env::var("RS274").unwrap_or("rs274".to_owned())
}

fn by_linuxcnc(folder: &Folder, text: &str, setup: &Setup) -> pkm_host::error::Result<Program> {
    let source = Source::from_text("p.ngc", text.to_owned());
    Program::parse_by(rs274().as_ref(), &source, Path::new(&folder.path("")), Some(Wrench::ZERO), setup)
}

fn fixed() -> Setup {
    let tools = Tools::parse(&Source::from_text("t.tbl", TOOLS.to_owned())).unwrap();
    Setup { tools, ..Case { direction: Direction::Fixed, ..CASES[0] }.setup() }
}

/// Without moves that go nowhere.
fn moving(program: &Program) -> Vec<&Move> {
    let moves = &program.moves;
    (0..moves.len()).filter(|i| *i == 0 || moves[*i].to != moves[i - 1].to).map(|i| &moves[i]).collect()
}

#[test]
#[ignore = "needs LinuxCNC's interpreter, rs274 (Debian: linuxcnc-uspace)"]
fn what_both_read_are_the_same_moves() {
    let folder = Folder::new();
    let mut read = 0;
    for case in cases().filter(|c| c.for_linuxcnc && matches!(c.says, Says::Moves(..))) {
        let (own, theirs) = (case.read(case.text).unwrap(), by_linuxcnc(&folder, case.text, &case.setup()));
        let theirs = theirs.unwrap_or_else(|e| panic!("{}: {e}", case.name));
        let again = case.read(&rewritten(&theirs)).unwrap_or_else(|e| panic!("{}: {e}", case.name));
        for (theirs, within_m) in [(&theirs, 1e-9), (&again, 3e-9)] {
            let (own, theirs) = (moving(&own), moving(theirs));
            assert_eq!(own.len(), theirs.len(), "{}", case.name);
            for (one, other) in own.iter().zip(theirs) {
                let [way, turn] = one.to.apart(&other.to);
                assert!(way < within_m && turn < 1e-9, "{}, line {}: {:?} {:?}", case.name, one.line, one.to, other.to);
                assert_eq!((one.is_rapid, one.longer_m), (other.is_rapid, other.longer_m), "{}", case.name);
            }
        }
        let lines = |program: &Program| moving(program).iter().map(|m| m.line).collect::<Vec<_>>();
        // where a subprogram moves both name its line
        assert_eq!(lines(&own), lines(&theirs), "{}", case.name);
        read += 1;
    }
    assert!(read >= 25, "{read}");
}

/// Ends of moves by hand, in the work frame.
const BY_HAND: &[(&str, &str, &[[f64; 3]])] = &[
    (
        "positions as parameters, computed numbers of O words and of codes",
        "o200 sub\nG1 X[#5420+#1] Y[#5421-1] F100\no200 endsub\nG0 X1 Y2 Z3\n#7=200\no#7 call [5]\nG[2-1] Z[#5422*2]\nM2\n",
        &[[1.0, 2.0, 3.0], [6.0, 1.0, 3.0], [6.0, 1.0, 6.0]],
    ),
    (
        "a turned work frame",
        "G0 X0 Y0 Z0\nG10 L2 P1 R90\nG1 X10 F100\nY5\nG10 L2 P1 R0\nX1 Y1\nM2\n",
        &[[0.0, 0.0, 0.0], [0.0, 10.0, 0.0], [-5.0, 10.0, 0.0], [1.0, 1.0, 0.0]],
    ),
    (
        "boring cycles",
        "G0 X0 Y0 Z5\nG98 G85 X2 Y0 Z-3 R1 F50\nG89 X3 Z-2 R1 P0.1\nG80\nM2\n",
        &[
            [0.0, 0.0, 5.0],
            [2.0, 0.0, 5.0],
            [2.0, 0.0, 1.0],
            [2.0, 0.0, -3.0],
            [2.0, 0.0, 1.0],
            [2.0, 0.0, 5.0],
            [3.0, 0.0, 5.0],
            [3.0, 0.0, 1.0],
            [3.0, 0.0, -2.0],
            [3.0, 0.0, 5.0],
        ],
    ),
    (
        "an offset that is put aside and taken again",
        "G0 X1 Y1 Z1\nG92 X0\nG1 X2 F100\nG92.2\nX2\nG92.3\nX3\nG92.1\nG28\nM2\n",
        &[[1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [2.0, 1.0, 1.0], [4.0, 1.0, 1.0], [0.0, 0.0, -20.0]],
    ),
    (
        "inches and a loop",
        "G20\nG0 X0 Y0 Z0.1\n#1=0\no1 while [#1 LT 2]\n#1=[#1+1]\nG1 X[#1/3] F10\no1 endwhile\nM2\n",
        &[[0.0, 0.0, 2.54], [25.4 / 3.0, 0.0, 2.54], [50.8 / 3.0, 0.0, 2.54]],
    ),
];

#[test]
#[ignore = "needs LinuxCNC's interpreter, rs274 (Debian: linuxcnc-uspace)"]
fn what_linuxcnc_alone_reads_goes_where_it_should() {
    let folder = Folder::new();
    folder.write("hole.ngc", "o<hole> sub\n(F 1 2 3)\nG98 G81 X#1 Y#2 Z-1 R1 F100\no<hole> endsub\n");
    let hole = |x: f64, y: f64| [[x, y, 5.0], [x, y, 1.0], [x, y, -1.0], [x, y, 5.0]];
    for (name, text, by_hand) in BY_HAND {
        let program = by_linuxcnc(&folder, &format!("G21 G90 G54\n{text}"), &fixed());
        let program = program.unwrap_or_else(|e| panic!("{name}: {e}"));
        let ends: Vec<[f64; 3]> = moving(&program).iter().map(|m| mm(&m.to)).collect();
        assert_eq!(ends.len(), by_hand.len(), "{name}: {ends:?}");
        for (found, [x, y, z]) in ends.iter().zip(*by_hand) {
            assert!(apart(found, &[x - 205.0, *y, z + 1130.0]) < 1e-6, "{name}: {ends:?}");
        }
    }
    // the subroutine in a file: moves have the line of the call, and the load that the file says
    let text = "G21 G90 G54\nG0 X0 Y0 Z5\n#9=-4\no<Hole> call [3] [-2]\no<hole> call [4] [#9]\nG80\nM2\n";
    let program = by_linuxcnc(&folder, text, &fixed()).unwrap();
    let holes = [hole(3.0, -2.0), hole(4.0, -4.0)].concat();
    let moves = moving(&program);
    assert_eq!(moves.len(), 9);
    for (mv, [x, y, z]) in moves[1..].iter().zip(holes) {
        assert!(apart(&mm(&mv.to), &[x - 205.0, y, z + 1130.0]) < 1e-6, "{:?}", mv.to);
        let Load::Given([load, _]) = mv.load else { panic!("{:?}", mv.load) };
        assert_eq!(load.to_vector()[2], if mv.is_rapid { 0.0 } else { 3.0 });
    }
    assert_eq!(moves.iter().map(|m| m.line).collect::<Vec<_>>(), [2, 4, 4, 4, 4, 5, 5, 5, 5]);
}

/// Left of a square of 20 mm: a tool of 6 mm goes 3 mm beside it, and around its corners.
#[test]
#[ignore = "needs LinuxCNC's interpreter, rs274 (Debian: linuxcnc-uspace)"]
fn a_radius_is_compensated() {
    let folder = Folder::new();
    let text = "G21 G90 G54 G17\nT1 M6\nG43 H1\nG0 X-20 Y-10 Z5\nG41 D1 G1 X0 Y0 F300\nY20\nX20\nY0\nG40 X40\nM2\n";
    let program = by_linuxcnc(&folder, text, &fixed()).unwrap();
    let of_line = |line: u64| {
        let moves = program.moves.iter().filter(move |m| m.line == line);
        moves.map(|m| apart_from_frame(&mm(&m.to))).collect::<Vec<_>>()
    };
    let is_at = |found: &[f64; 3], x: f64, y: f64| apart(found, &[x, y, 5.0]) < 1e-6;
    assert!(is_at(of_line(6).last().unwrap(), -3.0, 20.0), "{:?}", of_line(6));
    for (line, corner, from, to) in
        [(7, [0.0, 20.0], [0.0, 23.0], [20.0, 23.0]), (8, [20.0, 20.0], [23.0, 20.0], [23.0, 0.0])]
    {
        let ends = of_line(line);
        let (last, around) = ends.split_last().unwrap();
        assert!(is_at(last, to[0], to[1]) && is_at(around.last().unwrap(), from[0], from[1]), "{ends:?}");
        assert!(
            around.len() > 10 && around.iter().all(|p| ((p[0] - corner[0]).hypot(p[1] - corner[1]) - 3.0).abs() < 1e-6)
        );
    }
    assert!(is_at(of_line(9).last().unwrap(), 40.0, 0.0));
    assert!(program.moves[1..].iter().all(|m| m.longer_m == 0.01));
    let tools = Tools::parse(&Source::from_text("t.tbl", "T1 P1 Z10\n".to_owned())).unwrap();
    let failure = by_linuxcnc(&folder, text, &Setup { tools, ..fixed() }).map(|_| ()).unwrap_err();
    assert!(failure.line == Some(5) && failure.message.contains("the diameter of every tool"), "{failure}");
}

fn apart_from_frame([x, y, z]: &[f64; 3]) -> [f64; 3] {
    [x + 205.0, *y, z - 1130.0]
}

/// Lines behind a start, the line that is refused, words of the reason.
const BAD: &[(&str, u64, &str)] = &[
    ("G1 X5 F100 Q", 3, "interpreter says of `G1 X5 F100 Q`: No characters found in reading real value"),
    ("G1 X5 (open", 3, "Unclosed comment"),
    ("G1 X#100 F100", 3, "does a parameter have no value?"),
    ("o1 if [#31 GT 0]\no1 endif", 3, "does a parameter have no value?"),
    ("G1 X#<depth> F100", 3, "depth"),
    ("M8\no<nothing> call", 4, "`o<nothing>` is neither in the program nor in a file"),
    ("T9 M6", 3, "give it with --tools"),
    ("M100", 3, "Unknown m code"),
    ("o<wrong> call", 3, "wrong.ngc, line 2: LinuxCNC's interpreter says of `G1 Z`:"),
    ("G56 G0 X0 Y0", 3, "where G56 lies"),
    ("G30", 3, "G30 = [x, y, z, a, b]"),
    ("G43 H1\nG53 G0 Z1", 4, "G49 before this line"),
    ("G43 H1\nG1 X5 F100", 4, "all of X Y Z"),
    ("G38.2 Z-5 F50", 3, "probe"),
    ("G5.2 X0 Y1 P1 F9\nX1 Y1 P1\nX2 Y2 P1\nG5.3", 6, "splines"),
    ("G1 X5 A10 F100", 3, "`A10` is not supported"),
    ("o1 while [1]\no1 endwhile", 4, "does a loop end?"),
    ("G1 X5 F100 (F 1 2 3) (F 3 2 1)", 3, "a line can set one load only"),
    ("G1 X5 F100", 3, "end it with M2 or M30"),
];

#[test]
#[ignore = "needs LinuxCNC's interpreter, rs274 (Debian: linuxcnc-uspace)"]
fn what_linuxcnc_refuses_is_refused_with_its_line() {
    let folder = Folder::new();
    folder.write("wrong.ngc", "o<wrong> sub\nG1 Z\no<wrong> endsub\n");
    let mut wrong = Vec::new();
    for (text, line, words) in BAD {
        let end = if words.contains("M30") { "" } else { "M2\n" };
        let text = format!("G21 G90 G54\nG0 X0 Y0 Z0\n{text}\n{end}");
        match by_linuxcnc(&folder, &text, &fixed()) {
            Err(failure) if failure.line == Some(*line) && failure.message.contains(words) => {}
            Err(failure) => wrong.push(format!("{text}: {failure}")),
            Ok(_) => wrong.push(format!("{text} is read")),
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The whole command; what it writes is read without LinuxCNC.
#[test]
#[ignore = "needs LinuxCNC's interpreter, rs274 (Debian: linuxcnc-uspace)"]
fn a_program_of_linuxcnc_is_compensated() {
    let folder = Folder::new();
    folder.write("side.ngc", "o<side> sub\nG1 X[#5420+#1] F100 (cut)\no<side> endsub\n");
    let text =
        "%\nG21 G90 G54\nG0 X0 Y0 Z0 M8\n/G0 X50\no<side> call [4] ; F 0 0 -90\nG85 X5 Y1 Z-2 R1\nG80\nG0 Z-5\n%\n";
    let (path, job, out) = (folder.write("p.ngc", text), folder.write("j.toml", JOB), folder.path("out.ngc"));
    let args = ["compensate", "--path", &path, "--job", &job, "--wrench", WRENCH, "--block-delete", "--out", &out];
    assert!(refused(&args)["message"].as_str().unwrap().contains("--interpreter"), "the way out is named");
    let summary = json(&[&args[..], &["--interpreter", &rs274()]].concat());
    let [before, after] = ["error_before_um", "error_after_um"].map(|key| summary[key]["max"].as_f64().unwrap());
    assert!(before > 0.5 && after < 0.01, "{before} µm, {after} µm");
    assert!(summary["reader"].as_str().unwrap().starts_with("LinuxCNC's interpreter, "), "{summary}");
    assert!(folder.read("report.html").contains("LinuxCNC's interpreter"));
    let written = folder.read("out.ngc");
    for line in [
        "(3: G0 X0 Y0 Z0 M8)",
        "M8",
        "(5: o<side> call [4])",
        "; F 0 0 -90",
        "(side.ngc 2: G1 X[#5420+#1] F100)",
        "(cut)",
    ] {
        assert!(written.lines().any(|l| l == line), "{line}\n{written}");
    }
    assert!(written.lines().next().unwrap().contains("read by LinuxCNC's interpreter"), "{written}");
    assert!(!written.contains("X50"), "{written}");
    let plain = folder.write("again.ngc", &written.replace("pkm-host compensate", "made"));
    json(&["compensate", "--path", &plain, "--job", &job, "--wrench", WRENCH, "--out", &folder.path("again_out.ngc")]);
}

/// What LinuxCNC reads has the same times: turns in G95 need S there too.
#[test]
#[ignore = "needs LinuxCNC's interpreter, rs274 (Debian: linuxcnc-uspace)"]
fn a_turn_in_g95_takes_the_same_time() {
    let folder = Folder::new();
    let start = "G21 G90\nG0 X-205 Y100 Z1120 A0 B-20\n";
    let (out, reader) = (folder.path("out.ngc"), rs274());
    let path = folder.write("p.ngc", &format!("{start}G95 G1 A5 F0.1 S1000 M3\nX-200\nM2\n"));
    let args = ["compensate", "--path", &path, "--wrench", WRENCH, "--interpreter", &reader, "--out", &out];
    json(&args);
    let lines: Vec<String> =
        folder.read("out.ngc").lines().filter(|l| !l.starts_with('(')).map(str::to_owned).collect();
    is_in_g93_and_back(&lines);
    folder.write("p.ngc", &format!("{start}G95 G1 A5 F0.1 M3\nM2\n"));
    let error = refused(&args);
    assert!(error["message"].as_str().unwrap().contains("give S") && error["line"] == 3, "{error}");
}

#[test]
fn without_the_interpreter_nothing_is_written() {
    let folder = Folder::new();
    let (path, other) =
        (folder.write("p.ngc", "G0 X-205 Y0 Z1130 A0 B0\nG1 X-200\nM2\n"), folder.write("other", "#!/bin/sh\n"));
    let before = folder.contents();
    for (program, words) in [
        ("rs274-that-is-not-there", "no such program"),
        (folder.path("none/rs274").as_str(), "No such file"),
        (other.as_str(), "another program"),
    ] {
        let out = folder.path("out.ngc");
        let args = ["compensate", "--path", &path, "--wrench", WRENCH, "--interpreter", program, "--out", &out];
        let error = refused(&args);
        let message = error["message"].as_str().unwrap();
        assert!(message.contains(words) && message.contains("linuxcnc-uspace"), "{message}");
        assert!(error["kind"] == "usage" && error["file"] == program, "{error}");
    }
    assert_eq!(before, folder.contents());
    let sheet = crate::common::fixture("jobs/path.csv");
    let args = ["compensate", "--path", &sheet, "--interpreter", "rs274", "--out", &folder.path("out.csv")];
    assert!(refused(&args)["message"].as_str().unwrap().contains("--interpreter is for G-code"));
}
