//! Builders of laws with a memory of runs: `relevance` and `flexible`, filled from a library.

use ilc_rt::learning::law::flexible::{Flexible, TableShape};
use ilc_rt::learning::law::relevance::{Relevance, RelevanceWeights, RunShape};
use ilc_rt::library::{LibraryError, Task};
use ilc_rt::record::IterationRecord;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use super::figure::{Figure, Readable};
use super::{Builder, Built, Call, Fits, Size};
use crate::argument::read_disturbance;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::library::PyLibrary;
use crate::python_law::Channels;
use crate::whole::number;

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[("relevance", relevance), ("flexible", flexible)];

pub(super) fn relevance(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let weights = read_weights(&a.get("weights")?)?;
    let top = a.maybe_whole("top")?;
    let dt_s = a.maybe_number("dt_s")?;
    let has_library = a.given("library")?.is_some();
    if weights.error_rate > 0.0 && dt_s.is_none() && !has_library {
        return Err(no_sample_time(&weights));
    }
    let size = call.size.unwrap_or(Size { n_disturbances: weights.disturbance.len(), ..Size::ONE });
    let (runs, library_dt_s) = earlier_runs(call)?;
    // Without a weight of the rate, and before the first run, the sample time has no effect.
    let is_used = weights.error_rate > 0.0 && call.size.is_some();
    let dt_s = dt_s.or(library_dt_s).or((!is_used).then_some(1.0));
    let dt_s = dt_s.ok_or_else(|| no_sample_time(&weights))?;
    let Size { n_samples, channels: Channels { n_inputs, n_outputs }, n_disturbances } = size;
    let shape = RunShape { n_samples, n_inputs, n_outputs, n_disturbances, dt_s };
    let core = call.inner("core", size.channels)?;
    let law = Relevance::new(core, shape, weights, top).or_raise()?;
    filled(call, law, &runs)
}

pub(super) fn flexible(call: &Call<'_, '_>) -> PyResult<Built> {
    let tolerance = call.arguments.number("tolerance")?;
    let (runs, _) = earlier_runs(call)?;
    let Size { n_samples, channels, n_disturbances } = call.size();
    let Channels { n_inputs, n_outputs } = channels;
    let shape = TableShape { n_samples, n_inputs, n_outputs, n_disturbances, tolerance };
    let law = Flexible::new(call.inner("core", channels)?, shape).or_raise()?;
    filled(call, law, &runs)
}

/// Returns the law with the runs of earlier campaigns in memory.
fn filled<L: Readable + 'static>(
    call: &Call<'_, '_>,
    mut law: L,
    runs: &[IterationRecord],
) -> PyResult<Built> {
    detached(call.py(), || {
        let recall = |run: &IterationRecord| {
            law.recall(&run.input, &run.error_m, &run.disturbance).map(drop)
        };
        runs.iter().try_for_each(recall)
    })
    .or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::First })
}

/// Reads the runs of the library that match the coming ones, and their sample time.
fn earlier_runs(call: &Call<'_, '_>) -> PyResult<(Vec<IterationRecord>, Option<f64>)> {
    let library = call.arguments.given("library")?;
    let task = Task { cell: call.arguments.maybe_text("cell")? };
    let library = library.map(|given| {
        given.cast_into::<PyLibrary>().map_err(|other| {
            PyTypeError::new_err(format!("library: {other}; a Library or None is needed"))
        })
    });
    let (Some(library), Some(size)) = (library.transpose()?, call.size) else {
        return Ok((Vec::new(), None));
    };
    let Size { n_samples, channels: Channels { n_inputs, n_outputs }, n_disturbances } = size;
    if n_inputs != n_outputs {
        return Ok((Vec::new(), None));
    }
    let library = library.get();
    detached(call.py(), || {
        library.read(|library| {
            let (ids, dt_s) = library.fitting(n_samples, n_inputs, n_disturbances, &task)?;
            let runs: Result<Vec<_>, LibraryError> =
                ids.into_iter().map(|id| library.load(id).map(|row| row.record)).collect();
            Ok((runs?, dt_s))
        })
    })
    .or_raise()
}

impl Readable for Relevance {
    fn figure(&self, name: &str) -> Option<Figure> {
        (name == "n_runs").then(|| Figure::Count(self.len()))
    }

    fn has_inner(&self) -> bool {
        true
    }

    fn relevance(&mut self) -> Option<&mut Relevance> {
        Some(self)
    }
}

impl Readable for Flexible {
    fn figure(&self, name: &str) -> Option<Figure> {
        (name == "n_runs").then(|| Figure::Count(self.len()))
    }

    fn has_inner(&self) -> bool {
        true
    }
}

/// Reads any object with the attributes of `ilc_rt.RelevanceWeights`.
fn read_weights(object: &Bound<'_, PyAny>) -> PyResult<RelevanceWeights> {
    let part = |name: &str| number(name, &object.getattr(name)?);
    let disturbance = read_disturbance("disturbance", &object.getattr("disturbance")?)?;
    let n = disturbance.len();
    RelevanceWeights {
        error: part("error")?,
        error_rate: part("error_rate")?,
        disturbance,
        epsilon: part("epsilon")?,
        rate_filter_s: part("rate_filter_s")?,
        error_gain: part("error_gain")?,
        input_gain: part("input_gain")?,
    }
    .spread(n)
    .or_raise()
}

/// Refuses invalid weights of the relevance.
#[pyfunction]
pub(crate) fn check_relevance_weights(weights: &Bound<'_, PyAny>) -> PyResult<()> {
    read_weights(weights).map(drop)
}

fn no_sample_time(weights: &RelevanceWeights) -> PyErr {
    PyValueError::new_err(format!(
        "dt_s = None: the weight of the error's rate, {}, needs the sample time, and no library has it",
        weights.error_rate
    ))
}
