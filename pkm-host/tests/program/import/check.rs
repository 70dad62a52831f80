//! `check`: everything that is wrong or doubtful, at once, and nothing of a good file.

use rayon::prelude::*;
use serde_json::Value;

use super::cells;
use super::table::{Table, good};
use crate::common::{Folder, fixture, json, run};

/// A set of readings in which nothing is doubtful.
const SET: &str = "own-none-1";

fn clean() -> Table {
    let text = std::fs::read_to_string(fixture(&format!("measured/{SET}/measured.csv"))).unwrap();
    cells(&text.lines().filter(|l| !l.starts_with('#')).map(|l| format!("{l}\n")).collect::<String>())
}

/// Exit status and document.
fn checked(text: &str) -> (i32, Value) {
    let folder = Folder::new();
    let data = folder.write("d.csv", text);
    let machine = fixture(&format!("measured/{SET}/machine.toml"));
    let output = run(&["check", &data, "--machine", &machine, "--json"]);
    let document = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {output:?}"));
    (output.status.code().unwrap(), document)
}

/// What is done to a good set, the kind of the problem, its line (0: of no line), its column, words of the message, and how many
/// problems there are in all.
type Case = (&'static str, fn(Table) -> Table, &'static str, u64, &'static str, &'static str, usize);

fn scaled(cell: &str, factor: f64) -> String {
    (cell.parse::<f64>().unwrap() * factor).to_string()
}

const TRANSLATIONS: [&str; 3] = ["dx_um", "dy_um", "dz_um"];
const ROTATIONS: [&str; 3] = ["rx_urad", "ry_urad", "rz_urad"];
const DEFLECTIONS: [&str; 6] = ["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad"];
const LOADS: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];

/// Changes some cells of one row.
fn row(mut table: Table, row: usize, names: &[&str], change: impl Fn(&str) -> String) -> Table {
    for name in names {
        let n = table.column(name);
        table.rows[row][n] = change(&table.rows[row][n]);
    }
    table
}

/// Changes some cells of the second pose.
fn pose(table: Table, names: &[&str], change: impl Fn(&str) -> String) -> Table {
    (60..120).fold(table, |table, n| row(table, n, names, &change))
}

/// Exchanges two columns at the second pose.
fn pose_exchanged(mut table: Table, [a, b]: [&str; 2]) -> Table {
    let (a, b) = (table.column(a), table.column(b));
    table.rows[60..120].iter_mut().for_each(|row| row.swap(a, b));
    table
}

/// Rows of the set that begin a pose, and have loads of one sign.
fn one_sign(mut table: Table) -> Table {
    let loads = LOADS.map(|name| table.column(name));
    table.rows.retain(|row| loads.iter().all(|n| !row[*n].starts_with('-') || row[*n].trim_start_matches('-') == "0"));
    table
}

/// The loads of the set as they are at a point 450 mm below A, and given as loads at A.
fn with_lever(mut table: Table) -> Table {
    let [fx, fy, _, mx, my, _] = LOADS.map(|name| table.column(name));
    let number = |row: &[String], n: usize| row[n].parse::<f64>().unwrap();
    for row in &mut table.rows {
        let (force, moment) = ([fx, fy].map(|n| number(row, n)), [mx, my].map(|n| number(row, n)));
        row[mx] = (moment[0] + 0.45 * force[1]).to_string();
        row[my] = (moment[1] - 0.45 * force[0]).to_string();
    }
    table
}

/// A zero that moves by some µm with each reading of a series, from every second series on.
fn with_drift(mut table: Table, um_per_reading: f64) -> Table {
    let [series, z] = ["series", "dz_um"].map(|name| table.column(name));
    let (mut last, mut place, mut count) = (String::new(), 0, 0);
    for row in &mut table.rows {
        if row[series] != last {
            (last, place, count) = (row[series].clone(), 0, count + 1);
        }
        if count % 2 == 0 {
            row[z] = (row[z].parse::<f64>().unwrap() + um_per_reading * f64::from(place)).to_string();
        }
        place += 1;
    }
    table
}

