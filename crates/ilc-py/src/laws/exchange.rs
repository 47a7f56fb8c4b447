//! Exchange of an update's arrays between NumPy and a law.
//!
//! Row-major arrays of float64 are read in place. Long updates run with the interpreter released,
//! on a copy, as other Python threads may write into the arrays meanwhile.

use ilc_rt::learning::LearningError;
use numpy::{IxDyn, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::Readable;
use crate::argument::{Layout, in_order, refuse_infinite};
use crate::detached::detached;

/// Number of values up to which an update is faster than releasing the interpreter and copying.
const SHORT: usize = 2048;

/// A signal of Python, read in place.
pub(super) struct Given<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
    layout: Layout,
}

impl<'py> Given<'py> {
    /// Reads `(n_samples,)` or `(n_samples, n_channels)` of finite numbers.
    pub(super) fn read(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = in_order(name, object)?.readonly();
        let layout = Layout::of(name, array.shape())?;
        refuse_infinite(name, array.as_slice()?, array.shape())?;
        Ok(Self { array, layout })
    }

    pub(super) fn layout(&self) -> Layout {
        self.layout
    }

    pub(super) fn values(&self) -> PyResult<&[f64]> {
        Ok(self.array.as_slice()?)
    }
}

/// Runs one update, and returns the next input, shaped as `input`.
pub(super) fn exchange<'py>(
    py: Python<'py>,
    input: &Given<'py>,
    error: &Given<'py>,
    law: &mut dyn Readable,
    calls_python: bool,
) -> PyResult<Result<Bound<'py, PyAny>, LearningError>> {
    let next = PyArrayDyn::<f64>::zeros(py, IxDyn(input.array.shape()), false);
    let done = {
        let mut place = next.readwrite();
        let place = place.as_slice_mut()?;
        let (input, error) = (input.values()?, error.values()?);
        if calls_python || law.is_long() || input.len() + error.len() > SHORT {
            let (input, error) = (input.to_vec(), error.to_vec());
            detached(py, || law.update(&input, &error, place))
        } else {
            law.update(input, error, place)
        }
    };
    Ok(done.map(|()| next.into_any()))
}
