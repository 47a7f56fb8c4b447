//! Norm-optimal learning: the input that a quadratic cost over the whole run asks for.

mod decouple;
#[cfg(test)]
mod oracle;
mod pairing;

use crate::learning::error::check;
use crate::learning::sweep::{self, FactorError, Gains, General, Rate, Run, Sweep};
use crate::learning::{Law, LearningError, Structure};
use crate::model::{ModelError, StateSpace};

use decouple::{Part, parts};
use pairing::Paired;

/// What a good next input is.
///
/// `J = sum_k q |z[k]|^2 + s |u'[k]|^2 + r |v[k]|^2 + sum_{k>=1} rate^2 |v[k] - v[k-1]|^2`
///
/// with `z` the predicted error, `u'` the next input and `v` its change; each number holds for every
/// channel.
///
/// # Units
/// - only the ratios matter; with error and input in metres all four are numbers without unit
/// # Source
/// - \[barton2010\], Eq. (3.13): `q`, `s`, `r`; \[haas2016\], Eq. (7): `rate`, there `d`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Weight of the predicted error.
    pub q: f64,
    /// Weight of the next input: keeps it small, at the price of an error that stays.
    pub s: f64,
    /// Weight of the change of the input: slows learning down, and evens noise out.
    pub r: f64,
    /// Weight of the change from one sample to the next: keeps the input smooth. Enters squared.
    pub rate: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self { q: 1.0, s: 0.0, r: 0.0, rate: 0.0 }
    }
}

/// Norm-optimal learning for a time-invariant model, exact and in linear time.
///
/// `u_{j+1} = u_j + argmin_v J(v)` with `z = e_j - P v`, `P` the lifted operator of the model.
///
/// With `s = r = 0` and `rate = d` this is convex-optimisation learning. The law pairs `e[k + l]`
/// with `u[k]`, where `l` is the first Markov parameter of that output that is not zero: 1 for an
/// axis without delay, 1 more for each sample of delay in the model. So the last `l` samples of the
/// input reach nothing within the run: there `s`, `r` and `rate` alone decide (with `rate` alone the
/// change is held at its last useful value), and if all three are zero the input stays as it was.
/// Axes that do not act on each other are solved one by one.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs`
/// # Real Time
/// Cold path. Allocates when it is made, never in [`Law::update`]; `O(n_samples)` time and memory.
/// # Source
/// - \[haas2016\], Eq. (5) to (12); \[barton2010\], Eq. (3.13) to (3.15). They solve the same problem
///   with dense matrices; here it is solved by a Riccati recursion.
#[derive(Debug)]
pub struct NormOptimal {
    model: StateSpace,
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    weights: Weights,
    parts: Vec<Box<dyn Sweep>>,
}

impl NormOptimal {
    /// Makes the law: factorises the problem for runs of `n_samples` samples.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a weight that is negative or not finite.
    /// - [`LearningError::Empty`] for no samples, or a model without inputs or outputs.
    /// - [`LearningError::Undetermined`] if `s`, `r` and `rate` are zero and the model does not
    ///   determine the input.
    /// - [`LearningError::Unbounded`] if they are zero and the model's inverse is unstable.
    /// - [`LearningError::Model`] for a continuous model.
    pub fn new(
        model: &StateSpace,
        n_samples: usize,
        weights: Weights,
    ) -> Result<Self, LearningError> {
        if model.dt_s().is_none() {
            return Err(ModelError::Continuous { action: "norm-optimal learning" }.into());
        }
        let Weights { q, s, r, rate } = weights;
        for (what, value) in [("q", q), ("s", s), ("r", r), ("rate", rate)] {
            if !(value.is_finite() && value >= 0.0) {
                let allowed = "a weight must be finite and not negative";
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        for (what, count) in
            [("n_samples", n_samples), ("n_inputs", n_inputs), ("n_outputs", n_outputs)]
        {
            if count == 0 {
                return Err(LearningError::Empty { what });
            }
        }
        let parts = parts(model)?
            .into_iter()
            .map(|part| solver(part, n_samples, weights))
            .collect::<Result<_, _>>()?;
        Ok(Self { model: model.clone(), n_samples, n_inputs, n_outputs, weights, parts })
    }

    /// Returns the number of groups of axes that are solved by themselves.
    pub fn n_parts(&self) -> usize {
        self.parts.len()
    }
}

/// Factorises one group of coupled axes.
fn solver(part: Part, n_samples: usize, weights: Weights) -> Result<Box<dyn Sweep>, LearningError> {
    let Weights { s, r, rate, .. } = weights;
    let paired = Paired::new(&part.model, n_samples, weights)?;
    let channels = sweep::Channels {
        inputs: part.inputs,
        outputs: part.outputs,
        shifts: paired.shifts().to_vec(),
    };
    let free_samples = paired.free_samples();
    let gains = if rate > 0.0 {
        Gains::new(&Rate { inner: paired, weight: rate * rate }, free_samples)
    } else {
        Gains::new(&paired, free_samples)
    };
    let gains = gains.map_err(|error| match error {
        FactorError::Undetermined { sample } => LearningError::Undetermined { s, r, rate, sample },
        FactorError::Unbounded => LearningError::Unbounded { s, r, rate },
    })?;
    Ok(match sweep::single(&gains, &channels) {
        Some(solver) => solver,
        None => Box::new(General::new(gains, channels)),
    })
}

impl Law for NormOptimal {
    fn update(
        &mut self,
        input: &[f64],
        error: &[f64],
        next: &mut [f64],
    ) -> Result<(), LearningError> {
        let Self { n_samples, n_inputs, n_outputs, .. } = *self;
        check("input", input, n_samples, n_inputs)?;
        check("error", error, n_samples, n_outputs)?;
        if next.len() != input.len() {
            let (what, found, n_channels) = ("next", next.len(), n_inputs);
            return Err(LearningError::Length { what, found, n_samples, n_channels });
        }
        let mut run = Run { input, error, next, n_inputs, n_outputs };
        for part in &mut self.parts {
            part.solve(&mut run);
        }
        check("next", run.next, n_samples, n_inputs)
    }

    fn structure(&self) -> Structure<'_> {
        Structure::Optimal { model: &self.model, weights: self.weights }
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        let Weights { q, s, r, rate } = self.weights;
        format!(
            r#"{{"law":"norm_optimal","q":{q},"s":{s},"r":{r},"rate":{rate},"n_samples":{},"n_inputs":{},"n_outputs":{}}}"#,
            self.n_samples, self.n_inputs, self.n_outputs
        )
    }
}
