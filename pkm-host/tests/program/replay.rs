//! `replay`: a log of a drive that wears, what the core's estimator says of it, and what is refused.

use std::path::Path;

use pkm_core::nalgebra::Matrix6;
use pkm_core::tables::reference::{MACHINE_F64, PARAMETERS};
use pkm_core::{Pose, Wrench};
use pkm_trials::life::{Plan, live};
use serde_json::Value;

use crate::common::{Folder, fixture, json, reference_machine, refused};

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
    let [alarm] = &found["standing"].as_array().unwrap()[..] else { panic!("{:#}", found["standing"]) };
    assert_eq!(alarm["amplitude"], "limb.2.body axial");
    let (change, deviation) = (alarm["change"].as_f64().unwrap(), alarm["deviation"].as_f64().unwrap());
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
    let steps = folder.read("out/steps.csv");
    let last: Vec<&str> = steps.lines().last().unwrap().split(',').collect();
    let values: Vec<f64> =
        found["amplitudes"].as_array().unwrap().iter().map(|a| a["value"].as_f64().unwrap()).collect();
    assert_eq!([6, 8, 10].map(|column| last[column].parse::<f64>().unwrap()).to_vec(), values);
    assert_eq!(
        (last[2], last[5], steps.lines().count()),
        ("taken", "2", 1 + found["readings"].as_u64().unwrap() as usize)
    );
    let page = folder.read("out/report.html");
    assert!(page.contains("limb.2.body axial") && page.contains("Inspect it."));
    let softer_percent = page.split("the limb yields ").nth(1).unwrap().split(' ').next().unwrap();
    // of the whole limb, that is a screw, a body and joints
    assert!((15.0..25.0).contains(&softer_percent.parse::<f64>().unwrap()), "{softer_percent}");

    // with the probe's gain beside the drives it is the drive all the same
    let example = json(&["replay", "--log", &fixture(LOG), "--learn", &fixture("logs/learn.toml"), "--out", &out]);
    let [alarm] = &example["standing"].as_array().unwrap()[..] else { panic!("{:#}", example["standing"]) };
    assert_eq!(alarm["amplitude"], "limb.2.body axial");
    assert_eq!(example["amplitudes"][3]["settings"]["alarm"], 0.01);

    // the sensor's sign is wrong: one reading passes, which is no change of the machine
    let log = std::fs::read_to_string(fixture(LOG)).unwrap();
    let head: Vec<&str> = log.lines().next().unwrap().split(',').collect();
    let at = head.iter().position(|h| *h == "dx_um").unwrap();
    let turned = log.lines().skip(1).map(|line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[at] = format!("-{}", cells[at]).replace("--", "");
        cells.join(",") + "\n"
    });
    let turned = folder.write("turned.csv", &format!("{}\n{}", head.join(","), turned.collect::<String>()));
    json(&["replay", "--log", &turned, "--out", &out]);
    let page = folder.read("out/report.html");
    assert!(page.contains("readings were taken in; refused were") && !page.contains("than at acceptance"));

    // taken to vary little beside a model that errs by much: the change is seen, and not where
    let amplitude = |limb: u8| {
        format!(
            "[[learn]]\nplace = \"limb.{limb}.body\"\nmotion = \"axial\"\ndeviation = 1e-10\ndrift_per_day = 1e-11\n\
             least = -1e-8\nmost = 1e-7\nrate_per_s = 1e-12\nalarm = 1e-11\n"
        )
    };
    let text = format!("format = 1\nmodel_share = 0.05\n{}{}{}", amplitude(1), amplitude(2), amplitude(3));
    let file = folder.write("little.toml", &text);
    json(&["replay", "--log", &fixture(LOG), "--learn", &file, "--out", &out]);
    let page = folder.read("out/report.html");
    assert!(page.contains("does not tell where") && page.contains("--next") && !page.contains("Inspect it."));
    assert!(page.contains("give a greater `deviation`"), "a change of six deviations");

    // a fit of the readings before the wear says the same as the estimator
    let text = std::fs::read_to_string(fixture(LOG)).unwrap();
    let healthy: String = text.lines().take(81).map(|line| format!("{line}\n")).collect();
    let file = folder.write("learn.toml", &learn("drift_per_day = 1e-11", "drift_per_day = 0.0"));
    let log = folder.write("healthy.csv", &healthy);
    let found = json(&["replay", "--log", &log, "--learn", &file, "--out", &out]);
    assert_eq!(found["standing"], serde_json::json!([]));
    let own = &found["amplitudes"][0];
    let [value, deviation, batch, batch_deviation] =
        ["value", "deviation", "batch_value", "batch_deviation"].map(|key| own[key].as_f64().unwrap());
    assert!((value - batch).abs() < 1e-6 * deviation, "{value:e} {batch:e}");
    assert!((deviation - batch_deviation).abs() < 1e-6 * deviation);
    // no growth without the effect: nothing is known of the temperature
    assert_eq!(found["amplitudes"][1]["deviation"], 1.0);
}

