//! Builders of laws that use one run: `pd`, `error_feedforward`, `adjoint`, `model_inverse`.

use ilc_rt::learning::law::adjoint::Adjoint;
use ilc_rt::learning::law::error_feedforward::{ErrorFeedforward, Feedforward};
use ilc_rt::learning::law::model_inverse::ModelInverse;
use ilc_rt::learning::law::pd::{Pd, PdGains};
use ilc_rt::model::StateSpace;
use pyo3::prelude::*;

use super::figure::readable;
use super::{Builder, Built, Call, Fits, Size};
use crate::argument::Channels;
use crate::arguments::read;
use crate::signal::given_filter;

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[
    ("pd", pd),
    ("error_feedforward", error_feedforward),
    ("adjoint", adjoint),
    ("model_inverse", model_inverse),
];

readable! { Pd, ModelInverse }
readable! { ErrorFeedforward as law => n_limited: Count(law.n_limited()); }
readable! {
    Adjoint as law => gain: Number(law.gain()), gain_limit: Number(law.gain_limit());
}

pub(super) fn pd(call: &Call<'_, '_>) -> PyResult<Built> {
    let gains = read!(call.arguments, PdGains: [number => kp, kd] [whole => lead_samples]);
    let Size { n_samples, channels, .. } = call.size();
    let filter = call.filter("q_filter")?;
    Built::of(Fits::Alike, Pd::new(gains, n_samples, channels.n_inputs, filter))
}

pub(super) fn error_feedforward(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let rule = read!(a, Feedforward:
        [number => gain_per_s]
        [whole => lead_samples]
        input_max: a.maybe_number("input_max")?.unwrap_or(f64::INFINITY),
    );
    let Size { n_samples, channels, .. } = call.size();
    let filter = call.filter("filter")?;
    Built::of(Fits::Alike, ErrorFeedforward::new(rule, n_samples, channels.n_inputs, filter))
}

/// Reads a model, and the runs of this length that a law with it accepts.
pub(super) fn modelled(call: &Call<'_, '_>) -> PyResult<(StateSpace, usize, Fits)> {
    let model = call.arguments.model("model")?;
    let n_samples = call.arguments.whole("n_samples")?;
    let fits = Fits::Fixed(n_samples, Channels::of(&model));
    Ok((model, n_samples, fits))
}

pub(super) fn adjoint(call: &Call<'_, '_>) -> PyResult<Built> {
    let (model, n_samples, fits) = modelled(call)?;
    let (gain, filter) =
        (call.arguments.maybe_number("gain")?, given_filter(call.arguments, "q_filter")?);
    call.built(fits, || Adjoint::new(&model, n_samples, gain, filter))
}

pub(super) fn model_inverse(call: &Call<'_, '_>) -> PyResult<Built> {
    let (model, n_samples, fits) = modelled(call)?;
    let (gain, filter) =
        (call.arguments.number("gain")?, given_filter(call.arguments, "q_filter")?);
    call.built(fits, || ModelInverse::new(&model, n_samples, gain, filter))
}
