//! Plans of moves without samples: the native side of `ilc_rt.trajectory.MovePlan`.

use ilc_rt::trajectory::{Linear, PathSegment};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::answer::{give_signal, give_vector};
use crate::argument::{Signal, misfit, read_array};
use crate::arguments::Arguments;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, New, made};
use crate::trajectory::{SETTINGS, read_each, read_limits};

/// Moves planned, or times evaluated, in less than about 100 us: other threads do not wait.
const FEW: usize = 32;

#[pyclass(name = "MovePlan", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyMovePlan(Linear);

#[pymethods]
impl PyMovePlan {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let Signal { values: points_m, layout } = a.signal("points_m")?;
        let n_axes = layout.n_channels;
        let each = |name: &str, n| read_each(name, &a.get(name)?, n);
        let feeds_m_s = each("feed_m_s", layout.n_samples - 1)?;
        let (limits, setting) = (read_limits(a, n_axes)?, a.choice("setting", &SETTINGS)?);
        let velocity_m_s = each("start_velocity_m_s", n_axes)?;
        let planned = || {
            let (start_m, ends_m) = points_m.split_at(n_axes);
            let segments = PathSegment::lines(ends_m, n_axes, &feeds_m_s);
            Linear::plan_moving(start_m, &velocity_m_s, &segments, &limits, setting)
        };
        let is_short = layout.n_samples <= FEW;
        let plan = if is_short { planned() } else { detached(a.py(), planned) }.or_raise()?;
        made(a, Self(plan))
    }

    /// Time from the start to the end, at rest, in s.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.0.duration_s()
    }

    /// Duration without limits, in s.
    #[getter]
    fn nominal_s(&self) -> f64 {
        self.0.nominal_s()
    }

    /// Number of axes.
    #[getter]
    fn n_axes(&self) -> usize {
        self.0.n_axes()
    }

    /// Number of moves.
    #[getter]
    fn n_moves(&self) -> usize {
        self.0.starts_s().len()
    }

    /// Times from the start at which the moves begin in s, shape (n_moves,).
    #[getter]
    fn starts_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give_vector(py, self.0.starts_s().collect())
    }

    /// Return positions in m, velocities in m/s and accelerations in m/s^2 at times from the start in s.
    ///
    /// Each has shape (n_axes,) for one time, (n_times, n_axes) for (n_times,).
    fn at<'py>(&self, t_s: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyTuple>> {
        let py = t_s.py();
        let (times_s, shape) = read_array("t_s", t_s)?;
        if shape.len() > 1 {
            return Err(misfit("t_s", &shape, "() or (n_times,)"));
        }
        let evaluated = || self.0.tables_at(&times_s);
        let tables = if times_s.len() <= FEW { evaluated() } else { detached(py, evaluated) };
        let give = |table| give_signal(py, table, self.n_axes(), shape.is_empty());
        PyTuple::new(py, tables.into_iter().map(give).collect::<PyResult<Vec<_>>>()?)
    }

    fn __repr__(&self) -> String {
        format!(
            "MovePlan(n_moves={}, n_axes={}, duration_s={:?})",
            self.n_moves(),
            self.n_axes(),
            self.duration_s()
        )
    }
}