#[test]
fn a_diagnosis_of_the_readings_since_the_change_says_what_it_is() {
    let folder = Folder::new();
    let out = folder.path("out");
    let found = json(&["replay", "--log", &fixture(LOG), "--diagnose", "--out", &out])["diagnosis"].take();
    assert_eq!(
        (&found["refused"], &found["verdict"], &found["effects"]),
        (&Value::Null, &"adequate".into(), &serde_json::json!([]))
    );
    // of limb 2 alone, whose 8.5 nm/N along its axis (fixtures/logs/learn.toml) have become more as its joint's stiffness less
    let (usual, softer) = (8.5e-9, (1.0 / 0.7 - 1.0) / PARAMETERS.limbs[1].platform_joint.linear_n_per_m[2]);
    let [inspect] = &found["inspect"].as_array().unwrap()[..] else { panic!("{}", found["inspect"]) };
    let (place, rest) = inspect.as_str().unwrap().split_once(": ").unwrap();
    assert_eq!(place, "limb 2 along its axis, drive, joints and body");
    let percent: f64 = rest.split_once(" % softer than declared").unwrap().0.parse().unwrap();
    assert!((percent - 100.0 * softer / (usual + softer)).abs() < 1.0, "{inspect}");
    // a joint's three stiffnesses have gone together: what the readings show of them is along the limb
    let [value] = &found["declared_value_findings"].as_array().unwrap()[..] else { panic!("{found}") };
    assert_eq!(value["inspect"], "limb 2: joint, bearing or drive along its axis");
    let (from, readings) = (found["from_line"].as_u64().unwrap(), found["readings"].as_u64().unwrap());
    // from the change, which it takes some readings to show, to the end of the log
    assert!((82..82 + 10).contains(&from) && readings == 151 - from + 1, "{from} {readings}");
    assert!(folder.read("out/report.html").contains("What a diagnosis says"));
    // what it was made of is a file for `diagnose`
    let own = json(&["diagnose", "--data", &folder.path("out/readings.csv"), "--out", &folder.path("own")]);
    assert_eq!((&own["verdict"], &own["condition"]["inspect"]), (&found["verdict"], &found["inspect"]));
    assert_eq!(folder.read("out/readings.csv").lines().count() as u64, 1 + readings);

    // a row without load, which teaches nothing, is kept for what it says of the sensor's zero; too little is no failure
    let few: Vec<String> = healthy().lines().take(6).map(str::to_owned).collect();
    let zero = few[5].split(',').enumerate().map(|(n, cell)| if (8..17).contains(&n) { "0" } else { cell });
    let zero = zero.collect::<Vec<_>>().join(",");
    let log = folder.write("few.csv", &format!("{}\n{zero}\n", few.join("\n")));
    let found = json(&["replay", "--log", &log, "--diagnose", "--out", &out]);
    assert!(found["diagnosis"]["refused"].as_str().unwrap().contains("too few"), "{}", found["diagnosis"]);
    assert_eq!((&found["taken"], &found["diagnosis"]["readings"]), (&5.into(), &5.into()));
    assert_eq!(folder.read("out/readings.csv").lines().count(), 1 + 6);
}

/// The example's readings before the wear, without the spike among them.
fn healthy() -> String {
    let text = std::fs::read_to_string(fixture(LOG)).unwrap();
    text.lines().take(81).filter(|line| !line.contains("999.00")).map(|line| format!("{line}\n")).collect()
}

