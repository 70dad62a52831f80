//! `fem`: what needs no CalculiX with a stand-in for it, and (ignored unless asked for) a cluster's job with both.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

use crate::common::{Folder, fixture, json, numbers, reference_machine, refused, run};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::source::Source;
use serde_json::Value;

/// Two poses of the reference machine.
const POSES: &str = "pose,theta_deg,sigma_deg,z0_mm\np 1,0,0,530\np2,5,-3,520\n";

/// Compliance that the stand-in prints, by rows: m/N along, rad/(N·m) about, and one coupling.
fn compliance() -> [[f64; 6]; 6] {
    let mut c = [[0.0; 6]; 6];
    for (i, row) in c.iter_mut().enumerate() {
        row[i] = [1e-8, 2e-8, 4e-9, 1e-6, 2e-6, 3e-6][i];
    }
    c[0][4] = 5e-8;
    c[4][0] = 5e-8;
    c
}

/// A program that answers like `ccx`, but only to decks without the text `refused`; where θ is 5° all is twice as soft. Every run
/// leaves a line in a file.
fn stand_in(folder: &Folder, refused: &str) -> String {
    let printed = |times: f64| {
        let columns = compliance().map(|column| column.map(|c| times * c));
        let threes = columns.iter().flat_map(|c| [&c[..3], &c[3..]]);
        threes.map(|c| format!("  17 {:e} {:e} {:e}\n", c[0], c[1], c[2])).collect::<String>()
    };
    let script = format!(
        "#!/bin/sh\nif [ \"$1\" = -v ]; then echo 'This is Version 0.0'; exit; fi\n\
         if grep -q '{refused}' case.inp; then echo ' *ERROR in something: too bad'; exit 201; fi\n\
         echo run >>{}\nif grep -q 'theta 5 ' case.inp; then cat >case.dat <<END\n{}END\nelse cat >case.dat <<END\n{}END\nfi\n",
        folder.path("runs"),
        printed(2.0),
        printed(1.0)
    );
    let path = folder.write("ccx", &script);
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

fn runs(folder: &Folder) -> usize {
    if folder.has("runs") { folder.read("runs").lines().count() } else { 0 }
}

#[test]
fn stiffness_is_the_inverse_of_what_was_printed_and_the_work_goes_away() {
    let folder = Folder::new();
    let (ccx, poses, out) = (stand_in(&folder, "never"), folder.write("p.csv", POSES), folder.path("k.csv"));
    let document = json(&["fem", "--poses", &poses, "--out", &out, "--ccx", &ccx, "--mesh", "3"]);
    assert_eq!((document["poses"].as_u64(), document["computed"].as_u64(), runs(&folder)), (Some(2), Some(2), 2));
    let text = folder.read("k.csv");
    let rows: Vec<Vec<&str>> =
        text.lines().filter(|l| !l.starts_with('#')).map(|l| l.split(',').collect::<Vec<_>>()).collect();
    assert_eq!((rows[0][4], rows[0][8], rows.len(), &rows[2][..4]), ("k11", "k15", 3, &["p2", "5", "-3", "520"][..]));
    let (determinant, k) = (1e-8 * 2e-6 - 5e-8 * 5e-8, |n: usize| rows[1][n].parse::<f64>().unwrap());
    for (column, expected) in [(4, 2e-6 / determinant), (8, -5e-8 / determinant), (10, 1.0 / 2e-8), (24, 1.0 / 3e-6)] {
        assert!((k(column) / expected - 1.0).abs() < 1e-6, "{}: {}", rows[0][column], k(column));
    }
    let manifest: Value = serde_json::from_str(&folder.read("k.manifest.json")).unwrap();
    assert_eq!(manifest["solver"], "CalculiX 0.0");
    assert_eq!(manifest["poses"].as_array().map(Vec::len), Some(2));
    assert!(folder.read("k.html").contains("<svg") && !folder.has("k.work"));
    // what it writes is what other commands read
    json(&["stiffness", "--poses", &out]);

    let again = folder.path("again.csv");
    json(&["fem", "--poses", &poses, "--out", &again, "--ccx", &ccx, "--mesh", "3", "--jobs", "1", "--keep"]);
    assert_eq!(folder.read("again.csv"), text);
    assert_eq!(folder.read("again.manifest.json"), folder.read("k.manifest.json"));
    assert!(folder.contents().iter().any(|(path, _)| path.ends_with("case.inp")), "kept");
}

#[test]
fn a_run_that_failed_goes_on_where_it_stopped() {
    let folder = Folder::new();
    let (poses, out) = (folder.write("p.csv", POSES), folder.path("k.csv"));
    let arguments = |ccx: &str| -> Vec<String> {
        let options = ["fem", "--poses", &poses, "--out", &out, "--mesh", "3", "--jobs", "1", "--ccx", ccx];
        options.map(str::to_owned).to_vec()
    };
    let call = |ccx: &str| {
        let arguments = arguments(ccx);
        let output = run(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, message) = call(&folder.path("nothing"));
    assert_eq!(code, Some(1));
    assert!(message.contains("apt-get install calculix-ccx") && message.contains("--ccx"), "{message}");
    assert!(!folder.has("k.csv") && !folder.has("k.work"));

    // the second pose fails
    let (code, message) = call(&stand_in(&folder, "theta 5"));
    assert_eq!(code, Some(1));
    assert!(message.contains("*ERROR in something: too bad") && message.contains("ccx.log"), "{message}");
    assert!(message.contains("the same command goes on from there"), "{message}");
    assert!(!folder.has("k.csv") && folder.has("k.work"));
    assert_eq!(runs(&folder), 1);

    let (code, message) = call(&stand_in(&folder, "never"));
    assert_eq!(code, Some(0), "{message}");
    assert_eq!(runs(&folder), 2, "the first pose was not computed again");
    assert!(folder.has("k.csv") && !folder.has("k.work"));
}

#[test]
fn what_others_left_in_the_folder_stays() {
    let folder = Folder::new();
    // ids that are alike as names of folders
    let poses = folder.write("p.csv", "pose,theta_deg,sigma_deg,z0_mm\na b,0,0,530\na_b,0,0,530\n-1,0,0,530\n");
    let (ccx, out) = (stand_in(&folder, "never"), folder.path("k.csv"));
    fs::create_dir_all(folder.path("k.work/running-old")).unwrap();
    folder.write("k.work/thesis.txt", "precious");
    let call = ["fem", "--poses", &poses, "--out", &out, "--ccx", &ccx, "--mesh", "3"];
    json(&[&call[..], &["--keep"]].concat());
    json(&call);
    assert_eq!(runs(&folder), 3, "each pose once, and taken over from there");
    assert_eq!(folder.read("k.work/thesis.txt"), "precious");
    assert!(!folder.has("k.work/running-old"), "of a run that was killed");
    assert!(folder.contents().iter().filter(|(path, _)| path.ends_with("case.inp")).count() == 3, "kept before");

    let lock = fs::File::create(folder.path("k.work/lock")).unwrap();
    lock.lock().unwrap();
    let output = run(&call);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8(output.stderr).unwrap().contains("another run works in this folder"));
    drop(lock);

    for (option, path) in [("--out", folder.path("k.html")), ("--out", poses.clone()), ("--readings", out.clone())] {
        let call = if option == "--out" {
            [&call[..3], &["--out", &path]].concat()
        } else {
            [&call[..5], &[option, &path]].concat()
        };
        let message = refused(&call)["message"].as_str().unwrap().to_owned();
        let expected = if path == poses { "would overwrite" } else { "have this name" };
        assert!(message.contains(expected), "{message}");
    }
    let output = run(&[&call[..], &["--readings", "/proc/nothing/r.csv"]].concat());
    assert_eq!((output.status.code(), runs(&folder)), (Some(1), 3), "told before anything is computed");
}

#[test]
fn a_cluster_job_gives_what_a_run_gives() {
    let folder = Folder::new();
    let (ccx, poses) = (stand_in(&folder, "never"), folder.write("p.csv", POSES));
    let (out, direct, work) = (folder.path("k.csv"), folder.path("direct.csv"), folder.path("cases"));
    let common = ["fem", "--poses", &poses, "--ccx", &ccx, "--mesh", "3"];
    json(&[&common[..], &["--out", &direct]].concat());

    let on_cluster = [&common[..], &["--out", &out, "--work", &work]].concat();
    let document = json(&[&on_cluster[..], &["--emit", "slurm"]].concat());
    assert_eq!((document["tasks"].as_u64(), runs(&folder)), (Some(2), 2));
    let collect = [&on_cluster[..], &["--collect"]].concat();
    let output = run(&collect);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8(output.stderr).unwrap().contains("2 of 2 poses have no whole result"));
    for (task, expected) in [("1", 3), ("2", 4), ("2", 4)] {
        let mut script = Command::new("bash");
        script.arg("run.sbatch").current_dir(&work).env("SLURM_ARRAY_TASK_ID", task).env("CCX", &ccx);
        assert!(script.env_remove("SLURM_SUBMIT_DIR").status().unwrap().success());
        assert_eq!(runs(&folder), expected, "task {task}");
    }
    json(&collect);
    assert_eq!(folder.read("k.csv"), folder.read("direct.csv"));
}

