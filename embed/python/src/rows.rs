//! Arrays in and out: a row for each pose.

use numpy::ndarray::ArrayView;
use numpy::{AllowTypeChange, IxDyn, PyArray1, PyArray2, PyArray3, PyArrayLikeDyn, PyArrayMethods};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::errors::{Refusal, usage};

/// What a user gives for an array of floats: anything that `numpy.asarray` takes.
pub type Given<'py> = Bound<'py, PyAny>;

/// Not by the signature, whose errors have no name of the argument and are Python's own.
fn floats<'py>(name: &str, given: &Given<'py>) -> PyResult<PyArrayLikeDyn<'py, f64, AllowTypeChange>> {
    let py = given.py();
    // the conversion takes what is beneath a mask
    if py.import("numpy.ma")?.call_method1("is_masked", (given,))?.is_truthy()? {
        return Err(usage(format!("{name}: elements are masked; leave their rows out")));
    }
    given.extract().map_err(|error: PyErr| {
        let is_of_the_argument = error.is_instance_of::<PyTypeError>(py)
            || error.is_instance_of::<PyValueError>(py)
            || error.is_instance_of::<PyOverflowError>(py);
        if is_of_the_argument { usage(format!("{name}: {}", error.value(py))) } else { error }
    })
}

/// A copy of an array of shape (n, N), which Python may change while the GIL is released.
pub fn rows<const N: usize>(name: &str, given: &Given<'_>) -> PyResult<Vec<[f64; N]>> {
    let floats = floats(name, given)?;
    let array = floats.as_array();
    match array.shape() {
        [_, columns] if *columns == N => Ok(chunks(array)),
        shape => Err(usage(format!("{name}: expected an array of shape (n, {N}), found {shape:?}"))),
    }
}

/// The same with one row for all: of shape (N,) too.
pub fn rows_for<const N: usize>(name: &str, given: &Given<'_>, count: usize) -> PyResult<Vec<[f64; N]>> {
    let floats = floats(name, given)?;
    let array = floats.as_array();
    match array.shape() {
        [columns] if *columns == N => Ok(chunks(array).repeat(count)),
        [rows, columns] if (*rows, *columns) == (count, N) => Ok(chunks(array)),
        shape => Err(usage(format!("{name}: expected an array of shape ({count}, {N}) or ({N},), found {shape:?}"))),
    }
}

fn chunks<const N: usize>(array: ArrayView<'_, f64, IxDyn>) -> Vec<[f64; N]> {
    let numbers: Vec<f64> = array.iter().copied().collect();
    numbers.as_chunks().0.to_vec()
}

/// Computes a row for each, without the GIL.
///
/// # Errors
/// The first row that is refused. No row is ever NaN.
pub fn each<I: Sync, T: Send>(
    py: Python<'_>,
    inputs: &[I],
    compute: impl Fn(&I) -> Result<T, Refusal> + Sync + Send,
) -> PyResult<Vec<T>> {
    each_of(py, "", inputs, compute)
}

/// The same of an argument beside the one that the rows are of: errors begin with `argument`.
pub fn each_of<I: Sync, T: Send>(
    py: Python<'_>,
    argument: &str,
    inputs: &[I],
    compute: impl Fn(&I) -> Result<T, Refusal> + Sync + Send,
) -> PyResult<Vec<T>> {
    let computed = py.detach(|| {
        let mut results = Vec::with_capacity(inputs.len());
        for (row, input) in inputs.iter().enumerate() {
            results.push(compute(input).map_err(|refusal| (row, refusal))?);
        }
        Ok(results)
    });
    computed.map_err(|(row, refusal): (usize, Refusal)| refusal.at_row(argument, row))
}

/// As an array of shape (n, N).
pub fn array<'py, const N: usize>(py: Python<'py>, rows: Vec<[f64; N]>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let count = rows.len();
    PyArray1::from_vec(py, rows.into_flattened()).reshape([count, N])
}

/// As an array of shape (n, 6, 6).
pub fn matrices<'py>(py: Python<'py>, rows: Vec<[[f64; 6]; 6]>) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let count = rows.len();
    PyArray1::from_vec(py, rows.into_flattened().into_flattened()).reshape([count, 6, 6])
}