#[test]
fn what_a_log_says_wrongly_is_refused_with_a_code_and_moves_nothing() {
    let folder = Folder::new();
    let out = folder.path("out");
    let healthy = healthy();
    let good = json(&["replay", "--log", &folder.write("good.csv", &healthy), "--out", &out]);
    assert_eq!((&good["taken"], &good["refused"]), (&79.into(), &serde_json::json!([])));
    let place = "P01,9.2,-11.6,521.5,10,-20,300";
    let pressed = format!("{place},0,0,-900,0,0,0");
    let last = healthy.lines().last().unwrap();
    let time: u64 = last.split(',').next().unwrap().parse().unwrap();
    for (row, code) in [
        // a press of 900 N that lifts the tip; of 0.01 N; with a reading of a tenth of a metre
        (format!("{time},{pressed},0,0,90.00,0.3"), "wrong_sign"),
        (format!("{time},{place},0,0,-0.01,0,0,0,0,0,0,0.3"), "not_excited"),
        (format!("{time},{pressed},0,0,-100000,0.3"), "unexpected"),
        (last.replacen(&time.to_string(), &(time - 1).to_string(), 1), "backwards"),
    ] {
        let log = folder.write("bad.csv", &format!("{healthy}{row}\n"));
        let found = json(&["replay", "--log", &log, "--out", &out]);
        assert_eq!(found["refused"], serde_json::json!([{ "line": 81, "code": code }]));
        let values =
            |of: &Value| of["amplitudes"].as_array().unwrap().iter().map(|a| a["value"].clone()).collect::<Vec<_>>();
        assert_eq!(values(&found), values(&good), "{code}");
    }
    // the last reading three times more is taken in, from then on the probe is stuck
    let stuck = format!("{last}\n").repeat(6);
    let found = json(&["replay", "--log", &folder.write("stuck.csv", &format!("{healthy}{stuck}")), "--out", &out]);
    let stuck = [84, 85, 86].map(|line| serde_json::json!({ "line": line, "code": "stuck" }));
    assert_eq!(found["refused"], serde_json::json!(stuck));
}

/// A log that ends with rows as `change` makes them of the healthy ones' last, a day after one another.
fn followed_by(rows: usize, change: impl Fn(usize, &mut Vec<String>)) -> String {
    let healthy = healthy();
    let last: Vec<String> = healthy.lines().last().unwrap().split(',').map(str::to_owned).collect();
    let time: usize = last[0].parse().unwrap();
    let row = |n: usize| {
        let mut cells = last.clone();
        cells[0] = (time + 86_400 * (n + 1)).to_string();
        change(n, &mut cells);
        cells.join(",") + "\n"
    };
    healthy.clone() + &(0..rows).map(row).collect::<String>()
}

#[test]
fn a_log_that_ends_in_refusals_is_no_healthy_machine() {
    let folder = Folder::new();
    let out = folder.path("out");
    let run = |log: &str| {
        let found = json(&["replay", "--log", &folder.write("log.csv", log), "--out", &out]);
        (found, folder.read("out/report.html"))
    };
    let stuck = |rows| run(&followed_by(rows, |_, _| {}));
    let (found, page) = stuck(29);
    assert_eq!(found["refused"].as_array().unwrap().len(), 26, "three more are taken in, then the probe is stuck");
    assert!(page.contains("The last 26 readings were refused, 26 as stuck: from line 84 on nothing was learned."));
    assert!(page.contains("find out why the last 26 readings were refused"));
    // what is not read is known ever less: the table has what is left of it at the end
    let own = &found["amplitudes"][0];
    let [deviation, at_end] = ["deviation", "deviation_at_end"].map(|key| own[key].as_f64().unwrap());
    assert!(at_end > 1.1 * deviation && page.contains(&format!("± {:.3}", 1.96e9 * at_end)));
    let (_, page) = stuck(10);
    assert!(!page.contains("from line"), "7 readings may be spikes");
    // nothing at all was taken in
    let still = healthy().lines().next().unwrap().to_owned()
        + "\n1700000000,P01,9.2,-11.6,521.5,10,-20,300,0,0,-0.01,0,0,0,0,0,0,0.3\n";
    let (found, page) = run(&still);
    assert_eq!((&found["taken"], &found["days_since_first"]), (&0.into(), &Value::Null));
    assert!(page.contains("nothing is known beyond the settings") && !page.contains("No change that is worth"));
    let log = folder.write("log.csv", &still);
    let nothing = json(&["replay", "--log", &log, "--diagnose", "--out", &out]);
    assert!(nothing["diagnosis"].is_null() && nothing["warnings"].to_string().contains("no diagnosis"), "{nothing}");
    // the clock was ten years ahead once
    let (found, page) = run(&followed_by(30, |n, cells| {
        cells[14] = format!("{:.2}", cells[14].parse::<f64>().unwrap() + 0.01 * n as f64);
        if n == 0 {
            cells[0] = (cells[0].parse::<u64>().unwrap() + 315_000_000).to_string();
        }
    }));
    assert!(page.contains("29 as backwards"), "{}", found["refused"]);
    assert_eq!(found["days_since_last"], 0.0);
    assert!(found["days_since_first"].as_f64().unwrap() > 3600.0);
}

