//! Stiffness data that are few, doubtful or wrong, and what `fit` says of them.

use nalgebra::{Matrix3, Matrix6, Vector3};

use crate::common::{Folder, fixture, json, reference_machine, refused, run};

/// Rows of a stiffness file: the pose's cells, and the matrix.
struct Rows(Vec<([String; 4], Matrix6<f64>)>);

impl Rows {
    /// Of the finite elements at 49 poses.
    fn of_solids() -> Self {
        Self::read(&std::fs::read_to_string(fixture("stiffness/fe-l49.csv")).unwrap())
    }

    fn read(text: &str) -> Self {
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let header: Vec<&str> = lines.next().unwrap().split(',').collect();
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let cell = |name: &str| cells[header.iter().position(|h| *h == name).unwrap()].to_owned();
            let k = |i: usize, j: usize| cell(&format!("k{}{}", i.min(j) + 1, i.max(j) + 1)).parse().unwrap();
            (["pose", "theta_deg", "sigma_deg", "z0_mm"].map(cell), Matrix6::from_fn(k))
        };
        Self(lines.map(row).collect())
    }

    /// What the reference machine with an elastic platform has at the corners, edges and faces of a grid.
    fn of_grid(folder: &Folder, theta: usize, sigma: usize, z0: usize) -> Self {
        let effect = "\n[[effect]]\nid = \"moving-platform-compliance\"\nbending_per_nm2 = 3e-6\ntorsion_per_nm2 = 3e-6\nhub_rad_per_nm = 1e-7\n\
                      [[effect]]\nid = \"telescopic-limb\"\ntube_m = 0.4\nram_m = 0.39\nguide_m_per_n = 3e-10\n";
        let machine = folder.write("soft.toml", &(reference_machine() + effect));
        let at = |low: f64, high: f64, n: usize, i: usize| low + (high - low) * i as f64 / (n - 1) as f64;
        let mut poses = "pose,theta_deg,sigma_deg,z0_mm\n".to_owned();
        for n in 0..theta * sigma * z0 {
            let (t, s, z) = (n % theta, n / theta % sigma, n / theta / sigma);
            let (t, s) = (at(-12.0, 12.0, theta, t), at(-14.0, 14.0, sigma, s));
            poses.push_str(&format!("G{n},{t},{s},{}\n", at(505.0, 555.0, z0, z)));
        }
        let (poses, out) = (folder.write("grid.csv", &poses), folder.path("grid-k.csv"));
        json(&["stiffness", "--machine", &machine, "--poses", &poses, "--out", &out]);
        Self::read(&folder.read("grid-k.csv"))
    }

    /// As a file with the couplings above the diagonal, or below it.
    fn written(&self, below: bool) -> String {
        let pairs: Vec<(usize, usize)> = (0..6).flat_map(|i| (i..6).map(move |j| (i, j))).collect();
        let name = |(i, j): &(usize, usize)| {
            if below { format!("k{}{}", j + 1, i + 1) } else { format!("k{}{}", i + 1, j + 1) }
        };
        let mut text =
            format!("pose,theta_deg,sigma_deg,z0_mm,{}\n", pairs.iter().map(name).collect::<Vec<_>>().join(","));
        for (pose, k) in &self.0 {
            let cells: Vec<String> = pairs.iter().map(|(i, j)| k[(*i, *j)].to_string()).collect();
            text.push_str(&format!("{},{}\n", pose.join(","), cells.join(",")));
        }
        text
    }

    fn map(&self, change: impl Fn(&Matrix6<f64>) -> Matrix6<f64>) -> Self {
        Self(self.0.iter().map(|(pose, k)| (pose.clone(), change(k))).collect())
    }
}

/// Warnings of a fit to some rows.
fn warnings(folder: &Folder, rows: &Rows, more: &[&str]) -> String {
    let data = folder.write("d.csv", &rows.written(false));
    json(&[&["fit", "--data", &data, "--out", &folder.path("out")], more].concat())["warnings"].to_string()
}

