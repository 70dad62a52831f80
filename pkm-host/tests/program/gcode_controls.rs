//! What a control makes of a line where something else would be as near: times of moves, tools in hand, where a program ends.

use serde_json::Value;

use crate::common::{Folder, fixture, json, refused};

const START: &str = "G21 G90 G94\nG0 X-205 Y0 Z1130 A0 B0\n";
const WRENCH: &str = "100,50,-300,0,0,1";
const TOOLS: &str = "format = 1\n[material]\nkc1_1_n_per_mm2 = 1500\nmc = 0.25\nu_rel = 0.2\n\
    [[tool]]\nnumber = 1\nlength_mm = 10\ndiameter_mm = 10\nkind = \"mill\"\nteeth = 2\ndepth_mm = 2\nwidth_mm = 5\nside = \"climb\"\n\
    [[tool]]\nnumber = 2\nlength_mm = 25.5\ndiameter_mm = 6\nkind = \"drill\"\nteeth = 2\n";

/// A program compensated: the summary, and its lines without comments.
fn compensated(program: &str, args: &[&str]) -> (Value, Vec<String>) {
    let folder = Folder::new();
    let (path, out) = (folder.write("p.ngc", program), folder.path("out.ngc"));
    let tools = folder.write("tools.toml", TOOLS);
    let summary = json(&[&["compensate", "--path", &path, "--out", &out, "--tools", &tools], args].concat());
    let lines = folder.read("out.ngc").lines().filter(|l| !l.starts_with('(')).map(str::to_owned).collect();
    (summary, lines)
}

/// Why a program is refused, and in which line.
fn why(program: &str) -> (String, u64) {
    let folder = Folder::new();
    let (path, out) = (folder.write("p.ngc", program), folder.path("out.ngc"));
    let tools = folder.write("tools.toml", TOOLS);
    let error = refused(&["compensate", "--path", &path, "--out", &out, "--tools", &tools, "--wrench", WRENCH]);
    (error["message"].as_str().unwrap().to_owned(), error["line"].as_u64().unwrap())
}

/// The number behind a letter.
fn word(line: &str, letter: char) -> Option<f64> {
    line.split_whitespace().find_map(|w| w.strip_prefix(letter)?.parse().ok())
}

/// F of a cut that only turns the tool is °/min. The compensated tip moves a little beside, and a control would take F as mm/min: the
/// turn would be over at once. So its parts say their time.
#[test]
fn a_turn_takes_the_time_that_its_feed_says() {
    let (_, lines) = compensated(&format!("{START}G1 A10 F100\nX-200 F200\n"), &["--wrench", WRENCH]);
    let begin = lines.iter().position(|l| l.contains("G93")).unwrap();
    let end = lines.iter().position(|l| l == "G94 F100").unwrap();
    let times: Vec<f64> = lines[begin..end].iter().map(|l| 1.0 / word(l, 'F').unwrap()).collect();
    // the first goes to where the load begins
    assert_eq!(times.len(), 11, "{lines:#?}");
    assert!((times[1..].iter().sum::<f64>() - 10.0 / 100.0).abs() < 1e-5, "{times:?}");
    assert!(lines[end + 1..].iter().all(|l| !l.contains("G93")) && lines[end + 1].contains("F200"), "{lines:#?}");
    // in inches F of a turn is the same
    let inches = "G20 G90 G94\nG0 X-8 Y0 Z44.5 A0 B0\nG1 A10 F100\n";
    let (_, lines) = compensated(inches, &["--wrench", WRENCH]);
    assert!(lines.iter().any(|l| l == "G94 F100"), "{lines:#?}");
    // without a load the tip stays, and so does the line
    let (_, lines) = compensated(&format!("{START}G1 A10 F100\n"), &["--wrench", "0,0,0,0,0,0"]);
    assert!(lines.iter().all(|l| !l.contains("G93")), "{lines:#?}");
}

/// In G93 the parts of a cut take its time together; the way to where the load begins is no part of it.
#[test]
fn parts_in_g93_take_the_time_of_the_whole() {
    let (_, lines) = compensated(&format!("{START}G93\nG1 X-200 F10\nX-199 F10\n"), &["--wrench", WRENCH]);
    let cuts: Vec<(f64, f64)> = lines.iter().filter_map(|l| Some((word(l, 'X')?, 1.0 / word(l, 'F')?))).collect();
    let [first, second]: [f64; 2] = [-200.5, -198.5].map(|end| {
        let of_cut = |x: f64| x > end - 4.4 && x < end + 0.6 && (end < -200.0 || x > -199.5);
        cuts.iter().filter(|(x, _)| of_cut(*x)).map(|(_, minutes)| minutes).sum()
    });
    assert!((first - 0.1).abs() < 1e-6 && (second - 0.1).abs() < 1e-6, "{first} {second}: {cuts:?}");
    // the first place is some micrometres away, and reached at the feed of the cut
    let (x, minutes) = cuts[0];
    assert!(x < -204.9 && minutes < 0.01 * 0.1, "{cuts:?}");
}