#[test]
fn what_a_log_holds_and_is_not_used_is_said() {
    let folder = Folder::new();
    let out = folder.path("out");
    let healthy = healthy();
    let run = |log: &str, options: &[&str]| {
        let file = folder.write("log.csv", log);
        json(&[&["replay", "--log", &file, "--out", &out], options].concat())
    };
    let warned = |found: &Value, what: &str| {
        found["warnings"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains(what))
    };
    assert_eq!(run(&healthy, &[])["warnings"], serde_json::json!([]));
    let renamed = healthy.replacen("dx_um", "Weg 1 [µm]", 1);
    let found = run(&renamed, &[]);
    assert!(warned(&found, "not used: Weg 1"), "{}", found["warnings"]);
    assert_eq!(found["taken"], 79);
    let read = run(&renamed, &["--columns", "dx_um=Weg 1"]);
    assert_eq!((&read["amplitudes"], &read["warnings"]), (&run(&healthy, &[])["amplitudes"], &serde_json::json!([])));
    let milliseconds: String = healthy
        .replacen("time_s", "Zeit [ms]", 1)
        .lines()
        .enumerate()
        .map(|(n, line)| {
            let (time, rest) = line.split_once(',').unwrap();
            if n == 0 { format!("{line}\n") } else { format!("{time}000,{rest}\n") }
        })
        .collect();
    assert_eq!(run(&milliseconds, &[])["amplitudes"], read["amplitudes"]);
    let mut twice: Vec<&str> = healthy.lines().collect();
    twice.insert(5, twice[4]);
    assert!(warned(&run(&twice.join("\n"), &[]), "log.csv:6: the same reading as in line 5"));
    let warm = healthy.replacen('\n', ",temperature_c\n", 1).replace(",0.3\n", ",0.3,21.5\n");
    assert!(warned(&run(&warm, &[]), "log.csv:1: temperature_c changes nothing"));
    let noisy = healthy.replacen('\n', ",load_random\n", 1).replace(",0.3\n", ",0.3,0.01\n");
    assert!(warned(&run(&noisy, &[]), "log.csv:1: not used in a log: load_random"));
    // a load that was lost is none that stands above
    let mut cells: Vec<Vec<&str>> = healthy.lines().map(|line| line.split(',').collect()).collect();
    cells[6][8..14].fill("");
    let text: String = cells.iter().map(|row| row.join(",") + "\n").collect();
    let error = refused(&["replay", "--log", &folder.write("log.csv", &text), "--out", &out]);
    assert!(error["line"] == 7 && error["column"] == "fx_n", "{error}");
}

/// Nothing is learned from a log in other units, and the codes of its rows do not say why.
#[test]
fn a_log_in_other_units_is_asked_about() {
    let folder = Folder::new();
    let out = folder.path("out");
    let text = healthy();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let scaled = |columns: &[&str], factor: f64| -> String {
        let row = |(n, line): (usize, &str)| {
            let cell = |(h, c): (&&str, &str)| match c.parse::<f64>() {
                Ok(value) if n > 0 && columns.contains(h) => (factor * value).to_string(),
                _ => c.to_owned(),
            };
            header.iter().zip(line.split(',')).map(cell).collect::<Vec<_>>().join(",") + "\n"
        };
        text.lines().enumerate().map(row).collect()
    };
    for (columns, factor, words) in [
        (&["theta_deg", "sigma_deg"][..], 1f64.to_radians(), "log.csv: theta_deg: no angle is above"),
        (
            &["fx_n", "fy_n", "fz_n"],
            1e-3,
            "log.csv: the translations read are 1e3 times what the declared machine gives: are they in µm, and loads in N and N·m?",
        ),
        (
            &["dx_um", "dy_um", "dz_um"],
            1e-3,
            "log.csv: the translations read are 1e-3 times what the declared machine gives: are they in µm, and loads in N and N·m?",
        ),
        (
            &["point_u_mm", "point_v_mm", "point_w_mm"],
            1e-3,
            "log.csv: point_u_mm: the point of the readings is at most",
        ),
    ] {
        let log = folder.write("log.csv", &scaled(columns, factor));
        let found = json(&["replay", "--log", &log, "--out", &out]);
        assert!(found["warnings"].to_string().contains(words), "{words}: {}", found["warnings"]);
    }
}

