//! Trajectories: `Trajectory` and the functions that plan one.

use std::collections::BTreeMap;
use std::time::Instant;

use ilc_rt::trajectory::curve::{Butterfly, Curve, Run, RunLimits, Spiral, Spline};
use ilc_rt::trajectory::exponential::AlphaMax;
use ilc_rt::trajectory::kind::RasterSection;
use ilc_rt::trajectory::program::{GcodeSetting, read_gcode};
use ilc_rt::trajectory::{
    AxisLimits, ExponentialSigmoid, Interpolator, Linear, LinearSetting, MAX_AXES,
    ModulatedSegment, MoveError, POINTS_A_PERIOD, PathSegment, PathSpec, SampledMotion,
    TrackingIndex, TrajectoryError, points_program,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::argument::{Signal, give_signal, read_vector};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::exceptions;
use crate::whole;

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

/// Reads points, one a row.
fn read_points(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<f64>>> {
    let points = Signal::read(name, object)?;
    Ok(points.values.chunks(points.n_channels).map(<[f64]>::to_vec).collect())
}

/// Reads a number for all, or one for each.
fn read_each(name: &str, object: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<f64>> {
    if let Ok(value) = object.extract::<f64>() {
        return Ok(vec![value; n]);
    }
    let values = read_vector(name, object)?;
    if values.len() == n {
        return Ok(values);
    }
    Err(PyValueError::new_err(format!(
        "{name} has {} entries; a number, or {n} of them, is needed",
        values.len()
    )))
}

/// Reads the limits of each axis.
fn read_limits(
    n_axes: usize,
    velocity: &Bound<'_, PyAny>,
    acceleration: &Bound<'_, PyAny>,
    jerk: &Bound<'_, PyAny>,
) -> PyResult<Vec<AxisLimits>> {
    if !(1..=MAX_AXES).contains(&n_axes) {
        return Err(TrajectoryError::from(MoveError::Axes { n_axes })).or_raise();
    }
    let velocity = read_each("velocity_max_m_s", velocity, n_axes)?;
    let acceleration = read_each("acceleration_max_m_s2", acceleration, n_axes)?;
    let jerk = read_each("jerk_max_m_s3", jerk, n_axes)?;
    Ok((0..n_axes)
        .map(|i| AxisLimits {
            velocity_max_m_s: velocity[i],
            acceleration_max_m_s2: acceleration[i],
            jerk_max_m_s3: jerk[i],
        })
        .collect())
}

/// Reads the largest alpha wanted: a number for all places, or numbers by the place's name.
fn read_alpha_max(object: Option<&Bound<'_, PyAny>>) -> PyResult<AlphaMax> {
    let mut alpha_max = AlphaMax::default();
    let Some(object) = object else { return Ok(alpha_max) };
    if let Ok(value) = object.extract::<f64>() {
        return Ok(AlphaMax { start_up: value, transition: value, end: value });
    }
    let Ok(by_place) = object.extract::<BTreeMap<String, f64>>() else {
        return Err(PyTypeError::new_err(format!(
            "alpha_max = {}; a number, or a dict of numbers by place, is needed",
            object.repr()?
        )));
    };
    for (place, value) in by_place {
        match place.as_str() {
            "start-up" => alpha_max.start_up = value,
            "transition" => alpha_max.transition = value,
            "end" => alpha_max.end = value,
            other => {
                return Err(PyValueError::new_err(format!(
                    "alpha_max: {other:?}; \"start-up\", \"transition\" or \"end\" is needed"
                )));
            }
        }
    }
    Ok(alpha_max)
}

fn read_setting(setting: &str) -> PyResult<LinearSetting> {
    match setting {
        "complete" => Ok(LinearSetting::CompleteEveryMove),
        "on_time" => Ok(LinearSetting::StartOnTime),
        other => Err(PyValueError::new_err(format!(
            "setting = {other:?}; \"complete\" or \"on_time\" is needed"
        ))),
    }
}

/// The first point and the moves to the others.
fn moves(points: &[Vec<f64>], feeds: &[f64]) -> (Vec<f64>, Vec<PathSegment>) {
    let start = points.first().cloned().unwrap_or_default();
    let to = points.iter().skip(1).zip(feeds);
    (start, to.map(|(to_m, feed)| PathSegment::line(to_m.clone(), *feed)).collect())
}

fn sample_linear(
    start_m: &[f64],
    segments: &[PathSegment],
    limits: &[AxisLimits],
    setting: LinearSetting,
    dt_s: f64,
) -> Result<(SampledMotion, Vec<Alpha>), TrajectoryError> {
    let plan = Linear::plan(start_m, segments, limits, setting)?;
    let motion = SampledMotion::sample(plan.duration_s(), dt_s, plan.n_axes(), |t_s| {
        (plan.at(t_s), plan.programmed_m(t_s))
    })?;
    Ok((motion.verified(limits)?, Vec::new()))
}

fn sample_exponential(
    start_m: &[f64],
    segments: &[ModulatedSegment],
    limits: &[AxisLimits],
    alpha_max: &AlphaMax,
    dt_s: f64,
) -> Result<(SampledMotion, Vec<Alpha>), TrajectoryError> {
    let plan = ExponentialSigmoid::plan_below(start_m, segments, limits, alpha_max)?;
    let motion = SampledMotion::sample(plan.duration_s(), dt_s, plan.n_axes(), |t_s| {
        (plan.at(t_s), plan.programmed_m(t_s))
    })?;
    let alphas = plan
        .choices()
        .iter()
        .map(|choice| {
            let intervals = choice.admissible.iter().map(|i| (i.from, i.to)).collect();
            (choice.segment, choice.place.to_owned(), choice.alpha, intervals)
        })
        .collect();
    Ok((motion.verified(limits)?, alphas))
}

fn sample_run(
    curve: &impl Curve,
    limits: &RunLimits,
    dt_s: f64,
) -> Result<(SampledMotion, Vec<Alpha>), TrajectoryError> {
    Ok((Run::plan(curve, limits, dt_s)?.motion().clone(), Vec::new()))
}

fn sample_path(
    spec: &PathSpec,
    limits: &[AxisLimits],
    dt_s: f64,
) -> Result<(SampledMotion, Vec<Alpha>), TrajectoryError> {
    let mut plan = Interpolator::plan(spec, limits, dt_s)?;
    let n_axes = plan.n_axes();
    let mut motion = SampledMotion { dt_s, n_axes, ..SampledMotion::default() };
    for _ in 0..plan.n_samples() {
        let setpoint = plan.next();
        motion.position_m.extend_from_slice(&setpoint.position_m[..n_axes]);
        motion.velocity_m_s.extend_from_slice(&setpoint.velocity_m_s[..n_axes]);
    }
    let v = &motion.velocity_m_s;
    let last = v.len();
    motion.acceleration_m_s2 = (0..last)
        .map(|i| {
            // At rest at both ends, where there is no neighbour.
            let inside = i >= n_axes && i + n_axes < last;
            if inside { (v[i + n_axes] - v[i - n_axes]) / (2.0 * dt_s) } else { 0.0 }
        })
        .collect();
    motion.programmed_m.clone_from(&motion.position_m);
    Ok((motion, Vec::new()))
}

/// Plan straight moves, each axis limited in jerk.
///
/// Seven phases of jerk a move. What happens between moves is one of the two
/// settings of machine tools.
///
/// Parameters
/// ----------
/// points_m : ndarray of float64, shape (n_points,) or (n_points, n_axes)
///     Start and the end of each move, in m.
/// feed_m_s : float or ndarray of float64, shape (n_points - 1,)
///     Speed along each move, in m/s.
/// dt_s : float
///     Sample time in s.
/// velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s.
/// acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^2.
/// jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^3.
/// setting : str
///     ``"complete"``: every move is completed, an oscillation loses frequency.
///     ``"on_time"``: the next begins on time, an oscillation loses amplitude.
///
/// Returns
/// -------
/// Trajectory
///
/// Raises
/// ------
/// TrajectoryError
///     If a value is out of its range.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [dimarco2016], Chapter 2.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> move = trajectory.jerk_limited(
/// ...     [0.0, 2.0], feed_m_s=1.0, dt_s=0.01,
/// ...     velocity_max_m_s=1.0, acceleration_max_m_s2=2.0, jerk_max_m_s3=8.0)
/// >>> round(float(move.t_s[-1]), 6)
/// 2.75
#[pyfunction]
#[pyo3(signature = (points_m, *, feed_m_s, dt_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3, setting="complete"))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn jerk_limited(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    feed_m_s: &Bound<'_, PyAny>,
    dt_s: f64,
    velocity_max_m_s: &Bound<'_, PyAny>,
    acceleration_max_m_s2: &Bound<'_, PyAny>,
    jerk_max_m_s3: &Bound<'_, PyAny>,
    setting: &str,
) -> PyResult<PyTrajectory> {
    let points = read_points("points_m", points_m)?;
    let feeds = read_each("feed_m_s", feed_m_s, points.len() - 1)?;
    let limits =
        read_limits(points[0].len(), velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3)?;
    let setting = read_setting(setting)?;
    let (start, segments) = moves(&points, &feeds);
    planned(py, || sample_linear(&start, &segments, &limits, setting, dt_s))
}

/// Plan an exponential/sigmoid (E/S) move.
///
/// ``x = (m t)(1 - exp(-a t^3)) + A sin(w t)(1 - exp(-a t^2))`` at the start,
/// sigmoids where a line goes on or turns round, the mirror image of a start
/// where it ends. It is on its programmed path, and on time, soon after a start.
/// Each alpha is the largest that honours every limit.
///
/// Parameters
/// ----------
/// points_m : ndarray of float64, shape (n_points,) or (n_points, n_axes)
///     Start and the end of each leg, in m.
/// feed_m_s : float or ndarray of float64, shape (n_points - 1,)
///     Speed of each leg, in m/s; a start overshoots it by 79 %.
/// dt_s : float
///     Sample time in s.
/// velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s.
/// acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^2.
/// jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^3.
/// amplitude_m : float or ndarray of float64, shape (n_points - 1,)
///     Amplitude of the oscillation along each leg, in m.
/// frequency_hz : float or ndarray of float64, shape (n_points - 1,)
///     Its frequency, in Hz.
/// alpha_max : float or dict of float, optional
///     No alpha above this is used, at every place or by the name of the place:
///     ``"start-up"``, ``"transition"``, ``"end"``. The largest that the limits
///     allow is not the one with the smallest `tracking_index`.
///
/// Returns
/// -------
/// Trajectory
///     With `alphas`.
///
/// Raises
/// ------
/// TrajectoryError
///     If no alpha holds the limits, or a value is out of its range.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// Notes
/// -----
/// A start has to be over before its leg is: ``a T^3`` of at least 45, so that
/// its acceleration reaches about ``11 v / T`` in a leg of T seconds.
///
/// References
/// ----------
/// [dimarco2016], Section 2.1, 2.3.3.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> move = trajectory.exponential_sigmoid(
/// ...     [0.0, 0.2, 0.0], feed_m_s=0.1, dt_s=0.001,
/// ...     velocity_max_m_s=0.5, acceleration_max_m_s2=5.0, jerk_max_m_s3=200.0)
/// >>> " ".join(place for _, place, _, _ in move.alphas)
/// 'start-up transition end'
#[pyfunction]
#[pyo3(signature = (points_m, *, feed_m_s, dt_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3, amplitude_m=None, frequency_hz=None, alpha_max=None))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn exponential_sigmoid(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    feed_m_s: &Bound<'_, PyAny>,
    dt_s: f64,
    velocity_max_m_s: &Bound<'_, PyAny>,
    acceleration_max_m_s2: &Bound<'_, PyAny>,
    jerk_max_m_s3: &Bound<'_, PyAny>,
    amplitude_m: Option<&Bound<'_, PyAny>>,
    frequency_hz: Option<&Bound<'_, PyAny>>,
    alpha_max: Option<&Bound<'_, PyAny>>,
) -> PyResult<PyTrajectory> {
    let points = read_points("points_m", points_m)?;
    let n_legs = points.len() - 1;
    let feeds = read_each("feed_m_s", feed_m_s, n_legs)?;
    let each = |name: &str, object: Option<&Bound<'_, PyAny>>| {
        object.map_or_else(|| Ok(vec![0.0; n_legs]), |object| read_each(name, object, n_legs))
    };
    let amplitudes = each("amplitude_m", amplitude_m)?;
    let frequencies = each("frequency_hz", frequency_hz)?;
    let limits =
        read_limits(points[0].len(), velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3)?;
    let segments: Vec<ModulatedSegment> = (0..n_legs)
        .map(|i| ModulatedSegment {
            to_m: points[i + 1].clone(),
            feed_m_s: feeds[i],
            amplitude_m: amplitudes[i],
            frequency_hz: frequencies[i],
        })
        .collect();
    let alpha_max = read_alpha_max(alpha_max)?;
    planned(py, || sample_exponential(&points[0], &segments, &limits, &alpha_max, dt_s))
}

