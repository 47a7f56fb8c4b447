//! The two sweeps for any number of states, inputs and outputs.
//!
//! Each sample is a product of a matrix with a vector. Eight rows after the other stay in registers
//! while all columns are added to them, in the order of [`fixed`] and with the widest instructions of
//! the processor, so that the numbers are the same.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::factor::Gains;
use super::record::Sizes;
use super::wide::{Instructions, LANES, Wide, Work};
use super::{Channels, Run, Sweep, fixed};

/// The solver for coupled axes, and for time-varying gains.
///
/// # Real Time
/// Cold path. Allocates at creation, never in [`Sweep::solve`]; each sample costs about
/// `(n + m)(n + p + m) + (n + m)(n + m)` multiply-adds.
#[derive(Debug, Clone)]
pub struct General {
    gains: Gains,
    channels: Channels,
    /// One `kappa` per sample and input.
    kappa: Vec<f64>,
    work: Vec<f64>,
}

impl General {
    /// Creates the solver for the given channels.
    pub fn new(gains: Gains, channels: Channels) -> Self {
        let Sizes { n, m, targets, .. } = gains.sizes();
        let kappa = vec![0.0; gains.n_samples() * m];
        let work = vec![0.0; padded(n + m) + n + targets + m];
        Self { gains, channels, kappa, work }
    }

    /// Creates the solver for signals that consist of this problem's channels only: every input,
    /// and a target for every output that has one, already paired.
    pub fn alone(gains: Gains) -> Self {
        let channels = Channels {
            inputs: (0..gains.n_inputs()).collect(),
            outputs: (0..gains.n_targets()).collect(),
            shifts: vec![0; gains.n_targets()],
        };
        Self::new(gains, channels)
    }

    /// Returns the gains.
    pub fn gains(&self) -> &Gains {
        &self.gains
    }

    /// Returns the gains, for [`Gains::refactor`].
    pub fn gains_mut(&mut self) -> &mut Gains {
        &mut self.gains
    }

    /// [`Sweep::solve`] for any sizes.
    #[inline(always)]
    fn any(&mut self, wide: impl Wide, run: &mut Run) {
        let Self { gains, channels, kappa, work } = self;
        let Sizes { n, m, targets: p, held, .. } = gains.sizes();
        let rows = n + m;
        let last = gains.n_samples().saturating_sub(1);
        let (state, rest) = work.split_at_mut(n);
        let (sum, rest) = rest.split_at_mut(padded(rows));
        let (error, rest) = rest.split_at_mut(p);
        let input = &mut rest[..m];
        let (inputs, outputs) = (&channels.inputs[..m], &channels.outputs[..p]);
        let shifts = &channels.shifts[..p];

        state.fill(0.0);
        let mut k = gains.n_samples();
        for place in 0..gains.n_stored() {
            let (count, at) = gains.open_set(place);
            for _ in 0..count {
                k -= 1;
                for i in 0..p {
                    // Beyond the end of the run the weight is zero: any finite value will do.
                    let sample = (k + shifts[i]).min(last);
                    error[i] = run.error[sample * run.n_outputs + outputs[i]];
                }
                sum.fill(0.0);
                let fresh = &at.back[n * rows..];
                add(wide, sum, fresh, rows, error);
                if held > 0 {
                    let values = &run.input[k * run.n_inputs..(k + 1) * run.n_inputs];
                    for i in 0..m {
                        input[i] = values[inputs[i]];
                    }
                    add(wide, sum, &fresh[p * rows..], rows, input);
                }
                add(wide, sum, at.back, rows, state);
                state.copy_from_slice(&sum[..n]);
                kappa[k * m..(k + 1) * m].copy_from_slice(&sum[n..rows]);
            }
        }

        state.fill(0.0);
        for place in (0..gains.n_stored()).rev() {
            let (count, at) = gains.open_set(place);
            for _ in 0..count {
                let kappa = &kappa[k * m..(k + 1) * m];
                let from_drive = &at.fore[n * rows..];
                sum.fill(0.0);
                add(wide, &mut sum[..padded(n)], from_drive, n, kappa);
                sum[n..rows].copy_from_slice(kappa);
                add(wide, sum, at.fore, rows, state);
                state.copy_from_slice(&sum[..n]);
                for i in 0..m {
                    let index = k * run.n_inputs + inputs[i];
                    run.next[index] = run.input[index] + sum[n + i];
                }
                k += 1;
            }
        }
    }
}

/// Returns the length of whole rows of eight numbers that hold `count` of them.
fn padded(count: usize) -> usize {
    count.next_multiple_of(LANES)
}

/// Adds multiples of the columns of a matrix, which is followed by [`BEYOND`](super::factor::BEYOND) numbers, to
/// a vector that is [`padded`]; its end holds any numbers afterwards.
#[inline(always)]
fn add(wide: impl Wide, sum: &mut [f64], matrix: &[f64], n_rows: usize, factors: &[f64]) {
    let mut first = 0;
    while sum.len() - first >= 4 * LANES {
        block::<4>(wide, &mut sum[first..], (matrix, n_rows, first), factors);
        first += 4 * LANES;
    }
    match (sum.len() - first) / LANES {
        3 => block::<3>(wide, &mut sum[first..], (matrix, n_rows, first), factors),
        2 => block::<2>(wide, &mut sum[first..], (matrix, n_rows, first), factors),
        1 => block::<1>(wide, &mut sum[first..], (matrix, n_rows, first), factors),
        _ => {}
    }
}

