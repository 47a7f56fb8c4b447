//! The gains of several samples multiplied out, so that the sweeps take these samples at one step.
//!
//! Each sample of a sweep waits for the one before. A step of `S` samples waits once, and has one
//! product with the `n x n` transition instead of `S`. Used by the sweeps of this folder only.

use super::factor::Gains;
use super::record::{Record, Sizes};
use super::wide::{HALF, LANES};

/// Numbers after the last gains, so that whole rows of them can be read from every place.
pub(super) const BEYOND: usize = 4 * LANES;

/// Returns the row at which others begin below `n` rows: a half at a time is in a register.
pub(super) const fn below(n: usize) -> usize {
    n.next_multiple_of(HALF)
}

/// Returns the length of a column of the gains: `n` rows, and `m` [`below`] them.
pub(super) const fn rows(n: usize, m: usize) -> usize {
    below(below(n) + m)
}

/// The gains along a run, step by step.
///
/// A step is a sample with `S` times the inputs and targets, in order of time:
///
/// `[p_k; kappa] = back [p_{k+S}; e; u]`, `[x_{k+S}; v] = fore [x_k; kappa] + [0; kappa]`.
///
/// If the run is no multiple of `S`, samples of zeros follow its end.
#[derive(Debug, Clone)]
pub(super) struct Steps {
    sizes: Sizes,
    samples: usize,
    /// In the order of the recursion; with [`BEYOND`] numbers after them.
    back: Vec<f64>,
    fore: Vec<f64>,
    /// Number of steps that each set serves.
    counts: Vec<usize>,
}

impl Steps {
    /// Multiplies out the gains of `samples` samples each.
    pub(super) fn new(gains: &Gains, samples: usize) -> Self {
        let mut steps = Self::empty(gains, samples);
        let mut product = Product::new(gains.sizes(), steps.sizes);
        let (n_samples, settled) = (gains.n_samples(), gains.settled_samples());
        let mut step = n_samples.div_ceil(samples);
        while step > 0 {
            step -= 1;
            let places = step * samples..((step + 1) * samples).min(n_samples);
            let records: Vec<Record> = places.clone().map(|k| gains.at(k)).collect();
            let mut count = 1;
            if places.len() == samples && settled.start <= places.start && places.end <= settled.end
            {
                // All steps of these gains at once, however long the run is.
                let first = settled.start.div_ceil(samples);
                count += step - first;
                step = first;
            }
            steps.push(&mut product, &records, count);
        }
        for gains in [&mut steps.back, &mut steps.fore] {
            gains.resize(gains.len() + BEYOND, 0.0);
        }
        steps
    }

    /// Multiplies out those gains that serve most samples, for one step; `None` if all differ.
    pub(super) fn settled(gains: &Gains, samples: usize) -> Option<Self> {
        let record = gains.settled()?;
        let mut steps = Self::empty(gains, samples);
        let mut product = Product::new(gains.sizes(), steps.sizes);
        steps.push(&mut product, &vec![record; samples], 1);
        Some(steps)
    }

    fn empty(gains: &Gains, samples: usize) -> Self {
        let Sizes { n, m, p, targets, held } = gains.sizes();
        let [m, p, targets, held] = [m, p, targets, held].map(|count| samples * count);
        let sizes = Sizes { n, m, p, targets, held };
        Self { sizes, samples, back: Vec::new(), fore: Vec::new(), counts: Vec::new() }
    }

    /// Adds a set that serves some steps.
    fn push(&mut self, product: &mut Product, records: &[Record], count: usize) {
        let rows = rows(self.sizes.n, self.sizes.m);
        let (back, fore) = (self.back.len(), self.fore.len());
        self.back.resize(back + rows * self.sizes.columns(), 0.0);
        self.fore.resize(fore + rows * (self.sizes.n + self.sizes.m), 0.0);
        product.back(records, &mut self.back[back..]);
        product.fore(records, &mut self.fore[fore..]);
        self.counts.push(count);
    }

    /// Returns the sizes of a step.
    pub(super) fn sizes(&self) -> Sizes {
        self.sizes
    }

