//! What is written is read back as it was, and the order of rows is no information: over random machines and tables.

use fastrand::Rng;
use pkm_core::Machine;
use pkm_core::machine::{BodyKind, Joint, MachineParameters, Tube};
use pkm_host::diagnose::{self, Method, Rules};
use pkm_host::files::dataset::{POSE_COLUMNS, read_stiffness, stiffness_columns, to_csv};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::readings::Readings;
use pkm_host::files::source::Source;
use pkm_host::files::table::{DiagonalForm, FactorForm, TableFile};
use pkm_host::files::table_numbers::{TableNumbers, UncertaintyNumbers};
use pkm_host::fit::{self, TermChoice};
use pkm_host::pose::PoseBox;
use pkm_host::progress::silent;
use pkm_tests::{random_parameters, random_pose, seeded};

fn reference() -> MachineFile {
    MachineFile::parse(Source::embedded(pkm_fixtures::MACHINE)).expect("good")
}

/// A machine file with these parameters.
fn machine_toml(p: &MachineParameters, z0_m: f64) -> String {
    let mm = |m: f64| m * 1e3;
    let joint = |j: &Joint| {
        format!("{{ linear_n_per_m = {:?}, angular_nm_per_rad = {:?} }}", j.linear_n_per_m, j.angular_nm_per_rad)
    };
    let tube = |t: &Tube| {
        let (young, shear) = (t.young_pa / 1e9, t.shear_pa / 1e9);
        let (outer, inner) = (mm(t.outer_m), mm(t.inner_m));
        format!("{{ young_gpa = {young:?}, shear_gpa = {shear:?}, outer_mm = {outer:?}, inner_mm = {inner:?} }}")
    };
    let g = [p.geometry.a1_m, p.geometry.a2_m, p.geometry.b1_m, p.geometry.b2_m].map(mm);
    let mut text = format!(
        "format = 1\nname = \"random\"\n[geometry]\na1_mm = {:?}\na2_mm = {:?}\nb1_mm = {:?}\nb2_mm = {:?}\n[travel]\n\
         min_mm = {:?}\nmax_mm = {:?}\n[box]\ntheta_deg = [-1.0, 1.0]\nsigma_deg = [-1.0, 1.0]\nz0_mm = [{:?}, {:?}]\n",
        g[0],
        g[1],
        g[2],
        g[3],
        p.travel.min_m.map(mm),
        p.travel.max_m.map(mm),
        mm(0.9 * z0_m),
        mm(1.1 * z0_m),
    );
    for limb in &p.limbs {
        let kind = if limb.body.kind == BodyKind::Beam { "beam" } else { "diagonal" };
        text.push_str(&format!(
            "[[limb]]\nbase_joint = {}\nplatform_joint = {}\nbody = {{ kind = \"{kind}\", rod = {}, screw = {} }}\n",
            joint(&limb.base_joint),
            joint(&limb.platform_joint),
            tube(&limb.body.rod),
            tube(&limb.body.screw)
        ));
    }
    text
}

#[test]
fn machine_files_hold_the_machine() {
    let mut rng = seeded();
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-15 * b.abs();
    for n in 0..300 {
        let kind = if n % 2 == 0 { BodyKind::Beam } else { BodyKind::Diagonal };
        let p = random_parameters(&mut rng, kind);
        let machine = Machine::<f64>::new(&p).expect("good");
        let pose = random_pose(&mut rng, &machine, p.geometry.a1_m + p.geometry.b1_m, 0.2);
        let text = machine_toml(&p, pose.z0_m);
        let read =
            MachineFile::parse(Source::from_text("m.toml", text.clone())).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let k = read.machine.stiffness(&pose).expect("in reach").matrix();
        let expected = machine.stiffness(&pose).expect("in reach").matrix();
        assert!(pkm_tests::scaled_difference(&k, &expected) <= 1e-12, "{text}");
        for (a, b) in read.parameters.limbs.iter().zip(&p.limbs) {
            assert_eq!((a.base_joint, a.platform_joint), (b.base_joint, b.platform_joint));
            assert!(
                close(a.body.rod.outer_m, b.body.rod.outer_m) && close(a.body.screw.young_pa, b.body.screw.young_pa)
            );
        }
    }
}

#[test]
fn tables_keep_their_bits() {
    let mut rng = seeded();
    for _ in 0..300 {
        let any = |rng: &mut Rng| (rng.f64() - 0.5) * 10_f64.powi(-rng.i32(1..20));
        let mut terms = vec![[0, 0, 0]];
        for i in 1..rng.u8(2..8) {
            terms.push([i % 3, i / 3, rng.u8(0..3)]);
        }
        let mut row = |constant: f64| -> Vec<f64> {
            terms
                .iter()
                .enumerate()
                .map(|(n, _)| if n == 0 { constant + 0.1 * rng.f64() } else { 0.05 * any(&mut rng) })
                .collect()
        };
        let diagonal: Vec<Vec<f64>> = (0..6).map(|_| row(0.9)).collect();
        let factor = (0..6).flat_map(|i| (0..=i).map(move |j| f64::from(u8::from(i == j)))).map(&mut row).collect();
        let center = [any(&mut rng), any(&mut rng), 530.0 + any(&mut rng)];
        let scale = [15.0 + any(&mut rng), 15.0 + any(&mut rng), 30.0 + any(&mut rng)];
        let range = |i: usize| [center[i] - scale[i], center[i] + scale[i]];
        let table = TableFile {
            format: 1,
            machine: "random".into(),
            machine_sha256: "0".repeat(64),
            data: "k.csv".into(),
            data_sha256: "0".repeat(64),
            extent: PoseBox { theta_deg: range(0), sigma_deg: range(1), z0_mm: range(2) },
            center,
            scale,
            terms: terms.clone(),
            diagonal: DiagonalForm { coefficients: diagonal, paper_e: [[any(&mut rng); 9]; 6] },
            factor: Some(FactorForm { coefficients: factor }),
            uncertainty: Some(UncertaintyNumbers {
                spread: std::array::from_fn(|_| any(&mut rng).abs()),
                rest: any(&mut rng).abs(),
                columns: std::array::from_fn(|_| std::array::from_fn(|_| any(&mut rng))),
            }),
        };
        let text = table.to_json();
        let read =
            TableFile::parse(&Source::from_text("t.json", text.clone())).unwrap_or_else(|e| panic!("{e}\n{text}"));
        // no number is NaN, so that what is shown is the same when all bits are
        assert_eq!(format!("{read:?}"), format!("{table:?}"));
    }
}

