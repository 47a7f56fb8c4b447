//! Parametric ILC: norm-optimal learning of the weights of given signals, so that what is learned on one
//! program holds on every other one.
//!
//! `basis_functions` and `position_domain` are this law with other signals; they, the Python bindings and the
//! tests import it.

mod answer;
mod fit;
mod functions;
mod group;
#[cfg(test)]
mod oracle;
mod terms;

pub use functions::{Function, MotionFunction, Travel};
pub use terms::{Diagonal, Term};

use nalgebra::{DMatrix, DVector};

use super::norm_optimal::decouple::parts;
use super::norm_optimal::plant::OwnPlant;
use super::norm_optimal::{Plant, Weights};
#[cfg(doc)]
use crate::learning::LearningError;
use crate::learning::error::{check, check_adjoint, check_counts, check_update};
use crate::learning::{Law, Result};

use answer::Answer;
use fit::Fit;
use group::Group;

/// Largest number of parameters that a status message names.
const NAMED_MAX: usize = 24;

/// Parametric ILC: `u = Psi theta`, with `theta` from a weighted least-squares problem.
///
/// `theta' = argmin |e + P (u - Psi theta)|_q^2 + |Psi theta|_s^2 + |Psi theta - u|_r^2`
///
/// A parameter that the program does not excite stays as it is. Axes that the model does not couple are solved
/// separately. The input `u` of the last run need not be in the span of the signals.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs`
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]: a product with a matrix of parameters times
/// samples.
/// # Source
/// - \[vandewijdeven2010\]; \[bolder2015\], Sec. 3: the update, and the parameters as functions of the program.
#[derive(Debug)]
pub struct Parametric {
    name: &'static str,
    described: serde_json::Value,
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    dt_s: f64,
    terms: Vec<Term>,
    answer: Answer,
    groups: Vec<Group>,
    /// Roots of the weights of error and change.
    q: Vec<f64>,
    r: Vec<f64>,
    start: Vec<f64>,
    theta: Vec<f64>,
    /// Learn; otherwise the parameters stay.
    learns: bool,
    /// Error that the input of the last run should have removed.
    wanted: Vec<f64>,
}

/// The law's name and parameters, for the record of a run.
pub type Told = (&'static str, serde_json::Value);

impl Parametric {
    /// Creates the law for the signals of a run.
    ///
    /// # Errors
    /// - [`LearningError::Empty`] for no samples or terms; [`LearningError::TooMany`] for a problem beyond memory.
    /// - [`LearningError::Parameter`] for an invalid weight.
    /// - [`LearningError::Length`] or [`LearningError::NotFinite`] for an invalid signal.
    /// - [`LearningError::Model`] for a continuous model, or one for another number of samples.
    pub fn new<'a>(
        told: Told,
        model: impl Into<Plant<'a>>,
        terms: Vec<Term>,
        n_samples: usize,
        weights: &Diagonal,
    ) -> Result<Self> {
        let plant = model.into();
        plant.check(n_samples)?;
        let first = plant.at(0);
        let (n_inputs, n_outputs) = (first.n_inputs(), first.n_outputs());
        let dt_s = first.dt_s().unwrap_or(1.0);
        check_counts(&[
            ("n_samples", n_samples),
            ("n_inputs", n_inputs),
            ("n_outputs", n_outputs),
            ("terms", terms.len()),
        ])?;
        for term in &terms {
            check("signal", &term.signal, n_samples, 1)?;
        }
        let q = Diagonal::roots(&weights.q, "q", n_samples * n_outputs)?;
        let s = Diagonal::roots(&weights.s, "s", n_samples * n_inputs)?;
        let r = Diagonal::roots(&weights.r, "r", n_samples * n_inputs)?;
        let mut groups = Vec::new();
        for part in parts(plant, &Weights::default().into())? {
            let mut answer = Answer::new(part.plant);
            let channels = (part.inputs, part.outputs);
            let roots = [&q, &s, &r].map(Vec::as_slice);
            groups.push(Group::new(&mut answer, &terms, channels, roots, [n_inputs, n_outputs])?);
        }
        let answer = Answer::new(match plant {
            Plant::Invariant(model) => OwnPlant::Invariant(model.clone()),
            Plant::Varying(model) => OwnPlant::Varying(model.clone()),
        });
        let start = vec![0.0; terms.len()];
        let wanted = vec![0.0; n_samples * n_outputs];
        let (name, described) = told;
        let mut law = Self {
            name,
            described,
            n_samples,
            n_inputs,
            n_outputs,
            dt_s,
            theta: start.clone(),
            terms,
            answer,
            groups,
            q,
            r,
            start,
            learns: true,
            wanted,
        };
        law.begin_with();
        Ok(law)
    }

    /// Sets the parameters to begin with, and whether to learn others.
    ///
    /// # Errors
    /// - [`LearningError::Length`] or [`LearningError::NotFinite`].
    pub fn starting_with(mut self, parameters: &[f64], learns: bool) -> Result<Self> {
        check("parameters", parameters, self.terms.len(), 1)?;
        self.start.copy_from_slice(parameters);
        self.learns = learns;
        self.begin_with();
        Ok(self)
    }

    /// Returns the parameters, in the order of the terms.
    pub fn parameters(&self) -> &[f64] {
        &self.theta
    }

    /// Returns the terms.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    fn begin_with(&mut self) {
        self.theta.copy_from_slice(&self.start);
        for group in &mut self.groups {
            group.begin_with(&self.start);
        }
    }

    fn input_of(&self, theta: &[f64], input: &mut [f64]) {
        input.fill(0.0);
        for (term, theta) in self.terms.iter().zip(theta) {
            let own = input.iter_mut().skip(term.input).step_by(self.n_inputs);
            own.zip(&term.signal).for_each(|(u, psi)| *u += theta * psi);
        }
    }
}

