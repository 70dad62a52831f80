//! `coefficients.json`: a correction table with where it comes from.

use pkm_core::correction::FACTOR_ENTRIES;
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Result, clipped};
use crate::pose::{PoseBox, core_units};
use crate::source::{self, Source};
use crate::table_numbers::{TableNumbers, UncertaintyNumbers, refuse_not_positive};
use crate::toml_error::plain;

/// `coefficients.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    pub extent: PoseBox,
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
    /// How far the factor form may be off; absent when that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<UncertaintyNumbers>,
}

/// Rows c11…c66.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiagonalForm {
    /// One coefficient a term.
    pub coefficients: Vec<Vec<f64>>,
    /// The paper's e_ij of Eq. 11 in ° and mm. With selected terms, which the paper has not, those of Eq. 12 fitted
    /// to the same data.
    pub paper_e: [[f64; 9]; 6],
}

/// Rows of the lower triangle of G.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FactorForm {
    /// One coefficient a term.
    pub coefficients: Vec<Vec<f64>>,
}

impl TableFile {
    /// `coefficients.json`.
    pub fn to_json(&self) -> String {
        source::json(self)
    }

    /// Reads a table and lets the core check it.
    ///
    /// # Errors
    /// Syntax, missing or unknown fields, what the core refuses.
    pub fn parse(source: &Source) -> Result<Self> {
        let in_file = |f: Failure| f.in_file(&source.name);
        let mut reader = serde_json::Deserializer::from_str(source.text()?);
        let read = serde_path_to_error::deserialize(&mut reader).map_err(|e| (e.path().to_string(), e.into_inner()));
        // what stands behind has no key
        let read = read.and_then(|table: Self| reader.end().map(|()| table).map_err(|e| (".".into(), e)));
        let table = read.map_err(|(key, e)| in_file(unread(&key, &e)))?;
        if table.format != 1 {
            let message = format!("expected 1, found {}", table.format);
            return Err(in_file(Failure::input(message)).at_column("format"));
        }
        table.check().map_err(in_file)?;
        Ok(table)
    }

    /// What the core can't see: the shape of the rows, the box, and a correction that is positive in it.
    fn check(&self) -> Result<()> {
        let fail = |key: &str, message: String| Err(Failure::input(message).at_column(key));
        let forms = [
            ("diagonal.coefficients", Some(&self.diagonal.coefficients), 6),
            ("factor.coefficients", self.factor.as_ref().map(|f| &f.coefficients), FACTOR_ENTRIES),
        ];
        for (key, rows, count) in forms {
            let Some(rows) = rows else { continue };
            let n = self.terms.len();
            if rows.len() != count || rows.iter().any(|r| r.len() != n) {
                return fail(key, format!("expected {count} rows of {n} coefficients, one for each of the terms"));
            }
        }
        if (1..self.terms.len()).any(|i| self.terms[..i].contains(&self.terms[i])) {
            return fail("terms", "expected different terms, found one twice".into());
        }
        for ((range, center), scale) in self.extent.ranges().iter().zip(self.center).zip(self.scale) {
            if (range[0] - center + scale).abs().max((range[1] - center - scale).abs()) > 1e-6 * scale.abs() {
                return fail("box", format!("expected center ± scale, found {range:?} for {center} ± {scale}"));
            }
        }
        let numbers = self.numbers();
        numbers.table()?;
        if let Some(uncertainty) = &self.uncertainty {
            uncertainty.core().map_err(|f| f.at_column("uncertainty"))?;
        }
        let center_scale = (self.center, self.scale);
        let rows = numbers.positive_rows();
        rows.into_iter().try_for_each(|(name, row)| refuse_not_positive(&name, row, &self.terms, center_scale))
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

/// What the JSON reader does not like, at a key (`.` for the document).
fn unread(key: &str, error: &serde_json::Error) -> Failure {
    let text = error.to_string();
    let said = plain(text.split(" at line ").next().unwrap_or(""));
    let message = match said.as_str() {
        // behind an array that has all it should
        "trailing characters" if key != "." => "not JSON, or more values than expected".to_owned(),
        _ if error.is_data() => said,
        _ => format!("not JSON, or not all of it: {said}"),
    };
    let failure = Failure::input(message).at_line(error.line() as u64);
    if key == "." { failure } else { failure.at_column(clipped(key)) }
}