#[test]
fn few_poses_are_fitted_or_refused() {
    let folder = Folder::new();
    let rows = Rows::of_solids();
    let mut fitted = 0;
    for n in 9..=17 {
        for stride in [3, 5, 11] {
            let few = Rows((0..n).map(|i| rows.0[i * stride % 49].clone()).collect());
            let data = folder.write("few.csv", &few.written(false));
            let output = run(&["fit", "--data", &data, "--out", &folder.path("out")]);
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(matches!(output.status.code(), Some(0 | 2)), "{n}, {stride}: {said}");
            fitted += usize::from(output.status.success());
        }
    }
    assert!(fitted >= 3, "{fitted}");
}

#[test]
fn couplings_below_the_diagonal_are_as_good() {
    let folder = Folder::new();
    let rows = Rows::of_solids();
    let table = |below: bool| {
        let data = folder.write("k.csv", &rows.written(below));
        json(&["fit", "--data", &data, "--out", &folder.path("out")]);
        let table: serde_json::Value = serde_json::from_str(&folder.read("out/coefficients.json")).unwrap();
        table["factor"].clone()
    };
    let above = table(false);
    assert_eq!(above["coefficients"].as_array().unwrap().len(), 21);
    assert_eq!(above, table(true));
}

#[test]
fn verification_without_couplings_leaves_the_factor_form() {
    let folder = Folder::new();
    let rows = Rows::of_solids();
    let mut six = "pose,theta_deg,sigma_deg,z0_mm,k11,k22,k33,k44,k55,k66\n".to_owned();
    for (pose, k) in rows.0.iter().skip(30) {
        let cells: Vec<String> = (0..6).map(|i| k[(i, i)].to_string()).collect();
        six.push_str(&format!("{},{}\n", pose.join(","), cells.join(",")));
    }
    let six = folder.write("six.csv", &six);
    let data = folder.write("k.csv", &Rows(rows.0[..30].to_vec()).written(false));
    let output = run(&["fit", "--data", &data, "--verify", &six, "--out", &folder.path("out")]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("deflections are judged by the training poses"), "{text}");
    assert!(text.contains("no other poses have tested it") && !text.contains("no factor form"), "{text}");
}

#[test]
fn verification_poses_that_were_fitted_are_left_out_of_the_judgement() {
    let folder = Folder::new();
    let rows = Rows::of_solids();
    let data = folder.write("k.csv", &Rows(rows.0[..39].to_vec()).written(false));
    let judged = |name: &str, first: usize| {
        let others = folder.write(name, &Rows(rows.0[first..].to_vec()).written(false));
        let output =
            run(&["fit", "--data", &data, "--verify", &others, "--terms", "select", "--out", &folder.path("out")]);
        let text = String::from_utf8(output.stdout).unwrap();
        let fit: serde_json::Value = serde_json::from_str(&folder.read("out/fit.json")).unwrap();
        (text, fit["verify"].clone(), fit["warnings"].to_string())
    };
    let (_, alone, _) = judged("others.csv", 39);
    let (text, with_shared, said) = judged("shared.csv", 37);
    assert_eq!(with_shared["poses"], 10);
    assert_eq!(with_shared, alone);
    assert!(said.contains("2 of 12 verification poses are training poses too: they say nothing of others"), "{said}");
    assert!(!text.contains("no other poses have tested it"), "{text}");
    assert!(text.contains("on the 10 of 12 verification poses that had no part in the fit"), "{text}");

    let all = run(&["fit", "--data", &data, "--verify", &data, "--out", &folder.path("out")]);
    let text = String::from_utf8(all.stdout).unwrap();
    assert!(text.contains("no other poses have tested it"), "{text}");
    assert!(text.contains("on verification poses that had a part in the fit themselves"), "{text}");
}

