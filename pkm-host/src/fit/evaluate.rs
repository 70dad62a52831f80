//! How well the basic model and a table agree with stiffness data (paper, Eqs. 13 and 14).

use nalgebra::{Matrix6, Vector3, Vector6};
use pkm_core::{Domain, Machine, Stiffness, Wrench};
use serde::Serialize;

use super::Sample;
use crate::error::{Failure, Result};
use crate::files::table_numbers::TableNumbers;
use crate::pose::ROTATION_ARM_M;

/// Mean, standard deviation (n − 1), greatest and least of six quantities.
#[derive(Clone, Debug, Serialize)]
pub struct Statistics {
    /// By stiffness 11…66, like the others.
    pub mean: [f64; 6],
    /// NaN (null) for a single pose.
    pub stdev: [f64; 6],
    /// Greatest.
    pub max: [f64; 6],
    /// Least.
    pub min: [f64; 6],
}

impl Statistics {
    fn new(values: &[[f64; 6]]) -> Self {
        let n = values.len() as f64;
        let over = |f: &dyn Fn(&mut dyn Iterator<Item = f64>) -> f64| -> [f64; 6] {
            std::array::from_fn(|i| f(&mut values.iter().map(|v| v[i])))
        };
        let mean = over(&|v| v.sum::<f64>() / n);
        let stdev = std::array::from_fn(|i| {
            let squares: f64 = values.iter().map(|v| (v[i] - mean[i]).powi(2)).sum();
            (squares / (n - 1.0)).sqrt()
        });
        let max = over(&|v| v.fold(f64::NEG_INFINITY, f64::max));
        let min = over(&|v| v.fold(f64::INFINITY, f64::min));
        Self { mean, stdev, max, min }
    }
}

/// Statistics of me (Eq. 13) with the paper's bands.
#[derive(Clone, Debug, Serialize)]
pub struct CorrectionEffect {
    /// Of me.
    #[serde(flatten)]
    pub statistics: Statistics,
    /// Poses with me at least 0.9, 0.6-0.9, 0-0.6, below 0.
    pub bands: [[usize; 4]; 6],
}

/// Mean and greatest deflection error under each of the six unit loads, in %.
#[derive(Clone, Debug, Serialize)]
pub struct DeflectionError {
    /// By load.
    pub mean: [f64; 6],
    /// By load.
    pub max: [f64; 6],
}

/// Errors of the improved model (diagonal form) on k_ii.
#[derive(Clone, Debug, Serialize)]
pub struct Improved {
    /// Eq. 14.
    pub re_percent: Statistics,
    /// Eq. 13 with absolute values.
    pub me: CorrectionEffect,
}

/// Errors of the basic model on k_ii.
#[derive(Clone, Debug, Serialize)]
pub struct Basic {
    /// Eq. 14 with K_p in place of K_m.
    pub re_percent: Statistics,
}

/// Deflection errors of every form of the model; null where the data or the table lack the couplings.
#[derive(Clone, Debug, Serialize)]
pub struct DeflectionErrors {
    /// K_p.
    pub basic: Option<DeflectionError>,
    /// √C K_p √C.
    pub diagonal: Option<DeflectionError>,
    /// Eq. 10 as published: the diagonal alone.
    pub diagonal_literal: Option<DeflectionError>,
    /// (L G)(L G)ᵀ.
    pub factor: Option<DeflectionError>,
}

/// How the models compare with data.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// Poses.
    pub poses: usize,
    /// Of them outside the table's box.
    pub outside_box: usize,
    /// Diagonal form.
    pub improved: Improved,
    /// K_p.
    pub basic: Basic,
    /// Factor form on k_ii; null without it.
    pub factor: Option<Basic>,
    /// All forms under unit loads at A.
    pub deflection_percent: DeflectionErrors,
    /// All forms under unit loads at the tool's tip, seen there, wrist joints at 0.
    pub tip_deflection_percent: DeflectionErrors,
}

/// Displacements of a point under the six unit loads there, rotations times [`ROTATION_ARM_M`].
fn unit_deflections(k: &Stiffness<f64>, at_m: Vector3<f64>) -> Option<[[f64; 6]; 6]> {
    let factor = k.factor().ok()?;
    let mut columns = [[0.0; 6]; 6];
    for (i, column) in columns.iter_mut().enumerate() {
        let unit = Wrench::from_vector(Vector6::ith(i, 1.0));
        let d = factor.deflection(&unit.moved_to_a(at_m)).ok()?.seen_at(at_m);
        let (d, r) = (d.translation_m, d.rotation_rad * ROTATION_ARM_M);
        *column = [d.x, d.y, d.z, r.x, r.y, r.z];
    }
    Some(columns)
}

