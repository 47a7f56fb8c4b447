//! Adjoint (gradient) ILC: the error, run backward through the model.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::context::{BuildError, Example, LawCell, LawContext, LawParameters, check_cutoff};
use super::q_filter::{QFilter, QRunner};
use crate::learning::error::{check, check_adjoint, check_counts, check_update};
use crate::learning::operator::Operator;
use crate::learning::{Law, LearningError, LowPass, Result};
use crate::model::{ModelError, StateSpace};
use crate::schema::{Violation, field_order};

/// `[learning.adjoint]`: the gain, and an optional low-pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct AdjointParameters {
    /// Step of the gradient descent, below `2 / |P|^2` unless there is a low-pass; half of that by
    /// default.
    #[schemars(range(min = 1e-12, max = 1e12))]
    pub gain: Option<f64>,
    /// Order of the zero-phase Butterworth low-pass (Q-filter).
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass, 0.001 to 0.95 of the Nyquist frequency; no low-pass by default.
    pub cutoff_hz: Option<f64>,
}

impl Default for AdjointParameters {
    fn default() -> Self {
        Self { gain: None, order: 2, cutoff_hz: None }
    }
}

impl LawParameters for AdjointParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_cutoff("[learning.adjoint] cutoff_hz", self.cutoff_hz, cell)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let filter = match self.cutoff_hz {
            Some(cutoff_hz) => QFilter::low_pass(self.order, cutoff_hz, context.cell.cycle_s)
                .map_err(LearningError::from)?,
            None => QFilter::None,
        };
        Ok(Box::new(Adjoint::new(context.model, context.n_samples(), self.gain, filter)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[
            Example { is_parallel: false, learning: "law = \"adjoint\"", error_left: 0.1 },
            Example {
                is_parallel: true,
                learning: "law = \"adjoint\"\ninput_max_m_s = 0.1",
                error_left: 0.2,
            },
        ]
    }
}

