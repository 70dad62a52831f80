//! Points, reflectors and readings that tell no deflection: one message that says what to mend.

use super::{Reflector, as_points};
use crate::bad_input::{Kind, Make, Put, Reader};
use crate::common::{Folder, fixture, refused, run};

#[test]
fn bad_points() {
    let files = ["reflectors.toml", "readings.csv"].map(|f| fixture(&format!("tracker/{f}")));
    let good = std::fs::read_to_string(fixture("tracker/points.csv")).unwrap();
    let call = ["import", "--points", "BAD", "--reflectors", &files[0], "--readings", &files[1], "--out", "OUT"];
    Reader { good: &good, name: "p.csv", call: &call, old: "out" }.refuses_text(&POINTS.iter().collect::<Vec<_>>(), 24);
}

#[test]
fn bad_reflectors() {
    let files = ["points.csv", "readings.csv"].map(|f| fixture(&format!("tracker/{f}")));
    let good = std::fs::read_to_string(fixture("tracker/reflectors.toml")).unwrap();
    let call = ["import", "--points", &files[0], "--reflectors", "BAD", "--readings", &files[1], "--out", "OUT"];
    Reader { good: &good, name: "r.toml", call: &call, old: "out" }.refuses(REFLECTORS, 18);
}

/// A file without the lines that begin so.
fn without(good: &str, begin: &str) -> Vec<u8> {
    good.lines().filter(|l| !l.starts_with(begin)).map(|l| format!("{l}\n")).collect::<String>().into()
}

#[rustfmt::skip] // a kind a line
const POINTS: &[Kind] = &[
    ("metres", Put("x_mm", "x_m"), ":2: x_m: ", "did you mean `x_mm`?"),
    ("no unit of a coordinate", Put("x_mm", "X"), ":2: X: ", "no unit of X|`X [mm]`"),
    ("an unknown unit", Put("x_mm", "X [yd]"), ":2: X [yd]: ", "unknown unit `yd` of x_mm"),
    ("thousands", Put("1900.6108", "\"1,900\""), ":10: x_mm: ", "without separators between thousands"),
    ("no uncertainty that is one", Put("u95_um", "u95_mm"), ":2: u95_mm: ", "did you mean `u95_um`?"),
    ("no states", Put(",state,", ",note,"), ":2: state: ", "missing column"),
    ("an uncertainty of 0", Make(|good| good.replacen(",6\n", ",0\n", 1).into()), ":7: u95_um: ", "expanded uncertainty above 0"),
    ("a negative uncertainty", Make(|good| good.replacen(",6\n", ",-6\n", 1).into()), ":7: u95_um: ", "found -6"),
    ("a state of another name", Put("P1-fx,loaded,R1", "P1-fx,pressed,R1"), ":10: state: ", "expected `unloaded` or `loaded`, found `pressed`"),
    ("a reflector that is not there", Put("P1-fx,loaded,R2", "P1-fx,loaded,R9"), ":11: point: ", "no reflector `R9`|R1, R2, R3, R4, G1, G2, G3"),
    ("a reflector twice", Put("P1-fx,loaded,R2", "P1-fx,loaded,R1"), ":11: point: ", "duplicate|first in line 10"),
    ("no name of a reading", Put("P1-fx,loaded,R1", ",loaded,R1"), ":10: reading: ", "empty cell"),
    ("a reading that is not there", Put("P1-fx,loaded,R1", "P1-fy,loaded,R1"), ":10: reading: ", "no reading and no series `P1-fy`"),
    ("a point loaded alone", Make(|good| without(good, "P1 zero,unloaded,R3")), ":11: point: ", "`R3` of reading P1-fx was not measured unloaded"),
    ("a point unloaded alone", Make(|good| without(good, "P2-fz,loaded,R4")), ":27: point: ", "`R4` of reading P2-fz was not measured loaded"),
    ("a base's point in one state", Make(|good| without(good, "P2-fz,loaded,G2")), ":29: point: ", "`G2` of reading P2-fz was not measured loaded"),
    ("text for a coordinate", Put("P1-fx,loaded,R1,", "P1-fx,loaded,R1,a"), ":10: x_mm: ", "finite number"),
    ("farther than light reaches", Put("P1-fx,loaded,R1,", "P1-fx,loaded,R1,99999999"), ":10: x_mm: ", "within"),
    ("a reflector that slipped", Make(|good| slipped(good, "P3-fz,loaded,R3")), ":61: point: ", "`R3` has left the others in reading P3-fz|rigid"),
    ("a base's reflector that slipped", Make(|good| slipped(good, "P3-fz,loaded,G2")), ":64: point: ", "`G2`, or one of the two others, has left"),
    ("inches", Make(|good| scaled(good, 1.0 / 25.4)), ": ", "are they in mm"),
    ("left-handed axes", Make(mirrored), ": ", "right-handed"),
];

