//! Trajectories: the native side of the planning functions of `ilc_rt.trajectory`.
//!
//! Each returns its samples by name; the class that holds them is `ilc_rt.trajectory.Trajectory`.

use std::time::Instant;

use ilc_rt::trajectory::curve::{Butterfly, Curve, Run, RunLimits, Spiral, Spline};
use ilc_rt::trajectory::exponential::AlphaMax;
use ilc_rt::trajectory::exponential::listing::{ListedLeg, Listing};
use ilc_rt::trajectory::kind::RasterSection;
use ilc_rt::trajectory::program::{GcodeSetting, read_gcode};
use ilc_rt::trajectory::{
    AxisLimits, ExponentialSigmoid, Linear, LinearSetting, MAX_AXES, ModulatedSegment, MoveError,
    POINTS_A_PERIOD, PathSpec, SampledMotion, TrackingIndex, TrajectoryError, points_program,
};
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyFloat;

use crate::answer::{ByName, by_name, give_signal};
use crate::argument::read_vector;
use crate::arguments::{Arguments, read};
use crate::detached::computed;
use crate::error::OrRaise;

/// A chosen alpha: segment, place, value, and its admissible intervals.
type Alpha = (usize, String, f64, Vec<(f64, f64)>);
/// A planned motion.
type Planned = Result<(SampledMotion, Vec<Alpha>), TrajectoryError>;

/// Settings by name.
pub(crate) const SETTINGS: [(&str, LinearSetting); 2] =
    [("complete", LinearSetting::CompleteEveryMove), ("on_time", LinearSetting::StartOnTime)];

/// The limits of an axis by name.
const LIMITS: [&str; 3] = ["velocity_max_m_s", "acceleration_max_m_s2", "jerk_max_m_s3"];

/// Plans a motion while other Python threads run, and returns its samples by name.
fn planned(py: Python<'_>, plan: impl FnOnce() -> Planned + Send) -> ByName<'_> {
    let begun = Instant::now();
    let (motion, alphas) = computed(py, plan)?;
    let computing_s = begun.elapsed().as_secs_f64();
    let signal = |values| give_signal(py, values, motion.n_axes, false);
    Ok(by_name!(py,
        [motion => dt_s]
        position_m: signal(motion.position_m)?,
        velocity_m_s: signal(motion.velocity_m_s)?,
        acceleration_m_s2: signal(motion.acceleration_m_s2)?,
        programmed_m: signal(motion.programmed_m)?,
        alphas: alphas,
        computing_s: computing_s,
    ))
}

/// Reads the points of a path: the coordinates of the first, and those of the others.
fn read_points(a: Arguments<'_, '_>) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let mut start = a.signal("points_m")?;
    let ends = start.values.split_off(start.n_channels);
    Ok((start.values, ends))
}

