//! A low-pass (Q-filter) after any law, e.g. after norm-optimal learning.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawName;
use super::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_core, check_cutoff,
};
use super::q_filter::{QFilter, QRunner};
use crate::learning::error::{check_learns_from_every_run, check_length};
use crate::learning::{Law, LearningError, Result};
use crate::schema::{Violation, field_order};

/// `[learning.filtered]`: another law and the low-pass after it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct FilteredParameters {
    /// The law whose input is filtered, with the parameters of its own table.
    pub core: LawName,
    /// Order of the zero-phase Butterworth low-pass (Q-filter).
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass, 0.001 to 0.95 of the Nyquist frequency: nothing is learned above it.
    pub cutoff_hz: f64,
}

impl Default for FilteredParameters {
    fn default() -> Self {
        Self { core: LawName::NormOptimal, order: 2, cutoff_hz: 10.0 }
    }
}

impl LawParameters for FilteredParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_core("[learning.filtered] core", self.core, cell)?;
        check_cutoff("[learning.filtered] cutoff_hz", Some(self.cutoff_hz), cell)
    }

    fn core(&self) -> Option<LawName> {
        Some(self.core)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let filter = QFilter::low_pass(self.order, self.cutoff_hz, context.cell.cycle_s)
            .map_err(LearningError::from)?;
        let size = (context.n_samples(), context.n_axes());
        Ok(Box::new(Filtered::new(context.core(self.core)?, size, filter)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"filtered\"\n[learning.filtered]\ncutoff_hz = 12.0\n\
                       [learning.norm_optimal]\nr = 0.1",
            error_left: 0.1,
        }]
    }
}

/// A wrapper that filters the next input of the inner law.
///
/// `u_{j+1} = Q law(u_j, e_j)`
///
/// With a norm-optimal law it is norm-optimal ILC with a Q-filter: the weights say how the input is learned, and the
/// filter takes away what lies above the frequency up to which the model holds. A part of the error remains there.
///
/// # Shapes
/// - those of the inner law
/// # Real Time
/// Cold path. The filter allocates at creation, never in [`Law::update`].
/// # Source
/// - \[bristow2006\]: robustness by the Q-filter, whatever the learning function.
pub struct Filtered<L = Box<dyn Law>> {
    law: L,
    q_filter: QFilter,
    runner: QRunner,
    n_samples: usize,
    n_inputs: usize,
    dual: Vec<f64>,
}

impl<L: Law> std::fmt::Debug for Filtered<L> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("Filtered").field("q_filter", &self.q_filter).finish_non_exhaustive()
    }
}

impl<L: Law> Filtered<L> {
    /// Wraps a law for runs of so many samples and inputs.
    ///
    /// # Errors
    /// - [`LearningError::Signal`] if the run is too short for the filter.
    /// - [`LearningError::Measures`] for a law that makes runs which only measure.
    pub fn new(law: L, (n_samples, n_inputs): (usize, usize), q_filter: QFilter) -> Result<Self> {
        check_learns_from_every_run("filtered", &law)?;
        let runner = q_filter.for_samples(n_samples)?;
        let dual = vec![0.0; n_samples * n_inputs];
        Ok(Self { law, q_filter, runner, n_samples, n_inputs, dual })
    }
}

