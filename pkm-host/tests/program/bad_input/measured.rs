//! Measured files: what every command refuses, and what a diagnosis does.

use super::{Kind, Make, Put, Reader};
use crate::common::fixture;

const GOOD: &str = "\
pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,dx_um,dy_um,dz_um,rx_urad,ry_urad,rz_urad,series,direction,\
temperature_c,sigma_linear_um,point_u_mm,point_v_mm,point_w_mm
a,0,0,530,0,0,0,0,0,0,0,0,0,0,0,0,s1,load,20,0.5,0,0,10
a,0,0,530,100,0,-400,0,5.5,0,12.5,0,,-3.5,0,0,s1,load,21,0.5,0,0,10
b,5,0,530,100,0,-400,0,5.5,0,12.5,0,,-3.5,0,0,s1,unload,21,0.5,0,0,10
";

#[test]
fn measured_files() {
    let call = ["predict", "--data", "BAD", "--out", "OUT"];
    Reader { good: GOOD, name: "d.csv", call: &call, old: "out" }.refuses_text(&KINDS.iter().collect::<Vec<_>>(), 20);
}

#[test]
fn readings_to_diagnose() {
    let good = std::fs::read_to_string(fixture("measured/p05/measured.csv")).unwrap();
    let call = ["diagnose", "--data", "BAD", "--out", "OUT"];
    Reader { good: &good, name: "d.csv", call: &call, old: "out/machine.toml" }
        .refuses_text(&TO_DIAGNOSE.iter().collect::<Vec<_>>(), 18);
}