/// Exchanges the deflections of the first two poses, in the second repeat alone.
fn repeat_exchanged(mut table: Table) -> Table {
    let [n, repeat] = ["dx_um", "repeat"].map(|name| table.column(name));
    for row in 0..60 {
        if table.rows[row][repeat] != "2" {
            continue;
        }
        let [a, b] = table.rows.get_disjoint_mut([row, row + 60]).unwrap();
        a[n..n + 6].swap_with_slice(&mut b[n..n + 6]);
    }
    table
}

/// The first reading of each pose and load.
fn without_repeats(mut table: Table) -> Table {
    let n = table.column("repeat");
    table.rows.retain(|row| row[n] == "1");
    table
}

#[rustfmt::skip] // a case a line
const DOUBTFUL: &[Case] = &[
    ("nothing", |t| t, "", 0, "", "", 0),
    ("angles in radians", |t| t.map(&["theta_deg", "sigma_deg"], |c| c.parse::<f64>().unwrap().to_radians().to_string()), "angles_in_radians", 0, "theta_deg", "theta [rad]", 2),
    ("temperatures in kelvins", |t| t.with(19, "temperature_c", "293.4"), "temperature_in_kelvin", 2, "temperature_c", "temperature [K]|and 594 more", 1),
    ("temperatures in degrees Fahrenheit", |t| t.with(19, "temperature_c", "71.5"), "temperature_in_fahrenheit", 0, "temperature_c", "temperature [°F]|below 71.5", 1),
    ("a temperature left out", |t| row(t.with(19, "temperature_c", "23.4"), 5, &["temperature_c"], |_| String::new()), "temperature_left_out", 7, "temperature_c", "no temperature in line 7|20 °C is taken", 1),
    ("a point in metres", |t| t.with(4, "point_u_mm", "0").with(5, "point_v_mm", "0").with(6, "point_w_mm", "0.01"), "point_in_metres", 0, "point_u_mm", "point_u [m]", 1),
    ("a placeholder for no value", |t| row(t, 20, &["dx_um"], |_| "9999".into()), "placeholder", 22, "dx_um", "empty the cell", 2),
    ("a negative one with decimals", |t| row(t, 21, &["rz_urad"], |_| "-9999.99".into()), "placeholder", 23, "rz_urad", "-9999.99", 2),
    ("a channel that is not connected", |t| t.map(&["dz_um"], |_| "0.00".into()), "constant_channel", 0, "dz_um", "all 600 readings are 0", 2),
    ("a channel that is not connected, beside blank rows and readings without load", |t| [(3, ""), (4, ""), (7, "0")].iter().fold(t.map(&["dz_um"], |_| "0.00".into()), |t, (n, cell)| row(row(t, *n, &DEFLECTIONS, |_| (*cell).into()), *n, if cell.is_empty() { &[] } else { &LOADS }, |_| "0".into())), "constant_channel", 0, "dz_um", "all 598 readings are 0", 2),
    ("a channel that is stuck", |t| t.map(&["rx_urad"], |_| "17.3".into()), "constant_channel", 0, "rx_urad", "all 600 readings are 17.3", 2),
    ("a digit lost", |t| row(t, 1, &["dx_um"], |c| scaled(c, 0.8)), "gross_error", 3, "dx_um", "mistyped", 1),
    ("a digit too many", |t| row(t, 30, &["dx_um"], |c| scaled(c, 100.0)), "repeats_differ", 32, "dx_um", "repeats in lines 32, 37 differ|times as much as repeats elsewhere", 1),
    ("one row with its sign reversed", |t| row(t, 1, &DEFLECTIONS, |c| scaled(c, -1.0)), "reversed_sign", 3, "", "opposite sign", 1),
    ("one row without its load", |t| row(t, 1, &LOADS, |_| "0".into()), "load_missing", 3, "", "was the load lost", 1),
    ("a row that stands twice", |mut t| { let row = t.rows[12].clone(); t.rows.insert(13, row); t }, "duplicate_row", 15, "", "the same reading as in line 14", 1),
    ("rows that stand twice", |mut t| { let rows = t.rows[12..15].to_vec(); t.rows.extend(rows); t }, "duplicate_row", 602, "", "the same reading as in line 14, and as often in lines 603, 604", 1),
    ("rows of two poses with their sign reversed", |t| (10..110).fold(t, |t, n| row(t, n, &DEFLECTIONS, |c| scaled(c, -1.0))), "reversed_sign", 13, "", "opposite sign of what the load gives, unlike in other rows (as in lines", 1),
    ("two poses with their sign reversed", |t| (0..120).fold(t, |t, n| row(t, n, &DEFLECTIONS, |c| scaled(c, -1.0))), "pose_taken_otherwise", 2, "", "pose p01 (line 2), pose p02 (line 62) fit the declared machine much better with all signs reversed|at other poses 1.", 1),
    ("a pose with one channel reversed", |t| pose(t, &["rx_urad"], |c| scaled(c, -1.0)), "pose_taken_otherwise", 62, "", "pose p02 (line 62)|with −rx, ry, rz in place of rx, ry, rz", 1),
    ("a pose in arcseconds", |t| pose(t, &ROTATIONS, |c| scaled(c, 0.648 / std::f64::consts::PI)), "pose_taken_otherwise", 62, "", "with rotations in arcseconds", 1),
    ("a pose in mm", |t| pose(t, &TRANSLATIONS, |c| scaled(c, 1e-3)), "pose_taken_otherwise", 62, "", "with translations in mm", 1),
    ("a pose under forces in kgf", |t| pose(t, &LOADS[..3], |c| scaled(c, 1.0 / 9.806_65)), "pose_taken_otherwise", 62, "", "with forces in kgf or daN", 1),
    ("a pose without its loads", |t| pose(t, &DEFLECTIONS, |c| scaled(c, 1e-3)), "pose_taken_otherwise", 62, "", "as if no load had been put on", 1),
    ("a pose with its theta mistyped", |t| pose(t, &["theta_deg"], |c| (c.parse::<f64>().unwrap() + 6.0).to_string()), "pose_taken_otherwise", 62, "", "pose p02 (line 62)|with theta at -13.7 deg, not -7.7", 1),
    ("a pose with its z0 mistyped", |t| pose(t, &["z0_mm"], |c| (c.parse::<f64>().unwrap() + 20.0).to_string()), "pose_taken_otherwise", 62, "", "pose p02 (line 62)|with z0 at 51|mm, not 532.0", 1),
    ("second readings of another scale", |t| { let n = t.column("repeat"); (0..600).filter(|row| t.rows[*row][n] == "2").collect::<Vec<_>>().into_iter().fold(t, |t, row_n| row(t, row_n, &DEFLECTIONS, |c| scaled(c, 1.03))) }, "repeats_of_other_scale", 0, "", "the second reading has translations 3.|%) more and rotations|Diagnose the repeats apart", 1),
    ("two poses exchanged", |mut t| { let n = t.column("dx_um"); for row in 0..60 { let [a, b] = t.rows.get_disjoint_mut([row, row + 60]).unwrap(); a[n..n + 6].swap_with_slice(&mut b[n..n + 6]) } t }, "pose_taken_otherwise", 2, "", "pose p01 (line 2)|as those of pose p02 (line 62)", 2),
    ("two poses exchanged in one of their repeats", repeat_exchanged, "pose_taken_otherwise", 7, "", "pose p01 (line 7), one repeat of it,|as those of pose p02 (line 67)", 2),
    ("a pose with two columns exchanged", |t| pose_exchanged(t, ["dx_um", "dy_um"]), "pose_taken_otherwise", 62, "", "with dx, dy, dz along v, u, w, rotations as they are", 1),
    ("a pose with all columns of x and y exchanged", |t| pose_exchanged(pose_exchanged(t, ["dx_um", "dy_um"]), ["rx_urad", "ry_urad"]), "pose_taken_otherwise", 62, "", "with dx, dy, dz along v, u, w, and ry, rx, rz in place of rx, ry, rz", 1),
    ("a pose in nm", |t| pose(t, &TRANSLATIONS, |c| scaled(c, 1e3)), "pose_taken_otherwise", 62, "", "with translations in nm", 1),
    ("a pose in degrees", |t| pose(t, &ROTATIONS, |c| scaled(c, 1e-6_f64.to_degrees())), "pose_taken_otherwise", 62, "", "with rotations in degrees", 1),
    ("a pose with its loads in kN", |t| pose(t, &LOADS, |c| scaled(c, 1e-3)), "pose_taken_otherwise", 62, "", "with forces in kN (", 1),
    ("a pose with a digit too many in its loads", |t| pose(t, &LOADS, |c| scaled(c, 10.0)), "pose_taken_otherwise", 62, "", "with loads a tenth as large", 1),
    ("a pose that yields a little more", |t| pose(t, &DEFLECTIONS, |c| scaled(c, 1.2)), "", 0, "", "", 0),
    ("a pose at which the instrument's clamp is loose", |t| pose(t, &["dx_um", "rz_urad"], |c| scaled(c, 2.0)), "", 0, "", "", 0),
    ("a pose in mm, and a gross error elsewhere", |t| row(pose(t, &TRANSLATIONS, |c| scaled(c, 1e-3)), 400, &["dx_um"], |c| scaled(c, 30.0)), "pose_taken_otherwise", 62, "", "with translations in mm", 2),
    ("rotations of the wrong sign", |t| t.map(&ROTATIONS, |c| scaled(c, -1.0)), "readings_taken_otherwise", 0, "", "with the signs of all rotations reversed", 1),
    ("loads in pounds", |t| t.map(&LOADS[..3], |c| scaled(c, 1.0 / 4.448_221_615)).map(&LOADS[3..], |c| scaled(c, 1.0 / 1.355_817_948)), "readings_taken_otherwise", 0, "", "with forces in lbf and moments in lbf·ft", 1),
    ("forces in pounds", |t| t.map(&LOADS[..3], |c| scaled(c, 1.0 / 4.448_221_615)), "readings_taken_otherwise", 0, "", "with forces in lbf, or with forces in lbf and moments in lbf·ft (", 1),
    ("loads that never turn", one_sign, "loads_of_one_sign", 0, "", "load reversed", 1),
    ("loads that scatter", |t| t.with(4, "load_random", "0.3"), "loads_that_scatter", 0, "load_random", "scatter by 30 % (median)|clocks", 1),
    ("no repeats", without_repeats, "few_repeats", 0, "", "0 repeated rows to take the noise of a channel from|read 10 more|such as those of lines", 1),
    ("a series at several poses", |t| t.map(&["series"], |_| "1".into()), "series_at_several_poses", 0, "", "number the series through", 1),
    ("a pose with another place", |t| row(t, 0, &["theta_deg"], |c| scaled(c, 1.01)), "pose_name_at_several_positions", 0, "", "mistyped", 2),
    ("translations in mm", |t| t.map(&TRANSLATIONS, |c| scaled(c, 1e-3)), "cannot_be_diagnosed", 0, "", "`diagnose` refuses these readings: the translations read are 1e-3 times what the declared machine gives: are they in µm", 1),
    ("one rotation reversed", |t| t.map(&["rx_urad"], |c| scaled(c, -1.0)), "readings_taken_otherwise", 0, "", "with −rx, ry, rz in place of rx, ry, rz", 1),
    ("zeros that creep", |t| with_drift(t, 1.5), "drift_within_series", 0, "", "the zero drifts while a series is read|from the first reading to the last dz_um by", 1),
    ("zeros that creep by less than the noise", |t| with_drift(t, 0.02), "", 0, "", "", 0),
    ("a gauge that sticks", |t| (60..70).fold(t, |t, n| row(t, n, &["dx_um"], |_| "12.34".into())), "stuck_readings", 62, "", "dx_um reads 12.3 µm 5 times in a row while the load changes, and so does another run|a sensor that sticks", 1),
    ("half of a pose in mm", |t| (60..90).fold(t, |t, n| row(t, n, &TRANSLATIONS, |c| scaled(c, 1e-3))), "rows_in_other_unit", 62, "", "the translations are next to nothing|are they in mm, or was the load not there? A diagnosis leaves this out", 1),
    ("half of a pose in mrad", |t| (70..100).fold(t, |t, n| row(t, n, &ROTATIONS, |c| scaled(c, 1e-3))), "rows_in_other_unit", 73, "", "the rotations are next to nothing|are they in mrad", 1),
    ("a sixth of the rows in mm", |t| (0..600).filter(|n| n % 60 < 10).fold(t, |t, n| row(t, n, &TRANSLATIONS, |c| scaled(c, 1e-3))), "rows_in_other_unit", 2, "", "are they in mm|`diagnose` refuses so many of them", 1),
    ("three poses, and no repeats", |mut t| { t.rows.truncate(180); without_repeats(t) }, "cannot_be_diagnosed", 0, "", "`diagnose` refuses these readings: 3 poses cannot tell", 2),
    ("four poses, one of them in mm", |mut t| { t.rows.truncate(240); pose(t, &TRANSLATIONS, |c| scaled(c, 1e-3)) }, "cannot_be_diagnosed", 0, "", "3 poses that are not left out cannot tell", 2),
    ("loads 450 mm above where the file has them", with_lever, "readings_taken_otherwise", 0, "", " with loads that act |(u, v, w) from where the file has them", 1),
    ("all signs reversed", |t| t.map(&DEFLECTIONS, |c| scaled(c, -1.0)), "readings_taken_otherwise", 0, "", "with all signs reversed", 1),
    ("one force reversed", |t| t.map(&["fz_n"], |c| scaled(c, -1.0)), "readings_taken_otherwise", 0, "", "with forces along u, v, −w", 1),
    ("two forces exchanged", |t| t.exchanged("fx_n", "fy_n"), "readings_taken_otherwise", 0, "", "with forces along v, u, w", 1),
    ("two angles exchanged", |t| t.exchanged("theta_deg", "sigma_deg"), "readings_taken_otherwise", 0, "", "with theta and sigma exchanged", 1),
    ("one angle reversed", |t| t.map(&["sigma_deg"], |c| scaled(c, -1.0)), "readings_taken_otherwise", 0, "", "with sigma reversed", 1),
    ("rotations in arcseconds", |t| t.map(&ROTATIONS, |c| scaled(c, 0.648 / std::f64::consts::PI)), "readings_taken_otherwise", 0, "", "with rotations in arcseconds", 1),
    ("rotations in millidegrees", |t| t.map(&ROTATIONS, |c| scaled(c, 0.18 / std::f64::consts::PI)), "readings_taken_otherwise", 0, "", "thousandths of a degree", 1),
    ("translations in thou", |t| t.map(&TRANSLATIONS, |c| scaled(c, 1.0 / 25.4)), "readings_taken_otherwise", 0, "", "thousandths of an inch", 1),
];

