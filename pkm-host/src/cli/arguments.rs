//! Arguments that several commands take, and how numbers are read.

use std::path::PathBuf;

use crate::files::import::Renames;
use crate::plan::model::Form;

/// Columns of measured data that are called otherwise.
#[derive(clap::Args)]
pub(crate) struct ColumnsArgs {
    /// Names of columns that the program does not know, as new=theirs,… (`dx_um=Weg X,fx_n=Kraft 1`); a unit in their name or in
    /// a row of units is converted.
    #[arg(long, value_name = "NEW=THEIRS,…", requires = "data")]
    columns: Option<Renames>,
}

impl ColumnsArgs {
    /// None, if none was given.
    pub(crate) fn renames(&self) -> Renames {
        self.columns.clone().unwrap_or_default()
    }
}

/// A table and its form.
#[derive(clap::Args)]
pub(crate) struct TableArgs {
    /// coefficients.json of `fit`; without it the basic model.
    #[arg(long, value_name = "JSON")]
    pub(crate) table: Option<PathBuf>,
    /// How the table is applied.
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) form: Form,
}

pub(crate) fn positive(text: &str) -> Result<f64, String> {
    finite(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("expected a number above 0".into()) })
}

pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    finite(text).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("expected a number of at least 0".into()) })
}

pub(crate) fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err("expected a finite number".into()),
    }
}

/// Numbers with commas between.
pub(crate) fn list<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values = text.split(',').map(|t| finite(t.trim())).collect::<Result<Vec<_>, _>>()?;
    values.try_into().map_err(|v: Vec<f64>| format!("expected {N} numbers with commas between, found {}", v.len()))
}