/// Minutes of the lines in G93, of the first the way to where the load begins.
fn minutes_in_g93(lines: &[String]) -> Vec<f64> {
    let begin = lines.iter().position(|l| l.contains("G93")).unwrap();
    let is_cut = |l: &&String| l.contains('X') && l.contains('F');
    lines[begin..]
        .iter()
        .take_while(|l| !l.contains("G94") && !l.contains("G95"))
        .filter(is_cut)
        .map(|l| 1.0 / word(l, 'F').unwrap())
        .collect()
}

/// The tip of a cut that only turns goes half a micrometre a degree: as fast as that the way to where it begins took 95 s.
#[test]
fn the_way_to_a_turn_takes_no_longer_than_the_turn() {
    let start = "G21 G90\nG0 X-205 Y100 Z1120 A0 B-20\n";
    let side = "0,0,-400,0,0,0";
    let found = |cuts: &str, minutes: f64, wrench: &str| {
        let (_, lines) = compensated(&format!("{start}{cuts}M2\n"), &["--wrench", wrench]);
        let times = minutes_in_g93(&lines);
        let turn: f64 = times[1..].iter().sum();
        assert!((turn - minutes).abs() < 1e-4 * minutes, "{cuts}: {times:?}");
        assert!(times[0] > 0.001 * minutes && times[0] <= minutes * (1.0 + 1e-6), "{cuts}: {times:?}");
    };
    found("G1 A5 F100\n", 0.05, side);
    found("G93 G1 A5 F20\n", 0.05, side);
    found("S1000 M3\nG95 G1 A5 F0.1\n", 0.05, side);
    // a turn that is small beside what a load does
    found("G1 A0.2 F100\n", 0.002, "0,0,-4000,0,0,0");
    found("G93 G1 A0.2 F500\n", 0.002, "0,0,-4000,0,0,0");
    // the tip goes a little as the program says
    found("G93 G1 X-205.001 A5 F20\n", 0.05, side);
    // the load changes in mid-program
    found("G1 X-203 F200\n(wrench 0,0,-900,0,0,0)\nG1 A5 F100\n", 0.05, side);
    found("G1 X-203 F200\n(wrench 0,0,-900,0,0,0)\nG93 G1 A5 F20\n", 0.05, side);
}

/// A turn of 5° at 0.1° a turn of the spindle and 1000 of these a minute; the cut behind is in G95 again.
pub(crate) fn is_in_g93_and_back(lines: &[String]) {
    let times = minutes_in_g93(lines);
    assert!(times.len() == 6 && (times[1..].iter().sum::<f64>() - 0.05).abs() < 1e-5, "{lines:#?}");
    let [begin, back] = ["G93", "G95 F0.1"].map(|w| lines.iter().position(|l| l.contains(w)).unwrap());
    assert!(lines[begin..back].iter().all(|l| !l.contains("G95")), "{lines:#?}");
    assert!(lines[back + 1..].iter().all(|l| !l.contains("G93") && !l.contains('F')), "{lines:#?}");
}

/// F of G95 is degrees a turn of the spindle where only the tool turns: the same as in G94 with S.
#[test]
fn a_turn_in_g95_takes_the_time_that_s_says() {
    let start = "G21 G90\nG0 X-205 Y100 Z1120 A0 B-20\n";
    let (_, lines) = compensated(&format!("{start}G95 G1 A5 F0.1 S1000 M3\nX-200\nM2\n"), &["--wrench", WRENCH]);
    is_in_g93_and_back(&lines);
    // in inches F of a turn is the same
    let inches = "G20 G90 G95\nG0 X-8 Y0 Z44.5 A0 B0\nG1 A5 F0.1 S1000 M3\n";
    let (_, lines) = compensated(inches, &["--wrench", WRENCH]);
    let times = minutes_in_g93(&lines);
    assert!(
        (times[1..].iter().sum::<f64>() - 0.05).abs() < 1e-5 && lines.iter().any(|l| l == "G95 F0.1"),
        "{lines:#?}"
    );
    // without S the time is not known, nor with S0
    for speed in ["", "S1000 M3\nS0\n"] {
        let (message, line) = why(&format!("{start}{speed}G95 G1 A5 F0.1 M3\nM2\n"));
        assert!(message.contains("G95") && message.contains("give S") && message.contains("G94"), "{message}");
        assert_eq!(line, 3 + speed.lines().count() as u64);
    }
    // what has no load, or goes, needs none
    for (cut, wrench) in [("A5", "0,0,0,0,0,0"), ("X-204 A5", WRENCH)] {
        let (_, lines) = compensated(&format!("{start}G95 G1 {cut} F0.1 M3\nM2\n"), &["--wrench", wrench]);
        assert!(lines.iter().all(|l| !l.contains("G93")) && lines.iter().any(|l| l.contains("G95")), "{lines:#?}");
    }
}