impl<L: Law> Law for Filtered<L> {
    fn inner(&self) -> Option<&dyn Law> {
        Some(&self.law)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Law> {
        Some(&mut self.law)
    }

    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        check_length("next", next, self.n_samples, self.n_inputs)?;
        self.law.update(input, error, next)?;
        Ok(self.runner.apply(next, self.n_inputs)?)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        check_length("dual", dual, self.n_samples, self.n_inputs)?;
        self.dual.copy_from_slice(dual);
        self.runner.apply_transposed(&mut self.dual, self.n_inputs)?;
        self.law.apply_adjoint(&self.dual, to_input, to_error)
    }

    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        self.law.recall(input, error, disturbance)
    }

    fn take_over(&mut self, reference: &[f64], input: &[f64]) -> Result<bool> {
        self.law.take_over(reference, input)
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        let Some(mut input) = self.law.first_input()? else { return Ok(None) };
        let mut runner = self.q_filter.for_samples(self.n_samples)?;
        runner.apply(&mut input, self.n_inputs)?;
        Ok(Some(input))
    }

    fn reset(&mut self) {
        self.law.reset();
    }

    fn describe(&self) -> String {
        let (q_filter, core) = (self.q_filter.describe(), self.law.describe());
        format!(r#"{{"law":"filtered","q_filter":{q_filter},"core":{core}}}"#)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::learning::law::norm_optimal::{NormOptimal, Weights};
    use crate::model::{Method, StateSpace, discretize, second_order};

    const N: usize = 150;
    const DT_S: f64 = 2e-3;

    fn axis(omega: f64, damping: f64, delay: usize) -> StateSpace {
        let model = second_order(omega, damping).unwrap();
        discretize(&model, DT_S, Method::ZeroOrderHold).unwrap().delayed(delay).unwrap()
    }

    fn law(r: f64) -> Filtered<NormOptimal> {
        let weights = Weights { q: 1.0, s: 0.0, r, rate: 0.0 };
        let core = NormOptimal::new(&axis(94.0, 0.7, 0), N, weights).unwrap();
        Filtered::new(core, (N, 1), QFilter::low_pass(2, 25.0, DT_S).unwrap()).unwrap()
    }

    /// Returns the matrix of the filter, column by column.
    fn filter() -> DMatrix<f64> {
        let mut runner = QFilter::low_pass(2, 25.0, DT_S).unwrap().for_samples(N).unwrap();
        let mut matrix = DMatrix::identity(N, N);
        for mut column in matrix.column_iter_mut() {
            runner.apply(column.as_mut_slice(), 1).unwrap();
        }
        matrix
    }

    #[test]
    fn with_norm_optimal_it_is_the_filtered_dense_solution() {
        let lifted = axis(94.0, 0.7, 0).lifted(N).unwrap();
        let (u, e) = (
            DVector::from_fn(N, |k, _| (k as f64 * 0.13).sin()),
            DVector::from_fn(N, |k, _| (k as f64 * 0.21).cos()),
        );
        let r = 0.05;
        let left = lifted.tr_mul(&lifted) + DMatrix::identity(N, N) * r;
        let change = left.lu().solve(&lifted.tr_mul(&e)).unwrap();
        let expected = filter() * (&u + change);
        let mut next = vec![0.0; N];
        law(r).update(u.as_slice(), e.as_slice(), &mut next).unwrap();
        for (found, expected) in next.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-8, "{found} {expected}");
        }
    }

    /// A plant with a mode that the model omits: alone the law diverges, with the filter it converges.
    #[test]
    fn the_filter_keeps_the_law_from_a_mode_that_the_model_omits() {
        let mode = discretize(&second_order(400.0, 0.04).unwrap(), DT_S, Method::ZeroOrderHold);
        let plant = axis(94.0, 0.7, 0).series(&mode.unwrap()).unwrap().lifted(N).unwrap();
        let reference = DVector::from_fn(N, |k, _| 0.01 * (k as f64 / 48.0).sin().powi(4));
        let run = |law: &mut dyn Law| {
            let mut u = DVector::zeros(N);
            let mut sizes = Vec::new();
            for _ in 0..12 {
                let e = &reference - &plant * &u;
                sizes.push(e.norm());
                let mut next = vec![0.0; N];
                law.update(u.as_slice(), e.as_slice(), &mut next).unwrap();
                u = DVector::from_vec(next);
            }
            sizes
        };
        let weights = Weights { q: 1.0, s: 0.0, r: 1e-3, rate: 0.0 };
        let mut plain = NormOptimal::new(&axis(94.0, 0.7, 0), N, weights).unwrap();
        let (alone, filtered) = (run(&mut plain), run(&mut law(1e-3)));
        assert!(alone[11] > 10.0 * alone[3], "{alone:?}");
        assert!(filtered[2..].iter().all(|size| *size < 0.01 * filtered[0]), "{filtered:?}");
    }
}