/// Plan a modulated tool path: a feed with an oscillation along it.
///
/// ``x = v t + A sin(w t)``, as a ramped sinusoid by the E/S interpolator, or as
/// the six-point sine that a numerical controller gets, by the jerk-limited
/// linear one.
///
/// Parameters
/// ----------
/// points_m : ndarray of float64, shape (2,) or (2, n_axes)
///     Start and end, in m.
/// feed_m_s : float
///     Speed of the line, in m/s.
/// amplitude_m : float
///     Amplitude, in m.
/// frequency_hz : float
///     Frequency, in Hz.
/// dt_s : float
///     Sample time in s.
/// velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s.
/// acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^2.
/// jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^3.
/// interpolation : str
///     ``"exponential_sigmoid"``, or ``"complete"`` or ``"on_time"`` for the
///     six-point sine in one of the two settings.
///
/// Returns
/// -------
/// Trajectory
///
/// Raises
/// ------
/// TrajectoryError
///     If no alpha holds the limits, or a value is out of its range.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [dimarco2016], Chapters 1 and 2.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> path = trajectory.modulated(
/// ...     [0.0, 0.1], feed_m_s=0.02, amplitude_m=0.001, frequency_hz=2.0, dt_s=0.001,
/// ...     velocity_max_m_s=0.5, acceleration_max_m_s2=5.0, jerk_max_m_s3=200.0)
/// >>> round(float(path.t_s[-1]), 6)
/// 5.0
#[pyfunction]
#[pyo3(signature = (points_m, *, feed_m_s, amplitude_m, frequency_hz, dt_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3, interpolation="exponential_sigmoid"))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn modulated(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    feed_m_s: f64,
    amplitude_m: f64,
    frequency_hz: f64,
    dt_s: f64,
    velocity_max_m_s: &Bound<'_, PyAny>,
    acceleration_max_m_s2: &Bound<'_, PyAny>,
    jerk_max_m_s3: &Bound<'_, PyAny>,
    interpolation: &str,
) -> PyResult<PyTrajectory> {
    let points = read_points("points_m", points_m)?;
    let [start, end] = &points[..] else {
        return Err(PyValueError::new_err(format!(
            "points_m has {} rows; start and end, 2, are needed",
            points.len()
        )));
    };
    let limits = read_limits(start.len(), velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3)?;
    let segment = ModulatedSegment { to_m: end.clone(), feed_m_s, amplitude_m, frequency_hz };
    if interpolation == "exponential_sigmoid" {
        return planned(py, || {
            sample_exponential(start, &[segment], &limits, &AlphaMax::default(), dt_s)
        });
    }
    let setting = read_setting(interpolation).map_err(|_| {
        PyValueError::new_err(format!(
            "interpolation = {interpolation:?}; \"exponential_sigmoid\", \"complete\" or \
             \"on_time\" is needed"
        ))
    })?;
    planned(py, || {
        let program = points_program(start, &segment, POINTS_A_PERIOD)?;
        sample_linear(start, &program, &limits, setting, dt_s)
    })
}

