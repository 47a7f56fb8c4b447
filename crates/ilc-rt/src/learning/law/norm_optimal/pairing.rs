//! Which sample of the error belongs to which sample of the input.

use std::ops::Range;

use nalgebra::DMatrix;

use super::Weights;
use crate::learning::sweep::{Stage, Stages};
use crate::model::{ModelError, StateSpace};

/// A Markov parameter counts as zero below this part of the magnitudes that were added up for it.
const ROUNDING: f64 = 1e-13;

/// The tracking problem of a model whose outputs answer late.
///
/// Row `i` of the output is paired with a sample `l_i` ahead, `l_i` being the first Markov parameter
/// of that row that is not zero: `C_i <- C_i A^{l_i}`, `D_i <- C_i A^{l_i - 1} B`. So the effect of
/// an input is seen at its own stage, whatever the delay. Where `k + l_i` lies beyond the end of the
/// run the weight of the row is zero.
#[derive(Debug)]
pub(super) struct Paired {
    inner: Stage,
    shifts: Vec<usize>,
    n_samples: usize,
}

impl Paired {
    pub(super) fn new(
        model: &StateSpace,
        n_samples: usize,
        weights: Weights,
    ) -> Result<Self, ModelError> {
        let shifts = relative_degrees(model)?;
        let (mut c, mut d) = (model.c().clone(), model.d().clone());
        for (row, shift) in shifts.iter().enumerate() {
            for _ in 0..shift.unwrap_or(0) {
                let ahead = c.row(row) * model.a();
                let effect = c.row(row) * model.b();
                d.set_row(row, &effect);
                c.set_row(row, &ahead);
            }
        }
        let (m, p) = (model.n_inputs(), model.n_outputs());
        let mut q = DMatrix::identity(p, p) * weights.q;
        for (row, shift) in shifts.iter().enumerate() {
            if shift.is_none() {
                q[(row, row)] = 0.0;
            }
        }
        let inner = Stage {
            a: model.a().clone(),
            b: model.b().clone(),
            c,
            d,
            q,
            s: DMatrix::identity(m, m) * weights.s,
            r: DMatrix::identity(m, m) * weights.r,
        };
        let shifts = shifts.into_iter().map(|shift| shift.unwrap_or(0)).collect();
        Ok(Self { inner, shifts, n_samples })
    }

    /// Returns, for each output, by how many samples it is late; 0 for one that answers to nothing.
    pub(super) fn shifts(&self) -> &[usize] {
        &self.shifts
    }

    /// Returns how many samples at the end may reach nothing within the run.
    ///
    /// With several inputs one of them may show in an output only through the state, up to as many
    /// samples later as there are states.
    pub(super) fn free_samples(&self) -> usize {
        let inner = if self.inner.b.ncols() > 1 { self.inner.a.nrows() } else { 0 };
        self.last_shift() + inner
    }

    fn last_shift(&self) -> usize {
        self.shifts.iter().copied().max().unwrap_or(0)
    }
}

impl Stages for Paired {
    fn n_samples(&self) -> usize {
        self.n_samples
    }

    fn n_targets(&self) -> usize {
        self.shifts.len()
    }

    fn stage(&self, k: usize) -> Stage {
        let mut stage = self.inner.clone();
        for (row, shift) in self.shifts.iter().enumerate() {
            if k + shift >= self.n_samples {
                stage.q[(row, row)] = 0.0;
            }
        }
        stage
    }

    fn constant(&self) -> Range<usize> {
        0..self.n_samples.saturating_sub(self.last_shift())
    }
}

/// Returns, for each output, the index of its first Markov parameter that is not zero, or `None` if
/// all are (by Cayley and Hamilton `n + 1` of them decide).
pub(in crate::learning::law) fn relative_degrees(model: &StateSpace) -> Result<Vec<Option<usize>>, ModelError> {
    let n = model.n_states();
    let parameters = model.markov(n + 1)?;
    let (a, c) = (model.a().abs(), model.c().abs());
    let mut reached = model.b().abs();
    let mut found = vec![None; model.n_outputs()];
    for (k, parameter) in parameters.iter().enumerate() {
        let magnitude = if k == 0 { model.d().abs() } else { &c * &reached };
        if k > 0 {
            reached = &a * reached;
        }
        for (row, degree) in found.iter_mut().enumerate() {
            let answers =
                |col: usize| parameter[(row, col)].abs() > ROUNDING * magnitude[(row, col)];
            if degree.is_none() && (0..model.n_inputs()).any(answers) {
                *degree = Some(k);
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Method, discretize, from_transfer_function, second_order};

    fn axis() -> StateSpace {
        discretize(&second_order(157.0, 0.5).unwrap(), 2e-3, Method::ZeroOrderHold).unwrap()
    }

    #[test]
    fn delay_and_feedthrough_move_the_pairing() {
        let lead = from_transfer_function(&[1.0, 0.2], &[1.0, 0.5], Some(2e-3)).unwrap();
        assert_eq!(relative_degrees(&lead).unwrap(), [Some(0)]);
        assert_eq!(relative_degrees(&axis()).unwrap(), [Some(1)]);
        let both = axis().delayed(3).unwrap().append(&lead).unwrap();
        assert_eq!(relative_degrees(&both).unwrap(), [Some(4), Some(0)]);
        let mute = StateSpace::static_gain(DMatrix::zeros(1, 1), Some(2e-3)).unwrap();
        assert_eq!(relative_degrees(&mute).unwrap(), [None]);
    }

    #[test]
    fn paired_matrices_are_the_markov_parameters_ahead() {
        let late = axis().delayed(2).unwrap();
        let paired = Paired::new(&late, 10, Weights::default()).unwrap();
        let markov = late.markov(5).unwrap();
        assert_eq!(paired.shifts(), [3]);
        assert!((paired.inner.d[(0, 0)] - markov[3][(0, 0)]).abs() < 1e-16);
        assert!(((&paired.inner.c * &paired.inner.b)[(0, 0)] - markov[4][(0, 0)]).abs() < 1e-16);
        assert!(paired.stage(6).q[(0, 0)] > 0.0 && paired.stage(7).q[(0, 0)] <= 0.0);
    }
}