#[test]
fn a_tool_is_in_hand_from_m6_on() {
    let cut = "S3000 M3\nG0 X-205 Y0 Z1130 A0 B0\nG1 Z1132 F100\n";
    let of = |change: &str| compensated(&format!("G21 G90 G94\nT1 M6\n{change}\n{cut}"), &[]).1;
    let numbers = |lines: Vec<String>| -> Vec<String> { lines.into_iter().filter(|l| l.contains('Z')).collect() };
    assert_eq!(numbers(of("T2 M6")), numbers(of("M6 T2")));
    // G43 without H is that of the tool in hand, not of the one that is called next
    let first = numbers(of("G43 H1"));
    assert_eq!(numbers(of("T2\nG43")), first);
    assert_ne!(numbers(of("T2\nG43 H2")), first);
}

/// Of the tools 1 and 2, 10 and 25.5 mm long: what is said of lengths that are not those of the tool in hand.
#[test]
fn a_cut_with_another_length_than_that_of_the_tool_in_hand_is_a_warning() {
    let cut = "G0 X-205 Y0 Z1130 A0 B0\nG1 X-204 F100\nX-203\n";
    let says = |program: &str, words: &[&str]| {
        let (summary, _) = compensated(program, &["--wrench", WRENCH]);
        let mut said = summary["warnings"].as_array().unwrap().iter().filter_map(Value::as_str).collect::<Vec<_>>();
        said.retain(|warning| !warning.contains("the load of the tool before"));
        assert!(
            said.len() == words.len() && said.iter().zip(words).all(|(s, w)| s.contains(w)),
            "{program}: {said:#?}"
        );
    };
    let no_length = "p.ngc:3: T2 (line 1) is 25.5 mm long";
    says(&format!("T2 M6\n{cut}"), &[no_length]);
    says(&format!("T2\n{cut}"), &[no_length]);
    says(&format!("T2 M6\n{cut}T1 M6\n{cut}"), &[no_length, "p.ngc:7: T1 (line 5) is 10 mm long"]);
    says(&format!("T2 M6\nG43 H0\n{cut}"), &["p.ngc:4: T2 (line 1) is 25.5 mm long"]);
    says(&format!("T2 M6\nG43 H2\n{cut}G49\n{cut}"), &["p.ngc:8: T2 (line 1) is 25.5 mm long"]);
    says(
        &format!("T1 M6\nG43 H2\n{cut}"),
        &["p.ngc:4: H2 (line 2), 25.5 mm long, is not the tool in hand at this cut, which is T1"],
    );
    // nothing is wrong with these: a T calls the next tool; no tool, or one that the table does not have; coordinates of the machine
    let changed = format!("T2\nG49\nM6\nG43 H2\n{cut}");
    says(&format!("T1 M6\nG43 H1\n{cut}{changed}"), &[]);
    says(&format!("T1\nG43 H2\n{cut}{changed}"), &[]);
    says(cut, &[]);
    says(&format!("T9 M6\n{cut}"), &[]);
    says("T2 M6\nG0 X-205 Y0 Z1130 A0 B0\nG1 G53 X-204 Y0 Z1130 F100\n", &[]);
}

#[test]
fn a_comment_sets_the_load_with_a_blank_before_it() {
    let said =
        |comment: &str| compensated(&format!("{START}{comment}\nG1 X-200 F100\n"), &["--wrench", "0,0,-1,0,0,0"]).0;
    let load = "(wrench 0,0,-500,0,0,0)";
    assert_eq!(said(&format!("; {load}"))["error_before_um"], said(load)["error_before_um"]);
    assert_ne!(said("; no load")["error_before_um"], said(load)["error_before_um"]);
}

