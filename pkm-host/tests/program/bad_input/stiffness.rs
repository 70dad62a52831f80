//! Stiffness files, and of CSV all that has to do with the file and its lines.

use super::{Kind, Make, Put, Reader};
use crate::common::fixture;

/// The header stands in line 3, poses from line 4 on.
#[test]
fn stiffness_files() {
    let good = std::fs::read_to_string(fixture("stiffness/fe-l49.csv")).unwrap();
    let call = ["fit", "--data", "BAD", "--out", "OUT"];
    Reader { good: &good, name: "k.csv", call: &call, old: "out/coefficients.rs" }.refuses(KINDS, 60);
}

/// Lines of data and header cell by cell; comments stay out.
fn cells(text: &str, change: impl Fn(usize, &mut Vec<String>)) -> Vec<u8> {
    let lines = text.lines().filter(|l| !l.starts_with('#')).enumerate();
    let changed = lines.map(|(n, line)| {
        let mut cells = line.split(',').map(str::to_owned).collect();
        change(n, &mut cells);
        cells.join(",") + "\n"
    });
    changed.collect::<String>().into()
}

fn scaled(cell: &str, factor: f64) -> String {
    (cell.parse::<f64>().unwrap() * factor).to_string()
}

#[rustfmt::skip] // a kind a line
const KINDS: &[Kind] = &[
    // the file
    ("empty", Make(|_| Vec::new()), ":1: ", "header|found nothing"),
    ("a byte-order mark alone", Make(|_| "\u{feff}".into()), ":1: ", "header|found nothing"),
    ("blank lines alone", Make(|_| "\n \n\t\n".into()), ":1: ", "header|found nothing"),
    ("comments alone", Make(|good| good.lines().map(|l| format!("# {l}\n")).collect::<String>().into()), ":1: ", "header|found nothing"),
    ("a header alone", Make(|good| good.lines().take(3).map(|l| format!("{l}\n")).collect::<String>().into()), ":3: ", "rows of data"),
    ("no header", Make(|good| good.lines().skip(3).map(|l| format!("{l}\n")).collect::<String>().into()), ":1: ", "header|numbers"),
    ("tabs between cells", Make(|good| good.replace(',', "\t").into()), ":3: ", "tabs|commas or semicolons"),
    ("spaces between cells", Make(|good| good.replace(',', " ").into()), ":3: ", "commas or semicolons"),
    ("bars between cells", Make(|good| good.replace(',', "|").into()), ":3: ", "commas or semicolons"),
    ("TOML", Make(|_| "format = 1\nname = \"reference\"\n".into()), ":1: ", "commas or semicolons"),
    ("JSON", Make(|_| "{\"pose\": \"a\",\n\"k11\": 1}\n".into()), ":1: ", "column"),
    ("a page of HTML", Make(|_| "<!DOCTYPE html>\n<html><body>404</body></html>\n".into()), ":1: ", "commas or semicolons"),
    ("a semicolon in the header alone", Put("pose,theta_deg", "pose;theta_deg"), ":4: ", "expected 2 cells as in the header, found 1"),
    ("a header of 10 MB", Make(|good| good.replacen("pose,", &format!("{},", "pose".repeat(2_500_000)), 1).into()), ":3: pose: ", "missing"),
    ("a line of 10 MB", Make(|good| good.replacen("O01,", &"O01,".repeat(2_500_000), 1).into()), ":4: ", "expected 25 cells"),
    ("an unclosed quote", Put("O01,", "\"O01,"), ":4: ", "quote"),
    ("an unclosed quote in the header", Put("pose,", "\"pose,"), ":3: ", "quote"),
    ("an unclosed quote at the end", Make(|good| format!("{good}\"O50,").into()), ":53: ", "found 1"),
    ("a byte of Latin-1 behind", Make(|good| [good.as_bytes(), b"O50,\xb0,0,500\n"].concat()), ":53: ", "UTF-8"),
    ("a mark of a merge", Put("O03,", "<<<<<<< ours\nO03,"), ":6: ", "expected 25 cells as in the header, found 1"),
    ("cut off in the middle", Make(|good| good[..good.len() - 30].into()), ":52: ", "expected 25 cells"),
    // columns
    ("a missing column", Put(",k66\n", ",note\n"), ":3: k66: ", "missing column"),
    ("a missing column of the pose", Make(|good| cells(good, |_, c| drop(c.remove(3)))), ":1: z0_mm: ", "missing column"),
    ("no column of ids", Make(|good| cells(good, |_, c| drop(c.remove(0)))), ":1: pose: ", "missing column"),
    ("a column twice", Put("pose,theta_deg", "pose,sigma_deg"), ":3: sigma_deg: ", "duplicate"),
    ("a misspelt column", Put("sigma_deg", "simga_deg"), ":3: simga_deg: ", "did you mean `sigma_deg`?"),
    ("a column in capitals", Put("pose,", "POSE,"), ":3: POSE: ", "did you mean `pose`?"),
    ("a column without its underscore", Put("z0_mm", "z0mm"), ":3: z0mm: ", "did you mean `z0_mm`?"),
    ("radians", Put("theta_deg", "theta_rad"), ":3: theta_rad: ", "did you mean `theta_deg`?"),
    ("metres in the header", Put("z0_mm", "z0_m"), ":3: z0_m: ", "did you mean `z0_mm`?"),
    ("a column without its unit", Put("theta_deg", "theta"), ":3: theta: ", "did you mean `theta_deg`?"),
    ("a column without its number", Put(",k11,", ",k1,"), ":3: k1: ", "did you mean `k11`?"),
    ("a column without a name", Put("pose,theta_deg", ",theta_deg"), ":3: ", "column 1 of the header has no name"),
    ("some of the couplings", Put(",k12,", ",note,"), ":3: k12: ", "all 15 couplings or none"),
    ("a pose in both forms", Put(",k66\n", ",q1_mm\n"), ":3: q1_mm: ", "not both"),
    ("screw lengths, one of them missing", Make(|good| good.replace("theta_deg,sigma_deg,z0_mm", "q1_mm,q2_mm,note").into()), ":3: q3_mm: ", "missing column"),
    // cells
    ("a cell too many", Put("O01,-15,", "O01,-15,7,"), ":4: ", "expected 25 cells as in the header, found 26"),
    ("a cell too few", Put("O01,-15,", "O01,"), ":4: ", "expected 25 cells as in the header, found 24"),
    ("a decimal comma", Put("O01,-15,", "O01,-15,0,"), ":4: ", "decimal comma|semicolons"),
    ("a decimal comma in quotes", Put("O01,-15,", "O01,\"-15,0\","), ":4: theta_deg: ", "decimal point"),
    ("text", Put("O01,-15", "O01,x15"), ":4: theta_deg: ", "number|x15"),
    ("nothing", Put("O01,-15", "O01,"), ":4: theta_deg: ", "number|empty cell"),
    ("NaN", Put("O01,-15", "O01,NaN"), ":4: theta_deg: ", "finite number|NaN"),
    ("infinity", Put("O01,-15", "O01,-inf"), ":4: theta_deg: ", "finite number|-inf"),
    ("beyond all numbers", Put("O01,-15", "O01,1e999"), ":4: theta_deg: ", "finite number|1e999"),
    ("hexadecimal", Put("O01,-15", "O01,0x0F"), ":4: theta_deg: ", "number|0x0F"),
    ("Fortran's exponent", Put("4.1715142e6", "4.1715142D+06"), ":4: k11: ", "number|4.1715142D+06"),
    ("an exponent cut off", Put("4.1715142e6", "4.1715142e"), ":4: k11: ", "number"),
    ("two points", Put("4.1715142e6", "4.171.514"), ":4: k11: ", "number|4.171.514"),
    ("a minus of typography", Put("O01,-15", "O01,\u{2212}15"), ":4: theta_deg: ", "minus"),
    ("a degree sign", Put("O01,-15", "O01,-15°"), ":4: theta_deg: ", "without unit"),
    ("a unit", Put("4.1715142e6", "4.17 N/µm"), ":4: k11: ", "without unit"),
    ("spaces for thousands", Put("4.1715142e6", "4 171 514"), ":4: k11: ", "number|4 171 514"),
    ("apostrophes for thousands", Put("4.1715142e6", "4'171'514"), ":4: k11: ", "number|4'171'514"),
    ("a spreadsheet's error", Put("4.1715142e6", "#DIV/0!"), ":4: k11: ", "number|#DIV/0!"),
    ("a spreadsheet's formula", Put("4.1715142e6", "=A1*2"), ":4: k11: ", "number|=A1*2"),
    ("a million digits", Make(|good| good.replacen("4.1715142e6", &"9".repeat(1_000_000), 1).into()), ":4: k11: ", "number"),
    ("10 MB in a cell", Make(|good| good.replacen("4.1715142e6", &"x".repeat(10_000_000), 1).into()), ":4: k11: ", "number"),
    ("deflections", Make(|_| b"pose,theta_deg,sigma_deg,z0_mm,fx_n,dx_um\np1,0,0,530,100,2\np1,0,0,530,-100,-2\n".to_vec()), ":1: ", "these are deflections|pkm-host diagnose"),
    // poses and matrices
    ("an id twice", Put("O02,", "O01,"), ":5: pose: ", "duplicate pose `O01`|line 4"),
    ("out of travel", Put("O01,-15", "O01,-45"), ":4: pose: ", "O01|travel|mm"),
    ("out of reach", Put("O01,-15", "O01,95"), ":4: pose: ", "O01"),
    ("metres for mm", Make(|good| cells(good, |n, c| if n > 0 { c[3] = scaled(&c[3], 1e-3) })), ":2: pose: ", "are lengths in mm?"),
    ("θ and Z0 swapped", Make(|good| cells(good, |n, c| if n > 0 { c.swap(1, 3) })), ":2: pose: ", "O01"),
    ("a negative stiffness", Put("4.1715142e6", "-4.1715142e6"), ":4: k11: ", "from 1 to 1e15"),
    ("no stiffness", Put("4.1715142e6", "0"), ":4: k11: ", "from 1 to 1e15"),
    ("a compliance", Put("4.1715142e6", "2.4e-7"), ":4: k11: ", "from 1 to 1e15"),
    ("not positive definite", Put("4.1715142e6", "4176.2"), ":4: k11…k66: ", "positive definite"),
    ("two columns swapped", Put("k11,k12,k13", "k12,k11,k13"), ":5: k11…k66: ", "positive definite"),
    ("not symmetric", Make(|good| cells(good, |n, c| c.push(if n == 0 { "k21".into() } else { scaled(&c[5], 1.1) }))), ":2: k21: ", "symmetric|k12"),
    // all together
    ("too few poses", Make(|good| good.lines().take(9).map(|l| format!("{l}\n")).collect::<String>().into()), ": ", "6 poses cannot determine the 9 terms|10 are needed"),
    ("θ never moves", Make(|good| cells(good, |n, c| if n > 0 { c[1] = "5".into() })), ": ", "cannot determine the terms|θ"),
    ("Z0 never moves", Make(|good| cells(good, |n, c| if n > 0 { c[3] = "530".into() })), ": ", "cannot determine the terms|Z0"),
    ("a correction that is not positive", Make(|good| cells(good, |n, c| {
        // halfway in the box c33 would have to be negative
        if n > 0 {
            let factor = 1e-3 + (c[1].parse::<f64>().unwrap() / 15.0).powi(4);
            c[4..].iter_mut().for_each(|k| *k = scaled(k, factor));
        }
    })), ": ", "not positive at|box"),
];