#[test]
fn settings_that_a_log_speaks_against_are_named() {
    let folder = Folder::new();
    let out = folder.path("out");
    let page = |from: &str, to: &str| {
        let file = folder.write("learn.toml", &learn(from, to));
        json(&["replay", "--log", &fixture(LOG), "--learn", &file, "--out", &out]);
        folder.read("out/report.html")
    };
    let usual = page("format", "format");
    let [limit, unit] = ["it may be: the change", "in m/N (--learn)?"];
    assert!(!usual.contains(limit) && !usual.contains(unit));
    // the drive yields by 1.7 nm/N more
    let page_of_limit = page("most = 1e-7", "most = 1e-9");
    assert!(page_of_limit.contains(limit) && page_of_limit.contains("stands at the `most`"));
    // nanometres, where metres were meant
    let nm = "deviation = 1.0\ndrift_per_day = 0.01\nleast = -1.0\nmost = 100.0\nrate_per_s = 1e-3\nalarm = 0.2";
    let m = "deviation = 1e-9\ndrift_per_day = 1e-11\nleast = -1e-9\nmost = 1e-7\nrate_per_s = 1e-12\nalarm = 2e-10";
    assert!(page(m, nm).contains(unit));
    // a change that has no alarm yet
    let open = page("alarm = 2e-10", "alarm = 5e-9");
    assert!(open.contains("which is not proven to be worth an alarm (5.00 nm/N)"));
}

#[test]
fn an_estimator_that_follows_too_slowly_is_found_by_the_fit_beside_it() {
    let folder = Folder::new();
    let out = folder.path("out");
    // a probe that comes to read 0.16 % more in 400 days
    let healthy = healthy();
    let rows: Vec<Vec<&str>> = healthy.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let mut log = format!("{}\n", healthy.lines().next().unwrap());
    for (n, row) in rows.iter().cycle().take(400).enumerate() {
        let mut cells: Vec<String> = row.iter().map(|cell| (*cell).to_owned()).collect();
        cells[0] = (1_700_000_000 + 86_400 * n).to_string();
        for cell in &mut cells[14..17] {
            *cell = (cell.parse::<f64>().unwrap() * (1.0 + 4e-6 * n as f64)).to_string();
        }
        log += &(cells.join(",") + "\n");
    }
    let log = folder.write("log.csv", &log);
    let page = |drift_per_day: f64| {
        let text = format!(
            "format = 1\nmodel_share = 0.0\n[[learn]]\nplace = \"probe\"\ndeviation = 0.05\ndrift_per_day = {drift_per_day:?}\n\
             least = -0.5\nmost = 0.5\nrate_per_s = 0.01\nalarm = 0.02\n"
        );
        json(&["replay", "--log", &log, "--learn", &folder.write("learn.toml", &text), "--out", &out]);
        folder.read("out/report.html")
    };
    let slow = page(0.0);
    assert!(slow.contains("which is no chance") && slow.contains("change the settings that are doubted below"));
    assert!(!page(2e-5).contains("which is no chance"));
}

#[test]
fn a_healthy_machine_whose_joints_stiffen_under_load_has_no_wear() {
    let folder = Folder::new();
    let effect = "\n[[effect]]\nid = \"contact-stiffening\"\nunloaded_m_per_n = 5e-9\nreference_n = 200.0\n";
    let machine = folder.write("machine.toml", &(reference_machine() + effect));
    json(&["predict", "--machine", &machine, "--data", &fixture(LOG), "--out", &folder.path("read.csv")]);
    let read = folder.read("read.csv");
    let ends = std::iter::once(",sigma_angular_urad\n").chain(std::iter::repeat(",1\n"));
    let log =
        folder.write("log.csv", &read.lines().zip(ends).map(|(row, end)| row.to_owned() + end).collect::<String>());
    let settings = fixture("logs/learn.toml");
    let out = folder.path("out");
    let found = json(&["replay", "--log", &log, "--machine", &machine, "--learn", &settings, "--out", &out]);
    for own in found["amplitudes"].as_array().unwrap() {
        for [value, deviation] in [["value", "deviation"], ["batch_value", "batch_deviation"]] {
            let [value, deviation] = [value, deviation].map(|key| own[key].as_f64().unwrap());
            assert!(value.abs() < deviation, "{own:#}");
        }
    }
}

