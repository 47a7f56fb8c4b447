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

use super::figure::Figure;
use super::kinds::modelled;
use super::{Builder, Built, Call, Fits, Readable};
use crate::argument::{Layout, Signal};
use crate::detached::interruptible;
use crate::error::OrRaise;
use crate::model_argument::read_any_model;
use crate::python_law::Channels;
use crate::signal::read_filter;

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[
    ("parametric", parametric),
    ("point_to_point", point_to_point),
    ("stable_inverse", stable_inverse),
    ("model_free", model_free),
    ("higher_order", higher_order),
    ("filtered", filtered),
];

/// The signals of `parametric` are columns, those of the first input first, as many of each input.
fn parametric(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let model = read_any_model("model", &a.get("model")?)?;
    let Signal { values, layout } = a.signal("signals")?;
    let Layout { n_samples, n_channels, .. } = layout;
    let channels = Channels { n_inputs: model.n_inputs(), n_outputs: model.n_outputs() };
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
    let law = interruptible(call.py(), || {
        let told = ("parametric", serde_json::Value::Null);
        Parametric::new(told, model.plant(), terms, n_samples, &weights)?
            .starting_with(&start, learns)
    })?;
    Ok(Built { law: Box::new(law.or_raise()?), fits: Fits::Fixed(n_samples, channels) })
}

impl Readable for Parametric {
    fn figure(&self, name: &str) -> Option<Figure> {
        (name == "parameters").then(|| Figure::Input(self.parameters().to_vec()))
    }
}

fn point_to_point(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let (model, n_samples, fits) = modelled(call)?;
    let points = a.maybe_wholes("points")?.unwrap_or_default();
    let (gain, r) = (a.number("gain")?, a.number("r")?);
    let law = interruptible(call.py(), || PointToPoint::new(&model, n_samples, &points, gain, r))?;
    Ok(Built { law: Box::new(law.or_raise()?), fits })
}

impl Readable for PointToPoint {}

fn stable_inverse(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let (model, n_samples, fits) = modelled(call)?;
    let methods =
        [("stable_inversion", InverseMethod::StableInversion), ("zpetc", InverseMethod::Zpetc)];
    let (method, gain) = (a.choice("method", &methods)?, a.number("gain")?);
    let rule = InverseRule { gain, method, zero_radius: a.number("zero_radius")? };
    let filter = read_filter("q_filter", a.given("q_filter")?.as_ref())?;
    let law = StableInverse::new(&model, n_samples, rule, filter).or_raise()?;
    Ok(Built { law: Box::new(law), fits })
}

impl Readable for StableInverse {}

fn model_free(call: &Call<'_, '_>) -> PyResult<Built> {
    let (size, a) = (call.size(), call.arguments);
    if size.channels.n_inputs != 1 {
        let found = size.channels.n_inputs;
        let reason = format!("one input and one output are needed; the run has {found} channels");
        return Err(LearningError::User { law: "ModelFreeIlc".to_owned(), reason }).or_raise();
    }
    let rule = ModelFreeRule { gain: a.maybe_number("gain")?, probe: a.number("probe")? };
    let law = ModelFree::new(rule, size.n_samples, 1).or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::Alike })
}

impl Readable for ModelFree {
    fn figure(&self, name: &str) -> Option<Figure> {
        (name == "phase").then(|| Figure::Text(self.purpose().as_str().to_owned()))
    }
}

fn higher_order(call: &Call<'_, '_>) -> PyResult<Built> {
    let (size, weights) = (call.size(), call.arguments.vector("weights")?);
    let inner = call.inner("law", size.channels)?;
    let size = (size.n_samples, size.channels.n_inputs);
    let law = HigherOrder::new(inner, &weights, size).or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::First })
}

impl Readable for HigherOrder<Box<dyn Law>> {}

fn filtered(call: &Call<'_, '_>) -> PyResult<Built> {
    let (size, filter) = (call.size(), call.filter("q_filter")?);
    let inner = call.inner("law", size.channels)?;
    let law = Filtered::new(inner, (size.n_samples, size.channels.n_inputs), filter).or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::Any })
}

impl Readable for Filtered<Box<dyn Law>> {}
