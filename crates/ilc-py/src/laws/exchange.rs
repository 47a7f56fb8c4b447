//! The arrays of one update: from Python to a law and back, each written once.
//!
//! For laws that take any length of run, so that a run of a million samples is no trouble; the other
//! files of this folder import it.

use ilc_rt::learning::LearningError;
use numpy::{IxDyn, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::argument::{Layout, misfit, private, refuse_infinite};
use crate::detached::detached;
use crate::error::OrRaise;

/// A signal in an array that nobody else knows, so that it stays as it is while other Python threads
/// run.
pub(super) struct Given<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
    layout: Layout,
}

impl<'py> Given<'py> {
    /// Reads `(n_samples,)` or `(n_samples, n_channels)` of finite numbers.
    pub(super) fn read(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = private(name, object)?.readonly();
        let layout = Layout::of(name, array.shape())?;
        refuse_infinite(name, array.as_slice()?, array.shape())?;
        Ok(Self { array, layout })
    }

    /// Refuses any other number of samples or channels.
    pub(super) fn of_size(self, name: &str, n_samples: usize, n_channels: usize) -> PyResult<Self> {
        if (self.layout.n_samples, self.layout.n_channels) == (n_samples, n_channels) {
            return Ok(self);
        }
        Err(misfit(name, self.array.shape(), &format!("({n_samples}, {n_channels})")))
    }

    /// Refuses what does not fit the input.
    pub(super) fn like(self, name: &str, input: &Self) -> PyResult<Self> {
        let Layout { n_samples, n_channels, .. } = input.layout;
        self.layout.require(name, n_samples, n_channels)?;
        Ok(self)
    }

    pub(super) fn layout(&self) -> Layout {
        self.layout
    }
}

/// Runs one update while other Python threads run, and returns the next input, shaped as `input`.
///
/// `work` is given the input, the error and the place for the next input.
pub(super) fn exchange<'py>(
    py: Python<'py>,
    input: &Given<'py>,
    error: &Given<'py>,
    work: impl FnOnce(&[f64], &[f64], &mut [f64]) -> Result<(), LearningError> + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let next = PyArrayDyn::<f64>::zeros(py, IxDyn(input.array.shape()), false);
    {
        let mut place = next.readwrite();
        let (input, error) = (input.array.as_slice()?, error.array.as_slice()?);
        let place = place.as_slice_mut()?;
        detached(py, || work(input, error, place)).or_raise()?;
    }
    Ok(next.into_any())
}
