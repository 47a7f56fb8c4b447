//! Values returned to Python, for every family of this crate: arrays, and figures by name.

use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{Element, IntoPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::argument::Matrix;

/// Figures by name, as returned to Python.
pub(crate) type ByName<'py> = PyResult<Bound<'py, PyDict>>;
/// An array, as returned to Python.
pub(crate) type Array<'py> = PyResult<Bound<'py, PyAny>>;

/// Returns figures by name: fields of structs under their own names, then others with their values.
///
/// `by_name!(py, [fit => residual_rms] delay_s: 0.0)`
macro_rules! by_name {
    ($py:expr, $([$of:expr => $($field:ident),+ $(,)?])* $($name:ident: $value:expr),* $(,)?) => {{
        let figures = ::pyo3::types::PyDict::new($py);
        $($(figures.set_item(stringify!($field), &$of.$field)?;)+)*
        $(figures.set_item(stringify!($name), $value)?;)*
        figures
    }};
}
pub(crate) use by_name;

/// Returns numbers to Python, as an array of one axis.
pub(crate) fn give_vector<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyAny> {
    Array1::from(values).into_pyarray(py).into_any()
}

/// Returns a time-first signal to Python, without channel axis if `is_flat`.
pub(crate) fn give_signal(
    py: Python<'_>,
    values: Vec<f64>,
    n_channels: usize,
    is_flat: bool,
) -> Array<'_> {
    if is_flat {
        return Ok(give_vector(py, values));
    }
    let shape = (values.len() / n_channels.max(1), n_channels);
    Array2::from_shape_vec(shape, values)
        .map(|array| array.into_pyarray(py).into_any())
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Returns a matrix to Python.
pub(crate) fn give_matrix<'py>(py: Python<'py>, matrix: &Matrix) -> Bound<'py, PyAny> {
    Array2::from_shape_fn(matrix.shape(), |at| matrix[at]).into_pyarray(py).into_any()
}

/// Returns matrices to Python, as an array of shape (count, rows, columns).
pub(crate) fn give_matrices<T: Element>(
    py: Python<'_>,
    shape: (usize, usize, usize),
    at: impl Fn(usize, usize, usize) -> T,
) -> Bound<'_, PyAny> {
    Array3::from_shape_fn(shape, |(k, row, col)| at(k, row, col)).into_pyarray(py).into_any()
}
