//! `verify`: diagnoses of a machine before and after a repair, and `plan --kind campaign`, whose file becomes data of a diagnosis.

use serde_json::Value;

use crate::common::{Folder, json, reference_machine, refused, run};

/// Readings of a campaign, by the program's own prediction of a machine, with noise of 0.3 µm and 1.2 µrad.
fn measure(folder: &Folder, campaign: &str, machine: &str, name: &str, seed: u64) -> String {
    let predicted = folder.path("predicted.csv");
    json(&["predict", "--machine", machine, "--data", campaign, "--out", &predicted]);
    let text = folder.read("predicted.csv");
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut read = header.join(",") + "\n";
    for line in lines {
        let cells = line.split(',').zip(&header).map(|(cell, column)| {
            let sigma = match *column {
                "dx_um" | "dy_um" | "dz_um" => 0.3,
                "rx_urad" | "ry_urad" | "rz_urad" => 1.2,
                _ => return cell.to_owned(),
            };
            // twelve uniform numbers: near enough to normal
            let noise = (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
            format!("{:.3}", cell.parse::<f64>().unwrap() + sigma * noise)
        });
        read += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    folder.write(name, &read)
}

fn change<'a>(found: &'a Value, quantity: &str) -> &'a Value {
    found["changes"].as_array().unwrap().iter().find(|c| c["quantity"] == quantity).unwrap()
}

/// Ratio of limb 1's axial stiffness in the middle of the reference machine's box, drive intact over drive worn, by the numbers of its
/// file: two joints and a tube beside a screw in series. The base joint's directions are those of the base, from which the limb leans by
/// the difference of b1 and a1 over Z0.
fn true_ratio(worn_n_per_m: f64) -> f64 {
    let (aside_m, z0_m): (f64, f64) = (0.350 - 0.180, 0.530);
    let q_m = aside_m.hypot(z0_m);
    let area = |outer: f64, inner: f64| std::f64::consts::FRAC_PI_4 * (outer * outer - inner * inner);
    let body = q_m / (206e9 * (area(0.06, 0.036) + area(0.032, 0.0)));
    let compliance = |base: f64| ((z0_m / q_m).powi(2) / base + (aside_m / q_m).powi(2) / 2e8) + body + 1.0 / 2.5e8;
    compliance(worn_n_per_m) / compliance(3e8)
}

/// What readings that are not what they are taken for say of a machine is nothing to compare.
fn concludes_nothing_beside_readings_that_are_unsound(folder: &Folder, before: &str, after: &str) {
    let mut document: Value = serde_json::from_str(&folder.read("after/diagnosis.json")).unwrap();
    document["measurement"] =
        serde_json::json!({ "verdict": "unsound", "reasons": ["the loads are in kN", "no more"] });
    let unsound = folder.write("unsound.json", &document.to_string());
    for (one, other, when) in
        [(before, &unsound[..], "after"), (&unsound, before, "before"), (&unsound, after, "before")]
    {
        let out = folder.path("nothing");
        let call = ["verify", "--before", one, "--after", other, "--out", &out];
        let found = json(&call);
        assert_eq!(found["verdict"], "inconclusive");
        let why = format!("the measurement {when} is unsound (the loads are in kN)");
        assert!(found["caveats"].to_string().contains(&why), "{found}");
        assert!(found["changes"].as_array().unwrap().iter().all(|c| c["verdict"] == "inconclusive"), "{found}");
        let text = String::from_utf8(run(&call).stdout).unwrap();
        for said in [text, folder.read("nothing/report.html")] {
            assert!(said.contains("No conclusion: the measurement of one") && said.contains(&why), "{said}");
            for conclusion in ["The machine has changed", "Nothing has changed", "softer", "stiffer", "new table"] {
                assert!(!said.contains(conclusion), "{conclusion}");
            }
        }
    }
}

