//! Commands of `pkm-host`.

use pkm_host::cli;
use pyo3::prelude::*;

use crate::errors;

/// Runs a command that computes from files with its arguments, without the GIL, and returns its JSON document.
#[pyfunction]
pub fn run(py: Python<'_>, arguments: Vec<String>) -> PyResult<String> {
    py.detach(|| cli::compute(arguments)).map(|output| output.json).map_err(|failure| errors::of(&failure))
}
