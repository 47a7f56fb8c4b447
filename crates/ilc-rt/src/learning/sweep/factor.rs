//! The backward Riccati recursion along a run: gains from model and weights.

use std::ops::Range;

use thiserror::Error;

use super::cholesky::Pivots;
use super::record::{Record, Sizes};
use super::recursion::Recursion;
use super::{Stage, Stages};

/// The recursion has reached steady state once the closed-loop transition over the samples passed
/// is below this ...
const SETTLED_TRANSITION: f64 = 1e-9;
/// ... and one more sample changes the cost by less than this share.
const SETTLED_CHANGE: f64 = 1e-13;
/// Sets of gains for which room is made at a time.
const GROWTH: usize = 64;
/// Growth of the steady-state closed loop over a run above which it is refused.
const UNBOUNDED_GROWTH: f64 = 1e12;

/// The same for time-varying gains: higher, because the scales of the states may differ as well.
const UNBOUNDED_PRODUCT: f64 = 1e16;

/// Numerical form of the recursion; all have the same solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// Cost as a sum of squares (Joseph form).
    #[default]
    Joseph,
    /// Square root of the cost, by Cholesky factorisation of the sample's whole cost.
    Cholesky,
    /// Square root of the cost, by Householder reflections: nothing is squared, at three times the time.
    SquareRoot,
}

/// Reason why a problem has no usable solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum FactorError {
    /// A direction of the input is without cost long before the end of the run.
    #[error("the input at sample {sample} is not determined by model and weights")]
    Undetermined {
        /// The last sample concerned.
        sample: usize,
    },
    /// The solution grows without bound along the run.
    #[error("the solution grows without bound along the run")]
    Unbounded,
}

/// The gains along a run.
///
/// If the stages are constant, the gains reach a steady state as the recursion comes from the end;
/// one set then serves all earlier samples, so memory and set-up time do not depend on the run's
/// length.
#[derive(Debug, Clone)]
pub struct Gains {
    n_samples: usize,
    free_samples: usize,
    sizes: Sizes,
    remembers_change: bool,
    /// [`Record::back`] and [`Record::fore`] of each set, in the order of the recursion: those of
    /// the last samples, the steady-state one, those of the first samples. There may be more room.
    back: Vec<f64>,
    fore: Vec<f64>,
    n_stored: usize,
    /// `H^-1` (m x m) of each sample, from the end, if weights alone vary along the run.
    inverse: Vec<f64>,
    /// Number of sets before the steady-state one, and the number of samples that one serves; 0 if
    /// there is none.
    n_tail: usize,
    n_settled: usize,
    pivots: Pivots,
    stage: Stage,
    recursion: Recursion,
    /// Closed-loop transition over the samples passed, and workspace for its product with one more;
    /// for varying stages only one row of it.
    passed: Vec<f64>,
    product: Vec<f64>,
}

impl Gains {
    /// Runs the recursion from the end of the run to its start, in Joseph form.
    ///
    /// `free_samples` at the end of the run may be undetermined by model and weights, because the
    /// run ends before they take effect; their input is then unchanged.
    ///
    /// # Errors
    /// - [`FactorError::Undetermined`] if an earlier sample is undetermined.
    /// - [`FactorError::Unbounded`] if the solution grows without bound along the run.
    pub fn new(stages: &impl Stages, free_samples: usize) -> Result<Self, FactorError> {
        Self::with_form(stages, free_samples, Form::default())
    }

    /// Runs the recursion in the given form.
    ///
    /// # Errors
    /// - as [`Gains::new`].
    pub fn with_form(
        stages: &impl Stages,
        free_samples: usize,
        form: Form,
    ) -> Result<Self, FactorError> {
        let n_samples = stages.n_samples();
        let stage = stages.stage(0);
        let m = stage.n_inputs();
        let sizes = Sizes {
            n: stage.n_states(),
            m,
            p: stage.n_outputs(),
            targets: stages.n_targets(),
            held: if stages.holds_input() { m } else { 0 },
        };
        let room = || vec![0.0; sizes.n * sizes.n];
        let mut gains = Self {
            n_samples,
            free_samples,
            sizes,
            remembers_change: stages.remembers_change(),
            back: Vec::new(),
            fore: Vec::new(),
            n_stored: 0,
            inverse: Vec::new(),
            n_tail: 0,
            n_settled: 0,
            pivots: Pivots::NONE,
            stage,
            recursion: Recursion::new(form, sizes),
            passed: room(),
            product: room(),
        };
        if stages.constant().is_empty() {
            gains.back.resize(n_samples * sizes.back(), 0.0);
            gains.fore.resize(n_samples * sizes.fore(), 0.0);
            if stages.has_constant_plant() {
                gains.inverse.resize(n_samples * m * m, 0.0);
                gains.recursion.inverse.resize(m * m, 0.0);
            }
        }
        gains.refactor(stages)?;
        Ok(gains)
    }

