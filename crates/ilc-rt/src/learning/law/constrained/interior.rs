//! The interior point: Mehrotra's predictor and corrector, with a Riccati recursion as the linear
//! solution.

use super::riccati::{Gain, Plant, Pull, Weighing};
use super::rows::{BEND, CHANGE, OUTPUT, Rows, STEP};
use super::solver::{Bands, Outcome, Places, Solver};
use crate::learning::sweep::Run;

/// Gap at which the search ends, as a part of the cost ...
const GAP: f64 = 1e-13;
/// ... and the one that is good enough where rounding lets it shrink no further.
const GAP_ENOUGH: f64 = 1e-9;
/// What of the cost before learning counts as nothing.
const FLOOR: f64 = 1e-12;
/// Part of the first violation that may be left when the search ends.
const RESIDUAL: f64 = 1e-11;
/// Iterations after which the search is given up.
const MAX_ITERATIONS: usize = 60;
/// Part of the way to the border that a step may go, at first and near the end.
const MARGIN: f64 = 0.995;
const MARGIN_LATE: f64 = 0.9999;
/// The products of slack and multiplier start at this part of the cost before learning, in sum ...
const START: f64 = 0.1;
/// ... and, coming from an earlier solution, at this part.
const WARM_START: f64 = 1e-4;
/// The most that a bound may be exceeded by, as a part of its size.
const EXCESS: f64 = 1e-9;

/// One group of axes: `N` states, `M` inputs, `P` outputs, `NS` states with the delayed changes.
#[derive(Debug)]
pub(super) struct Interior<const N: usize, const M: usize, const P: usize, const NS: usize> {
    plant: Plant<N, M, P>,
    /// The different weights, and which of them holds at each sample.
    weighings: Vec<Weighing<M, P>>,
    which: Vec<usize>,
    /// Weight of the input alone, at each of `weighings`.
    holds: Vec<[[f64; M]; M]>,
    places: Places,
    bands: Bands,
    rows: Rows,
    /// Gains of the problem without bounds.
    plain: Vec<Gain<M, NS>>,
    gains: Vec<Gain<M, NS>>,
    kappa: Vec<[f64; M]>,
    /// Error at the samples that the input reaches, and the same weighted.
    error: Vec<[f64; P]>,
    weighted: Vec<[f64; P]>,
    /// `-S u`.
    hold: Vec<[f64; M]>,
    input: Vec<[f64; M]>,
    /// Where the search is: the change of the input and the output that it causes.
    v: Vec<[f64; M]>,
    output: Vec<[f64; P]>,
    /// The step from there.
    v_step: Vec<[f64; M]>,
    output_step: Vec<[f64; P]>,
    /// How the cost pulls there.
    pulls: Vec<Pull<M, P>>,
    /// Input that the last solution gave, from which the next search may start.
    last: Vec<[f64; M]>,
    has_last: bool,
    cost: f64,
    cost_before: f64,
    /// The size of the cost that the search has to do with.
    worth: f64,
}

