//! Higher order in the iteration: the next input from several past runs, with any law.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawName;
use super::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_core, violation,
};
use super::inputs::Inputs;
use crate::learning::error::{check_learns_from_every_run, check_length};
use crate::learning::{Law, LearningError, Result, Surrogate};
use crate::schema::{Violation, field_order};

/// Largest number of runs.
const ORDER_MAX: usize = 20;
/// Tolerance of the sum of the weights.
const ROUNDING: f64 = 1e-9;
/// Largest weight of a run.
const WEIGHT_MAX: f64 = 1e3;

/// `[learning.higher_order]`: the core law and the weights of the last runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct HigherOrderParameters {
    /// The law that proposes an input after each run, with the parameters of its own table.
    pub core: LawName,
    /// Weights of its proposals after the last run, the one before, ..., 1 to 20 numbers that add up to 1:
    /// `[1.5, -0.5]` extrapolates, `[0.5, 0.5]` averages noise.
    pub weights: Vec<f64>,
}

impl Default for HigherOrderParameters {
    fn default() -> Self {
        Self { core: LawName::NormOptimal, weights: vec![1.5, -0.5] }
    }
}

impl LawParameters for HigherOrderParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_core("[learning.higher_order] core", self.core, cell)?;
        if is_sound(&self.weights) {
            return Ok(());
        }
        let (key, found) = ("[learning.higher_order] weights", format!("{:?}", self.weights));
        Err(violation(key, found, RULE))
    }

    fn core(&self) -> Option<LawName> {
        Some(self.core)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let size = (context.n_samples(), context.n_axes());
        Ok(Box::new(HigherOrder::new(context.core(self.core)?, &self.weights, size)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"higher_order\"\n[learning.higher_order]\nweights = [0.8, 0.2]\n\
                       [learning.norm_optimal]\nrate = 6.0",
            error_left: 0.15,
        }]
    }
}

const RULE: &str = "1 to 20 numbers of at most 1000 that add up to 1";

fn is_sound(weights: &[f64]) -> bool {
    let sum: f64 = weights.iter().sum();
    (1..=ORDER_MAX).contains(&weights.len())
        && weights.iter().all(|weight| weight.abs() <= WEIGHT_MAX)
        && (sum - 1.0).abs() <= ROUNDING
}

/// A wrapper whose next input is a weighted sum of the inner law's proposals after the last runs.
///
/// `u_{j+1} = sum_i w_i law(u_{j-i}, e_{j-i})`, i = 0 for the last run
///
/// A missing earlier run is replaced by the oldest one. For an inner law with contraction `T` the inputs converge if
/// the roots of `z^n = t (w_0 z^(n-1) + ... + w_(n-1))` are inside the unit circle for every eigenvalue `t` of `T`;
/// with weights that are not negative they are wherever the inner law's error falls in every run.
///
/// # Shapes
/// - those of the inner law
/// # Real Time
/// Cold path. Allocates at creation, one row for each weight, never in [`Law::update`].
/// # Source
/// - \[bien1989\].
pub struct HigherOrder<L = Box<dyn Law>> {
    law: L,
    weights: Vec<f64>,
    n_samples: usize,
    n_inputs: usize,
    /// Proposals, the newest at `newest`.
    proposals: Inputs,
    newest: usize,
    proposal: Vec<f64>,
}

impl<L: Law> std::fmt::Debug for HigherOrder<L> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let weights = &self.weights;
        out.debug_struct("HigherOrder").field("weights", weights).finish_non_exhaustive()
    }
}

impl<L: Law> HigherOrder<L> {
    /// Wraps a law for runs of so many samples and inputs.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] unless there are 1 to 20 weights that add up to 1.
    /// - [`LearningError::Measures`] for a law that makes runs which only measure.
    pub fn new(law: L, weights: &[f64], (n_samples, n_inputs): (usize, usize)) -> Result<Self> {
        check_learns_from_every_run("higher_order", &law)?;
        if !is_sound(weights) {
            let (what, value) = ("the sum of weights", weights.iter().sum());
            return Err(LearningError::Parameter { what, value, allowed: RULE });
        }
        let (weights, proposal) = (weights.to_vec(), vec![0.0; n_samples * n_inputs]);
        let mut proposals = Inputs::new(proposal.len());
        proposals.reserve(weights.len());
        Ok(Self { law, weights, n_samples, n_inputs, proposals, newest: 0, proposal })
    }

    fn forget(&mut self) {
        self.proposals.clear();
        self.newest = 0;
    }

    fn store(&mut self) {
        let order = self.weights.len();
        if self.proposals.len() < order {
            self.newest = self.proposals.len();
            self.proposals.push(&self.proposal);
        } else {
            self.newest = (self.newest + 1) % order;
            self.proposals.replace(self.newest, &self.proposal);
        }
    }
}