fn deflection_error(
    samples: &[Sample],
    at_m: Vector3<f64>,
    model: impl Fn(&Sample) -> Option<Stiffness<f64>>,
) -> Option<DeflectionError> {
    let errors = samples
        .iter()
        .map(|sample| {
            let expected = unit_deflections(&sample.target.full?, at_m)?;
            let found = unit_deflections(&model(sample)?, at_m)?;
            let norm = |v: &[f64; 6]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            Some(std::array::from_fn(|load| {
                let difference = std::array::from_fn(|i| found[load][i] - expected[load][i]);
                100.0 * norm(&difference) / norm(&expected[load])
            }))
        })
        .collect::<Option<Vec<[f64; 6]>>>()?;
    let statistics = Statistics::new(&errors);
    Some(DeflectionError { mean: statistics.mean, max: statistics.max })
}

/// Holds basic and corrected model against data; `tip_m` is where the tool's tip is at home, in A-uvw.
///
/// # Errors
/// A corrected stiffness that the core refuses, outside the box.
pub fn evaluate(
    samples: &[Sample],
    machine: &Machine<f64>,
    tip_m: Vector3<f64>,
    numbers: &TableNumbers,
) -> Result<Evaluation> {
    let table = numbers.table()?;
    let corrected = |sample: &Sample| table.diagonal_form(machine, &sample.pose.pose).map(|c| c.factor.stiffness());
    let factored = |sample: &Sample| table.factor_form(machine, &sample.pose.pose).map(|c| c.factor.stiffness());
    let relative =
        |k: Vector6<f64>, a: [f64; 6]| -> [f64; 6] { std::array::from_fn(|i| 100.0 * (k[i] - a[i]).abs() / a[i]) };
    let (mut improved, mut basic, mut factor, mut me) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for sample in samples {
        let refused = |e: pkm_core::CorrectionError| {
            Failure::input(format!("pose `{}`: {e}", sample.pose.id)).at_line(sample.pose.line)
        };
        let m = corrected(sample).map_err(refused)?.principal();
        let (p, a) = (sample.basic.principal(), sample.target.principal);
        improved.push(relative(m, a));
        basic.push(relative(p, a));
        me.push(std::array::from_fn(|i| {
            let (improved, basic) = ((m[i] - a[i]).abs(), (p[i] - a[i]).abs());
            // nothing to correct, and nothing spoilt
            if improved.max(basic) <= 1e-12 * a[i] { 1.0 } else { 1.0 - improved / basic }
        }));
        if table.has_factor_form() {
            factor.push(relative(factored(sample).map_err(refused)?.principal(), a));
        }
    }
    let band = |me: f64| match me {
        me if me >= 0.9 => 0,
        me if me >= 0.6 => 1,
        me if me >= 0.0 => 2,
        _ => 3,
    };
    let mut bands = [[0; 4]; 6];
    for values in &me {
        for (counts, value) in bands.iter_mut().zip(values) {
            counts[band(*value)] += 1;
        }
    }
    let literal = |sample: &Sample| {
        let k = corrected(sample).ok()?.principal();
        Some(Stiffness::from_lower(&Matrix6::from_diagonal(&k)))
    };
    let under_load = |at_m: Vector3<f64>| DeflectionErrors {
        basic: deflection_error(samples, at_m, |s| Some(s.basic)),
        diagonal: deflection_error(samples, at_m, |s| corrected(s).ok()),
        diagonal_literal: deflection_error(samples, at_m, literal),
        factor: deflection_error(samples, at_m, |s| factored(s).ok()),
    };
    let outside_box = samples.iter().filter(|s| table.domain(&s.pose.pose) == Domain::Outside).count();
    Ok(Evaluation {
        poses: samples.len(),
        outside_box,
        improved: Improved {
            re_percent: Statistics::new(&improved),
            me: CorrectionEffect { statistics: Statistics::new(&me), bands },
        },
        basic: Basic { re_percent: Statistics::new(&basic) },
        factor: table.has_factor_form().then(|| Basic { re_percent: Statistics::new(&factor) }),
        deflection_percent: under_load(Vector3::zeros()),
        tip_deflection_percent: under_load(tip_m),
    })
}
