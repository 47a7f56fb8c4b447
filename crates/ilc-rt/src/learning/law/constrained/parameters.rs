//! `[learning.constrained]`: the weights of norm-optimal learning and its bounds.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Bound, Bounds, Constrained, Limit};
use crate::fieldbus::cia402::InputKind;
use crate::learning::Law;
use crate::learning::law::LawName;
use crate::learning::law::context::{
    BuildError, Example, LawAxis, LawCell, LawContext, LawParameters, needs_inputs, violation,
};
use crate::learning::law::norm_optimal::Weights;
use crate::schema::{Violation, field_order};

/// `[learning.constrained]`: the weights of norm-optimal learning and its bounds.
///
/// The input is bounded by `input_max_m` and `input_max_m_s` of `[learning]`, the corrected set
/// point of a csp axis by the position limits of its axis. If no input satisfies all bounds the
/// input is kept, and the log states the reason.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ConstrainedParameters {
    /// Weight of the next error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: f64,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: f64,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: f64,
    /// Weight of the rate of the change of input.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub rate: f64,
    /// Largest change of the input of a csp axis from run to run.
    #[schemars(range(min = 1e-12, max = 1.0))]
    pub change_max_m: Option<f64>,
    /// Largest change of the input of a csv axis from run to run.
    #[schemars(range(min = 1e-12, max = 10.0))]
    pub change_max_m_s: Option<f64>,
    /// Largest change of the input of a csp axis from sample to sample.
    #[schemars(range(min = 1e-12, max = 1.0))]
    pub step_max_m: Option<f64>,
    /// Largest change of the input of a csv axis from sample to sample.
    #[schemars(range(min = 1e-12, max = 10.0))]
    pub step_max_m_s: Option<f64>,
    /// Velocity limit of the corrected set point of csp axes, at most the smallest of their limits;
    /// each axis' own limit by default.
    #[schemars(range(min = 1e-6))]
    pub velocity_max_m_s: Option<f64>,
    /// Acceleration limit of the corrected set point of csp axes, at most the smallest of their
    /// limits; each axis' own limit by default.
    #[schemars(range(min = 1e-4))]
    pub acceleration_max_m_s2: Option<f64>,
}

impl Default for ConstrainedParameters {
    fn default() -> Self {
        Self {
            q: 1.0,
            s: 0.0,
            r: 0.0,
            rate: 0.0,
            change_max_m: None,
            change_max_m_s: None,
            step_max_m: None,
            step_max_m_s: None,
            velocity_max_m_s: None,
            acceleration_max_m_s2: None,
        }
    }
}

impl LawParameters for ConstrainedParameters {
    /// No set point exceeds the limits of its axis, so a wider bound would have no effect.
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        let least = |limit: fn(&LawAxis) -> f64| {
            let csp = cell.axes.iter().filter(|axis| axis.corrects_set_point());
            csp.map(limit).fold(f64::INFINITY, f64::min)
        };
        let velocity = least(|axis| axis.velocity_max);
        let acceleration = least(|axis| axis.acceleration_max);
        for (name, bound, low, high) in [
            ("velocity_max_m_s", self.velocity_max_m_s, 1e-6, velocity),
            ("acceleration_max_m_s2", self.acceleration_max_m_s2, 1e-4, acceleration),
        ] {
            let key = format!("[learning.constrained] {name}");
            let Some(bound) = bound else { continue };
            if !high.is_finite() {
                let allowed =
                    "only with csp axes: a csv axis has no corrected set point; remove it";
                return Err(violation(&key, "given", allowed));
            }
            if !(low..=high).contains(&bound) {
                return Err(violation(&key, bound, format!("allowed {low} to {high}")));
            }
        }
        Ok(())
    }

    fn requires(&self, cell: &LawCell) -> Result<(), Violation> {
        needs_inputs(LawName::Constrained, cell)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let weights = Weights { q: self.q, s: self.s, r: self.r, rate: self.rate };
        let bounds = self.bounds(context);
        Ok(Box::new(Constrained::new(context.model, context.n_samples(), weights, bounds)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"constrained\"\n[learning.constrained]\nrate = 6.0",
            error_left: 0.1,
        }]
    }
}

impl ConstrainedParameters {
    /// Converts the limits of each axis into bounds of the input; those of a set point only if the
    /// input is added to one.
    fn bounds(&self, context: &LawContext) -> Bounds {
        let axes = &context.cell.axes;
        let each =
            |value: &dyn Fn(&LawAxis) -> f64| Limit::PerChannel(axes.iter().map(value).collect());
        let within = |most: &dyn Fn(&LawAxis) -> f64| Bound {
            lower: each(&|axis| -most(axis)),
            upper: each(most),
        };
        let optional = |csp: Option<f64>, csv: Option<f64>| {
            let value = |axis: &LawAxis| match axis.input {
                InputKind::Position => csp,
                InputKind::Velocity => csv,
                InputKind::Torque => None,
            };
            let bound = || within(&|axis| value(axis).unwrap_or(f64::INFINITY));
            (csp.is_some() || csv.is_some()).then(bound)
        };
        let set_point = |axis: &LawAxis, limit: f64| {
            if axis.corrects_set_point() { limit } else { f64::INFINITY }
        };
        let any_set_point = axes.iter().any(LawAxis::corrects_set_point);
        let of_set_point = |bound: Bound| any_set_point.then_some(bound);
        Bounds {
            input: Some(within(&|axis| axis.input_max)),
            change: optional(self.change_max_m, self.change_max_m_s),
            step: optional(self.step_max_m, self.step_max_m_s),
            position: of_set_point(Bound {
                lower: each(&|axis| {
                    if axis.corrects_set_point() { axis.position_min } else { f64::NEG_INFINITY }
                }),
                upper: each(&|axis| set_point(axis, axis.position_max)),
            }),
            velocity: of_set_point(within(&|axis| {
                set_point(axis, self.velocity_max_m_s.unwrap_or(axis.velocity_max))
            })),
            acceleration: of_set_point(within(&|axis| {
                set_point(axis, self.acceleration_max_m_s2.unwrap_or(axis.acceleration_max))
            })),
            output: None,
            reference: Some(context.reference_m.to_vec()),
            output_reference: None,
        }
    }
}
