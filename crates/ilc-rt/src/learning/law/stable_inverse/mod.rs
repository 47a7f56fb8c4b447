//! Inverse-model ILC for non-minimum phase: stable inversion, or zero phase error tracking (ZPETC).

mod inverse;
#[cfg(test)]
mod oracle;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_cutoff, violation,
};
use super::norm_optimal::decouple::parts;
use super::norm_optimal::plant::OwnPlant;
use super::norm_optimal::{Plant, Weights};
use super::q_filter::{QFilter, QRunner};
use crate::learning::error::{check, check_adjoint, check_counts, check_update};
use crate::learning::{Law, LearningError, LowPass, Result};
use crate::model::{ModelError, StateSpace};
use crate::schema::{Violation, field_order};

use inverse::Inverse;

/// Method of inverting the zeros outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InverseMethod {
    /// Exact inverse by preactuation.
    #[default]
    StableInversion,
    /// Zero phase error tracking: no phase error, a gain that differs from 1 at high frequency.
    Zpetc,
}

/// `[learning.stable_inverse]`: gain, method and zero-phase Butterworth low-pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct StableInverseParameters {
    /// Share of the predicted error that one update removes.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 2.0))]
    pub gain: f64,
    /// Method of inverting the zeros outside the unit circle.
    pub method: InverseMethod,
    /// Radius from which on a zero counts as outside; below 1 with `zpetc` alone, so that zeros near -1 are not
    /// cancelled and the input does not ring.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub zero_radius: f64,
    /// Order of the zero-phase Butterworth low-pass (Q-filter).
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass, 0.001 to 0.95 of the Nyquist frequency.
    pub cutoff_hz: f64,
}

impl Default for StableInverseParameters {
    fn default() -> Self {
        let method = InverseMethod::StableInversion;
        Self { gain: 0.5, method, zero_radius: 1.0, order: 2, cutoff_hz: 10.0 }
    }
}

impl LawParameters for StableInverseParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        if self.zero_radius < 1.0 && self.method != InverseMethod::Zpetc {
            let key = "[learning.stable_inverse] zero_radius";
            return Err(violation(key, self.zero_radius, "1, or method = \"zpetc\""));
        }
        check_cutoff("[learning.stable_inverse] cutoff_hz", Some(self.cutoff_hz), cell)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let filter = QFilter::low_pass(self.order, self.cutoff_hz, context.cell.cycle_s)
            .map_err(LearningError::from)?;
        let rule =
            InverseRule { gain: self.gain, method: self.method, zero_radius: self.zero_radius };
        Ok(Box::new(StableInverse::new(context.model, context.n_samples(), rule, filter)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[
            Example {
                is_parallel: false,
                learning: "law = \"stable_inverse\"\n[learning.stable_inverse]\ncutoff_hz = 8.0",
                error_left: 0.1,
            },
            Example {
                is_parallel: false,
                learning: "law = \"stable_inverse\"\n[learning.stable_inverse]\nmethod = \"zpetc\"\n\
                           zero_radius = 0.9\ncutoff_hz = 8.0",
                error_left: 0.1,
            },
        ]
    }
}

/// Parameters of a [`StableInverse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseRule {
    /// Step.
    pub gain: f64,
    /// Method of inverting the zeros outside.
    pub method: InverseMethod,
    /// Radius from which on a zero counts as outside.
    pub zero_radius: f64,
}

