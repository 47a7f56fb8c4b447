//! Contour geometry: `contour_error`, `coupling_gains`, `projection_across`, `Line`, `Arc`.

use ilc_rt::trajectory::contour::{Arc, Line, SampledPath, Shape, coupling};
use ilc_rt::trajectory::{MAX_AXES, contour_error_m};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::answer::{Array, give_matrices, give_signal, give_vector};
use crate::argument::{Signal, misfit, read_vector};
use crate::arguments::Arguments;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, New, made};
use crate::whole::whole;

#[pyclass(name = "Line", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyLine(Line);

#[pymethods]
impl PyLine {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let point = |name: &str| read_point(name, &a.get(name)?);
        made(a, Self(Line { from_m: point("from_m")?, to_m: point("to_m")? }))
    }
}

#[pyclass(name = "Arc", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyArc(Arc);

#[pymethods]
impl PyArc {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let point = |name: &str| read_point(name, &a.get(name)?);
        let axis = a.maybe("axis", read_point)?.unwrap_or([0.0, 0.0, 1.0]);
        let arc = Arc::new(point("from_m")?, point("centre_m")?, axis, a.number("sweep_rad")?);
        made(a, Self(arc.or_raise()?))
    }
}

#[pyfunction]
pub(crate) fn contour_error<'py>(a: Arguments<'_, 'py>) -> Array<'py> {
    let (py, path, actual_m) = (a.py(), a.get("reference_m")?, a.get("actual_m")?);
    let window = a.maybe("window", whole)?;
    if let Some(shapes) = read_shapes(&path, window)? {
        let points = read_points("actual_m", &actual_m)?;
        let errors = detached(py, || Shape::contour_error_m(&shapes, &points));
        return Ok(give_vector(py, errors));
    }
    let Signal { values: reference, layout } = read_path("reference_m", &path)?;
    let n_axes = layout.n_channels;
    let actual = read_path("actual_m", &actual_m)?.with_channels("actual_m", n_axes)?.values;
    let allowed = match window {
        None if !matches!(n_axes, 2 | 3) => "2 or 3 axes, or 1 to 12 with a window,",
        Some(_) if n_axes > MAX_AXES => "1 to 12 axes",
        _ => "",
    };
    if !allowed.is_empty() {
        return Err(misfit("reference_m", &layout.shape(), allowed));
    }
    let errors = detached(py, || match window {
        Some(window) => Ok(contour_error_m(&reference, &actual, n_axes, window)),
        None if n_axes == 2 => SampledPath::<2>::contour_error_m(&reference, &actual),
        None => SampledPath::<3>::contour_error_m(&reference, &actual),
    });
    Ok(give_vector(py, errors.or_raise()?))
}

#[pyfunction]
pub(crate) fn coupling_gains<'py>(reference_m: &Bound<'py, PyAny>) -> Array<'py> {
    let reference = read_path("reference_m", reference_m)?.with_channels("reference_m", 2)?;
    let gains = coupling::coupling_gains(reference.values.as_chunks().0);
    give_signal(reference_m.py(), gains.concat(), 2, false)
}

#[pyfunction]
pub(crate) fn projection_across<'py>(reference_m: &Bound<'py, PyAny>) -> Array<'py> {
    let reference = read_path("reference_m", reference_m)?;
    let flat: Vec<f64> = match reference.n_channels {
        2 => coupling::across::<2>(reference.values.as_chunks().0).concat().concat(),
        3 => coupling::across::<3>(reference.values.as_chunks().0).concat().concat(),
        _ => {
            return Err(misfit("reference_m", &reference.shape(), "(n_samples, 2 or 3)"));
        }
    };
    let n = reference.n_channels;
    let at = |k: usize, row, col| flat[(k * n + row) * n + col];
    Ok(give_matrices(reference_m.py(), (reference.n_samples, n, n), at))
}

/// Reads a path, always with a channel axis.
fn read_path(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Signal> {
    let signal = Signal::read(name, object)?;
    if signal.is_flat {
        return Err(misfit(name, &signal.shape(), "(n_samples, n_axes)"));
    }
    Ok(signal)
}

/// Reads points of 2 or 3 axes; a missing third coordinate is 0.
fn read_points(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 3]>> {
    let signal = read_path(name, object)?;
    match signal.n_channels {
        2 => Ok(signal.values.as_chunks::<2>().0.iter().map(|[x, y]| [*x, *y, 0.0]).collect()),
        3 => Ok(signal.values.as_chunks().0.to_vec()),
        _ => Err(misfit(name, &signal.shape(), "(n_samples, 2 or 3)")),
    }
}

fn read_point(name: &str, object: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    match read_vector(name, object)?[..] {
        [x, y] => Ok([x, y, 0.0]),
        [x, y, z] => Ok([x, y, z]),
        ref other => Err(misfit(name, &[other.len()], "(2,) or (3,)")),
    }
}

/// Reads a list of shapes; `None` for anything else.
fn read_shapes(object: &Bound<'_, PyAny>, window: Option<usize>) -> PyResult<Option<Vec<Shape>>> {
    let Ok(list) = object.cast::<PyList>() else { return Ok(None) };
    let shape = |item: Bound<'_, PyAny>| {
        let line = item.cast::<PyLine>().map(|line| Shape::Line(line.get().0));
        line.or_else(|_| item.cast::<PyArc>().map(|arc| Shape::Arc(arc.get().0))).ok()
    };
    let Some(shapes) = list.iter().map(shape).collect::<Option<Vec<Shape>>>() else {
        return Ok(None);
    };
    if shapes.is_empty() {
        return Err(PyValueError::new_err("reference_m is an empty list; a path is needed"));
    }
    if let Some(window) = window {
        return Err(PyValueError::new_err(format!(
            "window = {window}; exact pieces have no samples, so None is needed"
        )));
    }
    Ok(Some(shapes))
}
