//! Finite elements against the core.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use pkm_core::effects::EFFECTS;
use pkm_core::{Machine, MachineParameters, Pose};
use pkm_host::dataset::{StiffnessData, read_stiffness};
use pkm_host::machine_file::MachineFile;
use pkm_host::source::Source;

/// Effects of which all parameters are fitted, from starting values: no more than what FE shows and no less than nothing.
fn fitted(machine: &MachineParameters, data: &StiffnessData, start: &[(&str, &[f64])]) -> MachineParameters {
    let places: Vec<(usize, usize, f64)> = start
        .iter()
        .flat_map(|(id, values)| {
            let effect = EFFECTS.iter().position(|e| e.id == *id).unwrap();
            values.iter().enumerate().map(move |(p, v)| (effect, p, *v))
        })
        .collect();
    let with = |x: &DVector<f64>| {
        let mut m = *machine;
        for ((effect, p, unit), x) in places.iter().zip(x) {
            m.effects.parameters[*effect][*p] = unit * x * x;
        }
        m
    };
    // entries of K_fem^-½-like scaling: k_ij / √(k_ii k_jj)
    let residual = |x: &DVector<f64>| -> DVector<f64> {
        let machine = Machine::<f64>::new(&with(x)).unwrap();
        let mut r = Vec::new();
        for (pose, target) in data.poses.iter().zip(&data.targets) {
            let k = machine.stiffness(&pose.pose).unwrap().matrix();
            let full = target.full.as_ref().unwrap().matrix();
            for i in 0..6 {
                for j in 0..=i {
                    r.push((k[i][j] - full[i][j]) / (full[i][i] * full[j][j]).sqrt());
                }
            }
        }
        DVector::from_vec(r)
    };
    let mut x = DVector::from_element(places.len(), 1.0);
    let mut lambda = 1e-3;
    let mut r = residual(&x);
    for _ in 0..200 {
        let columns: Vec<DVector<f64>> = (0..x.len())
            .map(|j| {
                let mut y = x.clone();
                y[j] += 1e-6;
                (residual(&y) - &r) / 1e-6
            })
            .collect();
        let a = DMatrix::from_columns(&columns);
        let n = a.tr_mul(&a);
        let damped = &n + DMatrix::from_diagonal(&(n.diagonal() * lambda)) + DMatrix::identity(x.len(), x.len()) * 1e-12;
        let step = damped.cholesky().unwrap().solve(&a.tr_mul(&r));
        let trial = &x - step;
        let there = residual(&trial);
        if there.norm() < r.norm() {
            let gain = 1.0 - there.norm() / r.norm();
            (x, r) = (trial, there);
            lambda *= 0.3;
            if gain < 1e-9 {
                break;
            }
        } else {
            lambda *= 4.0;
        }
    }
    println!("rms {:e}", r.norm() / (r.len() as f64).sqrt());
    for ((effect, p, unit), x) in places.iter().zip(&x) {
        println!("{} {} = {:e}", EFFECTS[*effect].id, EFFECTS[*effect].parameters[*p], unit * x * x);
    }
    with(&x)
}

fn errors(machine: &MachineParameters, data: &StiffnessData) -> ([f64; 6], [f64; 6]) {
    let machine = Machine::<f64>::new(machine).unwrap();
    let (mut mean, mut max) = ([0.0; 6], [0.0_f64; 6]);
    for (pose, target) in data.poses.iter().zip(&data.targets) {
        let k = machine.stiffness(&pose.pose).unwrap().principal();
        for i in 0..6 {
            let e = 100.0 * (k[i] / target.principal[i] - 1.0);
            mean[i] += e.abs() / data.poses.len() as f64;
            max[i] = max[i].max(e.abs());
        }
    }
    (mean, max)
}

#[test]
fn explore() {
    let reference = MachineFile::parse(pkm_host::source::fixtures::machine()).unwrap();
    for name in std::env::var("FEM").unwrap_or_default().split(',').filter(|n| !n.is_empty()) {
        let data = read_stiffness(Source::read(Path::new(name)).unwrap(), &reference).unwrap();
        println!("{name}: {:?}", errors(&reference.parameters, &data));
        let tel: (&str, &[f64]) = ("telescopic-limb", &[0.4046, 0.4046, 0.7e-6, 5e-10, 1.0e-6, 2e-9]);
        let plat: (&str, &[f64]) = ("moving-platform-compliance", &[1e-6, 1e-8, 1e-6, 1e-8, 1e-10]);
        let axial: (&str, &[f64]) = ("limb-1-axial", &[1e-9]);
        for set in [
            vec![tel, plat],
            vec![tel, plat, axial, ("limb-2-axial", &[1e-9]), ("limb-3-axial", &[1e-9])],
        ] {
            let m = fitted(&reference.parameters, &data, &set);
            println!("{:?}", errors(&m, &data));
        }
    }
    let _: Option<Pose<f64>> = None;
}