impl<L: Law> Law for HigherOrder<L> {
    fn inner(&self) -> Option<&dyn Law> {
        Some(&self.law)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Law> {
        Some(&mut self.law)
    }

    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        check_length("next", next, self.n_samples, self.n_inputs)?;
        self.law.update(input, error, &mut self.proposal)?;
        self.store();
        next.fill(0.0);
        let last = self.proposals.len() - 1;
        for (age, weight) in self.weights.iter().enumerate() {
            let row = (self.newest + last + 1 - age.min(last)) % (last + 1);
            self.proposals.add(row, *weight, next);
        }
        Ok(())
    }

    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        self.law.recall(input, error, disturbance)
    }

    fn take_over(&mut self, reference: &[f64], input: &[f64]) -> Result<bool> {
        self.law.take_over(reference, input)
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        self.law.first_input()
    }

    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        Surrogate::Inside(&mut self.law)
    }

    fn on_rollback(&mut self) {
        self.forget();
        self.law.on_rollback();
    }

    fn reset(&mut self) {
        self.forget();
        self.law.reset();
    }

    fn describe(&self) -> String {
        let Self { weights, law, .. } = self;
        format!(r#"{{"law":"higher_order","weights":{weights:?},"core":{}}}"#, law.describe())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::learning::law::adjoint::Adjoint;
    use crate::learning::law::q_filter::QFilter;
    use crate::model::{Method, StateSpace, discretize, second_order};

    const N: usize = 80;

    fn axis(omega: f64, damping: f64, delay: usize) -> StateSpace {
        let model = second_order(omega, damping).unwrap();
        discretize(&model, 2e-3, Method::ZeroOrderHold).unwrap().delayed(delay).unwrap()
    }

    /// Runs the law on a plant, and returns the inputs.
    fn learn(weights: &[f64], runs: usize) -> Vec<DVector<f64>> {
        let core = Adjoint::new(&axis(94.0, 0.7, 0), N, None, QFilter::None).unwrap();
        let mut law = HigherOrder::new(core, weights, (N, 1)).unwrap();
        let plant = axis(80.0, 0.5, 1).lifted(N).unwrap();
        let mut inputs = vec![DVector::zeros(N)];
        for _ in 0..runs {
            let e = reference() - &plant * &inputs[inputs.len() - 1];
            let mut next = vec![0.0; N];
            law.update(inputs[inputs.len() - 1].as_slice(), e.as_slice(), &mut next).unwrap();
            inputs.push(DVector::from_vec(next));
        }
        inputs
    }

    fn reference() -> DVector<f64> {
        DVector::from_fn(N, |k, _| 0.01 * (k as f64 / 25.0).sin().powi(4))
    }

    #[test]
    fn it_is_the_recursion_of_its_companion_matrix() {
        let weights = [1.3, -0.5, 0.2];
        let model = axis(94.0, 0.7, 0).lifted(N).unwrap();
        let plant = axis(80.0, 0.5, 1).lifted(N).unwrap();
        let gain = Adjoint::new(&axis(94.0, 0.7, 0), N, None, QFilter::None).unwrap().gain();
        let learned = DMatrix::identity(N, N) - gain * model.transpose() * &plant;
        let constant = gain * model.transpose() * reference();
        // The oldest run replaces the missing ones: they are equal at first.
        let mut past = vec![DVector::zeros(N); 3];
        for u in learn(&weights, 9) {
            assert!((&u - &past[0]).amax() < 1e-12);
            let mut following = DVector::zeros(N);
            for (weight, input) in weights.iter().zip(&past) {
                following += *weight * (&learned * input + &constant);
            }
            past.rotate_right(1);
            past[0] = following;
        }
    }

    #[test]
    fn it_extrapolates_and_forgets_what_was_rolled_back() {
        let plant = axis(80.0, 0.5, 1).lifted(N).unwrap();
        let left = |weights: &[f64]| (reference() - &plant * &learn(weights, 30)[30]).norm();
        assert!(left(&[1.5, -0.5]) < 0.9 * left(&[1.0]), "{} {}", left(&[1.5, -0.5]), left(&[1.0]));

        let core = Adjoint::new(&axis(94.0, 0.7, 0), N, None, QFilter::None).unwrap();
        let mut law = HigherOrder::new(core, &[1.5, -0.5], (N, 1)).unwrap();
        let update = |law: &mut HigherOrder<Adjoint>, size: f64| {
            let mut next = vec![0.0; N];
            law.update(&[size; N], &[0.0; N], &mut next).unwrap();
            next[0]
        };
        assert!((update(&mut law, 1.0) - 1.0).abs() < 1e-12);
        assert!((update(&mut law, 2.0) - 2.5).abs() < 1e-12);
        law.on_rollback();
        assert!((update(&mut law, 3.0) - 3.0).abs() < 1e-12);
        for weights in [&[][..], &[0.5], &[1.0; 21], &[f64::NAN], &[2001.0, -2000.0]] {
            let core = Adjoint::new(&axis(94.0, 0.7, 0), N, None, QFilter::None).unwrap();
            assert!(HigherOrder::new(core, weights, (N, 1)).is_err(), "{weights:?}");
        }
    }
}
