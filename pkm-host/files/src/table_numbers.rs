//! The numbers of a correction table in the core's units, and the proof that they leave it positive.

use pkm_core::correction::{UNCERTAINTY_COLUMNS, UNCERTAINTY_ENTRIES, UNCERTAINTY_SPREAD};
use pkm_core::{Basis, CorrectionTable, TableUncertainty};
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Result};

/// The numbers of a table in the core's units, for the core to borrow.
#[derive(Clone, Debug)]
pub struct TableNumbers<T = f64> {
    /// Middle of the box, rad, rad, m.
    pub centre: [T; 3],
    /// Half widths, rad, rad, m.
    pub half_width: [T; 3],
    /// Exponents of the scaled θ, σ, Z0.
    pub terms: Vec<[u8; 3]>,
    /// Six rows, c11…c66.
    pub diagonal: Vec<T>,
    /// 21 rows of G's lower triangle.
    pub factor: Option<Vec<T>>,
}

/// How far the factor form may be off: the numbers of [`TableUncertainty`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UncertaintyNumbers {
    /// Growth of the variance: coefficients of [`pkm_core::correction::spread_terms`].
    pub spread: [f64; UNCERTAINTY_SPREAD],
    /// Standard deviation beyond the columns.
    pub rest: f64,
    /// Columns of the covariance factor, lower triangles row by row.
    #[serde(with = "columns")]
    pub columns: [[f64; UNCERTAINTY_ENTRIES]; UNCERTAINTY_COLUMNS],
}

/// Serde knows no arrays of this length and kind.
mod columns {
    use super::{Deserialize, Serialize, UNCERTAINTY_COLUMNS, UNCERTAINTY_ENTRIES};

    type Columns = [[f64; UNCERTAINTY_ENTRIES]; UNCERTAINTY_COLUMNS];

    pub(super) fn serialize<S: serde::Serializer>(columns: &Columns, to: S) -> Result<S::Ok, S::Error> {
        columns.iter().map(|column| column.to_vec()).collect::<Vec<_>>().serialize(to)
    }

    pub(super) fn deserialize<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Columns, D::Error> {
        let rows = Vec::<Vec<f64>>::deserialize(from)?;
        let expected = || serde::de::Error::custom("expected 4 columns of 21 numbers");
        let columns: Option<Vec<_>> = rows.into_iter().map(|row| row.try_into().ok()).collect();
        columns.and_then(|columns| columns.try_into().ok()).ok_or_else(expected)
    }
}

impl UncertaintyNumbers {
    /// The core's.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn core(&self) -> Result<TableUncertainty<f64>> {
        TableUncertainty::<f64>::new(self.spread, self.rest, self.columns).map_err(|e| Failure::input(e.to_string()))
    }
}

impl TableNumbers {
    /// The polynomials that must be positive: c_ii, and the diagonal of G.
    pub fn positive_rows(&self) -> Vec<(String, &[f64])> {
        let n = self.terms.len();
        let diagonal = (0..6).map(|i| (format!("c{0}{0}", i + 1), &self.diagonal[i * n..(i + 1) * n]));
        let factor = self.factor.iter().flat_map(|f| {
            (0..6).map(move |i| {
                let row = i * (i + 3) / 2;
                (format!("g{0}{0}", i + 1), &f[row * n..(row + 1) * n])
            })
        });
        diagonal.chain(factor).collect()
    }

    /// The core's table.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn table(&self) -> Result<CorrectionTable<'_, f64>> {
        Basis::<f64>::new(self.centre, self.half_width, &self.terms)
            .and_then(|basis| CorrectionTable::<f64>::new(basis, &self.diagonal, self.factor.as_deref()))
            .map_err(|e| Failure::input(e.to_string()))
    }

    /// The same in `f32`, as generated source has them.
    pub fn narrowed(&self) -> TableNumbers<f32> {
        let narrow = |v: &Vec<f64>| v.iter().map(|x| *x as f32).collect();
        TableNumbers {
            centre: self.centre.map(|v| v as f32),
            half_width: self.half_width.map(|v| v as f32),
            terms: self.terms.clone(),
            diagonal: narrow(&self.diagonal),
            factor: self.factor.as_ref().map(narrow),
        }
    }
}

impl TableNumbers<f32> {
    /// The core's table.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn table(&self) -> Result<CorrectionTable<'_, f32>> {
        Basis::<f32>::new(self.centre, self.half_width, &self.terms)
            .and_then(|basis| CorrectionTable::<f32>::new(basis, &self.diagonal, self.factor.as_deref()))
            .map_err(|e| Failure::input(e.to_string()))
    }
}

/// Refuses a correction that is not positive somewhere in its box.
///
/// # Errors
/// A place in the box, in ° and mm.
pub fn refuse_not_positive(
    name: &str,
    coefficients: &[f64],
    terms: &[[u8; 3]],
    (center, scale): ([f64; 3], [f64; 3]),
) -> Result<()> {
    positive_in_box(coefficients, terms).map_err(|t| {
        let [theta, sigma, z0]: [f64; 3] = std::array::from_fn(|i| center[i] + scale[i] * t[i]);
        Failure::input(format!(
            "the correction {name} is not positive at θ = {theta:.2}°, σ = {sigma:.2}°, Z0 = {z0:.1} mm, inside its box: \
             fit with more poses there, or with other terms"
        ))
    })
}

/// Proves that a polynomial is positive on [−1, 1]³ by dividing the box until a slope bound decides.
/// `Err` holds a point where it is not, or where a million boxes did not decide.
fn positive_in_box(c: &[f64], terms: &[[u8; 3]]) -> std::result::Result<(), [f64; 3]> {
    let value = |t: [f64; 3]| -> f64 {
        c.iter().zip(terms).map(|(c, n)| c * (0..3).map(|i| t[i].powi(n[i].into())).product::<f64>()).sum()
    };
    let slope: [f64; 3] = std::array::from_fn(|i| c.iter().zip(terms).map(|(c, n)| c.abs() * f64::from(n[i])).sum());
    let mut boxes = vec![([0.0; 3], [1.0; 3])];
    let mut count = 0;
    while let Some((middle, half)) = boxes.pop() {
        let here = value(middle);
        count += 1;
        if !(here > 0.0) || count > 1_000_000 {
            return Err(middle);
        }
        let drop: [f64; 3] = std::array::from_fn(|i| slope[i] * half[i]);
        if here > drop.iter().sum::<f64>() {
            continue;
        }
        // the first of the widest
        let widest = (1..3).fold(0, |widest, i| if drop[i] > drop[widest] { i } else { widest });
        let mut narrower = half;
        narrower[widest] /= 2.0;
        for side in [-1.0, 1.0] {
            let mut moved = middle;
            moved[widest] += side * narrower[widest];
            boxes.push((moved, narrower));
        }
    }
    Ok(())
}
