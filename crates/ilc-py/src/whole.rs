//! Whole numbers among the arguments: each refused under its own name, with a sentence.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat};

/// The largest number that any count, index or order may be.
const MAX: u64 = u32::MAX as u64;

/// Reads a whole number: Python's, NumPy's, whatever has an index.
///
/// # Errors
/// - `TypeError` for a truth value, a float, or anything else that counts nothing.
/// - `ValueError` for a number that is negative or too large.
pub(crate) fn whole(name: &str, object: &Bound<'_, PyAny>) -> PyResult<usize> {
    let number = number(name, object, &format!("0 to {MAX}"))?;
    match number.extract::<u64>().ok().filter(|value| *value <= MAX) {
        #[expect(clippy::cast_possible_truncation, reason = "at most 32 bits")]
        Some(value) => Ok(value as usize),
        None => Err(out_of_range(name, &number, &format!("0 to {MAX}"))),
    }
}

/// Returns the integer that an object stands for.
fn number<'py>(name: &str, object: &Bound<'py, PyAny>, range: &str) -> PyResult<Bound<'py, PyAny>> {
    let refused = || {
        let kind = object.get_type().name().map_or_else(|_| "object".to_owned(), |n| n.to_string());
        let text = shown(object);
        PyTypeError::new_err(format!(
            "{name} = {text} is a {kind}; a whole number from {range} is needed"
        ))
    };
    if object.is_instance_of::<PyBool>() || object.is_instance_of::<PyFloat>() {
        return Err(refused());
    }
    object.call_method0("__index__").map_err(|_| refused())
}

fn out_of_range(name: &str, number: &Bound<'_, PyAny>, range: &str) -> PyErr {
    let text = shown(number);
    PyValueError::new_err(format!("{name} = {text}; a whole number from {range} is needed"))
}

/// Returns how a value shows itself, on one line and not for ever.
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

/// Reads two things that belong together.
pub(crate) fn pair<'py>(
    name: &str,
    object: &Bound<'py, PyAny>,
    needed: &str,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    object.extract().map_err(|_| {
        PyTypeError::new_err(format!("{name} holds {}; {needed} is needed", shown(object)))
    })
}

/// One reader for each name, as `from_py_with` takes them.
macro_rules! named {
    ($($name:ident),* $(,)?) => {
        $(pub(crate) fn $name(object: &Bound<'_, PyAny>) -> PyResult<usize> {
            whole(stringify!($name), object)
        })*
    };
}

/// The same for arguments that may be `None`.
macro_rules! named_maybe {
    ($($name:ident),* $(,)?) => {
        $(pub(crate) fn $name(object: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
            if object.is_none() { Ok(None) } else { whole(stringify!($name), object).map(Some) }
        })*
    };
}

named! {
    blend, input, keep, lead, n, n_agents, n_axes, n_poles, n_runs, n_samples, n_zeros,
    order, output, patience, periods, repeats, rows, top,
}

/// Arguments that may be `None`.
pub(crate) mod maybe {
    use super::{Bound, PyAny, PyAnyMethods, PyResult, whole};
    named_maybe! {
        n_samples, overlap_samples, period_samples, segment_samples, top, window,
    }
}

/// Sequences of whole numbers.
pub(crate) mod list {
    use super::{Bound, PyAny, PyResult, each, whole};

    pub(crate) fn starts(object: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
        each("starts", object, "a sequence of samples", |start| whole("starts", start))
    }
}

/// Sequences of whole numbers, or `None`.
pub(crate) mod maybe_list {
    use super::{Bound, PyAny, PyAnyMethods, PyResult, each, whole};

    pub(crate) fn axes(object: &Bound<'_, PyAny>) -> PyResult<Option<Vec<usize>>> {
        list("axes", object)
    }

    pub(crate) fn leaders(object: &Bound<'_, PyAny>) -> PyResult<Option<Vec<usize>>> {
        list("leaders", object)
    }

    fn list(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Option<Vec<usize>>> {
        if object.is_none() {
            return Ok(None);
        }
        each(name, object, "a sequence of numbers counted from 0", |i| whole(name, i)).map(Some)
    }
}

/// Sequences of pairs, or `None`.
pub(crate) mod maybe_pairs {
    use super::{Bound, PyAny, PyAnyMethods, PyResult, each, pair, whole};

    pub(crate) fn pairs(object: &Bound<'_, PyAny>) -> PyResult<Option<Vec<(usize, usize)>>> {
        if object.is_none() {
            return Ok(None);
        }
        let needed = "a sequence of pairs of agents";
        let read = |both: &Bound<'_, PyAny>| {
            let (first, second) = pair("pairs", both, "a pair of agents")?;
            Ok((whole("pairs", &first)?, whole("pairs", &second)?))
        };
        each("pairs", object, needed, read).map(Some)
    }
}

/// Reads segments: where each starts, and its value.
pub(crate) fn segments(object: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, f64)>> {
    let needed = "a pair of a sample and a number";
    each("segments", object, "a sequence of (start, value)", |both| {
        let (start, value) = pair("segments", both, needed)?;
        let value = value.extract().map_err(|_| {
            PyTypeError::new_err(format!("segments holds {}; {needed} is needed", shown(both)))
        })?;
        Ok((whole("segments", &start)?, value))
    })
}

/// Reads a number of runs to make.
pub(crate) fn iterations(object: &Bound<'_, PyAny>) -> PyResult<u32> {
    let range = format!("1 to {}", u32::MAX);
    let number = number("iterations", object, &range)?;
    match number.extract::<u32>() {
        Ok(value) if value > 0 => Ok(value),
        _ => Err(out_of_range("iterations", &number, &range)),
    }
}

/// Reads the identity of a run.
pub(crate) fn id(object: &Bound<'_, PyAny>) -> PyResult<i64> {
    let range = format!("0 to {}", i64::MAX);
    let number = number("id", object, &range)?;
    match number.extract::<i64>() {
        Ok(value) if value >= 0 => Ok(value),
        _ => Err(out_of_range("id", &number, &range)),
    }
}
