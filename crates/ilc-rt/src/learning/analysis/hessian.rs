//! The adjoint of a norm-optimal law's iteration, from its normal equations.

use super::plant::Plant;
use crate::learning::law::norm_optimal::{NormOptimal, Weights};
use crate::learning::{LearningError, Result};
use crate::model::StateSpace;

/// The adjoint of a norm-optimal law's iteration.
///
/// With `P` the law's model, `P_true` the axes and `H = P'QP + S + R + W`, `T = H^-1 (R + W + P'Q
/// (P - P_true))`, so `T' = (R + W + (P - P_true)'QP) H^-1`. In this form nothing cancels where the
/// model is exact, whatever the weights.
pub(super) struct Hessian {
    law: NormOptimal,
    own: Plant,
    weights: Weights,
    /// True if the law's model equals the axes.
    is_right: bool,
    n_inputs: usize,
    solved: Vec<f64>,
    error: Vec<f64>,
    back: Vec<f64>,
}

impl std::fmt::Debug for Hessian {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hessian").field("weights", &self.weights).finish_non_exhaustive()
    }
}

impl Hessian {
    /// Creates the adjoint from the law's model, its weights, and the axes.
    pub(super) fn new(
        own: &StateSpace,
        model: &StateSpace,
        n_samples: usize,
        weights: Weights,
    ) -> Result<Self> {
        let n_inputs = own.n_inputs();
        let n_u = n_samples * n_inputs;
        Ok(Self {
            law: NormOptimal::new(own, n_samples, weights)?,
            own: Plant::new(own)?,
            weights,
            is_right: own == model,
            n_inputs,
            solved: vec![0.0; n_u],
            error: vec![0.0; n_samples * own.n_outputs()],
            back: vec![0.0; n_u],
        })
    }

    /// `out = T' x` for the given axes.
    pub(super) fn transposed(&mut self, x: &[f64], axes: &Plant, out: &mut [f64]) -> Result {
        if !self.law.solve(x, &mut self.solved)? {
            return Err(LearningError::Numerics {
                what: "monotonic factor",
                reason: "the cost of the law could not be inverted",
            });
        }
        self.penalise(out);
        if self.is_right {
            return Ok(());
        }
        self.own.apply(&self.solved, &mut self.error);
        for value in &mut self.error {
            *value *= self.weights.q;
        }
        for (plant, sign) in [(&self.own, 1.0), (axes, -1.0)] {
            plant.apply_transposed(&self.error, &mut self.back);
            for (value, back) in out.iter_mut().zip(&self.back) {
                *value += sign * back;
            }
        }
        Ok(())
    }

    /// `out = (R + W) z`
    fn penalise(&self, out: &mut [f64]) {
        let (m, n, z) = (self.n_inputs, out.len(), &self.solved);
        let weight = self.weights.rate * self.weights.rate;
        for (i, value) in out.iter_mut().enumerate() {
            *value = self.weights.r * z[i];
            if i >= m {
                *value += weight * (z[i] - z[i - m]);
            }
            if i + m < n {
                *value -= weight * (z[i + m] - z[i]);
            }
        }
    }
}