    /// Runs the recursion again, for other matrices of the same shapes (re-factorisation).
    ///
    /// # Real Time
    /// Cold path. Does not allocate without a constant range of stages, unless
    /// [`Stages::stage_into`] does.
    /// # Errors
    /// - as [`Gains::new`]; the gains are then invalid.
    pub fn refactor(&mut self, stages: &impl Stages) -> Result<(), FactorError> {
        let (n_samples, n) = (self.n_samples, self.sizes.n);
        let constant = stages.constant();
        let free_from = n_samples - self.free_samples.min(n_samples.saturating_sub(1));
        (self.n_stored, self.n_tail, self.n_settled) = (0, 0, 0);
        self.pivots = Pivots::NONE;
        self.recursion.restart();
        self.passed.fill(0.0);
        if constant.is_empty() {
            self.passed.fill(1.0);
        }
        for i in 0..n {
            self.passed[i * n + i] = 1.0;
        }
        let has_constant_plant = stages.has_constant_plant();
        let mut k = n_samples;
        while k > 0 {
            k -= 1;
            if k.is_multiple_of(64) {
                crate::interrupt::point();
            }
            // The stages of the constant range are read once, and so is a constant plant.
            if !constant.contains(&k) || k + 1 == constant.end {
                if has_constant_plant && k + 1 < n_samples {
                    stages.weights_into(k, &mut self.stage);
                } else {
                    stages.stage_into(k, &mut self.stage);
                }
            }
            let pivots = self.step();
            if pivots.vanished && k < free_from {
                return Err(FactorError::Undetermined { sample: k });
            }
            self.pivots.min = self.pivots.min.min(pivots.min);
            self.pivots.max = self.pivots.max.max(pivots.max);
            if constant.is_empty() {
                self.grow()?;
            }
            if !constant.contains(&k) {
                continue;
            }
            self.pass();
            let is_settled = one_norm(&self.passed, n) < SETTLED_TRANSITION
                && self.recursion.change() <= SETTLED_CHANGE * self.recursion.scale(&self.stage);
            if is_settled || k == constant.start {
                self.bounded(constant.len())?;
            }
            if is_settled && pivots.vanished && k > constant.start {
                return Err(FactorError::Undetermined { sample: k - 1 });
            }
            if is_settled {
                self.n_tail = n_samples - k - 1;
                self.n_settled = k - constant.start + 1;
                k = constant.start;
            }
        }
        Ok(())
    }

    /// Returns the number of samples of a run.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Returns the number of states, including those of penalties.
    pub fn n_states(&self) -> usize {
        self.sizes.n
    }

