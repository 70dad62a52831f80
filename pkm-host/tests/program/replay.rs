//! `replay`: a log of a drive that wears, what the core's estimator says of it, and what is refused.

use pkm_core::tables::reference::PARAMETERS;
use serde_json::Value;

use crate::common::{Folder, fixture, json, refused};

const LOG: &str = "logs/worn-drive.csv";

/// A file of amplitudes with one line changed.
fn learn(from: &str, to: &str) -> String {
    let text = "format = 1\nmodel_share = 0.01\n[[learn]]\nplace = \"limb.2.body\"\nmotion = \"axial\"\ndeviation = 1e-9\n\
                drift_per_day = 1e-11\nleast = -1e-9\nmost = 1e-7\nrate_per_s = 1e-12\nalarm = 2e-10\n\
                [[learn]]\nplace = \"temperature\"\ndeviation = 1.0\ndrift_per_day = 0.1\nleast = -20.0\nmost = 20.0\n\
                rate_per_s = 0.01\nalarm = 3.0\n";
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1)
}

#[test]
fn a_worn_drive_raises_an_alarm_and_its_size_is_found() {
    let folder = Folder::new();
    let out = folder.path("out");
    let found = json(&["replay", "--log", &fixture(LOG), "--out", &out]);
    // how the log was made: the drive of limb 2, its platform joint along the limb, has lost 30 % of its stiffness from line 82 on
    let softer = (1.0 / 0.7 - 1.0) / PARAMETERS.limbs[1].platform_joint.linear_n_per_m[2];
    assert_eq!(found["alarm"]["amplitude"], "limb.2.body axial");
    let (change, deviation) =
        (found["alarm"]["change"].as_f64().unwrap(), found["alarm"]["deviation"].as_f64().unwrap());
    assert!(
        (change - softer).abs() < 3.0 * deviation && deviation < 0.1 * softer,
        "{change:e} {deviation:e} {softer:e}"
    );
    let line = found["alarms"][0]["line"].as_u64().unwrap();
    assert!((82..82 + 30).contains(&line), "{line}");
    assert!(found["changes_at_lines"].as_array().unwrap().iter().all(|at| at.as_u64() >= Some(82)));
    // one reading of 999 µm among the healthy ones
    assert_eq!(found["refused"][0], serde_json::json!({ "line": 32, "code": "unexpected" }));
    let written: Value = serde_json::from_str(&folder.read("out/replay.json")).unwrap();
    assert_eq!(written["amplitudes"], found["amplitudes"]);
    let page = folder.read("out/report.html");
    assert!(page.contains("limb.2.body axial") && page.contains("Inspect it."));

    // a fit of the readings before the wear says the same as the estimator
    let text = std::fs::read_to_string(fixture(LOG)).unwrap();
    let healthy: String = text.lines().take(81).map(|line| format!("{line}\n")).collect();
    let file = folder.write("learn.toml", &learn("drift_per_day = 1e-11", "drift_per_day = 0.0"));
    let log = folder.write("healthy.csv", &healthy);
    let found = json(&["replay", "--log", &log, "--learn", &file, "--out", &out]);
    assert_eq!(found["alarm"], Value::Null);
    let own = &found["amplitudes"][0];
    let [value, deviation, batch, batch_deviation] =
        ["value", "deviation", "batch_value", "batch_deviation"].map(|key| own[key].as_f64().unwrap());
    assert!((value - batch).abs() < 1e-6 * deviation, "{value:e} {batch:e}");
    assert!((deviation - batch_deviation).abs() < 1e-6 * deviation);
    // no growth without the effect: nothing is known of the temperature
    assert_eq!(found["amplitudes"][1]["deviation"], 1.0);
}

#[test]
fn bad_logs_and_amplitudes_are_refused_with_what_to_do() {
    let folder = Folder::new();
    let out = folder.path("out");
    let text = std::fs::read_to_string(fixture(LOG)).unwrap();
    let log = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        refused(&["replay", "--log", &folder.write("log.csv", &text.replacen(from, to, 1)), "--out", &out])
    };
    for (from, to, column, message) in [
        ("time_s,", "seconds,", "", "time_s"),
        ("\n1700000000,", "\n1700000000.5,", "time_s", "expected whole seconds"),
        ("\n1700000000,", "\n-1,", "time_s", "expected whole seconds"),
        ("sigma_linear_um\n", "sigma_angular_urad\n", "", "sigma_linear_um"),
        ("0.3\n", "0\n", "sigma_linear_um", "above 0"),
    ] {
        let error = log(from, to);
        let said = error["message"].as_str().unwrap();
        assert!(said.contains(message), "{from} {to}: {said}");
        assert!(column.is_empty() || error["column"] == column, "{error}");
    }
    let amplitudes = |from: &str, to: &str| {
        let file = folder.write("learn.toml", &learn(from, to));
        refused(&["replay", "--log", &fixture(LOG), "--learn", &file, "--out", &out])
    };
    for (from, to, message) in [
        ("format = 1", "format = 2", "expected 1, found 2"),
        ("limb.2.body", "limb.4.body", "expected one of limb.1.base_joint"),
        ("limb.2.body", "moving_platform", "expected one of limb.1.base_joint"),
        ("axial", "lateral", "expected one of axial"),
        ("motion = \"axial\"\n", "", "motion is missing"),
        ("deviation = 1e-9", "deviation = 0.0", "deviation of amplitude 1 is out of its range"),
        ("least = -20.0", "least = 1.0", "least of amplitude 2 is out of its range"),
        ("model_share = 0.01", "model_share = 2.0", "the model's share"),
        ("alarm = 2e-10", "alarms = 2e-10", "alarms"),
    ] {
        let error = amplitudes(from, to);
        let said = format!("{error}");
        assert!(said.contains(message), "{from} {to}: {said}");
    }
    let twice = learn("place = \"temperature\"", "place = \"limb.2.body\"\nmotion = \"axial\"");
    let file = folder.write("learn.toml", &twice);
    let error = refused(&["replay", "--log", &fixture(LOG), "--learn", &file, "--out", &out]);
    assert!(error["message"].as_str().unwrap().contains("amplitude 2 stands twice"), "{error}");
    assert!(!folder.has("out/replay.json"));
}