/// The chords of an arc meet at angles that the joints have to follow: v²/r, which no chord by itself shows.
#[test]
fn joints_are_held_against_their_limits_along_an_arc() {
    let circle = |feed: f64| format!("{START}G17 G2 I1 J0 F{feed}\n");
    let limits = ["--wrench", WRENCH, "--limits", &fixture("jobs/limits.toml")];
    let (fast, _) = compensated(&circle(6000.0), &limits);
    assert_eq!((&fast["feeds_checked"], &fast["too_fast"][0]["line"]), (&Value::from(1), &Value::from(3)));
    let allowed = fast["too_fast"][0]["allowed_per_min"].as_f64().unwrap();
    // three screws of 2000 mm/s² at three points of the circle, by the inverse kinematics at a small step
    let least = least_feed_of_circle();
    assert!((allowed / least - 1.0).abs() < 0.02, "{allowed} mm/min, by finite differences {least}");
    let (slow, _) = compensated(&circle(allowed.floor()), &limits);
    assert_eq!(slow["too_fast"].as_array().map(Vec::len), Some(0));
}

/// The feed around a circle of 1 mm at which a screw reaches 2000 mm/s², by finite differences of the inverse kinematics.
fn least_feed_of_circle() -> f64 {
    let five = &crate::common::FIVE;
    let lengths = |angle: f64| {
        let tip_m = [-0.204 + 1e-3 * angle.cos(), 1e-3 * angle.sin(), 1.130];
        five.inverse_at(tip_m.into(), [0.0, 0.0].into()).unwrap().joints.lengths.q_m
    };
    let step = 0.05_f64;
    let bent = (0..720).map(|n| {
        let angle = f64::from(n).to_radians() / 2.0;
        ((lengths(angle + step) - lengths(angle) * 2.0 + lengths(angle - step)) / (step * step)).amax()
    });
    // per s², for one radian a second, which is 1 mm/s
    60.0 * (2.0 / bent.fold(0.0, f64::max)).sqrt()
}

/// Limits say nothing about a feed that is not one of a minute: that is said, and not that there are none.
#[test]
fn cuts_that_limits_say_nothing_about_are_counted() {
    let folder = Folder::new();
    let found = |cuts: &str, with_limits: bool| {
        let path = folder.write("p.ngc", &format!("{START}S1000 M3\n{cuts}"));
        let (out, limits) = (folder.path("out.ngc"), fixture("jobs/limits.toml"));
        let args = ["compensate", "--path", &path, "--wrench", WRENCH, "--out", &out];
        let limits: &[&str] = if with_limits { &["--limits", &limits] } else { &[] };
        let found = json(&[&args[..], limits].concat());
        let counts = ["feeds_checked", "feeds_not_checked"].map(|key| found[key].as_u64().unwrap());
        (counts, found["warnings"].to_string(), folder.read("report.html"))
    };
    let without = "Feeds were not held against limits";
    let of_a_turn = "G95 S0\nG1 X-200 F0.1\n";
    let (counts, warnings, report) = found(of_a_turn, true);
    let said = "the feed of 1 of 1 cuts could not be held against the joints&#39; limits: in G95 (mm a turn) without S or F in force at line 5;";
    assert_eq!(counts, [0, 1]);
    assert!(warnings.contains(&said.replace("&#39;", "'")), "{warnings}");
    assert!(report.replace('\'', "&#39;").contains(said) && !report.contains(without), "{report}");
    let (counts, warnings, report) = found(of_a_turn, false);
    assert!(counts == [0, 0] && warnings == "[]" && report.contains(without), "{warnings}");
    // an arc is one cut, however many chords it has
    let mixed = "G1 X-204\nX-203 F100\nG93 G2 X-201 I1 F10\nG1 X-200 F10\nG94 F100\nX-205\n";
    let (counts, warnings, _) = found(mixed, true);
    let said = "3 of 5 cuts could not be held against the joints' limits: without an F in force at line 4, \
                in G93 (1 over the minutes of a move) at line 6 and 1 more;";
    assert!(counts == [2, 3] && warnings.contains(said), "{warnings}");
    assert_eq!(found("G1 X-204 F100\n", true).1, "[]");
}

#[test]
fn what_stops_comes_with_the_last_part() {
    let (_, lines) = compensated(&format!("{START}G1 X-200 F100 M9 M5\nM30\n"), &["--wrench", WRENCH]);
    let at = lines.iter().position(|l| l.contains("M5")).unwrap();
    assert!(word(&lines[at], 'X').unwrap() > -200.1 && lines[at].contains("M9"), "{lines:#?}");
}

