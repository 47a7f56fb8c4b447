//! Pairing of the samples of the error with those of the input.

use std::ops::Range;

use nalgebra::DMatrix;

use super::cost::Cost;
use super::plant::{OwnPlant, Plant};
use super::relative_degree::relative_degrees;
use crate::learning::sweep::{Stage, Stages};
use crate::learning::weights::Weight;
use crate::model::{ModelError, StateSpace, TimeVarying};

/// The tracking problem of a model with delayed outputs.
///
/// Row `i` of the output is paired with the sample `l_i` ahead at which an input first affects it:
/// `C_i[k] <- C_i[k+l_i] A[k+l_i-1] .. A[k]`, `D_i[k] <- C_i[k+l_i] A[k+l_i-1] .. A[k+1] B[k]`. So
/// the effect of an input occurs at its own stage, whatever the delay, and the weight of that row
/// is `q[k+l_i]`, zero beyond the end of the run. Rows coupled by a weight share the smallest `l_i`
/// among them, since their errors at one sample have to be at one stage.
#[derive(Debug, Clone)]
pub struct Paired {
    plant: OwnPlant,
    /// Paired `C` and `D`: one, or one per sample.
    rows: Vec<(DMatrix<f64>, DMatrix<f64>)>,
    cost: Cost,
    shifts: Vec<usize>,
    /// Rows that respond to no input and are coupled to no row that does.
    mute: Vec<bool>,
    free_samples: usize,
    n_samples: usize,
}

impl Paired {
    /// Pairs the rows of a model for runs of `n_samples` samples.
    ///
    /// # Errors
    /// - [`ModelError`] for a continuous model, or one with another number of samples.
    /// # Panics
    /// If the weights do not match the model; [`Cost::check`] rules this out.
    pub fn new<'a>(
        plant: impl Into<Plant<'a>>,
        n_samples: usize,
        cost: Cost,
    ) -> Result<Self, ModelError> {
        let plant = plant.into();
        plant.check(n_samples)?;
        let degrees = relative_degrees(plant, n_samples)?;
        let (shifts, mute) = shared(&degrees, &cost.q);
        let first = plant.at(0);
        let mut latest = degrees.iter().flatten().copied().max().unwrap_or(0);
        // With several inputs one of them may affect an output only through the state, up to as
        // many samples later as there are states; for a time-varying model a single one as well.
        if first.n_inputs() > 1 || matches!(plant, Plant::Varying(_)) {
            latest += first.n_states();
        }
        let (plant, rows) = match plant {
            Plant::Invariant(model) => {
                (OwnPlant::Invariant(model.clone()), vec![ahead(plant, 0, &shifts, usize::MAX)])
            }
            Plant::Varying(model) => {
                let rows = (0..n_samples).map(|k| ahead(plant, k, &shifts, n_samples)).collect();
                (OwnPlant::Varying(TimeVarying::clone(model)), rows)
            }
        };
        Ok(Self { plant, rows, cost, shifts, mute, free_samples: latest, n_samples })
    }

    /// Returns the delay of each output in samples; 0 for one that responds to no input.
    pub fn shifts(&self) -> &[usize] {
        &self.shifts
    }

    /// Returns the largest number of samples at the end without effect within the run.
    pub fn free_samples(&self) -> usize {
        self.free_samples
    }

    fn at(&self, k: usize) -> (&StateSpace, &DMatrix<f64>, &DMatrix<f64>) {
        let (c, d) = &self.rows[if self.rows.len() == 1 { 0 } else { k }];
        (self.plant.borrow().at(k), c, d)
    }

    /// Writes the weights at sample `k`.
    fn weigh(&self, k: usize, q: &mut DMatrix<f64>, s: &mut DMatrix<f64>, r: &mut DMatrix<f64>) {
        for col in 0..q.ncols() {
            let sample = k + self.shifts[col];
            for row in 0..q.nrows() {
                let meet = self.shifts[row] == self.shifts[col] && sample < self.n_samples;
                let counts = meet && !self.mute[row] && !self.mute[col];
                q[(row, col)] = if counts { self.cost.q.entry(sample, row, col) } else { 0.0 };
            }
        }
        for col in 0..s.ncols() {
            for row in 0..s.nrows() {
                s[(row, col)] = self.cost.s.entry(k, row, col);
                r[(row, col)] = self.cost.r.entry(k, row, col);
            }
        }
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
        let (model, c, d) = self.at(k);
        let (p, m) = d.shape();
        let zeros = DMatrix::zeros;
        let (mut q, mut s, mut r) = (zeros(p, p), zeros(m, m), zeros(m, m));
        self.weigh(k, &mut q, &mut s, &mut r);
        Stage { a: model.a().clone(), b: model.b().clone(), c: c.clone(), d: d.clone(), q, s, r }
    }

    fn stage_into(&self, k: usize, stage: &mut Stage) {
        let (model, c, d) = self.at(k);
        stage.a.copy_from(model.a());
        stage.b.copy_from(model.b());
        stage.c.copy_from(c);
        stage.d.copy_from(d);
        self.weigh(k, &mut stage.q, &mut stage.s, &mut stage.r);
    }

    fn weights_into(&self, k: usize, stage: &mut Stage) {
        self.weigh(k, &mut stage.q, &mut stage.s, &mut stage.r);
    }

    fn constant(&self) -> Range<usize> {
        if self.rows.len() == 1 && self.cost.is_constant() {
            let latest = self.shifts.iter().copied().max().unwrap_or(0);
            return 0..self.n_samples.saturating_sub(latest);
        }
        0..0
    }

    fn holds_input(&self) -> bool {
        !self.cost.s.is_zero()
    }

    fn has_constant_plant(&self) -> bool {
        self.rows.len() == 1
    }
}

