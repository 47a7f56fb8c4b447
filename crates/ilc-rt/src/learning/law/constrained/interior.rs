//! Interior-point method: Mehrotra's predictor-corrector, with a Riccati recursion as linear
//! solver.

use super::gain::Gain;
use super::riccati::{Plant, Pull, Weighing};
use super::rows::Rows;
use super::solver::{Bands, Outcome, Places, Solver};
use crate::learning::sweep::Run;
use crate::learning::sweep::wide::Instructions;

/// Duality gap at which the search ends, relative to the cost ...
const GAP: f64 = 3e-14;
/// ... the one at which the active bounds are known, so that the rest is solved with them as equations ...
const GAP_FINISH: f64 = 1e-7;
/// ... and the accepted one if rounding prevents a smaller one.
pub(super) const GAP_ENOUGH: f64 = 1e-9;
/// An iteration that reduces the gap by less than this factor is limited by rounding.
const STALLED: f64 = 0.9;
/// Part of the cost before learning that counts as zero.
const FLOOR: f64 = 1e-12;
/// Share of the initial infeasibility that may remain when the search ends.
const RESIDUAL: f64 = 1e-11;
/// Largest number of iterations of a search, and of a careful one.
const MAX_ITERATIONS: usize = 60;
const MAX_CAREFUL_ITERATIONS: usize = 120;
/// Share of the step to the boundary, at first and near the end.
const MARGIN: f64 = 0.995;
const MARGIN_LATE: f64 = 0.9999;
/// In a careful search, a corrected step that is shorter than this, or increases the gap, is
/// replaced by a centring step: if single products of slack and multiplier are far below the
/// others, corrections may cycle.
const SHORT: f64 = 0.1;
/// Centring parameter of that step: at least this share of the mean product ...
const CENTRING: f64 = 0.3;
/// ... and once this many consecutive iterations have not reduced the gap to a new minimum, only
/// centring steps are taken.
const LOST: usize = 8;
/// Initial sum of the products of slack and multiplier, relative to the cost before learning (cold
/// start): large ones leave the search room among many active bounds, in half of the iterations ...
const START: f64 = 30.0;
/// ... and for a warm start from an earlier solution.
const WARM_START: f64 = 0.1;

/// One group of axes: `N` states, `M` inputs, `P` outputs, `NS` states with the delayed changes.
pub(super) struct Interior<const N: usize, const M: usize, const P: usize, const NS: usize> {
    pub(super) plant: Plant<N, M, P>,
    pub(super) instructions: Instructions,
    /// The distinct weights, and their index at each sample.
    pub(super) weighings: Vec<Weighing<M, P>>,
    pub(super) which: Vec<usize>,
    /// Weight of the input alone, at each of `weighings`.
    pub(super) holds: Vec<[[f64; M]; M]>,
    pub(super) places: Places,
    pub(super) bands: Bands,
    pub(super) rows: Rows,
    /// Gains of the problem without bounds.
    pub(super) plain: Vec<Gain<M, NS>>,
    pub(super) gains: Vec<Gain<M, NS>>,
    pub(super) kappa: Vec<[f64; M]>,
    /// Error at the samples that the input affects, and its weighted value.
    pub(super) error: Vec<[f64; P]>,
    pub(super) weighted: Vec<[f64; P]>,
    /// `-S u`.
    pub(super) hold: Vec<[f64; M]>,
    pub(super) input: Vec<[f64; M]>,
    /// Current point of the search: the change of the input and the output that it causes.
    pub(super) v: Vec<[f64; M]>,
    pub(super) output: Vec<[f64; P]>,
    /// The search step.
    pub(super) v_step: Vec<[f64; M]>,
    pub(super) output_step: Vec<[f64; P]>,
    /// Gradient of the cost there.
    pub(super) pulls: Vec<Pull<M, P>>,
    /// Input of the last solution, for a warm start.
    pub(super) last: Vec<[f64; M]>,
    pub(super) has_last: bool,
    pub(super) cost: f64,
    pub(super) cost_before: f64,
    /// The reference size of the cost.
    pub(super) worth: f64,
}