#[test]
fn sheets_keep_their_bits() {
    let mut rng = seeded();
    let mut header: Vec<String> = POSE_COLUMNS.map(str::to_owned).to_vec();
    header.extend(stiffness_columns().map(|(_, _, name)| name));
    let file = reference();
    let mut written = Vec::new();
    let mut rows = Vec::new();
    for n in 0..300 {
        let p = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&p).expect("good");
        let pose = random_pose(&mut rng, &machine, p.geometry.a1_m + p.geometry.b1_m, 0.2);
        let k = machine.stiffness(&pose).expect("in reach");
        let mut row = vec![["a \"quoted\", name", "#", "ü"][n % 3].to_owned() + &n.to_string()];
        row.extend([rng.f64().to_string(), (-rng.f64()).to_string(), "530.5".into()]);
        row.extend(stiffness_columns().map(|(i, j, _)| k.matrix()[(i, j)].to_string()));
        written.push((row[0].clone(), k.matrix()));
        rows.push(row);
    }
    for delimiter in [b',', b';'] {
        let text = to_csv(delimiter, &header, &rows);
        let read = read_stiffness(Source::from_text("k.csv", text), &file).expect("good");
        let found: Vec<_> = read.poses.iter().zip(&read.targets).collect();
        for ((pose, target), (id, k)) in found.into_iter().zip(&written) {
            assert_eq!((&pose.id, target.full.expect("whole").matrix()), (id, *k));
        }
    }
}

#[test]
fn the_order_of_poses_is_nothing_to_a_fit() {
    let mut rng = seeded();
    let file = reference();
    let text = Source::embedded(pkm_fixtures::TRAINING).text().expect("text").to_owned();
    let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
    let fitted = |lines: &[&str]| {
        let data = read_stiffness(Source::from_text("k.csv", lines.join("\n")), &file).expect("good");
        let samples = fit::samples(&file.machine, data).expect("in reach");
        fit::fit(samples, None, TermChoice::Full).expect("fitted").numbers
    };
    let expected = fitted(&lines);
    for _ in 0..5 {
        let mut rows = lines[1..].to_vec();
        rng.shuffle(&mut rows);
        let found = fitted(&[&lines[..1], &rows].concat());
        let all = |n: &TableNumbers| [&n.diagonal[..], n.factor.as_deref().expect("whole")].concat();
        let worst = all(&found).iter().zip(all(&expected)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst <= 1e-9 && found.centre == expected.centre, "{worst:e}");
    }
}

/// Series by series, since the order within one is the history of the load.
#[test]
fn the_order_of_series_is_nothing_to_a_diagnosis() {
    let mut rng = seeded();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures/measured/p05/");
    let read = |name: &str| std::fs::read_to_string(format!("{folder}{name}")).expect("a fixture");
    let file = MachineFile::parse(Source::from_text("machine.toml", read("machine.toml"))).expect("good");
    let text = read("measured.csv");
    let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
    let diagnosed = |lines: &[&str]| {
        let readings = Readings::read(Source::from_text("d.csv", lines.join("\n")), &file).expect("good");
        diagnose::diagnose(&file, &readings, None, Method::Formulas, &Rules::DEFAULT, &silent)
            .expect("diagnosed")
            .to_json()
    };
    let expected = diagnosed(&lines);
    let column = lines[0].split(',').position(|name| name == "series").expect("there");
    let mut series: Vec<&[&str]> =
        lines[1..].chunk_by(|a, b| a.split(',').nth(column) == b.split(',').nth(column)).collect();
    assert!(series.len() > 10, "{}", series.len());
    rng.shuffle(&mut series);
    let found = diagnosed(&[&lines[..1], &series.concat()].concat());
    let ids = |d: &serde_json::Value| -> Vec<String> {
        d["effects"].as_array().expect("effects").iter().map(|e| e["id"].to_string()).collect()
    };
    assert_eq!((&found["verdict"], ids(&found)), (&expected["verdict"], ids(&expected)));
    for (a, b) in found["effects"].as_array().unwrap().iter().zip(expected["effects"].as_array().unwrap()) {
        for (name, of_b) in b["parameters"].as_object().expect("parameters") {
            let [a, b] = [&a["parameters"][name]["value"], &of_b["value"]].map(|v| v.as_f64().expect("a number"));
            assert!((a - b).abs() <= 1e-4 * b.abs(), "{name}: {a} {b}");
        }
    }
}
