//! The backward Riccati recursion: gains from model and weights.

use nalgebra::DMatrix;
use thiserror::Error;

use super::cholesky::Cholesky;
use super::{Stage, Stages};

/// The closed loop counts as settled once its transition over the samples passed is below this ...
const SETTLED_TRANSITION: f64 = 1e-9;
/// ... and one more sample changes the cost by less than this part of it.
const SETTLED_CHANGE: f64 = 1e-13;
/// Growth of the closed loop over a run that is refused.
const UNBOUNDED_GROWTH: f64 = 1e12;

/// Why a problem has no usable solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum FactorError {
    /// Some direction of the input costs nothing long before the end of the run.
    #[error("the input at sample {sample} is not determined by model and weights")]
    Undetermined {
        /// The last sample at which this happens.
        sample: usize,
    },
    /// The solution grows without bound along the run.
    #[error("the solution grows without bound along the run")]
    Unbounded,
}

/// The gains of one sample, in the fused form of the two sweeps.
///
/// `p_k = transition' p_{k+1} + from_error e_k + from_input u_k`,
/// `kappa_k = costate p_{k+1} + error e_k - input u_k`,
/// `x_{k+1} = transition x_k + b kappa_k`, `v_k = kappa_k - feedback x_k`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StageGains {
    /// `A - B K`, (n, n).
    pub(super) transition: DMatrix<f64>,
    /// `K`, (m, n).
    pub(super) feedback: DMatrix<f64>,
    /// `(C - D K)' Q`, (n, p).
    pub(super) from_error: DMatrix<f64>,
    /// `K' S`, (n, m).
    pub(super) from_input: DMatrix<f64>,
    /// `H^-1 B'`, (m, n).
    pub(super) costate: DMatrix<f64>,
    /// `H^-1 D' Q`, (m, p).
    pub(super) error: DMatrix<f64>,
    /// `H^-1 S`, (m, m).
    pub(super) input: DMatrix<f64>,
    /// `B`, (n, m).
    pub(super) b: DMatrix<f64>,
}

/// The gains along a run.
///
/// Where the stages are constant the gains settle while the recursion comes from the end; one set
/// then serves all earlier samples, so that memory and set-up time do not depend on the run's length.
#[derive(Debug, Clone)]
pub struct Gains {
    n_samples: usize,
    /// Gains of the samples before the constant range.
    head: Vec<StageGains>,
    /// Gains of the samples from the end of the head to the start of the tail.
    settled: Option<StageGains>,
    /// Gains of the last samples.
    tail: Vec<StageGains>,
}

impl Gains {
    /// Runs the recursion from the end of the run to its start.
    ///
    /// `H = S + R + D'QD + B'Pi B`, `K = H^-1 (D'QC + B'Pi A)`, and Joseph's form
    /// `Pi <- (C-DK)'Q(C-DK) + K'(S+R)K + (A-BK)'Pi(A-BK)`, a sum of squares that keeps its sign
    /// under rounding.
    ///
    /// `free_samples` at the end of the run may be undetermined by model and weights, because the
    /// run ends before their effect shows; their input then stays as it was.
    ///
    /// # Errors
    /// - [`FactorError::Undetermined`] if an earlier sample is not determined.
    /// - [`FactorError::Unbounded`] if the solution would grow beyond all measure along the run.
    pub fn new(stages: &impl Stages, free_samples: usize) -> Result<Self, FactorError> {
        let n_samples = stages.n_samples();
        let n_targets = stages.n_targets();
        let constant = stages.constant();
        let free_from = n_samples - free_samples.min(n_samples.saturating_sub(1));
        let n_states = if n_samples == 0 { 0 } else { stages.stage(0).a.nrows() };
        let mut cost = DMatrix::zeros(n_states, n_states);
        let mut passed = DMatrix::identity(n_states, n_states);
        let (mut head, mut tail, mut settled) = (Vec::new(), Vec::new(), None);
        let mut k = n_samples;
        while k > 0 {
            k -= 1;
            let stage = stages.stage(k);
            let (gains, vanished) = solve(&stage, &cost, n_targets);
            if vanished && k < free_from {
                return Err(FactorError::Undetermined { sample: k });
            }
            let earlier = joseph(&stage, &gains, &cost);
            let change = (&earlier - &cost).amax();
            cost = earlier;
            if k < constant.start {
                head.push(gains);
                continue;
            }
            if !constant.contains(&k) {
                tail.push(gains);
                continue;
            }
            passed *= &gains.transition;
            let scale = cost.amax() + (stage.c.transpose() * &stage.q * &stage.c).amax();
            let is_settled =
                one_norm(&passed) < SETTLED_TRANSITION && change <= SETTLED_CHANGE * scale;
            if is_settled || k == constant.start {
                bounded(&gains, constant.len())?;
            }
            if is_settled && vanished && k > constant.start {
                return Err(FactorError::Undetermined { sample: k - 1 });
            }
            if is_settled {
                settled = Some(gains);
                k = constant.start;
            } else {
                tail.push(gains);
            }
        }
        head.reverse();
        tail.reverse();
        Ok(Self { n_samples, head, settled, tail })
    }

