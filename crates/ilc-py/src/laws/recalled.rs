//! Builders of laws with a memory of runs: `relevance` and `flexible`, filled from a library.

use std::sync::Arc;

use ilc_rt::learning::law::flexible::{Flexible, TableShape};
use ilc_rt::learning::law::relevance::{Relevance, RelevanceWeights, RunShape};
use ilc_rt::library::{Earlier, Task};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use super::figure::readable;
use super::{Builder, Built, Call, Fits, Size};
use crate::argument::{Channels, read_disturbance};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::library::PyLibrary;
use crate::whole::{number, whole};

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[("relevance", relevance), ("flexible", flexible)];

readable! {
    Relevance as law => n_runs: Count(law.len());

    fn has_inner(&self) -> bool {
        true
    }

    fn relevance(&mut self) -> Option<&mut Relevance> {
        Some(self)
    }
}
readable! {
    Flexible as law => n_runs: Count(law.len());

    fn has_inner(&self) -> bool {
        true
    }
}

pub(super) fn relevance(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let weights = read_weights(&a.get("weights")?)?;
    let (top, dt_s) = (a.maybe("top", whole)?, a.maybe_number("dt_s")?);
    let has_library = a.given("library")?.is_some();
    if weights.error_rate > 0.0 && dt_s.is_none() && !has_library {
        return Err(no_sample_time(&weights));
    }
    let size = call.size.unwrap_or(Size { n_disturbances: weights.disturbance.len(), ..Size::ONE });
    let earlier = earlier(call)?;
    // Without a weight of the rate, and before the first run, the sample time has no effect.
    let is_used = weights.error_rate > 0.0 && call.size.is_some();
    let of_library = earlier.as_ref().and_then(Earlier::cycle_s);
    let dt_s = dt_s.or(of_library).or((!is_used).then_some(1.0));
    let dt_s = dt_s.ok_or_else(|| no_sample_time(&weights))?;
    let Size { n_samples, channels: Channels { n_inputs, n_outputs }, n_disturbances } = size;
    let shape = RunShape { n_samples, n_inputs, n_outputs, n_disturbances, dt_s };
    let core = call.inner("core", size.channels)?;
    let mut law = Relevance::new(core, shape, weights, top).or_raise()?;
    if let Some(earlier) = earlier {
        detached(call.py(), || earlier.put_on_shelf(&mut law)).or_raise()?;
    }
    Built::of(Fits::First, Ok(law))
}

pub(super) fn flexible(call: &Call<'_, '_>) -> PyResult<Built> {
    let tolerance = call.arguments.number("tolerance")?;
    let earlier = earlier(call)?;
    let Size { n_samples, channels, n_disturbances } = call.size();
    let Channels { n_inputs, n_outputs } = channels;
    let shape = TableShape { n_samples, n_inputs, n_outputs, n_disturbances, tolerance };
    let mut law = Flexible::new(call.inner("core", channels)?, shape).or_raise()?;
    if let Some(earlier) = earlier {
        detached(call.py(), || earlier.tabulate(&mut law)).or_raise()?;
    }
    Built::of(Fits::First, Ok(law))
}

/// Returns the runs of the library that have the size of the coming ones; `None` before the first run.
fn earlier(call: &Call<'_, '_>) -> PyResult<Option<Earlier>> {
    let library = call.arguments.given("library")?;
    let task = Task { cell: call.arguments.maybe_text("cell")? };
    let library = library.map(|given| {
        given.cast_into::<PyLibrary>().map_err(|other| {
            PyTypeError::new_err(format!("library: {other}; a Library or None is needed"))
        })
    });
    let (Some(library), Some(size)) = (library.transpose()?, call.size) else { return Ok(None) };
    let Size { n_samples, channels: Channels { n_inputs, n_outputs }, n_disturbances } = size;
    if n_inputs != n_outputs {
        return Ok(None);
    }
    let library = Arc::clone(&library.get().0);
    let find = || Earlier::of(library, n_samples, n_inputs, n_disturbances, &task);
    detached(call.py(), find).or_raise().map(Some)
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
