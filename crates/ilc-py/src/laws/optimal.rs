//! Builders of norm-optimal ILC: `norm_optimal`, `contour`, `formation`, `dynamic`.

use ilc_rt::learning::law::dynamic::{DynamicNormOptimal, InputWeights};
use ilc_rt::learning::law::norm_optimal::{Cost, NormOptimal};
use ilc_rt::learning::weights::{Dynamic, FilteredInput, Weight};
use ilc_rt::model::StateSpace;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::figure::readable;
use super::{Builder, Built, Call, Fits};
use crate::argument::{Matrix, misfit};
use crate::arguments::Arguments;
use crate::error::OrRaise;
use crate::model_argument::{AnyModel, read_any_model, read_model};
use crate::weights::{read_contour, read_formation_weight, read_matrices};

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[
    ("norm_optimal", plain),
    ("contour", contour),
    ("formation", formation),
    ("dynamic", dynamic),
];

/// The kinds that are class methods of `NormOptimalIlc`.
pub(super) const METHODS: [&str; 3] = ["contour", "formation", "dynamic"];

readable! {
    NormOptimal as law => conditioning: Number(law.conditioning());

    // About 0.2 ms for one axis of second order and 3 ms for 16 states or more; Python switches threads
    // every 5 ms.
    fn in_place_max(&self) -> usize {
        (1 << 26) / self.n_states().max(16).pow(2)
    }
}
readable! { DynamicNormOptimal as law => conditioning: Number(law.inner().conditioning()); }

pub(super) fn plain(call: &Call<'_, '_>) -> PyResult<Built> {
    let model = read_any_model("model", &call.arguments.get("model")?)?;
    let n_samples = call.arguments.whole("n_samples")?;
    let q = call.arguments.weight("q", n_samples, model.channels().n_outputs)?;
    build(call, &model, n_samples, q, None)
}

pub(super) fn contour(call: &Call<'_, '_>) -> PyResult<Built> {
    let model = read_any_model("model", &call.arguments.get("model")?)?;
    let (q, n_samples, p) = read_contour(call.arguments)?;
    let n_outputs = model.channels().n_outputs;
    if p != n_outputs {
        let rule = format!("(n_samples, {n_outputs}), one column an output,");
        return Err(misfit("reference", &[n_samples, p], &rule));
    }
    build(call, &model, n_samples, q, None)
}

pub(super) fn formation(call: &Call<'_, '_>) -> PyResult<Built> {
    let n_samples = call.arguments.whole("n_samples")?;
    let (model, n_agents, n_outputs) = side_by_side(call.arguments)?;
    let q = read_formation_weight(call.arguments, n_samples, n_agents, n_outputs)?;
    build(call, &AnyModel::Invariant(model), n_samples, q, None)
}

pub(super) fn dynamic(call: &Call<'_, '_>) -> PyResult<Built> {
    let model = read_any_model("model", &call.arguments.get("model")?)?;
    let n_samples = call.arguments.whole("n_samples")?;
    let filter = read_dynamic(call.arguments, &model, n_samples)?;
    let q = call.arguments.weight("q", n_samples, filter.n_filtered())?;
    let filtered = |filter: &str, weight: &str| -> PyResult<Option<FilteredInput>> {
        let Some(filter) = call.arguments.maybe(filter, read_model)? else { return Ok(None) };
        let weight = call.arguments.weight(weight, n_samples, filter.n_outputs())?;
        FilteredInput::new(filter, weight).or_raise().map(Some)
    };
    let inputs = InputWeights {
        input: filtered("input_filter", "input_weight")?,
        change: filtered("change_filter", "change_weight")?,
    };
    build(call, &model, n_samples, q, Some((&filter, &inputs)))
}

fn build(
    call: &Call<'_, '_>,
    model: &AnyModel,
    n_samples: usize,
    q: Weight,
    filters: Option<(&Dynamic, &InputWeights)>,
) -> PyResult<Built> {
    let channels = model.channels();
    let cost = read_cost(call.arguments, q, n_samples, channels.n_inputs)?;
    let (plant, fits) = (model.plant(), Fits::Fixed(n_samples, channels));
    let Some(filters) = filters else {
        return call.built(fits, || NormOptimal::new(plant, n_samples, cost));
    };
    call.built(fits, || DynamicNormOptimal::with_inputs(plant, n_samples, filters, cost))
}

/// Reads the weights of input, change and rate, in addition to that of the error.
pub(super) fn read_cost(
    a: Arguments<'_, '_>,
    q: Weight,
    n_samples: usize,
    n_inputs: usize,
) -> PyResult<Cost> {
    let input = |name| a.weight(name, n_samples, n_inputs);
    Ok(Cost { q, s: input("s")?, r: input("r")?, rate: a.number("rate")? })
}

/// Reads the filter of the error, by default none, its coupling and the weight of the unfiltered error.
fn read_dynamic(a: Arguments<'_, '_>, model: &AnyModel, n_samples: usize) -> PyResult<Dynamic> {
    let coupling = a.maybe("coupling", read_matrices)?;
    let size = coupling.as_ref().map_or(model.channels().n_outputs, |matrices| matrices[0].nrows());
    let none = || {
        let dt_s = model.plant().at(0).dt_s();
        StateSpace::static_gain(Matrix::identity(size, size), dt_s).or_raise()
    };
    let filter = a.maybe("filter", read_model)?.map_or_else(none, Ok)?;
    let mut dynamic = Dynamic::new(filter).or_raise()?;
    if let Some(matrices) = coupling {
        if matrices.len() != n_samples {
            let (rows, cols) = matrices[0].shape();
            let rule = format!("({n_samples}, rows, columns)");
            return Err(misfit("coupling", &[matrices.len(), rows, cols], &rule));
        }
        dynamic = dynamic.with_coupling(matrices).or_raise()?;
    }
    if a.given("plain")?.is_some() {
        let weight = a.weight("plain", n_samples, dynamic.n_outputs())?;
        dynamic = dynamic.with_plain(weight);
    }
    Ok(dynamic)
}

/// Reads the block-diagonal model of several agents; also their number and the outputs of each.
fn side_by_side(a: Arguments<'_, '_>) -> PyResult<(StateSpace, usize, usize)> {
    let models: Vec<Bound<'_, PyAny>> = a.get("models")?.extract()?;
    let Some(first) = models.first() else {
        return Err(PyValueError::new_err("models is empty; at least one agent is needed"));
    };
    let mut all = read_model("models[0]", first)?;
    let n_outputs = all.n_outputs();
    for (i, model) in models.iter().enumerate().skip(1) {
        let agent = read_model(&format!("models[{i}]"), model)?;
        let found = agent.n_outputs();
        if found != n_outputs {
            return Err(PyValueError::new_err(format!(
                "models[{i}] has {found} outputs; {n_outputs} are needed, as models[0] has"
            )));
        }
        all = all.append(&agent).or_raise()?;
    }
    Ok((all, models.len(), n_outputs))
}