#[test]
fn the_next_probings_leave_what_they_say() {
    let folder = Folder::new();
    let (out, learn) = (folder.path("out"), learn("model_share = 0.01", "model_share = 0.0"));
    let own = |place: &str, motion: &str| {
        format!(
            "[[learn]]\nplace = \"{place}\"\nmotion = \"{motion}\"\ndeviation = 1e-9\ndrift_per_day = 0.0\nleast = -1e-8\nmost = 1e-7\n\
             rate_per_s = 1e-12\nalarm = 2e-10\n"
        )
    };
    let learn = learn[..learn.rfind("[[learn]]").unwrap()].replace("drift_per_day = 1e-11", "drift_per_day = 0.0");
    let learn = folder.write("learn.toml", &(learn + &own("limb.1.body", "axial") + &own("base", "rz")));
    // one press along w alone: of a turn of the base about z it tells nothing
    let healthy = healthy();
    let mut lines = healthy.lines();
    let header = lines.next().unwrap();
    let first = lines.next().unwrap();
    let log = folder.write("log.csv", &format!("{header}\n{first}\n"));
    let found = json(&["replay", "--log", &log, "--learn", &learn, "--next", "3", "--out", &out]);
    let next = found["next"].as_array().unwrap();
    assert_eq!(next.len(), 3);
    let sum = |shares: &Value| shares.as_array().unwrap().iter().map(|s| s.as_f64().unwrap()).sum::<f64>();
    let now: f64 = found["amplitudes"].as_array().unwrap().iter().map(|a| a["variance_left"].as_f64().unwrap()).sum();
    assert!(sum(&next[0]["variance_left"]) < now && sum(&next[2]["variance_left"]) < sum(&next[0]["variance_left"]));

    // probed as proposed, with what the model predicts, the same estimator knows as much as was foretold
    let filled = folder.path("filled.csv");
    json(&["predict", "--data", &folder.path("out/next.csv"), "--out", &filled]);
    let filled = folder.read("filled.csv");
    let mut rows = filled.lines();
    // with rotations behind, which no cell of the log keeps
    let predicted = rows.next().unwrap();
    assert!(predicted.starts_with(header), "the columns of a log: {predicted}");
    let cells = header.split(',').count();
    let time = first.split(',').next().unwrap();
    let probed: String =
        rows.map(|row| format!("{time}{}\n", row.split(',').take(cells).collect::<Vec<_>>().join(","))).collect();
    let log = folder.write("log.csv", &format!("{header}\n{first}\n{probed}"));
    let after = json(&["replay", "--log", &log, "--learn", &learn, "--out", &out]);
    assert_eq!(after["taken"], 4, "{}", after["refused"]);
    for (amplitude, foretold) in
        after["amplitudes"].as_array().unwrap().iter().zip(next[2]["variance_left"].as_array().unwrap())
    {
        let [left, foretold] = [&amplitude["variance_left"], foretold].map(|v| v.as_f64().unwrap());
        assert!((left - foretold).abs() < 1e-9 * foretold, "{left} {foretold}");
    }
    // no row of the log whose load is no greater is better than the first proposal
    let force = |row: &str| {
        let parts = row.split(',').skip(8).take(3).map(|cell| cell.parse::<f64>().unwrap().powi(2));
        parts.sum::<f64>().sqrt()
    };
    for row in healthy.lines().skip(2).filter(|row| force(row) <= force(first)).take(20) {
        let row = format!("{time}{}", &row[row.find(',').unwrap()..]);
        let log = folder.write("log.csv", &format!("{header}\n{first}\n{row}\n"));
        let other = json(&["replay", "--log", &log, "--learn", &learn, "--out", &out]);
        let left: f64 =
            other["amplitudes"].as_array().unwrap().iter().map(|a| a["variance_left"].as_f64().unwrap()).sum();
        assert!(left > sum(&next[0]["variance_left"]), "{row}");
    }
    // nothing is said where nothing was asked
    assert_eq!(after["next"], serde_json::json!([]));
    assert!(
        refused(&["replay", "--log", &log, "--next", "0", "--out", &out])["message"]
            .as_str()
            .unwrap()
            .contains("1..=50")
    );
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
        ("10.33", "nan", "dx_um", "expected a finite number"),
        ("801", "inf", "fy_n", "expected a finite number"),
        (",fx_n,", ",xx,", "", "fx_n"),
        (",801,", ",,", "fy_n", "found an empty cell"),
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
        ("motion = \"axial\"\n", "motion = \"axial\"\nmotions = 1\n", "motions"),
        ("temperature\"\n", "temperature\"\nmotion = \"x\"\n", "temperature has no motion"),
        ("deviation = 1e-9", "deviation = 0.0", "deviation of limb.2.body axial: expected a standard deviation above"),
        ("least = -20.0", "least = 1.0", "least of temperature: expected at most `accepted`"),
        (
            "alarm = 2e-10",
            "alarm = 2e-7",
            "alarm of limb.2.body axial: expected a change above 0 that `least` or `most`",
        ),
        ("model_share = 0.01", "model_share = 2.0", "expected a share from 0 to 1, found 2"),
        ("alarm = 2e-10", "alarms = 2e-10", "alarms"),
    ] {
        let error = amplitudes(from, to);
        let said = format!("{error}");
        assert!(said.contains(message), "{from} {to}: {said}");
        assert!(error["line"].is_u64(), "{error}");
    }
    let twice = learn("place = \"temperature\"", "place = \"limb.2.body\"\nmotion = \"axial\"");
    let file = folder.write("learn.toml", &twice);
    let error = refused(&["replay", "--log", &fixture(LOG), "--learn", &file, "--out", &out]);
    let again = "limb.2.body axial is limb.2.body axial once more, which is learned already";
    assert!(error["message"].as_str().unwrap().ends_with(again), "{error}");
    assert_eq!((&error["line"], &error["column"]), (&12.into(), &"learn.place".into()));
    let same = learn("place = \"temperature\"", "place = \"limb.2.base_joint\"\nmotion = \"axial\"");
    let error =
        refused(&["replay", "--log", &fixture(LOG), "--learn", &folder.write("learn.toml", &same), "--out", &out]);
    assert!(error["message"].as_str().unwrap().contains("yields along its axis alike"), "{error}");
    assert!(!folder.has("out/replay.json"));
}

