//! Exchange of an update's arrays between NumPy and a law.
//!
//! Row-major arrays of float64 are read in place. Updates that take long run with the interpreter
//! released, on a copy, as other Python threads may write into the arrays meanwhile. The memory of the
//! copies is kept from update to update: fresh memory of this size costs more than the update itself.

use std::ops::Range;

use ilc_rt::learning::LearningError;
use numpy::{IxDyn, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyTuple;

use super::Readable;
use crate::argument::{Layout, in_order, misfit, refuse_infinite};
use crate::detached::detached;

/// Number of values up to which a new array is cleared in less time than `numpy.empty` is called.
const SHORT: usize = 4096;
/// Values copied and checked at a time: they stay in the first-level cache.
const PIECE: usize = 2048;

/// A signal of Python, read in place.
pub(super) struct Given<'py> {
    name: &'static str,
    array: PyReadonlyArrayDyn<'py, f64>,
    pub(super) layout: Layout,
}

impl<'py> Given<'py> {
    /// Reads `(n_samples,)` or `(n_samples, n_channels)` of numbers, finite or not.
    fn of(name: &'static str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = in_order(name, object)?;
        // Refused while the update of another thread writes into it as its `out`.
        let array = array.try_readonly()?;
        let layout = Layout::of(name, array.shape())?;
        Ok(Self { name, array, layout })
    }

    /// Reads `(n_samples,)` or `(n_samples, n_channels)` of finite numbers.
    pub(super) fn read(name: &'static str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let given = Self::of(name, object)?;
        refuse_infinite(name, given.values()?, given.array.shape())?;
        Ok(given)
    }

    pub(super) fn values(&self) -> PyResult<&[f64]> {
        Ok(self.array.as_slice()?)
    }

    /// Copies finite numbers; refuses others.
    fn copy_to(&self, copy: &mut Vec<f64>) -> PyResult<()> {
        let values = self.values()?;
        copy.clear();
        for piece in values.chunks(PIECE) {
            if refuse_infinite(self.name, piece, &[piece.len()]).is_err() {
                // Named by its place in the whole.
                return refuse_infinite(self.name, values, self.array.shape());
            }
            copy.extend_from_slice(piece);
        }
        Ok(())
    }
}

/// Memory of the copies of input and error.
#[derive(Debug, Default)]
pub(super) struct Copies {
    input: Vec<f64>,
    error: Vec<f64>,
}

/// The signals of one update.
pub(super) struct Signals<'py> {
    pub(super) input: Given<'py>,
    pub(super) error: Given<'py>,
    /// Array of the next input; a new one if it is not given.
    out: Option<Out<'py>>,
    /// True if input and error have been copied.
    are_copied: bool,
}

/// An array of the caller for the next input.
struct Out<'py> {
    array: Bound<'py, PyArrayDyn<f64>>,
    /// True if it is the array of the input.
    is_input: bool,
}

impl<'py> Signals<'py> {
    /// Reads the signals, of finite numbers; copies them if they have more than `in_place_max` values.
    pub(super) fn read(
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        copies: &mut Copies,
        in_place_max: usize,
    ) -> PyResult<Self> {
        let (input, error) = (Given::of("u", u)?, Given::of("e", e)?);
        let out = out.map(|out| Out::read(out, &input, &error)).transpose()?;
        let mut signals = Self { input, error, out, are_copied: false };
        if signals.len() > in_place_max {
            signals.copy(copies)?;
            signals.are_copied = true;
        } else {
            for given in [&signals.input, &signals.error] {
                refuse_infinite(given.name, given.values()?, given.array.shape())?;
            }
        }
        Ok(signals)
    }

    /// Returns the number of values of input and error.
    fn len(&self) -> usize {
        self.input.array.len() + self.error.array.len()
    }

    fn copy(&self, copies: &mut Copies) -> PyResult<()> {
        self.input.copy_to(&mut copies.input)?;
        self.error.copy_to(&mut copies.error)
    }