#[rustfmt::skip] // a kind a line
const REFLECTORS: &[Kind] = &[
    ("another format", Put("format = 1", "format = 2"), ":2: format: ", "expected 1, found 2"),
    ("an unknown key", Put("xyz_mm", "xzy_mm"), ":28: reflector.5.xzy_mm: ", "did you mean `xyz_mm`?"),
    ("an uncertainty of 0", Put("u95_um = 4.0", "u95_um = 0.0"), ":3: u95_um: ", "expanded uncertainty above 0"),
    ("coordinates of the other body", Put("uvw_mm", "xyz_mm"), ":8: reflector.xyz_mm: ", "expected uvw_mm"),
    ("two coordinates", Put("uvw_mm = [75.0, 75.0, 40.0]", "uvw_mm = [75.0, 75.0]"), ":8: reflector.1.uvw_mm: ", "expected 3 numbers, found 2"),
    ("a name twice", Put("\"R2\"", "\"R1\""), ":11: reflector.name: ", "duplicate reflector `R1`"),
    ("nowhere", Put("on = \"platform\"", "on = \"head\""), ":7: reflector.1.on: ", "head"),
    ("too far", Put("[75.0, 75.0, 40.0]", "[75.0, 75.0, 4e9]"), ":8: reflector.uvw_mm: ", "within"),
    ("none on the platform", Make(|good| good.replace("platform", "base").replace("uvw", "xyz").into()), ": reflector: ", "on = \"platform\""),
];

/// The row that begins so, 5 mm away.
fn slipped(good: &str, begin: &str) -> Vec<u8> {
    changed(good, begin, |n, v| if n == 0 { v + 5.0 } else { v })
}

fn scaled(good: &str, factor: f64) -> Vec<u8> {
    changed(good, "", |_, v| v * factor)
}

fn mirrored(good: &str) -> Vec<u8> {
    changed(good, "", |n, v| if n == 1 { -v } else { v })
}

/// Coordinates of the rows that begin so.
fn changed(good: &str, begin: &str, change: impl Fn(usize, f64) -> f64) -> Vec<u8> {
    let row = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if line.starts_with(begin) && !line.starts_with("reading,") && !line.starts_with('#') {
            (0..3).for_each(|n| cells[3 + n] = change(n, cells[3 + n].parse().unwrap()).to_string());
        }
        cells.join(",") + "\n"
    };
    good.lines().map(row).collect::<String>().into()
}