/// The externally given parts of an [`Interior`].
pub(super) struct Parts<const N: usize, const M: usize, const P: usize> {
    pub(super) plant: Plant<N, M, P>,
    pub(super) weighings: Vec<Weighing<M, P>>,
    pub(super) which: Vec<usize>,
    pub(super) holds: Vec<[[f64; M]; M]>,
    pub(super) places: Places,
    pub(super) bands: Bands,
}

impl<const N: usize, const M: usize, const P: usize, const NS: usize> Interior<N, M, P, NS> {
    pub(super) fn new(parts: Parts<N, M, P>) -> Self {
        let Parts { plant, weighings, which, holds, places, bands } = parts;
        let n_samples = which.len();
        let count = |is_bounded: bool, width: usize| if is_bounded { n_samples * width } else { 0 };
        let rows = Rows::new([
            count(bands.input.is_some() || bands.change.is_some(), M),
            count(bands.step.is_some(), M),
            count(bands.bend.is_some(), M),
            count(bands.output.is_some(), P),
        ]);
        let mut interior = Self {
            plant,
            instructions: Instructions::best(),
            weighings,
            which,
            holds,
            places,
            bands,
            rows,
            plain: vec![Gain::NONE; n_samples],
            gains: vec![Gain::NONE; n_samples],
            kappa: vec![[0.0; M]; n_samples],
            error: vec![[0.0; P]; n_samples],
            weighted: vec![[0.0; P]; n_samples],
            hold: vec![[0.0; M]; n_samples],
            input: vec![[0.0; M]; n_samples],
            v: vec![[0.0; M]; n_samples],
            output: vec![[0.0; P]; n_samples],
            v_step: vec![[0.0; M]; n_samples],
            output_step: vec![[0.0; P]; n_samples],
            pulls: vec![Pull::NONE; n_samples],
            last: vec![[0.0; M]; n_samples],
            has_last: false,
            cost: 0.0,
            cost_before: 0.0,
            worth: 0.0,
        };
        interior.factorise(false);
        std::mem::swap(&mut interior.plain, &mut interior.gains);
        interior
    }

    /// Returns the last sample before the final `free` ones whose input is undetermined.
    pub(super) fn undetermined(&self, free: usize) -> Option<usize> {
        let end = self.plain.len() - free.min(self.plain.len() - 1);
        (0..end).rev().find(|k| self.plain[*k].vanished())
    }

    /// Adds a weight on the change of inputs without effect within the run, so that they stay
    /// unchanged.
    pub(super) fn settle_free(&mut self, weight: f64) {
        for k in 0..self.which.len() {
            if self.plain[k].vanished() {
                let (mut held, hold) =
                    (self.weighings[self.which[k]].clone(), self.holds[self.which[k]]);
                for i in 0..M {
                    held.change[i][i] += weight;
                }
                self.which[k] = self.weighings.len();
                self.weighings.push(held);
                self.holds.push(hold);
            }
        }
        self.factorise(false);
        std::mem::swap(&mut self.plain, &mut self.gains);
    }

    /// Returns the cost below which it counts as zero.
    pub(super) fn least_cost(&self) -> f64 {
        FLOOR * self.worth
    }

    /// Keeps the present point, to return to it.
    #[inline(never)]
    fn keep(&mut self) {
        self.rows.keep(&self.stiffness_of_rows());
        for (k, last) in self.last.iter_mut().enumerate() {
            for (i, last) in last.iter_mut().enumerate() {
                *last = self.input[k][i] + self.v[k][i];
            }
        }
    }

    /// Goes to the last solution, as a change of this run's input.
    #[inline(never)]
    fn return_to_last(&mut self) {
        for (k, v) in self.v.iter_mut().enumerate() {
            for (i, v) in v.iter_mut().enumerate() {
                *v = self.last[k][i] - self.input[k][i];
            }
        }
        self.roll();
    }

