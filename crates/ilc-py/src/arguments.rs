//! Arguments by name, as passed on in a dict by the typed functions and classes of Python.
//!
//! For every family of this crate: each argument is read, and refused, under its own name.
//! Signatures, defaults and documentation are those of the Python package.

use ilc_rt::learning::weights::Weight;
use ilc_rt::model::StateSpace;
use numpy::PyUntypedArray;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyList, PyString};
use pyo3::{Borrowed, CastError};

use crate::argument::{Matrix, Signal, misfit, read_array, read_pair, read_vector};
use crate::model_argument::read_model;
use crate::whole::{each, finite, number, pair, positive, refused, shown, whole};

/// The arguments of one call by name, handed over in a dict.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arguments<'a, 'py>(Borrowed<'a, 'py, PyDict>);

impl<'a, 'py> FromPyObject<'a, 'py> for Arguments<'a, 'py> {
    type Error = CastError<'a, 'py>;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> Result<Self, Self::Error> {
        object.cast().map(Self)
    }
}

impl<'a, 'py> Arguments<'a, 'py> {
    /// Wraps the arguments of a call.
    pub(crate) fn new(arguments: &'a Bound<'py, PyDict>) -> Self {
        Self(arguments.as_borrowed())
    }

    /// Returns the interpreter.
    pub(crate) fn py(self) -> Python<'py> {
        self.0.py()
    }

    /// Returns a required argument.
    pub(crate) fn get(self, name: &str) -> PyResult<Bound<'py, PyAny>> {
        self.0
            .get_item(name)?
            .ok_or_else(|| PyTypeError::new_err(format!("the argument {name} is missing")))
    }

    /// Returns an argument unless it is `None` or missing.
    pub(crate) fn given(self, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(self.0.get_item(name)?.filter(|value| !value.is_none()))
    }

    /// Applies a reader to an argument unless it is `None` or missing.
    pub(crate) fn maybe<T>(
        self,
        name: &str,
        read: impl FnOnce(&str, &Bound<'py, PyAny>) -> PyResult<T>,
    ) -> PyResult<Option<T>> {
        self.given(name)?.map(|value| read(name, &value)).transpose()
    }

    /// Reads a number, including infinity and NaN.
    pub(crate) fn number(self, name: &str) -> PyResult<f64> {
        number(name, &self.get(name)?)
    }

    /// Reads a number, or `None`.
    pub(crate) fn maybe_number(self, name: &str) -> PyResult<Option<f64>> {
        self.maybe(name, number)
    }

    /// Reads a finite number.
    pub(crate) fn finite(self, name: &str) -> PyResult<f64> {
        finite(name, self.number(name)?)
    }

    /// Reads a finite number above 0.
    pub(crate) fn positive(self, name: &str) -> PyResult<f64> {
        positive(name, self.number(name)?)
    }

    /// Reads a limit above 0; `None` is infinite.
    pub(crate) fn limit(self, name: &str) -> PyResult<f64> {
        self.maybe_number(name)?.map_or(Ok(f64::INFINITY), |value| positive(name, value))
    }

    /// Reads a whole number.
    pub(crate) fn whole(self, name: &str) -> PyResult<usize> {
        whole(name, &self.get(name)?)
    }

    /// Reads indices from 0, or `None`.
    pub(crate) fn maybe_wholes(self, name: &str) -> PyResult<Option<Vec<usize>>> {
        self.maybe(name, |name, list| {
            each(name, list, "a sequence of numbers counted from 0", |i| whole(name, i))
        })
    }

    /// Reads pairs of indices from 0, or `None`.
    pub(crate) fn maybe_pairs(self, name: &str) -> PyResult<Option<Vec<(usize, usize)>>> {
        self.maybe(name, |name, list| {
            each(name, list, "a sequence of pairs of agents", |both| {
                let (first, second) = pair(name, both, "a pair of agents")?;
                Ok((whole(name, &first)?, whole(name, &second)?))
            })
        })
    }

    /// Reads a bool.
    pub(crate) fn flag(self, name: &str) -> PyResult<bool> {
        let value = self.get(name)?;
        value.extract().map_err(|_| refused(name, &value, "True or False"))
    }

    /// Reads a text.
    pub(crate) fn text(self, name: &str) -> PyResult<String> {
        let value = self.get(name)?;
        value.extract().map_err(|_| refused(name, &value, "a text"))
    }

    /// Reads a text, or `None`.
    pub(crate) fn maybe_text(self, name: &str) -> PyResult<Option<String>> {
        if self.given(name)?.is_some() { self.text(name).map(Some) } else { Ok(None) }
    }

    /// Reads one of several words, each with its meaning.
    pub(crate) fn choice<T: Copy>(self, name: &str, choices: &[(&str, T)]) -> PyResult<T> {
        choice(name, &self.get(name)?, choices)
    }

    /// Reads a time-invariant model.
    pub(crate) fn model(self, name: &str) -> PyResult<StateSpace> {
        read_model(name, &self.get(name)?)
    }

    /// Reads a one-dimensional array of finite numbers.
    pub(crate) fn vector(self, name: &str) -> PyResult<Vec<f64>> {
        read_vector(name, &self.get(name)?)
    }

    /// Reads two numbers.
    pub(crate) fn pair(self, name: &str) -> PyResult<[f64; 2]> {
        read_pair(name, &self.get(name)?)
    }

    /// Reads a signal.
    pub(crate) fn signal(self, name: &str) -> PyResult<Signal> {
        Signal::read(name, &self.get(name)?)
    }

    /// Reads a weight: a number, `(n,)`, `(p, p)` or `(n, p, p)`.
    pub(crate) fn weight(
        self,
        name: &str,
        n_samples: usize,
        n_channels: usize,
    ) -> PyResult<Weight> {
        let (values, shape) = read_array(name, &self.get(name)?)?;
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

    /// Returns a copy that nothing changes later: lists and arrays are copied, NumPy's numbers are Python's.
    pub(crate) fn kept(self) -> PyResult<Bound<'py, PyDict>> {
        let kept = PyDict::new(self.py());
        for (name, value) in self.0.iter() {
            let value = if value.is_exact_instance_of::<PyFloat>() || value.is_none() {
                value
            } else if value.getattr_opt("ndim")?.is_some_and(|n| n.eq(0).unwrap_or(false)) {
                value.call_method0("item")?
            } else if value.is_exact_instance_of::<PyUntypedArray>() {
                value.call_method0("copy")?
            } else if value.is_instance_of::<PyList>() || value.hasattr("__array_interface__")? {
                self.py().import("copy")?.getattr("deepcopy")?.call1((value,))?
            } else {
                value
            };
            kept.set_item(name, value)?;
        }
        Ok(kept)
    }

    /// Returns the call in Python's notation, with arrays by their shapes.
    pub(crate) fn call(self, name: &str) -> PyResult<String> {
        let mut words = Vec::new();
        for (key, value) in self.0.iter() {
            let text = match value.getattr_opt("shape")? {
                Some(shape) if shape.len().is_ok_and(|axes| axes > 0) => {
                    format!("array of shape {}", shape.repr()?)
                }
                _ => value.repr()?.to_string(),
            };
            words.push(format!("{key}={text}"));
        }
        Ok(format!("{name}({})", words.join(", ")))
    }
}