/// Plan the smooth curve through points.
///
/// A natural cubic spline, run with curvature-limited speed.
///
/// Parameters
/// ----------
/// points_m : ndarray of float64, shape (n_points, n_axes)
///     Points in order, in m.
/// feed_m_s : float
///     Highest speed along the path, in m/s.
/// dt_s : float
///     Sample time in s.
/// velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s.
/// acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^2.
/// jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^3.
/// curvature_acceleration_max_m_s2 : float
///     Highest acceleration across the path, in m/s^2.
///
/// Returns
/// -------
/// Trajectory
///
/// Raises
/// ------
/// TrajectoryError
///     If a value is out of its range, or two neighbours are the same.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> path = trajectory.spline(
/// ...     [[0.0, 0.0], [0.03, 0.02], [0.06, 0.0]], feed_m_s=0.05, dt_s=0.002,
/// ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=100.0)
/// >>> path.n_axes
/// 2
#[pyfunction]
#[pyo3(signature = (points_m, *, feed_m_s, dt_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3, curvature_acceleration_max_m_s2=f64::INFINITY))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn spline(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    feed_m_s: f64,
    dt_s: f64,
    velocity_max_m_s: &Bound<'_, PyAny>,
    acceleration_max_m_s2: &Bound<'_, PyAny>,
    jerk_max_m_s3: &Bound<'_, PyAny>,
    curvature_acceleration_max_m_s2: f64,
) -> PyResult<PyTrajectory> {
    let points = read_points("points_m", points_m)?;
    let axes =
        read_limits(points[0].len(), velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3)?;
    let limits = RunLimits { feed_m_s, curvature_acceleration_max_m_s2, axes };
    planned(py, || sample_run(&Spline::through(&points)?, &limits, dt_s))
}