    /// Returns the samples per step.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// Returns the number of steps.
    pub(super) fn n_steps(&self) -> usize {
        self.counts.iter().sum()
    }

    /// Returns the number of sets.
    pub(super) fn n_sets(&self) -> usize {
        self.counts.len()
    }

    /// Returns a set, counted from the end of the run, and the number of steps it serves; each matrix
    /// with what follows it in memory, at least [`BEYOND`] numbers.
    pub(super) fn set(&self, place: usize) -> (usize, Record<'_>) {
        let Sizes { n, m, .. } = self.sizes;
        let rows = rows(n, m);
        let (back, fore) = (rows * self.sizes.columns(), rows * (n + m));
        let record = Record { back: &self.back[place * back..], fore: &self.fore[place * fore..] };
        (self.counts[place], record)
    }
}

/// Workspace of the products.
struct Product {
    one: Sizes,
    all: Sizes,
    /// State or costate as a matrix of what it depends on, column by column.
    state: Vec<f64>,
    sum: Vec<f64>,
}

impl Product {
    fn new(one: Sizes, all: Sizes) -> Self {
        let columns = all.columns().max(all.n + all.m);
        Self { one, all, state: vec![0.0; all.n * columns], sum: vec![0.0; one.n + one.m] }
    }

    fn restart(&mut self) {
        self.state.fill(0.0);
        for i in 0..self.one.n {
            self.state[i * self.one.n + i] = 1.0;
        }
    }

    /// Multiplies out the backward matrices of some samples, from the last to the first.
    fn back(&mut self, records: &[Record], to: &mut [f64]) {
        let (Sizes { n, m, targets, held, .. }, all) = (self.one, self.all);
        let (error, input) = (n, n + all.targets);
        self.restart();
        for (s, record) in records.iter().enumerate().rev() {
            for column in 0..all.columns() {
                let own = match column {
                    i if i >= input + s * held && i < input + (s + 1) * held => {
                        Some(targets + i - input - s * held)
                    }
                    i if i >= error + s * targets && i < error + (s + 1) * targets => {
                        Some(i - error - s * targets)
                    }
                    _ => None,
                };
                let own = own.map(|i| &record.back[(n + i) * (n + m)..][..n + m]);
                let kappa = &mut to[column * rows(n, all.m) + below(n) + s * m..][..m];
                self.step(column, record.back, own, kappa);
            }
        }
        self.finish(all.columns(), to);
    }

    /// Multiplies out the forward matrices of some samples, from the first to the last.
    fn fore(&mut self, records: &[Record], to: &mut [f64]) {
        let (Sizes { n, m, .. }, all) = (self.one, self.all);
        self.restart();
        for (s, record) in records.iter().enumerate() {
            for column in 0..n + all.m {
                let own = column.checked_sub(n + s * m).filter(|i| *i < m);
                let own = own.map(|i| &record.fore[n * (n + m) + i * n..][..n]);
                let change = &mut to[column * rows(n, all.m) + below(n) + s * m..][..m];
                self.step(column, record.fore, own, change);
            }
        }
        self.finish(n + all.m, to);
    }

    /// Replaces a column of the state by that of the next sample, and writes the rest of it.
    fn step(&mut self, column: usize, matrix: &[f64], own: Option<&[f64]>, rest: &mut [f64]) {
        let n = self.one.n;
        self.sum.fill(0.0);
        if let Some(own) = own {
            self.sum[..own.len()].copy_from_slice(own);
        }
        let state = &mut self.state[column * n..][..n];
        let rows = self.sum.len();
        for (value, entries) in state.iter().zip(matrix.chunks_exact(rows)) {
            if *value != 0.0 {
                for (sum, entry) in self.sum.iter_mut().zip(entries) {
                    *sum += entry * value;
                }
            }
        }
        state.copy_from_slice(&self.sum[..n]);
        rest.copy_from_slice(&self.sum[n..]);
    }

    fn finish(&self, columns: usize, to: &mut [f64]) {
        let (n, rows) = (self.one.n, rows(self.all.n, self.all.m));
        for column in 0..columns {
            to[column * rows..][..n].copy_from_slice(&self.state[column * n..][..n]);
        }
    }
}
