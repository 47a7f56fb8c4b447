//! Contour geometry: `contour_error`, `coupling_gains`, `projection_across`, `Line`, `Arc`.

use ilc_rt::trajectory::contour::{Arc, ContourError, Line, SampledPath, Shape, coupling};
use ilc_rt::trajectory::{MAX_AXES, contour_error_m};
use numpy::IntoPyArray;
use numpy::ndarray::Array3;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::argument::{Signal, give_signal, misfit, read_vector};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::whole;

/// Straight piece of a contour.
///
/// Parameters
/// ----------
/// from_m, to_m : sequence of 2 or 3 floats
///     Its ends in m.
///
/// Raises
/// ------
/// ValueError, TypeError
///     If a point has the wrong shape, dtype or a number that is not finite.
///
/// Examples
/// --------
/// >>> from ilc_rt.trajectory import Line, contour_error
/// >>> contour_error([Line([0.0, 0.0], [1.0, 0.0])], [[0.5, 0.25]])
/// array([0.25])
#[pyclass(name = "Line", module = "ilc_rt.trajectory", frozen)]
#[derive(Debug)]
struct PyLine(Line, Made);

#[pymethods]
impl PyLine {
    #[new]
    fn new(from_m: &Bound<'_, PyAny>, to_m: &Bound<'_, PyAny>) -> PyResult<Self> {
        let made = made!(from_m, to_m);
        Ok(Self(
            Line { from_m: read_point("from_m", from_m)?, to_m: read_point("to_m", to_m)? },
            made,
        ))
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().1.reduce(slf.get_type().as_any())
    }

    fn __repr__(&self) -> String {
        format!("Line(from_m={:?}, to_m={:?})", self.0.from_m, self.0.to_m)
    }
}

/// Circular piece of a contour, in any plane.
///
/// Parameters
/// ----------
/// from_m : sequence of 2 or 3 floats
///     Where it begins, in m.
/// centre_m : sequence of 2 or 3 floats
///     Its centre in m.
/// sweep_rad : float
///     How far it turns around the axis, in rad; up to a full turn either way.
/// axis : sequence of 3 floats
///     Around what it turns; perpendicular to the radius.
///
/// Raises
/// ------
/// ContourError
///     If the numbers describe no arc.
/// ValueError, TypeError
///     If a point has the wrong shape, dtype or a number that is not finite.
///
/// Examples
/// --------
/// >>> from ilc_rt.trajectory import Arc, contour_error
/// >>> contour_error([Arc([1.0, 0.0], [0.0, 0.0], 3.14)], [[0.0, 1.5]])
/// array([0.5])
#[pyclass(name = "Arc", module = "ilc_rt.trajectory", frozen)]
#[derive(Debug)]
struct PyArc(Arc, Made);

#[pymethods]
impl PyArc {
    #[new]
    #[pyo3(signature = (from_m, centre_m, sweep_rad, axis=None))]
    fn new(
        from_m: &Bound<'_, PyAny>,
        centre_m: &Bound<'_, PyAny>,
        sweep_rad: f64,
        axis: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let made = made!(from_m, centre_m, sweep_rad, axis);
        let (from_m, centre_m) = (read_point("from_m", from_m)?, read_point("centre_m", centre_m)?);
        let axis = axis.map_or(Ok([0.0, 0.0, 1.0]), |axis| read_point("axis", axis))?;
        Ok(Self(Arc::new(from_m, centre_m, axis, sweep_rad).or_raise()?, made))
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().1.reduce(slf.get_type().as_any())
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// Return how far measured points are from a path.
///
/// Parameters
/// ----------
/// reference_m : ndarray of float64, shape (n_reference, n_axes), or list of Line and Arc
///     The path in m: as samples, joined by straight steps, or as exact pieces.
/// actual_m : ndarray of float64, shape (n_samples, n_axes)
///     Measured points in m.
/// window : int or None
///     For a sampled path of 1 to 12 axes: how many samples before and after its
///     own time a point is compared with. None, for 2 and 3 axes: the whole path,
///     by a spatial index.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples,)
///     Distances in m, exact for the path as it is given.
///
/// Raises
/// ------
/// ContourError
///     If there is no path.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [barton2010], Sect. 4.1.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt.trajectory import contour_error
/// >>> contour_error(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.5, 0.25]]))
/// array([0.25])
#[pyfunction]
#[pyo3(signature = (reference_m, actual_m, window=None))]
fn contour_error<'py>(
    py: Python<'py>,
    reference_m: &Bound<'py, PyAny>,
    actual_m: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = whole::maybe::window)] window: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
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

/// Return the linearised coupling gains of two axes.
///
/// ``epsilon = c1 e1 + c2 e2``, ``c1 = -sin(theta)``, ``c2 = cos(theta)``
///
/// Parameters
/// ----------
/// reference_m : ndarray of float64, shape (n_samples, 2)
///     Reference in m.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples, 2)
///     One pair a sample; where the reference rests, that of the nearest sample
///     that moves.
///
/// Raises
/// ------
/// ValueError, TypeError
///     If the array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [barton2010], Eq. (4.1) to (4.3).
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt.trajectory import coupling_gains
/// >>> coupling_gains(np.array([[0.0, 0.0], [0.0, 2.0]]))
/// array([[-1.,  0.],
///        [-1.,  0.]])
#[pyfunction]
fn coupling_gains<'py>(
    py: Python<'py>,
    reference_m: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let reference = read_path("reference_m", reference_m)?.with_channels("reference_m", 2)?;
    let gains = coupling::coupling_gains(reference.values.as_chunks().0);
    give_signal(py, gains.concat(), 2, false)
}

/// Return what takes the part along the path away from an error.
///
/// ``epsilon = (I - t t') e`` with t the unit tangent of the reference.
///
/// Parameters
/// ----------
/// reference_m : ndarray of float64, shape (n_samples, 2) or (n_samples, 3)
///     Reference in m.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples, n_axes, n_axes)
///     One symmetric matrix a sample.
///
/// Raises
/// ------
/// ValueError, TypeError
///     If the array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [barton2010], Eq. (4.2), for two and three axes.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt.trajectory import projection_across
/// >>> projection_across(np.array([[0.0, 0.0], [0.0, 2.0]]))[0]
/// array([[1., 0.],
///        [0., 0.]])
#[pyfunction]
fn projection_across<'py>(
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

/// Reads a list of shapes; `None` if it is something else.
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

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLine>()?;
    module.add_class::<PyArc>()?;
    module.add_function(wrap_pyfunction!(contour_error, module)?)?;
    module.add_function(wrap_pyfunction!(coupling_gains, module)?)?;
    module.add_function(wrap_pyfunction!(projection_across, module)?)
}