#[test]
fn readings_are_the_solids_deflections_with_the_noise_that_was_asked_for() {
    let folder = Folder::new();
    let (ccx, poses) = (stand_in(&folder, "never"), folder.write("p.csv", POSES));
    let (out, readings) = (folder.path("k.csv"), folder.path("d.csv"));
    let fem = |more: &[&str]| {
        json(&[&["fem", "--out", &out, "--ccx", &ccx, "--mesh", "3", "--readings", &readings], more].concat());
        folder.read("d.csv").lines().filter(|l| !l.starts_with('#')).map(str::to_owned).collect::<Vec<_>>()
    };
    let loads = "pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,point_u_mm,point_v_mm,point_w_mm,dx_um,ry_urad\n\
                 a,0,0,530,100,0,0,0,0,0,0,0,100,,\n";
    let rows = fem(&["--loads", &folder.write("l.csv", loads), "--noise", "0,0", "--zero", "0,0"]);
    let cells: Vec<f64> = rows[1].split(',').skip(1).take(14).map(|c| c.parse().unwrap()).collect();
    // a force of 100 N beyond A turns by 10 N·m as well, and what turns moves the point
    let c = compliance();
    let (dx, ry) = (c[0][0] * 100.0 + c[0][4] * 10.0, c[4][0] * 100.0 + c[4][4] * 10.0);
    assert!((cells[12] - (dx + 0.1 * ry) * 1e6).abs() < 1e-3, "{rows:?}");
    assert!((cells[13] - ry * 1e6).abs() < 1e-3, "{rows:?}");
    assert!(rows[0].ends_with("dx_um,ry_urad,sigma_linear_um,sigma_angular_urad"), "only what was asked for");

    let usual = ["--poses", &poses, "--repeats", "30", "--noise", "0.3,0.5", "--zero", "0.4,0", "--seed", "7"];
    let rows = fem(&usual);
    assert_eq!(rows.len(), 1 + 2 * 30 * 12 * 3);
    assert_eq!(rows, fem(&usual), "repeatable");
    let column = |name: &str| rows[0].split(',').position(|c| c == name).unwrap();
    let value = |row: &str, name: &str| row.split(',').nth(column(name)).unwrap().parse::<f64>().unwrap();
    // along z nothing couples: the error of three readings of a series
    let errors: Vec<[f64; 3]> = rows[1..]
        .chunks(3)
        .map(|s| {
            let soft = if s[0].starts_with("p2") { 2.0 } else { 1.0 };
            std::array::from_fn(|i| value(&s[i], "dz_um") - soft * 4e-3 * value(&s[i], "fz_n"))
        })
        .collect();
    let n = errors.len() as f64;
    let within = errors.iter().map(|[a, b, _]| (a - b).powi(2) / 2.0).sum::<f64>() / n;
    let shared = errors.iter().map(|[a, b, _]| a * b).sum::<f64>() / n;
    assert!((within / 0.09 - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{within}");
    assert!((shared / 0.16 - 1.0).abs() < 5.0 * (4.0 / n).sqrt(), "{shared}");
    assert_eq!(value(&rows[1], "sigma_linear_um"), 0.5);
    assert!(rows.iter().filter(|r| r.ends_with(",unload") || r.contains(",unload,")).count() == 2 * 30 * 12);
}

#[test]
fn readings_are_of_their_own_pose_though_another_stands_twice() {
    let folder = Folder::new();
    let text = "pose,theta_deg,sigma_deg,z0_mm\na,0,0,530\nb,0,0,530\nc,5,-3,520\n";
    let (ccx, poses) = (stand_in(&folder, "never"), folder.write("p.csv", text));
    let (out, readings) = (folder.path("k.csv"), folder.path("d.csv"));
    let call = ["fem", "--poses", &poses, "--out", &out, "--ccx", &ccx, "--mesh", "3", "--readings", &readings];
    json(&[&call[..], &["--noise", "0,0", "--zero", "0,0", "--repeats", "1"]].concat());
    let written = folder.read("d.csv");
    for (id, soft) in [("a", 1.0), ("b", 1.0), ("c", 2.0)] {
        let row = written.lines().find(|l| l.starts_with(&format!("{id},")) && l.contains(",0,0,500,0,0,0,")).unwrap();
        let dz_um: f64 = row.split(',').nth(15).unwrap().parse().unwrap();
        assert!((dz_um - soft * 4e-9 * 500.0 * 1e6).abs() < 1e-3, "{row}");
    }
}

#[test]
fn every_machine_is_drawn_without_computing() {
    for machine in ["machines/reference.toml", "machines/x150.toml"] {
        let (folder, machine) = (Folder::new(), fixture(machine));
        let (poses, out) = (folder.path("p.csv"), folder.path("k.csv"));
        json(&["plan", "--kind", "levels", "4", "--machine", &machine, "--out", &poses]);
        let document = json(&["fem", "--machine", &machine, "--poses", &poses, "--out", &out, "--dry-run"]);
        assert!(document["nodes"].as_u64().unwrap() > 5000, "{document}");
        assert!(folder.read("k.drawing.html").contains("<svg") && !folder.has("k.csv") && !folder.has("k.work"));
    }
}

#[test]
fn a_section_that_says_all_of_it_is_the_same_machine() {
    for set in ["", "limb = \"uniform\"\nplatform = { kind = \"rigid\" }\n", "tube = { behind_mm = [1.5, 0.0, 2.0] }\n"]
    {
        let reference = reference_machine();
        let (head, rest) = reference.split_once("[solid]").unwrap();
        assert!(!rest.contains("[[limb]]"), "the section is the last");
        let parse = |solid: &str| {
            let text = format!("{head}{solid}");
            MachineFile::parse(Source::from_text("m.toml", text)).unwrap().solid.unwrap()
        };
        let solid = parse(&format!("[solid]\n{set}"));
        assert_eq!(parse(&solid.toml()).toml(), solid.toml());
    }
}

#[test]
fn the_screws_bore_reaches_the_solid() {
    let text = reference_machine().replace("outer_mm = 32.0, inner_mm = 0.0", "outer_mm = 32.0, inner_mm = 25.0");
    let solid = MachineFile::parse(Source::from_text("m.toml", text)).unwrap().solid.unwrap();
    let screw = "[solid.screw]\nouter_mm = [32, 32, 32]\ninner_mm = [25, 25, 25]\n";
    assert!(solid.toml().contains(screw), "{}", solid.toml());
}

#[test]
fn what_does_not_fit_is_refused_before_anything_is_computed() {
    let folder = Folder::new();
    let (ccx, poses, out) = (stand_in(&folder, "never"), folder.write("p.csv", POSES), folder.path("k.csv"));
    let call = |set: &str| {
        let set = set.split(';').flat_map(|s| ["--set", s]);
        let arguments: Vec<&str> =
            ["fem", "--poses", &poses, "--out", &out, "--ccx", &ccx].into_iter().chain(set).collect();
        let failure = refused(&arguments);
        failure["message"].as_str().unwrap().to_owned()
    };
    for (set, expected) in [
        // at these poses
        (
            "solid.ram.length_mm=[560,560,560];solid.tube.behind_mm=[0,0,0]",
            "the ram's inner end meets the tube's rear end",
        ),
        ("solid.tube.length_mm=[600,600,600]", "the tube's mouth is at the platform joint"),
        ("solid.tube.outer_mm=[400,400,400]", "limbs 1 and 2 meet"),
        ("solid.base.thickness_mm=900", "limb 1 goes through the base"),
        // at any
        ("solid.ram.length_mm=[300,300,300]", "tube and ram long enough together"),
        ("solid.screw.inner_mm=[32,0,0]", "a bore below the screw's outer_mm"),
        ("solid.ram.outer_mm=[82,82,82]", "a bore below the tube's outer_mm"),
        ("solid.tube.inner_mm=[50,50,50]", "a bore that ram and screw fit in"),
        ("solid.platform.hub_mm=400", "bores too near"),
        ("solid.platform.poisson=0.5", "expected a number from -0.99 to below 0.5, found 0.5"),
        ("solid.platform.thickness_mm=0", "expected a number above 0, found 0"),
        ("solid.nut.axial_n_per_m=[1e8,1e8,-1]", "expected a number above 0, found -1"),
        ("solid.nut.axial_n_per_m=[1e8,1e8]", "expected 3 numbers"),
        ("solid.nut.axial_n_per_m=1e8", "solid.nut.axial_n_per_m"),
        ("solid.platform.kind=soft", "elastic"),
        ("solid.platform=3", "a table"),
        ("solid.platform.rim_mm=0.2", "a rim of at least a twentieth of the widest bore"),
        ("solid.platform.thickness_mm=0.01", "takes too many elements"),
        ("solid.screw.outer_mm=[64,64,64];solid.tube.inner_mm=[63,63,63]", "a bore that ram and screw fit in"),
        ("solid.nose_mm=1", "nose_mm"),
        ("limb.2.body.rod.shear_gpa=60", "Poisson's ratio would be"),
        ("limb.4.body.rod.shear_gpa=60", "there is no limb.4"),
        ("limb.2", "expected key.key=value"),
        ("name.x=3", "name is a value"),
        ("solid.base.rim_mm=8 mm", "expected a number, a word or an array"),
        ("solid.platform.young_gpa=nan", "expected a number above 0, found NaN"),
    ] {
        let message = call(set);
        assert!(message.contains(expected), "{set}: {message}");
    }
    assert_eq!(runs(&folder), 0);
    assert!(!folder.has("k.csv") && !folder.has("k.html") && !folder.has("k.work"));
    let doubled = folder.write("doubled.csv", "pose,theta_deg,sigma_deg,z0_mm\na,0,0,530\na,1,0,530\n");
    let message = refused(&["fem", "--poses", &doubled, "--out", &out])["message"].as_str().unwrap().to_owned();
    assert!(message.contains("duplicate"), "{message}");
}

#[test]
#[ignore = "needs CalculiX and Slurm: .ci/slurm-node"]
fn slurm_computes_what_a_run_computes() {
    let folder = Folder::new();
    let (poses, work) = (folder.write("p.csv", POSES), folder.path("cases"));
    let (direct, gathered) = (folder.path("direct.csv"), folder.path("gathered.csv"));
    let common = ["fem", "--poses", &poses, "--mesh", "3", "--work", &work];
    json(&[&common[..], &["--out", &gathered, "--emit", "slurm"]].concat());
    let job = Command::new("sbatch").args(["--wait", "run.sbatch"]).current_dir(&work).status().unwrap();
    assert!(job.success());
    let document = json(&[&common[..], &["--out", &gathered, "--collect"]].concat());
    assert_eq!(document["computed"], 0);
    assert!(numbers::<6>(&document["basic_model"]["re_percent"]["mean"]).iter().all(|e| *e > 1.0));
    json(&["fem", "--poses", &poses, "--mesh", "3", "--out", &direct]);
    assert_eq!(folder.read("gathered.csv"), folder.read("direct.csv"));
}
