//! Plans of moves without samples: the native side of `ilc_rt.trajectory.MovePlan`.

use ilc_rt::trajectory::{AxisLimits, Linear, LinearSetting};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::answer::{Array, by_name, give_signal, give_vector};
use crate::argument::{Signal, misfit, read_array};
use crate::arguments::choice;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::trajectory::{SETTINGS, limits_of, read_each};

/// Moves planned, or times evaluated, in less than about 100 us: other threads do not wait.
const FEW: usize = 32;

#[pyclass(name = "MovePlan", module = "ilc_rt._native", subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyMovePlan {
    plan: Linear,
    points_m: Vec<f64>,
    feed_m_s: Vec<f64>,
    limits: Vec<AxisLimits>,
    setting: LinearSetting,
    start_velocity_m_s: Vec<f64>,
}

#[pymethods]
impl PyMovePlan {
    /// Takes its arguments by position: reading them from a dict would take as long as a plan.
    #[new]
    fn new(
        points_m: &Bound<'_, PyAny>,
        feed_m_s: &Bound<'_, PyAny>,
        velocity_max_m_s: &Bound<'_, PyAny>,
        acceleration_max_m_s2: &Bound<'_, PyAny>,
        jerk_max_m_s3: &Bound<'_, PyAny>,
        setting: &Bound<'_, PyAny>,
        start_velocity_m_s: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let py = points_m.py();
        let Signal { values: points_m, layout } = Signal::read("points_m", points_m)?;
        let n_axes = layout.n_channels;
        let feed_m_s = read_each("feed_m_s", feed_m_s, layout.n_samples - 1)?;
        let limits = limits_of([velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3], n_axes)?;
        let setting = choice("setting", setting, &SETTINGS)?;
        let start_velocity_m_s = read_each("start_velocity_m_s", start_velocity_m_s, n_axes)?;
        let planned =
            || Linear::through(&points_m, &feed_m_s, &start_velocity_m_s, &limits, setting);
        let is_short = layout.n_samples <= FEW;
        let plan = if is_short { planned() } else { detached(py, planned) }.or_raise()?;
        Ok(Self { plan, points_m, feed_m_s, limits, setting, start_velocity_m_s })
    }

    /// Time from the start to the end, at rest, in s.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.plan.duration_s()
    }

    /// Duration without limits, in s.
    #[getter]
    fn nominal_s(&self) -> f64 {
        self.plan.nominal_s()
    }

    /// Number of axes.
    #[getter]
    fn n_axes(&self) -> usize {
        self.plan.n_axes()
    }

    /// Number of moves.
    #[getter]
    fn n_moves(&self) -> usize {
        self.plan.starts_s().len()
    }

    /// Times from the start at which the moves begin in s, shape (n_moves,).
    #[getter]
    fn starts_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give_vector(py, self.plan.starts_s().collect())
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
        let evaluated = || self.plan.tables_at(&times_s);
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
    /// Pickled and copied as its arguments; keeping those of Python would take longer than a plan.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        let (py, this) = (slf.py(), slf.get());
        let each = |limit: fn(&AxisLimits) -> f64| {
            give_vector(py, this.limits.iter().map(limit).collect())
        };
        let name = SETTINGS.iter().find(|(_, setting)| *setting == this.setting);
        let arguments = by_name!(py,
            [this => feed_m_s, start_velocity_m_s]
            points_m: give_signal(py, this.points_m.clone(), this.n_axes(), false)?,
            velocity_max_m_s: each(|limits| limits.velocity_max_m_s),
            acceleration_max_m_s2: each(|limits| limits.acceleration_max_m_s2),
            jerk_max_m_s3: each(|limits| limits.jerk_max_m_s3),
            setting: name.map(|(name, _)| *name),
        );
        let maker = py.import("ilc_rt._native")?.getattr("_made")?;
        Ok((maker, (slf.get_type(), py.None(), arguments)).into_pyobject(py)?.into_any())
    }
}