/// A short life by `pkm-trials life`, whose truth is a frame; docs/estimation.md has the figures of long ones.
#[test]
fn over_a_life_with_wear_seasons_and_a_failing_probe_it_knows_more_than_a_frozen_table() {
    let folder = Folder::new();
    let plan = Plan { days: 200, readings: 2, foreign: false };
    let lived = live(Path::new(env!("CARGO_BIN_EXE_pkm-host")), 20, &plan, Path::new(&folder.path("."))).unwrap();
    println!("{}", lived.line());
    assert!(lived.of_frozen < 0.5 && lived.of_batch < 2.0);
    assert!(lived.loose_after.is_some_and(|n| n <= 30));
    assert_eq!((lived.false_alarms, lived.failed_taken), ([0, 0], [0, 20]));
}

#[test]
fn readings_outside_the_tables_box_are_counted() {
    let folder = Folder::new();
    let table = fixture("jobs/wide-table.json");
    let poses = folder.write("poses.csv", "pose,theta_deg,sigma_deg,z0_mm\nin,30,5,530\nout,38,5,530\n");
    json(&["stiffness", "--poses", &poses, "--table", &table, "--out", &folder.path("k.csv")]);
    let wrench = Wrench { force_n: [300.0, -200.0, 400.0].into(), ..Wrench::ZERO };
    let mut log =
        "time_s,pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,dx_um,dy_um,dz_um,sigma_linear_um\n"
            .to_owned();
    for (row, at) in folder.read("k.csv").lines().skip(1).zip(1..) {
        let cells: Vec<&str> = row.split(',').collect();
        let number = |cell: usize| cells[cell].parse::<f64>().unwrap();
        // the upper triangle, row by row, after the pose's name and coordinates
        let mut upper = 4..;
        let mut k = Matrix6::zeros();
        for i in 0..6 {
            for j in i..6 {
                k[(i, j)] = number(upper.next().unwrap());
                k[(j, i)] = k[(i, j)];
            }
        }
        let moved = k.lu().solve(&wrench.to_vector()).unwrap() * 1e6;
        let [fx, fy, fz] = <[f64; 3]>::from(wrench.force_n);
        let pose = cells[..4].join(",");
        log += &format!("{},{pose},{fx},{fy},{fz},0,0,0,{},{},{},1\n", 1000 * at, moved[0], moved[1], moved[2]);
    }
    let log = folder.write("log.csv", &log);
    let found = json(&["replay", "--log", &log, "--table", &table, "--out", &folder.path("out")]);
    assert_eq!((&found["taken"], &found["outside_box_at_lines"]), (&2.into(), &serde_json::json!([3])));
    let page = folder.read("out/report.html");
    assert!(page.contains("table was fitted in: 1 of them") && page.contains("touch the loads that --next proposes"));
    json(&["replay", "--log", &log, "--table", &table, "--next", "1", "--out", &folder.path("out")]);
    assert!(folder.read("out/report.html").contains("touch the loads that are proposed below"));

    // a table of a narrower box: what is proposed lies within it
    let mut narrow: Value = serde_json::from_str(&std::fs::read_to_string(&table).unwrap()).unwrap();
    narrow["box"]["theta_deg"] = serde_json::json!([-4.0, 13.0]);
    (narrow["center"][0], narrow["scale"][0]) = (4.5.into(), 8.5.into());
    let narrow = folder.write("narrow.json", &narrow.to_string());
    let found = json(&["replay", "--log", &log, "--table", &narrow, "--next", "3", "--out", &folder.path("out")]);
    let thetas: Vec<f64> = found["next"].as_array().unwrap().iter().map(|p| p["pose"][0].as_f64().unwrap()).collect();
    assert!(thetas.len() == 3 && thetas.iter().all(|theta| (-4.0..=13.0).contains(theta)), "{thetas:?}");
}