/// Plan the butterfly contour.
///
/// ``r = exp(cos t) - 2 cos 4t - sin(t/12)^5``, x = scale r sin t,
/// y = scale r cos t, with curvature-limited speed.
///
/// Parameters
/// ----------
/// dt_s : float
///     Sample time in s.
/// velocity_max_m_s : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s.
/// acceleration_max_m_s2 : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s^2.
/// jerk_max_m_s3 : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s^3.
/// feed_m_s : float
///     Highest speed along the path, in m/s.
/// curvature_acceleration_max_m_s2 : float
///     Highest acceleration across the path, in m/s^2.
/// scale_m : float
///     Size, in m.
/// turns : float
///     Turns of t; 12 close the contour.
/// center_m : (float, float)
///     Centre, in m.
///
/// Returns
/// -------
/// Trajectory
///
/// Raises
/// ------
/// TrajectoryError
///     If a value is out of its range.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> path = trajectory.butterfly(
/// ...     dt_s=0.002, velocity_max_m_s=0.1, acceleration_max_m_s2=0.5, jerk_max_m_s3=20.0)
/// >>> path.n_axes
/// 2
#[pyfunction]
#[pyo3(signature = (*, dt_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3, feed_m_s=0.004, curvature_acceleration_max_m_s2=0.02, scale_m=0.00185, turns=1.0, center_m=(0.0, 0.0)))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn butterfly(
    py: Python<'_>,
    dt_s: f64,
    velocity_max_m_s: &Bound<'_, PyAny>,
    acceleration_max_m_s2: &Bound<'_, PyAny>,
    jerk_max_m_s3: &Bound<'_, PyAny>,
    feed_m_s: f64,
    curvature_acceleration_max_m_s2: f64,
    scale_m: f64,
    turns: f64,
    center_m: (f64, f64),
) -> PyResult<PyTrajectory> {
    let axes = read_limits(2, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3)?;
    let limits = RunLimits { feed_m_s, curvature_acceleration_max_m_s2, axes };
    let center = finite_pair("center_m", center_m)?;
    planned(py, || sample_run(&Butterfly::new(scale_m, turns, center)?, &limits, dt_s))
}

