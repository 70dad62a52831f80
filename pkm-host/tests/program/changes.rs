//! Readings that are not of one measurement: what began at one of the poses, and poses that are not where the file has them.

use serde_json::Value;

use crate::common::{Folder, fixture, json};

/// The readings of a practice set with cells changed: by the number of the row's pose in the file's order, from 0, and the column.
fn changed(set: &str, change: impl Fn(usize, &str, f64) -> Option<f64>) -> String {
    let text = std::fs::read_to_string(measured(set, "measured.csv")).unwrap();
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut out = header.join(",") + "\n";
    let (mut name, mut pose) = (None, 0);
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        if name.replace(cells[0]).is_some_and(|before| before != cells[0]) {
            pose += 1;
        }
        let of = |(cell, column): (&&str, &&str)| match cell.parse() {
            Ok(value) => change(pose, column, value).map_or(String::new(), |v| v.to_string()),
            Err(_) => (*cell).to_owned(),
        };
        out.push_str(&(cells.iter().zip(&header).map(of).collect::<Vec<_>>().join(",") + "\n"));
    }
    out
}

fn measured(set: &str, file: &str) -> String {
    fixture(&format!("measured/{set}/{file}"))
}

fn is_read(column: &str) -> bool {
    column.ends_with("_um") || column.ends_with("_urad")
}

fn diagnosed(set: &str, data: &str) -> Value {
    let folder = Folder::new();
    let (machine, data) = (measured(set, "machine.toml"), folder.write("d.csv", data));
    json(&["diagnose", "--machine", &machine, "--data", &data, "--out", &folder.path("out")])
}

/// Places and laws of what was found, in order of their names.
fn found(diagnosis: &Value) -> Vec<String> {
    let effects = diagnosis["effects"].as_array().unwrap();
    let mut all: Vec<String> =
        effects.iter().map(|e| format!("{}: {}", e["where"].as_str().unwrap(), e["law"].as_str().unwrap())).collect();
    all.sort();
    all
}

/// A sensor that reads 4 % more from the middle of a campaign on is that, whatever is wrong with the machine beside it.
#[test]
fn what_began_at_a_pose_is_no_part_of_the_machine() {
    for (set, poses, machine) in [("p01", 10, None), ("p18", 15, Some("moving_platform: constant"))] {
        let scaled = |pose: usize, column: &str, value: f64| {
            Some(if is_read(column) && pose >= poses / 2 { 1.04 * value } else { value })
        };
        let data = changed(set, scaled);
        let diagnosis = diagnosed(set, &data);
        let expected: Vec<&str> = machine.into_iter().chain(["sensor: time"]).collect();
        assert_eq!(found(&diagnosis), expected, "{set}");
        let warnings = diagnosis["data_warnings"].as_array().unwrap();
        assert_eq!((warnings.len(), &warnings[0]["kind"]), (1, &"change_between_poses".into()), "{set}: {warnings:?}");
        // the first row of the first such pose
        let line = warnings[0]["lines"][0].as_u64().unwrap() as usize;
        let name = |line: usize| data.lines().nth(line - 1).unwrap().split(',').next().unwrap();
        let first = format!("from pose {} (line {line}) on the readings differ from those before", name(line));
        assert!(warnings[0]["message"].as_str().unwrap().starts_with(&first), "{warnings:?}");
        let before: std::collections::BTreeSet<&str> = (2..line).map(name).collect();
        assert_eq!(before.len(), poses / 2);
        assert!(!before.contains(name(line)));
        assert_eq!(diagnosis["measurement"]["verdict"], "doubtful", "{set}");
    }
}

/// A θ that is 1° beside the true one at all poses is no limb, read in translations alone.
#[test]
fn a_machine_beside_its_poses_is_a_matter_of_geometry() {
    let beside = |_: usize, column: &str, value: f64| match column {
        "theta_deg" => Some(value + 1.0),
        _ if column.ends_with("_urad") => None,
        _ => Some(value),
    };
    assert_eq!(found(&diagnosed("p01", &changed("p01", beside))), ["geometry: constant"]);
}