/// Reads a number for all of `n`, or one for each.
pub(crate) fn read_each(name: &str, object: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<f64>> {
    Ok(match read_all(name, object, n)? {
        All::Alike(value) => vec![value; n],
        All::Each(values) => values,
    })
}

/// A number for all, or one for each.
enum All {
    Alike(f64),
    Each(Vec<f64>),
}

impl All {
    fn of(&self, index: usize) -> f64 {
        match self {
            Self::Alike(value) => *value,
            Self::Each(values) => values[index],
        }
    }
}

fn read_all(name: &str, object: &Bound<'_, PyAny>, n: usize) -> PyResult<All> {
    if let Ok(value) = object.cast_exact::<PyFloat>() {
        return Ok(All::Alike(value.value()));
    }
    // Of an array NumPy would make a number with a warning, or an exception.
    let is_array = object.cast::<PyUntypedArray>().is_ok_and(|array| array.ndim() > 0);
    if !is_array && let Ok(value) = object.extract::<f64>() {
        return Ok(All::Alike(value));
    }
    let values = read_vector(name, object)?;
    if values.len() == n {
        return Ok(All::Each(values));
    }
    Err(PyValueError::new_err(format!(
        "{name} has {} entries; a number, or {n} of them, is needed",
        values.len()
    )))
}

/// Reads the limits of `n_axes` axes.
fn read_limits(a: Arguments<'_, '_>, n_axes: usize) -> PyResult<Vec<AxisLimits>> {
    let [velocity, acceleration, jerk] = LIMITS;
    limits_of([&a.get(velocity)?, &a.get(acceleration)?, &a.get(jerk)?], n_axes)
}

/// Reads the limits of `n_axes` axes from those of velocity, acceleration and jerk.
pub(crate) fn limits_of(
    each_limit: [&Bound<'_, PyAny>; 3],
    n_axes: usize,
) -> PyResult<Vec<AxisLimits>> {
    if !(1..=MAX_AXES).contains(&n_axes) {
        return Err(TrajectoryError::from(MoveError::Axes { n_axes })).or_raise();
    }
    let all = |i: usize| read_all(LIMITS[i], each_limit[i], n_axes);
    let [velocity, acceleration, jerk] = [all(0)?, all(1)?, all(2)?];
    let axis = |i| AxisLimits {
        velocity_max_m_s: velocity.of(i),
        acceleration_max_m_s2: acceleration.of(i),
        jerk_max_m_s3: jerk.of(i),
    };
    Ok((0..n_axes).map(axis).collect())
}

/// Reads a point in the plane.
fn read_place(a: Arguments<'_, '_>, name: &str) -> PyResult<[f64; 2]> {
    let (x, y): (f64, f64) = a.get(name)?.extract()?;
    if x.is_finite() && y.is_finite() {
        return Ok([x, y]);
    }
    Err(PyValueError::new_err(format!("{name} = ({x}, {y}); finite numbers are needed")))
}

fn sampled(plan: &Linear, limits: &[AxisLimits], dt_s: f64) -> Planned {
    Ok((plan.sampled(dt_s)?.verified(limits)?, Vec::new()))
}

fn sample_exponential(
    start_m: &[f64],
    segments: &[ModulatedSegment],
    limits: &[AxisLimits],
    alpha_max: &AlphaMax,
    dt_s: f64,
) -> Planned {
    let plan = ExponentialSigmoid::plan_below(start_m, segments, limits, alpha_max)?;
    let alphas = plan.choices().iter().map(|choice| {
        let intervals = choice.admissible.iter().map(|i| (i.from, i.to)).collect();
        (choice.segment, choice.place.to_owned(), choice.alpha, intervals)
    });
    Ok((plan.sampled(dt_s)?.verified(limits)?, alphas.collect()))
}

/// Plans a run along a curve.
fn along<'py, C: Curve>(
    a: Arguments<'_, 'py>,
    n_axes: usize,
    curve: impl FnOnce() -> Result<C, TrajectoryError> + Send,
) -> ByName<'py> {
    let limits = read!(a, RunLimits:
        [number => feed_m_s, curvature_acceleration_max_m_s2]
        axes: read_limits(a, n_axes)?,
    );
    let dt_s = a.number("dt_s")?;
    let plan = || Ok((Run::plan(&curve()?, &limits, dt_s)?.motion().clone(), Vec::new()));
    planned(a.py(), plan)
}

#[pyfunction]
pub(crate) fn jerk_limited<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (points, dt_s) = (a.signal("points_m")?, a.number("dt_s")?);
    let feeds = read_each("feed_m_s", &a.get("feed_m_s")?, points.n_samples - 1)?;
    let (limits, setting) = (read_limits(a, points.n_channels)?, a.choice("setting", &SETTINGS)?);
    planned(a.py(), || {
        sampled(&Linear::through(&points.values, &feeds, &[], &limits, setting)?, &limits, dt_s)
    })
}

#[pyfunction]
pub(crate) fn exponential_sigmoid<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let ((start, ends), dt_s) = (read_points(a)?, a.number("dt_s")?);
    let (n_axes, n_legs) = (start.len(), ends.len() / start.len());
    let each = |name: &str| {
        a.maybe(name, |name, given| read_each(name, given, n_legs))
            .map(|given| given.unwrap_or_else(|| vec![0.0; n_legs]))
    };
    let feeds = read_each("feed_m_s", &a.get("feed_m_s")?, n_legs)?;
    let (amplitudes, frequencies) = (each("amplitude_m")?, each("frequency_hz")?);
    let limits = read_limits(a, n_axes)?;
    let segment = |(i, to_m): (usize, &[f64])| ModulatedSegment {
        to_m: to_m.to_vec(),
        feed_m_s: feeds[i],
        amplitude_m: amplitudes[i],
        frequency_hz: frequencies[i],
    };
    let segments: Vec<_> = ends.chunks(n_axes).enumerate().map(segment).collect();
    let alpha_max = a.maybe("alpha_max", |_, bounds| {
        let [start_up, transition, end] = bounds.extract::<[f64; 3]>()?;
        Ok(AlphaMax { start_up, transition, end })
    })?;
    let alpha_max = alpha_max.unwrap_or_default();
    planned(a.py(), || sample_exponential(&start, &segments, &limits, &alpha_max, dt_s))
}