/// A machine that softens by 0.04 % and grows by 11 µm/m for each degree: where all grows alike A moves along BA, which is along w at
/// θ = σ = 0, by its share of Z0, and all that yields does so by as much more.
#[test]
fn a_log_with_temperatures_is_read_as_of_a_machine_that_is_warm() {
    let folder = Folder::new();
    let out = folder.path("out");
    let (softer_per_k, longer_per_k) = (4e-4, 11e-6);
    let machine = folder.write(
        "machine.toml",
        &format!(
            "{}\n[[effect]]\nid = \"thermal-modulus\"\nbodies_per_k = {softer_per_k}\njoints_per_k = {softer_per_k}\n\
             [[effect]]\nid = \"thermal-expansion\"\nlimbs_per_k = {longer_per_k}\nplatforms_per_k = {longer_per_k}\n",
            reference_machine()
        ),
    );
    let mut log = "time_s,pose,series,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,dx_um,dy_um,dz_um,\
                   sigma_linear_um,temperature_c\n"
        .to_owned();
    let mut row = |series: &str, at: u32, force_n: [f64; 3], temperature_c: f64, zero_c: f64| {
        let z0_mm = 500.0 + f64::from(5 * at);
        let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: z0_mm * 1e-3 };
        let cold = MACHINE_F64.stiffness(&pose).unwrap().factor().unwrap();
        let cold = cold.deflection(&Wrench { force_n: force_n.into(), ..Wrench::ZERO }).unwrap().translation_m;
        let [x, y, z] = (cold / (1.0 - softer_per_k * (temperature_c - 20.0)) * 1e6).into();
        let z = z + longer_per_k * (temperature_c - zero_c) * z0_mm * 1e3;
        let [fx, fy, fz] = force_n;
        log += &format!("{at},P,{series},0,0,{z0_mm},{fx},{fy},{fz},0,0,0,{x},{y},{z},0.3,{temperature_c}\n");
    };
    // rows on their own were zeroed at 20 °C, those of a series at its first
    for (at, temperature_c) in [20.0, 24.0, 33.0, 45.0, 12.0].into_iter().enumerate() {
        row("", at as u32, [800.0, -300.0, -500.0], temperature_c, 20.0);
    }
    for (at, force_n) in
        [[0.0; 3], [900.0, 0.0, 0.0], [300.0, 600.0, -400.0], [-300.0, 0.0, -900.0]].into_iter().enumerate()
    {
        row("warm", 5 + at as u32, force_n, 45.0, 45.0);
    }
    let log_file = folder.write("log.csv", &log);
    let found = json(&["replay", "--machine", &machine, "--log", &log_file, "--out", &out]);
    assert_eq!(found["warnings"], serde_json::json!([]));
    assert_eq!(found["refused"], serde_json::json!([{ "line": 7, "code": "not_excited" }]));
    for own in found["amplitudes"].as_array().unwrap() {
        let [value, deviation, batch] = ["value", "deviation", "batch_value"].map(|key| own[key].as_f64().unwrap());
        assert!(value.abs() < 1e-6 * deviation && batch.abs() < 1e-6 * deviation, "{own}");
    }
    // to a machine that is never warm the same log is another
    let cold = json(&["replay", "--log", &log_file, "--out", &out]);
    assert!(cold["refused"].as_array().unwrap().len() > 3, "{}", cold["refused"]);

    for (cell, what) in [("", "found an empty cell"), ("2600", "no machine has this temperature")] {
        let wrong = log.replacen(",33\n", &format!(",{cell}\n"), 1);
        let log = folder.write("wrong.csv", &wrong);
        let error = refused(&["replay", "--machine", &machine, "--log", &log, "--out", &out]);
        assert!(error["line"] == 4 && error["column"] == "temperature_c", "{error}");
        assert!(error["message"].as_str().unwrap().contains(what), "{error}");
    }
}
