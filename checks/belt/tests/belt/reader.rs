//! The published text format, and what is wrong with it, by line.

use pkm_belt::files::{self, Tension, parse_runs, parse_tension};

use crate::simulated::{Truth, runs, tension};

#[test]
fn runs_are_read_as_published() {
    let read = parse_runs(&runs(&Truth::STIFF, 3, 1)).unwrap();
    assert_eq!(read.len(), 3);
    assert!(read.iter().all(|r| r.points.len() == 25));
    assert_eq!(read[1].tool.coordinates_m.map(|v| (1e6 * v).round()), [3.034e6, 3.0275e6, 2.136e6, 1500.0, 2.13125e6]);
    // the first reading stands in line 7: heading lines and a blank one before it
    assert_eq!(read[0].points[0][0].line, 7);
    let text = "Run 1:\n{bl:1000.00,   br:2500.25,   tr:2400.50,   tl:990.05},\n";
    let point: String = text.to_owned() + &text[7..].repeat(3) + "(0, 2140), (3020, 2141)\n(0, 0), (3030, 0)\n";
    let two = parse_runs(&point.repeat(2)).unwrap();
    assert_eq!(two[0].points[0][3].at_m.as_slice(), [1.0, 2.50025, 2.4005, 0.99005]);
}

#[test]
fn bad_runs_are_refused_with_their_line() {
    let good = runs(&Truth::STIFF, 2, 2);
    let lines: Vec<&str> = good.lines().collect();
    let with = |line: usize, text: &str| {
        let mut lines = lines.clone();
        lines[line - 1] = text;
        parse_runs(&lines.join("\n")).unwrap_err()
    };
    let tool = lines.iter().position(|l| l.starts_with('(')).unwrap() + 1;
    let second_run = lines.iter().position(|l| l.starts_with("Run 2")).unwrap() + 1;
    for (line, text, at, says) in [
        (8, "{bl:1, br:2, tr:3}", 8, "form '{bl:"),
        (8, "{bl:1000, br:2000, tl:2000, tr:1000}", 8, "form '{bl:"),
        (8, "{bl:1000, br:2000, tr:20OO, tl:1000}", 8, "form '{bl:"),
        (8, "{bl:1000, br:2000, tr:NaN, tl:1000}", 8, "tr is NaN mm"),
        (8, "{bl:1000, br:-2000, tr:2000, tl:1000}", 8, "br is -2000 mm"),
        (8, "{bl:1000000, br:2000, tr:2000, tl:1000}", 8, "bl is 1000000 mm"),
        (8, "{bl:1000, br:2000, tr:2000, tl:99}", 8, "tl is 99 mm, not between 100"),
        (8, "bl 1000", 8, "neither 'Run"),
        (9, "{bl:1100, br:2550, tr:2400, tl:1000},", 9, "more than 10 mm from line 7"),
        (8, "", 5, "99 readings"),
        (tool, "(1, 2), (3, x)", tool, "anchors have the form"),
        (tool, "", 5, "after this run two lines"),
        (tool, "(1, 2), (inf, 3)", tool, "anchors have the form"),
        (second_run, "Average of all", 0, "fewer than two runs"),
    ] {
        let error = with(line, text);
        assert_eq!(error.line.unwrap_or(0), at, "{text}: {error:?}");
        assert!(error.message.contains(says), "{text}: {error:?}");
    }
    assert_eq!(parse_runs("").unwrap_err().line, None);
    // a point less in the second run
    let mut fewer = lines.clone();
    fewer.drain(second_run + 1..second_run + 5);
    let error = parse_runs(&fewer.join("\n")).unwrap_err();
    assert_eq!(error.line, Some(second_run), "{error:?}");
    assert!(error.message.contains("24 points and the first has 25"), "{error:?}");
}

#[test]
fn tension_pairs_are_read_with_what_they_are() {
    let pairs = parse_tension(&tension(&Truth::STIFF)).unwrap();
    let kinds: Vec<[Tension; 2]> = pairs.iter().map(|p| p.map(|r| r.0)).collect();
    assert_eq!(kinds, [[Tension::Low, Tension::High], [Tension::Low, Tension::Low]]);
    let unknown = parse_tension("//\n{bl:1800, br:1801, tr:1802, tl:1803}\n").unwrap_err();
    assert_eq!(unknown.line, Some(2));
    let alone = parse_tension("{bl:1800, br:1801, tr:1802, tl:1803} //Low\n").unwrap_err();
    assert!(alone.message.contains("no second"), "{alone:?}");
}

#[test]
fn a_folder_is_read_under_either_name_and_errors_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let missing = files::read(folder.path()).unwrap_err();
    assert!(missing.to_string().contains("10X Calibration Test.txt"), "{missing}");
    std::fs::write(folder.path().join("10X Calibration Test.txt"), runs(&Truth::STIFF, 2, 3)).unwrap();
    std::fs::write(folder.path().join("tension.txt"), "{bl:1}").unwrap();
    let bad = files::read(folder.path()).unwrap_err();
    assert!(
        bad.to_string().ends_with("tension.txt:1: a reading ends with '//Low tension …' or '//High tension …'"),
        "{bad}"
    );
    std::fs::write(folder.path().join("tension.txt"), tension(&Truth::STIFF)).unwrap();
    assert_eq!(files::read(folder.path()).unwrap().runs.len(), 2);
}
