//! Builders of wrappers: `gate`, `ladder`, `through_jacobian`.

use ilc_rt::learning::Law;
use ilc_rt::learning::gate::{Gate, GateRule, GateState, Measure};
use ilc_rt::learning::ladder::{Ladder, LadderRule};
use ilc_rt::learning::law::through_jacobian::ThroughJacobian;
use pyo3::prelude::*;

use super::figure::Figure;
use super::{Builder, Built, Call, Fits, Readable};
use crate::error::OrRaise;
use crate::python_law::Channels;
use crate::weights::read_matrices;

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] =
    &[("gate", gate), ("ladder", ladder), ("through_jacobian", through_jacobian)];

/// The inner law of a wrapper, of any kind.
type Inner = Box<dyn Law>;

pub(super) fn gate(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let channels = call.size().channels;
    let n_channels = channels.n_outputs;
    let rule = GateRule {
        measure: a
            .choice("measure", &[("rms", Measure::Rms { n_channels }), ("max", Measure::Max)])?,
        tolerance: a.maybe_number("tolerance")?.unwrap_or(0.0),
        resume: a.number("resume")?,
        growth: a.number("growth")?,
        patience: a.whole("patience")?,
    };
    let law = Gate::new(call.inner("law", channels)?, rule).or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::Any })
}

impl Readable for Gate<Inner> {
    fn figure(&self, name: &str) -> Option<Figure> {
        Some(match name {
            "state" => Figure::Text(
                match self.state() {
                    GateState::Learning => "learning",
                    GateState::Holding => "holding",
                    GateState::RolledBack => "rolled_back",
                }
                .to_owned(),
            ),
            "best_error" => self.best_figure().into(),
            "best_input" => match self.best_figure() {
                Some(_) => Figure::Input(self.best_input().to_vec()),
                None => Figure::Absent,
            },
            _ => return None,
        })
    }
}

pub(super) fn ladder(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let rule = LadderRule {
        repeats: a.whole("repeats")?,
        slow: a.number("slow")?,
        increase: a.number("increase")?,
        lowest: a.number("lowest")?,
        highest: a.number("highest")?,
    };
    let law = Ladder::new(call.inner("law", call.size().channels)?, rule).or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::Any })
}

impl Readable for Ladder<Inner> {
    fn figure(&self, name: &str) -> Option<Figure> {
        Some(match name {
            "gain" => Figure::Number(self.gain()),
            "runs" => Figure::Count(self.runs()),
            "repeatable_rms" => self.figure().into(),
            "noise_rms" => Figure::Number(self.noise()),
            _ => return None,
        })
    }
}

pub(super) fn through_jacobian(call: &Call<'_, '_>) -> PyResult<Built> {
    let jacobians = read_matrices("jacobian", &call.arguments.get("jacobian")?)?;
    let (n_outputs, n_inputs) = jacobians.first().map_or((0, 0), nalgebra::DMatrix::shape);
    // The inner law's error has the shape of the input.
    let inner = call.inner("law", Channels { n_inputs, n_outputs: n_inputs })?;
    let law = ThroughJacobian::new(inner, &jacobians).or_raise()?;
    Ok(Built { law: Box::new(law), fits: Fits::Channels(Channels { n_inputs, n_outputs }) })
}

impl Readable for ThroughJacobian<Inner> {
    fn figure(&self, name: &str) -> Option<Figure> {
        let (n_joints, n_coordinates) = self.shape();
        match name {
            "n_joints" => Some(Figure::Count(n_joints)),
            "n_coordinates" => Some(Figure::Count(n_coordinates)),
            _ => None,
        }
    }
}
