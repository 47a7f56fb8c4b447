//! `RelevanceIlc`.

use ilc_rt::learning::law::relevance::{Relevance, RelevanceWeights, RunShape};
use ilc_rt::learning::{Law, LearningError};
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::recalled::{Recalled, Size};
use super::relevance_weights::read_weights;
use crate::argument::read_disturbance;
use crate::error::OrRaise;
use crate::library::PyLibrary;
use crate::made::{Made, made};
use crate::whole;

/// Learning from every past run, weighted by its relevance (DPW-ILC).
///
/// ``u' = sum_j w_j L(u_j, e_j)``, ``w_j = N_j / sum_k N_k``
///
/// with L the core law and N_j the relevance of run j: large for a run whose
/// error was small and whose disturbance was like the coming one's.
///
/// Parameters
/// ----------
/// library : Library or None
///     Where runs of earlier campaigns are; those that fit are read once, at the
///     first update: the same number of samples, axes and disturbances, and the
///     same cell, program and measurement as the newest of that size. None:
///     memory only. The law never writes: `Campaign` and `Library.append` do.
/// core : law
///     What a run proposes for the next one: any law, or any object with
///     ``update(u, e, disturbance=None)`` whose result depends on u and e alone.
/// weights : RelevanceWeights or tuple (e, er, d)
///     Weights of error, error rate and disturbance.
/// top : int or None
///     How many of the most relevant runs count; None: all. Exact, and of
///     equally relevant runs the older ones.
/// dt_s : float or None
///     Sample time in seconds, for the error's rate. None: that of the runs in
///     the library.
/// cell : str or None
///     Only runs of the cell of this name.
///
/// Raises
/// ------
/// LearningError
///     If a weight is negative, top is 0 or the sample time is not above 0.
/// TypeError
///     If core is no law.
///
/// Notes
/// -----
/// The disturbance given to `update` is the coming run's: it is measured before
/// that run and used to weigh the past. The law remembers it, and stores the run
/// under it once its error is there. So the first run has to be announced by
/// `expect`; one that was not is used for the next input but not remembered.
/// Left out, the disturbance is that of the run before. At most 7 numbers.
///
/// References
/// ----------
/// [dimarco2016], Eq. (4.2) to (4.14), Appendix C.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import PdIlc, RelevanceIlc
/// >>> law = RelevanceIlc(None, PdIlc(kp=1.0, kd=0.0), (1.0, 0.0, 1.0), top=30)
/// >>> law.expect(20.0)
/// >>> law.update(np.zeros(3), np.array([1.0, 2.0, 4.0]), disturbance=25.0)
/// array([2., 4., 4.])
/// >>> len(law)
/// 1
#[pyclass(name = "RelevanceIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyRelevanceIlc {
    made: Made,
    weights: RelevanceWeights,
    top: Option<usize>,
    dt_s: Option<f64>,
    recalled: Recalled<Relevance>,
}