fn check_case((what, spoil, kind, line, column, words, count): &Case) -> Result<(), String> {
    let (code, document) = checked(&spoil(clean()).text(','));
    let problems = document["problems"].as_array().ok_or_else(|| format!("{what}: {document}"))?;
    let list = problems.iter().map(|p| format!("{p}\n")).collect::<String>();
    if code != 0 || problems.iter().any(|p| p["severity"] != "doubtful") {
        return Err(format!("{what}: exit {code}: {list}"));
    }
    if problems.len() != *count {
        return Err(format!("{what}: {} problems: {list}", problems.len()));
    }
    let is_it = |p: &&Value| {
        p["kind"] == *kind && p["line"].as_u64().unwrap_or(0) == *line && p["column"].as_str().unwrap_or("") == *column
    };
    let found = problems.iter().find(is_it).map(|p| p["message"].as_str().unwrap());
    match found {
        None if *count == 0 => Ok(()),
        Some(message) if words.split('|').all(|word| message.contains(word)) => Ok(()),
        _ => Err(format!("{what}: no {kind} at {line} {column}: {list}")),
    }
}

#[test]
fn what_is_doubtful_is_named_with_its_place() {
    let wrong: Vec<String> = DOUBTFUL.par_iter().filter_map(|case| check_case(case).err()).collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), DOUBTFUL.len(), wrong.join("\n"));
}

