//! Weights of a cost as they come from Python.

use ilc_rt::learning::weights::Weight;
use numpy::IntoPyArray;
use numpy::ndarray::{Array1, Array3};
use pyo3::prelude::*;

use crate::argument::{Matrix, give_matrix, misfit, read_array};

/// Reads a number, `(n,)`, `(p, p)` or `(n, p, p)`.
pub(crate) fn read_weight(
    name: &str,
    object: &Bound<'_, PyAny>,
    n_samples: usize,
    n_channels: usize,
) -> PyResult<Weight> {
    let (values, shape) = read_array(name, object)?;
    let (n, p) = (n_samples, n_channels);
    let block = |values: &[f64]| Matrix::from_row_slice(p, p, values);
    match shape[..] {
        [] => Ok(Weight::Scalar(values[0])),
        [length] if length == n => Ok(Weight::PerSample(values)),
        [rows, cols] if (rows, cols) == (p, p) => Ok(Weight::Block(block(&values))),
        [length, rows, cols] if (length, rows, cols) == (n, p, p) => {
            Ok(Weight::Blocks(values.chunks_exact((p * p).max(1)).map(block).collect()))
        }
        _ => Err(misfit(name, &shape, &format!("(), ({n},), ({p}, {p}) or ({n}, {p}, {p})"))),
    }
}

/// Returns a weight to Python in the shape in which it came.
pub(super) fn give_weight<'py>(py: Python<'py>, weight: &Weight) -> PyResult<Bound<'py, PyAny>> {
    Ok(match weight {
        Weight::Scalar(value) => value.into_pyobject(py)?.into_any(),
        Weight::PerSample(values) => Array1::from(values.clone()).into_pyarray(py).into_any(),
        Weight::Block(block) => give_matrix(py, block),
        Weight::Blocks(blocks) => {
            let p = blocks.first().map_or(0, Matrix::nrows);
            Array3::from_shape_fn((blocks.len(), p, p), |(k, row, col)| blocks[k][(row, col)])
                .into_pyarray(py)
                .into_any()
        }
    })
}
