//! Finite elements and the core against each other. Needs CalculiX (`ccx`), so that all is ignored unless asked for.

use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector};
use pkm_core::effects::EFFECTS;
use pkm_core::{Machine, MachineParameters};
use pkm_host::cli;
use pkm_host::files::dataset::{StiffnessData, read_stiffness};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::source::Source;

const RIGID: [&str; 2] = ["solid.platform.kind=rigid", "solid.base.kind=rigid"];

struct Scratch(tempfile::TempDir);

impl Scratch {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Every n-th pose of L49.
    fn poses(&self, every: usize) -> PathBuf {
        let text = std::fs::read_to_string(fixture("poses/l49.csv")).unwrap();
        let (head, rows) = text.split_at(text.find("O01").unwrap());
        let rows: Vec<&str> = rows.lines().step_by(every).collect();
        std::fs::write(self.path("poses.csv"), format!("{head}{}\n", rows.join("\n"))).unwrap();
        self.path("poses.csv")
    }

    fn fem(&self, poses: &Path, set: &[&str], size: f64, readings: &[&str]) -> StiffnessData {
        self.fem_of(None, poses, set, size, readings)
    }

    fn fem_of(
        &self,
        machine: Option<&Path>,
        poses: &Path,
        set: &[&str],
        size: f64,
        readings: &[&str],
    ) -> StiffnessData {
        let out = self.path("k.csv");
        let shown = |path: &Path| path.display().to_string();
        let mut args = vec!["fem".into(), "--poses".into(), shown(poses), "--out".into(), shown(&out)];
        args.extend(machine.into_iter().flat_map(|path| ["--machine".into(), shown(path)]));
        args.extend(set.iter().flat_map(|s| ["--set".into(), (*s).into()]));
        args.extend(["--mesh".into(), size.to_string(), "--jobs".into(), "2".into()]);
        args.extend(readings.iter().map(|a| (*a).to_owned()));
        cli::run(args).unwrap_or_else(|e| panic!("{e}"));
        read_stiffness(Source::read(&out).unwrap(), &reference()).unwrap()
    }
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures").join(name)
}

fn reference() -> MachineFile {
    MachineFile::parse(Source::embedded(pkm_fixtures::MACHINE)).unwrap()
}

/// Greatest relative difference of each k_ii, %.
fn apart(machine: &MachineParameters, data: &StiffnessData) -> [f64; 6] {
    let machine = Machine::<f64>::new(machine).unwrap();
    let at = data.poses.iter().map(|p| machine.stiffness(&p.pose).unwrap().principal().into());
    greatest(&at.collect::<Vec<_>>(), data)
}

fn greatest(found: &[[f64; 6]], data: &StiffnessData) -> [f64; 6] {
    assert_eq!(found.len(), data.targets.len());
    std::array::from_fn(|i| {
        let each = found.iter().zip(&data.targets).map(|(k, target)| 100.0 * (k[i] / target.principal[i] - 1.0).abs());
        each.fold(0.0, f64::max)
    })
}

fn below(limit_percent: f64, found: [f64; 6], what: &str) {
    println!("{what}: {found:.3?} %");
    assert!(found.iter().all(|e| *e <= limit_percent), "{what}: {found:?}");
}

