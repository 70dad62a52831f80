//! Tool paths: G-code and CSV.

use super::{Kind, Make, Put, Reader};
use crate::common::fixture;

/// Two lines, and the one that is tried is the third.
const START: &str = "G1 X-205 Y0 Z1137 I0 J0 K1\n; cut\n";

#[test]
fn programs() {
    let call = ["compensate", "--path", "BAD", "--wrench", "1,0,-60,0,0,0", "--out", "OUT"];
    Reader { good: START, name: "p.ngc", call: &call, old: "out" }.refuses(PROGRAMS, 40);
}

#[test]
fn cuts_without_a_load() {
    let call = ["compensate", "--path", "BAD", "--out", "OUT"];
    let kinds: &[Kind] = &[("a cut without a load", Put("", ""), ":1: ", "without a load|--wrench")];
    Reader { good: START, name: "p.ngc", call: &call, old: "out" }.refuses(kinds, 1);
}

#[test]
fn sheets() {
    let good = std::fs::read_to_string(fixture("jobs/path.csv")).unwrap();
    let call = ["compensate", "--path", "BAD", "--out", "OUT"];
    Reader { good: &good, name: "p.csv", call: &call, old: "out" }.refuses(SHEETS, 20);
}

/// The program with another line.
macro_rules! line {
    ($line:literal) => {
        Make(|good| format!("{good}{}\n", $line).into_bytes())
    };
}

#[rustfmt::skip] // a kind a line
const PROGRAMS: &[Kind] = &[
    ("empty", Make(|_| Vec::new()), ": ", "expected moves|found none"),
    ("no move", Make(|_| "M3 S100\n".into()), ": ", "expected moves|found none"),
    ("a CSV", Make(|_| "x_mm,y_mm\n1,2\n".into()), ":1: ", "X: expected a number"),
    ("a move without a place", Make(|_| "G0 X1 Y2\n".into()), ":1: ", "all of X Y Z"),
    ("a move without a direction", Make(|_| "G0 X1 Y2 Z3\n".into()), ":1: ", "where the tool points"),
    ("a move of no kind", Make(|_| "X1 Y2 Z3 I0 J0 K1\n".into()), ":1: ", "before any G0 or G1"),
    ("line ends of old", Make(|good| format!("{good}G1 X\n").replace('\n', "\r").into()), ":3: ", "expected a number"),
    ("an arc", line!("G2 X-200 Y5 I9 J0"), ":3: ", "the arc's radius is 9"),
    ("a feed below 0", line!("G1 X-200 F-100"), ":3: ", "F-100: a feed is not below 0"),
    ("turns of an arc", line!("G2 I5 P20000"), ":3: ", "turns from 1 to 10000"),
    ("an arc the other way", line!("G03 X-200 Y5 R-1"), ":3: ", "the arc's ends are"),
    ("inches", line!("G20 G1 Z60"), ":3: ", "beyond its"),
    ("increments", line!("G91 G1 Z400"), ":3: ", "beyond its"),
    ("inverse time", line!("G93 G1 X-200"), ":3: ", "F is missing"),
    ("a coordinate system", line!("G54"), ":3: ", "--job"),
    ("a shift of coordinates", line!("G92 X0"), ":3: ", "right after a cut"),
    ("a length of the tool", line!("G43 H1"), ":3: ", "--tools"),
    ("a radius of the tool", line!("G41 D1"), ":3: ", "compensation"),
    ("a reference point", line!("G28 Z0\nG1 X-200"), ":4: ", "all of X Y Z"),
    ("a canned cycle", line!("G81 X-200 Z3"), ":3: ", "expected R"),
    ("a spline", line!("G5 X-200"), ":3: ", "splines"),
    ("another axis", line!("G1 X-200 C10"), ":3: ", "`C10` is not supported"),
    ("two kinds of direction", line!("G1 X-200 A10"), ":3: ", "I J K and A B"),
    ("a word twice", line!("G1 X-200 X-201"), ":3: ", "duplicate X"),
    ("two motions", line!("G0 G1 X-200"), ":3: ", "second motion"),
    ("a pause in a move", line!("G4 P1 X-200"), ":3: ", "G4 with a move"),
    ("a word without a number", line!("G1 X"), ":3: ", "X: expected a number, found ``"),
    ("two points", line!("G1 X1.2.3"), ":3: ", "X: expected a number"),
    ("two signs", line!("G1 X--12"), ":3: ", "X: expected a number"),
    ("a decimal comma", line!("G1 X-200,5"), ":3: ", "found `,`"),
    ("a minus of typography", line!("G1 X\u{2212}200"), ":3: ", "X: expected a number"),
    ("an exponent", line!("G1 X-2.0e2"), ":3: ", "`E2` is not supported"),
    ("NaN", line!("G1 Xnan"), ":3: ", "X: expected a number, found `nan`"),
    ("a million digits", Make(|good| format!("{good}G1 X{}\n", "9".repeat(1_000_000)).into()), ":3: ", "X: expected a"),
    ("a million digits behind the point", Make(|good| format!("{good}G1 Z2000.{}\n", "9".repeat(1_000_000)).into()), ":3: ", "beyond its"),
    ("10 MB of letters", Make(|good| format!("{good}{}\n", "X".repeat(10_000_000)).into()), ":3: ", "X: expected a number"),
    ("10 MB of comment", Make(|good| format!("{good}({}\n", "x".repeat(10_000_000)).into()), ":3: ", "not closed"),
    ("10 MB of words", Make(|good| format!("{good}{}\n", "G1".repeat(5_000_000)).into()), ":3: ", "second motion"),
    ("a parameter without a value", line!("G1 X#1"), ":3: ", "#1 has no value"),
    ("an expression without an end", line!("G1 X[1+2"), ":3: ", "`]` is missing"),
    ("an assignment without brackets", line!("#1=2+3"), ":3: ", "stands in brackets"),
    ("a subroutine", line!("O100 sub"), ":3: ", "`O100 endsub` is missing"),
    ("an unknown subprogram", line!("M98 P7"), ":3: ", "O7 is not in this file"),
    ("a subprogram in itself", line!("M98 P7\nM30\nO7\nM98 P7\nM99"), ":6: ", "inside each other"),
    ("a main program without end", line!("M99"), ":3: ", "without end"),
    ("an unclosed comment", line!("G1 X-200 (open"), ":3: ", "not closed"),
    ("a comment of another language", line!("// G1 X-200"), ":3: ", "found `/`"),
    ("Siemens' own language", line!("G3 X10 Y5 CR=5"), ":3: ", "have the CAM system write DIN/ISO"),
    ("Heidenhain's Klartext", line!("L X+10 Y+5 R0 FMAX"), ":3: ", "have the CAM system write DIN/ISO"),
    ("a chamfer of Fanuc", line!("G1 X-200 ,C1."), ":3: ", "chamfers and roundings"),
    ("block delete within a line", line!("N10 /G1 X-200"), ":3: ", "has to begin its line"),
    ("comments in comments", line!("(TOOL (10 MM))"), ":3: ", "do not nest"),
    ("waiting for an input", line!("M66 P0 L3 Q5"), ":3: ", "`M66` is not supported"),
    ("a load by M67", line!("M67 E0 Q10"), ":3: ", "compensated twice"),
    ("a return to a line", line!("M99 P20"), ":3: ", "write M99 alone"),
    ("a limit of the spindle", line!("G92 S3000"), ":3: ", "a limit of the spindle's speed"),
    ("a tool's radius by D", line!("G1 X-200 D1"), ":3: ", "D is a tool's radius"),
    ("a number without a letter", line!("G1 -200"), ":3: ", "found `-`"),
    ("a line number behind", line!("X-200 N10"), ":3: ", "N first"),
    ("a word of nothing", line!("P3"), ":3: ", "`P3`"),
    ("a motion that was ended", line!("G80 X-200"), ":3: ", "after G80"),
    ("no direction", line!("G1 I0 J0 K0"), ":3: ", "no direction"),
    ("a direction about", line!("G1 K-1"), ":3: ", "180°"),
    ("half a load", line!("(wrench 1,2,3)"), ":3: ", "six numbers"),
    ("a load that is no number", line!("; wrench 1,2,3,4,5,x"), ":3: ", "six numbers"),
    ("a load without end", line!("(wrench 1,2,3,4,5,1e999)"), ":3: ", "six numbers"),
    ("out of travel", line!("G1 Z1400"), ":3: ", "beyond its"),
    ("metres", line!("G1 X-0.205 Y0 Z1.137"), ":3: ", "beyond its"),
    ("far away", line!("G1 X-9 Z999999999999"), ":3: ", "within ±1e9"),
    ("beyond any machine", line!("G1 Z99999999"), ":3: ", "within ±1e7"),
    ("an arc of too many parts", line!("G2 X-205 Y0 I9e5 J0 P9000"), ":3: ", "--chord-mm"),
    ("a cycle of too many moves", line!("G83 X-205 Z1 R0 Q0.001 L9999"), ":3: ", "moves in one line"),
    ("beyond all steps", line!("G1 X-9999999 Z9999999"), ": ", "steps"),
];

