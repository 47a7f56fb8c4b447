//! Builders of wrappers: `gate`, `ladder`, `through_jacobian`.

use ilc_rt::learning::Law;
use ilc_rt::learning::gate::{Gate, GateRule, Measure};
use ilc_rt::learning::ladder::{Ladder, LadderRule};
use ilc_rt::learning::law::through_jacobian::ThroughJacobian;
use pyo3::prelude::*;

use super::figure::readable;
use super::{Builder, Built, Call, Fits};
use crate::argument::Channels;
use crate::arguments::read;
use crate::weights::read_matrices;

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] =
    &[("gate", gate), ("ladder", ladder), ("through_jacobian", through_jacobian)];

/// The inner law of a wrapper, of any kind.
type Inner = Box<dyn Law>;

readable! {
    Gate<Inner> as law =>
    state: Text(law.state().name()),
    best_error: Number(law.best_figure()),
    best_input: Input(law.best_figure().map(|_| law.best_input().to_vec()));
}
readable! {
    Ladder<Inner> as law =>
    gain: Number(law.gain()),
    runs: Count(law.runs()),
    repeatable_rms: Number(law.figure()),
    noise_rms: Number(law.noise());
}
readable! {
    ThroughJacobian<Inner> as law =>
    n_joints: Count(law.shape().0),
    n_coordinates: Count(law.shape().1);
}

pub(super) fn gate(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let channels = call.size().channels;
    let n_channels = channels.n_outputs;
    let rule = read!(a, GateRule:
        [number => resume, growth]
        [whole => patience]
        measure: a
            .choice("measure", &[("rms", Measure::Rms { n_channels }), ("max", Measure::Max)])?,
        tolerance: a.maybe_number("tolerance")?.unwrap_or(0.0),
    );
    Built::of(Fits::Any, Gate::new(call.inner("law", channels)?, rule))
}

pub(super) fn ladder(call: &Call<'_, '_>) -> PyResult<Built> {
    let rule = read!(call.arguments, LadderRule:
        [whole => repeats]
        [number => slow, increase, lowest, highest]
    );
    Built::of(Fits::Any, Ladder::new(call.inner("law", call.size().channels)?, rule))
}

pub(super) fn through_jacobian(call: &Call<'_, '_>) -> PyResult<Built> {
    let jacobians = read_matrices("jacobian", &call.arguments.get("jacobian")?)?;
    let (n_outputs, n_inputs) = jacobians.first().map_or((0, 0), nalgebra::DMatrix::shape);
    // The inner law's error has the shape of the input.
    let inner = call.inner("law", Channels { n_inputs, n_outputs: n_inputs })?;
    let fits = Fits::Channels(Channels { n_inputs, n_outputs });
    Built::of(fits, ThroughJacobian::new(inner, &jacobians))
}
