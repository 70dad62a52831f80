//! Where to measure or to compute (paper, Section 4.2).

use pkm_core::correction::EQ_11;

use crate::error::{Failure, Result, status};
use crate::files::machine::MachineFile;
use crate::pose::{NamedPose, pose_of, tidy};

/// Kinds of plans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanKind {
    /// First three columns of L49(7⁸), the third (i + j) mod 7, as the paper.
    L49,
    /// The third column (i + 3j) mod 7: terms of Eq. 11 far less entangled.
    L49Balanced,
    /// N² poses on N levels, the third column the best balanced of its kind.
    Levels(usize),
    /// 25 poses spread over the inside of the box.
    Verify,
    /// Poses and loads that tell the rivals of a diagnosis apart.
    Discriminate,
    /// Poses, loads, repeats and series that show effects of a stated size, before anything is read.
    Campaign,
}

impl PlanKind {
    /// From the words behind `--kind`.
    ///
    /// # Errors
    /// An unknown word, or a number of levels that is missing or not 4…50.
    pub fn parse(words: &[String]) -> Result<Self> {
        let words: Vec<&str> = words.iter().flat_map(|w| w.split_whitespace()).collect();
        match words.as_slice() {
            ["l49"] => Ok(Self::L49),
            ["l49-balanced"] => Ok(Self::L49Balanced),
            ["verify"] => Ok(Self::Verify),
            ["discriminate"] => Ok(Self::Discriminate),
            ["campaign"] => Ok(Self::Campaign),
            ["levels", n] => match n.parse() {
                Ok(n @ 4..=50) => Ok(Self::Levels(n)),
                _ => Err(Failure::usage(format!("--kind levels: expected a whole number from 4 to 50, found `{n}`"))),
            },
            ["levels"] => Err(Failure::usage("--kind levels: expected the number of levels behind it")),
            other => Err(Failure::usage(format!(
                "--kind: expected l49, l49-balanced, levels N, verify, discriminate or campaign, found `{}`",
                other.join(" ")
            ))),
        }
    }
}

/// Lays the poses of a plan into the machine's box.
///
/// # Errors
/// A pose that the machine cannot take.
pub fn plan(kind: PlanKind, machine: &MachineFile) -> Result<Vec<NamedPose>> {
    let (letter, points) = match kind {
        PlanKind::L49 => ('O', latin(7, 1)),
        PlanKind::L49Balanced => ('O', latin(7, 3)),
        PlanKind::Levels(n) => ('O', latin(n, best_step(n))),
        PlanKind::Verify => ('V', spread(25)),
        PlanKind::Discriminate | PlanKind::Campaign => {
            return Err(Failure::usage("expected a kind of plan that has poses alone"));
        }
    };
    let width = points.len().to_string().len();
    let at = |i: usize, t: f64| {
        let [low, high] = machine.pose_box.ranges()[i];
        // levels like -15, -10, … 15 exactly, not -9.999999999999998
        tidy(low + (high - low) * t)
    };
    points
        .into_iter()
        .enumerate()
        .map(|(n, t)| {
            let id = format!("{letter}{:0width$}", n + 1);
            let [theta, sigma, z0] = std::array::from_fn(|i| at(i, t[i]));
            let pose = pose_of(theta, sigma, z0);
            machine.machine.inverse(&pose).map_err(|e| {
                let why = machine.refusal(e, &pose);
                let message = format!("pose {id} of the plan (θ {theta}°, σ {sigma}°, Z0 {z0} mm): {why}");
                Failure::refused(status(e), format!("{message}; choose another box"))
            })?;
            Ok(NamedPose { id, line: n as u64 + 1, pose })
        })
        .collect()
}

/// Every pair of levels of two variables, once, with the third at (i + step·j) mod n; in 0…1.
fn latin(n: usize, step: usize) -> Vec<[f64; 3]> {
    let level = |k: usize| k as f64 / (n - 1) as f64;
    (0..n * n).map(|m| (m / n, m % n)).map(|(i, j)| [level(i), level(j), level((i + step * j) % n)]).collect()
}

/// The step, coprime with n, that entangles the terms of Eq. 11 least.
fn best_step(n: usize) -> usize {
    let coprime = |a: usize| (2..=a).all(|d| !(a.is_multiple_of(d) && n.is_multiple_of(d)));
    (1..n)
        .filter(|s| coprime(*s))
        .map(|s| (largest_vif(&latin(n, s)), s))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(1, |(_, s)| s)
}

/// Largest variance inflation factor of Eq. 11's terms, variables scaled to −1…1.
fn largest_vif(points: &[[f64; 3]]) -> f64 {
    let columns: Vec<Vec<f64>> = EQ_11
        .iter()
        .filter(|term| **term != [0, 0, 0])
        .map(|term| {
            let value = |t: &[f64; 3]| (0..3).map(|i| (2.0 * t[i] - 1.0).powi(term[i].into())).product::<f64>();
            let raw: Vec<f64> = points.iter().map(value).collect();
            let mean = raw.iter().sum::<f64>() / raw.len() as f64;
            let norm = raw.iter().map(|v| (v - mean).powi(2)).sum::<f64>().sqrt();
            raw.iter().map(|v| (v - mean) / norm).collect()
        })
        .collect();
    let correlation = nalgebra::DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
        columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum()
    });
    correlation.try_inverse().map_or(f64::INFINITY, |inverse| inverse.diagonal().max())
}

/// Points of an additive sequence, evenly spread over the inside of the unit cube.
fn spread(n: usize) -> Vec<[f64; 3]> {
    // real root of x⁴ = x + 1, what the golden number is in one dimension
    const ROOT: f64 = 1.220_744_084_605_759_5;
    (1..=n).map(|k| std::array::from_fn(|i| (0.5 + k as f64 / ROOT.powi(i as i32 + 1)).fract())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_3_is_balanced_and_the_papers_step_1_is_not() {
        assert!((largest_vif(&latin(7, 1)) - 7.1).abs() < 0.05, "{}", largest_vif(&latin(7, 1)));
        assert!((largest_vif(&latin(7, 3)) - 1.1).abs() < 0.05, "{}", largest_vif(&latin(7, 3)));
        // 3 and 4 = −3 are mirror images
        assert!([3, 4].contains(&best_step(7)));
    }

    #[test]
    fn every_pair_of_levels_stands_once() {
        for (n, step) in [(7, 1), (7, 3), (9, best_step(9)), (10, best_step(10))] {
            let points = latin(n, step);
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                let key = |x: f64| (x * 1e6).round() as i64;
                let pairs: std::collections::BTreeSet<_> = points.iter().map(|p| (key(p[a]), key(p[b]))).collect();
                assert_eq!(pairs.len(), n * n);
            }
        }
    }
}
