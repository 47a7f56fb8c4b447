//! Sweeps of an iteration of the interior point along the run: the recursion for the gains, the cost
//! and its pull at a point, and the two sweeps for the step from there.

#![expect(clippy::needless_range_loop, reason = "matrices are written with their indices")]
#![expect(clippy::inline_always, reason = "what takes over the instructions of its caller")]

use super::interior::Interior;
use super::riccati::{Plant, Pull};
use super::rows::{BEND, CHANGE, OUTPUT, STEP};
use crate::learning::sweep::wide::{Wide, Work};

/// Largest state for which the recursion is compiled for each instruction set: beyond, the code is long.
const WIDE_MAX: usize = 8;

impl<const N: usize, const M: usize, const P: usize, const NS: usize> Interior<N, M, P, NS> {
    /// Runs the recursion over all samples, with or without the weights of the rows; for
    /// [`forward`](Self::forward) also solves backwards, which takes no time beside it.
    #[inline(never)]
    pub(super) fn factorise(&mut self, with_rows: bool) {
        if NS <= WIDE_MAX {
            self.instructions.run(Factorisation { interior: self, with_rows });
        } else {
            self.recur(with_rows);
        }
    }

    #[inline(always)]
    fn recur(&mut self, with_rows: bool) {
        let sigma = &self.rows.sigma[..];
        let begin = if with_rows { self.rows.begin } else { [None; 4] };
        let row_pull = &self.rows.pull[..];
        let (mut cost, mut slope) = ([[0.0; NS]; NS], [0.0; NS]);
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
            let pull = with_rows_of(&self.pulls[k], row_pull, begin, k);
            self.kappa[k] = self.plant.backward(&self.gains[k], &pull, &mut slope);
        }
    }

    /// Computes cost and gradient at the iterate, sample by sample.
    ///
    /// The step is solved for, not the next iterate: near a bound the rows' weights exceed 1e10,
    /// and the iterate, multiplied by them, would swamp everything else.
    #[inline(never)]
    pub(super) fn look(&mut self) {
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

    /// Solves for the step, with or without the rows.
    pub(super) fn sweep(&mut self, with_rows: bool) {
        self.backward(with_rows);
        self.forward(with_rows);
    }

    #[inline(never)]
    fn backward(&mut self, with_rows: bool) {
        let gains = if with_rows { &self.gains } else { &self.plain };
        let begin = if with_rows { self.rows.begin } else { [None; 4] };
        let row_pull = &self.rows.pull[..];
        let mut slope = [0.0; NS];
        for k in (0..gains.len()).rev() {
            let pull = with_rows_of(&self.pulls[k], row_pull, begin, k);
            self.kappa[k] = self.plant.backward(&gains[k], &pull, &mut slope);
        }
    }

    /// Writes the step, after [`factorise`](Self::factorise) or from `sweep`.
    #[inline(never)]
    pub(super) fn forward(&mut self, with_rows: bool) {
        let gains = if with_rows { &self.gains } else { &self.plain };
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

    /// Takes a step of the given length.
    pub(super) fn advance(&mut self, length: f64) {
        self.go(length);
        self.rows.advance(length);
    }

    /// Takes a step of the given length, without slacks and multipliers.
    #[inline(never)]
    pub(super) fn go(&mut self, length: f64) {
        for k in 0..self.v.len() {
            for i in 0..M {
                self.v[k][i] += length * self.v_step[k][i];
            }
            for i in 0..P {
                self.output[k][i] += length * self.output_step[k][i];
            }
        }
        for (value, step) in self.rows.values.iter_mut().zip(&self.rows.steps) {
            *value += length * step;
        }
    }

    /// Computes output and rows from the change of the input.
    #[inline(never)]
    pub(super) fn roll(&mut self) {
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
    #[inline(never)]
    pub(super) fn relax(&mut self) {
        self.v.fill([0.0; M]);
        self.output.fill([0.0; P]);
        self.look();
        self.sweep(false);
        self.v.copy_from_slice(&self.v_step);
        self.output.copy_from_slice(&self.output_step);
        self.rows.values.copy_from_slice(&self.rows.steps);
    }
}

/// The recursion, for the instructions of the processor.
struct Factorisation<'a, const N: usize, const M: usize, const P: usize, const NS: usize> {
    interior: &'a mut Interior<N, M, P, NS>,
    with_rows: bool,
}

impl<const N: usize, const M: usize, const P: usize, const NS: usize> Work
    for Factorisation<'_, N, M, P, NS>
{
    type Output = ();

    #[inline(always)]
    fn with(self, _: impl Wide) {
        self.interior.recur(self.with_rows);
    }
}

/// Returns the pull of a sample with that of its rows.
#[inline(always)]
fn with_rows_of<const M: usize, const P: usize>(
    pull: &Pull<M, P>,
    row_pull: &[f64],
    begin: [Option<usize>; 4],
    k: usize,
) -> Pull<M, P> {
    let mut pull = *pull;
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
    pull
}

fn add(sum: &mut [f64], more: &[f64]) {
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum += more;
    }
}

/// Writes the values of all rows of one sample.
#[inline]
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