#[pyfunction]
pub(crate) fn modulated<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let ((start, end), dt_s) = (read_points(a)?, a.number("dt_s")?);
    if start.len() != end.len() {
        let n_rows = 1 + end.len() / start.len();
        let line = format!("points_m has {n_rows} rows; start and end, 2, are needed");
        return Err(PyValueError::new_err(line));
    }
    let limits = read_limits(a, start.len())?;
    let segment =
        read!(a, ModulatedSegment: [number => feed_m_s, amplitude_m, frequency_hz] to_m: end);
    let [complete, on_time] = SETTINGS.map(|(word, setting)| (word, Some(setting)));
    let interpolations = [("exponential_sigmoid", None), complete, on_time];
    let setting = a.choice("interpolation", &interpolations)?;
    planned(a.py(), || match setting {
        None => sample_exponential(&start, &[segment], &limits, &AlphaMax::default(), dt_s),
        Some(setting) => {
            let program = points_program(&start, &segment, POINTS_A_PERIOD)?;
            sampled(&Linear::plan(&start, &program, &limits, setting)?, &limits, dt_s)
        }
    })
}

#[pyfunction]
pub(crate) fn sigmoid_pair<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (velocity, amplitude) = (a.pair("velocity_m_s")?, a.pair("amplitude_m")?);
    let (omega, phase_zero) = (a.pair("omega_rad_s")?, a.pair("phase_zero_s")?);
    let leg = |i: usize| ListedLeg {
        velocity_m_s: velocity[i],
        amplitude_m: amplitude[i],
        omega_rad_s: omega[i],
        phase_zero_s: phase_zero[i],
    };
    let pair = read!(a, Listing:
        [number => corner_s, start_alpha, transition_alpha, sine_alpha, sine_offset_s]
        legs: [leg(0), leg(1)],
    );
    let (duration_s, dt_s) = (a.number("duration_s")?, a.number("dt_s")?);
    planned(a.py(), || Ok((pair.sample(duration_s, dt_s)?, Vec::new())))
}

#[pyfunction]
pub(crate) fn spline<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let points = a.signal("points_m")?;
    let n_axes = points.n_channels;
    let points: Vec<Vec<f64>> = points.values.chunks(n_axes).map(<[f64]>::to_vec).collect();
    along(a, n_axes, || Spline::through(&points))
}

#[pyfunction]
pub(crate) fn butterfly<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (scale_m, turns) = (a.number("scale_m")?, a.number("turns")?);
    let center = read_place(a, "center_m")?;
    along(a, 2, || Butterfly::new(scale_m, turns, center))
}

#[pyfunction]
pub(crate) fn spiral<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (pitch_m, turns) = (a.number("pitch_m")?, a.number("turns")?);
    let center = read_place(a, "center_m")?;
    along(a, 2, || Spiral::new(pitch_m, turns, center))
}

#[pyfunction]
pub(crate) fn raster<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (limits, start, dt_s) = (read_limits(a, 2)?, read_place(a, "start_m")?, a.number("dt_s")?);
    let raster = read!(a, RasterSection:
        [number => width_m, pitch_m]
        [whole => rows]
        [flag => there_and_back]
    );
    let (feed_m_s, setting) = (a.number("feed_m_s")?, a.choice("setting", &SETTINGS)?);
    planned(a.py(), || {
        let program = raster.segments(start, feed_m_s)?;
        sampled(&Linear::plan(&start, &program, &limits, setting)?, &limits, dt_s)
    })
}

#[pyfunction]
pub(crate) fn gcode<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let text = a.get("text")?;
    let bytes = match text.extract::<&[u8]>() {
        Ok(bytes) => bytes,
        Err(_) => text.extract::<&str>()?.as_bytes(),
    };
    let (start, dt_s) = (a.vector("start_m")?, a.number("dt_s")?);
    let limits = read_limits(a, start.len())?;
    let (feed_m_s, blend_s) = (a.number("feed_m_s")?, a.maybe_number("blend_s")?);
    let setting = GcodeSetting {
        start_m: &start,
        feed_m_s,
        rapid_m_s: a.maybe_number("rapid_m_s")?.unwrap_or(feed_m_s),
        rotary: &[],
        exact_corners: blend_s.is_none(),
        block_delete: a.flag("block_delete")?,
    };
    let program = read_gcode(bytes, &setting).or_raise()?;
    let spec = PathSpec {
        start_m: start,
        segments: program.segments,
        blend_s,
        dwell_before_s: program.dwell_before_s,
        dwell_after_s: 0.0,
    };
    planned(a.py(), || Ok((SampledMotion::of_path(&spec, &limits, dt_s)?, Vec::new())))
}

#[pyfunction]
pub(crate) fn tracking_index(a: Arguments<'_, '_>) -> PyResult<(f64, f64)> {
    let programmed = a.signal("programmed_m")?;
    let gains = (a.number("k_e")?, a.number("k_a")?);
    let index = TrackingIndex::of(
        &programmed.values,
        &a.signal("position_m")?.values,
        &a.signal("acceleration_m_s2")?.values,
        programmed.n_channels,
        a.number("dt_s")?,
        gains,
    )
    .or_raise()?;
    Ok((index.tracking, index.acceleration))
}