/// Inverse-model ILC that also inverts zeros outside the unit circle, by looking ahead.
///
/// `u_{j+1} = Q (u_j + gain L e_j)`, with `P = K Bs(z) Bu(z) / A(z)`, Bu having the zeros outside;
/// stable inversion: `L = A / (K Bs Bu)`, 1/Bu run backward in time;
/// ZPETC: `L = A Bu(1/z) / (K Bs Bu(1)^2)`
///
/// Each axis separately. The error is held beyond the end of the run, and is zero before it: preactuation that would
/// begin before the run is cut off, so the program should rest at first for the settling time of the zeros outside.
///
/// # Shapes
/// - `input`, `error`, `next`: `n_samples` x `n_channels`
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples)`.
/// # Source
/// - \[tomizuka1987\]: ZPETC; \[devasia1996\], \[vanzundert2018\]: stable inversion.
#[derive(Debug, Clone)]
pub struct StableInverse {
    axes: Vec<Inverse>,
    rule: InverseRule,
    n_samples: usize,
    q_filter: QFilter,
    runner: QRunner,
}

impl StableInverse {
    /// Creates the law for runs of `n_samples` samples.
    ///
    /// # Errors
    /// - [`LearningError::NoInverse`] for a zero on the unit circle, an axis without response, or axes that the
    ///   model couples.
    /// - [`LearningError::Parameter`] unless `0 < gain < 2` and `0.1 <= zero_radius <= 1`, 1 for stable inversion.
    /// - [`LearningError::Empty`] for 0 samples or channels; [`LearningError::Model`] for a continuous model.
    /// - [`LearningError::Signal`] if the run is too short for the filter.
    pub fn new(
        model: &StateSpace,
        n_samples: usize,
        rule: InverseRule,
        q_filter: QFilter,
    ) -> Result<Self> {
        if model.dt_s().is_none() {
            return Err(ModelError::Continuous { action: "learning with the inverse" }.into());
        }
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        check_counts(&[
            ("n_samples", n_samples),
            ("n_inputs", n_inputs),
            ("n_outputs", n_outputs),
        ])?;
        let least = if rule.method == InverseMethod::Zpetc { 0.1 } else { 1.0 };
        for (what, value, is_right, allowed) in [
            (
                "gain",
                rule.gain,
                rule.gain > 0.0 && rule.gain < 2.0,
                "it must lie above 0 and below 2, or the error grows",
            ),
            (
                "zero_radius",
                rule.zero_radius,
                (least..=1.0).contains(&rule.zero_radius),
                "from 0.1 to 1 for ZPETC, 1 for stable inversion",
            ),
        ] {
            if !is_right {
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        let mut axes = Vec::new();
        for part in parts(Plant::Invariant(model), &Weights::default().into())? {
            let OwnPlant::Invariant(own) = &part.plant else { continue };
            if own.n_outputs() == 0 {
                return Err(LearningError::NoInverse { reason: "it responds to no input" });
            }
            let place = axes.len();
            if part.inputs != [place] || part.outputs != [place] {
                let reason = "it couples axes; one input and one output for each is needed";
                return Err(LearningError::NoInverse { reason });
            }
            axes.push(Inverse::new(own, n_samples, rule)?);
        }
        if axes.len() != n_outputs {
            return Err(LearningError::NotSquare { n_inputs, n_outputs });
        }
        let runner = q_filter.for_samples(n_samples)?;
        Ok(Self { axes, rule, n_samples, q_filter, runner })
    }
}

impl Law for StableInverse {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let n_axes = self.axes.len();
        check_update(input, error, next, self.n_samples, [n_axes, n_axes])?;
        next.copy_from_slice(input);
        for (axis, inverse) in self.axes.iter_mut().enumerate() {
            let change = inverse.apply(error.iter().skip(axis).step_by(n_axes));
            let own = next.iter_mut().skip(axis).step_by(n_axes);
            own.zip(change).for_each(|(next, change)| *next += self.rule.gain * change);
        }
        self.runner.apply(next, n_axes)?;
        check("next", next, self.n_samples, n_axes)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        let n_axes = self.axes.len();
        check_adjoint(dual, to_input, to_error, self.n_samples, [n_axes, n_axes])?;
        to_input.copy_from_slice(dual);
        self.runner.apply_transposed(to_input, n_axes)?;
        for (axis, inverse) in self.axes.iter_mut().enumerate() {
            let own = to_error.iter_mut().skip(axis).step_by(n_axes);
            let change = inverse.transposed(to_input.iter().skip(axis).step_by(n_axes));
            own.zip(change).for_each(|(to, change)| *to = self.rule.gain * change);
        }
        Ok(true)
    }

    fn low_pass(&self, dt_s: f64) -> Option<LowPass> {
        let cutoff_hz = self.q_filter.cutoff_hz(dt_s)?;
        let runner = QFilter::None.for_samples(self.n_samples).ok()?;
        let plain = Self { q_filter: QFilter::None, runner, ..self.clone() };
        Some(LowPass { cutoff_hz, unfiltered: Box::new(plain) })
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        let InverseRule { gain, method, zero_radius } = self.rule;
        format!(
            r#"{{"law":"stable_inverse","gain":{gain},"method":{},"zero_radius":{zero_radius},"q_filter":{},"n_samples":{},"n_channels":{}}}"#,
            serde_json::json!(method),
            self.q_filter.describe(),
            self.n_samples,
            self.axes.len()
        )
    }
}