/// Where the readings cannot tell two joints apart noise decides which of them is named: that is no change.
fn one_joint_by_two_names_is_no_change(folder: &Folder, before: &str, after: &str) {
    const JOINTS: [&str; 2] = ["limb.2.platform_joint.linear_n_per_m", "limb.2.base_joint.linear_n_per_m"];
    let with = |of: &str, [parameter, other]: [&str; 2]| {
        let name = format!("{of}/diagnosis.json");
        let text = std::fs::read_to_string(&name).unwrap();
        let mut document: Value = serde_json::from_str(&text).unwrap();
        document["declared_value_findings"] = serde_json::json!([{ "parameter": parameter, "axis": 2, "declared": 3e8,
            "estimated": 1.6e8, "pull_sd": -6.0, "inspect": "limb 2: joint", "class": ["limb.1.body.young_gpa", other] }]);
        document
    };
    let verified = |one: &Value, other: &Value| {
        let [one, other] = [("one.json", one), ("other.json", other)].map(|(n, d)| folder.write(n, &d.to_string()));
        json(&["verify", "--before", &one, "--after", &other])
    };
    let [one, mut other] = [with(before, JOINTS), with(after, [JOINTS[1], JOINTS[0]])];
    let found = verified(&one, &other);
    let fates = found["findings"].as_array().unwrap();
    assert_eq!((fates.len(), &fates[0]["verdict"]), (1, &"unchanged".into()), "{fates:?}");
    assert!(JOINTS.iter().all(|joint| fates[0]["text"].as_str().unwrap().contains(joint)), "{fates:?}");
    assert_eq!(found["verdict"], "unchanged", "{found}");
    // the readings of the second tell them apart
    other["declared_value_findings"][0]["class"] = serde_json::json!([]);
    let found = verified(&one, &other);
    let verdicts: Vec<&Value> = found["findings"].as_array().unwrap().iter().map(|f| &f["verdict"]).collect();
    assert_eq!(verdicts, ["gone", "new"]);
    assert_eq!(found["verdict"], "changed");
}

/// The same of an effect at two places.
fn one_effect_at_two_places_is_no_change(folder: &Folder, before: &str, after: &str) {
    let verified = |second: f64| {
        let at = |name: &str, of: &str, place: &str, class: &str, value: f64| {
            let text = std::fs::read_to_string(format!("{of}/diagnosis.json")).unwrap();
            let mut document: Value = serde_json::from_str(&text).unwrap();
            document["effects"] = serde_json::json!([{ "id": "element", "where": place, "where_class": [class],
                "law": "constant", "probability": 0.97,
                "parameters": { "axial.m_per_n": { "value": value, "stderr": 2e-10 } } }]);
            folder.write(name, &document.to_string())
        };
        let one = at("one.json", before, "limb.2.body", "limb.2.base_joint", 5e-9);
        let other = at("other.json", after, "limb.2.base_joint", "limb.2.body", second);
        json(&["verify", "--before", &one, "--after", &other])
    };
    for (second, verdict) in [(5.2e-9, "unchanged"), (9e-9, "stronger"), (2e-9, "weaker")] {
        let found = verified(second);
        let fates = found["findings"].as_array().unwrap();
        assert_eq!((fates.len(), &fates[0]["verdict"]), (1, &verdict.into()), "{fates:?}");
        assert_eq!(found["verdict"] == "unchanged", verdict == "unchanged", "{found}");
    }
}

/// One diagnosis alone: measurement, model and machine are three things, each estimate with its uncertainty.
fn says_apart(folder: &Folder, first: &Value) {
    assert_eq!(first["measurement"]["verdict"], "sound", "{}", first["measurement"]);
    let limb = &first["condition"]["quantities"][0];
    assert_eq!((&limb["quantity"], &limb["state"]), (&"limb.1.axial".into(), &"softer".into()), "{limb}");
    assert!(first["condition"]["inspect"][0].as_str().unwrap().starts_with("limb 1 along its axis"));
    let estimates = first["estimates"].as_array().unwrap();
    let covariance = folder.read("before/covariance.csv");
    assert_eq!(covariance.lines().count(), estimates.len() + 1);
    let first_row: Vec<&str> = covariance.lines().nth(1).unwrap().split(',').collect();
    let deviation = estimates[0]["standard_uncertainty"].as_f64().unwrap();
    assert!((first_row[1].parse::<f64>().unwrap().sqrt() / deviation - 1.0).abs() < 1e-6);
    let k = first["uncertainty"]["k"].as_f64().unwrap();
    assert!((1.95..2.1).contains(&k), "{k}");
}

