//! Weights along the run: `ilc_rt.weights`, and their conversion for laws.

use ilc_rt::learning::weights::{
    Contour, ContourTerms, Coupled, Formation, Gain, Objective, Pass, Schedule, Weight, band,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::answer::{Array, give_matrices, give_signal, give_vector};
use crate::argument::{Matrix, misfit, read_array};
use crate::arguments::Arguments;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::model::PyStateSpace;
use crate::whole::{each, number, pair, shown, whole};

/// Reads a number, or one per sample.
fn read_gain(a: Arguments<'_, '_>, name: &str, n_samples: usize) -> PyResult<Gain> {
    let (values, shape) = read_array(name, &a.get(name)?)?;
    match shape[..] {
        [] => Ok(Gain::Constant(values[0])),
        [length] if length == n_samples => Ok(Gain::PerSample(values)),
        _ => Err(misfit(name, &shape, &format!("() or ({n_samples},)"))),
    }
}

/// Reads a number, or one per agent, per sample, or per agent and sample.
fn read_gains(
    a: Arguments<'_, '_>,
    name: &str,
    (n_samples, n_agents): (usize, usize),
) -> PyResult<Vec<Gain>> {
    let (values, shape) = read_array(name, &a.get(name)?)?;
    let (rows, cols) = match shape[..] {
        [] => (1, 1),
        [cols] => (1, cols),
        [rows, cols] => (rows, cols),
        _ => (0, 0),
    };
    let fits = (rows == 1 || rows == n_samples) && (cols == 1 || cols == n_agents);
    if !fits || values.is_empty() {
        let rule = format!(
            "(), ({n_agents},) for one an agent, ({n_samples}, 1) for one a sample, or \
             ({n_samples}, {n_agents})"
        );
        return Err(misfit(name, &shape, &rule));
    }
    let column = |agent: usize| values.iter().skip(agent).step_by(cols).copied();
    let of = |agent: usize| match rows {
        1 => Gain::Constant(values[agent]),
        _ => Gain::PerSample(column(agent).collect()),
    };
    Ok((0..cols).map(of).collect())
}

/// Reads a matrix, or one per sample.
pub(crate) fn read_matrices(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<Matrix>> {
    let (values, shape) = read_array(name, object)?;
    match shape[..] {
        [rows, cols] | [_, rows, cols] if !values.is_empty() => {
            let block = |block| Matrix::from_row_slice(rows, cols, block);
            Ok(values.chunks(rows * cols).map(block).collect())
        }
        _ => Err(misfit(name, &shape, "(rows, columns) or (n_samples, rows, columns)")),
    }
}

/// Returns a weight to Python as one matrix per sample.
fn give_blocks<'py>(py: Python<'py>, weight: &Weight, n_samples: usize, p: usize) -> Array<'py> {
    let values = weight.values(n_samples, p).or_raise()?;
    Ok(give_matrices(py, (n_samples, p, p), |k, row, col| values[(k * p + row) * p + col]))
}

/// Reads a contour with its weights; also the samples and outputs of its reference.
pub(crate) fn read_contour(a: Arguments<'_, '_>) -> PyResult<(Weight, usize, usize)> {
    let reference = a.signal("reference")?;
    let (n_samples, p) = (reference.n_samples, reference.n_channels);
    let (q, gain) = (a.weight("q", n_samples, p)?, |name| read_gain(a, name, n_samples));
    let terms = ContourTerms { q, contour: gain("contour")?, along: gain("along")? };
    let axes = a.maybe_wholes("axes")?.unwrap_or_else(|| (0..p).collect());
    let weight = detached(a.py(), || Contour::of_axes(&reference.values, p, &axes)?.weight(&terms));
    Ok((weight.or_raise()?, n_samples, p))
}

/// Reads the objective of several agents, as a weight of all their errors.
pub(crate) fn read_formation_weight(
    a: Arguments<'_, '_>,
    n_samples: usize,
    n_agents: usize,
    n_axes: usize,
) -> PyResult<Weight> {
    let formation = read_formation(a, n_agents, n_axes)?;
    let gains = |name: &str| read_gains(a, name, (n_samples, n_agents));
    let weight = a.weight("weight", n_samples, n_axes)?;
    let objective = Objective {
        own: vec![weight.clone()],
        centre: weight,
        own_share: match a.maybe_wholes("leaders")? {
            Some(leaders) => Objective::led_by(n_agents, &leaders).or_raise()?.own_share,
            None => gains("own")?,
        },
        centre_share: gains("centre")?,
        tracking_share: gains("tracking")?,
        sigma: gains("sigma")?,
    };
    detached(a.py(), || formation.weight(n_samples, &objective)).or_raise()
}