#[pymethods]
impl PyRelevanceIlc {
    #[new]
    #[pyo3(signature = (library, core, weights, top=None, *, dt_s=None, cell=None))]
    fn new(
        library: Option<&Bound<'_, PyLibrary>>,
        core: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::maybe::top)] top: Option<usize>,
        dt_s: Option<f64>,
        cell: Option<String>,
    ) -> PyResult<Self> {
        let made = made!(library, core, weights, top, dt_s, cell);
        let weights = read_weights(weights)?;
        if top == Some(0) {
            return Err(LearningError::Empty { what: "top" }).or_raise();
        }
        if let Some(value) = dt_s.filter(|dt_s| !(dt_s.is_finite() && *dt_s > 0.0)) {
            let allowed = "a sample time must be finite and above 0";
            return Err(LearningError::Parameter { what: "dt_s", value, allowed }).or_raise();
        }
        if library.is_none() && dt_s.is_none() && weights.error_rate > 0.0 {
            return Err(no_sample_time(&weights));
        }
        let recalled = Recalled::new(library, core, cell)?;
        Ok(Self { made, weights, top, dt_s, recalled })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Return the input of the next run.
    ///
    /// Parameters
    /// ----------
    /// u : ndarray of float64, shape (n_samples,) or (n_samples, n_inputs)
    ///     Input of the run that is over.
    /// e : ndarray of float64, shape (n_samples,) or (n_samples, n_outputs)
    ///     Error of that run, reference minus measurement, on the grid of `u`.
    /// disturbance : float or array_like of float64, shape (n_disturbances,)
    ///     Disturbance of the coming run; None: as it was.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, same shape as `u`
    ///     Input of the next run.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If an array has the wrong shape, dtype or a number that is not finite.
    /// LearningError
    ///     If the number of disturbances changes, or the core law fails.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        disturbance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.recalled.update(py, u, e, disturbance, |core, size| self.make(core, size))
    }

    /// Announce a run before it begins: the first one, or one not learned from.
    ///
    /// `update` announces the coming run by itself if it is given a disturbance.
    ///
    /// Parameters
    /// ----------
    /// disturbance : float or array_like of float64, shape (n_disturbances,)
    ///     Disturbance of the run about to begin.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If it holds no number, or one that is not finite.
    fn expect(&self, disturbance: &Bound<'_, PyAny>) -> PyResult<()> {
        self.recalled.expect(disturbance)
    }

    /// Remember a run that was made elsewhere.
    ///
    /// Parameters
    /// ----------
    /// u, e : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
    ///     Its input and error.
    /// disturbance : float or array_like of float64, shape (n_disturbances,)
    ///     The disturbance it was made under; None if none is measured.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `update` does.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn remember(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        e: &Bound<'_, PyAny>,
        disturbance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        self.recalled.remember(py, u, e, disturbance, |core, size| self.make(core, size))
    }

    /// Return which runs count under a disturbance, the most relevant first.
    ///
    /// Parameters
    /// ----------
    /// disturbance : float, array_like of float64 or None
    ///     The disturbance; None if none is measured.
    ///
    /// Returns
    /// -------
    /// runs : ndarray of int64, shape (n_runs,)
    ///     Numbers of the runs in memory, from 0.
    /// weights : ndarray of float64, shape (n_runs,)
    ///     Their weights, which add up to 1.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If it is no disturbance of this law.
    #[pyo3(signature = (disturbance=None))]
    fn relevant<'py>(
        &self,
        py: Python<'py>,
        disturbance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<RunsAndWeights<'py>> {
        let disturbance = optional(disturbance)?;
        let found = match self.recalled.with(py, |law| law.relevant(&disturbance)) {
            Some(found) => found.or_raise()?,
            None => Vec::new(),
        };
        let (runs, weights): (Vec<usize>, Vec<f64>) = found.into_iter().unzip();
        Ok((numbers(runs).into_pyarray(py), weights.into_pyarray(py)))
    }

    /// Forget all but the runs that hold most weight.
    ///
    /// Parameters
    /// ----------
    /// keep : int
    ///     How many stay.
    /// disturbances : array_like of float64 or None
    ///     Disturbances to come, shape (n, n_disturbances), or (n,) for a single
    ///     one; None: those of all runs in memory, as if they came again.
    ///
    /// Returns
    /// -------
    /// ndarray of int64, shape (n_kept,)
    ///     Numbers, before the trimming, of the runs that stayed.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If the disturbances have the wrong shape.
    ///
    /// Notes
    /// -----
    /// A run's share is the sum of its weights under each of the disturbances; the
    /// largest shares stay. For a single disturbance these are exactly the runs
    /// most relevant for it.
    #[pyo3(signature = (keep, disturbances=None))]
    fn trim<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = whole::keep)] keep: usize,
        disturbances: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let given = match disturbances.filter(|given| !given.is_none()) {
            None => Vec::new(),
            Some(given) => {
                let numpy = py.import("numpy")?;
                read_disturbance("disturbances", &numpy.call_method1("ravel", (given,))?)?
            }
        };
        let kept = match self.recalled.with(py, |law| law.trim(keep, &given)) {
            Some(kept) => kept.or_raise()?,
            None => Vec::new(),
        };
        Ok(numbers(kept).into_pyarray(py))
    }

    /// Forget every run; the library is read again at the next update.
    fn reset(&self, py: Python<'_>) {
        self.recalled.reset(py);
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.recalled.with(py, |law| law.len()).unwrap_or(0)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let top = self.top.map_or_else(|| "None".to_owned(), |top| top.to_string());
        let RelevanceWeights { error, error_rate, disturbance, .. } = &self.weights;
        let core = self.recalled.core_repr(py)?;
        Ok(format!(
            "RelevanceIlc(core={core}, weights=({error}, {error_rate}, {disturbance:?}), top={top})"
        ))
    }
}

impl PyRelevanceIlc {
    fn make(&self, core: Box<dyn Law>, size: Size) -> PyResult<Relevance> {
        let Size { n_samples, n_inputs, n_outputs, n_disturbances, library_dt_s } = size;
        // Without a weight of the rate the sample time changes nothing.
        let unused = (self.weights.error_rate <= 0.0).then_some(1.0);
        let dt_s = self.dt_s.or(library_dt_s).or(unused);
        let dt_s = dt_s.ok_or_else(|| no_sample_time(&self.weights))?;
        let shape = RunShape { n_samples, n_inputs, n_outputs, n_disturbances, dt_s };
        Relevance::new(core, shape, self.weights.clone(), self.top).or_raise()
    }
}

/// Numbers of runs, and their weights.
type RunsAndWeights<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>);

fn no_sample_time(weights: &RelevanceWeights) -> PyErr {
    PyValueError::new_err(format!(
        "dt_s = None: the weight of the error's rate, {}, needs the sample time, and no library has it",
        weights.error_rate
    ))
}

fn optional(disturbance: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    match disturbance.filter(|given| !given.is_none()) {
        Some(given) => read_disturbance("disturbance", given),
        None => Ok(Vec::new()),
    }
}

fn numbers(runs: Vec<usize>) -> Vec<i64> {
    runs.into_iter().map(|run| i64::try_from(run).unwrap_or(i64::MAX)).collect()
}