#[test]
fn nothing_is_read_behind_the_end() {
    let program = format!("%\n{START}G1 X-200 F100\n");
    let (whole, _) = compensated(&format!("{program}M30\n%\n"), &["--wrench", WRENCH]);
    for tail in ["M30\nthis is no G-code?\n", "%\nG1 X-100 Y500 F1\n", "M30\n%\nG1 X-100\n#1=[\n"] {
        let (read, lines) = compensated(&format!("{program}{tail}"), &["--wrench", WRENCH]);
        assert_eq!((&read["error_before_um"], &read["moves"]), (&whole["error_before_um"], &whole["moves"]), "{tail}");
        assert!(lines.iter().all(|l| !l.contains("X-100")), "{lines:#?}");
    }
}

#[test]
fn words_that_contradict_each_other_are_refused_with_their_line() {
    for (line, said) in [
        ("G20 G21", "`G20` and `G21` in one line"),
        ("G90 G91 X1", "`G90` and `G91` in one line"),
        ("G17 G1 X-200 G18 F100", "`G17` and `G18` in one line"),
        ("G54 G55", "`G54` and `G55` in one line"),
        ("M3 M5 S100", "`M3` and `M5` in one line"),
        ("G80 G81 X-205 Y0 R1131 Z1132 F100", "`G80` and `G81` in one line"),
        ("G73 G80 X-205 Y0 R1131 Z1132 Q1 F100", "`G73` and `G80` in one line"),
        ("M8 M9", "`M8` and `M9` in one line"),
        ("M09 G1 X-200 F100 M07", "`M09` and `M07` in one line"),
        ("M0 M1", "`M0` and `M1` in one line"),
        ("M2 M30", "of M2, M30, M98 and M99 more than one"),
        ("S-5", "a speed is not below 0"),
        ("G4 P-1", "a dwell is not below 0"),
        ("G93 G1 X-200 F0", "F0 in G93"),
        ("G82 X-205 Y0 R1131 Z1132 P-1 F100", "P, the dwell, is below 0"),
        ("G3 X-204.92 Y0.02 R0", "an arc with R0"),
        ("G3 X-204.9 Y0 R0.02", "its radius is only"),
        ("T99 M6\nG43", "the tool table (--tools) has no such tool"),
    ] {
        let (message, at) = why(&format!("{START}{line}\nG1 X-201 F100\n"));
        let lines = 2 + line.lines().count() as u64;
        assert!(message.contains(said) && at == lines, "{line}: {message}, line {at}");
    }
    // mist and flood together, a stop with what it stops, and G80 before a motion contradict nothing
    compensated(&format!("{START}G80 G1 X-200 F100 M7 M8\nX-201 M9 M5\nM0 M9\n"), &["--wrench", WRENCH]);
    let folder = Folder::new();
    // a cycle whose tool would go to R through the workpiece
    let upward = folder.write("u.ngc", "G21 G90 G54\nG0 X0 Y0 Z5\nG81 X1 R-5 Z-2 F100\n");
    let job = "format = 1\naxes = [\"x\", \"-y\", \"-z\"]\ntool_axis = [0, 0, 1]\n[offsets]\nG54 = [-205, 0, -1130]\n";
    let (job, out) = (folder.write("job.toml", job), folder.path("o.ngc"));
    let error = refused(&["compensate", "--path", &upward, "--job", &job, "--wrench", WRENCH, "--out", &out]);
    assert!(error["message"].as_str().unwrap().contains("R lies deeper") && error["line"] == 3, "{error}");
    // a force is estimated while the spindle stands
    let path = folder.write("p.ngc", &format!("T1 M6 S3000 M3\n{START}G1 X-204 F100\nM5\nG1 X-203\n"));
    let tools = folder.write("t.toml", TOOLS);
    let error = refused(&["compensate", "--path", &path, "--tools", &tools, "--out", &out]);
    assert!(error["message"].as_str().unwrap().contains("the spindle stands (M5)") && error["line"] == 6, "{error}");
}