/// The machine with parameters of some effects fitted to all 21 entries of K, by damped least squares from starting values.
fn fitted(machine: &MachineParameters, data: &StiffnessData, start: &[(&str, &[f64])]) -> MachineParameters {
    let places: Vec<(usize, usize, f64)> = start
        .iter()
        .flat_map(|(id, values)| {
            let effect = EFFECTS.iter().position(|e| e.id == *id).unwrap();
            values.iter().enumerate().map(move |(p, v)| (effect, p, *v))
        })
        .collect();
    // squares, since none may be negative
    let with = |x: &DVector<f64>| {
        let mut m = *machine;
        for ((effect, p, unit), x) in places.iter().zip(x) {
            m.effects.parameters[*effect][*p] = unit * x * x;
        }
        m
    };
    let residual = |x: &DVector<f64>| {
        let machine = Machine::<f64>::new(&with(x)).unwrap();
        let mut r = Vec::new();
        for (pose, target) in data.poses.iter().zip(&data.targets) {
            let (k, fem) = (machine.stiffness(&pose.pose).unwrap().matrix(), target.full.unwrap().matrix());
            for i in 0..6 {
                // the principal stiffnesses, which are judged, count most
                let weight = |j: usize| if i == j { 4.0 } else { 1.0 };
                r.extend((0..=i).map(|j| weight(j) * (k[(i, j)] - fem[(i, j)]) / (fem[(i, i)] * fem[(j, j)]).sqrt()));
            }
        }
        DVector::from_vec(r)
    };
    let mut x = DVector::from_element(places.len(), 1.0);
    let (mut r, mut damping) = (residual(&x), 1e-3);
    for _ in 0..200 {
        let slope = |j: usize| {
            let mut near = x.clone();
            near[j] += 1e-6;
            (residual(&near) - &r) / 1e-6
        };
        let jacobian = DMatrix::from_columns(&(0..x.len()).map(slope).collect::<Vec<_>>());
        let normal = jacobian.tr_mul(&jacobian);
        let damped = &normal + DMatrix::from_diagonal(&normal.diagonal().map(|v| damping * v + 1e-12));
        let trial = &x - damped.cholesky().unwrap().solve(&jacobian.tr_mul(&r));
        let there = residual(&trial);
        if there.norm() < r.norm() {
            let enough = there.norm() > (1.0 - 1e-9) * r.norm();
            (x, r, damping) = (trial, there, 0.3 * damping);
            if enough {
                break;
            }
        } else {
            damping *= 4.0;
        }
    }
    with(&x)
}

const TELESCOPE: (&str, &[f64]) = ("telescopic-limb", &[0.4, 0.4, 7e-7, 5e-10, 1e-6, 2e-9]);
const PLATFORM: (&str, &[f64]) = ("moving-platform-compliance", &[1e-6, 1e-8, 1e-6, 1e-8, 1e-10]);

#[test]
#[ignore = "needs CalculiX"]
fn with_rigid_platforms_and_uniform_limbs_the_core_agrees() {
    let scratch = Scratch::new();
    let data = scratch.fem(&scratch.poses(1), &[&RIGID[..], &["solid.limb=uniform"]].concat(), 2.0, &[]);
    assert_eq!(data.poses.len(), 49);
    below(0.3, apart(&reference().parameters, &data), "49 poses, few elements");
    let data = scratch.fem(&scratch.poses(12), &[&RIGID[..], &["solid.limb=uniform"]].concat(), 1.0, &[]);
    below(0.1, apart(&reference().parameters, &data), "5 poses");
}

#[test]
#[ignore = "needs CalculiX"]
fn with_its_effects_fitted_the_core_agrees_with_telescopes_and_an_elastic_platform() {
    let scratch = Scratch::new();
    let reference = reference().parameters;
    // without a section [solid] the ram is the declared rod, and the tube bends like the declared body
    let text = std::fs::read_to_string(fixture("machines/reference.toml")).unwrap();
    let machine = scratch.path("machine.toml");
    std::fs::write(&machine, text.split("[solid]").next().unwrap()).unwrap();
    let poses = scratch.poses(1);
    let compute = |set: &[&str]| scratch.fem_of(Some(&machine), &poses, set, 2.0, &[]);
    // the telescopic effect knows of tube, ram and screw, not of nut and bearing: these stiff
    let stiff = ["nut", "bearing"].map(|part| format!("solid.{part}.axial_n_per_m=[1.5e9,1.5e9,1.5e9]"));
    let data = compute(&["solid.base.kind=rigid", &stiff[0], &stiff[1]]);
    below(1.0, apart(&fitted(&reference, &data, &[TELESCOPE, PLATFORM]), &data), "telescope and platform fitted");

    // with soft ones, which are what the axial effects are for, and an elastic base
    let data = compute(&[]);
    let axial = ["limb-1-axial", "limb-2-axial", "limb-3-axial"].map(|id| (id, &[1e-9][..]));
    let found = fitted(&reference, &data, &[&[TELESCOPE, PLATFORM], &axial[..]].concat());
    below(0.4, apart(&found, &data), "axial effects fitted as well");
}