fn finite_pair(name: &str, (x, y): (f64, f64)) -> PyResult<[f64; 2]> {
    if x.is_finite() && y.is_finite() {
        return Ok([x, y]);
    }
    Err(PyValueError::new_err(format!("{name} = ({x}, {y}); finite numbers are needed")))
}

/// Plan a spiral from its centre outwards, anticlockwise.
///
/// ``r = pitch theta / (2 pi)``, with curvature-limited speed.
///
/// Parameters
/// ----------
/// pitch_m : float
///     Distance of the turns, in m.
/// turns : float
///     Number of turns.
/// feed_m_s : float
///     Highest speed along the path, in m/s.
/// dt_s : float
///     Sample time in s.
/// velocity_max_m_s : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s.
/// acceleration_max_m_s2 : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s^2.
/// jerk_max_m_s3 : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s^3.
/// curvature_acceleration_max_m_s2 : float
///     Highest acceleration across the path, in m/s^2.
/// center_m : (float, float)
///     Centre, in m.
///
/// Returns
/// -------
/// Trajectory
///
/// Raises
/// ------
/// TrajectoryError
///     If a value is out of its range.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [barton2010], Section 8.1.2.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> path = trajectory.spiral(
/// ...     pitch_m=0.004, turns=3.0, feed_m_s=0.02, dt_s=0.002,
/// ...     velocity_max_m_s=0.1, acceleration_max_m_s2=0.5, jerk_max_m_s3=20.0)
/// >>> bool(abs((path.position_m[-1] ** 2).sum() ** 0.5 - 0.012) < 1e-12)
/// True
#[pyfunction]
#[pyo3(signature = (*, pitch_m, turns, feed_m_s, dt_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3, curvature_acceleration_max_m_s2=f64::INFINITY, center_m=(0.0, 0.0)))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn spiral(
    py: Python<'_>,
    pitch_m: f64,
    turns: f64,
    feed_m_s: f64,
    dt_s: f64,
    velocity_max_m_s: &Bound<'_, PyAny>,
    acceleration_max_m_s2: &Bound<'_, PyAny>,
    jerk_max_m_s3: &Bound<'_, PyAny>,
    curvature_acceleration_max_m_s2: f64,
    center_m: (f64, f64),
) -> PyResult<PyTrajectory> {
    let axes = read_limits(2, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3)?;
    let limits = RunLimits { feed_m_s, curvature_acceleration_max_m_s2, axes };
    let center = finite_pair("center_m", center_m)?;
    planned(py, || sample_run(&Spiral::new(pitch_m, turns, center)?, &limits, dt_s))
}

