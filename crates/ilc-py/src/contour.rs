//! Contour geometry: `contour_error`, `coupling_gains`, `projection_across`, `Line`, `Arc`.

use ilc_rt::trajectory::contour::{Arc, ContourError, Line, SampledPath, Shape, coupling};
use ilc_rt::trajectory::{MAX_AXES, contour_error_m};
use numpy::IntoPyArray;
use numpy::ndarray::Array3;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::argument::{Signal, give_signal, misfit, read_vector};
use crate::arguments::{Arguments, Keywords};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::Made;
use crate::whole::whole;

#[pyclass(name = "Line", module = "ilc_rt._native", subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyLine(Line, Made);

#[pymethods]
impl PyLine {
    #[new]
    #[pyo3(signature = (**keywords))]
    fn new(keywords: Option<Keywords<'_, '_>>) -> PyResult<Self> {
        let a = Arguments::of(keywords)?;
        let point = |name: &str| read_point(name, &a.get(name)?);
        Ok(Self(Line { from_m: point("from_m")?, to_m: point("to_m")? }, Made::of(a)?))
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().1.reduce(slf.get_type().as_any())
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.1.shown(py, "Line")
    }
}

#[pyclass(name = "Arc", module = "ilc_rt._native", subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyArc(Arc, Made);

#[pymethods]
impl PyArc {
    #[new]
    #[pyo3(signature = (**keywords))]
    fn new(keywords: Option<Keywords<'_, '_>>) -> PyResult<Self> {
        let a = Arguments::of(keywords)?;
        let point = |name: &str| read_point(name, &a.get(name)?);
        let axis = a.maybe("axis", read_point)?.unwrap_or([0.0, 0.0, 1.0]);
        let arc = Arc::new(point("from_m")?, point("centre_m")?, axis, a.number("sweep_rad")?);
        Ok(Self(arc.or_raise()?, Made::of(a)?))
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().1.reduce(slf.get_type().as_any())
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.1.shown(py, "Arc")
    }
}

#[pyfunction(signature = (reference_m, actual_m, window=None))]
pub(crate) fn contour_error<'py>(
    py: Python<'py>,
    reference_m: &Bound<'py, PyAny>,
    actual_m: &Bound<'py, PyAny>,
    window: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let window = window.map(|window| whole("window", window)).transpose()?;
    if let Some(shapes) = read_shapes(reference_m, window)? {
        let points = read_points("actual_m", actual_m)?;
        let errors = detached(py, || Shape::contour_error_m(&shapes, &points));
        return give_signal(py, errors, 1, true);
    }
    let reference = read_path("reference_m", reference_m)?;
    let n_axes = reference.n_channels;
    let actual = read_path("actual_m", actual_m)?.with_channels("actual_m", n_axes)?;
    let errors = match (window, n_axes) {
        (Some(window), 1..=MAX_AXES) => {
            detached(py, || contour_error_m(&reference.values, &actual.values, n_axes, window))
        }
        (None, 2) => to_sampled::<2>(py, &reference, &actual)?,
        (None, 3) => to_sampled::<3>(py, &reference, &actual)?,
        (None, _) => {
            let allowed = "2 or 3 axes, or 1 to 12 with a window,";
            return Err(misfit("reference_m", &reference.shape(), allowed));
        }
        (Some(_), _) => return Err(misfit("reference_m", &reference.shape(), "1 to 12 axes")),
    };
    give_signal(py, errors, 1, true)
}

#[pyfunction]
pub(crate) fn coupling_gains<'py>(
    py: Python<'py>,
    reference_m: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let reference = read_path("reference_m", reference_m)?.with_channels("reference_m", 2)?;
    let gains = coupling::coupling_gains(reference.values.as_chunks().0);
    give_signal(py, gains.concat(), 2, false)
}

#[pyfunction]
pub(crate) fn projection_across<'py>(
    py: Python<'py>,
    reference_m: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let reference = read_path("reference_m", reference_m)?;
    let flat: Vec<f64> = match reference.n_channels {
        2 => coupling::across::<2>(reference.values.as_chunks().0).concat().concat(),
        3 => coupling::across::<3>(reference.values.as_chunks().0).concat().concat(),
        _ => {
            return Err(misfit("reference_m", &reference.shape(), "(n_samples, 2 or 3)"));
        }
    };
    let shape = (reference.n_samples, reference.n_channels, reference.n_channels);
    let blocks = Array3::from_shape_vec(shape, flat)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(blocks.into_pyarray(py).into_any())
}

fn to_sampled<const N: usize>(
    py: Python<'_>,
    reference: &Signal,
    actual: &Signal,
) -> PyResult<Vec<f64>> {
    detached(py, || {
        let path = SampledPath::<N>::new(reference.values.as_chunks().0)?;
        let points = actual.values.as_chunks().0.iter();
        let distance = |p| path.nearest(p).map_or(f64::NAN, |found| found.distance_m);
        Ok::<Vec<f64>, ContourError>(points.map(distance).collect())
    })
    .or_raise()
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
    let mut shapes = Vec::with_capacity(list.len());
    for item in list {
        if let Ok(line) = item.cast::<PyLine>() {
            shapes.push(Shape::Line(line.get().0));
        } else if let Ok(arc) = item.cast::<PyArc>() {
            shapes.push(Shape::Arc(arc.get().0));
        } else {
            return Ok(None);
        }
    }
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