impl Law for Parametric {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        check_update(input, error, next, self.n_samples, [self.n_inputs, self.n_outputs])?;
        if self.learns {
            self.answer.forward(input, &mut self.wanted);
            self.wanted.iter_mut().zip(error).for_each(|(wanted, e)| *wanted += e);
            for group in &mut self.groups {
                group.solve(&self.wanted, input, [&self.q, &self.r], &mut self.theta);
            }
        }
        self.input_of(&self.theta, next);
        check("next", next, self.n_samples, self.n_inputs)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        let channels = [self.n_inputs, self.n_outputs];
        check_adjoint(dual, to_input, to_error, self.n_samples, channels)?;
        to_input.fill(0.0);
        to_error.fill(0.0);
        if !self.learns {
            return Ok(true);
        }
        let weigh = |term: &Term| -> f64 {
            let own = dual.iter().skip(term.input).step_by(self.n_inputs);
            own.zip(&term.signal).map(|(dual, psi)| dual * psi).sum()
        };
        let weighed: Vec<f64> = self.terms.iter().map(weigh).collect();
        let mut change = vec![0.0; to_input.len()];
        for group in &self.groups {
            group.transposed(&weighed, [&self.q, &self.r], to_error, &mut change);
        }
        self.answer.transposed(to_error, to_input);
        to_input.iter_mut().zip(&change).for_each(|(to, change)| *to += change);
        Ok(true)
    }

    fn take_over(&mut self, reference: &[f64], input: &[f64]) -> Result<bool> {
        if self.terms.iter().any(|term| term.function.is_none()) {
            return Ok(false);
        }
        let n_samples = input.len() / self.n_inputs;
        check("reference", reference, n_samples, self.n_inputs)?;
        check("input", input, n_samples, self.n_inputs)?;
        let channel = |signal: &[f64], axis: usize| -> Vec<f64> {
            signal.iter().skip(axis).step_by(self.n_inputs).copied().collect()
        };
        for axis in 0..self.n_inputs {
            let position_m = channel(reference, axis);
            let own = (0..self.terms.len()).filter(|i| self.terms[*i].input == axis);
            let own: Vec<usize> = own.collect();
            let signals = own.iter().filter_map(|i| self.terms[*i].function);
            let signals: Vec<Vec<f64>> = signals
                .map(|(function, lead)| function.signal(&position_m, self.dt_s, lead))
                .collect();
            let matrix = DMatrix::from_fn(n_samples, own.len(), |k, place| signals[place][k]);
            let fit = Fit::new(matrix);
            let start = DVector::from_iterator(own.len(), own.iter().map(|i| self.start[*i]));
            let found = &fit.inverse * DVector::from_vec(channel(input, axis)) + fit.left(&start);
            own.iter().zip(&found).for_each(|(i, value)| self.start[*i] = *value);
        }
        self.begin_with();
        Ok(true)
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        if self.start.iter().all(|value| *value == 0.0) {
            return Ok(None);
        }
        let mut input = vec![0.0; self.n_samples * self.n_inputs];
        self.input_of(&self.start, &mut input);
        Ok(Some(input))
    }

    fn status(&self) -> Option<String> {
        let named = self.terms.iter().zip(&self.theta).take(NAMED_MAX);
        let named: Vec<String> = named
            .map(|(term, theta)| format!("{}[{}] = {theta:.6e}", term.name, term.input))
            .collect();
        let rest = self.terms.len().saturating_sub(NAMED_MAX);
        let more = if rest > 0 { format!(", and {rest} more") } else { String::new() };
        Some(format!("parameters: {}{more}", named.join(", ")))
    }

    fn reset(&mut self) {
        self.begin_with();
    }

    fn describe(&self) -> String {
        serde_json::json!({
            "law": self.name,
            "parameters": self.described,
            "n_samples": self.n_samples,
            "n_inputs": self.n_inputs,
            "n_outputs": self.n_outputs,
        })
        .to_string()
    }
}