/// The parts of an [`Interior`] that are given from outside.
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

    /// Returns the last sample before the final `free` ones whose input nothing determines.
    pub(super) fn undetermined(&self, free: usize) -> Option<usize> {
        let end = self.plain.len() - free.min(self.plain.len() - 1);
        (0..end).rev().find(|k| self.plain[*k].vanished())
    }

    /// Weighs the change of inputs that reach nothing within the run, so that they stay as they were.
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

    /// Runs the recursion over all samples, with the weights of the rows or without them.
    #[inline(never)]
    fn factorise(&mut self, with_rows: bool) {
        let sigma = &self.rows.sigma[..];
        let begin = if with_rows { self.rows.begin } else { [None; 4] };
        let mut cost = [[0.0; NS]; NS];
        for k in (0..self.which.len()).rev() {
            let mut weighing = self.weighings[self.which[k]].clone();
            if let Some(at) = begin[CHANGE] {
                for (i, weight) in sigma[at + k * M..][..M].iter().enumerate() {
                    weighing.change[i][i] += weight;
                }
            }
            if let Some(at) = begin[STEP] {
                for (i, weight) in sigma[at + k * M..][..M].iter().enumerate() {
                    weighing.step[i] += weight;
                }
            }
            if let Some(at) = begin[BEND] {
                for (i, weight) in sigma[at + k * M..][..M].iter().enumerate() {
                    weighing.bend[i] += weight;
                }
            }
            if let Some(at) = begin[OUTPUT] {
                for (i, weight) in sigma[at + k * P..][..P].iter().enumerate() {
                    weighing.output[i][i] += weight;
                }
            }
            self.plant.earlier(&weighing, &mut cost, &mut self.gains[k]);
        }
    }

    /// Computes the cost where the search is, and how it pulls at each sample.
    ///
    /// The step is solved for, and not the next point: near a bound the rows' weights exceed 1e10,
    /// and the point itself, multiplied by them, would drown everything else.
    #[inline(never)]
    fn look(&mut self) {
        let mut cost = self.cost_before;
        let mut before = [0.0; M];
        for (k, pull) in self.pulls.iter_mut().enumerate() {
            let base = &self.weighings[self.which[k]];
            let (v, output) = (&self.v[k], &self.output[k]);
            for i in 0..P {
                let mut own = 0.0;
                for j in 0..P {
                    own += base.output[i][j] * output[j];
                }
                pull.output[i] = self.weighted[k][i] - own;
                cost += output[i] * (0.5 * own - self.weighted[k][i]);
            }
            for i in 0..M {
                let mut own = 0.0;
                for j in 0..M {
                    own += base.change[i][j] * v[j];
                }
                pull.change[i] = self.hold[k][i] - own;
                let step = v[i] - before[i];
                pull.step[i] = -base.step[i] * step;
                cost += v[i] * (0.5 * own - self.hold[k][i]) + 0.5 * base.step[i] * step * step;
            }
            before = *v;
        }
        self.cost = cost;
    }

    /// Solves for the step, with the rows or without them.
    #[inline(never)]
    fn sweep(&mut self, with_rows: bool) {
        let gains = if with_rows { &self.gains } else { &self.plain };
        let begin = if with_rows { self.rows.begin } else { [None; 4] };
        let row_pull = &self.rows.pull[..];
        let mut slope = [0.0; NS];
        for k in (0..gains.len()).rev() {
            let mut pull = self.pulls[k];
            if let Some(at) = begin[CHANGE] {
                add(&mut pull.change, &row_pull[at + k * M..][..M]);
            }
            if let Some(at) = begin[STEP] {
                add(&mut pull.step, &row_pull[at + k * M..][..M]);
            }
            if let Some(at) = begin[BEND] {
                add(&mut pull.bend, &row_pull[at + k * M..][..M]);
            }
            if let Some(at) = begin[OUTPUT] {
                add(&mut pull.output, &row_pull[at + k * P..][..P]);
            }
            self.kappa[k] = self.plant.backward(&gains[k], &pull, &mut slope);
        }
        let mut state = [0.0; NS];
        let begin = self.rows.begin;
        let mut before = ([0.0; M], [0.0; M]);
        for k in 0..gains.len() {
            let v = Plant::<N, M, P>::change(&gains[k], &self.kappa[k], &state);
            let output = self.plant.output(&state, &v);
            (self.v_step[k], self.output_step[k]) = (v, output);
            write_rows(&mut self.rows.steps, begin, k, &v, &before, &output);
            before = (v, before.0);
            self.plant.forward(&mut state, &v);
        }
    }

    /// Goes a part of the step.
    fn advance(&mut self, length: f64) {
        for k in 0..self.v.len() {
            for i in 0..M {
                self.v[k][i] += length * self.v_step[k][i];
            }
            for i in 0..P {
                self.output[k][i] += length * self.output_step[k][i];
            }
        }
        self.rows.advance(length);
    }

    /// Computes output and rows from the change of the input.
    fn roll(&mut self) {
        let mut state = [0.0; NS];
        let mut before = ([0.0; M], [0.0; M]);
        for (k, v) in self.v.iter().enumerate() {
            self.output[k] = self.plant.output(&state, v);
            write_rows(&mut self.rows.values, self.rows.begin, k, v, &before, &self.output[k]);
            before = (*v, before.0);
            self.plant.forward(&mut state, v);
        }
    }

    /// Goes to the solution of the problem without bounds.
    fn relax(&mut self) {
        self.v.fill([0.0; M]);
        self.output.fill([0.0; P]);
        self.look();
        self.sweep(false);
        self.v.copy_from_slice(&self.v_step);
        self.output.copy_from_slice(&self.output_step);
        self.rows.values.copy_from_slice(&self.rows.steps);
    }

    /// Takes over the signals of a run: what pulls at the input, and where the limits lie from here.
    fn load(&mut self, run: &Run) {
        let n_samples = self.which.len();
        self.cost_before = 0.0;
        for k in 0..n_samples {
            for (i, channel) in self.places.inputs.iter().enumerate() {
                self.input[k][i] = run.input[k * run.n_inputs + channel];
            }
            for (i, channel) in self.places.outputs.iter().enumerate() {
                let sample = k + self.places.shifts[i];
                let is_inside = sample < n_samples;
                let error =
                    if is_inside { run.error[sample * run.n_outputs + channel] } else { 0.0 };
                self.error[k][i] = error;
            }
            let place = self.which[k];
            let (weighing, hold) = (&self.weighings[place], &self.holds[place]);
            for i in 0..P {
                self.weighted[k][i] =
                    (0..P).map(|j| weighing.output[i][j] * self.error[k][j]).sum();
                self.cost_before += 0.5 * self.weighted[k][i] * self.error[k][i];
            }
            for i in 0..M {
                self.hold[k][i] = -(0..M).map(|j| hold[i][j] * self.input[k][j]).sum::<f64>();
                self.cost_before -= 0.5 * self.hold[k][i] * self.input[k][i];
            }
        }
        self.limit();
    }

    /// Sets the limits of all rows for the input at hand.
    fn limit(&mut self) {
        let Self { rows, bands, input, error, .. } = self;
        let zero = [0.0; M];
        let at = |k: usize, back: usize| if k < back { &zero } else { &input[k - back] };
        for k in 0..input.len() {
            for i in 0..M {
                let here = k * M + i;
                let u = input[k][i];
                let (first, second) = (at(k, 1)[i], at(k, 2)[i]);
                if let Some(begin) = rows.begin[CHANGE] {
                    let free = (f64::NEG_INFINITY, f64::INFINITY);
                    let (low, high) = bands.input.as_ref().map_or(free, |band| band.at(here));
                    let (least, most) = bands.change.as_ref().map_or(free, |band| band.at(here));
                    rows.lower.set(begin + here, least.max(low - u));
                    rows.upper.set(begin + here, most.min(high - u));
                }
                for (kind, band, offset) in [
                    (STEP, &bands.step, u - first),
                    (BEND, &bands.bend, (u - first) - (first - second)),
                ] {
                    if let (Some(begin), Some(band)) = (rows.begin[kind], band) {
                        let (low, high) = band.at(here);
                        rows.lower.set(begin + here, low - offset);
                        rows.upper.set(begin + here, high - offset);
                    }
                }
            }
            if let (Some(begin), Some(band)) = (rows.begin[OUTPUT], &bands.output) {
                for i in 0..P {
                    let (low, high) = band.at(k * P + i);
                    rows.lower.set(begin + k * P + i, low + error[k][i]);
                    rows.upper.set(begin + k * P + i, high + error[k][i]);
                }
            }
        }
    }

    /// Runs the iterations from the point where slacks and multipliers stand.
    fn search(&mut self) -> (bool, usize, f64) {
        let n_limits = self.rows.count();
        let mut residual = 1.0;
        let mut gap = self.rows.gap();
        let mut found = (false, 0, f64::INFINITY);
        let mut part = 1.0_f64;
        self.look();
        for iteration in 1..=MAX_ITERATIONS {
            self.rows.weigh(0.0, false);
            self.factorise(true);
            self.sweep(true);
            let length = self.rows.step(0.0, false, 1.0);
            let shrunk = self.rows.gap_at(length) / gap;
            let centre = shrunk * shrunk * shrunk * gap / n_limits;
            self.rows.weigh(centre, true);
            self.sweep(true);
            let margin = (1.0 - part).clamp(MARGIN, MARGIN_LATE);
            let length = self.rows.step(centre, true, margin);
            if !(length.is_finite() && self.cost.is_finite()) {
                break;
            }
            self.advance(length);
            self.look();
            residual *= 1.0 - length;
            let before = gap;
            gap = self.rows.gap();
            part = gap / self.cost.max(FLOOR * self.worth);
            #[cfg(test)]
            println!("  {iteration}: length {length:.4} gap {gap:e} of {:e}", self.cost);
            let is_done = residual <= RESIDUAL && part <= GAP_ENOUGH;
            found = (is_done, iteration, part);
            if is_done && (part <= GAP || gap > 0.5 * before) {
                break;
            }
        }
        found
    }

    /// Clips what rounding left outside of the bounds of input and change; returns whether all bounds
    /// hold then.
    fn vet(&mut self) -> bool {
        let mut largest = 0.0_f64;
        for (k, v) in self.v.iter_mut().enumerate() {
            for (i, v) in v.iter_mut().enumerate() {
                let u = self.input[k][i];
                if let Some(band) = &self.bands.input {
                    let (low, high) = band.at(k * M + i);
                    *v = v.max(low - u).min(high - u);
                }
                largest = largest.max((u + *v).abs());
            }
        }
        self.roll();
        let size = |band: &Option<super::solver::Band>| {
            let size = band.as_ref().map_or(0.0, |band| band.size);
            if size > 0.0 { size } else { largest }
        };
        let sizes = [
            size(&self.bands.input).max(size(&self.bands.change)),
            size(&self.bands.step),
            size(&self.bands.bend),
            size(&self.bands.output),
        ];
        let begin = self.rows.begin;
        let size_of = |start: usize| {
            (0..4).find(|kind| begin[*kind] == Some(start)).map_or(0.0, |kind| sizes[kind])
        };
        self.rows.overshoot(size_of) <= EXCESS
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
            // A cost that bounds alone cause counts as well.
            let stiffness = self.plain[0].stiffness();
            let overshoot = self.rows.overshoot(|_| 1.0);
            self.worth = self.cost_before + 0.5 * stiffness * overshoot * overshoot;
            let centre = self.worth / self.rows.count();
            let mut found = (false, 0, 0.0);
            if self.has_last {
                for (k, v) in self.v.iter_mut().enumerate() {
                    for (i, v) in v.iter_mut().enumerate() {
                        *v = self.last[k][i] - self.input[k][i];
                    }
                }
                self.roll();
                self.rows.start(WARM_START * centre, true);
                found = self.search();
            }
            if !found.0 {
                let wasted = found.1;
                self.relax();
                self.rows.start(START * centre, false);
                found = self.search();
                found.1 += wasted;
            }
            outcome = Outcome { is_solved: found.0, iterations: found.1, gap: found.2 };
            self.has_last = found.0;
        }
        outcome.is_solved &= self.vet();
        self.has_last &= outcome.is_solved;
        if self.has_last {
            for (k, last) in self.last.iter_mut().enumerate() {
                for (i, last) in last.iter_mut().enumerate() {
                    *last = self.input[k][i] + self.v[k][i];
                }
            }
        }
        outcome
    }

    fn write(&self, run: &mut Run) {
        for k in 0..self.v.len() {
            for (i, channel) in self.places.inputs.iter().enumerate() {
                let mut next = self.input[k][i] + self.v[k][i];
                // The sum rounds once more.
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

fn add(sum: &mut [f64], more: &[f64]) {
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum += more;
    }
}

/// Writes the values of all rows of one sample.
#[inline(always)]
fn write_rows<const M: usize, const P: usize>(
    values: &mut [f64],
    begin: [Option<usize>; 4],
    k: usize,
    v: &[f64; M],
    before: &([f64; M], [f64; M]),
    output: &[f64; P],
) {
    if let Some(at) = begin[CHANGE] {
        values[at + k * M..][..M].copy_from_slice(v);
    }
    if let Some(at) = begin[STEP] {
        for (i, value) in values[at + k * M..][..M].iter_mut().enumerate() {
            *value = v[i] - before.0[i];
        }
    }
    if let Some(at) = begin[BEND] {
        for (i, value) in values[at + k * M..][..M].iter_mut().enumerate() {
            *value = (v[i] - before.0[i]) - (before.0[i] - before.1[i]);
        }
    }
    if let Some(at) = begin[OUTPUT] {
        values[at + k * P..][..P].copy_from_slice(output);
    }
}