/// Plan a raster: rows to and fro, and back if asked for.
///
/// Parameters
/// ----------
/// width_m : float
///     Length of a row along the first axis, in m.
/// pitch_m : float
///     Distance of the rows along the second axis, in m.
/// rows : int
///     Number of rows.
/// feed_m_s : float
///     Speed, in m/s.
/// dt_s : float
///     Sample time in s.
/// velocity_max_m_s : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s.
/// acceleration_max_m_s2 : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s^2.
/// jerk_max_m_s3 : float or ndarray of float64, shape (2,)
///     Limit of each axis, in m/s^3.
/// start_m : (float, float)
///     First corner, in m.
/// there_and_back : bool
///     Whether the same way is gone back to the start.
/// setting : str
///     ``"complete"`` or ``"on_time"``, as in `jerk_limited`.
///
/// Returns
/// -------
/// Trajectory
///
/// Raises
/// ------
/// TrajectoryError
///     If a value is out of its range.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [barton2010], Section 8.1.2.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> path = trajectory.raster(
/// ...     width_m=0.02, pitch_m=0.005, rows=3, feed_m_s=0.05, dt_s=0.002,
/// ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=100.0)
/// >>> path.position_m[-1].tolist()
/// [0.02, 0.01]
#[pyfunction]
#[pyo3(signature = (*, width_m, pitch_m, rows, feed_m_s, dt_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3, start_m=(0.0, 0.0), there_and_back=false, setting="complete"))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn raster(
    py: Python<'_>,
    width_m: f64,
    pitch_m: f64,
    #[pyo3(from_py_with = whole::rows)] rows: usize,
    feed_m_s: f64,
    dt_s: f64,
    velocity_max_m_s: &Bound<'_, PyAny>,
    acceleration_max_m_s2: &Bound<'_, PyAny>,
    jerk_max_m_s3: &Bound<'_, PyAny>,
    start_m: (f64, f64),
    there_and_back: bool,
    setting: &str,
) -> PyResult<PyTrajectory> {
    let limits = read_limits(2, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3)?;
    let start = finite_pair("start_m", start_m)?;
    let setting = read_setting(setting)?;
    planned(py, || {
        let raster = RasterSection { width_m, pitch_m, rows, there_and_back };
        let program = raster.segments(start, feed_m_s)?;
        sample_linear(&start, &program, &limits, setting, dt_s)
    })
}

