//! The two sweeps for any number of states, inputs and outputs.
//!
//! Each step is a product of a matrix with a vector. Eight rows after the other stay in registers
//! while all columns are added to them, in the order of [`fixed`] and with the widest instructions of
//! the processor, so that the numbers are the same.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::factor::Gains;
use super::record::Sizes;
use super::steps::{Steps, below, rows};
use super::wide::{Instructions, LANES, Wide, Work};
use super::{Channels, Run, Sweep, fixed};

/// The solver for coupled axes, and for time-varying gains.
///
/// # Real Time
/// Cold path. Allocates at creation, never in [`Sweep::solve`]; each step of `S` samples costs about
/// `(n + S m)(n + S p + S m) + (n + S m)(n + S m)` multiply-adds.
#[derive(Debug, Clone)]
pub struct General {
    steps: Steps,
    channels: Channels,
    /// One `kappa` per step and input.
    kappa: Vec<f64>,
    work: Vec<f64>,
}

impl General {
    /// Creates the solver for the given channels.
    pub fn new(gains: &Gains, channels: Channels) -> Self {
        // The longer the step, the shorter the wait and the longer the products, which are shortest
        // where a step has as many inputs as states.
        let (n, m) = (gains.n_states(), gains.n_inputs().max(1));
        let inputs = if n > 16 { n } else { 8 };
        Self::with_steps(Steps::new(gains, inputs.div_ceil(m).max(2)), channels)
    }

    /// Creates the solver that takes the samples one by one.
    #[cfg(test)]
    pub(super) fn by_sample(gains: &Gains, channels: Channels) -> Self {
        Self::with_steps(Steps::new(gains, 1), channels)
    }

    fn with_steps(steps: Steps, channels: Channels) -> Self {
        let Sizes { n, m, targets, .. } = steps.sizes();
        let kappa = vec![0.0; steps.n_steps() * below(m)];
        let work = vec![0.0; padded(rows(n, m)) + n + targets + m];
        Self { steps, channels, kappa, work }
    }

    /// Creates the solver for signals that consist of this problem's channels only: every input,
    /// and a target for every output that has one, already paired.
    pub fn alone(gains: &Gains) -> Self {
        let channels = Channels {
            inputs: (0..gains.n_inputs()).collect(),
            outputs: (0..gains.n_targets()).collect(),
            shifts: vec![0; gains.n_targets()],
        };
        Self::new(gains, channels)
    }

    /// [`Sweep::solve`] for any sizes.
    #[inline(always)]
    fn any(&mut self, wide: impl Wide, run: &mut Run) {
        let Self { steps, channels, kappa, work } = self;
        let Sizes { n, m, targets: p, held, .. } = steps.sizes();
        let (rows, samples) = (rows(n, m), steps.samples());
        let (state, rest) = work.split_at_mut(n);
        let (sum, rest) = rest.split_at_mut(padded(rows));
        let (error, rest) = rest.split_at_mut(p);
        let input = &mut rest[..m];
        let (n_inputs, n_outputs) = (channels.inputs.len(), channels.outputs.len());

        state.fill(0.0);
        let mut step = steps.n_steps();
        for place in 0..steps.n_sets() {
            let (count, at) = steps.set(place);
            for _ in 0..count {
                step -= 1;
                for (i, error) in error.iter_mut().enumerate() {
                    let (sample, i) = (step * samples + i / n_outputs, i % n_outputs);
                    let place = (sample + channels.shifts[i]) * run.n_outputs + channels.outputs[i];
                    // Beyond the end of the run the weight is zero.
                    *error = run.error.get(place).copied().unwrap_or_default();
                }
                sum.fill(0.0);
                let fresh = &at.back[n * rows..];
                add(wide, sum, fresh, rows, error);
                if held > 0 {
                    for (i, input) in input.iter_mut().enumerate() {
                        let (sample, i) = (step * samples + i / n_inputs, i % n_inputs);
                        let place = sample * run.n_inputs + channels.inputs[i];
                        *input = run.input.get(place).copied().unwrap_or_default();
                    }
                    add(wide, sum, &fresh[p * rows..], rows, input);
                }
                add(wide, sum, at.back, rows, state);
                state.copy_from_slice(&sum[..n]);
                kappa[step * below(m)..][..m].copy_from_slice(&sum[below(n)..][..m]);
            }
        }

        state.fill(0.0);
        for place in (0..steps.n_sets()).rev() {
            let (count, at) = steps.set(place);
            for _ in 0..count {
                let kappa = &kappa[step * below(m)..][..m];
                sum.fill(0.0);
                sum[below(n)..][..m].copy_from_slice(kappa);
                add(wide, sum, &at.fore[n * rows..], rows, kappa);
                add(wide, sum, at.fore, rows, state);
                state.copy_from_slice(&sum[..n]);
                for (i, change) in sum[below(n)..][..m].iter().enumerate() {
                    let (sample, i) = (step * samples + i / n_inputs, i % n_inputs);
                    let place = sample * run.n_inputs + channels.inputs[i];
                    // The last step may reach beyond the end of the run.
                    if let (Some(input), Some(next)) =
                        (run.input.get(place), run.next.get_mut(place))
                    {
                        *next = input + change;
                    }
                }
                step += 1;
            }
        }
    }
}

/// Returns the length of whole rows of eight numbers that hold `count` of them.
fn padded(count: usize) -> usize {
    count.next_multiple_of(LANES)
}

/// Adds multiples of the columns of a matrix, which is followed by [`BEYOND`](super::steps::BEYOND) numbers, to
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
        if !fixed::solve(&self.steps, &self.channels, &mut self.kappa, run) {
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
        let all = 2 * (13 + 12 + 8 + 12 + 1);
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
        let mut general = General::new(&gains, channels.clone());
        let solve = |general: &mut General, way: &dyn Fn(&mut General, &mut Run) -> bool| {
            let mut next = vec![0.0; input.len()];
            let (input, error) = (&input[..], &error[..]);
            let mut run = Run { input, error, next: &mut next, n_inputs: m + 1, n_outputs: m + 1 };
            way(general, &mut run).then_some(next)
        };
        let any = |general: &mut General, how: Instructions| {
            solve(general, &|general, run| {
                how.run(Solve(general, run));
                true
            })
        };
        let best = any(&mut general, Instructions::best());
        assert!(best.is_some() && best == any(&mut general, Instructions::Portable), "{m} axes");
        let fixed = solve(&mut general, &|General { steps, kappa, channels, .. }, run| {
            fixed::solve(steps, channels, kappa, run)
        });
        let told = format!("{} states, {m} axes", gains.n_states());
        assert!(fixed.is_none() || fixed == best, "{told}");

        let mut by_sample = General::by_sample(&gains, channels);
        let by_sample = any(&mut by_sample, Instructions::Portable).unwrap();
        let scale = by_sample.iter().fold(1.0_f64, |scale, value| scale.max(value.abs()));
        for (k, (step, sample)) in best.unwrap().iter().zip(&by_sample).enumerate() {
            assert!((step - sample).abs() <= 1e-13 * scale, "{told}, at {k}: {step} and {sample}");
        }
        fixed.is_some()
    }
}
