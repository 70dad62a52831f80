use super::*;
use crate::head::Head;
use crate::source::Source;
use crate::tools::Tools;

/// What `rs274` prints before the first line of a program.
const BEGIN: &str = "    1 N..... USE_LENGTH_UNITS(CANON_UNITS_MM)
    2 N..... SET_G5X_OFFSET(1, 0.000000000, 0.000000000, 0.000000000, 0.000000000, 0.000000000, 0.000000000)
    3 N..... SET_G92_OFFSET(0.000000000, 0.000000000, 0.000000000, 0.000000000, 0.000000000, 0.000000000)
    4 N..... SET_XY_ROTATION(0.000000000)
    5 N..... SET_FEED_REFERENCE(CANON_XYZ)
    6 N..... ON_RESET()
    7 N..... STRAIGHT_TRAVERSE(100000000.000000000, 100000000.000000000, 100000000.000000000, 100000000.000000000, 100000000.000000000, 100000000.000000000)
    8 N..... COMMENT(\"interpreter: motion mode set to none\")
";
const HEAD: &str = "G17 G21 G40 G49 G80 G90 G91.1 G94\n";
const FAR: &str = "100000000.000000000";

fn setup() -> Setup {
    let tools = "format = 1\n[[tool]]\nnumber = 7\nlength_mm = 10\ndiameter_mm = 4\n[[tool]]\nnumber = 8\nlength_mm = 10\n\
        [[tool]]\nnumber = 9\nlength_mm = 0\n";
    let tools = Tools::parse(&Source::from_text("t.toml", tools.to_owned())).unwrap();
    let offsets = ProgramOffsets {
        frames_mm: [Some([1.0, 2.0, 3.0]), None, None, None, None, None, None, None, None],
        references: [Some([5.0, 6.0, 7.0, 0.0, 0.0]), None],
    };
    Setup { tools, offsets, head: Some(Head::Fixed([0.0, 0.0, 1.0])), ..Setup::default() }
}

/// The program in plain words of lines and of what is printed of each: `@` and the line's number, then the calls.
fn expanded(files: &[&str], calls: &str) -> Result<Expanded, String> {
    let files: Vec<File<'_>> = files
        .iter()
        .enumerate()
        .map(|(n, text)| File { name: format!("file{n}.ngc"), lines: text.lines().collect() })
        .collect();
    let setup = setup();
    let mut canonical = Canonical::new(&setup, &files);
    for line in BEGIN.lines() {
        canonical.take(line).unwrap();
    }
    for line in calls.lines().map(|l| l.replace("FAR", FAR)) {
        let line = match line.strip_prefix('@') {
            Some(at) => format!("    9 N..... COMMENT(\"{}\")", mark_text(at)),
            None => format!("   10 N50    {line}"),
        };
        canonical.take(&line).map_err(|why| format!("{}: {}{why}", canonical.line, canonical.place()))?;
    }
    Ok(canonical.finish())
}

/// `@2` is line 2 of the program, `@1:2` of its first file of subroutines.
fn mark_text(at: &str) -> String {
    let (file, line) = at.split_once(':').unwrap_or(("0", at));
    let mark = mark(file.parse().unwrap(), line.parse::<usize>().unwrap() - 1);
    mark[1..mark.len() - 1].to_owned()
}

#[test]
fn calls_become_plain_words_behind_the_line_that_made_them() {
    let program = "G54 G0 X[#1] (go) ; F 1 2 3\nT7 M6\ng43\nG1 Z5 S100 M3 F20 (MSG, x)\no<sub> call [3]\nG85 X1\nM30";
    let calls = "\
@1
COMMENT(\"interpreter: continuing to use same coordinate system\")
COMMENT(\"go\")
STRAIGHT_TRAVERSE(1.500000000, 2.000000000, 99999997.000000000, FAR, FAR, FAR)
@2
SELECT_TOOL(7)
START_CHANGE()
STOP_SPINDLE_TURNING(0)
CHANGE_TOOL(1)
@3
USE_TOOL_LENGTH_OFFSET(0.000000000 0.000000000 10.000000000, 0.000000000 0.000000000 0.000000000, 0.000000000 0.000000000 0.000000000)
@4
MESSAGE(\" x\")
SET_SPINDLE_SPEED(0, 100.000000000)
START_SPINDLE_CLOCKWISE(0)
SET_FEED_RATE(20.000000000)
STRAIGHT_FEED(1.500000000, 2.000000000, 5.000000000, FAR, FAR, FAR)
@5
@1:2
STRAIGHT_FEED(3.000000000, 2.000000000, 5.000000000, FAR, FAR, FAR)
ARC_FEED(5.000000000, 2.000000000, 4.000000000, 2.000000000, -2, 6.000000000, FAR, FAR, FAR)
@6
SET_MOTION_CONTROL_MODE(CANON_EXACT_PATH)
STRAIGHT_TRAVERSE(1.000000000, 2.000000000, 6.000000000, FAR, FAR, FAR)
STRAIGHT_TRAVERSE(1.000000000, 2.000000000, 6.000000000, FAR, FAR, FAR)
DWELL(0.500000000)
SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.000000)
SET_NAIVECAM_TOLERANCE(0.000000000)
@7
SET_G5X_OFFSET(1, 1.000000000, 2.000000000, 3.000000000, 0.000000000, 0.000000000, 0.000000000)
STOP_SPINDLE_TURNING(0)
PALLET_SHUTTLE()
PROGRAM_END()
ON_RESET()
";
    let found = expanded(&[program, "o<sub> sub\nG2 X#1"], calls).unwrap();
    let text = "(1: G54 G0 X[#1])\n(go) ; F 1 2 3\nG54\nG0 X1.5 Y2\n(2: T7 M6)\nT7\nM5\nM6\n(3: g43)\nG43 H7\n(4: G1 Z5 S100 M3 F20)\n(MSG, x)\n\
                S100\nM3\nG1 X1.5 Y2 Z5 F20\n(5: o<sub> call [3])\n(file1.ngc 2: G2 X#1)\nX3 Y2 Z5\nG2 X5 Y2 Z6 I1 J0 P2\n(6: G85 X1)\n\
                G0 X1 Y2 Z6\nG4 P0.5\n(7: M30)\nM30\n";
    assert_eq!(found.text, format!("{HEAD}{text}"));
    let lines = [1, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 4, 4, 4, 4, 4, 5, 5, 5, 5, 6, 6, 6, 7, 7];
    assert_eq!(found.lines, lines);
}

/// Offsets on top of the work frame and its turn are in the new coordinates; the frame itself is the control's.
#[test]
fn frames_are_named_and_what_lies_on_them_is_written_out() {
    let calls = "\
@1
SET_G5X_OFFSET(1, 4.000000000, 2.000000000, 3.000000000, 0.000000000, 0.000000000, 0.000000000)
SET_XY_ROTATION(90.000000000)
STRAIGHT_TRAVERSE(10.000000000, 1.000000000, 5.000000000, FAR, FAR, FAR)
@2
SET_G92_OFFSET(2.000000000, 0.000000000, -1.000000000, 0.000000000, 0.000000000, 0.000000000)
STRAIGHT_FEED(10.000000000, 1.000000000, 5.000000000, FAR, FAR, FAR)
ARC_FEED(10.000000000, 3.000000000, 10.000000000, 2.000000000, 1, 5.000000000, FAR, FAR, FAR)
@3
SET_G92_OFFSET(0.000000000, 0.000000000, 0.000000000, 0.000000000, 0.000000000, 0.000000000)
SET_XY_ROTATION(0.000000000)
SET_G5X_OFFSET(2, 0.000000000, 1.000000000, 0.000000000, 0.000000000, 0.000000000, 0.000000000)
USE_LENGTH_UNITS(CANON_UNITS_INCHES)
SELECT_PLANE(CANON_PLANE_XZ)
STRAIGHT_TRAVERSE(1.000000000, 0.000000000, 2.000000000, FAR, FAR, FAR)
ARC_FEED(2.500000000, 1.000000000, 2.250000000, 1.000000000, 1, 0.000000000, FAR, FAR, FAR)
";
    let found = expanded(&["G10\nG92\nG55 G20"], calls).unwrap().text;
    let words: Vec<&str> = found.lines().filter(|l| !l.starts_with('(')).collect();
    let moves: Vec<Vec<f64>> = words
        .iter()
        .map(|l| l.split(' ').filter(|w| "XYZIJK".contains(&w[..1])).map(|w| w[1..].parse().unwrap()).collect())
        .collect();
    let expected: [(usize, &[f64]); 4] = [
        (3, &[-1.0, 10.0, 5.0]),
        (4, &[-1.0, 12.0, 4.0]),
        (5, &[-3.0, 12.0, 4.0, -1.0, 0.0]),
        (11, &[1.0, 0.0, 2.5, 0.25, 0.0]),
    ];
    for (line, numbers) in expected {
        assert!(
            moves[line].len() == numbers.len() && moves[line].iter().zip(numbers).all(|(a, b)| (a - b).abs() < 1e-9),
            "{} {numbers:?}",
            words[line]
        );
    }
    assert_eq!(words.len(), 12);
    assert_eq!(words[1..3], ["G10 L2 P1 X4 Y2 Z3", "G54"]);
    assert_eq!(words[6..11], ["G10 L2 P2 X0 Y1 Z0", "G55", "G20", "G18", "G0 X1 Y0 Z2"]);
    assert!(words[5].starts_with("G3 ") && words[5].ends_with(" P1"), "{}", words[5]);
    assert!(words[11].starts_with("G3 X1 Y0 Z2.5 K"), "{}", words[11]);
}

/// LinuxCNC's tools point down: a height that the program does not give after another tool length is not known here.
#[test]
fn a_height_that_a_tool_length_implies_is_not_known() {
    let calls = "\
@1
STRAIGHT_TRAVERSE(1.000000000, 2.000000000, 3.000000000, FAR, FAR, FAR)
USE_TOOL_LENGTH_OFFSET(0.000000000 0.000000000 10.000000000, 0.000000000 0.000000000 0.000000000, 0.000000000 0.000000000 0.000000000)
STRAIGHT_TRAVERSE(5.000000000, 2.000000000, -7.000000000, FAR, FAR, FAR)
STRAIGHT_TRAVERSE(5.000000000, 2.000000000, 4.000000000, FAR, FAR, FAR)
USE_TOOL_LENGTH_OFFSET(0.000000000 0.000000000 0.000000000, 0.000000000 0.000000000 0.000000000, 0.000000000 0.000000000 0.000000000)
STRAIGHT_FEED(6.000000000, 2.000000000, 14.000000000, FAR, FAR, FAR)
";
    let (calls, off) = calls.split_at(calls.rfind("USE_TOOL").unwrap());
    let found = |word: &str| expanded(&[&format!("G43 H7\n{word}")], &format!("{calls}@2\n{off}")).unwrap().text;
    let expected = "(1: G43 H7)\nG0 X1 Y2 Z3\nG43 H7\nX5 Y2\nX5 Y2 Z4\n";
    assert_eq!(found("G49"), format!("{HEAD}{expected}(2: G49)\nG49\nG1 X6 Y2\n"));
    // a tool without length here may have one in the control's own table
    assert_eq!(found("G43 H9"), format!("{HEAD}{expected}(2: G43 H9)\nG43 H9\nG1 X6 Y2\n"));
}

#[test]
fn words_that_move_nothing_pass() {
    for (line, calls, words) in [
        (
            "G64 P0.1",
            "SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.100000)\nSET_NAIVECAM_TOLERANCE(0.200000000)",
            "G64 P0.1 Q0.2",
        ),
        ("G64", "SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.000000)\nSET_NAIVECAM_TOLERANCE(0.000000000)", "G64"),
        ("G61.1", "SET_MOTION_CONTROL_MODE(CANON_EXACT_STOP)", "G61.1"),
        ("G61", "SET_MOTION_CONTROL_MODE(CANON_EXACT_PATH)", "G61"),
        ("G95 F1", "SET_FEED_MODE(0, 1)\nSET_FEED_RATE(0.000000000)", "G95"),
        ("M4", "START_SPINDLE_COUNTERCLOCKWISE(0)", "M4"),
        ("M7 M8", "MIST_ON()\nFLOOD_ON()", "M7\nM8"),
        ("M9", "MIST_OFF()\nFLOOD_OFF()", "M9"),
        ("M0", "PROGRAM_STOP()", "M0"),
        ("M1", "OPTIONAL_PROGRAM_STOP()", "M1"),
        ("M49", "DISABLE_FEED_OVERRIDE()\nDISABLE_SPEED_OVERRIDE(0)", "M50 P0\nM51 P0"),
        ("M48", "ENABLE_FEED_OVERRIDE()\nENABLE_SPEED_OVERRIDE(0)", "M50 P1\nM51 P1"),
        ("M64 P3", "SET_AUX_OUTPUT_BIT(3)", "M64 P3"),
        ("(LOGOPEN,a.txt)", "LOGOPEN(\"a.txt\")\nLOG(\" 1\")\nLOGCLOSE()", "(LOGOPEN,a.txt)\n(LOG, 1)\n(LOGCLOSE)"),
    ] {
        let found = expanded(&[line], &format!("@1\n{calls}\n")).unwrap().text;
        let note = if line.starts_with('(') { String::new() } else { format!("(1: {line})\n") };
        assert_eq!(found, format!("{HEAD}{note}{words}\n"));
    }
}

#[test]
fn what_has_no_part_in_a_compensated_program_is_refused() {
    let known = "STRAIGHT_TRAVERSE(1.0, 2.0, 3.0, FAR, FAR, FAR)\n";
    let long = "USE_TOOL_LENGTH_OFFSET(0.0 0.0 10.0, 0.0 0.0 0.0, 0.0 0.0 0.0)\nSTRAIGHT_TRAVERSE(1.0, 2.0, 4.0, FAR, FAR, FAR)\n";
    for (line, calls, words) in [
        ("G5.2", "NURBS_FEED(3, ...)".to_owned(), "splines"),
        ("G38.2", "TURN_PROBE_ON()".to_owned(), "probe"),
        ("G33", "START_SPEED_FEED_SYNC(1.000000,0)".to_owned(), "coupled to the spindle"),
        ("G33.1", "RIGID_TAP(1.0, 2.0, 3.0, 1.0)".to_owned(), "coupled to the spindle"),
        ("G84 R2", "STRAIGHT_FEED(1.0, 2.0, -5.0, FAR, FAR, FAR)".to_owned(), "coupled to the spindle"),
        ("g74 r2", "STRAIGHT_FEED(1.0, 2.0, -5.0, FAR, FAR, FAR)".to_owned(), "coupled to the spindle"),
        ("G96 D9", "SET_SPINDLE_MODE(0 1000.000000000)".to_owned(), "G97"),
        ("M3 $1", "START_SPINDLE_CLOCKWISE(1)".to_owned(), "other spindles"),
        ("M66", "WAIT(0, 1, 0, 0.0)".to_owned(), "not supported (WAIT"),
        ("M60", "PALLET_SHUTTLE()".to_owned(), "not supported (PALLET_SHUTTLE"),
        ("M68 E1 Q2.5", "SET_AUX_OUTPUT_VALUE(1,2.500000)".to_owned(), "compensated twice"),
        ("M61 Q1", "CHANGE_TOOL_NUMBER(1)".to_owned(), "not supported"),
        ("G10 L1", "SET_TOOL_TABLE_ENTRY(1, 1, 0.0 0.0 0.2)".to_owned(), "--tools"),
        ("G43.1", "USE_TOOL_LENGTH_OFFSET(0.0 0.0 5.0, 0.0 0.0 0.0, 0.0 0.0 0.0)".to_owned(), "no tool of --tools"),
        ("G43.1", "USE_TOOL_LENGTH_OFFSET(1.0 0.0 10.0, 0.0 0.0 0.0, 0.0 0.0 0.0)".to_owned(), "along Z"),
        (
            "G41 D7",
            "COMMENT(\"interpreter: cutter radius compensation on left\")".to_owned(),
            "the diameter of every tool",
        ),
        ("G10 L2 A1", "SET_G5X_OFFSET(1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)".to_owned(), "rotary axes"),
        ("G56", format!("SET_G5X_OFFSET(3, {FAR}, {FAR}, {FAR}, 0.0, 0.0, 0.0)"), "where G56 lies"),
        ("G17.1", "SELECT_PLANE(CANON_PLANE_UV)".to_owned(), "CANON_PLANE_UV"),
        ("G30", known.to_owned(), "G30 = [x, y, z, a, b]"),
        (
            "G[20+8]",
            format!("{known}STRAIGHT_TRAVERSE(1.0, 2.0, FAR, FAR, FAR, FAR)"),
            "Z goes to a place that is not known",
        ),
        ("G53 X1", format!("{known}{long}"), "G49 before this line"),
        ("G1 X#1", "STRAIGHT_FEED(nan, 2.0, 3.0, 0.0, 0.0, 0.0)".to_owned(), "expected 6 numbers"),
        ("G1", "STRAIGHT_FEED(1.0)".to_owned(), "expected 6 numbers"),
    ] {
        let failure = expanded(&["G21", line], &format!("@1\n{known}@1:1\n{calls}\n")).map(|_| ()).unwrap_err();
        assert!(failure.starts_with("1: file1.ngc, line 1: ") && failure.contains(words), "{line}: {failure}");
    }
    // compensation by a radius that the line gives needs no table
    assert!(expanded(&["G41.1 D4"], "@1\nCOMMENT(\"interpreter: cutter radius compensation on left\")").is_ok());
}