#[test]
fn a_repaired_drive_is_found_with_its_size_and_nothing_is_where_nothing_changed() {
    let folder = Folder::new();
    let campaign = folder.path("campaign.csv");
    let planned = json(&[
        "plan",
        "--kind",
        "campaign",
        "--sigma-um",
        "1",
        "--sigma-urad",
        "4",
        "--most-poses",
        "10",
        "--out",
        &campaign,
    ]);
    let poses = planned["poses"].as_u64().unwrap();
    assert!((8..=10).contains(&poses), "{planned}");
    // two series of 24 loads
    assert_eq!(planned["readings"].as_u64().unwrap(), poses * 48);
    let shown = planned["detectable"].as_array().unwrap();
    let drive = shown.iter().find(|d| d["id"] == "limb-1-axial").unwrap();
    assert_eq!(drive["found"], true);
    let size = |key: &str| drive[key].as_f64().unwrap();
    assert!(size("smallest_after") <= size("smallest_before") && size("smallest_of_grid") <= size("smallest_after"));

    let reference = reference_machine();
    // the first is limb 1's drive
    let worn = reference.replacen("3.0e8]", "1.5e8]", 1);
    assert_ne!(worn, reference);
    let (intact, worn) = (folder.write("intact.toml", &reference), folder.write("worn.toml", &worn));
    let diagnose = |machine: &str, name: &str, seed: u64| {
        let data = measure(&folder, &campaign, machine, &format!("{name}.csv"), seed);
        let out = folder.path(name);
        let found = json(&["diagnose", "--machine", &intact, "--data", &data, "--method", "formulas", "--out", &out]);
        (found, out)
    };
    let [(first, before), (_, after), (_, again)] =
        [diagnose(&worn, "before", 1), diagnose(&intact, "after", 2), diagnose(&intact, "again", 3)];

    says_apart(&folder, &first);

    let out = folder.path("verified");
    let found = json(&["verify", "--before", &before, "--after", &format!("{after}/diagnosis.json"), "--out", &out]);
    assert_eq!(found["verdict"], "changed");
    let limb = change(&found, "limb.1.axial");
    assert_eq!(limb["verdict"], "stiffer", "{limb}");
    let truth = 100.0 * (true_ratio(1.5e8) - 1.0);
    let number = |key: &str| limb[key].as_f64().unwrap();
    let off = (number("change_percent") - truth).abs();
    assert!(off < number("expanded_uncertainty_percent"), "{truth} {limb}");
    assert!(number("expanded_uncertainty_percent") < 0.3 * truth, "{truth} {limb}");
    for other in ["limb.2.axial", "limb.3.axial"] {
        assert_eq!(change(&found, other)["verdict"], "unchanged", "{found}");
    }
    assert!(folder.read("verified/report.html").contains("The machine has changed"));

    concludes_nothing_beside_readings_that_are_unsound(&folder, &before, &after);

    // the report of a diagnosis stays where it is
    let kept = folder.read("after/report.html");
    let after_json = format!("{after}/diagnosis.json");
    for (one, other) in [(&before, &after), (&after, &before), (&before, &after_json)] {
        let error = refused(&["verify", "--before", one, "--after", other, "--out", &after]);
        assert!(error["message"].as_str().unwrap().contains("give another folder"), "{error}");
    }
    assert_eq!(folder.read("after/report.html"), kept);

    // measured twice, and nothing was done in between
    let found = json(&["verify", "--before", &after, "--after", &again]);
    assert_eq!(found["verdict"], "unchanged", "{found}");
    one_joint_by_two_names_is_no_change(&folder, &after, &again);
    one_effect_at_two_places_is_no_change(&folder, &after, &again);
    // the same readings twice: that is said first, and nobody is told that all is well
    let same = json(&["verify", "--before", &after, "--after", &after, "--out", &folder.path("same")]);
    assert!(same["caveats"][0].as_str().unwrap().contains("of the same readings"), "{same}");
    let page = folder.read("same/report.html");
    let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("no {text}"));
    assert!(at("of the same readings") < at("settle what") && at("settle what") < at("Nothing has changed"));

    // a machine file of another number is another machine
    let text = folder.read("again/diagnosis.json");
    let sum = first["machine_sha256"].as_str().unwrap();
    let foreign = folder.write("foreign.json", &text.replace(sum, &"0".repeat(64)));
    let error = refused(&["verify", "--before", &after, "--after", &foreign, "--out", &folder.path("none")]);
    assert_eq!(error["column"], "machine_sha256");
    let error = refused(&["verify", "--before", &after, "--after", &again, "--machine", &worn]);
    assert!(error["message"].as_str().unwrap().contains("--machine"), "{error}");
    json(&["verify", "--before", &after, "--after", &again, "--machine", &intact]);
    let broken = folder.write("broken.json", &text.replacen("\"condition\"", "\"state\"", 1));
    assert!(
        refused(&["verify", "--before", &broken, "--after", &after])["message"].as_str().unwrap().contains("condition")
    );
    let cut = folder.write("cut.json", &text[..3000]);
    let error = refused(&["verify", "--before", &cut, "--after", &after]);
    assert!(error["message"].as_str().unwrap().contains("not JSON, or not all of it"), "{error}");
    // the file whose covariance is none is named, whichever it is
    let mut damaged: Value = serde_json::from_str(&text).unwrap();
    damaged["condition"]["deviation_covariance"][0][0] = (-1.0).into();
    let damaged = folder.write("damaged.json", &damaged.to_string());
    for [one, other] in [[&damaged, &after], [&after, &damaged]] {
        let error = refused(&["verify", "--before", one, "--after", other]);
        assert!(error["file"].as_str().unwrap().ends_with("damaged.json"), "{error}");
    }
    assert!(!folder.has("none"));
}