    /// Returns the number of samples of a run.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Returns the number of states, those of penalties included.
    pub fn n_states(&self) -> usize {
        if self.n_stored() == 0 { 0 } else { self.set(0).1.transition.nrows() }
    }

    /// Returns how many sets of gains are kept.
    pub fn n_stored(&self) -> usize {
        self.head.len() + usize::from(self.settled.is_some()) + self.tail.len()
    }

    /// Returns the set with the given place in time, and for how many samples it serves.
    pub(super) fn set(&self, place: usize) -> (usize, &StageGains) {
        if let Some(gains) = self.head.get(place) {
            return (1, gains);
        }
        let place = place - self.head.len();
        match &self.settled {
            Some(gains) if place == 0 => {
                (self.n_samples - self.head.len() - self.tail.len(), gains)
            }
            Some(_) => (1, &self.tail[place - 1]),
            None => (1, &self.tail[place]),
        }
    }
}

/// Returns the gains of one sample, and whether part of its input is undetermined.
fn solve(stage: &Stage, cost: &DMatrix<f64>, n_targets: usize) -> (StageGains, bool) {
    let Stage { a, b, c, d, q, s, r } = stage;
    let weighted = d.transpose() * q;
    let reached = b.transpose() * cost;
    let h = s + r + &weighted * d + &reached * b;
    let factor = Cholesky::new(&h);
    let feedback = factor.solve(&(&weighted * c + &reached * a));
    let from_error = (c - d * &feedback).transpose() * q;
    let gains = StageGains {
        transition: a - b * &feedback,
        from_error: from_error.columns(0, n_targets).into_owned(),
        from_input: feedback.transpose() * s,
        costate: factor.solve(&b.transpose()),
        error: factor.solve(&weighted.columns(0, n_targets).into_owned()),
        input: factor.solve(s),
        b: b.clone(),
        feedback,
    };
    (gains, factor.vanished())
}

fn joseph(stage: &Stage, gains: &StageGains, cost: &DMatrix<f64>) -> DMatrix<f64> {
    let left = &stage.c - &stage.d * &gains.feedback;
    let effort = &stage.s + &stage.r;
    left.transpose() * &stage.q * &left
        + gains.feedback.transpose() * effort * &gains.feedback
        + gains.transition.transpose() * cost * &gains.transition
}

/// Refuses a closed loop whose slowest pole grows beyond all measure over the run.
fn bounded(gains: &StageGains, n_samples: usize) -> Result<(), FactorError> {
    const MAX_SWEEPS: usize = 10_000;
    let transition = &gains.transition;
    if transition.is_empty() {
        return Ok(());
    }
    let radius = nalgebra::Schur::try_new(transition.clone(), f64::EPSILON, MAX_SWEEPS)
        .map_or(0.0, |schur| {
            schur.complex_eigenvalues().iter().map(|pole| pole.norm()).fold(0.0, f64::max)
        });
    if radius.ln() * n_samples as f64 > UNBOUNDED_GROWTH.ln() {
        return Err(FactorError::Unbounded);
    }
    Ok(())
}

fn one_norm(matrix: &DMatrix<f64>) -> f64 {
    matrix.column_iter().map(|column| column.abs().sum()).fold(0.0, f64::max)
}