/// Which of the two is called would be anybody's guess.
#[test]
fn a_program_number_that_stands_twice_is_refused_with_both_lines() {
    let main = format!("O1\n{START}M98 P100\nM30\n");
    for (subprograms, at, other) in [
        ("O100\nG1 X-204 F100\nM99\nO0100\nG1 X-201 F100\nM99\n", 9, 6),
        ("o100 sub\nG1 X-204 F100\no100 endsub\no100 sub\nG1 X-201\no100 endsub\n", 9, 6),
        ("O100\nM99\nO1\nM99\n", 8, 1),
    ] {
        let (message, line) = why(&format!("{main}{subprograms}"));
        let said = format!(": it begins at line {other} already");
        assert!(message.contains(&said) && line == at, "{subprograms}: {message}, line {line}");
    }
    // a name may be that of a subprogram and of a loop; two loops may share one
    let whole = "O100\no1 repeat [2]\nG1 X-204 F100\no1 endrepeat\no1 repeat [2]\nG1 X-203\no1 endrepeat\nM99\n";
    compensated(&format!("{START}M98 P100\nM30\n{whole}"), &["--wrench", WRENCH]);
}

/// A `%` in the middle ends a program as it does at the end: that is said where something is behind it.
#[test]
fn lines_behind_a_percent_sign_are_counted() {
    let program = format!("%\n{START}G1 X-200 F100\n");
    let warnings = |tail: &str| {
        let (summary, _) = compensated(&format!("{program}{tail}"), &["--wrench", WRENCH]);
        summary["warnings"].as_array().unwrap().clone()
    };
    for (tail, said) in [
        ("%\nG1 X-199\n\n(a comment)\nG1 X-198 #1=[\n%\n", "p.ngc:5: the 2 lines behind % are not read"),
        ("%\nG1 X-199\nM30\n%\n", "p.ngc:5: the 2 lines behind % are not read"),
        ("%\nG1 X-199\n", "p.ngc:5: the line behind % is not read"),
    ] {
        let found = warnings(tail);
        assert!(found.len() == 1 && found[0].as_str().unwrap().ends_with(said), "{tail}: {found:?}");
    }
    for tail in ["%\n", "%\n\n(a comment)\n; another\n%\n", "M30\n%\n", "M30\nO100\nG1 X-199\nM99\n%\n", ""] {
        assert_eq!(warnings(tail), [] as [Value; 0], "{tail}");
    }
    // where no move is before it, that is why there is none
    let folder = Folder::new();
    let path = folder.write("p.ngc", &format!("G21\n%\n{START}G1 X-200 F100\n"));
    let error = refused(&["compensate", "--path", &path, "--out", &folder.path("o.ngc"), "--wrench", WRENCH]);
    assert!(error["message"].as_str().unwrap().contains("the 3 lines behind the % of line 2 are not read"), "{error}");
}

/// Whether the heights of a cycle stay where they are when G90 and G91 change depends on the control.
#[test]
fn heights_of_a_cycle_are_not_carried_between_g90_and_g91() {
    let down = "G90 G99 G81 X-205 Y0 Z1133 R1131 F100\n";
    let up = "G91 G99 G81 X1 Z2 R1 F100\n";
    for (cycle, line, said) in [
        (down, "G91 X1 L2", "R and Z were given in G90, and this line is in G91"),
        (down, "G91 G82 X1 P1", "R and Z were given in G90, and this line is in G91"),
        (down, "G91 X1 Z2", "R was given in G90, and this line is in G91"),
        (down, "G91 X1 R1", "Z was given in G90, and this line is in G91"),
        (up, "G90 X-203", "R and Z were given in G91, and this line is in G90"),
    ] {
        let (message, at) = why(&format!("{START}{cycle}{line}\n"));
        let todo = message.contains("write R and Z again in this line, or end the cycle with G80 first");
        assert!(message.contains(said) && todo && at == 4, "{cycle}{line}: {message}, line {at}");
    }
    for lines in [
        format!("{down}G91 X1 Z2 R1 L2\nX1\nG90 X-200 Z1133 R1131\nX-199\n"),
        format!("{down}G91\nG90 X-203\n"),
        format!("{down}G80\nG91 G81 X1 Z2 R1\nX1\n"),
        format!("{up}X1\nG90 G0 Z1130\n{down}X-203\n"),
    ] {
        compensated(&format!("{START}{lines}"), &["--wrench", WRENCH]);
    }
}