/// Adjoint (gradient) ILC: one step of gradient descent on the squared error.
///
/// `u_{j+1} = Q (u_j + alpha P' e_j)`, `P` the lifted system of the model
///
/// With an exact model and without filter, `|e|` falls in every run (monotone convergence) if
/// `0 < alpha < 2 / |P|^2`: `e_{j+1} = (I - alpha P P') e_j`. It falls quickly where the model's
/// gain is near its maximum and slowly elsewhere. Of the model-based laws this is the most robust
/// against noise and model errors: it converges as long as the phase of the real axis stays within
/// 90 degrees of the model. Delays and the pairing of samples are part of `P`.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs`
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples)` through a backward
/// simulation.
/// # Source
/// - \[barton2010\], Ch. 3: the lifted system; the law is the gradient of Eq. (3.13) with Q = I, S
///   = R = 0.
#[derive(Debug, Clone)]
pub struct Adjoint {
    operator: Operator,
    gain: f64,
    gain_limit: f64,
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    q_filter: QFilter,
    runner: QRunner,
}

impl Adjoint {
    /// Creates the law for runs of `n_samples` samples; the default gain is `1 / |P|^2`, half the
    /// limit.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a gain that is not positive and finite, or a model with a
    ///   zero or unbounded response.
    /// - [`LearningError::GainBound`] for a gain at or above the limit without filter.
    /// - [`LearningError::Empty`] for 0 samples, inputs or outputs; [`LearningError::TooMany`] for
    ///   more than a million values.
    /// - [`LearningError::Model`] for a continuous model.
    /// - [`LearningError::Signal`] if the run is too short for the filter.
    pub fn new(
        model: &StateSpace,
        n_samples: usize,
        gain: Option<f64>,
        q_filter: QFilter,
    ) -> Result<Self> {
        if model.dt_s().is_none() {
            return Err(ModelError::Continuous { action: "gradient learning" }.into());
        }
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        check_counts(&[
            ("n_samples", n_samples),
            ("n_inputs", n_inputs),
            ("n_outputs", n_outputs),
        ])?;
        // The norm takes a hundred products and stores twenty signals.
        let allowed = 1_000_000 / n_inputs.max(n_outputs);
        if n_samples > allowed {
            return Err(LearningError::TooMany { what: "n_samples", value: n_samples, allowed });
        }
        if let Some(value) = gain.filter(|gain| !(gain.is_finite() && *gain > 0.0)) {
            let allowed = "a gain must be finite and greater than 0";
            return Err(LearningError::Parameter { what: "gain", value, allowed });
        }
        let mut operator = Operator::new(model);
        // The upper bound of the norm: a slightly low limit is safe, a high one is not.
        let found = operator.norm(n_samples);
        let norm = found.value + found.error;
        let gain_limit = 2.0 / (norm * norm);
        if !(gain_limit.is_finite() && gain_limit > 0.0) {
            let allowed = "the model must answer to its input, and within bounds over the run";
            return Err(LearningError::Parameter { what: "|P|", value: norm, allowed });
        }
        let gain = gain.unwrap_or(0.5 * gain_limit);
        if gain >= gain_limit && q_filter == QFilter::None {
            return Err(LearningError::GainBound { gain, limit: gain_limit });
        }
        let runner = q_filter.for_samples(n_samples)?;
        Ok(Self { operator, gain, gain_limit, n_samples, n_inputs, n_outputs, q_filter, runner })
    }

    /// Returns the gain alpha.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// Returns `2 / |P|^2`, the gain above which the error grows; in long runs up to about one part
    /// in 1000 less, as only a bound of `|P|` is known.
    pub fn gain_limit(&self) -> f64 {
        self.gain_limit
    }
}

impl Law for Adjoint {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let Self { n_samples, n_inputs, n_outputs, gain, .. } = *self;
        check_update(input, error, next, n_samples, [n_inputs, n_outputs])?;
        self.operator.transposed(error, next);
        for (next, input) in next.iter_mut().zip(input) {
            *next = input + gain * *next;
        }
        self.runner.apply(next, n_inputs)?;
        check("next", next, n_samples, n_inputs)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        let Self { n_samples, n_inputs, n_outputs, gain, .. } = *self;
        check_adjoint(dual, to_input, to_error, n_samples, [n_inputs, n_outputs])?;
        to_input.copy_from_slice(dual);
        self.runner.apply_transposed(to_input, n_inputs)?;
        self.operator.forward(to_input, to_error);
        for value in to_error {
            *value *= gain;
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
        format!(
            r#"{{"law":"adjoint","gain":{},"q_filter":{},"n_samples":{},"n_inputs":{},"n_outputs":{}}}"#,
            self.gain,
            self.q_filter.describe(),
            self.n_samples,
            self.n_inputs,
            self.n_outputs
        )
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::model::{Method, discretize, from_transfer_function, second_order};

    fn axis() -> StateSpace {
        let model = second_order(157.0, 0.5).unwrap();
        discretize(&model, 2e-3, Method::ZeroOrderHold).unwrap().delayed(2).unwrap()
    }

    #[test]
    fn a_gain_with_delay_sends_each_error_back_to_its_cause() {
        // y[k] = 2 u[k-1]: |P| = 2, so that the gain is 1/4 and the limit 1/2.
        let model = from_transfer_function(&[2.0], &[1.0, 0.0], Some(1.0)).unwrap();
        let mut law = Adjoint::new(&model, 4, None, QFilter::None).unwrap();
        assert!((law.gain() - 0.25).abs() < 1e-12 && (law.gain_limit() - 0.5).abs() < 1e-12);
        let mut next = [0.0; 4];
        law.update(&[10.0; 4], &[9.0, 2.0, 4.0, 6.0], &mut next).unwrap();
        for (found, expected) in next.iter().zip([11.0, 12.0, 13.0, 10.0]) {
            assert!((found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn the_error_falls_in_every_run_below_the_limit_and_grows_above() {
        let (model, n_samples) = (axis(), 150);
        let dense = model.lifted(n_samples).unwrap();
        let reference = DVector::from_fn(n_samples, |k, _| (k as f64 / 20.0).sin().powi(3));
        for share in [0.1, 1.0, 1.9] {
            let limit = Adjoint::new(&model, n_samples, None, QFilter::None).unwrap().gain_limit();
            let gain = Some(0.5 * share * limit);
            let mut law = Adjoint::new(&model, n_samples, gain, QFilter::None).unwrap();
            let mut u = DVector::zeros(n_samples);
            let mut before = f64::INFINITY;
            for _ in 0..50 {
                let e = &reference - &dense * &u;
                assert!(e.norm() < before);
                before = e.norm();
                let mut next = vec![0.0; n_samples];
                law.update(u.as_slice(), e.as_slice(), &mut next).unwrap();
                u = DVector::from_vec(next);
            }
        }
        let norm = dense.svd(false, false).singular_values.max();
        let limit = Adjoint::new(&model, n_samples, None, QFilter::None).unwrap().gain_limit();
        let exact = 2.0 / (norm * norm);
        assert!(limit <= exact * (1.0 + 1e-12) && limit >= exact * (1.0 - 1e-6), "{limit} {exact}");
        let gain = Some(2.001 / (norm * norm));
        let error = Adjoint::new(&model, n_samples, gain, QFilter::None).unwrap_err();
        assert!(matches!(error, LearningError::GainBound { .. }), "{error}");
    }

    #[test]
    fn what_has_no_gradient_is_refused() {
        let refuse = |model: &StateSpace, n, gain| {
            Adjoint::new(model, n, gain, QFilter::None).unwrap_err().to_string()
        };
        assert!(refuse(&axis(), 0, None).contains("n_samples = 0"));
        assert!(refuse(&axis(), 9, Some(-1.0)).contains("gain = -1"));
        assert!(refuse(&axis(), 9, Some(f64::NAN)).contains("gain = NaN"));
        let mute = from_transfer_function(&[0.0], &[1.0, -0.5], Some(1.0)).unwrap();
        assert!(refuse(&mute, 9, None).contains("|P| = 0"));
        let explosive = from_transfer_function(&[1.0], &[1.0, -1e3], Some(1.0)).unwrap();
        assert!(refuse(&explosive, 400, None).contains("|P| = "));
        assert!(refuse(&second_order(1.0, 1.0).unwrap(), 9, None).contains("continuous"));
    }
}
