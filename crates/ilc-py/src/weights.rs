//! Weights along the run: `ilc_rt.weights`, and how a weight comes from and goes to Python.

use ilc_rt::learning::LearningError;
use ilc_rt::learning::weights::{
    Contour, ContourTerms, Coupled, Formation, Gain, Objective, Schedule, Weight,
};
use numpy::IntoPyArray;
use numpy::ndarray::Array3;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::argument::{Matrix, Signal, give_signal, misfit, read_array};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::laws::weight;
use crate::whole;

/// An argument that has a default.
pub(crate) type Given<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

/// Reads a weight, or takes the default.
pub(crate) fn read_weight(
    name: &str,
    given: Given<'_, '_>,
    default: f64,
    n_samples: usize,
    n_channels: usize,
) -> PyResult<Weight> {
    given.map_or(Ok(Weight::Scalar(default)), |given| {
        weight::read_weight(name, given, n_samples, n_channels)
    })
}

/// Reads a number, or one a sample, or takes the default.
fn read_gain(name: &str, given: Given<'_, '_>, default: f64, n_samples: usize) -> PyResult<Gain> {
    let Some(given) = given else { return Ok(Gain::Constant(default)) };
    let (values, shape) = read_array(name, given)?;
    match shape[..] {
        [] => Ok(Gain::Constant(values[0])),
        [length] if length == n_samples => Ok(Gain::PerSample(values)),
        _ => Err(misfit(name, &shape, &format!("() or ({n_samples},)"))),
    }
}

