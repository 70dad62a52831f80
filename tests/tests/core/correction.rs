//! Corrected stiffness against plain linear algebra, its box, and its refusals.

use nalgebra::{Matrix6, Vector6};
use pkm_core::effects::Effects;
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS};
use pkm_core::{
    Basis, CorrectionError, CorrectionTable, Domain, KinematicsError, Machine, MachineParameters, Pose, StiffnessError,
    TableError,
};
use pkm_tests::{cases, keep_worst, scaled_difference, seeded};

const CENTRE: [f64; 3] = [0.05, -0.02, 0.53];
const HALF_WIDTH: [f64; 3] = [0.2, 0.25, 0.03];
const TERMS: [[u8; 3]; 3] = [[0, 0, 0], [2, 1, 0], [0, 0, 3]];

fn basis() -> Basis<'static, f64> {
    Basis::<f64>::new(CENTRE, HALF_WIDTH, &TERMS).unwrap()
}

/// Diagonal entries near 1, the others small, all moving with the pose.
fn coefficients(rows: usize, is_diagonal: impl Fn(usize) -> bool) -> Vec<f64> {
    (0..rows).flat_map(|r| [if is_diagonal(r) { 1.2 } else { 0.1 }, 0.01 * r as f64, -0.02]).collect()
}

fn values(coefficients: &[f64], pose: &Pose<f64>) -> Vec<f64> {
    let t = [pose.theta_rad, pose.sigma_rad, pose.z0_m];
    let t: Vec<f64> = (0..3).map(|i| (t[i] - CENTRE[i]) / HALF_WIDTH[i]).collect();
    coefficients.chunks(3).map(|c| c[0] + c[1] * t[0] * t[0] * t[1] + c[2] * t[2].powi(3)).collect()
}

#[test]
fn both_forms_are_their_definitions() {
    let diagonal = coefficients(6, |_| true);
    let factor = coefficients(21, |r| [0, 2, 5, 9, 14, 20].contains(&r));
    let table = CorrectionTable::<f64>::new(basis(), &diagonal, Some(&factor)).unwrap();
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(1000) {
        let mut at = |i: usize| CENTRE[i] + HALF_WIDTH[i] * (2.0 * rng.f64() - 1.0);
        let pose = Pose { theta_rad: at(0), sigma_rad: at(1), z0_m: at(2) };
        let k_p = MACHINE_F64.stiffness(&pose).unwrap().matrix();

        let c = values(&diagonal, &pose);
        let expected = Matrix6::from_fn(|i, j| (c[i] * c[j]).sqrt() * k_p[(i, j)]);
        let found = table.diagonal_form(&MACHINE_F64, &pose).unwrap();
        assert_eq!(found.domain, Domain::Inside);
        keep_worst(&mut worst, scaled_difference(&found.factor.stiffness().matrix(), &expected));

        let entries = values(&factor, &pose);
        let g = Matrix6::from_fn(|i, j| if j <= i { entries[i * (i + 1) / 2 + j] } else { 0.0 });
        let half = k_p.cholesky().unwrap().l() * g;
        let expected = half * half.transpose();
        let found = table.factor_form(&MACHINE_F64, &pose).unwrap().factor;
        keep_worst(&mut worst, scaled_difference(&found.stiffness().matrix(), &expected));
    }
    assert!(worst <= 1e-12, "{worst:e}");
}

/// A compliance behind A is no part of what the table corrects.
#[test]
fn what_lies_behind_a_comes_after_the_table() {
    let diagonal = coefficients(6, |_| true);
    let factor = coefficients(21, |r| [0, 2, 5, 9, 14, 20].contains(&r));
    let table = CorrectionTable::<f64>::new(basis(), &diagonal, Some(&factor)).unwrap();
    let (linear, angular) = (2e-9, 4e-7);
    let behind = Matrix6::from_diagonal(&Vector6::new(linear, linear, linear, angular, angular, angular));
    let effects = Effects::NONE.with("wrist-compliance", [linear, angular]).unwrap();
    let soft = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    for in_factors in [false, true] {
        let compliance = |machine: &Machine<f64>| {
            let corrected =
                if in_factors { table.factor_form(machine, &pose) } else { table.diagonal_form(machine, &pose) };
            corrected.unwrap().factor.stiffness().matrix().try_inverse().unwrap()
        };
        let (found, expected) = (compliance(&soft), compliance(&MACHINE_F64) + behind);
        assert!(scaled_difference(&found, &expected) <= 1e-12, "{found} {expected}");
    }
}

