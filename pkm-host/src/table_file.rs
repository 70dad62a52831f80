//! A correction table that owns its numbers: as the fit makes it, as JSON, and as the core's view of it.

use pkm_core::{Basis, CorrectionTable};
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Result};
use crate::machine_file::PoseBox;
use crate::source::Source;

/// `coefficients.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TableFile {
    /// 1.
    pub format: u32,
    /// Name of the machine.
    pub machine: String,
    /// Of the machine file.
    pub machine_sha256: String,
    /// File of the stiffness data.
    pub data: String,
    /// Of that file.
    pub data_sha256: String,
    /// Extent of the data.
    #[serde(rename = "box")]
    pub extent: Extent,
    /// Middle of the box: θ in °, σ in °, Z0 in mm.
    pub center: [f64; 3],
    /// Half widths of the box in the same units.
    pub scale: [f64; 3],
    /// Exponents of the scaled θ, σ, Z0.
    pub terms: Vec<[u8; 3]>,
    /// The paper's form.
    pub diagonal: DiagonalForm,
    /// The factor form, when the data had all 21 columns.
    pub factor: Option<FactorForm>,
}

/// A box of poses in the units of files.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Extent {
    /// θ, least and greatest.
    pub theta_deg: [f64; 2],
    /// σ.
    pub sigma_deg: [f64; 2],
    /// Z0.
    pub z0_mm: [f64; 2],
}

impl From<PoseBox> for Extent {
    fn from(b: PoseBox) -> Self {
        let [theta_deg, sigma_deg, z0_mm] = b.0;
        Self { theta_deg, sigma_deg, z0_mm }
    }
}

/// Rows c11…c66.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DiagonalForm {
    /// One coefficient a term.
    pub coefficients: Vec<Vec<f64>>,
    /// The paper's e_ij of Eq. 11 in ° and mm; null when the terms are not among its nine.
    pub paper_e: Option<Vec<[f64; 9]>>,
}

/// Rows of the lower triangle of G.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FactorForm {
    /// One coefficient a term.
    pub coefficients: Vec<Vec<f64>>,
}

/// The numbers of a table in the core's units, for the core to borrow.
#[derive(Clone, Debug)]
pub struct TableNumbers {
    /// Middle of the box, rad, rad, m.
    pub centre: [f64; 3],
    /// Half widths, rad, rad, m.
    pub half_width: [f64; 3],
    /// Exponents of the scaled θ, σ, Z0.
    pub terms: Vec<[u8; 3]>,
    /// Six rows, c11…c66.
    pub diagonal: Vec<f64>,
    /// 21 rows of G's lower triangle.
    pub factor: Option<Vec<f64>>,
}

impl TableNumbers {
    /// The core's table.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn table(&self) -> Result<CorrectionTable<'_, f64>> {
        Basis::<f64>::new(self.centre, self.half_width, &self.terms)
            .and_then(|basis| CorrectionTable::<f64>::new(basis, &self.diagonal, self.factor.as_deref()))
            .map_err(|e| Failure::input(e.to_string()))
    }
}

/// Box values in ° and mm as the core has them, rad and m.
pub fn core_units([theta_deg, sigma_deg, z0_mm]: [f64; 3]) -> [f64; 3] {
    [theta_deg.to_radians(), sigma_deg.to_radians(), z0_mm / 1e3]
}

impl TableFile {
    /// Reads a table and lets the core check it.
    ///
    /// # Errors
    /// Syntax, missing or unknown fields, what the core refuses.
    pub fn parse(source: &Source) -> Result<Self> {
        let in_file = |f: Failure| f.in_file(&source.name);
        let table: Self = serde_json::from_str(source.text()?).map_err(|e| {
            in_file(Failure::input(format!("not a table of coefficients: {e}"))).at_line(e.line() as u64)
        })?;
        if table.format != 1 {
            let message = format!("expected 1, found {}", table.format);
            return Err(in_file(Failure::input(message)).at_column("format"));
        }
        table.numbers().table().map_err(in_file)?;
        Ok(table)
    }

    /// What the core needs of it.
    pub fn numbers(&self) -> TableNumbers {
        TableNumbers {
            centre: core_units(self.center),
            half_width: core_units(self.scale),
            terms: self.terms.clone(),
            diagonal: self.diagonal.coefficients.concat(),
            factor: self.factor.as_ref().map(|f| f.coefficients.concat()),
        }
    }
}
