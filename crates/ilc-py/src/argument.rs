//! Arrays among the arguments: each read, and refused, under its own name.

use std::ops::Deref;

use ilc_rt::model::StateSpace;
use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// The matrix type of `ilc-rt`.
pub(crate) type Matrix = nalgebra::DMatrix<f64>;

/// Channels of the input and of the output or error, of a model or a law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Channels {
    pub(crate) n_inputs: usize,
    pub(crate) n_outputs: usize,
}

impl Channels {
    /// Returns the channels of a model.
    pub(crate) fn of(model: &StateSpace) -> Self {
        Self { n_inputs: model.n_inputs(), n_outputs: model.n_outputs() }
    }
}

/// Samples and channels of a signal, and true if it has a channel axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(crate) n_samples: usize,
    pub(crate) n_channels: usize,
    pub(crate) is_flat: bool,
}

impl Layout {
    /// Reads `(n_samples,)` or `(n_samples, n_channels)`.
    pub(crate) fn of(name: &str, shape: &[usize]) -> PyResult<Self> {
        let (n_samples, n_channels, is_flat) = match *shape {
            [n_samples] => (n_samples, 1, true),
            [n_samples, n_channels] => (n_samples, n_channels, false),
            _ => return Err(misfit(name, shape, "(n_samples,) or (n_samples, n_channels)")),
        };
        if n_samples * n_channels == 0 {
            return Err(misfit(name, shape, "at least one sample of one channel"));
        }
        Ok(Self { n_samples, n_channels, is_flat })
    }

    /// Refuses any other number of samples.
    pub(crate) fn require_samples(self, name: &str, n_samples: usize) -> PyResult<()> {
        let rule = || format!("({n_samples},) or ({n_samples}, n_channels)");
        self.require(name, self.n_samples == n_samples, rule)
    }

    /// Refuses any other number of channels.
    pub(crate) fn require_channels(self, name: &str, n_channels: usize) -> PyResult<()> {
        self.require(name, self.n_channels == n_channels, || format!("(n_samples, {n_channels})"))
    }

    /// Refuses any other size.
    pub(crate) fn require_exactly(
        self,
        name: &str,
        n_samples: usize,
        n_channels: usize,
    ) -> PyResult<()> {
        let fits = (self.n_samples, self.n_channels) == (n_samples, n_channels);
        self.require(name, fits, || format!("({n_samples}, {n_channels})"))
    }

    fn require(self, name: &str, fits: bool, rule: impl FnOnce() -> String) -> PyResult<()> {
        if fits { Ok(()) } else { Err(misfit(name, &self.shape(), &rule())) }
    }

    /// Returns the original shape.
    pub(crate) fn shape(self) -> Vec<usize> {
        if self.is_flat { vec![self.n_samples] } else { vec![self.n_samples, self.n_channels] }
    }
}

/// A signal, time first, with its original layout.
#[derive(Debug)]
pub(crate) struct Signal {
    pub(crate) values: Vec<f64>,
    pub(crate) layout: Layout,
}

impl Deref for Signal {
    type Target = Layout;
    fn deref(&self) -> &Layout {
        &self.layout
    }
}

impl Signal {
    /// Reads `(n_samples,)` or `(n_samples, n_channels)`.
    pub(crate) fn read(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (values, array) = finite(name, object)?;
        Layout::of(name, array.shape()).map(|layout| Self { values, layout })
    }

    /// Refuses any other number of channels.
    pub(crate) fn with_channels(self, name: &str, n_channels: usize) -> PyResult<Self> {
        self.require_channels(name, n_channels).map(|()| self)
    }

    /// Refuses any other number of samples.
    pub(crate) fn with_samples(self, name: &str, n_samples: usize) -> PyResult<Self> {
        self.require_samples(name, n_samples).map(|()| self)
    }
}

