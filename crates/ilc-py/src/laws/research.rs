//! Builders of laws of research: `parametric`, `point_to_point`, `stable_inverse`, `model_free`, `higher_order`,
//! `filtered`.

use ilc_rt::learning::law::filtered::Filtered;
use ilc_rt::learning::law::higher_order::HigherOrder;
use ilc_rt::learning::law::model_free::{ModelFree, ModelFreeRule};
use ilc_rt::learning::law::parametric::{Diagonal, Parametric, Term};
use ilc_rt::learning::law::point_to_point::PointToPoint;
use ilc_rt::learning::law::stable_inverse::{InverseMethod, InverseRule, StableInverse};
use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use super::figure::readable;
use super::kinds::modelled;
use super::{Builder, Built, Call, Fits};
use crate::argument::{Layout, Signal};
use crate::arguments::read;
use crate::error::OrRaise;
use crate::model_argument::read_any_model;
use crate::signal::given_filter;

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[
    ("parametric", parametric),
    ("point_to_point", point_to_point),
    ("stable_inverse", stable_inverse),
    ("model_free", model_free),
    ("higher_order", higher_order),
    ("filtered", filtered),
];

readable! { PointToPoint, StableInverse, HigherOrder<Box<dyn Law>>, Filtered<Box<dyn Law>> }
readable! { Parametric as law => parameters: Input(law.parameters().to_vec()); }
readable! { ModelFree as law => phase: Text(law.purpose().as_str()); }

/// The signals of `parametric` are columns, those of the first input first, as many of each input.
fn parametric(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let model = read_any_model("model", &a.get("model")?)?;
    let Signal { values, layout } = a.signal("signals")?;
    let Layout { n_samples, n_channels, .. } = layout;
    let channels = model.channels();
    let of_input = (n_channels / channels.n_inputs).max(1);
    let term = |column: usize| Term {
        input: column / of_input,
        name: column.to_string(),
        signal: values.iter().skip(column).step_by(n_channels).copied().collect(),
        function: None,
    };
    let terms = (0..n_channels).map(term).collect();
    let [q, s, r] = ["q", "s", "r"].map(|name| a.signal(name).map(|signal| signal.values));
    let weights = Diagonal { q: q?, s: s?, r: r? };
    let (start, learns) = (a.vector("parameters")?, a.flag("learn")?);
    call.built(Fits::Fixed(n_samples, channels), || {
        let told = ("parametric", serde_json::Value::Null);
        Parametric::new(told, model.plant(), terms, n_samples, &weights)?
            .starting_with(&start, learns)
    })
}

fn point_to_point(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let (model, n_samples, fits) = modelled(call)?;
    let points = a.maybe_wholes("points")?.unwrap_or_default();
    let (gain, r) = (a.number("gain")?, a.number("r")?);
    call.built(fits, || PointToPoint::new(&model, n_samples, &points, gain, r))
}

fn stable_inverse(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let (model, n_samples, fits) = modelled(call)?;
    let methods =
        [("stable_inversion", InverseMethod::StableInversion), ("zpetc", InverseMethod::Zpetc)];
    let method = a.choice("method", &methods)?;
    let rule = read!(a, InverseRule: [number => gain, zero_radius] method: method);
    Built::of(fits, StableInverse::new(&model, n_samples, rule, given_filter(a, "q_filter")?))
}

fn model_free(call: &Call<'_, '_>) -> PyResult<Built> {
    let (size, a) = (call.size(), call.arguments);
    if size.channels.n_inputs != 1 {
        let found = size.channels.n_inputs;
        let reason = format!("one input and one output are needed; the run has {found} channels");
        return Err(LearningError::User { law: "ModelFreeIlc".to_owned(), reason }).or_raise();
    }
    let rule = read!(a, ModelFreeRule: [maybe_number => gain] [number => probe]);
    Built::of(Fits::Alike, ModelFree::new(rule, size.n_samples, 1))
}

fn higher_order(call: &Call<'_, '_>) -> PyResult<Built> {
    let (size, weights) = (call.size(), call.arguments.vector("weights")?);
    let inner = call.inner("law", size.channels)?;
    let size = (size.n_samples, size.channels.n_inputs);
    Built::of(Fits::First, HigherOrder::new(inner, &weights, size))
}

fn filtered(call: &Call<'_, '_>) -> PyResult<Built> {
    let (size, filter) = (call.size(), call.filter("q_filter")?);
    let inner = call.inner("law", size.channels)?;
    let size = (size.n_samples, size.channels.n_inputs);
    Built::of(Fits::Any, Filtered::new(inner, size, filter))
}
