//! The native side of `ilc_rt.trajectory`: reads arguments, plans, and gives a `Trajectory`.
//!
//! Signatures, defaults and docstrings are in Python; each function here is called by one there.

use std::collections::BTreeMap;

use ilc_rt::trajectory::curve::{Butterfly, Curve, Run, RunLimits, Spiral, Spline};
use ilc_rt::trajectory::exponential::AlphaMax;
use ilc_rt::trajectory::kind::RasterSection;
use ilc_rt::trajectory::program::{GcodeSetting, read_gcode};
use ilc_rt::trajectory::{
    AxisLimits, ExponentialSigmoid, Interpolator, Linear, LinearSetting, MAX_AXES,
    ModulatedSegment, MoveError, POINTS_A_PERIOD, PathSegment, PathSpec, SampledMotion,
    TrajectoryError, points_program,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::argument::{Signal, read_vector};
use crate::error::OrRaise;
use crate::exceptions;
use crate::trajectory::{Alpha, PyTrajectory, planned};
use crate::whole;

/// What planning and sampling gives.
type Sampled = Result<(SampledMotion, Vec<Alpha>), TrajectoryError>;

/// Limits of velocity, acceleration and jerk: each a number for all axes, or one for each.
#[derive(FromPyObject)]
struct Limits<'py>(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

impl Limits<'_> {
    /// Reads the limits of each axis.
    fn read(&self, n_axes: usize) -> PyResult<Vec<AxisLimits>> {
        if !(1..=MAX_AXES).contains(&n_axes) {
            return Err(TrajectoryError::from(MoveError::Axes { n_axes })).or_raise();
        }
        let velocity = read_each("velocity_max_m_s", &self.0, n_axes)?;
        let acceleration = read_each("acceleration_max_m_s2", &self.1, n_axes)?;
        let jerk = read_each("jerk_max_m_s3", &self.2, n_axes)?;
        let axis = |i: usize| AxisLimits {
            velocity_max_m_s: velocity[i],
            acceleration_max_m_s2: acceleration[i],
            jerk_max_m_s3: jerk[i],
        };
        Ok((0..n_axes).map(axis).collect())
    }

    /// Reads the limits of a curve with its speed: along it, and the acceleration across.
    fn read_run(&self, n_axes: usize, (feed_m_s, across): (f64, f64)) -> PyResult<RunLimits> {
        let axes = self.read(n_axes)?;
        Ok(RunLimits { feed_m_s, curvature_acceleration_max_m_s2: across, axes })
    }
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

fn finite_pair(name: &str, (x, y): (f64, f64)) -> PyResult<[f64; 2]> {
    if x.is_finite() && y.is_finite() {
        return Ok([x, y]);
    }
    Err(PyValueError::new_err(format!("{name} = ({x}, {y}); finite numbers are needed")))
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
) -> Sampled {
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
) -> Sampled {
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

fn sample_run(curve: &impl Curve, limits: &RunLimits, dt_s: f64) -> Sampled {
    Ok((Run::plan(curve, limits, dt_s)?.motion().clone(), Vec::new()))
}

fn sample_path(spec: &PathSpec, limits: &[AxisLimits], dt_s: f64) -> Sampled {
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

/// Plans straight moves with seven phases of jerk each.
#[pyfunction]
fn plan_linear(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    feed_m_s: &Bound<'_, PyAny>,
    dt_s: f64,
    limits: Limits<'_>,
    setting: &str,
) -> PyResult<PyTrajectory> {
    let points = read_points("points_m", points_m)?;
    let feeds = read_each("feed_m_s", feed_m_s, points.len() - 1)?;
    let limits = limits.read(points[0].len())?;
    let setting = read_setting(setting)?;
    let (start, segments) = moves(&points, &feeds);
    planned(py, || sample_linear(&start, &segments, &limits, setting, dt_s))
}

/// Plans an exponential/sigmoid move; `oscillation` is amplitude and frequency of each leg.
#[pyfunction]
fn plan_exponential(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    feed_m_s: &Bound<'_, PyAny>,
    dt_s: f64,
    limits: Limits<'_>,
    oscillation: (Option<Bound<'_, PyAny>>, Option<Bound<'_, PyAny>>),
    alpha_max: Option<&Bound<'_, PyAny>>,
) -> PyResult<PyTrajectory> {
    let points = read_points("points_m", points_m)?;
    let n_legs = points.len() - 1;
    let feeds = read_each("feed_m_s", feed_m_s, n_legs)?;
    let each = |name: &str, object: Option<Bound<'_, PyAny>>| {
        object.map_or_else(|| Ok(vec![0.0; n_legs]), |object| read_each(name, &object, n_legs))
    };
    let amplitudes = each("amplitude_m", oscillation.0)?;
    let frequencies = each("frequency_hz", oscillation.1)?;
    let limits = limits.read(points[0].len())?;
    let leg = |i: usize| ModulatedSegment {
        to_m: points[i + 1].clone(),
        feed_m_s: feeds[i],
        amplitude_m: amplitudes[i],
        frequency_hz: frequencies[i],
    };
    let segments: Vec<ModulatedSegment> = (0..n_legs).map(leg).collect();
    let alpha_max = read_alpha_max(alpha_max)?;
    planned(py, || sample_exponential(&points[0], &segments, &limits, &alpha_max, dt_s))
}

/// Plans a leg with an oscillation along it, as a ramped sinusoid or as a six-point sine.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn plan_modulated(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    feed_m_s: f64,
    amplitude_m: f64,
    frequency_hz: f64,
    dt_s: f64,
    limits: Limits<'_>,
    interpolation: &str,
) -> PyResult<PyTrajectory> {
    let points = read_points("points_m", points_m)?;
    let [start, end] = &points[..] else {
        return Err(PyValueError::new_err(format!(
            "points_m has {} rows; start and end, 2, are needed",
            points.len()
        )));
    };
    let limits = limits.read(start.len())?;
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

/// Plans the natural cubic spline through points; `speed` is the feed and the acceleration across.
#[pyfunction]
fn plan_spline(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    speed: (f64, f64),
    dt_s: f64,
    limits: Limits<'_>,
) -> PyResult<PyTrajectory> {
    let points = read_points("points_m", points_m)?;
    let limits = limits.read_run(points[0].len(), speed)?;
    planned(py, || sample_run(&Spline::through(&points)?, &limits, dt_s))
}

/// Plans the butterfly contour.
#[pyfunction]
fn plan_butterfly(
    py: Python<'_>,
    scale_m: f64,
    turns: f64,
    center_m: (f64, f64),
    speed: (f64, f64),
    dt_s: f64,
    limits: Limits<'_>,
) -> PyResult<PyTrajectory> {
    let limits = limits.read_run(2, speed)?;
    let center = finite_pair("center_m", center_m)?;
    planned(py, || sample_run(&Butterfly::new(scale_m, turns, center)?, &limits, dt_s))
}

/// Plans a spiral from its centre.
#[pyfunction]
fn plan_spiral(
    py: Python<'_>,
    pitch_m: f64,
    turns: f64,
    center_m: (f64, f64),
    speed: (f64, f64),
    dt_s: f64,
    limits: Limits<'_>,
) -> PyResult<PyTrajectory> {
    let limits = limits.read_run(2, speed)?;
    let center = finite_pair("center_m", center_m)?;
    planned(py, || sample_run(&Spiral::new(pitch_m, turns, center)?, &limits, dt_s))
}

/// Plans rows to and fro.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn plan_raster(
    py: Python<'_>,
    width_m: f64,
    pitch_m: f64,
    #[pyo3(from_py_with = whole::rows)] rows: usize,
    feed_m_s: f64,
    dt_s: f64,
    limits: Limits<'_>,
    start_m: (f64, f64),
    there_and_back: bool,
    setting: &str,
) -> PyResult<PyTrajectory> {
    let limits = limits.read(2)?;
    let start = finite_pair("start_m", start_m)?;
    let setting = read_setting(setting)?;
    planned(py, || {
        let raster = RasterSection { width_m, pitch_m, rows, there_and_back };
        let program = raster.segments(start, feed_m_s)?;
        sample_linear(&start, &program, &limits, setting, dt_s)
    })
}

/// Plans a part program in G-code.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn plan_gcode(
    py: Python<'_>,
    text: &Bound<'_, PyAny>,
    start_m: &Bound<'_, PyAny>,
    feed_m_s: f64,
    dt_s: f64,
    limits: Limits<'_>,
    rapid_m_s: Option<f64>,
    blend_s: Option<f64>,
    block_delete: bool,
) -> PyResult<PyTrajectory> {
    let bytes = match text.extract::<&[u8]>() {
        Ok(bytes) => bytes,
        Err(_) => text.extract::<&str>()?.as_bytes(),
    };
    let start = read_vector("start_m", start_m)?;
    let limits = limits.read(start.len())?;
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

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(plan_linear, module)?)?;
    module.add_function(wrap_pyfunction!(plan_exponential, module)?)?;
    module.add_function(wrap_pyfunction!(plan_modulated, module)?)?;
    module.add_function(wrap_pyfunction!(plan_spline, module)?)?;
    module.add_function(wrap_pyfunction!(plan_butterfly, module)?)?;
    module.add_function(wrap_pyfunction!(plan_spiral, module)?)?;
    module.add_function(wrap_pyfunction!(plan_raster, module)?)?;
    module.add_function(wrap_pyfunction!(plan_gcode, module)?)
}