/// Reads one gain for each agent from what broadcasts to `(n_samples, n_agents)`.
fn read_gains(
    name: &str,
    given: Given<'_, '_>,
    default: f64,
    (n_samples, n_agents): (usize, usize),
) -> PyResult<Vec<Gain>> {
    let Some(given) = given else { return Ok(vec![Gain::Constant(default)]) };
    let (values, shape) = read_array(name, given)?;
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

/// Reads one matrix a sample, `(n_samples, rows, columns)`, or a single one.
pub(crate) fn read_matrices(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<Matrix>> {
    let (values, shape) = read_array(name, object)?;
    match shape[..] {
        [rows, cols] | [_, rows, cols] if !values.is_empty() => Ok(blocks(&values, rows, cols)),
        _ => Err(misfit(name, &shape, "(rows, columns) or (n_samples, rows, columns)")),
    }
}

fn blocks(values: &[f64], rows: usize, cols: usize) -> Vec<Matrix> {
    values.chunks(rows * cols).map(|block| Matrix::from_row_slice(rows, cols, block)).collect()
}

/// Returns a weight to Python as one block a sample.
fn give_blocks<'py>(
    py: Python<'py>,
    weight: &Weight,
    n_samples: usize,
    p: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let mut values = Vec::with_capacity(n_samples * p * p);
    for k in 0..n_samples {
        // Symmetric: by columns is by rows.
        values.extend_from_slice(weight.at(k, p).as_slice());
    }
    if let Some(at) = values.iter().position(|value| !value.is_finite()) {
        let (what, sample) = ("weight", at / (p * p));
        let reason = "what it is made of is so large that it is not finite".to_owned();
        return Err(LearningError::Weight { what, sample, reason }).or_raise();
    }
    Array3::from_shape_vec((n_samples, p, p), values)
        .map(|array| array.into_pyarray(py).into_any())
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Returns the contour weight that Python describes, its samples and its channels.
pub(crate) fn read_contour(
    py: Python<'_>,
    reference: &Bound<'_, PyAny>,
    q: Given<'_, '_>,
    contour: Given<'_, '_>,
    along: Given<'_, '_>,
    axes: Option<Vec<usize>>,
) -> PyResult<(Weight, usize, usize)> {
    let reference = Signal::read("reference", reference)?;
    let (n_samples, p) = (reference.n_samples, reference.n_channels);
    let terms = ContourTerms {
        q: read_weight("q", q, 1.0, n_samples, p)?,
        contour: read_gain("contour", contour, 1.0, n_samples)?,
        along: read_gain("along", along, 0.0, n_samples)?,
    };
    let axes = axes.unwrap_or_else(|| (0..p).collect());
    let weight = detached(py, || Contour::of_axes(&reference.values, p, &axes)?.weight(&terms))
        .or_raise()?;
    Ok((weight, n_samples, p))
}

/// What several agents are to do, as Python gives it.
#[derive(Debug)]
pub(crate) struct Task<'a, 'py> {
    pub(crate) tracking: Given<'a, 'py>,
    pub(crate) own: Given<'a, 'py>,
    pub(crate) centre: Given<'a, 'py>,
    pub(crate) sigma: Given<'a, 'py>,
    pub(crate) weight: Given<'a, 'py>,
    pub(crate) leaders: Option<Vec<usize>>,
    pub(crate) pairs: Option<Vec<(usize, usize)>>,
    pub(crate) axes: Option<Vec<usize>>,
}

impl Task<'_, '_> {
    /// Returns the weight of all agents together.
    pub(crate) fn read(
        self,
        py: Python<'_>,
        n_samples: usize,
        n_agents: usize,
        n_axes: usize,
    ) -> PyResult<Weight> {
        let formation = read_formation(n_agents, n_axes, self.pairs, self.axes)?;
        let gains =
            |name: &str, given, default| read_gains(name, given, default, (n_samples, n_agents));
        let weight = read_weight("weight", self.weight, 1.0, n_samples, n_axes)?;
        let objective = Objective {
            own: vec![weight.clone()],
            centre: weight,
            own_share: match self.leaders {
                Some(leaders) => Objective::led_by(n_agents, &leaders).or_raise()?.own_share,
                None => gains("own", self.own, 1.0)?,
            },
            centre_share: gains("centre", self.centre, 0.0)?,
            tracking_share: gains("tracking", self.tracking, 1.0)?,
            sigma: gains("sigma", self.sigma, 1.0)?,
        };
        detached(py, || formation.weight(n_samples, &objective)).or_raise()
    }
}

fn read_formation(
    n_agents: usize,
    n_axes: usize,
    pairs: Option<Vec<(usize, usize)>>,
    axes: Option<Vec<usize>>,
) -> PyResult<Formation> {
    let pairs = pairs.unwrap_or_else(|| Formation::all_pairs(n_agents));
    let axes = axes.unwrap_or_else(|| (0..n_axes).collect());
    Formation::of_pairs(n_agents, n_axes, &pairs, &axes).or_raise()
}

/// Return weights by which the error across the path counts more.
///
/// ``Q_k = q I + contour (I - t_k t_k') + along t_k t_k'`` with ``t_k`` the unit
/// tangent of the reference.
///
/// Parameters
/// ----------
/// reference : ndarray of float64, shape (n_samples, n_outputs)
///     Reference of every output, the axes of the path in one unit.
/// q : float or ndarray of shape (n_samples,), (p, p) or (n_samples, p, p)
///     Weight of every output by itself.
/// contour : float or ndarray of shape (n_samples,)
///     Weight of the error across the path: to first order the contour error.
/// along : float or ndarray of shape (n_samples,)
///     Weight of the error along the path.
/// axes : sequence of int, optional
///     Outputs that make the path; by default all.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples, n_outputs, n_outputs)
///     Weight of the error, to be given to a law as `q`.
///
/// Raises
/// ------
/// LearningError
///     If a weight is negative or does not fit, the path never moves, or it has
///     fewer than two axes.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// Notes
/// -----
/// Where the reference rests its tangent is undefined; there the one nearest in
/// time holds. With q = along = 0 nothing weighs the error along the path: give
/// the law an s or r above 0.
///
/// References
/// ----------
/// [barton2010], Eq. (4.1) to (4.3), (5.9) to (5.11).
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import weights
/// >>> line = np.outer(np.linspace(0.0, 0.1, 5), [1.0, 1.0])
/// >>> weights.contour(line, q=0.0, contour=2.0)[2].round(12).tolist()
/// [[1.0, -1.0], [-1.0, 1.0]]
#[pyfunction]
#[pyo3(
    name = "contour_weights",
    signature = (
        reference, q=None, contour=None, along=None,
        axes=None
    ),
    text_signature = "(reference, q=1.0, contour=1.0, along=0.0, axes=None)"
)]
fn contour<'py>(
    py: Python<'py>,
    reference: &Bound<'py, PyAny>,
    q: Option<&Bound<'py, PyAny>>,
    contour: Option<&Bound<'py, PyAny>>,
    along: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = whole::maybe_list::axes)] axes: Option<Vec<usize>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (weight, n_samples, p) = read_contour(py, reference, q, contour, along, axes)?;
    give_blocks(py, &weight, n_samples, p)
}

