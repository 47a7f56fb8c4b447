//! One iteration of learning as a linear map of the input: `u_{j+1} = T u_j + L_e r`.

use super::hessian::Hessian;
use super::plant::{Plant, first_effects};
use crate::learning::error::check_counts;
use crate::learning::krylov::{noise, norm};
use crate::learning::{Law, LearningError, Result, Structure};
use crate::model::StateSpace;

/// Tolerance of linearity, relative to the update: rounding.
const LINEAR: f64 = 1e-6;
/// The same for `<T u, v>` and `<u, T' v>`.
const ADJOINT: f64 = 1e-6;

/// Largest number of inputs that is analysed: beyond it the analysis takes minutes.
const INPUTS_MAX: usize = 1_000_000;

/// Refuses an empty run, and one whose analysis would take minutes.
pub(in crate::learning) fn check_length(model: &StateSpace, n_samples: usize) -> Result {
    let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
    check_counts(&[("n_samples", n_samples), ("n_inputs", n_inputs), ("n_outputs", n_outputs)])?;
    let allowed = INPUTS_MAX / n_inputs.max(n_outputs);
    if n_samples > allowed {
        let what = "n_samples of an analysis";
        return Err(LearningError::TooMany { what, value: n_samples, allowed });
    }
    Ok(())
}

/// Replacement for zero in [`lift`].
pub(super) const FLOOR: f64 = 1e-60;

/// Source of the law's adjoint.
#[derive(Debug)]
enum Transpose {
    /// Implemented by the law.
    Law,
    /// From the cost of a norm-optimal law; see [`Hessian`].
    Optimal(Box<Hessian>),
    /// Not available.
    None,
}

/// A law with its plant: `T = L_u - L_e P`, with `u` and `e` whole runs.
///
/// The law is used through [`Law::update`], so that its behaviour at the ends of the run is
/// included. Inputs at the end of the run that affect no output and that the law does not couple to
/// the others do not affect convergence; they are omitted.
pub(super) struct Iteration<'a> {
    law: &'a mut dyn Law,
    pub(super) plant: Plant,
    pub(super) n_samples: usize,
    pub(super) n_inputs: usize,
    pub(super) n_outputs: usize,
    /// The law's output for zero input and error.
    offset: Vec<f64>,
    transpose: Transpose,
    /// Indices of omitted inputs.
    free: Vec<usize>,
    error: Vec<f64>,
    dual: Vec<f64>,
    input: Vec<f64>,
}

impl<'a> Iteration<'a> {
    pub(super) fn new(law: &'a mut dyn Law, model: &StateSpace, n_samples: usize) -> Result<Self> {
        let plant = Plant::new(model)?;
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        check_length(model, n_samples)?;
        let hessian = match law.structure() {
            Structure::Optimal { model: own, weights: Some(weights) } => {
                Some(Hessian::new(own, model, n_samples, weights)?)
            }
            _ => None,
        };
        let (n_u, n_e) = (n_samples * n_inputs, n_samples * n_outputs);
        law.reset();
        let mut offset = vec![0.0; n_u];
        law.update(&vec![0.0; n_u], &vec![0.0; n_e], &mut offset)?;
        let mut iteration = Self {
            law,
            plant,
            n_samples,
            n_inputs,
            n_outputs,
            offset,
            transpose: Transpose::None,
            free: Vec::new(),
            error: vec![0.0; n_e],
            dual: vec![0.0; n_e],
            input: vec![0.0; n_u],
        };
        iteration.transpose = if let Some(hessian) = hessian {
            Transpose::Optimal(Box::new(hessian))
        } else {
            let zero = vec![0.0; n_u];
            let Self { law, input, dual, .. } = &mut iteration;
            if law.apply_adjoint(&zero, input, dual)? { Transpose::Law } else { Transpose::None }
        };
        iteration.leave_out(model)?;
        iteration.check_transpose()?;
        Ok(iteration)
    }

