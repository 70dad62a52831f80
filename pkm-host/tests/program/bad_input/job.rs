//! The job of `place`.

use super::{Kind, Make, Put, Reader};
use crate::common::fixture;

/// Lines: 3 format, 6 base, 8 table, 9 cross slide, 10 dx, 11 dy, series A from 14 on, series B from 24 on.
#[test]
fn jobs() {
    let good = std::fs::read_to_string(fixture("jobs/plate.toml")).unwrap();
    let call = ["place", "--step-mm", "50", "--job", "BAD", "--out", "OUT"];
    Reader { good: &good, name: "job.toml", call: &call, old: "out/placement.json" }.refuses(KINDS, 60);
}

#[rustfmt::skip] // a kind a line
const KINDS: &[Kind] = &[
    // no TOML, or not all of it
    ("empty", Make(|_| Vec::new()), ": format: ", "missing"),
    ("a byte-order mark alone", Make(|_| "\u{feff}".into()), ": format: ", "missing"),
    ("a machine file", Make(|_| crate::common::reference_machine().into()), ":15: box: ", "unknown key"),
    ("JSON", Make(|_| "{\"format\": 1}".into()), ":1: ", "expected"),
    ("CSV", Make(|_| "x_mm,y_mm,z_mm\n0,0,0\n".into()), ":1: ", "expected"),
    ("cut off", Make(|good| good[..good.len() - 30].into()), ":30: { tip_mm: ", "expected"),
    ("a missing comma", Put("[0, 0, -1] },", "[0, 0, -1] }"), ":19: ", "expected"),
    ("a missing bracket", Put("[0, 0, 0, 1]]\n", "[0, 0, 0, 1]\n"), ":8: ", "expected"),
    ("a bracket too many", Put("[0, 0, 0, 1]]\n", "[0, 0, 0, 1]]]\n"), ":6: ", "expected"),
    ("an unclosed quote", Put("\"A\"", "\"A"), ":15: ", "expected"),
    ("no quotes", Put("\"A\"", "A"), ":15: ", "quote"),
    ("a key twice", Put("dx_mm = [-400.0, 400.0]", "dx_mm = [-400.0, 400.0]\ndx_mm = [-400.0, 400.0]"), ":11: dx_mm: ", "duplicate"),
    ("a name twice in a series", Put("name = \"A\"", "name = \"A\"\nname = \"B\""), ":16: name: ", "duplicate"),
    ("10,000 brackets", Make(|good| good.replacen("[0, 0, -1]", &"[".repeat(10_000), 1).into()), ":18: ", "nested"),
    ("a line of 10 MB", Make(|good| good.replacen("\"A\"", &"A".repeat(10_000_000), 1).into()), ":15: ", "neither a number nor text in quotes"),
    // numbers
    ("a decimal comma", Put("[-400.0, 400.0]", "[-400,0, 400,0]"), ":10: dx_mm: ", "expected 2 numbers, found 4"),
    ("a minus of typography", Put("[-400.0, 400.0]", "[\u{2212}400.0, 400.0]"), ":10: dx_mm: ", "minus"),
    ("a unit", Put("[-400.0, 400.0]", "[-400.0 mm, 400.0 mm]"), ":10: dx_mm: ", "without unit"),
    ("text", Put("[-400.0, 400.0]", "[\"-400\", \"400\"]"), ":10: dx_mm", "expected a number, found string"),
    ("true", Put("fx_n = 0.0", "fx_n = true"), ":16: series.1.wrench.fx_n: ", "expected a number, found boolean"),
    ("a million digits", Make(|good| good.replacen("-400.0", &"9".repeat(1_000_000), 1).into()), ":10: dx_mm", "number"),
    ("NaN among limits", Put("[-400.0, 400.0]", "[nan, 400.0]"), ":10: dx_mm: ", "within"),
    ("limits without end", Put("[-400.0, 400.0]", "[-inf, inf]"), ":10: dx_mm: ", "within"),
    ("limits far away", Put("[-400.0, 400.0]", "[-1e300, 400.0]"), ":10: dx_mm: ", "within"),
    ("limits the wrong way", Put("[-400.0, 400.0]", "[400.0, -400.0]"), ":10: dx_mm: ", "reversed"),
    ("a load that is no number", Put("fx_n = 0.0", "fx_n = nan"), ":16: series.A.wrench: ", "finite"),
    ("a load beyond all numbers", Put("fx_n = 0.0", "fx_n = 1e999"), ":16: series.1.wrench.fx_n: ", "number overflowed"),
    ("no load", Put("fz_n = -400.0, mx_nm = 0.0, my_nm = 0.0, mz_nm = 5.0", "fz_n = 0, mx_nm = 0, my_nm = 0, mz_nm = 0"), ": series.A.wrench: ", "without a load"),
    ("a tip that is no number", Put("[150.0, 20.0, 0.0]", "[150.0, nan, 0.0]"), ":19: series.A.holes[2].tip_mm: ", "finite"),
    ("a tip in metres", Put("[150.0, 20.0, 0.0]", "[150e3, 20e3, 0.0]"), ": ", "hole 2|series `A`"),
    ("an axis of no length", Put("[0.05, 0, -1]", "[0, 0, 0]"), ":20: series.A.holes[3].axis: ", "direction"),
    ("an axis that is no number", Put("[0.05, 0, -1]", "[0.05, nan, -1]"), ":20: series.A.holes[3].axis: ", "direction"),
    ("an infinite axis", Put("[0.05, 0, -1]", "[1e-320, inf, 0.0]"), ":20: series.A.holes[3].axis: ", "direction"),
    // matrices
    ("a matrix not rigid", Put("[[1, 0, 0, -220]", "[[1, 0.1, 0, -220]"), ":8: table_in_world: ", "not rigid"),
    ("a scale in a matrix", Put("[[1, 0, 0, -220], [0, 1, 0, -300], [0, 0, 1, 0]", "[[2, 0, 0, -220], [0, 2, 0, -300], [0, 0, 2, 0]"), ":8: table_in_world: ", "not rigid"),
    ("a reflection", Put("[0, -1, 0, 0], [0, 0, -1, 1140]", "[0, 1, 0, 0], [0, 0, -1, 1140]"), ":6: base_in_world: ", "reflection"),
    ("a transposed matrix", Put("[[1, 0, 0, -220], [0, 1, 0, -300], [0, 0, 1, 0], [0, 0, 0, 1]]", "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [-220, -300, 0, 1]]"), ":8: table_in_world: ", "last row"),
    ("another last row", Put("[0, 0, -1, 1140], [0, 0, 0, 1]]", "[0, 0, -1, 1140], [0, 0, 0, 2]]"), ":6: base_in_world: ", "last row"),
    ("three rows", Put(", [0, 0, 0, 1]]", "]"), ":6: base_in_world: ", "4 rows of 4"),
    ("three columns", Put("[[1, 0, 0, 0]", "[[1, 0, 0]"), ":6: base_in_world: ", "4 rows of 4"),
    ("a flat matrix", Put("[[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1140], [0, 0, 0, 1]]", "[1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 1140, 0, 0, 0, 1]"), ":6: base_in_world", "array"),
    ("a matrix with NaN", Put("1140", "nan"), ":6: base_in_world: ", "finite"),
    ("a number for a matrix", Put("[[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1140], [0, 0, 0, 1]]", "1140"), ":6: base_in_world: ", "array"),
    // keys and shapes
    ("no format", Put("format = 1\n", ""), ": format: ", "missing"),
    ("another format", Put("format = 1", "format = 2"), ":3: format: ", "expected 1, found 2"),
    ("no frame of the base", Put("base_in_world        = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1140], [0, 0, 0, 1]]\n", ""), ": base_in_world: ", "missing"),
    ("nothing that moves", Put("dx_mm = [-400.0, 400.0]\n", ""), ": dx_mm: ", "missing|least, greatest"),
    ("a misspelt key", Put("cross_slide_in_world", "cross_in_world"), ":9: cross_in_world: ", "unknown key|`cross_slide_in_world`"),
    ("another unit", Put("dx_mm", "dx_m"), ":10: dx_m: ", "unknown key|`dx_mm`"),
    ("kilonewtons", Put("fz_n", "fz_kn"), ":16: series.1.wrench.fz_kn: ", "unknown key|`fz_n`"),
    ("a load in one number", Put("wrench = { fx_n = 0.0, fy_n = 0.0, fz_n = -400.0, mx_nm = 0.0, my_nm = 0.0, mz_nm = 5.0 }", "wrench = -400"), ":16: series.1.wrench: ", "a table"),
    ("no moment", Put(", mz_nm = 5.0", ""), ":16: series.1.wrench.mz_nm: ", "missing"),
    ("no axis", Put(", axis = [0.05, 0, -1]", ""), ":20: series.1.holes.3.axis: ", "missing"),
    ("a tip of two numbers", Put("[150.0, 20.0, 0.0]", "[150.0, 20.0]"), ":19: series.1.holes.2.tip_mm: ", "expected 3 numbers, found 2"),
    ("a tip of four numbers", Put("[150.0, 20.0, 0.0]", "[150.0, 20.0, 0.0, 1.0]"), ":19: series.1.holes.2.tip_mm: ", "expected 3 numbers, found 4"),
    ("three limits", Put("dx_mm = [-400.0, 400.0]", "dx_mm = [-400.0, 0.0, 400.0]"), ":10: dx_mm: ", "expected 2 numbers, found 3"),
    ("one limit", Put("dx_mm = [-400.0, 400.0]", "dx_mm = 400.0"), ":10: dx_mm: ", "400"),
    ("holes of one hole", Put("holes = [\n    { tip_mm = [0.0, 0.0, 0.0], axis = [0, 0, -1] },\n", "holes = { tip_mm = [0.0, 0.0, 0.0], axis = [0, 0, -1] }\nmore = [\n"), ":17: series.1.holes: ", "array"),
    ("no holes", Make(|good| good[..good.find("    {").unwrap()].to_owned().into_bytes().into_iter().chain(*b"]\n").collect()), ":17: series.A.holes: ", "has no holes"),
    ("no series", Make(|good| format!("{}series = []\n", &good[..good.find("[[series]]").unwrap()]).into()), ":14: series: ", "at least one [[series]]"),
    ("no key of series", Make(|good| good[..good.find("[[series]]").unwrap()].into()), ": series: ", "missing"),
    ("one series, not one of several", Make(|good| good[..good.rfind("[[series]]").unwrap()].replace("[[series]]", "[series]").into()), ":14: series: ", "[[series]]"),
    ("a series' name twice", Put("\"B\"", "\"A\""), ":25: series.name: ", "duplicate"),
    ("an empty name", Put("\"A\"", "\"\""), ":15: series.name: ", "one line"),
    ("a name of two lines", Put("\"A\"", "\"A\\nB\""), ":15: series.name: ", "one line"),
    ("a rotary axis of no direction", Put("\n[[series]]", "\nrotary = { axis = [0,0,0], through_mm = [0,0,0], range_deg = [-180, 180] }\n[[series]]"), ":14: rotary.axis: ", "direction"),
    ("a rotary axis without range", Put("\n[[series]]", "\nrotary = { axis = [0,0,1], through_mm = [0,0,0] }\n[[series]]"), ":14: rotary.range_deg: ", "missing"),
    ("a rotary axis the wrong way", Put("\n[[series]]", "\nrotary = { axis = [0,0,1], through_mm = [0,0,0], range_deg = [180, -180] }\n[[series]]"), ":14: rotary.range_deg: ", "reversed"),
    // out of reach
    ("a hole too deep", Put("[150.0, 20.0, 0.0]", "[150.0, 20.0, -900.0]"), ": ", "hole 2 of series `A`|mm beyond its travel"),
    ("a hole from below", Put("[0.05, 0, -1]", "[0.05, 0, 1]"), ": ", "hole 3 of series `A`|out of reach"),
    ("holes too far apart", Put("[150.0, 20.0, 0.0]", "[1150.0, 20.0, 0.0]"), ": ", "hole 2 of series `A` is out of reach"),
];