#[test]
fn few_verification_poses_do_not_judge_a_box() {
    let folder = Folder::new();
    let rows = Rows::of_solids();
    let data = folder.write("k.csv", &Rows(rows.0[..40].to_vec()).written(false));
    let judged = |n: usize| {
        let others = folder.write("v.csv", &Rows(rows.0[40..40 + n].to_vec()).written(false));
        let output = run(&["fit", "--data", &data, "--verify", &others, "--out", &folder.path("out")]);
        (String::from_utf8(output.stdout).unwrap(), folder.read("out/report.html"))
    };
    let (text, report) = judged(1);
    assert!(!text.contains("NaN") && !report.contains("NaN"), "{text}");
    assert!(text.contains("standard deviation") && text.contains("        –"), "{text}");
    let fit: serde_json::Value = serde_json::from_str(&folder.read("out/fit.json")).unwrap();
    assert!(fit["verify"]["improved"]["re_percent"]["stdev"][0].is_null(), "{fit}");
    assert!(text.contains("verification, 1 pose ") && text.contains("on 1 pose that it was not fitted to"), "{text}");
    for (n, is_enough) in [(1, false), (3, false), (4, true)] {
        let (text, report) = judged(n);
        assert_eq!(text.contains("The table can be used"), is_enough, "{n}: {text}");
        assert_eq!(text.contains("leave a direction of its box untested"), !is_enough, "{n}: {text}");
        assert_eq!(report.contains("give at least 4 poses with --verify"), !is_enough, "{n}");
    }
}

#[test]
fn data_that_the_model_matches_are_no_alarm() {
    let folder = Folder::new();
    let poses: String = Rows::of_solids().0.iter().map(|(pose, _)| format!("{}\n", pose.join(","))).collect();
    let poses = folder.write("p.csv", &format!("pose,theta_deg,sigma_deg,z0_mm\n{poses}"));
    json(&["stiffness", "--poses", &poses, "--out", &folder.path("own.csv")]);
    let own = Rows::read(&folder.read("own.csv"));
    let judged = |rows: &Rows| {
        let data = folder.write("d.csv", &rows.written(false));
        let output = run(&["fit", "--data", &data, "--out", &folder.path("out")]);
        (String::from_utf8(output.stdout).unwrap(), folder.read("out/report.html"))
    };
    // as they are, and as a file with seven digits has them
    let rounded = own.map(|k| k.map(|v| format!("{v:.6e}").parse().unwrap()));
    for rows in [own, rounded] {
        let (text, report) = judged(&rows);
        assert!(text.contains("The data agree with the model") && text.contains("a table changes nothing"), "{text}");
        assert!(!text.contains("Don't use the table") && !report.contains("SI units"), "{text}");
        assert!(report.contains("the controller needs no table"));
    }
    let (text, _) = judged(&Rows::of_solids());
    assert!(!text.contains("The data agree"), "{text}");
}

#[test]
fn rows_that_contradict_the_others_are_named() {
    let folder = Folder::new();
    let rows = Rows::of_solids();
    assert_eq!(warnings(&folder, &rows, &[]), "[]");
    let mut wrong = Rows(rows.0.clone());
    // one pose in N/mm
    wrong.0[20].1 *= 0.1;
    let said = warnings(&folder, &wrong, &[]);
    let [pose, ..] = &wrong.0[20].0;
    assert!(
        said.contains(&format!("d.csv:22: pose `{pose}` contradicts the others: k")) && said.contains("0.1"),
        "{said}"
    );
    assert_eq!(said.matches("contradicts").count(), 1, "{said}");
    // a coupling with the wrong sign
    let mut wrong = Rows(rows.0.clone());
    let k = &mut wrong.0[5].1;
    let most = (0..6).flat_map(|i| (0..i).map(move |j| (i, j)));
    let share = |(i, j): &(usize, usize)| k[(*i, *j)].abs() / (k[(*i, *i)] * k[(*j, *j)]).sqrt();
    let (i, j) = most.max_by(|a, b| share(a).total_cmp(&share(b))).unwrap();
    (k[(i, j)], k[(j, i)]) = (-k[(i, j)], -k[(j, i)]);
    let said = warnings(&folder, &wrong, &[]);
    assert!(said.contains("d.csv:7: pose") && said.contains("contradicts the others: its coupling"), "{said}");
    // a pose that stands there twice
    let mut twice = Rows(rows.0.clone());
    let mut again = rows.0[8].clone();
    again.0[0] = "again".into();
    twice.0.push(again);
    let said = warnings(&folder, &twice, &[]);
    assert!(
        said.contains("d.csv:51: pose `again` is pose") && said.contains("of line 10 once more, and counts twice"),
        "{said}"
    );
}

