//! Tools and tool paths as a user gives them: `ik` and `fk` with the wrist, and `compensate`.

use std::f64::consts::PI;

use nalgebra::{Vector2, Vector3};
use pkm_core::tables::reference::{MACHINE_F64, TABLE_F64, UNCERTAINTY_F64};
use pkm_core::{Configuration, Pose, Tool, Wrench};
use serde_json::Value;

use crate::common::{FIVE, Folder, fixture, json, numbers, reference_machine, refused, run};

const HOME: Configuration<f64> =
    Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 }, beta_rad: Vector2::new(0.0, 0.0) };
const HEADER: &str = "x_mm,y_mm,z_mm,i,j,k,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm";

fn says(error: &Value, kind: &str, line: Option<u64>, words: &[&str]) {
    let message = error["message"].as_str().unwrap();
    assert_eq!((error["kind"].as_str(), error["line"].as_u64()), (Some(kind), line), "{message}");
    for word in words {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
}

fn text(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
}

fn at(theta_deg: f64, sigma_deg: f64, z0_mm: f64, beta_deg: [f64; 2]) -> Configuration<f64> {
    let pose = pkm_host::pose::pose_of(theta_deg, sigma_deg, z0_mm);
    Configuration { pose, beta_rad: beta_deg.map(f64::to_radians).into() }
}

/// A row of a path from a configuration, with a wrench.
fn row(configuration: &Configuration<f64>, wrench: &str) -> String {
    let Tool { tip_m, axis } = FIVE.tool(configuration).expect("a tool");
    format!("{},{},{wrench}\n", text((tip_m * 1e3).as_slice()), text(axis.as_slice()))
}

/// Rows of cells below the comments and the header.
fn rows(csv: &str, separator: char) -> Vec<Vec<f64>> {
    let lines = csv.lines().filter(|l| !l.starts_with('#')).skip(1);
    lines.map(|l| l.split(separator).take(12).map(|c| c.parse().unwrap()).collect()).collect()
}

type Rotation = [[f64; 3]; 3];

fn product(a: &Rotation, b: &Rotation) -> Rotation {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn times(a: &Rotation, v: [f64; 3]) -> [f64; 3] {
    a.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn about(axis: usize, angle: f64) -> Rotation {
    let (s, c) = angle.sin_cos();
    [
        [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
        [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
        [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
    ][axis]
}

/// Where a configuration has the tip in A-uvw, in m, and the axes of the tool there.
fn held(c: &Configuration<f64>) -> ([f64; 3], Rotation) {
    let [b1, b2] = c.beta_rad.into();
    let (r, h) = (-35.0 - 150.0 * b2.cos() - 190.0 * b2.sin(), 417.0 - 150.0 * b2.sin() + 190.0 * b2.cos());
    let arm = [-20.0 + b1.cos() * r, b1.sin() * r, h].map(|mm| mm / 1e3);
    (arm, product(&about(2, b1), &about(1, -b2)))
}

/// Tip and axis of the loaded tool, in mm: what the stiffness at A does is carried to the tip by matrices.
fn loaded(c: &Configuration<f64>, wrench: &[f64], with_table: bool) -> ([f64; 3], [f64; 3], f64) {
    let platform = product(&about(1, c.pose.theta_rad), &about(0, c.pose.sigma_rad));
    let (arm, tool) = held(c);
    let force = times(&tool, [wrench[0], wrench[1], wrench[2]]);
    let moment = times(&tool, [wrench[3], wrench[4], wrench[5]]);
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let plus = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| a[i] + b[i]) };
    let factor = if with_table {
        TABLE_F64.factor_form(&MACHINE_F64, &c.pose).unwrap().factor
    } else {
        MACHINE_F64.stiffness(&c.pose).unwrap().factor().unwrap()
    };
    let d = factor
        .deflection(&Wrench { force_n: force.into(), moment_nm: plus(moment, cross(arm, force)).into() })
        .unwrap();
    let (translation, rotation) = (d.translation_m.into(), d.rotation_rad.into());
    let moved = times(&platform, plus(translation, cross(rotation, arm)));
    let axis = times(&platform, times(&tool, [0.0, 0.0, 1.0]));
    let swing = cross(times(&platform, rotation), axis);
    let z0 = c.pose.z0_m;
    let tip = plus(times(&platform, arm), [z0 * c.pose.theta_rad.tan(), 0.0, z0]);
    (plus(tip, moved).map(|m| m * 1e3), plus(axis, swing), moved.iter().map(|v| v * v).sum::<f64>().sqrt() * 1e3)
}

fn off(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Largest error of the tip that a compensated CSV leaves, as a share of the deflection there, and in mm; checks that the machine
/// never jumps.
fn left_over(asked: &[Vec<f64>], written: &[Vec<f64>], with_table: bool) -> (f64, f64) {
    assert_eq!(asked.len(), written.len());
    let (mut near, mut share, mut worst) = (HOME, 0.0_f64, 0.0_f64);
    for (n, (asked, written)) in asked.iter().zip(written).enumerate() {
        let [x, y, z, i, j, k] = std::array::from_fn(|column| written[column]);
        let tool = Tool { tip_m: Vector3::new(x, y, z) / 1e3, axis: Vector3::new(i, j, k) };
        let held = FIVE.inverse(&tool, &near).expect("in reach").configuration;
        let angles = |c: &Configuration<f64>| [c.pose.theta_rad, c.pose.sigma_rad, c.beta_rad[0], c.beta_rad[1]];
        assert!(n == 0 || off(&angles(&held), &angles(&near)) < 0.4, "a jump");
        near = held;
        let (tip, axis, deflection) = loaded(&near, &asked[6..], with_table);
        let size = off(&asked[3..6], &[0.0; 3]);
        assert!(off(&axis, &[asked[3] / size, asked[4] / size, asked[5] / size]) < 1e-7);
        worst = worst.max(off(&tip, &asked[..3]));
        share = share.max(off(&tip, &asked[..3]) / deflection);
        assert_eq!(asked[6..], written[6..], "the wrench stays");
    }
    (share, worst)
}

#[test]
fn ik_of_a_tool_undoes_fk() {
    let (mut checked, mut other_mode) = (0, 0);
    for (theta, sigma, z0) in [(0.0, 0.0, 530.0), (12.0, -9.0, 505.0), (-20.0, 11.0, 480.0), (-7.5, 3.0, 600.0)] {
        for beta in [[0.0, -10.0], [35.0, -40.0], [-60.0, 5.0], [80.0, -80.0], [0.0, 60.0]] {
            let c = at(theta, sigma, z0, beta);
            let (Ok(joints), Ok(share)) = (FIVE.joints(&c), FIVE.normalised_determinant(&c)) else { continue };
            let q_mm: [f64; 3] = (joints.lengths.q_m * 1e3).into();
            let fk = json(&["fk", "--q-mm", &text(&q_mm), "--beta-deg", &text(&beta)]);
            assert!((fk["theta_deg"].as_f64().unwrap() - theta).abs() < 1e-9);
            let (tip, axis): ([f64; 3], [f64; 3]) = (numbers(&fk["tip_mm"]), numbers(&fk["axis"]));
            let (tip_there, axis_there, _) = loaded(&c, &[0.0; 6], false);
            assert!(off(&tip, &tip_there) < 1e-9 && off(&axis, &axis_there) < 1e-12);
            let near = [&q_mm[..], &beta].concat();
            let args = [
                "ik",
                "--tip-mm",
                &text(&tip),
                "--axis",
                &text(&axis.map(|v| 3.0 * v)),
                "--near",
                &text(&near),
                "--all",
            ];
            if share < 0.1 {
                // refused as a command to the machine, and yet listed
                let error = refused(&args[..args.len() - 1]);
                assert!(["singular", "out_of_travel"].contains(&error["kind"].as_str().unwrap()), "{error}");
                let solutions = json(&args)["solutions"].take();
                let same = |s: &Value| off(&numbers::<3>(&s["q_mm"]), &q_mm) < 1e-6;
                assert!(solutions.as_array().unwrap().iter().any(same), "{q_mm:?} is not in {solutions}");
                other_mode += 1;
                continue;
            }
            let ik = json(&args);
            assert_eq!(ik["status"], "ok");
            assert!(off(&numbers::<3>(&ik["q_mm"]), &q_mm) < 1e-6, "{ik}");
            let found =
                ["theta_deg", "sigma_deg", "z0_mm", "beta1_deg", "beta2_deg"].map(|key| ik[key].as_f64().unwrap());
            assert!(off(&found, &[theta, sigma, z0, beta[0], beta[1]]) < 1e-6, "{ik}");
            let solutions = ik["solutions"].as_array().unwrap();
            assert_eq!(solutions[0]["q_mm"], ik["q_mm"], "the nearest first");
            for solution in solutions {
                let q: [f64; 3] = numbers(&solution["q_mm"]);
                let beta = ["beta1_deg", "beta2_deg"].map(|key| solution[key].as_f64().unwrap());
                let again = json(&["fk", "--q-mm", &text(&q), "--beta-deg", &text(&beta)]);
                assert!(
                    off(&numbers::<3>(&again["tip_mm"]), &tip) < 1e-5
                        && off(&numbers::<3>(&again["axis"]), &axis) < 1e-8
                );
                assert_eq!(
                    solution["clear_of_singularity"],
                    solution["normalised_determinant"].as_f64().unwrap() >= 0.1
                );
            }
            checked += 1;
        }
    }
    assert!(checked > 8 && other_mode > 1, "{checked}, {other_mode}");
    let home = json(&["ik", "--tip-mm", "-205,0,1137", "--axis", "0,0,1"]);
    assert!(
        (home["z0_mm"].as_f64().unwrap() - 530.0).abs() < 1e-9
            && home["normalised_determinant"].as_f64().unwrap() > 0.999_999
    );
}

#[test]
fn a_tool_that_cannot_be_held_is_refused_with_the_amount() {
    let ik = |tip: &str, axis: &str| refused(&["ik", "--tip-mm", tip, "--axis", axis]);
    says(
        &ik("-205,0,1637", "0,0,1"),
        "out_of_travel",
        None,
        &["limb 1", "beyond its travel", "mm long", "gets as far as"],
    );
    says(&ik("-205,0,137", "0,0,1"), "unreachable", None, &["no configuration", "gets as far as tip"]);
    // β2 = 30° at home: in the opposite working mode
    let far = FIVE.tool(&at(0.0, 0.0, 530.0, [0.0, 30.0])).unwrap();
    let error = ik(&text((far.tip_m * 1e3).as_slice()), &text(far.axis.as_slice()));
    says(&error, "singular", None, &["normalised determinant -0.15", "at least 0.1"]);
    says(
        &refused(&["fk", "--q-mm", "556,556,553", "--beta-deg", "95,-3"]),
        "out_of_travel",
        None,
        &["β1", "5.000°", "-90 to 90"],
    );

    // narrow wrist limits count as travel
    let folder = Folder::new();
    let narrow = reference_machine().replace("b_mm = -150.0, min_deg = -90.0", "b_mm = -150.0, min_deg = -10.0");
    let tool = FIVE.tool(&at(0.0, 0.0, 530.0, [0.0, -12.5])).unwrap();
    let (tip, axis) = (text((tool.tip_m * 1e3).as_slice()), text(tool.axis.as_slice()));
    let args = ["ik", "--machine", &folder.write("m.toml", &narrow), "--tip-mm", &tip, "--axis", &axis];
    says(&refused(&args), "out_of_travel", None, &["β2 would be 2.500° beyond"]);
}

#[test]
fn a_badly_asked_tool_is_a_usage_error() {
    for (args, words) in [
        (&["ik", "--tip-mm", "0,0,1100"][..], "--axis"),
        (&["ik", "--axis", "0,0,1"], "--tip-mm"),
        (&["ik", "--tip-mm", "0,0,1100", "--axis", "0,0,0"], "direction"),
        (&["ik", "--tip-mm", "0,0,1100", "--axis", "0,0"], "expected 3 numbers"),
        (&["ik", "--tip-mm", "0,0,nan", "--axis", "0,0,1"], "finite"),
        (&["ik", "--tip-mm", "0,0,1100", "--axis", "0,0,1", "--theta-deg", "1"], "cannot be used with"),
        (&["ik", "--theta-deg", "1", "--sigma-deg", "1", "--z0-mm", "530", "--all"], "--tip-mm"),
        (&["ik", "--tip-mm", "0,0,1100", "--axis", "0,0,1", "--near", "1,2,3"], "expected 5 numbers"),
        (&["ik"], "--theta-deg"),
        (&["fk", "--q-mm", "556,556,553", "--beta-deg", "1"], "expected 2 numbers"),
    ] {
        says(&refused(args), "usage", None, &[words]);
    }
    let near = ["ik", "--tip-mm", "-205,0,1137", "--axis", "0,0,1", "--near", "556,556,553,0,-120"];
    says(&refused(&near), "out_of_travel", None, &["--near", "β2", "30.000°"]);
}

#[test]
fn a_compensated_csv_leaves_a_thousandth_of_the_deflection() {
    let folder = Folder::new();
    let (path, table) = (fixture("jobs/path.csv"), folder.table());
    let asked = rows(&std::fs::read_to_string(&path).unwrap(), ',');
    for with_table in [false, true] {
        let out = folder.path("out.csv");
        let mut args = vec!["compensate", "--path", &path, "--out", &out];
        if with_table {
            args.extend(["--table", &table]);
        }
        let summary = json(&args);
        let written = folder.read("out.csv");
        let (share, worst) = left_over(&asked, &rows(&written, ','), with_table);
        println!("left: {share:e} of the deflection, {worst:e} mm");
        assert!(share <= 1e-3, "{share}");
        let before = summary["error_before_um"]["max"].as_f64().unwrap();
        let after = summary["error_after_um"]["max"].as_f64().unwrap();
        assert!(before > 30.0 && after <= 1e-3 * before && (after - worst * 1e3).abs() < 1e-4, "{summary}");
        assert_eq!((&summary["points"], &summary["extrapolated_points"]), (&asked.len().into(), &0.into()));
        assert!((0.1..2.0).contains(&summary["min_normalised_determinant"].as_f64().unwrap()));
        assert!(folder.read("out.svg").contains("<svg"));
        let report = folder.read("report.html");
        assert!(report.contains(&format!("takes the tip {before:.1} µm from its path at most")), "{summary}");
        // the lines with the greatest errors, the worst first
        let row = &report[report.find("<tbody>").unwrap()..];
        let row = &row[..row.find("</tr>").unwrap()];
        assert!(row.contains("line ") && row.contains(&format!(">{before:.3}<")), "{row}");
    }
    let out = folder.path("filled.csv");
    let filled = json(&["compensate", "--path", &path, "--step-mm", "5", "--out", &out]);
    assert!(filled["points"].as_u64().unwrap() > asked.len() as u64);
    assert!(filled["error_at_midpoints_um"]["max"].as_f64().unwrap() < 0.1, "{filled}");
}

const LOADED_ROWS: &str = "x_mm,y_mm,z_mm,i,j,k,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n\
    -205,0,1137,0,0,1,LOAD,50,-400,0,0,0\n150,0,1137,0,0,1,LOAD,50,-400,0,0,0\n";

/// The control goes straight between two rows that are far apart, and the stiffness along the way is another.
#[test]
fn rows_that_are_far_apart_are_judged_between_them_too() {
    let folder = Folder::new();
    let (path, out) = (folder.write("far.csv", &LOADED_ROWS.replace("LOAD", "100")), folder.path("out.csv"));
    let summary = json(&["compensate", "--path", &path, "--out", &out]);
    let report = folder.read("report.html");
    assert!(report.contains("axis by ") && report.contains("have points written between"), "the page");
    let [start, end] = [0, 1].map(|row| rows(&folder.read("out.csv"), ',')[row][..3].to_vec());
    json(&["compensate", "--path", &path, "--step-mm", "177.5", "--out", &out]);
    let middle = &rows(&folder.read("out.csv"), ',')[1][..3];
    let off_um = 1e3 * (0..3).map(|i| (middle[i] - 0.5 * (start[i] + end[i])).powi(2)).sum::<f64>().sqrt();
    let said_um = summary["error_at_midpoints_um"]["max"].as_f64().unwrap();
    assert!(off_um > 3.0 && (said_um - off_um).abs() < 0.05 * off_um, "{said_um} {off_um}");
    let warning = summary["warnings"].to_string();
    assert!(
        warning.contains("at midpoints between points 4.08 µm are left") && warning.contains("--step-mm"),
        "{warning}"
    );
}

#[test]
fn a_load_in_other_units_is_asked_about_where_no_command_makes_up_for_it() {
    let folder = Folder::new();
    for load in ["4e5", "5e6", "1e8"] {
        let path = folder.write("q.csv", &LOADED_ROWS.replacen("LOAD", load, 1).replace("LOAD", "100"));
        let output = run(&["compensate", "--path", &path, "--out", &folder.path("out.csv")]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(message.contains("mm, farther than a machine tool yields: are forces in N"), "{message}");
        assert!(!message.contains(":  ("), "{message}");
    }
}

#[test]
fn a_path_says_how_well_the_table_knows_its_deflection() {
    let folder = Folder::new();
    let (path, table, out) = (fixture("jobs/path.csv"), folder.table(), folder.path("out.csv"));
    let summary = json(&["compensate", "--path", &path, "--table", &table, "--out", &out]);
    let (mut near, mut u95_mm) = (HOME, Vec::new());
    let asked = rows(&std::fs::read_to_string(&path).unwrap(), ',');
    let whole = rows(&std::fs::read_to_string(&out).unwrap(), ',');
    for row in &asked {
        let [x, y, z, i, j, k] = std::array::from_fn(|column| row[column]);
        let tool = Tool { tip_m: Vector3::new(x, y, z) / 1e3, axis: Vector3::new(i, j, k) };
        near = FIVE.inverse(&tool, &near).expect("in reach").configuration;
        let (arm, axes) = held(&near);
        let [force, moment] = [6, 9].map(|n| times(&axes, [row[n], row[n + 1], row[n + 2]]).into());
        let load = Wrench { force_n: force, moment_nm: moment };
        let factor = TABLE_F64.factor_form(&MACHINE_F64, &near.pose).unwrap().factor;
        let known = TABLE_F64.tip_uncertainty(&UNCERTAINTY_F64, &factor, &near.pose, &load, arm.into()).unwrap();
        u95_mm.push(1.96e3 * known.variance_m2.sum().sqrt());
    }
    let worst = 1e3 * u95_mm.iter().fold(0.0, |worst: f64, u95| worst.max(*u95));
    let said = summary["u95_um"]["max"].as_f64().unwrap();
    assert!((said - worst).abs() < 1e-6 * worst, "{said} is not {worst}");
    assert_eq!(summary["unsure_points"], 0);

    // a table that hardly knows anything
    let mut unsure: Value = serde_json::from_str(&std::fs::read_to_string(&table).unwrap()).unwrap();
    let spread = unsure["uncertainty"]["spread"].as_array_mut().expect("a table's uncertainty");
    spread.iter_mut().for_each(|factor| *factor = (factor.as_f64().unwrap() * 1e8).into());
    let table = folder.write("unsure.json", &unsure.to_string());
    let summary = json(&["compensate", "--path", &path, "--table", &table, "--out", &out]);
    assert!((summary["u95_um"]["max"].as_f64().unwrap() - 1e4 * said).abs() < 1e-6 * 1e4 * said);
    assert_eq!(summary["unsure_points"], summary["loaded_points"]);
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("expanded uncertainty exceeds the deflection"), "{warnings}");
    let report = folder.read("report.html");
    assert!(report.contains("Not all of the deflection is known"));
    // and compensates the share that is known
    let (part, mut least) = (rows(&std::fs::read_to_string(&out).unwrap(), ','), 1.0_f64);
    for (((asked, whole), part), u95_mm) in asked.iter().zip(&whole).zip(&part).zip(&u95_mm) {
        let off = |row: &[f64]| Vector3::from_fn(|n, _| row[n] - asked[n]);
        let (whole, part) = (off(whole), off(part));
        if whole.norm() > 0.0 {
            let share = whole.norm() / (1e4 * u95_mm);
            least = least.min(share);
            assert!((part - whole * share).norm() < 0.02 * part.norm() + 2e-6, "{part} of {whole}: not {share}");
        }
    }
    let share = summary["least_known_share"].as_f64().unwrap();
    assert!(share > 0.0 && (share / least - 1.0).abs() < 0.02, "{share} is not {least}");

    let without = json(&["compensate", "--path", &path, "--out", &out]);
    assert_eq!((&without["u95_um"], &without["unsure_points"]), (&Value::Null, &0.into()));
    assert_eq!(without["least_known_share"], Value::Null);
}

#[test]
fn a_path_goes_across_the_box_and_not_beyond_it() {
    let folder = Folder::new();
    let table = folder.table();
    let wrench = "120,-80,-300,2,-1,3";
    let across = |reach: f64| {
        let row = |n: i32| {
            let t = f64::from(n) / 20.0;
            let c = at(reach * t, -0.9 * reach * t, 530.0 + 1.9 * reach * t, [40.0 * t, -30.0 + 20.0 * t]);
            row(&c, wrench)
        };
        (-20..=20).map(row).collect::<String>()
    };
    let path = folder.write("in.csv", &format!("{HEADER}\n{}", across(14.9)));
    let out = folder.path("out.csv");
    let summary = json(&["compensate", "--path", &path, "--table", &table, "--out", &out]);
    let (share, _) = left_over(&rows(&folder.read("in.csv"), ','), &rows(&folder.read("out.csv"), ','), true);
    println!("left: {share:e} of the deflection");
    assert!(share <= 1e-3, "{share}");
    assert!(
        summary["error_after_um"]["max"].as_f64().unwrap()
            <= 1e-3 * summary["error_before_um"]["max"].as_f64().unwrap()
    );

    // without a table there is no box; with one it ends at θ = ±15°
    let path = folder.write("far.csv", &format!("{HEADER}\n{}", across(16.0)));
    json(&["compensate", "--path", &path, "--out", &folder.path("basic.csv")]);
    let args = ["compensate", "--path", &path, "--table", &table, "--out", &folder.path("far-out.csv")];
    let error = refused(&args);
    says(&error, "outside_box", Some(2), &["θ = -15.99", "outside -15 to 15°", "--allow-extrapolation"]);
    assert!(!folder.has("far-out.csv") && !folder.has("far-out.svg"));
    let summary = json(&[&args[..], &["--allow-extrapolation"]].concat());
    let beyond = summary["extrapolated_points"].as_u64().unwrap();
    assert_eq!(beyond, 4, "θ = ±16° and ±15.2°: {summary}");
    assert!(folder.read("far-out.csv").contains(&format!("# pkm-host compensate: {beyond} of 41 points lie outside")));
}

#[test]
fn a_path_that_the_machine_cannot_go_is_refused_with_its_line() {
    let folder = Folder::new();
    let out = folder.path("out.csv");
    let refuse = |body: &str| {
        let path = folder.write("in.csv", &format!("# no way\n{HEADER}\n{body}"));
        let error = refused(&["compensate", "--path", &path, "--out", &out]);
        assert!(!folder.has("out.csv") && !folder.has("out.svg"));
        error
    };
    let wrench = "100,0,-100,0,0,1";
    // β2 from −10° over the singularity locus (25.8°) to 50°; both ends could be held, and no row stands on the surface
    let turn: String = [-10.0, 10.0, 50.0].map(|b| row(&at(0.0, 0.0, 530.0, [0.0, b]), wrench)).concat();
    says(&refuse(&turn), "singular", Some(5), &["on the way from line 4", "normalised determinant", "at least 0.1"]);
    let out_of_travel = format!("{}-205,0,1437,0,0,1,{wrench}\n", row(&HOME, wrench));
    says(
        &refuse(&out_of_travel),
        "out_of_travel",
        Some(4),
        &["on the way from line 3", "mm beyond its travel", "770 mm"],
    );
    says(&refuse(&format!("-205,0,1637,0,0,1,{wrench}\n")), "out_of_travel", Some(3), &["mm beyond its travel"]);
    says(&refuse(&format!("-205,0,1137,0,0,0,{wrench}\n")), "input", Some(3), &["no direction"]);
    let over = format!("-205,0,1137,0,0,1,{wrench}\n-205,0,1137,0,0,-1,{wrench}\n");
    says(&refuse(&over), "input", Some(4), &["180°"]);
    says(&refuse(&format!("{}-205,0,1e9,0,0,1,{wrench}\n", row(&HOME, wrench))), "input", None, &["steps"]);
    let heavy = row(&HOME, "1e12,0,0,0,0,0");
    assert_eq!(refuse(&heavy)["line"], 3);
}

#[test]
fn spreadsheets_are_read_as_they_are() {
    let folder = Folder::new();
    let plain = folder.write("plain.csv", &format!("{HEADER}\n-205,0,1137.5,0,0,1,100,-50,-60.5,0,0,1\n"));
    json(&["compensate", "--path", &plain, "--out", &folder.path("plain-out.csv")]);
    let header = HEADER.replace(',', ";");
    let sheet =
        format!("\u{feff}# a comment\r\nblock;{header}\r\n\"first; cut\";-205;0;1137,5;0;0;1;100;-50;-60,5;0;0;1\r\n");
    json(&["compensate", "--path", &folder.write("sheet.csv", &sheet), "--out", &folder.path("sheet-out.csv")]);
    let found = folder.read("sheet-out.csv");
    let line = found.lines().last().unwrap();
    assert!(line.starts_with("\"first; cut\";") && line.ends_with(";100;-50;-60,5;0;0;1;1"), "{line}");
    // what went through once is not taken again
    let again = refused(&["compensate", "--path", &folder.path("sheet-out.csv"), "--out", &folder.path("again.csv")]);
    says(&again, "input", Some(1), &["compensated already"]);
    let expected = folder.read("plain-out.csv");
    let expected = expected.lines().last().unwrap().replace(',', ";").replace('.', ",");
    assert_eq!(line, format!("\"first; cut\";{expected}"));

    let bad = |header: &str, body: &str| {
        let path = folder.write("bad.csv", &format!("{header}\n{body}\n"));
        let error = refused(&["compensate", "--path", &path, "--out", &folder.path("bad-out.csv")]);
        assert!(!folder.has("bad-out.csv"));
        (error["line"].as_u64(), error["column"].clone(), error["message"].as_str().unwrap().to_owned())
    };
    let good = "-205,0,1137,0,0,1,100,0,0,0,0,1";
    let (line, column, message) = bad(&HEADER.replace("z_mm", "z_m"), good);
    assert!(line == Some(1) && column == "z_m" && message.contains("did you mean `z_mm`"), "{message}");
    let (_, column, message) = bad(&HEADER.replace(",fz_n", ""), "-205,0,1137,0,0,1,100,0,0,0,1");
    assert!(column == "fz_n" && message.contains("missing"), "{message}");
    let (line, column, _) = bad(HEADER, &format!("{good}\n-205,0,nan,0,0,1,100,0,0,0,0,1"));
    assert_eq!((line, column), (Some(3), "z_mm".into()));
    let (line, _, message) = bad(HEADER, "-205,0,1137,0,0,1,100,0,0,0,0");
    assert!(line == Some(2) && message.contains("expected 12 cells"), "{message}");
}

/// Places of a program's moves: letters with their numbers, modal.
fn places(program: &str, letters: &str) -> Vec<Vec<f64>> {
    let mut now = vec![f64::NAN; letters.len()];
    let mut found = Vec::new();
    for line in program.lines().map(|l| l.split(['(', ';']).next().unwrap()) {
        let words: Vec<&str> = line.split_whitespace().filter(|w| letters.contains(&w[..1])).collect();
        for word in &words {
            now[letters.find(&word[..1]).unwrap()] = word[1..].parse().unwrap();
        }
        if !words.is_empty() {
            found.push(now.clone());
        }
    }
    found
}

#[test]
fn a_program_keeps_its_words_and_is_divided() {
    let folder = Folder::new();
    let path = fixture("jobs/path.ngc");
    let out = folder.path("out.ngc");
    let summary = json(&["compensate", "--path", &path, "--table", &folder.table(), "--out", &out]);
    let (original, written) = (std::fs::read_to_string(&path).unwrap(), folder.read("out.ngc"));
    // lines without a move stay, in their order
    let mut lines = written.lines();
    let still = original.lines().filter(|l| !l.contains(['X', 'Y', 'Z']) || l.starts_with('('));
    for line in still {
        assert!(lines.any(|l| l == line), "{line}");
    }
    assert!(written.starts_with("%\n(pkm-host compensate: machine reference, coefficients.json, path.ngc)\n"));
    assert!(written.contains("N50 G1 F200 M8 X"), "{written}");
    let points = places(&written, "XYZIJK");
    assert_eq!(summary["points"], points.len());
    assert!(points.windows(2).all(|w| off(&w[0][..3], &w[1][..3]) < 2.1 || w[1][2] == 1120.0), "steps of 2 mm");
    let (before, after) = (&summary["error_before_um"]["max"], summary["error_after_um"]["max"].as_f64().unwrap());
    assert!(after <= 1e-3 * before.as_f64().unwrap(), "{summary}");
    assert!(summary["error_at_midpoints_um"]["max"].as_f64().unwrap() <= 1e-3 * before.as_f64().unwrap(), "{summary}");
    // what went through once is not taken again, whatever a control made of the comment
    let again = |path: &str, line: u64| {
        let again = refused(&["compensate", "--path", path, "--out", &folder.path("again.ngc")]);
        says(&again, "input", Some(line), &["compensated already"]);
        assert!(!folder.has("again.ngc"));
    };
    again(&out, 2);
    again(&folder.write("upper.ngc", &written.to_uppercase()), 2);
    again(&folder.write("numbered.ngc", &written.replace("(pkm-host", "N1 (pkm-host")), 2);
    again(&folder.write("semicolon.ngc", &written.replace("(pkm-host", "; pkm-host")), 2);
    // the fast moves have no load and stay where they were
    assert!(written.contains("\nN30 G0 X-235 Y-20 Z1120 I-0.058041 J-0.038694 K0.997564\n"), "{written}");
}

#[test]
fn rotary_words_are_the_wrists_joints() {
    let folder = Folder::new();
    let program =
        "G21 G90 (mm)\nG0 X-235 Y-20 Z1120 A-10 B-5\ng1 z1139 f200 m8 ; plunge\nx-175 a 20 b-12 m0\nn5 y1.5e\nM2\n";
    let path = folder.write("ab.ngc", program);
    let out = folder.path("out.ngc");
    let args = ["compensate", "--path", &path, "--wrench", "-100,50,-60,0,0,-1", "--out", &out];
    says(&refused(&args), "input", Some(5), &["E"]);
    folder.write("ab.ngc", &program.replace("1.5e", "1.5"));
    let summary = json(&args);
    let written = folder.read("out.ngc");
    assert!(written.contains("; plunge\n") && written.contains(" M0\nN5 X"), "{written}");
    let points = places(&written, "XYZAB");
    assert_eq!(summary["points"], points.len());
    // each stands where the load takes it to the straight way between the points asked for
    let mut near = at(0.0, 0.0, 530.0, [-10.0, -5.0]);
    let corner = [-235.0, -20.0, 1139.0, -10.0, -5.0];
    let cut: Vec<_> = points.iter().filter(|p| (p[1] + 20.0).abs() < 0.2 && p[2] > 1138.5).collect();
    assert!(cut.len() > 30);
    for p in cut {
        let beta = [p[3], p[4]];
        // by Newton steps on θ, σ, Z0 with differences of the tip
        for _ in 0..20 {
            let c = |d: [f64; 3]| {
                let [t, s, z] = [near.pose.theta_rad + d[0], near.pose.sigma_rad + d[1], near.pose.z0_m + d[2]];
                at(t * 180.0 / PI, s * 180.0 / PI, z * 1e3, beta)
            };
            let tip = |d: [f64; 3]| loaded(&c(d), &[0.0; 6], false).0;
            let (now, h) = (tip([0.0; 3]), 1e-6);
            let columns: [[f64; 3]; 3] = std::array::from_fn(|i| {
                let mut d = [0.0; 3];
                d[i] = h;
                let moved = tip(d);
                std::array::from_fn(|k| (moved[k] - now[k]) / h)
            });
            let goal: [f64; 3] = std::array::from_fn(|i| p[i] - now[i]);
            let det = |m: [[f64; 3]; 3]| {
                m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
                    + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
            };
            let step: [f64; 3] = std::array::from_fn(|i| {
                let mut m = columns;
                m[i] = goal;
                det(m) / det(columns)
            });
            near = c(step);
        }
        let (tip, axis, deflection) = loaded(&near, &[-100.0, 50.0, -60.0, 0.0, 0.0, -1.0], false);
        let share = (tip[0] - corner[0]) / 60.0;
        assert!((-1e-6..1.0 + 1e-6).contains(&share));
        assert!(off(&tip, &[tip[0], -20.0, 1139.0]) <= 1e-3 * deflection, "{tip:?}");
        // the axis that the joints on the way give there without a load
        let asked = at(
            near.pose.theta_rad * 180.0 / PI,
            near.pose.sigma_rad * 180.0 / PI,
            near.pose.z0_m * 1e3,
            [corner[3] + 30.0 * share, corner[4] - 7.0 * share],
        );
        assert!(off(&axis, &loaded(&asked, &[0.0; 6], false).1) < 1e-4);
    }
}

#[test]
fn what_is_not_of_the_dialect_is_refused_with_its_line() {
    let folder = Folder::new();
    let start = "G21 G90\nG0 X-205 Y0 Z1130 I0 J0 K1\n";
    let refuse = |program: &str| {
        let path = folder.write("p.ngc", program);
        let args = ["compensate", "--path", &path, "--wrench", "1,0,-60,0,0,0", "--out", &folder.path("out.ngc")];
        let error = refused(&args);
        assert!(!folder.has("out.ngc"));
        error
    };
    for (line, words) in [
        ("G2 X-200 Y5 I9 J0", "the arc's radius is 9"),
        ("G03 X-200 Y5 R1", "the arc's ends are"),
        ("G2 X-200 Y5", "without centre"),
        ("G2 X-200 Y5 I5 K3", "K is not in the arc's plane"),
        ("G93 G1 X-200", "F is missing"),
        ("G54", "--job"),
        ("G43 H1", "--tools"),
        ("G43.1 H1", "G43 H, G43.4 H and G49"),
        ("G41 D1", "tool's centre"),
        ("G10 L1 P1 Z3", "only L2 and L20"),
        ("G53 X-200 Y0 Z1130 G91", "G53 in G91"),
        ("G81 X-200 Z3", "expected R"),
        ("G83 X-200 Z1129 R1130", "Q, the depth"),
        ("G84 X-200 Z3 R1", "coupled to the spindle"),
        ("G85 X-200 Z3 R1", "of cycles"),
        ("G5 X-200", "splines"),
        ("G77 X-200", "of cycles"),
        ("G1 X-200 C10", "`C10` is not supported"),
        ("G1 X-200 A10", "I J K and A B"),
        ("G1 X-200 X-201", "duplicate X"),
        ("G0 G1 X-200", "second motion"),
        ("G4 P1 X-200", "G4 with a move"),
        ("G1 X", "X: expected a number, found ``"),
        ("G1 X1.2.3", "X: expected a number"),
        ("G1 X#1", "#1 has no value"),
        ("G1 X[1+2", "`]` is missing"),
        ("#1=2+3", "stands in brackets"),
        ("O100 sub", "`O100 endsub` is missing"),
        ("O100 call", "O100 is not in this file"),
        ("O100 if [1]", "`O100 endif` is missing"),
        ("M98 P7", "O7 is not in this file"),
        ("M99", "without end"),
        ("M72", "not followed"),
        ("G1 X-200 (open", "not closed"),
        ("G1 -200", "found `-`"),
        ("X-200 N10", "N first"),
        ("P3", "`P3`"),
        ("G80 X-200", "before any G0 or G1"),
        ("G1 I0 J0 K0", "no direction"),
        ("(wrench 1,2,3)", "six numbers"),
        ("; wrench 1,2,3,4,5,x", "six numbers"),
        ("G1 X-200 (wrench 1,2,3,0,0,0) (F 3 2 1)", "`(wrench 1,2,3,0,0,0)` and `(F 3 2 1)`|one load"),
        ("(F 3 2 1) ; wrench 1,2,3,0,0,0", "`(F 3 2 1)` and `; wrench 1,2,3,0,0,0`|one load"),
        ("G1 Z1400", "beyond its"),
    ] {
        let kind = if words == "beyond its" { "out_of_travel" } else { "input" };
        says(&refuse(&format!("{start}{line}\n")), kind, Some(3), &words.split('|').collect::<Vec<_>>());
    }
    says(&refuse("G0 X1 Y2\n"), "input", Some(1), &["all of X Y Z"]);
    says(&refuse("G0 X1 Y2 Z3\n"), "input", Some(1), &["where the tool points"]);
    says(&refuse("X1 Y2 Z3 I0 J0 K1\n"), "input", Some(1), &["before any G0 or G1"]);
    says(&refuse("M3 S100\n"), "input", None, &["found none"]);
    says(&refuse("0 BEGIN PGM PLATE MM\n"), "input", Some(1), &["is this G-code"]);
    says(&refuse("G0 CYCL DEF\n"), "input", Some(1), &["is this G-code"]);
    says(&refuse(&format!("{start}O100\n")), "input", Some(3), &["another program begins"]);
    says(&refuse(&format!("{start}G1 X\n").replace('\n', "\r")), "input", Some(3), &["expected a number"]);

    let path = folder.write("unloaded.ngc", &format!("{start}G1 X-200\n"));
    let out = folder.path("out.ngc");
    says(&refused(&["compensate", "--path", &path, "--out", &out]), "input", Some(3), &["without a load", "--wrench"]);
    let step = ["compensate", "--path", &path, "--wrench", "1,0,0,0,0,0", "--out", &out, "--step-mm", "0"];
    says(&refused(&step), "usage", None, &["--step-mm"]);
    let csv = ["compensate", "--path", &fixture("jobs/path.csv"), "--wrench", "1,0,0,0,0,0", "--out", &out];
    says(&refused(&csv), "usage", None, &["columns fx_n"]);
    let report = ["compensate", "--path", &fixture("jobs/path.csv"), "--out", &folder.path("report.html")];
    says(&refused(&report), "usage", None, &["the report goes there"]);
    let svg = ["compensate", "--path", &fixture("jobs/path.csv"), "--out", &folder.path("a.svg")];
    says(&refused(&svg), "usage", None, &["the plot goes there"]);
    let other = ["compensate", "--path", &fixture("jobs/path.csv"), "--out", &out];
    says(&refused(&other), "usage", None, &["the kind of file that --path is"]);
    let odd = ["compensate", "--path", &fixture("machines/reference.toml"), "--out", &out];
    says(&refused(&odd), "usage", None, &[".ngc"]);
    assert!(!folder.has("out.ngc"));
}

#[test]
fn a_table_without_factor_form_is_refused() {
    let folder = Folder::new();
    let mut table: Value = serde_json::from_str(&std::fs::read_to_string(folder.table()).unwrap()).unwrap();
    table["factor"] = Value::Null;
    let table = folder.write("diagonal.json", &table.to_string());
    let args = ["compensate", "--path", &fixture("jobs/path.csv"), "--table", &table, "--out", &folder.path("o.csv")];
    says(&refused(&args), "input", None, &["no factor form", "21 columns"]);
    assert!(!folder.has("o.csv"));
}

#[test]
fn without_a_load_a_path_stays_as_it_is() {
    let folder = Folder::new();
    let path =
        folder.write("idle.csv", &format!("{HEADER}\n-205,0,1137,0,0,1,0,0,0,0,0,0\n-200,0,1137,0,0,1,0,0,0,0,0,0\n"));
    let summary = json(&["compensate", "--path", &path, "--out", &folder.path("out.csv")]);
    assert_eq!(rows(&folder.read("idle.csv"), ','), rows(&folder.read("out.csv"), ','));
    assert_eq!((&summary["loaded_points"], &summary["error_before_um"]["max"]), (&0.into(), &0.0.into()));
}

#[test]
fn a_controls_program_goes_through_and_says_what_was_made_up_for() {
    let folder = Folder::new();
    let program = "O1001 (PART)\nT1 M6\nG0 X-205 Y0 Z1137 I0 J0 K1\nG1 X-204 F100\nT2 M6\nG1 X-203\nM30\n";
    let (path, out) = (folder.write("part.nc", program), folder.path("out.nc"));
    let output = run(&["compensate", "--path", &path, "--wrench", "10,0,-20.5,0,0,0", "--out", &out]);
    let warning = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && warning.contains("part.nc:6: T2 cuts with the load"), "{warning}");
    // behind the program's number, which controls look for in the first line
    let head = "O1001 (PART)\n(pkm-host compensate: machine reference, no table, part.nc, load 10 0 -20.5 0 0 0 N, N m where the program sets none)\n";
    assert!(folder.read("out.nc").starts_with(head), "{}", folder.read("out.nc"));
    let told = program.replace("T2 M6\n", "T2 M6\n(wrench 1,0,0,0,0,0)\n");
    let path = folder.write("part.nc", &told);
    assert!(run(&["compensate", "--path", &path, "--wrench", "10,0,-20.5,0,0,0", "--out", &out]).stderr.is_empty());
    let overwritten = refused(&["compensate", "--path", &path, "--wrench", "1,0,0,0,0,0", "--out", &path]);
    says(&overwritten, "usage", None, &["part.nc, which is read"]);
    assert_eq!(folder.read("part.nc"), told);
}

#[test]
fn a_wrench_that_never_acts_is_said() {
    let folder = Folder::new();
    let out = folder.path("out.ngc");
    let start = "G0 X-205 Y0 Z1137 I0 J0 K1\n";
    let warned = |rest: &str| {
        let path = folder.write("p.ngc", &format!("{start}{rest}"));
        json(&["compensate", "--path", &path, "--wrench", "10,0,-20,0,0,0", "--out", &out])["warnings"].to_string()
    };
    let own = "(wrench 1,0,-60,0,0,0)\n";
    for inert in [format!("{own}G1 X-204 F100\n"), format!("G1 X-204 F100 {own}G0 X-203\nG1 X-202\n")] {
        let said = warned(&inert);
        assert!(said.contains("p.ngc: --wrench acts on no cut: the program sets the load of each"), "{said}");
    }
    assert_eq!(warned(&format!("G1 X-204 F100\n{own}G1 X-203\n")), "[]");
    // nothing is cut: that is said, and no program is at fault
    let idle = warned("G0 X-204\n");
    assert!(idle.contains("no load anywhere") && !idle.contains("--wrench"), "{idle}");
}