/// Returns the shift of each row, the same for rows coupled by `q`, and the rows without any
/// response.
fn shared(degrees: &[Option<usize>], q: &Weight) -> (Vec<usize>, Vec<bool>) {
    let mut found = degrees.to_vec();
    // As many passes as there are rows propagate the smallest degree through any chain of
    // couplings.
    for _ in 0..degrees.len() {
        for row in 0..degrees.len() {
            for col in (0..degrees.len()).filter(|col| *col != row && q.couples(row, *col)) {
                found[row] = found[row].into_iter().chain(found[col]).min();
            }
        }
    }
    let mute = found.iter().map(Option::is_none).collect();
    (found.into_iter().map(|shift| shift.unwrap_or(0)).collect(), mute)
}

/// Returns `C` and `D` of sample `k`, each row advanced by its shift.
fn ahead(
    plant: Plant,
    k: usize,
    shifts: &[usize],
    n_samples: usize,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (mut c, mut d) = (plant.at(k).c().clone(), plant.at(k).d().clone());
    for (row, shift) in shifts.iter().copied().enumerate() {
        if shift == 0 {
            continue;
        }
        if k + shift >= n_samples {
            // Beyond the end of the run, where its weight is zero.
            c.row_mut(row).fill(0.0);
            d.row_mut(row).fill(0.0);
            continue;
        }
        let mut seen = plant.at(k + shift).c().row(row).into_owned();
        for sample in (k + 1..k + shift).rev() {
            seen *= plant.at(sample).a();
        }
        d.set_row(row, &(&seen * plant.at(k).b()));
        c.set_row(row, &(seen * plant.at(k).a()));
    }
    (c, d)
}

#[cfg(test)]
mod tests {
    use super::super::Weights;
    use super::*;
    use crate::model::{Method, discretize, from_transfer_function, second_order};

    fn axis() -> StateSpace {
        discretize(&second_order(157.0, 0.5).unwrap(), 2e-3, Method::ZeroOrderHold).unwrap()
    }

    fn paired(model: &StateSpace, n_samples: usize, cost: Cost) -> Paired {
        Paired::new(model, n_samples, cost).unwrap()
    }

    #[test]
    fn paired_matrices_are_the_markov_parameters_ahead() {
        let late = axis().delayed(2).unwrap();
        let paired = paired(&late, 10, Weights::default().into());
        let markov = late.markov(5).unwrap();
        let stage = paired.stage(0);
        assert_eq!(paired.shifts(), [3]);
        assert!((stage.d[(0, 0)] - markov[3][(0, 0)]).abs() < 1e-16);
        assert!(((&stage.c * &stage.b)[(0, 0)] - markov[4][(0, 0)]).abs() < 1e-16);
        assert!(paired.stage(6).q[(0, 0)] > 0.0 && paired.stage(7).q[(0, 0)] <= 0.0);
    }

    #[test]
    fn a_sample_is_weighed_by_its_own_weight() {
        let weights: Vec<f64> = (0..10).map(f64::from).collect();
        let cost = Cost { q: Weight::PerSample(weights), ..Weights::default().into() };
        let paired = paired(&axis().delayed(2).unwrap(), 10, cost);
        let found: Vec<f64> = (0..10).map(|k| paired.stage(k).q[(0, 0)]).collect();
        assert_eq!(found, [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn rows_that_a_weight_couples_share_the_smaller_delay() {
        let both = axis().delayed(3).unwrap().append(&axis()).unwrap();
        assert_eq!(paired(&both, 10, Weights::default().into()).shifts(), [4, 1]);
        let block = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.5, 1.0]);
        let cost = Cost { q: Weight::Block(block.clone()), ..Weights::default().into() };
        let paired = paired(&both, 10, cost);
        assert_eq!(paired.shifts(), [1, 1]);
        assert_eq!(paired.stage(8).q, block);
        assert!(paired.stage(9).q.amax() <= 0.0);
    }

    #[test]
    fn a_varying_model_is_paired_through_the_matrices_in_between() {
        let lead = |gain: f64| from_transfer_function(&[gain], &[1.0, -0.5, 0.1], Some(1.0));
        let samples = (0..6).map(|k| lead(f64::from(k + 1)).unwrap()).collect();
        let model = TimeVarying::new(samples).unwrap();
        let paired = Paired::new(&model, 6, Weights::default().into()).unwrap();
        assert_eq!(paired.shifts(), [2]);
        for k in 0..4 {
            let mut pulse = [0.0; 6];
            pulse[k] = 1.0;
            let y = model.simulate(&pulse, None).unwrap();
            let stage = paired.stage(k);
            assert!((stage.d[(0, 0)] - y[k + 2]).abs() < 1e-14);
            if k < 3 {
                let reached = &paired.stage(k + 1).c * &stage.b;
                assert!((reached[(0, 0)] - y[k + 3]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_stage_is_overwritten_with_the_same_numbers() {
        let q = Weight::PerSample((0..10).map(f64::from).collect());
        let cost = Cost { q, ..Weights { s: 0.5, r: 2.0, ..Weights::default() }.into() };
        let paired = paired(&axis().append(&axis().delayed(1).unwrap()).unwrap(), 10, cost);
        let mut stage = paired.stage(0);
        for k in 0..10 {
            paired.stage_into(k, &mut stage);
            assert_eq!(stage, paired.stage(k));
            paired.weights_into(9 - k, &mut stage);
            assert_eq!(stage, paired.stage(9 - k));
        }
    }
}