    /// Refuses a nonlinear law, by trial.
    pub(super) fn check_linear(&mut self) -> Result {
        let (n_u, n_e) = (self.n_u(), self.n_e());
        let signals = [noise(n_u, 1), noise(n_u, 2), noise(n_e, 3), noise(n_e, 4)];
        let sum = |a: &[f64], b: &[f64]| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| 2.0 * a - 3.0 * b).collect()
        };
        let [u, v, e, d] = &signals;
        let mut found = [vec![0.0; n_u], vec![0.0; n_u], vec![0.0; n_u]];
        self.law_linear(u, e, &mut found[0])?;
        self.law_linear(v, d, &mut found[1])?;
        self.law_linear(&sum(u, v), &sum(e, d), &mut found[2])?;
        let expected = sum(&found[0], &found[1]);
        let scale = norm(&found[0]).max(norm(&found[1])).max(norm(&expected));
        let apart: Vec<f64> = expected.iter().zip(&found[2]).map(|(a, b)| a - b).collect();
        let difference = norm(&apart) / scale.max(f64::MIN_POSITIVE);
        if difference <= LINEAR {
            return Ok(());
        }
        Err(LearningError::NotLinear { difference })
    }

    /// Discards an adjoint that fails the test `<T u, v> = <u, T' v>`.
    ///
    /// Figures from a wrong adjoint would not be those of the law. Without one the law is analysed
    /// by columns.
    fn check_transpose(&mut self) -> Result {
        if !self.has_transpose() {
            return Ok(());
        }
        let n = self.n_u();
        let (mut u, mut v) = (noise(n, 6), noise(n, 7));
        self.clear(&mut u);
        self.clear(&mut v);
        let (mut forward, mut back) = (vec![0.0; n], vec![0.0; n]);
        self.apply(&u, &mut forward)?;
        self.apply_transposed(&v, &mut back)?;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (size_u, size_v) = (norm(&u), norm(&v));
        let scale = norm(&forward) * size_v + norm(&back) * size_u + 1e-6 * size_u * size_v;
        let apart = (dot(&forward, &v) - dot(&u, &back)).abs();
        if apart.is_finite() && apart > ADJOINT * scale {
            self.transpose = Transpose::None;
        }
        Ok(())
    }

    pub(super) fn n_u(&self) -> usize {
        self.n_samples * self.n_inputs
    }

    pub(super) fn n_e(&self) -> usize {
        self.n_samples * self.n_outputs
    }

    /// Returns the indices of the inputs that do not affect convergence.
    pub(super) fn free(&self) -> &[usize] {
        &self.free
    }

    /// Returns true if [`Iteration::apply_transposed`] is available.
    pub(super) fn has_transpose(&self) -> bool {
        !matches!(self.transpose, Transpose::None)
    }

    /// `out = L_u u + L_e e`
    pub(super) fn law_linear(&mut self, u: &[f64], e: &[f64], out: &mut [f64]) -> Result {
        crate::interrupt::point();
        self.law.reset();
        self.law.update(u, e, out)?;
        for (value, offset) in out.iter_mut().zip(&self.offset) {
            *value -= offset;
        }
        Ok(())
    }

    /// `out = law(u, e)`, offset included.
    pub(super) fn law(&mut self, u: &[f64], e: &[f64], out: &mut [f64]) -> Result {
        crate::interrupt::point();
        self.law.reset();
        self.law.update(u, e, out)
    }

    /// `out = T u`
    pub(super) fn apply(&mut self, u: &[f64], out: &mut [f64]) -> Result {
        let mut input = std::mem::take(&mut self.input);
        let mut error = std::mem::take(&mut self.error);
        input.copy_from_slice(u);
        self.clear(&mut input);
        lift(&mut input);
        self.plant.apply(&input, &mut error);
        for value in &mut error {
            *value = -*value;
        }
        let done = self.law_linear(&input, &error, out);
        self.input = input;
        self.error = error;
        done?;
        self.clear(out);
        Ok(())
    }

    /// `out = T' x`
    pub(super) fn apply_transposed(&mut self, x: &[f64], out: &mut [f64]) -> Result {
        crate::interrupt::point();
        let mut input = x.to_vec();
        self.clear(&mut input);
        lift(&mut input);
        match &mut self.transpose {
            Transpose::Optimal(hessian) => hessian.transposed(&input, &self.plant, out)?,
            Transpose::Law => {
                self.law.apply_adjoint(&input, out, &mut self.dual)?;
                self.plant.apply_transposed(&self.dual, &mut self.input);
                for (value, through) in out.iter_mut().zip(&self.input) {
                    *value -= through;
                }
            }
            Transpose::None => {
                return Err(LearningError::Numerics {
                    what: "monotonic factor",
                    reason: "the law has no transpose",
                });
            }
        }
        self.clear(out);
        Ok(())
    }

    /// Sets the omitted inputs to zero.
    pub(super) fn clear(&self, signal: &mut [f64]) {
        for index in &self.free {
            signal[*index] = 0.0;
        }
    }

    /// Finds the inputs that affect no output within the run, and omits them if the law does not
    /// couple them to the others.
    fn leave_out(&mut self, model: &StateSpace) -> Result {
        let effects = first_effects(model)?;
        let mut free = Vec::new();
        for (channel, effect) in effects.iter().enumerate() {
            let late = effect.unwrap_or(self.n_samples).min(self.n_samples);
            free.extend(
                (self.n_samples - late..self.n_samples).map(|k| k * self.n_inputs + channel),
            );
        }
        if free.len() == self.n_u() {
            return Ok(());
        }
        let mut probe = vec![0.0; self.n_u()];
        let mut out = vec![0.0; self.n_u()];
        let zero = vec![0.0; self.n_e()];
        for (place, index) in free.iter().enumerate() {
            // Irregular values, so that no two effects cancel.
            probe[*index] = 1.0 + 0.37 * ((place * 7919) % 101) as f64 / 101.0;
        }
        self.law_linear(&probe, &zero, &mut out)?;
        let reach = norm(&out);
        for index in &free {
            out[*index] = 0.0;
        }
        if norm(&out) <= 1e-9 * reach {
            self.free = free;
        }
        Ok(())
    }
}

/// Keeps a signal of about unit size away from zero by less than rounding: a signal that decays
/// over a long quiet stretch would otherwise reach denormal numbers, which are a hundred times
/// slower.
pub(super) fn lift(signal: &mut [f64]) {
    for value in signal {
        if value.abs() < FLOOR {
            *value = FLOOR;
        }
    }
}