/// What a word means elsewhere is not what it was refused for.
#[test]
fn refusals_name_what_a_word_means() {
    for (line, said) in [
        ("G12.1", "polar interpolation is not supported"),
        ("G13.1", "polar interpolation is not supported"),
        ("G12 I5", "circular pockets are not supported"),
        ("G76 X-205 Y0 Z1133 R1131 Q0.1 F100", "fine boring on mills of the Fanuc family, and threading elsewhere"),
        ("G1 X-2e2 F100", "a number with an exponent has to be written out"),
        ("G1 X-2E+2 Y1e0 F100", "a number with an exponent has to be written out"),
        ("#1=2e2", "a number with an exponent has to be written out"),
        ("G1 X[-2e2] F100", "a number with an exponent has to be written out"),
        ("G1 X-200 RND=2", "`RND=` of Siemens' language is not supported"),
        ("G1 X-200 F100 CHR=2", "`CHR=` of Siemens' language is not supported"),
        ("G1 X-200 CHF = 2", "`CHF=` of Siemens' language is not supported"),
    ] {
        let (message, at) = why(&format!("{START}{line}\nG1 X-201 F100\n"));
        assert!(message.contains(said) && at == 3, "{line}: {message}, line {at}");
    }
    for (first, said) in [
        ("O0001 G21 G90 G54", "O1: words behind a program's number: put it on a line of its own"),
        ("O1 N10 (PART)", "O1: words behind a program's number: put it on a line of its own"),
        (":0001", "`:0001` is a program's number as ISO writes it: write O0001"),
    ] {
        let (message, at) = why(&format!("{first}\n{START}G1 X-201 F100\n"));
        assert!(message.contains(said) && at == 1, "{first}: {message}, line {at}");
    }
    let (message, at) = why(&format!("{START}M98 P100\nM30\n:0100\nG1 X-201 F100\nM99\n"));
    assert!(message.contains("line 5 has it as `:0100`: write O0100") && at == 3, "{message}, line {at}");
}

/// What `compensate --wrench` writes says no load, and is to be seen all the same.
#[test]
fn a_compensated_program_is_played() {
    let folder = Folder::new();
    let path = folder.write("p.ngc", &format!("{START}G1 X-200 F100\n"));
    let (out, page) = (folder.path("out.ngc"), folder.path("page.html"));
    json(&["compensate", "--path", &path, "--wrench", WRENCH, "--out", &out]);
    json(&["view", "--path", &out, "--out", &page]);
    assert!(folder.has("page.html"));
}