/// Return weights that divide between channels and coupled signals.
///
/// ``Q_k = sigma_k (gamma_k I + (1 - gamma_k) C_k' C_k)``
///
/// Parameters
/// ----------
/// coupling : ndarray of float64, shape (n_samples, c, p)
///     What each of p channels contributes to each of c coupled signals, as
///     ``[-sin theta, cos theta]`` to the contour error.
/// sigma : float or ndarray of shape (n_samples,)
///     Overall weight.
/// gamma : float or ndarray of shape (n_samples,)
///     Share of the channels by themselves, 0 to 1.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples, p, p)
///     Weight, to be given to a law as `q`, `s` or `r`.
///
/// Raises
/// ------
/// LearningError
///     If sigma is negative or gamma outside 0 to 1, or a length does not fit.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [barton2010], Eq. (5.2) to (5.7).
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import weights
/// >>> coupling = np.broadcast_to([[-0.6, 0.8]], (3, 1, 2))
/// >>> weights.coupled(coupling, sigma=2.0, gamma=0.0)[0].round(12).tolist()
/// [[0.72, -0.96], [-0.96, 1.28]]
#[pyfunction]
#[pyo3(
    name = "coupled_weights",
    signature = (coupling, sigma=None, gamma=None),
    text_signature = "(coupling, sigma=1.0, gamma=0.0)"
)]
fn coupled<'py>(
    py: Python<'py>,
    coupling: &Bound<'py, PyAny>,
    sigma: Option<&Bound<'py, PyAny>>,
    gamma: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let matrices = read_matrices("coupling", coupling)?;
    let (n_samples, p) = (matrices.len(), matrices[0].ncols());
    let shares = Coupled {
        sigma: read_gain("sigma", sigma, 1.0, n_samples)?,
        gamma: read_gain("gamma", gamma, 0.0, n_samples)?,
    };
    let weight = detached(py, || shares.weight(n_samples, &matrices)).or_raise()?;
    give_blocks(py, &weight, n_samples, p)
}

/// Return numbers that switch smoothly from one part of a run to the next.
///
/// Each value holds from its start on; a Gaussian filter makes the steps smooth.
///
/// Parameters
/// ----------
/// segments : sequence of (int, float)
///     First sample and value of each part; the first at sample 0.
/// n_samples : int
///     Samples of a run.
/// bandwidth_hz : float, optional
///     Frequency in Hz that the filter lowers to 1/sqrt(2); by default the values
///     step. From 10 % to 90 % takes 0.34 / bandwidth_hz seconds.
/// dt_s : float, optional
///     Sample time in seconds; needed with `bandwidth_hz`.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples,)
///     Values, none outside the range of those given.
///
/// Raises
/// ------
/// LearningError
///     If the starts do not rise from 0 within the run, or a value is not finite.
/// SignalError
///     If there is no such filter, or it is longer than the run.
/// ValueError
///     If only one of `bandwidth_hz` and `dt_s` is given.
///
/// References
/// ----------
/// [barton2010], sections 5.4.2 and 5.4.3, listing H.3.
///
/// Examples
/// --------
/// >>> from ilc_rt import weights
/// >>> weights.schedule([(0, 1.0), (2, 30.0)], 4).tolist()
/// [1.0, 1.0, 30.0, 30.0]
#[pyfunction]
#[pyo3(signature = (segments, n_samples, bandwidth_hz=None, dt_s=None))]
#[expect(clippy::needless_pass_by_value, reason = "arguments from Python are owned")]
fn schedule(
    py: Python<'_>,
    #[pyo3(from_py_with = whole::segments)] segments: Vec<(usize, f64)>,
    #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
    bandwidth_hz: Option<f64>,
    dt_s: Option<f64>,
) -> PyResult<Bound<'_, PyAny>> {
    let steps = Schedule::new(&segments).or_raise()?;
    let schedule = match (bandwidth_hz, dt_s) {
        (None, None) => steps,
        (Some(bandwidth_hz), Some(dt_s)) => steps.smoothed(bandwidth_hz, dt_s).or_raise()?,
        _ => return Err(PyValueError::new_err("bandwidth_hz and dt_s belong together: give both")),
    };
    let values = detached(py, || schedule.samples(n_samples)).or_raise()?;
    give_signal(py, values, 1, true)
}