/// Plan a part program in G-code.
///
/// G0 to G4, G17, G20, G21, G80, G90, G91, M2, M30; arcs by I and J, or R;
/// comments; words that ask for what is so anyway. The words mean what they
/// mean to LinuxCNC, or are refused.
///
/// Parameters
/// ----------
/// text : str or bytes
///     The program; bytes may have any encoding that continues ASCII.
/// start_m : ndarray of float64, shape (n_axes,)
///     Where it begins, in m.
/// feed_m_s : float
///     Speed until the first F, and of G0 unless `rapid_m_s` is given, in m/s.
/// dt_s : float
///     Sample time in s.
/// velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s.
/// acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^2.
/// jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
///     Limit of each axis, in m/s^3.
/// rapid_m_s : float, optional
///     Speed of G0, in m/s.
/// blend_s : float, optional
///     Window that rounds the corners, in s; without it every move is at rest
///     at its end.
/// block_delete : bool
///     Whether blocks that begin with / are left out.
///
/// Returns
/// -------
/// Trajectory
///     Its acceleration is the central difference of its velocity.
///
/// Raises
/// ------
/// TrajectoryError
///     If a word is not understood, with its line, or a limit would be broken.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> path = trajectory.gcode(
/// ...     "G1 X10 F3000\nG3 X0 Y10 I-10 J0", start_m=[0.0, 0.0], feed_m_s=0.05, dt_s=0.002,
/// ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=100.0)
/// >>> path.position_m[-1].tolist()
/// [0.0, 0.01]
#[pyfunction]
#[pyo3(signature = (text, *, start_m, feed_m_s, dt_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3, rapid_m_s=None, blend_s=None, block_delete=false))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn gcode(
    py: Python<'_>,
    text: &Bound<'_, PyAny>,
    start_m: &Bound<'_, PyAny>,
    feed_m_s: f64,
    dt_s: f64,
    velocity_max_m_s: &Bound<'_, PyAny>,
    acceleration_max_m_s2: &Bound<'_, PyAny>,
    jerk_max_m_s3: &Bound<'_, PyAny>,
    rapid_m_s: Option<f64>,
    blend_s: Option<f64>,
    block_delete: bool,
) -> PyResult<PyTrajectory> {
    let bytes = match text.extract::<&[u8]>() {
        Ok(bytes) => bytes,
        Err(_) => text.extract::<&str>()?.as_bytes(),
    };
    let start = read_vector("start_m", start_m)?;
    let limits = read_limits(start.len(), velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3)?;
    let setting = GcodeSetting {
        start_m: &start,
        feed_m_s,
        rapid_m_s: rapid_m_s.unwrap_or(feed_m_s),
        rotary: &[],
        exact_corners: blend_s.is_none(),
        block_delete,
    };
    let program = read_gcode(bytes, &setting)
        .map_err(|error| exceptions::TrajectoryError::new_err(error.to_string()))?;
    let spec = PathSpec {
        start_m: start,
        segments: program.segments,
        blend_s,
        dwell_before_s: program.dwell_before_s,
        dwell_after_s: 0.0,
    };
    planned(py, || sample_path(&spec, &limits, dt_s))
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
    module.add_function(wrap_pyfunction!(jerk_limited, module)?)?;
    module.add_function(wrap_pyfunction!(exponential_sigmoid, module)?)?;
    module.add_function(wrap_pyfunction!(modulated, module)?)?;
    module.add_function(wrap_pyfunction!(spline, module)?)?;
    module.add_function(wrap_pyfunction!(butterfly, module)?)?;
    module.add_function(wrap_pyfunction!(spiral, module)?)?;
    module.add_function(wrap_pyfunction!(raster, module)?)?;
    module.add_function(wrap_pyfunction!(gcode, module)?)?;
    module.add_function(wrap_pyfunction!(tracking_index, module)?)
}
