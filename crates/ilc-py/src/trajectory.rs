//! `Trajectory`, a planned motion in samples, and its index.

use std::time::Instant;

use ilc_rt::trajectory::{SampledMotion, TrackingIndex, TrajectoryError};
use pyo3::prelude::*;

use crate::argument::{Signal, give_signal};
use crate::detached::detached;
use crate::error::OrRaise;

/// Place of an alpha, the alpha, and the intervals in which it might be.
pub(crate) type Alpha = (usize, String, f64, Vec<(f64, f64)>);

/// A planned motion, sampled.
///
/// All arrays are float64 of shape (n_samples, n_axes), time first. The first
/// and the last sample are at rest, but for `sigmoid_pair`.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> move = trajectory.jerk_limited(
/// ...     [[0.0], [0.1]], feed_m_s=0.2, dt_s=0.001,
/// ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=50.0)
/// >>> float(move.position_m[-1, 0])
/// 0.1
#[pyclass(name = "Trajectory", module = "ilc_rt.trajectory", frozen)]
#[derive(Debug)]
pub(crate) struct PyTrajectory {
    motion: SampledMotion,
    alphas: Vec<Alpha>,
    /// Time that planning and sampling took, in seconds.
    #[pyo3(get)]
    computing_s: f64,
}

#[pymethods]
impl PyTrajectory {
    /// Pickled and copied as its samples.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let samples = (
            this.position_m(py)?,
            this.velocity_m_s(py)?,
            this.acceleration_m_s2(py)?,
            this.programmed_m(py)?,
        );
        let parts = (this.motion.dt_s, samples, this.alphas(), this.computing_s);
        let maker = py.import("ilc_rt._native")?.getattr("_trajectory")?;
        Ok((maker, parts.into_pyobject(py)?.into_any()))
    }

    /// Sample time in seconds.
    #[getter]
    fn dt_s(&self) -> f64 {
        self.motion.dt_s
    }

    /// Number of samples.
    #[getter]
    fn n_samples(&self) -> usize {
        self.motion.n_samples()
    }

    /// Number of axes.
    #[getter]
    fn n_axes(&self) -> usize {
        self.motion.n_axes
    }

    /// Time of each sample in seconds, shape (n_samples,).
    #[getter]
    fn t_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let dt_s = self.motion.dt_s;
        give_signal(py, (0..self.n_samples()).map(|k| k as f64 * dt_s).collect(), 1, true)
    }

    /// Positions in m.
    #[getter]
    fn position_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_signal(py, self.motion.position_m.clone(), self.motion.n_axes, false)
    }

    /// Velocities in m/s.
    #[getter]
    fn velocity_m_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_signal(py, self.motion.velocity_m_s.clone(), self.motion.n_axes, false)
    }

    /// Accelerations in m/s^2.
    #[getter]
    fn acceleration_m_s2<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_signal(py, self.motion.acceleration_m_s2.clone(), self.motion.n_axes, false)
    }

    /// Where the program would be at each sample if there were no limits, in m.
    #[getter]
    fn programmed_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_signal(py, self.motion.programmed_m.clone(), self.motion.n_axes, false)
    }

    /// Each alpha of an E/S move: (segment, place, alpha, admissible intervals).
    #[getter]
    fn alphas(&self) -> Vec<Alpha> {
        self.alphas.clone()
    }

    fn __repr__(&self) -> String {
        format!(
            "Trajectory(n_samples={}, n_axes={}, dt_s={})",
            self.n_samples(),
            self.n_axes(),
            self.dt_s()
        )
    }
}

/// Plans without the interpreter, and measures how long it takes.
pub(crate) fn planned(
    py: Python<'_>,
    plan: impl FnOnce() -> Result<(SampledMotion, Vec<Alpha>), TrajectoryError> + Send,
) -> PyResult<PyTrajectory> {
    let begun = Instant::now();
    let (motion, alphas) = detached(py, plan).or_raise()?;
    Ok(PyTrajectory { motion, alphas, computing_s: begun.elapsed().as_secs_f64() })
}

/// Return the two parts of the index J of an interpolated motion.
///
/// ``J = integral of k_e (y_des - y)^2 + k_a y''^2``, by the trapezoidal rule.
///
/// Parameters
/// ----------
/// trajectory : Trajectory
///     The motion; `programmed_m` is what it is compared with.
/// k_e : float
///     Weight of the tracking error.
/// k_a : float
///     Weight of the acceleration.
///
/// Returns
/// -------
/// (float, float)
///     The parts of tracking and of acceleration; their sum is J.
///
/// Raises
/// ------
/// TrajectoryError
///     If a weight is below 0 or not finite.
///
/// References
/// ----------
/// [dimarco2016], Eq. 2.19.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> move = trajectory.jerk_limited(
/// ...     [0.0, 0.1], feed_m_s=0.1, dt_s=0.001,
/// ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=50.0)
/// >>> tracking, acceleration = trajectory.tracking_index(move)
/// >>> tracking > 0.0 and acceleration > 0.0
/// True
#[pyfunction]
#[pyo3(signature = (trajectory, k_e=600.0, k_a=1.0))]
fn tracking_index(
    trajectory: &Bound<'_, PyTrajectory>,
    k_e: f64,
    k_a: f64,
) -> PyResult<(f64, f64)> {
    let motion = &trajectory.get().motion;
    let index = TrackingIndex::of(
        &motion.programmed_m,
        &motion.position_m,
        &motion.acceleration_m_s2,
        motion.n_axes,
        motion.dt_s,
        (k_e, k_a),
    )
    .or_raise()?;
    Ok((index.tracking, index.acceleration))
}

/// Makes a trajectory again from its samples, for copies.
#[pyfunction]
fn _trajectory(
    dt_s: f64,
    samples: [Bound<'_, PyAny>; 4],
    alphas: Vec<Alpha>,
    computing_s: f64,
) -> PyResult<PyTrajectory> {
    let [position, velocity, acceleration, programmed] = samples;
    let position = Signal::read("position_m", &position)?;
    let motion = SampledMotion {
        dt_s,
        n_axes: position.n_channels,
        velocity_m_s: Signal::read("velocity_m_s", &velocity)?.values,
        acceleration_m_s2: Signal::read("acceleration_m_s2", &acceleration)?.values,
        programmed_m: Signal::read("programmed_m", &programmed)?.values,
        position_m: position.values,
    };
    Ok(PyTrajectory { motion, alphas, computing_s })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyTrajectory>()?;
    module.add_function(wrap_pyfunction!(_trajectory, module)?)?;
    module.add_function(wrap_pyfunction!(tracking_index, module)?)
}