/// Reads one of several words, each with its meaning.
pub(crate) fn choice<T: Copy>(
    name: &str,
    word: &Bound<'_, PyAny>,
    choices: &[(&str, T)],
) -> PyResult<T> {
    let text = word.cast::<PyString>().map_err(|_| refused(name, word, "a text"))?.to_str()?;
    if let Some((_, meaning)) = choices.iter().find(|(word, _)| *word == text) {
        return Ok(*meaning);
    }
    let words: Vec<String> = choices.iter().map(|(word, _)| format!("'{word}'")).collect();
    let words = words.join(", ");
    let (others, last) = words.rsplit_once(", ").unwrap_or(("", &words));
    let line = format!("{name} = {}; {others} or {last} is needed", shown(word));
    Err(PyValueError::new_err(line))
}

/// Reads a struct: its fields by their names, each with a reader of [`Arguments`], then others with their values.
///
/// `read!(a, PdGains: [number => kp, kd] [whole => lead_samples])`
macro_rules! read {
    ($a:expr, $of:ident: $([$reader:ident => $($field:ident),+ $(,)?])* $($name:ident: $value:expr),* $(,)?) => {
        $of { $($($field: $a.$reader(stringify!($field))?,)+)* $($name: $value,)* }
    };
}
pub(crate) use read;
