//! Failures as the exceptions of `pkm.errors`.

use std::ffi::CString;

use pkm_core::{CorrectionError, KinematicsError, StiffnessError, ToolError};
use pkm_host::error::{Failure, Kind, printable, status, tool_status};
use pyo3::PyTypeInfo;
use pyo3::prelude::*;
use pyo3::types::PyType;

/// Those of `pkm/errors.py`; each takes message, row, file, line, column.
mod python {
    use pyo3::import_exception;

    import_exception!(pkm.errors, UsageError);
    import_exception!(pkm.errors, InputError);
    import_exception!(pkm.errors, OutOfTravelError);
    import_exception!(pkm.errors, UnreachableError);
    import_exception!(pkm.errors, SingularError);
    import_exception!(pkm.errors, NotFiniteError);
    import_exception!(pkm.errors, NoStiffnessError);
    import_exception!(pkm.errors, OtherError);
    import_exception!(pkm.errors, Warning);
    import_exception!(pkm.errors, ExtrapolationWarning);
}

/// Message, row, file, line, column.
type Arguments = (String, Option<usize>, Option<String>, Option<u64>, Option<String>);

/// A failure of the host's library.
pub fn of(failure: &Failure) -> PyErr {
    let Failure { file, line, column, .. } = failure;
    let place = (failure.to_string(), None::<usize>, file.clone(), *line, column.clone());
    match failure.kind {
        Kind::Usage => python::UsageError::new_err(place),
        Kind::Input => python::InputError::new_err(place),
        Kind::Refused(status) => refused(status, place),
        Kind::Other => python::OtherError::new_err(place),
    }
}

/// Bad arguments.
pub fn usage(message: String) -> PyErr {
    python::UsageError::new_err((message,))
}

/// Warns as the program does.
pub fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    warn_as(py, &python::Warning::type_object(py), text)
}

/// Warns that poses lie outside a table's box.
pub fn warn_of_extrapolation(py: Python<'_>, text: &str) -> PyResult<()> {
    warn_as(py, &python::ExtrapolationWarning::type_object(py), text)
}

fn warn_as(py: Python<'_>, category: &Bound<'_, PyType>, text: &str) -> PyResult<()> {
    PyErr::warn(py, category, &CString::new(printable(text))?, 1)
}

/// A refused row of a batch.
pub struct Refusal {
    status: &'static str,
    message: String,
}

impl Refusal {
    /// The matrix is not finite or not positive definite.
    pub fn no_stiffness(message: impl ToString) -> Self {
        Self { status: "no_stiffness", message: message.to_string() }
    }

    /// The same refusal with another message.
    pub fn saying(self, message: String) -> Self {
        Self { message, ..self }
    }

    /// As the exception of its status, with the row's number, from 0, behind what `argument` says.
    pub fn at_row(self, argument: &str, row: usize) -> PyErr {
        refused(self.status, (format!("{argument}row {row}: {}", self.message), Some(row), None, None, None))
    }
}

fn refused(status: &str, arguments: Arguments) -> PyErr {
    match status {
        "out_of_travel" => python::OutOfTravelError::new_err(arguments),
        "singular" => python::SingularError::new_err(arguments),
        "not_finite" => python::NotFiniteError::new_err(arguments),
        "no_stiffness" => python::NoStiffnessError::new_err(arguments),
        _ => python::UnreachableError::new_err(arguments),
    }
}

impl From<Failure> for Refusal {
    fn from(failure: Failure) -> Self {
        Self { status: failure.kind.name(), message: failure.message }
    }
}

impl From<KinematicsError> for Refusal {
    fn from(error: KinematicsError) -> Self {
        Self { status: status(error), message: error.to_string() }
    }
}

impl From<ToolError> for Refusal {
    fn from(error: ToolError) -> Self {
        let status = if error == ToolError::NotFinite { "not_finite" } else { tool_status(error) };
        Self { status, message: error.to_string() }
    }
}

impl From<StiffnessError> for Refusal {
    fn from(error: StiffnessError) -> Self {
        match error {
            StiffnessError::Kinematics(error) => error.into(),
            StiffnessError::NotFinite => Self { status: "not_finite", message: error.to_string() },
            error => Self::no_stiffness(error),
        }
    }
}

impl From<CorrectionError> for Refusal {
    fn from(error: CorrectionError) -> Self {
        match error {
            CorrectionError::Stiffness(error) => error.into(),
            error => Self::no_stiffness(error),
        }
    }
}