/// What is wrong with the readings' file, and reflectors that tell no motion.
#[test]
fn points_that_tell_no_deflection_are_refused() {
    let folder = Folder::new();
    let text = |file: &str| std::fs::read_to_string(fixture(&format!("tracker/{file}"))).unwrap();
    let said = |points: &str, reflectors: &str, readings: &str| {
        let files = [("p.csv", points), ("r.toml", reflectors), ("d.csv", readings)]
            .map(|(name, text)| folder.write(name, text));
        let [points, reflectors, readings] = &files;
        let out = folder.path("out.csv");
        let error =
            refused(&["import", "--points", points, "--reflectors", reflectors, "--readings", readings, "--out", &out]);
        assert!(!folder.has("out.csv"));
        error["message"].as_str().unwrap().to_owned()
    };
    let [points, reflectors, readings] = ["points.csv", "reflectors.toml", "readings.csv"].map(text);
    let put = |text: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    };
    for (points, reflectors, readings, expected) in [
        (
            &points,
            &reflectors,
            &put(&readings, "P1-fz", "P1-fx"),
            "d.csv:4: reading: reading P1-fx stands in line 3 as well",
        ),
        (
            &points,
            &reflectors,
            &put(&readings, "reading,", "note,"),
            "d.csv:2: reading: missing column: each reading needs the name",
        ),
        (&points, &reflectors, &put(&readings, "P1-fx,", ","), "d.csv:3: reading: expected the name of the reading"),
        (
            &points,
            &reflectors,
            &put(&readings, "mz_nm", "mz_nm,dx_um").replace(",0\n", ",0,1\n"),
            "d.csv:2: dx_um: not expected beside --points",
        ),
        (
            &points,
            &reflectors,
            &put(&readings, "P1 zero,P1,0,0,530,0", "P1 zero,P1,0,1,530,0"),
            "d.csv:4: series: series P1 zero stands at two poses",
        ),
        (
            &put(&points, "P1 zero,unloaded", "P1-fx,unloaded"),
            &reflectors,
            &readings,
            "d.csv:4: reading: no unloaded points of reading P1-fz, nor of its series P1 zero",
        ),
    ] {
        let message = said(points, reflectors, readings);
        assert!(message.starts_with(&folder.path(expected)), "{message}\nfor {expected}");
    }
    // neither the point's nor the tracker's
    let no_u95: String = reflectors.lines().filter(|l| !l.starts_with("u95_um")).map(|l| format!("{l}\n")).collect();
    assert!(
        said(&points, &no_u95, &readings).starts_with(&folder.path("p.csv:3: u95_um: no uncertainty of this point"))
    );
    // two of four that are there
    let few: String =
        points.lines().filter(|l| ![",R1,", ",R2,"].iter().any(|r| l.contains(r))).map(|l| format!("{l}\n")).collect();
    assert!(said(&few, &reflectors, &readings).contains("six components need 3 of the 4"));
    // one that nobody can place
    let alone: String = points.lines().filter(|l| !l.contains(",G")).map(|l| format!("{l}\n")).collect();
    let unknown: String = reflectors.lines().filter(|l| !l.contains("_mm =")).map(|l| format!("{l}\n")).collect();
    let (first, _) = readings.split_once("P2-fx").unwrap();
    let at_one_pose: String =
        alone.lines().filter(|l| !l.starts_with("P2") && !l.starts_with("P3")).map(|l| format!("{l}\n")).collect();
    assert!(said(&at_one_pose, &unknown, first).contains("do not tell where the tracker stands"));
    let in_line: Vec<Reflector> =
        [-75.0, 10.0, 75.0].iter().zip(["R1", "R2", "R3"]).map(|(u, r)| (r, [*u, 5.0, 20.0], true, 5.0)).collect();
    let [points, reflectors, readings] =
        as_points("p08", &in_line, &folder, 5).map(|file| std::fs::read_to_string(file).unwrap());
    let message = said(&points, &reflectors, &readings);
    assert!(
        message
            .starts_with(&folder.path("p.csv:5: point: the reflectors of reading r0 lie within 0.000 mm of one line")),
        "{message}"
    );
    // nothing but options
    let lone = run(&["import", "--points", &folder.path("p.csv"), "--out", &folder.path("out.csv")]);
    assert_eq!(lone.status.code(), Some(2));
}
