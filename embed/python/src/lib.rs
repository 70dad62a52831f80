//! The core and the host's program for Python, as the module `pkm._core`; `python/pkm` is what a user imports.
//!
//! Nothing is computed here: a batch calls `pkm-core` row by row, a command is the one that `pkm-host` runs.

mod commands;
mod errors;
mod model;
mod rows;

/// `pkm._core`.
#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use crate::commands::run;
    #[pymodule_export]
    use crate::model::Model;
}