/// What a program leaves to the control is said, or refused where controls differ.
#[test]
fn what_is_left_to_the_control_is_said() {
    let warnings = |cut: &str| {
        let (summary, _) = compensated(&format!("{START}{cut}"), &["--wrench", WRENCH]);
        summary["warnings"].as_array().unwrap().iter().map(|w| w.as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let line = START.lines().count() + 1;
    for (cut, said) in [
        ("G1 X-204\n", "a cut without F in force"),
        ("G1 X-204 F0\n", "a cut without F in force"),
        ("(F100 -50 -200)\nG1 X-204 F100\n", "`(F100 -50 -200)` sets no load: expected (F x y z)"),
        ("(F=10,0,-20)\nG1 X-204 F100\n", "`(F=10,0,-20)` sets no load"),
        ("(F 10 0 -20 N)\nG1 X-204 F100\n", "`(F 10 0 -20 N)` sets no load"),
        ("G61 G1 X-204 F100\n", "a cut in G61 (exact stop)"),
        ("G81 X-204 Y1 Z1135 R1132 F100\n", "a drilling cycle without G98 or G99: read as G98"),
        ("G61.1 G1 X-204 F100\nX-203\n", "a cut in G61 (exact stop) (first of 2 such lines)"),
    ] {
        let found = warnings(cut);
        assert!(found.len() == 1 && found[0].contains(&format!("p.ngc:{line}: {said}")), "{cut}: {found:?}");
    }
    for cut in [
        "(F 200)\nG1 X-204 F100\n",
        "(FACE MILL 50 4)\nG1 X-204 F100\n",
        "(FEED 500, SPEED 12000)\nG95 S0\nG1 X-204 F0.1\n",
        "(F500 S12000)\nG1 X-204 F100\n",
        "G61\nG64\nG1 X-204 F100\n",
        "G93 G1 X-204 F10\n",
        "G98 G81 X-204 Y1 Z1135 R1132 F100\n",
        "G99 G81 X-204 Y1 Z1135 R1132 F100\n",
        // back to the height before it is back to R
        "G81 X-204 Y1 Z1135 R1130 F100\n",
    ] {
        assert_eq!(warnings(cut), [""; 0], "{cut}");
    }
    for (cut, why) in [
        ("G1 X-204 F500\nG4 F2.\nX-203\n", "a dwell in Siemens' own mode"),
        ("G1 X-204 F500\nG4 S3\nX-203\n", "a dwell in Siemens' own mode"),
        ("G81 X-204 Y1 Z1135 R1132 F100 K0\n", "controls differ in whether the tool goes there"),
    ] {
        assert!(self::why(&format!("{START}{cut}")).0.contains(why), "{cut}");
    }
}

/// A program that a control's editor wrote: line ends of CR LF stay, comments in the control's encoding are read.
#[test]
fn line_ends_stay_and_comments_are_read_in_their_encoding() {
    let folder = Folder::new();
    let (path, out) = (folder.path("p.nc"), folder.path("out.nc"));
    let program = format!("%\nO1 (T\u{e4}sche)\n{START}G1 X-204 F100\nM30\n%\n").replace('\n', "\r\n");
    let bytes: Vec<u8> = program.chars().map(|c| c as u8).collect();
    std::fs::write(&path, &bytes).unwrap();
    let summary = json(&["compensate", "--path", &path, "--wrench", WRENCH, "--out", &out]);
    assert!(summary["warnings"].to_string().contains("p.nc: read as Windows-1252, and written as UTF-8"), "{summary}");
    let made = folder.read("out.nc");
    assert_eq!(made.matches('\n').count(), made.matches("\r\n").count());
    assert!(made.contains("(T\u{e4}sche)\r\n") && made.matches("\r\n").count() > 8, "{made}");
}

/// A wall that is cut and then gone over without load: the second pass began where the first one's load had the command, 60 µm beside.
#[test]
fn a_cut_without_load_begins_where_it_is_programmed() {
    let cut = "(wrench 0,-300,-60,0,0,0)\nG1 Y10 F100\n(wrench 0,0,0,0,0,0)\n";
    let behind = |moves: &str| -> Vec<String> {
        let (_, lines) = compensated(&format!("{START}{cut}{moves}M2\n"), &[]);
        let last = lines.iter().rposition(|l| l.starts_with("X-204.996") && l.contains(" Y10.0589")).unwrap();
        lines[last + 1..].iter().take_while(|l| *l != "M2").cloned().collect()
    };
    let begin = "X-205 Y10 Z1130 A0 B0";
    assert_eq!(behind("X-175\n"), [begin, "X-175 Y10 Z1130 A0 B0"]);
    // a rapid goes from where the machine stands
    assert_eq!(behind("G0 X-175\n"), ["G0 X-175 Y10 Z1130 A0 B0"]);
    let arc = behind("G2 X-200 Y5 R5\n");
    assert!(arc.len() > 30 && arc[0].contains(begin) && arc.last().unwrap().contains("X-200 Y5 Z1130"), "{arc:#?}");
    // a drill that goes sideways has no load
    let (_, lines) = compensated("G21 G90\nT2 M6\nS2000 M3\nG0 X-205 Y0 Z1130 A0 B0\nG1 Z1135 F300\nX-200\nM2\n", &[]);
    let side = lines.iter().position(|l| l == "X-205 Y0 Z1135 A0 B0").unwrap();
    assert!(word(&lines[side - 1], 'Z').unwrap() > 1135.01, "{lines:#?}");
}

/// Between two cuts the tool goes 20 mm without load, over which the chart of errors had the load's 28 µm.
#[test]
fn the_chart_of_errors_is_zero_where_there_is_no_load() {
    let cut = "(wrench 0,-300,-60,0,0,0)\nG1 X-203 F100\n(wrench 0,0,0,0,0,0)\nX-193\nX-203\n";
    let folder = Folder::new();
    let path = folder.write("p.ngc", &format!("{START}{cut}(wrench 0,-300,-60,0,0,0)\nX-205\nM2\n"));
    json(&["compensate", "--path", &path, "--out", &folder.path("out.ngc")]);
    let picture = folder.read("out.svg");
    let (_, series) = picture.split_once("data-name=\"uncompensated\"").unwrap();
    let line = series.split_once(" d=\"M").unwrap().1.split_once('"').unwrap().0;
    let points: Vec<(f64, f64)> = line
        .split('L')
        .map(|point| point.split_once(',').map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap())).unwrap())
        .collect();
    let zero = points.iter().map(|p| p.1).fold(0.0, f64::max);
    let at_zero: Vec<bool> = points.iter().map(|p| p.1 == zero).collect();
    assert_eq!(at_zero, [false, false, true, true, false, false], "{line}");
    assert!(points[1].0 == points[2].0 && points[3].0 == points[4].0 && points[3].0 - points[2].0 > 100.0, "{line}");
}