#[test]
#[ignore = "needs CalculiX"]
fn elements_half_as_long_change_little() {
    let scratch = Scratch::new();
    let poses = scratch.poses(48);
    let usual = scratch.fem(&poses, &[], 1.0, &[]);
    let fine = scratch.fem(&poses, &[], 0.5, &[]);
    let found: Vec<[f64; 6]> = usual.targets.iter().map(|t| t.principal).collect();
    below(0.2, greatest(&found, &fine), "usual elements against twice as fine");
}

#[test]
#[ignore = "needs CalculiX"]
fn the_fixtures_are_what_fem_computes_and_every_time_the_same() {
    let scratch = Scratch::new();
    let poses = scratch.poses(16);
    let data = scratch.fem(&poses, &[], 1.0, &[]);
    let text = std::fs::read_to_string(scratch.path("k.csv")).unwrap();
    let fixture = read_stiffness(Source::embedded(pkm_fixtures::TRAINING), &reference()).unwrap();
    for (pose, target) in data.poses.iter().zip(&data.targets) {
        let n = fixture.poses.iter().position(|p| p.id == pose.id).unwrap();
        let (found, kept) = (target.full.unwrap().matrix(), fixture.targets[n].full.unwrap().matrix());
        for i in 0..6 {
            for j in 0..6 {
                let scale = (kept[(i, i)] * kept[(j, j)]).sqrt();
                assert!((found[(i, j)] - kept[(i, j)]).abs() < 1e-4 * scale, "{}: k{}{}", pose.id, i + 1, j + 1);
            }
        }
    }
    scratch.fem(&poses, &[], 1.0, &[]);
    assert_eq!(std::fs::read_to_string(scratch.path("k.csv")).unwrap(), text);
}

#[test]
#[ignore = "needs CalculiX"]
fn what_is_undeclared_in_the_solids_is_found_in_readings_of_them() {
    use pkm_host::diagnose::{Method, Rules, Verdict, diagnose};
    use pkm_host::files::readings::Readings;
    use pkm_host::progress::silent;
    let scratch = Scratch::new();
    let poses = scratch.poses(5);
    for (set, id) in [
        (&["solid.platform.kind=rigid", "solid.offset_mm=[20,20,20]"][..], "platform-offset"),
        (&[][..], "moving-platform-compliance"),
    ] {
        let out = scratch.path("readings.csv");
        let asked = ["--readings", &out.display().to_string(), "--seed", "1"];
        scratch.fem(&poses, &[&["solid.limb=uniform", "solid.base.kind=rigid"], set].concat(), 2.0, &asked);
        let file = reference();
        let readings = Readings::read(Source::read(&out).unwrap(), &file).unwrap();
        let diagnosis = diagnose(&file, &readings, None, Method::Formulas, &Rules::DEFAULT, &silent).unwrap();
        let found: Vec<&str> = diagnosis.effects.iter().map(|e| e.id).collect();
        println!("{id}: {found:?}, {:?}", diagnosis.judgement.verdict);
        assert_eq!((found, diagnosis.judgement.verdict), (vec![id], Verdict::Explained));
        if id == "platform-offset" {
            for (name, metres, stderr) in diagnosis.effects[0].parameters.iter().filter(|p| p.0.starts_with("limb")) {
                assert!((metres - 0.020).abs() < 1e-4, "{name}: {metres} ± {stderr}");
            }
        }
    }
}