fn read_formation(a: Arguments<'_, '_>, n_agents: usize, n_axes: usize) -> PyResult<Formation> {
    // Before a list as long as they say.
    Formation::check_size(n_agents, n_axes).or_raise()?;
    let pairs = a.maybe_pairs("pairs")?.unwrap_or_else(|| Formation::all_pairs(n_agents));
    let axes = a.maybe_wholes("axes")?.unwrap_or_else(|| (0..n_axes).collect());
    Formation::of_pairs(n_agents, n_axes, &pairs, &axes).or_raise()
}

#[pyfunction]
pub(crate) fn contour_weights<'py>(a: Arguments<'_, 'py>) -> Array<'py> {
    let (weight, n_samples, p) = read_contour(a)?;
    give_blocks(a.py(), &weight, n_samples, p)
}

#[pyfunction]
pub(crate) fn coupled_weights<'py>(a: Arguments<'_, 'py>) -> Array<'py> {
    let matrices = read_matrices("coupling", &a.get("coupling")?)?;
    let (n_samples, p) = (matrices.len(), matrices[0].ncols());
    let gain = |name| read_gain(a, name, n_samples);
    let shares = Coupled { sigma: gain("sigma")?, gamma: gain("gamma")? };
    let weight = detached(a.py(), || shares.weight(n_samples, &matrices)).or_raise()?;
    give_blocks(a.py(), &weight, n_samples, p)
}

#[pyfunction]
pub(crate) fn schedule<'py>(a: Arguments<'_, 'py>) -> Array<'py> {
    let n_samples = a.whole("n_samples")?;
    let steps = Schedule::new(&read_segments(&a.get("segments")?)?).or_raise()?;
    let schedule = match (a.maybe_number("bandwidth_hz")?, a.maybe_number("dt_s")?) {
        (None, None) => steps,
        (Some(bandwidth_hz), Some(dt_s)) => steps.smoothed(bandwidth_hz, dt_s).or_raise()?,
        _ => return Err(PyValueError::new_err("bandwidth_hz and dt_s belong together: give both")),
    };
    let values = detached(a.py(), || schedule.samples(n_samples)).or_raise()?;
    Ok(give_vector(a.py(), values))
}

/// Reads segments: the start and the value of each.
fn read_segments(object: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, f64)>> {
    let needed = "a pair of a sample and a number";
    each("segments", object, "a sequence of (start, value)", |both| {
        let (start, value) = pair("segments", both, needed)?;
        let value = number("segments", &value).map_err(|error| {
            if error.is_instance_of::<PyTypeError>(both.py()) {
                let text = shown(both);
                return PyTypeError::new_err(format!("segments holds {text}; {needed} is needed"));
            }
            error
        })?;
        Ok((whole("segments", &start)?, value))
    })
}

#[pyfunction]
pub(crate) fn formation_weights<'py>(a: Arguments<'_, 'py>) -> Array<'py> {
    let (n_agents, n_axes) = (a.whole("n_agents")?, a.whole("n_axes")?);
    let n_samples = a.whole("n_samples")?;
    let weight = read_formation_weight(a, n_samples, n_agents, n_axes)?;
    give_blocks(a.py(), &weight, n_samples, n_agents * n_axes)
}

#[pyfunction]
pub(crate) fn formation_errors<'py>(a: Arguments<'_, 'py>) -> Array<'py> {
    let (e, n_agents) = (a.signal("e")?, a.whole("n_agents")?);
    if n_agents == 0 || !e.n_channels.is_multiple_of(n_agents) {
        let rule = format!("(n_samples, n_axes of {n_agents} agents)");
        return Err(misfit("e", &e.shape(), &rule));
    }
    let formation = read_formation(a, n_agents, e.n_channels / n_agents)?;
    let rows = formation.shape().nrows();
    let values = detached(a.py(), || formation.errors(&e.values)).or_raise()?;
    give_signal(a.py(), values, rows, false)
}

#[pyfunction]
pub(crate) fn band_filter(a: Arguments<'_, '_>) -> PyResult<PyStateSpace> {
    let pass = a.choice("passes", &[("low", Pass::Low), ("high", Pass::High)])?;
    let shape = (a.whole("order")?, a.number("cutoff_hz")?);
    let filter = band(pass, shape, a.number("dt_s")?, a.whole("n_channels")?);
    filter.or_raise().map(PyStateSpace::from)
}