#[test]
fn the_edge_of_the_box_is_inside() {
    let edge = |factor: f64, axis: usize| {
        let mut x = CENTRE;
        x[axis] += factor * HALF_WIDTH[axis];
        basis().domain(&Pose { theta_rad: x[0], sigma_rad: x[1], z0_m: x[2] })
    };
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            assert_eq!(edge(side, axis), Domain::Inside);
            assert_eq!(edge(side * 1.000_000_01, axis), Domain::Outside);
        }
    }
    assert_eq!(basis().domain(&Pose { theta_rad: f64::NAN, sigma_rad: 0.0, z0_m: 0.53 }), Domain::Outside);
}

#[test]
fn refusals_are_typed() {
    let diagonal = coefficients(6, |_| true);
    let table = CorrectionTable::<f64>::new(basis(), &diagonal, None).unwrap();
    let inside = Pose { theta_rad: 0.05, sigma_rad: 0.0, z0_m: 0.53 };
    assert!(!table.has_factor_form());
    assert_eq!(table.factor_form(&MACHINE_F64, &inside), Err(CorrectionError::NoFactorForm));
    let nan = Pose { theta_rad: f64::NAN, ..inside };
    assert_eq!(table.diagonal_form(&MACHINE_F64, &nan), Err(KinematicsError::NotFinite.into()));
    let mut negative = diagonal.clone();
    for bad in [[-1.0, 0.0, 0.0], [0.0; 3]] {
        negative[9..12].copy_from_slice(&bad);
        let table = CorrectionTable::<f64>::new(basis(), &negative, None).unwrap();
        assert_eq!(table.diagonal_form(&MACHINE_F64, &inside), Err(CorrectionError::NotPositive { row: 4 }));
    }
    let mut factor = coefficients(21, |r| [0, 2, 5, 9, 14, 20].contains(&r));
    factor[3 * 14] = 0.0;
    factor[3 * 14 + 1] = 0.0;
    let table = CorrectionTable::<f64>::new(basis(), &diagonal, Some(&factor)).unwrap();
    assert!(table.has_factor_form());
    assert_eq!(table.factor_form(&MACHINE_F64, &inside), Err(CorrectionError::NotPositive { row: 5 }));
    // polynomials that overflow far outside of a narrow box
    let narrow = Basis::<f32>::new([0.0, 0.0, 0.52], [0.2, 0.2, 1e-6], &[[0, 0, 0], [0, 0, 6]]).unwrap();
    let (of_two, beyond) = ([1.0, 1e20].repeat(21), Err(StiffnessError::NotPositiveDefinite.into()));
    let table = CorrectionTable::<f32>::new(narrow, &of_two[..12], Some(&of_two)).unwrap();
    let inside = Pose { theta_rad: 0.05, sigma_rad: 0.0, z0_m: 0.53 };
    assert_eq!(table.diagonal_form(&MACHINE_F32, &inside).map(|c| c.domain), beyond);
    assert_eq!(table.factor_form(&MACHINE_F32, &inside).map(|c| c.domain), beyond);
}

#[test]
fn damaged_tables_are_refused() {
    let new = |centre: f64, width: f64, terms: &[[u8; 3]]| Basis::<f64>::new([centre; 3], [width; 3], terms).err();
    assert_eq!(new(0.0, 1.0, &[]), Some(TableError::TermCount));
    assert_eq!(new(0.0, 1.0, &[[0; 3]; 65]), Some(TableError::TermCount));
    assert_eq!(new(0.0, 1.0, &[[0, 7, 0]]), Some(TableError::Exponent));
    assert_eq!(new(f64::NAN, 1.0, &TERMS), Some(TableError::NotFinite));
    assert_eq!(new(0.0, 0.0, &TERMS), Some(TableError::EmptyBox));
    let table = |d: &[f64], f: Option<&[f64]>| CorrectionTable::<f64>::new(basis(), d, f).err();
    assert_eq!(table(&[1.0; 17], None), Some(TableError::CoefficientCount));
    assert_eq!(table(&[1.0; 18], Some(&[1.0; 62])), Some(TableError::CoefficientCount));
    assert_eq!(table(&[f64::INFINITY; 18], None), Some(TableError::NotFinite));
    assert_eq!(table(&[1.0; 18], Some(&[1.0; 63])), None);
}
