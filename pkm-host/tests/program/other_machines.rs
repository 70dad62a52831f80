//! Diagnoses of machines of another size than the reference's, and of errors that are greater than people think.

use serde_json::Value;

use crate::common::{Folder, fixture, json};

fn read(set: &str, file: &str) -> String {
    std::fs::read_to_string(fixture(&format!("measured/{set}/{file}"))).unwrap()
}

/// The numbers of a text times a factor; what is between them stays.
fn scaled(text: &str, factor: f64) -> String {
    let is_of_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | 'e' | '+' | '-');
    let mut all = String::new();
    for part in text.split_inclusive(|c| !is_of_number(c)) {
        let number = part.trim_end_matches(|c| !is_of_number(c));
        match number.parse::<f64>() {
            Ok(value) => all.push_str(&format!("{}{}", value * factor, &part[number.len()..])),
            Err(_) => all.push_str(part),
        }
    }
    all
}

/// A machine file with all stiffnesses times a factor.
fn stiffer(machine: &str, factor: f64) -> String {
    let line = |line: &str| match line.split_once(" = [") {
        Some((key, values)) if key.ends_with("_per_m") || key.ends_with("_per_rad") => {
            format!("{key} = [{}\n", scaled(values, factor))
        }
        _ => {
            let mut parts = line.split("_gpa = ");
            let first = parts.next().unwrap().to_owned();
            let rest = parts.map(|part| {
                let end = part.find(',').unwrap();
                format!("_gpa = {}{}", scaled(&part[..end], factor), &part[end..])
            });
            first + &rest.collect::<String>() + "\n"
        }
    };
    machine.lines().map(line).collect()
}

/// Readings with cells changed, by name of the column.
fn with_cells(readings: &str, change: impl Fn(&[&str], &mut [f64])) -> String {
    let mut lines = readings.lines().filter(|line| !line.starts_with('#'));
    let head = lines.next().unwrap();
    let names: Vec<&str> = head.split(',').collect();
    let of = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let mut values: Vec<f64> = cells.iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        change(&names, &mut values);
        let text = |(cell, value): (&&str, f64)| if value.is_nan() { (*cell).to_owned() } else { value.to_string() };
        cells.iter().zip(values).map(text).collect::<Vec<_>>().join(",") + "\n"
    };
    format!("{head}\n{}", lines.map(of).collect::<String>())
}

fn diagnosed(folder: &Folder, machine: &str, measured: &str, held_out: &str) -> Value {
    let machine = folder.write("m.toml", machine);
    let (data, held_out) = (folder.write("d.csv", measured), folder.write("h.csv", held_out));
    json(&["diagnose", "--machine", &machine, "--data", &data, "--holdout", &held_out, "--out", &folder.path("out")])
}

/// A machine twenty times as stiff under twenty times the loads moves as the other does. What depends on the load is then found at
/// twenty times the load, in the same words, and predicts as well.
#[test]
fn the_size_of_the_loads_changes_nothing_but_numbers() {
    const SET: &str = "own-contact-stiffening-easy";
    let of = |factor: f64| {
        let loads = |names: &[&str], values: &mut [f64]| {
            let is_load = |name: &str| matches!(name, "fx_n" | "fy_n" | "fz_n" | "mx_nm" | "my_nm" | "mz_nm");
            values.iter_mut().zip(names).filter(|v| is_load(v.1)).for_each(|v| *v.0 *= factor);
        };
        let [measured, held_out] = ["measured.csv", "heldout.csv"].map(|file| with_cells(&read(SET, file), loads));
        diagnosed(&Folder::new(), &stiffer(&read(SET, "machine.toml"), factor), &measured, &held_out)
    };
    let [small, great] = [1.0, 20.0].map(of);
    for key in ["verdict", "suspect_readings"] {
        assert_eq!(small[key], great[key], "{key}");
    }
    let only = |found: &Value, key: &str| found["effects"][0][key].clone();
    for key in ["id", "where", "where_class", "law", "class"] {
        assert_eq!(only(&small, key), only(&great, key), "{key}");
    }
    let reference_n = |found: &Value| found["effects"][0]["parameters"]["reference_n"]["value"].as_f64().unwrap();
    let ratio = reference_n(&great) / reference_n(&small);
    assert!((ratio / 20.0 - 1.0).abs() < 1e-3, "{ratio}");
    let rms = |found: &Value| found["holdout"]["after"]["linear_um_rms"].as_f64().unwrap();
    assert!((rms(&great) / rms(&small) - 1.0).abs() < 1e-3, "{} {}", rms(&great), rms(&small));
}

/// A sensor that was clamped on 3.5° off is found with that angle. With a bound of 2.3° it was found with two thirds of it, and the
/// verdict was `explained`.
#[test]
fn a_sensor_that_stands_far_off_is_found_with_its_angle() {
    const SET: &str = "own-none-1";
    let turned = |names: &[&str], values: &mut [f64]| {
        let (sin, cos) = 0.0611_f64.sin_cos();
        for pair in [["dx_um", "dy_um"], ["rx_urad", "ry_urad"]] {
            let [x, y] = pair.map(|name| names.iter().position(|n| *n == name).unwrap());
            (values[x], values[y]) = (cos * values[x] + sin * values[y], cos * values[y] - sin * values[x]);
        }
    };
    let [machine, measured, held_out] = ["machine.toml", "measured.csv", "heldout.csv"].map(|file| read(SET, file));
    let found = diagnosed(&Folder::new(), &machine, &with_cells(&measured, turned), &held_out);
    let effects = found["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 1, "{effects:?}");
    assert_eq!((&effects[0]["id"], &found["verdict"]), (&"sensor-rotation".into(), &"explained".into()), "{effects:?}");
    let angle = &effects[0]["parameters"]["about_w_rad"];
    let (value, error) = (angle["value"].as_f64().unwrap().abs(), angle["stderr"].as_f64().unwrap());
    assert!((value - 0.0611).abs() < 3.0 * error && error < 3e-3, "{value} ± {error}");
}
