//! Norm-optimal ILC: minimises a quadratic cost over the whole run.

mod cost;
pub(super) mod decouple;
#[cfg(test)]
mod oracle;
mod pairing;
mod parameters;
pub(super) mod plant;
pub(super) mod relative_degree;

pub use cost::{Cost, Weights};
pub use pairing::Paired;
pub use parameters::{ContourParameters, NormOptimalParameters, PhaseParameters};
pub use plant::Plant;

use crate::learning::error::{check, check_adjoint, check_counts, check_length, is_finite};
use crate::learning::sweep::{
    self, Channels, FactorError, Form, Gains, Inverse, Rate, Run, Stages, Sweep,
};
use crate::learning::{Law, LearningError, Result, Structure};
use crate::model::StateSpace;

use decouple::{Part, parts};

/// Norm-optimal ILC, exact and in linear time.
///
/// `u_{j+1} = u_j + argmin_v J(v)` with `z = e_j - P v`, `P` the lifted system of the model, which
/// may vary along the run like the weights.
///
/// With `s = r = 0` and `rate = d` this is convex-optimisation ILC (CO-ILC). The law pairs
/// `e[k + l]` with `u[k]`, where `l` is the index of the first non-zero Markov parameter of that
/// output (its relative degree): 1 for an axis without delay, 1 more for each sample of dead time
/// in the model. So the last `l` samples of the input have no effect within the run: there `s`, `r`
/// and `rate` alone decide (with `rate` alone the change is held at its last useful value), and if
/// all three are zero the input is unchanged. Axes that are coupled neither by the model nor by the
/// weights are solved separately.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs`
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples)` time and memory.
/// # Source
/// - \[haas2016\], Eq. (5) to (12); \[barton2010\], Eq. (3.13) to (3.15). They solve the same
///   problem with dense matrices; here it is solved by a Riccati recursion.
pub struct NormOptimal {
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    weights: String,
    /// Model, if it is time-invariant, and the weights, if they are scalars.
    invariant: Option<StateSpace>,
    scalars: Option<Weights>,
    conditioning: f64,
    n_states: usize,
    parts: Vec<Box<dyn Sweep>>,
    /// Samples at the start of the run whose error is not used, at least in some output.
    n_unread: usize,
    inverses: Inverses,
}

/// The Hessians of the parts, factorised on first use.
enum Inverses {
    /// Data to factorise: the stages of each part, its channels and its free samples.
    Of(Vec<(Box<dyn Stages + Send>, Channels, usize)>),
    Made(Vec<Inverse>),
    /// The stages are not available.
    None,
}

impl std::fmt::Debug for NormOptimal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NormOptimal")
            .field("n_samples", &self.n_samples)
            .field("n_inputs", &self.n_inputs)
            .field("n_outputs", &self.n_outputs)
            .field("weights", &self.weights)
            .field("parts", &self.parts)
            .finish_non_exhaustive()
    }
}

impl NormOptimal {
    /// Creates the law: factorises the problem for runs of `n_samples` samples.
    ///
    /// `model` is a [`StateSpace`] or a
    /// [`TimeVarying`](crate::model::TimeVarying), `weights` are [`Weights`] or a [`Cost`].
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a weight that is negative or not finite.
    /// - [`LearningError::Weight`] for a weight of the wrong shape, or one that is not positive
    ///   semidefinite.
    /// - [`LearningError::Empty`] for 0 samples, or a model without inputs or outputs.
    /// - [`LearningError::Undetermined`] if `s`, `r` and `rate` are zero and the model does not
    ///   determine the input.
    /// - [`LearningError::Unbounded`] if they are zero and the model's inverse is unstable.
    /// - [`LearningError::Model`] for a continuous model, or one with another number of samples.
    pub fn new<'a>(
        model: impl Into<Plant<'a>>,
        n_samples: usize,
        weights: impl Into<Cost>,
    ) -> Result<Self> {
        Self::with_form(model, n_samples, weights, Form::default())
    }

    /// [`NormOptimal::new`] with another form of the recursion: for weights so small that
    /// [`NormOptimal::conditioning`] calls for a square-root form.
    ///
    /// # Errors
    /// - as [`NormOptimal::new`].
    pub fn with_form<'a>(
        model: impl Into<Plant<'a>>,
        n_samples: usize,
        weights: impl Into<Cost>,
        form: Form,
    ) -> Result<Self> {
        let (plant, cost) = (model.into(), weights.into());
        let (n_inputs, n_outputs) = (plant.at(0).n_inputs(), plant.at(0).n_outputs());
        check_counts(&[
            ("n_samples", n_samples),
            ("n_inputs", n_inputs),
            ("n_outputs", n_outputs),
        ])?;
        plant.check(n_samples)?;
        cost.check(n_samples, n_inputs, n_outputs)?;
        let mut law = Self {
            n_samples,
            n_inputs,
            n_outputs,
            weights: cost.json(),
            invariant: plant.invariant().cloned(),
            scalars: cost.scalars(),
            conditioning: 1.0,
            n_states: 0,
            parts: Vec::new(),
            n_unread: 0,
            inverses: Inverses::None,
        };
        let mut n_read = 0;
        let mut problems: Vec<(Box<dyn Stages + Send>, Channels, usize)> = Vec::new();
        for Part { plant, cost, inputs, outputs } in parts(plant, &cost)? {
            let (told, rate) = (cost.told(), cost.rate);
            let paired = Paired::new(plant.borrow(), n_samples, cost)?;
            let channels = Channels { inputs, outputs, shifts: paired.shifts().to_vec() };
            let free_samples = paired.free_samples();
            n_read += channels.outputs.len();
            if rate > 0.0 {
                let rated = Rate { inner: paired, weight: rate * rate };
                law.add(&rated, channels.clone(), free_samples, form, &told)?;
                problems.push((Box::new(rated), channels, free_samples));
            } else {
                law.add(&paired, channels.clone(), free_samples, form, &told)?;
                problems.push((Box::new(paired), channels, free_samples));
            }
        }
        law.inverses = Inverses::Of(problems);
        if n_read < n_outputs {
            law.n_unread = n_samples;
        }
        Ok(law)
    }

    /// Factorises one group of channels.
    fn add(
        &mut self,
        stages: &impl Stages,
        channels: Channels,
        free_samples: usize,
        form: Form,
        told: &str,
    ) -> Result {
        let weights = || told.to_owned();
        let gains = Gains::with_form(stages, free_samples, form).map_err(|error| match error {
            FactorError::Undetermined { sample } => {
                LearningError::Undetermined { weights: weights(), sample }
            }
            FactorError::Unbounded => LearningError::Unbounded { weights: weights() },
        })?;
        self.conditioning = self.conditioning.min(gains.conditioning());
        self.n_states = self.n_states.max(gains.n_states());
        let shift = channels.shifts.iter().copied().max().unwrap_or(0);
        self.n_unread = self.n_unread.max(shift.min(self.n_samples));
        self.parts.push(sweep::solver(&gains, stages, channels));
        Ok(())
    }

    /// Returns the conditioning of the input: the smallest pivot of the cost, over the largest.
    /// Below about `1e-12` part of the input is determined by noise only.
    pub fn conditioning(&self) -> f64 {
        self.conditioning
    }

    /// Returns the largest number of states among the groups of axes: the time of an update grows
    /// with its square.
    pub fn n_states(&self) -> usize {
        self.n_states
    }

    /// Returns the number of groups of axes that are solved separately.
    pub fn n_parts(&self) -> usize {
        self.parts.len()
    }

    /// Writes `H^-1 x`, `H` being the Hessian of the cost; returns true if it is available.
    ///
    /// # Errors
    /// - [`LearningError::Length`] for signals of a different length.
    pub(in crate::learning) fn solve(&mut self, x: &[f64], z: &mut [f64]) -> Result<bool> {
        check_length("x", x, self.n_samples, self.n_inputs)?;
        check_length("z", z, self.n_samples, self.n_inputs)?;
        let n_inputs = self.n_inputs;
        let Some(inverses) = self.inverses() else { return Ok(false) };
        for inverse in inverses {
            inverse.solve(x, z, n_inputs);
        }
        Ok(true)
    }

    /// Returns the inverses of the parts' Hessians; `None` if they are not available.
    fn inverses(&mut self) -> Option<&mut Vec<Inverse>> {
        if let Inverses::Of(problems) = &mut self.inverses {
            let made: Result<Vec<Inverse>, FactorError> = std::mem::take(problems)
                .into_iter()
                .map(|(stages, channels, free)| Inverse::new(stages, channels, free))
                .collect();
            self.inverses = made.map_or(Inverses::None, Inverses::Made);
        }
        match &mut self.inverses {
            Inverses::Made(inverses) => Some(inverses),
            _ => None,
        }
    }
}

impl Law for NormOptimal {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let Self { n_samples, n_inputs, n_outputs, .. } = *self;
        check_length("input", input, n_samples, n_inputs)?;
        check_length("error", error, n_samples, n_outputs)?;
        check_length("next", next, n_samples, n_inputs)?;
        let mut run = Run { input, error, next: &mut *next, n_inputs, n_outputs };
        for part in &mut self.parts {
            part.solve(&mut run);
        }
        // Any non-finite value in the input, or in an error that a part uses, makes a sample of
        // `next` non-finite, as there are only sums and products between. So one pass suffices, and
        // the place is searched for only if something is wrong.
        if is_finite(next) && is_finite(&error[..self.n_unread * n_outputs]) {
            return Ok(());
        }
        check("input", input, n_samples, n_inputs)?;
        check("error", error, n_samples, n_outputs)?;
        check("next", next, n_samples, n_inputs)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        let Self { n_samples, n_inputs, n_outputs, .. } = *self;
        check_adjoint(dual, to_input, to_error, n_samples, [n_inputs, n_outputs])?;
        let Some(inverses) = self.inverses() else { return Ok(false) };
        to_error.fill(0.0);
        for inverse in inverses {
            inverse.transposed(dual, to_input, to_error, (n_inputs, n_outputs));
        }
        Ok(true)
    }

    fn structure(&self) -> Structure<'_> {
        self.invariant
            .as_ref()
            .map_or(Structure::Unknown, |model| Structure::Optimal { model, weights: self.scalars })
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        let Self { weights, .. } = self;
        format!(
            r#"{{"law":"norm_optimal",{weights},"n_samples":{},"n_inputs":{},"n_outputs":{}}}"#,
            self.n_samples, self.n_inputs, self.n_outputs
        )
    }
}