/// Seven mistakes of five kinds: two kinds stand in several rows, and are said once each.
#[test]
fn all_that_is_wrong_is_listed_at_once() {
    let table = good()
        .put(0, "dx_um", "65.31 µm")
        .put(1, "dx_um", "471.44 µm")
        .put(2, "fx_n", "")
        .put(3, "direction", "north")
        .put(3, "z0_mm", "940")
        .put(4, "temperature_c", "-300")
        .put(5, "dx_um", "2.93 µm");
    let (code, document) = checked(&table.text(','));
    assert_eq!(code, 2, "{document}");
    let problems = document["problems"].as_array().unwrap();
    let wrong: Vec<(u64, &str)> = problems
        .iter()
        .filter(|p| p["severity"] == "wrong")
        .map(|p| (p["line"].as_u64().unwrap(), p["column"].as_str().unwrap()))
        .collect();
    assert_eq!(wrong, [(2, "dx_um"), (4, "fx_n"), (5, "pose"), (5, "direction"), (6, "temperature_c")], "{document}");
    assert_eq!(problems[0]["lines"], serde_json::json!([2, 3, 7]));
    assert_eq!(document["error"]["line"], 2);
    assert_eq!(document["error"]["kind"], "input");

    let folder = Folder::new();
    let data = folder.write("d.csv", &table.text(','));
    let output = run(&["check", &data]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), said.matches("error: ").count()), (Some(2), 5), "{said}");
    assert!(
        said.contains(":2: dx_um: ") && said.contains("the same in lines 3, 7") && said.contains(":5: pose: "),
        "{said}"
    );
    assert!(output.stdout.is_empty() && folder.contents().len() == 1);
}

#[test]
fn a_file_without_a_header_is_one_problem() {
    let (code, document) = checked("Dear colleague,\nthe data follow.\n");
    assert_eq!((code, document["problems"].as_array().unwrap().len()), (2, 1), "{document}");
    assert_eq!(document["problems"][0]["line"], 1);
}

#[test]
fn rows_of_another_width_are_all_named() {
    let text = good().text(',').replace("p02,", "p02,,");
    let (code, document) = checked(&text);
    assert_eq!((code, &document["problems"][0]["lines"]), (2, &serde_json::json!([5, 6])), "{document}");
}

/// Doubts do not stand in the way of a diagnosis, and are no failure of a check.
#[test]
fn a_good_file_is_told_so() {
    let folder = Folder::new();
    let machine = fixture(&format!("measured/{SET}/machine.toml"));
    let data = folder.write("d.csv", &clean().text('\t'));
    let output = run(&["check", &data, "--machine", &machine]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        said.contains("tabs between cells")
            && said.contains("600 readings at 10 poses; wrong: nothing; doubtful: nothing"),
        "{said}"
    );
    let document = json(&["check", &data, "--machine", &machine]);
    assert_eq!((document["readings"].as_u64(), document["poses"].as_u64()), (Some(600), Some(10)));
}
