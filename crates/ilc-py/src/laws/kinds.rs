//! Builders of laws that use one run: `pd`, `error_feedforward`, `adjoint`, `model_inverse`.

use ilc_rt::learning::law::adjoint::Adjoint;
use ilc_rt::learning::law::error_feedforward::{ErrorFeedforward, Feedforward};
use ilc_rt::learning::law::model_inverse::ModelInverse;
use ilc_rt::learning::law::pd::{Pd, PdGains};
use ilc_rt::model::StateSpace;
use pyo3::prelude::*;

use super::figure::Figure;
use super::{Builder, Built, Call, Fits, Readable, Size};
use crate::detached::interruptible;
use crate::error::OrRaise;
use crate::python_law::Channels;
use crate::signal::read_filter;

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[
    ("pd", pd),
    ("error_feedforward", error_feedforward),
    ("adjoint", adjoint),
    ("model_inverse", model_inverse),
];

pub(super) fn pd(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let gains = PdGains {
        kp: a.number("kp")?,
        kd: a.number("kd")?,
        lead_samples: a.whole("lead_samples")?,
    };
    let Size { n_samples, channels, .. } = call.size();
    let law = Pd::new(gains, n_samples, channels.n_inputs, call.filter("q_filter")?).or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::Alike })
}

impl Readable for Pd {}

pub(super) fn error_feedforward(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let rule = Feedforward {
        gain_per_s: a.number("gain_per_s")?,
        lead_samples: a.whole("lead_samples")?,
        input_max: a.maybe_number("input_max")?.unwrap_or(f64::INFINITY),
    };
    let Size { n_samples, channels, .. } = call.size();
    let filter = call.filter("filter")?;
    let law = ErrorFeedforward::new(rule, n_samples, channels.n_inputs, filter).or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::Alike })
}

impl Readable for ErrorFeedforward {
    fn figure(&self, name: &str) -> Option<Figure> {
        (name == "n_limited").then(|| Figure::Count(self.n_limited()))
    }
}

/// Reads a model, and the runs of this length that a law with it accepts.
pub(super) fn modelled(call: &Call<'_, '_>) -> PyResult<(StateSpace, usize, Fits)> {
    let model = call.arguments.model("model")?;
    let n_samples = call.arguments.whole("n_samples")?;
    let channels = Channels { n_inputs: model.n_inputs(), n_outputs: model.n_outputs() };
    Ok((model, n_samples, Fits::Fixed(n_samples, channels)))
}

pub(super) fn adjoint(call: &Call<'_, '_>) -> PyResult<Built> {
    let (model, n_samples, fits) = modelled(call)?;
    let gain = call.arguments.maybe_number("gain")?;
    let q_filter = read_filter("q_filter", call.arguments.given("q_filter")?.as_ref())?;
    let law =
        interruptible(call.py(), || Adjoint::new(&model, n_samples, gain, q_filter))?.or_raise()?;
    Ok(Built { law: Box::new(law), fits })
}

impl Readable for Adjoint {
    fn figure(&self, name: &str) -> Option<Figure> {
        match name {
            "gain" => Some(Figure::Number(self.gain())),
            "gain_limit" => Some(Figure::Number(self.gain_limit())),
            _ => None,
        }
    }
}

pub(super) fn model_inverse(call: &Call<'_, '_>) -> PyResult<Built> {
    let (model, n_samples, fits) = modelled(call)?;
    let gain = call.arguments.number("gain")?;
    let q_filter = read_filter("q_filter", call.arguments.given("q_filter")?.as_ref())?;
    let law = interruptible(call.py(), || ModelInverse::new(&model, n_samples, gain, q_filter))?;
    Ok(Built { law: Box::new(law.or_raise()?), fits })
}

impl Readable for ModelInverse {}