/// Arguments of a campaign.
fn campaign<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["plan", "--kind", "campaign", "--out", out], more].concat()
}

#[test]
fn a_campaign_stays_within_what_is_allowed_and_refuses_what_it_cannot_plan() {
    let folder = Folder::new();
    let out = folder.path("c.csv");
    let stated =
        ["--sigma-um", "2", "--force-n", "80", "--lever-mm", "0", "--detect", "limb-2-axial.axial_m_per_n=2e-9"];
    let planned = json(&campaign(&out, &[&stated[..], &["--series", "3", "--repeats", "2"]].concat()));
    // one load up, full and down again in each of six directions, three series of two repeats
    assert_eq!(planned["readings"].as_u64().unwrap(), planned["poses"].as_u64().unwrap() * 18 * 6);
    let text = folder.read("c.csv");
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    assert!(!header.contains(&"rx_urad"), "{header:?}");
    let at = |line: &str, column: &str| {
        let n = header.iter().position(|h| *h == column).unwrap();
        line.split(',').nth(n).unwrap().to_owned()
    };
    let number = |line: &str, column: &str| at(line, column).parse::<f64>().unwrap();
    for line in text.lines().skip(1) {
        assert!(["fx_n", "fy_n", "fz_n"].iter().all(|c| number(line, c).abs() <= 80.0), "{line}");
        assert!(["mx_nm", "my_nm", "mz_nm"].iter().all(|c| number(line, c) == 0.0), "{line}");
        assert!(number(line, "theta_deg").abs() <= 15.0 && (500.0..=560.0).contains(&number(line, "z0_mm")), "{line}");
        assert_eq!(at(line, "dx_um"), "");
    }
    assert_eq!(text.lines().filter(|l| at(l, "direction") == "unload").count() * 3, text.lines().count() - 1);
    for (more, words) in [
        (vec![], "--sigma-um"),
        (vec!["--sigma-um", "1", "--detect", "no-such.axial=1"], "there is no effect of this name"),
        (vec!["--sigma-um", "1", "--detect", "thermal-modulus.bodies_per_k=1e-4"], "temperatures"),
        (vec!["--sigma-um", "1", "--data", "d.csv"], "--data goes with"),
        (vec!["--sigma-um", "-1"], "expected a number from 0.001 to 10000"),
        (vec!["--sigma-um", "1e-10"], "expected a number from 0.001 to 10000"),
        (vec!["--sigma-um", "1", "--series", "-1"], "'--series <N>'"),
        (vec!["--sigma-um", "1", "--most-poses", "-1"], "'--most-poses <N>'"),
        (
            vec!["--sigma-um", "1", "--box", "-15,15,15,-15,500,560"],
            "expected least,greatest of each, found 15,-15 of σ",
        ),
        (vec!["--sigma-um", "1", "--box", "-15,15,-15,15,0.5,0.56"], "Z0 0.5 to 0.56 mm, is within travel"),
        (vec!["--sigma-um", "1", "--force-n", "1e-10"], "expected a number from 1 to 100000"),
        (vec!["--sigma-um", "1", "--detect", "limb-1-axial.axial_m_per_n=-1e-8"], "expected a size above 0"),
        (vec!["--sigma-um", "1", "--detect", "limb-1-axial.axial_m_per_n=1e300"], "no machine file may have"),
    ] {
        let error = refused(&campaign(&out, &more));
        assert!(error["message"].as_str().unwrap().contains(words), "{error}");
    }
    let error = refused(&["plan", "--kind", "l49", "--force-n", "10", "--out", &out]);
    assert!(error["message"].as_str().unwrap().contains("--kind campaign"), "{error}");
}