    /// Returns the number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.sizes.m
    }

    /// Returns the number of outputs that have a target.
    pub fn n_targets(&self) -> usize {
        self.sizes.targets
    }

    /// Returns the number of stored sets of gains.
    pub fn n_stored(&self) -> usize {
        self.n_stored
    }

    /// Returns a measure of the conditioning: the smallest over the largest pivot of any `H`. Below
    /// about `1e-12`, digits of the input are noise.
    pub fn conditioning(&self) -> f64 {
        if self.pivots.max > 0.0 { self.pivots.min / self.pivots.max } else { 0.0 }
    }

    pub(super) fn sizes(&self) -> Sizes {
        self.sizes
    }

    /// Returns [`Stages::remembers_change`] of the stages.
    pub(super) fn remembers_change(&self) -> bool {
        self.remembers_change
    }

    /// Returns the gains of sample `k`.
    pub(super) fn at(&self, k: usize) -> Record<'_> {
        let from_end = self.n_samples - 1 - k;
        let place = match from_end.checked_sub(self.n_tail) {
            Some(later) if self.n_settled > 0 => {
                self.n_tail + (later + 1).saturating_sub(self.n_settled)
            }
            _ => from_end,
        };
        let (back, fore) = (self.sizes.back(), self.sizes.fore());
        Record {
            back: &self.back[place * back..(place + 1) * back],
            fore: &self.fore[place * fore..(place + 1) * fore],
        }
    }

    /// Returns `H^-1` of sample `k` (m x m); `None` unless weights alone vary along the run.
    pub(super) fn inverse(&self, k: usize) -> Option<&[f64]> {
        let size = self.sizes.m * self.sizes.m;
        self.inverse.get((self.n_samples - 1 - k) * size..)?.get(..size)
    }

    /// Returns the gains in steady state, if it is reached.
    pub(super) fn settled(&self) -> Option<Record<'_>> {
        (self.n_settled > 0).then(|| self.at(self.n_samples - 1 - self.n_tail))
    }

    /// Returns the samples whose gains are those in steady state.
    pub(super) fn settled_samples(&self) -> Range<usize> {
        let end = self.n_samples - self.n_tail;
        end - self.n_settled..end
    }

    /// Goes back one sample, with the stage last read.
    fn step(&mut self) -> Pivots {
        let (back, fore) = (self.sizes.back(), self.sizes.fore());
        let (first_back, first_fore) = (self.n_stored * back, self.n_stored * fore);
        self.n_stored += 1;
        for (gains, size) in [(&mut self.back, back), (&mut self.fore, fore)] {
            if gains.len() < self.n_stored * size {
                gains.resize((self.n_stored + GROWTH) * size, 0.0);
            }
        }
        let back = &mut self.back[first_back..first_back + back];
        let fore = &mut self.fore[first_fore..first_fore + fore];
        let pivots = self.recursion.step(&self.stage, back, fore);
        let size = self.recursion.inverse.len();
        if size > 0 {
            let place = (self.n_stored - 1) * size;
            self.inverse[place..place + size].copy_from_slice(&self.recursion.inverse);
        }
        pivots
    }

    /// `passed <- passed (A - B K)`.
    fn pass(&mut self) {
        let n = self.sizes.n;
        self.product.fill(0.0);
        for (j, column) in self.recursion.transition.chunks_exact(n.max(1)).enumerate() {
            for (k, factor) in column.iter().enumerate() {
                for i in 0..n {
                    self.product[j * n + i] += self.passed[k * n + i] * factor;
                }
            }
        }
        std::mem::swap(&mut self.passed, &mut self.product);
    }

    /// Updates one row of `passed` and refuses unbounded growth since its minimum.
    fn grow(&mut self) -> Result<(), FactorError> {
        let n = self.sizes.n;
        let (row, next) = (&mut self.passed[..n], &mut self.product[..n]);
        let mut size = 0.0;
        for (value, column) in next.iter_mut().zip(self.recursion.transition.chunks_exact(n.max(1)))
        {
            *value = column.iter().zip(&*row).map(|(factor, old)| factor * old).sum();
            size += value.abs();
        }
        if size > UNBOUNDED_PRODUCT {
            return Err(FactorError::Unbounded);
        }
        if size < f64::MIN_POSITIVE {
            row.fill(1.0);
        } else {
            let scale = if size < 1.0 { 1.0 / size } else { 1.0 };
            for (old, value) in row.iter_mut().zip(&*next) {
                *old = value * scale;
            }
        }
        Ok(())
    }

    /// Refuses a closed loop whose slowest pole grows without bound over the run.
    fn bounded(&self, n_samples: usize) -> Result<(), FactorError> {
        const MAX_SWEEPS: usize = 10_000;
        let n = self.sizes.n;
        if n == 0 {
            return Ok(());
        }
        let transition = nalgebra::DMatrix::from_column_slice(n, n, &self.recursion.transition);
        let radius = nalgebra::Schur::try_new(transition, f64::EPSILON, MAX_SWEEPS)
            .map_or(0.0, |schur| {
                schur.complex_eigenvalues().iter().map(|pole| pole.norm()).fold(0.0, f64::max)
            });
        if radius.ln() * n_samples as f64 > UNBOUNDED_GROWTH.ln() {
            return Err(FactorError::Unbounded);
        }
        Ok(())
    }
}

/// Largest column sum of a square matrix.
fn one_norm(matrix: &[f64], n: usize) -> f64 {
    let columns = matrix.chunks_exact(n.max(1));
    columns.map(|column| column.iter().map(|value| value.abs()).sum()).fold(0.0, f64::max)
}