    /// Iterates from the current slacks and multipliers.
    ///
    /// A careful search takes more iterations, and converges where corrections alone do not: about
    /// once in ten thousand random problems.
    #[inline(never)]
    fn search(&mut self, is_careful: bool) -> (bool, usize, f64) {
        let n_limits = self.rows.count();
        let mut residual = 1.0;
        let mut gap = self.rows.gap();
        let mut found = (false, 0, f64::INFINITY);
        let mut part = 1.0_f64;
        let (mut low, mut since, mut is_lost) = (gap, 0, false);
        let mut may_finish = true;
        self.look();
        let most = if is_careful { MAX_CAREFUL_ITERATIONS } else { MAX_ITERATIONS };
        for iteration in 1..=most {
            self.rows.weigh(0.0, false);
            self.factorise(true);
            self.forward(true);
            let length = self.rows.step(0.0, false, 1.0);
            let shrunk = self.rows.gap_at(length) / gap;
            let centre = shrunk * shrunk * shrunk * gap / n_limits;
            self.rows.weigh(centre, true);
            self.sweep(true);
            let margin = (1.0 - part).clamp(MARGIN, MARGIN_LATE);
            let mut length = self.rows.step(centre, true, margin);
            if is_careful && (is_lost || length < SHORT || self.rows.gap_at(length) > gap) {
                let centre = CENTRING.max(shrunk * shrunk * shrunk) * gap / n_limits;
                self.rows.weigh(centre, false);
                self.sweep(true);
                length = self.rows.step(centre, false, MARGIN);
            }
            if !(length.is_finite() && self.cost.is_finite()) {
                break;
            }
            self.advance(length);
            self.look();
            residual *= 1.0 - length;
            let before = gap;
            gap = self.rows.gap();
            since = if gap < STALLED * low { 0 } else { since + 1 };
            low = low.min(gap);
            is_lost |= since >= LOST;
            part = gap / self.cost.max(self.least_cost());
            if may_finish && residual.max(part) <= GAP_FINISH {
                may_finish = false;
                self.keep();
                let finished = self.pin();
                if finished.0 {
                    return (true, iteration + finished.1, finished.2);
                }
                self.return_to_last();
                self.rows.restore_kept();
                self.look();
            }
            let is_done = residual <= RESIDUAL && part <= GAP_ENOUGH;
            found = (is_done, iteration, part);
            if is_done && (part <= GAP || gap > STALLED * before) {
                break;
            }
        }
        found
    }
}

impl<const N: usize, const M: usize, const P: usize, const NS: usize> std::fmt::Debug
    for Interior<N, M, P, NS>
{
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("Interior").field("places", &self.places).finish_non_exhaustive()
    }
}

impl<const N: usize, const M: usize, const P: usize, const NS: usize> Solver
    for Interior<N, M, P, NS>
{
    fn solve(&mut self, run: &Run) -> Outcome {
        self.load(run);
        self.relax();
        let mut outcome = Outcome { is_solved: true, iterations: 0, gap: 0.0 };
        if !self.rows.fit() {
            // A cost caused by the bounds alone counts as well.
            let stiffness = self.plain[0].stiffness();
            let overshoot = self.rows.overshoot(&[1.0; 4]);
            self.worth = self.cost_before + 0.5 * stiffness * overshoot * overshoot;
            let centre = self.worth / self.rows.count();
            let mut found = (false, 0, 0.0);
            if self.has_last {
                self.return_to_last();
                found = self.pin();
                if !found.0 {
                    let wasted = found.1;
                    self.return_to_last();
                    self.rows.start(WARM_START * centre, true);
                    found = self.search(false);
                    found.1 += wasted;
                }
            }
            for is_careful in [false, true] {
                if !found.0 {
                    let wasted = found.1;
                    self.relax();
                    self.rows.start(START * centre, false);
                    found = self.search(is_careful);
                    found.1 += wasted;
                }
            }
            outcome = Outcome { is_solved: found.0, iterations: found.1, gap: found.2 };
            self.has_last = found.0;
        }
        outcome.is_solved &= self.vet();
        self.has_last &= outcome.is_solved;
        if self.has_last {
            self.keep();
        }
        outcome
    }

    fn write(&self, run: &mut Run) {
        for k in 0..self.v.len() {
            for (i, channel) in self.places.inputs.iter().enumerate() {
                let mut next = self.input[k][i] + self.v[k][i];
                // The sum is rounded again.
                if let Some(band) = &self.bands.input {
                    let (low, high) = band.at(k * M + i);
                    next = next.max(low).min(high);
                }
                run.next[k * run.n_inputs + channel] = next;
            }
        }
    }

    fn conflict(&self, run: &Run) -> Option<super::BoundsError> {
        super::reach::conflict(&self.bands, &self.places.inputs, M, run)
    }

    fn forget(&mut self) {
        self.has_last = false;
    }
}