/// Changes the cells of columns whose names end so; the row counts from 0.
fn columns(text: &str, ends: &[&str], change: impl Fn(usize, &str) -> String) -> Vec<u8> {
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let header = lines.next().unwrap();
    let chosen: Vec<bool> = header.split(',').map(|name| ends.iter().any(|end| name.ends_with(end))).collect();
    let row = |(n, line): (usize, &str)| {
        let cells =
            line.split(',').zip(&chosen).map(|(cell, chosen)| if *chosen { change(n, cell) } else { cell.into() });
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    format!("{header}\n{}", lines.enumerate().map(row).collect::<String>()).into()
}

fn scaled(cell: &str, factor: f64) -> String {
    (cell.parse::<f64>().unwrap() * factor).to_string()
}

const DEFLECTIONS: &[&str] = &["x_um", "y_um", "z_um", "_urad"];

#[rustfmt::skip] // a kind a line
const KINDS: &[Kind] = &[
    ("no force and no moment", Make(|good| good.replace("fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm", "a,b,c,d,e,f").into()), ":1: fx_n: ", "missing column"),
    ("kilonewtons", Put("fz_n", "fz_kn"), ":1: fz_kn: ", "did you mean `fz_n`?"),
    ("newton millimetres", Put("my_nm", "my_nmm"), ":1: my_nmm: ", "did you mean `my_nm`?"),
    ("millimetres for micrometres", Put("dx_um", "dx_mm"), ":1: dx_mm: ", "did you mean `dx_um`?"),
    ("milliradians", Put("rx_urad", "rx_mrad"), ":1: rx_mrad: ", "did you mean `rx_urad`?"),
    ("kelvins", Put("temperature_c", "temperature_k"), ":1: temperature_k: ", "did you mean `temperature_c`?"),
    ("a misspelt series", Put("series", "seires"), ":1: seires: ", "did you mean `series`?"),
    ("a point without its height", Put("point_w_mm", "note"), ":1: point_w_mm: ", "missing column"),
    ("a deflection twice", Put("dy_um", "dx_um"), ":1: dx_um: ", "duplicate"),
    ("a direction of another name", Put("unload", "north"), ":4: direction: ", "expected `load` or `unload`, found `north`"),
    ("an endless direction", Make(|good| good.replace("unload", &"x".repeat(1_000_000)).into()), ":4: direction: ", "expected `load` or `unload`"),
    ("a blank force", Put("530,100,", "530,,"), ":3: fx_n: ", "number|empty cell"),
    ("a blank height", Put("0.5,0,0,10\nb", "0.5,0,0,\nb"), ":3: point_w_mm: ", "number|empty cell"),
    ("a question mark for a channel not measured", Put("12.5,0,,", "12.5,0,?,"), ":3: dz_um: ", "number|leave the cell empty"),
    ("NaN for a channel not measured", Put("12.5,0,,", "12.5,0,NaN,"), ":3: dz_um: ", "number|leave the cell empty"),
    ("an infinite deflection", Put("12.5,0,,", "inf,0,,"), ":3: dx_um: ", "finite number"),
    ("an infinite force", Put("530,100", "530,1e999"), ":3: fx_n: ", "finite number"),
    ("a negative deviation", Put("21,0.5", "21,-0.5"), ":3: sigma_linear_um: ", "at least 0|-0.5"),
    ("text for a temperature", Put("load,21", "load,warm"), ":3: temperature_c: ", "number|warm"),
    ("a temperature below all", Put("load,21", "load,-300"), ":3: temperature_c: ", "-273.15"),
    ("a temperature with its unit", Put("load,21", "load,21°C"), ":3: temperature_c: ", "without unit"),
    ("a pose out of travel", Put("a,0,0,530,100", "a,0,0,930,100"), ":3: pose: ", "pose `a`|travel"),
    ("a pose in metres", Put("a,0,0,530,100", "a,0,0,0.53,100"), ":3: pose: ", "are lengths in mm?"),
    ("a cell too few", Put("530,100,0,-400", "530,100,-400"), ":3: ", "expected 23 cells as in the header, found 22"),
    ("a decimal comma", Put("a,0,0,530,100", "a,0,0,530,0,100"), ":3: ", "decimal comma"),
];

#[rustfmt::skip] // a kind a line
const TO_DIAGNOSE: &[Kind] = &[
    ("no repeats and no deviation declared", Make(|good| good.lines().filter(|l| ["pose", ",1,load", ",1,unload"].iter().any(|p| l.contains(p))).map(|l| format!("{l}\n")).collect::<String>().into()), ": ", "sigma_linear_um"),
    ("too few poses", Make(|good| good.lines().filter(|l| l.starts_with("pose") || *l < "p04").map(|l| format!("{l}\n")).collect::<String>().into()), ": ", "poses cannot tell"),
    ("millimetres", Make(|good| columns(good, DEFLECTIONS, |_, c| scaled(c, 1e-3))), ": ", "are they in µm"),
    ("nanometres", Make(|good| columns(good, DEFLECTIONS, |_, c| scaled(c, 1e3))), ": ", "are they in µm"),
    ("no deflection at all", Make(|good| columns(good, DEFLECTIONS, |_, _| String::new())), ": ", "blank deflection columns"),
    ("no columns of deflections", Make(|good| good.replace("dx_um", "a").replace("dy_um", "b").replace("dz_um", "c").replace("rx_urad", "d").replace("ry_urad", "e").replace("rz_urad", "f").into()), ":2: dx_um: ", "at least one deflection column"),
    ("no load", Make(|good| columns(good, &["_n", "_nm"], |_, _| "0".into())), ": ", "no reading is under load"),
    ("one bad deflection far down", Make(|good| columns(good, &["dx_um"], |n, c| if n == 20 { "nan".into() } else { c.into() })), ":22: dx_um: ", "number"),
    ("a load of another size", Make(|good| columns(good, &["fx_n"], |n, c| if n == 20 { "1e300".into() } else { c.into() })), ":22: fx_n: ", "1e12"),
    ("the loads in kN", Make(|good| columns(good, &["_n", "_nm"], |_, c| scaled(c, 1e-3))), ": ", "are they in µm"),
];