/// Return weights of several agents that keep a formation.
///
/// ``Q = sigma (tracking (own Q_i + centre K' Q_c K) + (1 - tracking) F' F)``
///
/// Parameters
/// ----------
/// n_agents, n_axes : int
///     Agents, and axes of each; their errors stand one agent after the other.
/// n_samples : int
///     Samples of a run.
/// tracking : float or array that broadcasts to (n_samples, n_agents)
///     Share of tracking; the rest is the formation's.
/// own : float or array that broadcasts to (n_samples, n_agents)
///     Share of its own error in what an agent tracks.
/// centre : float or array that broadcasts to (n_samples, n_agents)
///     Share of the error of the formation's centre in what an agent tracks.
/// sigma : float or array that broadcasts to (n_samples, n_agents)
///     Overall weight.
/// weight : float or ndarray of shape (n_samples,), (d, d) or (n_samples, d, d)
///     Weight of the d axes of an agent, and of the centre.
/// leaders : sequence of int, optional
///     Agents that alone track their references; takes the place of `own`.
/// pairs : sequence of (int, int), optional
///     Pairs of agents that keep their offset; by default all.
/// axes : sequence of int, optional
///     Axes of an agent that keep the offset; by default all.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples, n_agents * n_axes, n_agents * n_axes)
///     Weight of all agents' errors, to be given to a law as `q`.
///
/// Raises
/// ------
/// LearningError
///     If a share lies outside 0 to 1, a weight is negative, or an agent or axis
///     is not there.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// Notes
/// -----
/// The formation error of agents i and j is ``e_j - e_i``: the wanted offset, as
/// their references have it, less the actual one. Where agents that a term
/// couples have different gains, the symmetric form of the product is taken.
///
/// References
/// ----------
/// [barton2010], Eq. (6.1) to (6.9), (6.13) to (6.15).
///
/// Examples
/// --------
/// >>> from ilc_rt import weights
/// >>> weights.formation(2, 1, 3, tracking=0.75)[0].tolist()
/// [[1.0, -0.25], [-0.25, 1.0]]
#[pyfunction]
#[pyo3(
    name = "formation_weights",
    signature = (
        n_agents, n_axes, n_samples, tracking=None, own=None,
        centre=None, sigma=None, weight=None,
        leaders=None, pairs=None, axes=None
    ),
    text_signature = "(n_agents, n_axes, n_samples, tracking=1.0, own=1.0, centre=0.0, sigma=1.0, \
                      weight=1.0, leaders=None, pairs=None, axes=None)"
)]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn formation<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = whole::n_agents)] n_agents: usize,
    #[pyo3(from_py_with = whole::n_axes)] n_axes: usize,
    #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
    tracking: Option<&Bound<'py, PyAny>>,
    own: Option<&Bound<'py, PyAny>>,
    centre: Option<&Bound<'py, PyAny>>,
    sigma: Option<&Bound<'py, PyAny>>,
    weight: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = whole::maybe_list::leaders)] leaders: Option<Vec<usize>>,
    #[pyo3(from_py_with = whole::maybe_pairs::pairs)] pairs: Option<Vec<(usize, usize)>>,
    #[pyo3(from_py_with = whole::maybe_list::axes)] axes: Option<Vec<usize>>,
) -> PyResult<Bound<'py, PyAny>> {
    let task = Task { tracking, own, centre, sigma, weight, leaders, pairs, axes };
    let weight = task.read(py, n_samples, n_agents, n_axes)?;
    give_blocks(py, &weight, n_samples, n_agents * n_axes)
}

/// Return the formation errors of several agents.
///
/// ``e_j - e_i`` for each axis and each pair of agents, axis by axis.
///
/// Parameters
/// ----------
/// e : ndarray of float64, shape (n_samples, n_agents * n_axes)
///     Errors of all agents, one agent after the other.
/// n_agents : int
///     Agents.
/// pairs : sequence of (int, int), optional
///     Pairs of agents; by default all.
/// axes : sequence of int, optional
///     Axes of an agent; by default all.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples, n_axes * n_pairs)
///     Wanted offset less actual one.
///
/// Raises
/// ------
/// LearningError
///     If an agent or axis is not there.
/// ValueError, TypeError
///     If `e` has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [barton2010], Eq. (4.4).
///
/// Examples
/// --------
/// >>> from ilc_rt import weights
/// >>> weights.formation_errors([[1.0, 2.0, 4.0, 6.0]], 2).tolist()
/// [[3.0, 4.0]]
#[pyfunction]
#[pyo3(signature = (e, n_agents, pairs=None, axes=None))]
fn formation_errors<'py>(
    py: Python<'py>,
    e: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = whole::n_agents)] n_agents: usize,
    #[pyo3(from_py_with = whole::maybe_pairs::pairs)] pairs: Option<Vec<(usize, usize)>>,
    #[pyo3(from_py_with = whole::maybe_list::axes)] axes: Option<Vec<usize>>,
) -> PyResult<Bound<'py, PyAny>> {
    let e = Signal::read("e", e)?;
    if n_agents == 0 || !e.n_channels.is_multiple_of(n_agents) {
        let rule = format!("(n_samples, n_axes of {n_agents} agents)");
        return Err(misfit("e", &e.shape(), &rule));
    }
    let formation = read_formation(n_agents, e.n_channels / n_agents, pairs, axes)?;
    let rows = formation.shape().nrows();
    let values = detached(py, || formation.errors(&e.values)).or_raise()?;
    give_signal(py, values, rows, false)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(contour, module)?)?;
    module.add_function(wrap_pyfunction!(coupled, module)?)?;
    module.add_function(wrap_pyfunction!(schedule, module)?)?;
    module.add_function(wrap_pyfunction!(formation, module)?)?;
    module.add_function(wrap_pyfunction!(formation_errors, module)?)
}