/// Reads a matrix; a single number stands for a 1 x 1 one.
pub(crate) fn read_matrix(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Matrix> {
    let (values, shape) = read_array(name, object)?;
    match shape[..] {
        [] => Ok(Matrix::from_element(1, 1, values[0])),
        [rows, cols] => Ok(Matrix::from_row_slice(rows, cols, &values)),
        _ => Err(misfit(name, &shape, "two axes, (rows, columns)")),
    }
}

/// Reads a list of numbers with exactly one axis.
pub(crate) fn read_vector(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let (values, array) = finite(name, object)?;
    if array.ndim() == 1 { Ok(values) } else { Err(misfit(name, array.shape(), "one axis, (n,)")) }
}

/// Reads two numbers.
pub(crate) fn read_pair(name: &str, object: &Bound<'_, PyAny>) -> PyResult<[f64; 2]> {
    match read_vector(name, object)?[..] {
        [first, second] => Ok([first, second]),
        ref other => Err(misfit(name, &[other.len()], "(2,)")),
    }
}

/// Reads a disturbance: a single number or a list of them.
pub(crate) fn read_disturbance(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let (values, shape) = read_array(name, object)?;
    if shape.len() <= 1 && !values.is_empty() {
        return Ok(values);
    }
    Err(misfit(name, &shape, "a number or (n_disturbances,)"))
}

/// Returns the exception for an argument of the wrong shape.
pub(crate) fn misfit(name: &str, shape: &[usize], allowed: &str) -> PyErr {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    PyValueError::new_err(format!(
        "{name} has shape ({}{comma}); {allowed} is needed",
        lengths.join(", ")
    ))
}

/// Reads any array of finite float64 or integers in row-major order.
pub(crate) fn read_array(
    name: &str,
    object: &Bound<'_, PyAny>,
) -> PyResult<(Vec<f64>, Vec<usize>)> {
    finite(name, object).map(|(values, array)| (values, array.shape().to_vec()))
}

/// Reads finite numbers, and returns their array as well.
fn finite<'py>(
    name: &str,
    object: &Bound<'py, PyAny>,
) -> PyResult<(Vec<f64>, Bound<'py, PyArrayDyn<f64>>)> {
    let array = in_order(name, object)?;
    let values = array.to_vec()?;
    refuse_infinite(name, &values, array.shape())?;
    Ok((values, array))
}

/// Refuses infinite or NaN numbers in a row-major array.
pub(crate) fn refuse_infinite(name: &str, values: &[f64], shape: &[usize]) -> PyResult<()> {
    // One pass without branches: a sum of `x * 0` is 0 unless an `x` is infinite or NaN. Several
    // partial sums, because each addition would wait for the previous one.
    let chunks = values.chunks_exact(16);
    let rest = chunks.remainder();
    let mut poison = [0.0; 16];
    for chunk in chunks {
        for (sum, value) in poison.iter_mut().zip(chunk) {
            *sum += value * 0.0;
        }
    }
    if poison.iter().chain(rest).all(|value| value.is_finite()) {
        return Ok(());
    }
    let index = values.iter().position(|value| !value.is_finite()).unwrap_or(0);
    Err(PyValueError::new_err(format!(
        "{name} holds {} at {}; only finite numbers are allowed",
        values[index],
        place(index, shape)
    )))
}

/// Reads any array of float64 or integers in row-major order, including infinite numbers and NaN.
pub(crate) fn read_numbers(
    name: &str,
    object: &Bound<'_, PyAny>,
) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let array = in_order(name, object)?;
    Ok((array.to_vec()?, array.shape().to_vec()))
}

/// Returns an array of float64 in row-major order: the given one itself, if it is one.
pub(crate) fn in_order<'py>(
    name: &str,
    object: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    if let Ok(array) = object.cast::<PyArrayDyn<f64>>()
        && array.is_c_contiguous()
        && array.data().is_aligned()
    {
        return Ok(array.clone());
    }
    converted(name, object)
}

fn converted<'py>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (object,)).map_err(|error| {
        PyValueError::new_err(format!("{name} is no array of numbers: {error}"))
    })?;
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    let size: usize = dtype.getattr("itemsize")?.extract()?;
    // An empty list is float64 already; narrower floats are widened without loss, and integers are
    // exact within the range of set points.
    if !(matches!(kind.as_str(), "i" | "u") || kind == "f" && size <= 8) {
        return Err(PyTypeError::new_err(format!(
            "{name} has dtype {dtype}; float64, or what widens to it, is needed"
        )));
    }
    let array = array.call_method1("astype", ("float64", "C", "unsafe", false, false))?;
    let array = array.cast_into::<PyArrayDyn<f64>>()?;
    if array.data().is_aligned() {
        return Ok(array);
    }
    Ok(array.call_method0("copy")?.cast_into::<PyArrayDyn<f64>>()?)
}

/// Returns the position of a flat index in Python's notation.
fn place(index: usize, shape: &[usize]) -> String {
    let mut rest = index;
    let mut indices = Vec::new();
    for length in shape.iter().rev() {
        indices.push((rest % length).to_string());
        rest /= length;
    }
    indices.reverse();
    format!("[{}]", indices.join(", "))
}
