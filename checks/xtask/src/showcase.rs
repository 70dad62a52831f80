//! The solids of fixtures/stiffness as readings without noise: what the paper's basic model lacks of them.

use std::fmt::Write;
use std::path::Path;

use pkm_core::{Deflection, Machine, Pose, Stiffness, Wrench};
use pkm_host::cli;
use pkm_host::diagnose::compare::{self, Zone};
use pkm_host::diagnose::{self, Method, Rules};
use pkm_host::files::dataset::{self, StiffnessData};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::readings::Readings;
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use pkm_host::pose::{ROTATION_ARM_M, written_units};
use pkm_host::progress::silent;

use crate::{Outcome, fit_fixtures, root};

const FORCE_N: f64 = 1000.0;
const MOMENT_NM: f64 = 100.0;

fn loads() -> [Wrench<f64>; 6] {
    std::array::from_fn(|axis| {
        let mut load = [0.0; 6];
        load[axis] = if axis < 3 { FORCE_N } else { MOMENT_NM };
        Wrench::from_vector(load.into())
    })
}

fn deflection(k: &Stiffness<f64>, load: &Wrench<f64>) -> Result<Deflection<f64>, String> {
    k.factor().and_then(|f| f.deflection(load)).map_err(|e| e.to_string())
}

/// Deflections under six loads at every pose, as a measured file with declared deviations of 1.5 µm and 5 µrad.
fn readings(data: &StiffnessData) -> Result<String, String> {
    let mut text = "pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,dx_um,dy_um,dz_um,rx_urad,ry_urad,\
                    rz_urad,sigma_linear_um,sigma_angular_urad\n"
        .to_owned();
    for (p, target) in data.poses.iter().zip(&data.targets) {
        let k = target.full.ok_or("the solids' stiffness is whole")?;
        for load in loads() {
            let d = deflection(&k, &load)?;
            let pose = written_units(&p.pose);
            let (load, d) = (load.to_vector(), d.to_vector() * 1e6);
            let numbers = pose.iter().chain(&load).map(|v| v.to_string());
            let cells: Vec<String> = numbers.chain(d.iter().map(|v| format!("{v:.4}"))).collect();
            let _ = writeln!(text, "{},{},1.5,5", p.id, cells.join(","));
        }
    }
    Ok(text)
}

/// Gives the stiffness at a pose.
type Law<'a> = &'a dyn Fn(&Pose<f64>) -> Result<Stiffness<f64>, String>;

/// Mean error of the deflection under each load at some poses, %: relative norm with rotations times 0.2 m.
fn errors(law: Law<'_>, data: &StiffnessData, at: &[usize]) -> Result<[f64; 6], String> {
    let norm = |d: &Deflection<f64>, e: &Deflection<f64>| {
        let (moved, turned) = (d.translation_m - e.translation_m, (d.rotation_rad - e.rotation_rad) * ROTATION_ARM_M);
        (moved.norm_squared() + turned.norm_squared()).sqrt()
    };
    let mut sums = [0.0; 6];
    for n in at {
        let (model, truth) =
            (law(&data.poses[*n].pose)?, data.targets[*n].full.ok_or("the solids' stiffness is whole")?);
        for (sum, load) in sums.iter_mut().zip(loads()) {
            let (a, b) = (deflection(&model, &load)?, deflection(&truth, &load)?);
            *sum += 100.0 * norm(&a, &b) / norm(&b, &Deflection::ZERO) / at.len() as f64;
        }
    }
    Ok(sums)
}

pub fn run() -> Outcome {
    let fail = |e: pkm_host::error::Failure| e.to_string();
    let declared = MachineFile::parse(Source::embedded(pkm_fixtures::MACHINE)).map_err(fail)?;
    let read = |source: Source| dataset::read_stiffness(source, &declared).map_err(fail);
    let (training, verification) =
        (read(Source::embedded(pkm_fixtures::TRAINING))?, read(Source::embedded(pkm_fixtures::VERIFICATION))?);
    let out = root().join("out/showcase");
    std::fs::create_dir_all(&out).map_err(|e| e.to_string())?;
    let write = |name: &str, text: String| std::fs::write(out.join(name), text).map_err(|e| e.to_string());
    write("measured.csv", readings(&training)?)?;
    write("heldout.csv", readings(&verification)?)?;
    let (data, held_out) = (out.join("measured.csv"), out.join("heldout.csv"));
    let said = cli::run([
        "diagnose".as_ref(),
        "--data".as_ref(),
        data.as_os_str(),
        "--holdout".as_ref(),
        held_out.as_os_str(),
        "--out".as_ref(),
        out.as_os_str(),
    ]);
    print!("{}", said.map_err(fail)?.text);

    // once more for what was found one after another, then a factor table of the solids on the machine that came out
    let load = |path: &Path| Source::read(path).and_then(|s| Readings::read(s, &declared)).map_err(fail);
    let (data, held_out) = (load(&data)?, load(&held_out)?);
    let diagnosis = diagnose::diagnose(&declared, &data, Some(&held_out), Method::Formulas, &Rules::DEFAULT, &silent)
        .map_err(fail)?;
    let improved = out.join("machine.toml");
    fit_fixtures(Some(&improved), &out.join("fit"))?;
    let table = Source::read(&out.join("fit/coefficients.json")).and_then(|s| TableFile::parse(&s)).map_err(fail)?;
    let numbers = table.numbers();
    let table = numbers.table().map_err(fail)?;
    let improved = Source::read(&improved).and_then(MachineFile::parse).map_err(fail)?.machine;

    let mut machines = vec![("as declared".to_owned(), declared.machine)];
    for step in &diagnosis.steps {
        let machine = Machine::<f64>::new(&step.machine).map_err(|e| e.to_string())?;
        machines.push((format!("+ {}", step.found.last().map_or("", String::as_str)), machine));
    }
    let zones = compare::zones(&data, &held_out);
    let in_zone = |zone: Zone| -> Vec<usize> {
        // six loads a pose
        (0..verification.poses.len()).filter(|n| zones[6 * n] == zone).collect()
    };
    let groups = [
        ("poses read", &training, (0..training.poses.len()).collect()),
        ("other poses, inside", &verification, in_zone(Zone::Inside)),
        ("other poses, at the edge", &verification, in_zone(Zone::Edge)),
        ("other poses, beyond", &verification, in_zone(Zone::Beyond)),
    ];
    println!("mean deflection error in % under Fx Fy Fz Mx My Mz");
    for (group, data, at) in groups.iter().filter(|g| !g.2.is_empty()) {
        println!("{} {group}", at.len());
        let show = |name: &str, law: Law<'_>| -> Outcome {
            let shown = errors(law, data, at)?.map(|e| format!("{e:7.2}")).join("");
            println!("  {name:<30}{shown}");
            Ok(())
        };
        for (name, machine) in &machines {
            show(name, &|pose| machine.stiffness(pose).map_err(|e| e.to_string()))?;
        }
        show("+ a factor table", &|pose| {
            table.factor_form(&improved, pose).map(|c| c.factor.stiffness()).map_err(|e| e.to_string())
        })?;
    }
    Ok(())
}