/// Adds the part of the columns from row `first` on to `8 G` numbers.
#[inline(always)]
fn block<const G: usize>(
    wide: impl Wide,
    sum: &mut [f64],
    (matrix, n_rows, first): (&[f64], usize, usize),
    factors: &[f64],
) {
    let mut rows = [wide.row(&[0.0; LANES]); G];
    for (row, values) in rows.iter_mut().zip(sum.as_chunks::<LANES>().0) {
        *row = wide.row(values);
    }
    // What is read beyond the end of a column adds to numbers that nothing reads.
    for (col, factor) in factors.iter().enumerate() {
        let column = &matrix[col * n_rows + first..][..G * LANES];
        for (row, values) in rows.iter_mut().zip(column.as_chunks::<LANES>().0) {
            *row = wide.add(*row, wide.scale(*factor, wide.row(values)));
        }
    }
    for (row, values) in rows.iter().zip(sum.as_chunks_mut::<LANES>().0) {
        *values = wide.values(*row);
    }
}

/// The general solver with the run to solve.
struct Solve<'a, 'r>(&'a mut General, &'a mut Run<'r>);

impl Work for Solve<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Self(general, run) = self;
        general.any(wide, run);
    }
}

impl Sweep for General {
    fn solve(&mut self, run: &mut Run) {
        if !fixed::solve(&self.gains, &self.channels, &mut self.kappa, run) {
            Instructions::best().run(Solve(self, run));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Stage, Stages};
    use super::*;
    use nalgebra::DMatrix;

    /// Coupled axes whose weight of the error varies from some sample on.
    struct Coupled {
        stage: Stage,
        n_samples: usize,
        varies_from: usize,
    }

    impl Stages for Coupled {
        fn n_samples(&self) -> usize {
            self.n_samples
        }

        fn n_targets(&self) -> usize {
            self.stage.q.nrows()
        }

        fn stage(&self, sample: usize) -> Stage {
            let mut stage = self.stage.clone();
            stage.q *= if sample < self.varies_from { 1.0 } else { 1.0 + (sample % 5) as f64 };
            stage
        }

        fn constant(&self) -> std::ops::Range<usize> {
            0..self.varies_from
        }

        fn holds_input(&self) -> bool {
            self.stage.s[0] > 0.0
        }
    }

    fn coupled(n: usize, m: usize, s: f64, varies_from: usize) -> Coupled {
        let value = |i: usize, j: usize| (((i * 7 + j * 3 + n) as f64) * 1.7).sin();
        let matrix = |rows, cols, gain: f64| {
            DMatrix::from_fn(rows, cols, |i, j| gain * value(i + rows, j + cols))
        };
        let eye = |gain: f64| DMatrix::identity(m, m) * gain;
        let (a, b, c) = (matrix(n, n, 0.8 / n as f64), matrix(n, m, 1.0), matrix(m, n, 1.0));
        let (d, q, s, r) = (eye(0.7), eye(2.0), eye(s), eye(0.1));
        Coupled { stage: Stage { a, b, c, d, q, s, r }, n_samples: 90, varies_from }
    }

    #[test]
    fn sizes_known_at_compile_time_give_the_numbers_of_any() {
        let mut known = 0;
        for (m, largest) in [(1, 17), (2, 13), (3, 13), (4, 13), (6, 13)] {
            for (n, s) in (1..=largest).flat_map(|n| [(n, 0.0), (n, 0.3)]) {
                let varies_from = if n % 2 == 0 { 0 } else { 60 };
                known += usize::from(agree(&coupled(n, m, s, varies_from)));
            }
        }
        // Each with a cost of the input and without; the others, and an old processor, take the general way.
        let all = 2 * (13 + 10 + 10 + 2 + 1);
        assert!(known == all || known == 0, "{known} of {all}");
    }

    /// Solves a problem every way, and returns true if its sizes are known at compile time.
    fn agree(stages: &Coupled) -> bool {
        let (n_samples, m) = (stages.n_samples, stages.n_targets());
        // The axes are those from the second on, in another order, among one more.
        let order: Vec<usize> = (1..=m).rev().collect();
        let shifts = (0..m).map(|i| i % 3).collect();
        let channels = Channels { inputs: order.clone(), outputs: order, shifts };
        let gains = Gains::new(stages, 0).unwrap();
        let wave = |seed: usize| -> Vec<f64> {
            (0..(m + 1) * n_samples).map(|k| ((k * k + seed) as f64).sin()).collect()
        };
        let (input, error) = (wave(1), wave(2));
        let mut general = General::new(gains.clone(), channels.clone());
        let mut solve = |way: &mut dyn FnMut(&mut General, &mut Run) -> bool| {
            let mut next = vec![0.0; input.len()];
            let (input, error) = (&input[..], &error[..]);
            let mut run = Run { input, error, next: &mut next, n_inputs: m + 1, n_outputs: m + 1 };
            way(&mut general, &mut run).then_some(next)
        };
        let mut any = |how: Instructions| {
            solve(&mut |general, run| {
                how.run(Solve(general, run));
                true
            })
        };
        let best = any(Instructions::best());
        assert!(best.is_some() && best == any(Instructions::Portable), "{m} axes");
        let fixed =
            solve(&mut |general, run| fixed::solve(&gains, &channels, &mut general.kappa, run));
        assert!(fixed.is_none() || fixed == best, "{} states, {m} axes", gains.n_states());
        fixed.is_some()
    }
}