    /// Runs one update, and returns the next input, shaped as the input.
    pub(super) fn exchange(
        self,
        py: Python<'py>,
        law: &mut dyn Readable,
        copies: &mut Copies,
        calls_python: bool,
    ) -> PyResult<Result<Bound<'py, PyAny>, LearningError>> {
        let are_copied = self.are_copied;
        let is_input = self.out.as_ref().is_some_and(|out| out.is_input);
        let next = match &self.out {
            Some(out) => out.array.clone(),
            None if self.input.array.len() > SHORT => empty(py, self.input.array.shape())?,
            None => PyArrayDyn::<f64>::zeros(py, IxDyn(self.input.array.shape()), false),
        };
        // The first run may have made another law.
        let is_quick = !are_copied && self.len() <= law.in_place_max();
        if is_quick && !is_input && !calls_python {
            let mut place = next.try_readwrite()?;
            let place = place.as_slice_mut()?;
            let done = law.update(self.input.values()?, self.error.values()?, place);
            drop(self);
            return Ok(done.map(|()| next.into_any()));
        }
        if !are_copied {
            self.copy(copies)?;
        }
        // Ends the use of the arrays: one of them may be written now.
        drop(self);
        let Copies { input, error } = copies;
        let done = {
            let mut place = next.try_readwrite()?;
            let place = place.as_slice_mut()?;
            let done = detached(py, || law.update(input, error, place));
            if done.is_err() && is_input {
                place.copy_from_slice(input);
            }
            done
        };
        Ok(done.map(|()| next.into_any()))
    }
}

impl<'py> Out<'py> {
    /// Reads the array for the next input: of float64, row-major, writeable, shaped as the input, and in memory
    /// of its own or in that of the whole input.
    fn read(object: &Bound<'py, PyAny>, input: &Given, error: &Given) -> PyResult<Self> {
        let Ok(array) = object.cast::<PyArrayDyn<f64>>() else {
            let class = object.get_type().name()?;
            let dtype = object.getattr_opt("dtype")?.map(|dtype| format!(" of dtype {dtype}"));
            let dtype = dtype.unwrap_or_default();
            return Err(PyTypeError::new_err(format!(
                "out is a {class}{dtype}; an ndarray of float64 is needed"
            )));
        };
        if array.shape() != input.array.shape() {
            let needed = PyTuple::new(object.py(), input.array.shape())?;
            return Err(misfit("out", array.shape(), &format!("{needed}, as of u,")));
        }
        let flags = object.getattr("flags")?;
        let is_writeable: bool = flags.getattr("writeable")?.extract()?;
        if !(array.is_c_contiguous() && array.data().is_aligned() && is_writeable) {
            return Err(PyValueError::new_err(
                "out is a view with gaps, in another order or read-only; a writeable array in C order is needed",
            ));
        }
        let (own, of_input, of_error) = (place(array), place(&input.array), place(&error.array));
        let meets = |other: &Range<usize>| own.start < other.end && other.start < own.end;
        let is_input = own == of_input;
        for (name, is_met) in [("u", !is_input && meets(&of_input)), ("e", meets(&of_error))] {
            if is_met {
                return Err(PyValueError::new_err(format!(
                    "out shares memory with {name}; memory of its own, or all of u, is needed"
                )));
            }
        }
        Ok(Self { array: array.clone(), is_input })
    }
}

/// Addresses of the numbers of a contiguous array.
fn place(array: &Bound<'_, PyArrayDyn<f64>>) -> Range<usize> {
    let start = array.data().addr();
    start..start + array.len() * size_of::<f64>()
}

/// Returns a new array whose numbers are not set yet.
fn empty<'py>(py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    static EMPTY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let array = EMPTY.import(py, "numpy", "empty")?.call1((PyTuple::new(py, shape)?,))?;
    Ok(array.cast_into()?)
}