#[rustfmt::skip] // a kind a line
const SHEETS: &[Kind] = &[
    ("empty", Make(|_| Vec::new()), ":1: ", "header"),
    ("G-code", Make(|_| "G1 X-205 Y0 Z1137 I0 J0 K1\n".into()), ":1: ", "commas or semicolons"),
    ("metres", Put("z_mm", "z_m"), ":4: z_m: ", "did you mean `z_mm`?"),
    ("no force", Put(",fz_n", ",note"), ":4: fz_n: ", "missing column"),
    ("no axis", Put(",k,", ",note,"), ":4: k: ", "missing column"),
    ("an axis twice", Put(",k,", ",j,"), ":4: j: ", "duplicate"),
    ("wrist's joints for an axis", Put(",i,j,k,", ",a,b,c,"), ":4: a: ", "did you mean `i`?"),
    ("NaN", Put("-205.000,-20.000", "-205.000,nan"), ":5: y_mm: ", "number"),
    ("nothing", Put("-205.000,-20.000", "-205.000,"), ":5: y_mm: ", "empty cell"),
    ("a cell too many", Put("-205.000,-20.000", "-205.000,-20.000,0"), ":5: ", "expected 12 cells as in the header, found 13"),
    ("a cell too few", Put("-205.000,-20.000", "-205.000"), ":5: ", "expected 12 cells as in the header, found 11"),
    ("no direction", Put("0.000000,-0.069756,0.997564", "0,0,0"), ":5: ", "no direction"),
    ("a direction about", Put("-0.069756,0.997564", "-0.069756,-0.997564"), "", "beyond its travel"),
    ("out of travel", Put("1140.000", "1640.000"), ":5: ", "mm beyond its travel"),
    ("metres in a cell", Put("-205.000,-20.000,1140.000", "-0.205,-0.020,1.140"), ":5: ", "no configuration"),
    ("a million digits", Make(|good| good.replacen("-20.000", &"9".repeat(1_000_000), 1).into()), ":5: y_mm: ", "number"),
    ("a load far beyond", Put("-60.0,140.0", "-60e6,140e6"), ":5: ", "of it would remain"),
    ("a load beyond all numbers", Put("-60.0,140.0", "-60e300,140e300"), ":5: fx_n: ", "load within|-6e301"),
];