#[test]
fn data_at_another_point_or_in_other_axes_are_found_out() {
    let folder = Folder::new();
    let rows = Rows::of_grid(&folder, 4, 4, 3);
    let machine = folder.path("soft.toml");
    let said = |rows: &Rows| warnings(&folder, rows, &["--machine", &machine]);
    assert!(!said(&rows).contains("follow the machine much better"));
    // A moves by what a point 250 mm along w from it does, less what the platform turns
    let mut t = Matrix6::identity();
    t.fixed_view_mut::<3, 3>(0, 3).copy_from(&Vector3::new(0.0, 0.0, 0.25).cross_matrix());
    let found = said(&rows.map(|k| t.transpose() * k * t));
    assert!(found.contains("with K at a point about 250 mm along w from A:"), "{found}");
    let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let mut r = Matrix6::zeros();
    r.fixed_view_mut::<3, 3>(0, 0).copy_from(&quarter);
    r.fixed_view_mut::<3, 3>(3, 3).copy_from(&quarter);
    let found = said(&rows.map(|k| r * k * r.transpose()));
    assert!(found.contains("with the axes u and v turned by 90° about w:"), "{found}");
}

#[test]
fn an_uncertainty_from_few_steps_of_a_grid_holds_between_them() {
    let folder = Folder::new();
    let between = folder.write("v.csv", &Rows::of_grid(&folder, 4, 5, 4).written(false));
    for (theta, sigma, z0) in [(3, 3, 3), (5, 3, 3), (4, 4, 4)] {
        for terms in ["paper", "select"] {
            let rows = Rows::of_grid(&folder, theta, sigma, z0);
            let said = warnings(&folder, &rows, &["--terms", terms, "--verify", &between]);
            // with three steps and Eq. 11's terms it holds 78 % at the poses on edges and faces that were not fitted, and says so
            let is_small = (theta, terms) == (3, "paper");
            let place = format!("{theta} x {sigma} x {z0}, {terms}: {said}");
            assert_eq!(
                said.contains("uncertainty is too small: at the verification poses it holds 78 %"),
                is_small,
                "{place}"
            );
            assert_eq!(said.contains("uncertainty is too small"), is_small, "{place}");
            assert!(folder.read("out/coefficients.json").contains("\"spread\""), "{theta} x {sigma} x {z0}, {terms}");
        }
    }
    // of another machine
    let other = folder.write("o.csv", &Rows::of_grid(&folder, 4, 5, 4).map(|k| k * 0.8).written(false));
    let said = warnings(&folder, &Rows::of_grid(&folder, 5, 5, 3), &["--verify", &other]);
    assert!(said.contains("uncertainty is too small: at the verification poses it holds"), "{said}");
}

#[test]
fn names_of_columns_with_units_are_told_how_to_be() {
    let folder = Folder::new();
    let text = Rows::of_solids().written(false).replacen("k11", "k11_n_per_mm", 1);
    let data = folder.write("k.csv", &text);
    let error = refused(&["fit", "--data", &data, "--out", &folder.path("out")]);
    assert!(error["message"].as_str().unwrap().contains("found `k11_n_per_mm`: name the columns k11, k12"), "{error}");
}

#[test]
fn unlikely_values_of_a_machine_file_are_warned_of() {
    let folder = Folder::new();
    let said = |from: &str, to: &str| {
        let text = reference_machine();
        assert!(text.contains(from), "{from}");
        let machine = folder.write("m.toml", &text.replace(from, to));
        let pose = ["--theta-deg", "0", "--sigma-deg", "0", "--z0-mm", "530"];
        json(&[&["ik", "--machine", &machine], &pose[..]].concat())["warnings"].to_string()
    };
    assert_eq!(said("shear_gpa", "shear_gpa"), "[]");
    assert!(said("= [-15.0, 15.0]", "= [-0.26, 0.26]").contains("box: its angles are below 0.6"));
    assert!(said("shear_gpa = 79.23", "shear_gpa = 206.0").contains("shear_gpa: 206: of no solid with this young_gpa"));
}
