//! Numbers among the arguments: each refused under its own name, with a sentence.

use pyo3::Borrowed;
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyString};

/// Reads a count, an index or an order: Python's integers, NumPy's, or any object with `__index__`.
///
/// # Errors
/// - `TypeError` for a bool, a float, or any other non-integer.
/// - `ValueError` for a number that is negative or too large.
pub(crate) fn whole(name: &str, object: &Bound<'_, PyAny>) -> PyResult<usize> {
    #[expect(clippy::cast_possible_truncation, reason = "at most 32 bits")]
    within(name, object, u32::MAX.into()).map(|value| value as usize)
}

/// Reads the identity of a run.
pub(crate) fn id(object: &Bound<'_, PyAny>) -> PyResult<i64> {
    within("id", object, i64::MAX.unsigned_abs()).map(u64::cast_signed)
}

fn within(name: &str, object: &Bound<'_, PyAny>, max: u64) -> PyResult<u64> {
    let needed = format!("a whole number from 0 to {max}");
    let refused = || refused(name, object, &needed);
    if object.is_instance_of::<PyBool>() || object.is_instance_of::<PyFloat>() {
        return Err(refused());
    }
    let number = object.call_method0("__index__").map_err(|_| refused())?;
    number.extract().ok().filter(|value| *value <= max).ok_or_else(|| {
        PyValueError::new_err(format!("{name} = {}; {needed} is needed", shown(&number)))
    })
}

/// Returns the repr of a value, in one line of bounded length.
pub(crate) fn shown(object: &Bound<'_, PyAny>) -> String {
    const LONGEST: usize = 60;
    // A number of thousands of digits has no text.
    let text = object.repr().map_or_else(|_| "a number".to_owned(), |text| text.to_string());
    let mut line: String = text.chars().filter(|c| !c.is_control()).take(LONGEST).collect();
    if line.len() < text.len() {
        line.push_str("...");
    }
    line
}

/// Reads the elements of a sequence.
pub(crate) fn each<'py, T>(
    name: &str,
    object: &Bound<'py, PyAny>,
    needed: &str,
    read: impl Fn(&Bound<'py, PyAny>) -> PyResult<T>,
) -> PyResult<Vec<T>> {
    let refused =
        |_| PyTypeError::new_err(format!("{name} = {}; {needed} is needed", shown(object)));
    object.try_iter().map_err(refused)?.map(|element| read(&element?)).collect()
}

/// Reads a pair.
pub(crate) fn pair<'py>(
    name: &str,
    object: &Bound<'py, PyAny>,
    needed: &str,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    object.extract().map_err(|_| {
        PyTypeError::new_err(format!("{name} holds {}; {needed} is needed", shown(object)))
    })
}

/// Reads a number: Python's, NumPy's, or any object with `__float__`.
///
/// # Errors
/// - `TypeError` for anything but a number.
/// - `ValueError` for an integer beyond the largest float.
pub(crate) fn number(name: &str, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    if object.is_instance_of::<PyString>() {
        return Err(refused(name, object, "a number"));
    }
    object.extract::<f64>().map_err(|error| {
        if !error.is_instance_of::<PyOverflowError>(object.py()) {
            return refused(name, object, "a number");
        }
        let line = format!("{name} = {}; only finite numbers are allowed", shown(object));
        PyValueError::new_err(line)
    })
}

/// Refuses a number that is not finite.
pub(crate) fn finite(name: &str, value: f64) -> PyResult<f64> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(PyValueError::new_err(format!("{name} = {value}; only finite numbers are allowed")))
}

/// Refuses a number that is not finite and above 0.
pub(crate) fn positive(name: &str, value: f64) -> PyResult<f64> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(PyValueError::new_err(format!("{name} = {value}; it must be finite and above 0")))
}

/// A number without a name of its own, within the range of a float.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Real(pub(crate) f64);

impl<'py> FromPyObject<'_, 'py> for Real {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        number("number", &object).map(Self)
    }
}

pub(crate) fn refused(name: &str, object: &Bound<'_, PyAny>, needed: &str) -> PyErr {
    let kind = object.get_type().name().map_or_else(|_| "object".to_owned(), |n| n.to_string());
    let text = shown(object);
    PyTypeError::new_err(format!("{name} = {text} is a {kind}; {needed} is needed"))
}
