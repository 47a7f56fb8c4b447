//! The transpose of an optimal law's iteration, by updates of the law itself.

use super::plant::Plant;
use crate::learning::law::norm_optimal::{NormOptimal, Weights};
use crate::learning::{Law, LearningError};
use crate::model::StateSpace;

/// The transpose of an optimal law's iteration.
///
/// `T = H^-1 M` with `H = P'QP + S + R + W` and `M = R + W`, so `T' = M H^-1`. What solves with `H` is
/// the law itself, with `S + R` as weight of the input: `H^-1 g` is its change for the input
/// `-(S + R)^-1 g`. With a rate penalty alone `W` is singular; then `g = W z + c P'Q e0` is taken
/// apart, `H^-1 W z = T z` and `H^-1 P'Q e0` being updates of the law.
pub(super) struct Hessian {
    solver: NormOptimal,
    plant: Plant,
    weights: Weights,
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    /// Only for a rate penalty alone: the change that restores the means.
    means: Option<Means>,
}

impl std::fmt::Debug for Hessian {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hessian").field("weights", &self.weights).finish_non_exhaustive()
    }
}

/// For each input channel a signal `P'Q e0` with its `H^-1 P'Q e0`, and the inverse of their sums.
struct Means {
    signals: Vec<Vec<f64>>,
    solutions: Vec<Vec<f64>>,
    inverse: nalgebra::DMatrix<f64>,
}

impl Hessian {
    /// Returns `None` where the transpose cannot be had this way.
    pub(super) fn new(
        model: &StateSpace,
        n_samples: usize,
        weights: Weights,
    ) -> Result<Option<Self>, LearningError> {
        let hold = weights.s + weights.r;
        let solver = Weights { s: hold, r: 0.0, ..weights };
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        let mut hessian = Self {
            solver: NormOptimal::new(model, n_samples, solver)?,
            plant: Plant::new(model)?,
            weights,
            n_samples,
            n_inputs,
            n_outputs,
            means: None,
        };
        if hold > 0.0 || weights.rate == 0.0 {
            return Ok(Some(hessian));
        }
        let n_u = n_samples * n_inputs;
        let mut sums = nalgebra::DMatrix::zeros(n_inputs, n_inputs);
        let (mut signals, mut solutions) = (Vec::new(), Vec::new());
        for channel in 0..n_inputs {
            // An error that this input could have made.
            let mut step = vec![0.0; n_u];
            for sample in step.chunks_exact_mut(n_inputs) {
                sample[channel] = 1.0;
            }
            let mut error = vec![0.0; n_samples * n_outputs];
            hessian.plant.apply(&step, &mut error);
            let mut signal = vec![0.0; n_u];
            hessian.plant.apply_transposed(&error, &mut signal);
            for value in &mut signal {
                *value *= weights.q;
            }
            let mut solution = vec![0.0; n_u];
            hessian.solver.update(&vec![0.0; n_u], &error, &mut solution)?;
            for sample in signal.chunks_exact(n_inputs) {
                for (row, value) in sample.iter().enumerate() {
                    sums[(row, channel)] += value;
                }
            }
            signals.push(signal);
            solutions.push(solution);
        }
        let Some(inverse) = sums.try_inverse() else { return Ok(None) };
        hessian.means = Some(Means { signals, solutions, inverse });
        Ok(Some(hessian))
    }

    /// `out = T' x = M H^-1 x`
    pub(super) fn transposed(&mut self, x: &[f64], out: &mut [f64]) -> Result<(), LearningError> {
        let Weights { s, r, rate, .. } = self.weights;
        if r + rate == 0.0 {
            out.fill(0.0);
            return Ok(());
        }
        let hold = s + r;
        let solved = if hold > 0.0 {
            let zero = vec![0.0; self.n_samples * self.n_outputs];
            let input: Vec<f64> = x.iter().map(|value| -value / hold).collect();
            self.solver.update(&input, &zero, out)?;
            out.iter().zip(&input).map(|(next, input)| next - input).collect()
        } else {
            self.solve_rate(x)?
        };
        self.penalise(&solved, out);
        Ok(())
    }

    /// `H^-1 x` where the rate of the change is all that is penalised.
    fn solve_rate(&mut self, x: &[f64]) -> Result<Vec<f64>, LearningError> {
        let Some(means) = &self.means else {
            return Err(LearningError::Numerics {
                what: "monotonic factor",
                reason: "an input has no effect at rest",
            });
        };
        let m = self.n_inputs;
        let mut sums = nalgebra::DVector::zeros(m);
        for sample in x.chunks_exact(m) {
            for (sum, value) in sums.iter_mut().zip(sample) {
                *sum += value;
            }
        }
        let shares = &means.inverse * sums;
        let mut rest = x.to_vec();
        for (signal, share) in means.signals.iter().zip(shares.iter()) {
            for (value, part) in rest.iter_mut().zip(signal) {
                *value -= share * part;
            }
        }
        // W z = rest: the differences of z are running sums of the rest.
        let weight = self.weights.rate * self.weights.rate;
        let mut z = vec![0.0; x.len()];
        let mut error = vec![0.0; self.n_samples * self.n_outputs];
        for channel in 0..m {
            let (mut sum, mut value) = (0.0, 0.0);
            for k in 0..self.n_samples {
                z[k * m + channel] = value;
                sum += rest[k * m + channel];
                value -= sum / weight;
            }
        }
        self.plant.apply(&z, &mut error);
        for value in &mut error {
            *value = -*value;
        }
        let mut solved = vec![0.0; x.len()];
        self.solver.update(&z, &error, &mut solved)?;
        for (solution, share) in means.solutions.iter().zip(shares.iter()) {
            for (value, part) in solved.iter_mut().zip(solution) {
                *value += share * part;
            }
        }
        Ok(solved)
    }

    /// `out = (R + W) x`
    fn penalise(&self, x: &[f64], out: &mut [f64]) {
        let (m, n) = (self.n_inputs, x.len());
        let weight = self.weights.rate * self.weights.rate;
        for (i, value) in out.iter_mut().enumerate() {
            *value = self.weights.r * x[i];
            if i >= m {
                *value += weight * (x[i] - x[i - m]);
            }
            if i + m < n {
                *value -= weight * (x[i + m] - x[i]);
            }
        }
    }
}
