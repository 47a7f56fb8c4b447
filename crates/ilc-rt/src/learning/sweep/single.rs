//! The two sweeps for one input and one output, with everything in registers.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::factor::Gains;
use super::lanes::{Cut, Place};
use super::record::Record;
use super::wide::{Instructions, Wide, Work};
use super::{Channels, Run, Sweep};

/// Largest number of states, including that of a rate penalty, that [`single`] supports.
#[cfg(test)]
const MAX_STATES: usize = 6;

/// Returns the solver for a single axis.
///
/// `None` unless the gains are for one input, one output and 1 to 6 states: the caller then uses
/// [`super::General`].
pub(super) fn single(
    gains: &Gains,
    channels: &Channels,
    how: Instructions,
) -> Option<Box<dyn Sweep>> {
    let ([input], [output], [shift]) =
        (&channels.inputs[..], &channels.outputs[..], &channels.shifts[..])
    else {
        return None;
    };
    let at = Place { input: *input, output: *output, shift: *shift };
    Some(match gains.n_states() {
        1 => Box::new(Single::<1>::new(gains, at, how)),
        2 => Box::new(Single::<2>::new(gains, at, how)),
        3 => Box::new(Single::<3>::new(gains, at, how)),
        4 => Box::new(Single::<4>::new(gains, at, how)),
        5 => Box::new(Single::<5>::new(gains, at, how)),
        6 => Box::new(Single::<6>::new(gains, at, how)),
        _ => return None,
    })
}

/// The gains of one sample with sizes known at compile time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fixed<const N: usize> {
    /// Column-major: column `j` is the effect of state `j`.
    pub(super) transition: [[f64; N]; N],
    pub(super) feedback: [f64; N],
    pub(super) from_error: [f64; N],
    pub(super) from_input: [f64; N],
    pub(super) costate: [f64; N],
    pub(super) b: [f64; N],
    pub(super) error: f64,
    pub(super) input: f64,
}

impl<const N: usize> Fixed<N> {
    fn new(record: Record, is_held: bool) -> Self {
        let rows = N + 1;
        let fore = |row: usize, col: usize| record.fore[col * rows + row];
        let back = |row: usize, col: usize| record.back[col * rows + row];
        let held = |row: usize| if is_held { back(row, N + 1) } else { 0.0 };
        Self {
            transition: std::array::from_fn(|col| std::array::from_fn(|row| fore(row, col))),
            feedback: std::array::from_fn(|col| -fore(N, col)),
            from_error: std::array::from_fn(|row| back(row, N)),
            from_input: std::array::from_fn(held),
            costate: std::array::from_fn(|col| back(N, col)),
            b: std::array::from_fn(|row| record.fore[rows * N + row]),
            error: back(N, N),
            input: -held(N),
        }
    }

    #[inline(always)]
    fn backward<const HELD: bool>(&self, costate: &mut [f64; N], input: f64, error: f64) -> f64 {
        let hold = |gain: f64| if HELD { gain * input } else { 0.0 };
        let kappa = dot(self.error * error - hold(self.input), &self.costate, costate);
        let earlier = std::array::from_fn(|i| {
            // Terms that do not wait for the previous sample come first: they shorten the
            // dependency chain.
            let fresh = self.from_error[i] * error + hold(self.from_input[i]);
            dot(fresh, &self.transition[i], costate)
        });
        *costate = earlier;
        kappa
    }

    #[inline(always)]
    fn forward(&self, state: &mut [f64; N], kappa: f64) -> f64 {
        let change = kappa - dot(0.0, &self.feedback, state);
        let mut next: [f64; N] = std::array::from_fn(|i| self.b[i] * kappa);
        for (column, value) in self.transition.iter().zip(*state) {
            for (entry, gain) in next.iter_mut().zip(column) {
                *entry += gain * value;
            }
        }
        *state = next;
        change
    }
}

#[inline(always)]
fn dot<const N: usize>(mut sum: f64, left: &[f64; N], right: &[f64; N]) -> f64 {
    for i in 0..N {
        sum += left[i] * right[i];
    }
    sum
}

/// Gains in order of time, each with the number of samples it serves.
type Sets<const N: usize> = Vec<(usize, Fixed<N>)>;

#[derive(Debug)]
struct Single<const N: usize> {
    /// The samples before and after the segments.
    before: Sets<N>,
    cut: Option<(Fixed<N>, Cut<N>, usize)>,
    after: Sets<N>,
    n_before: usize,
    n_samples: usize,
    is_held: bool,
    instructions: Instructions,
    place: Place,
    /// `kappa` before and after.
    kappa: Vec<f64>,
}

impl<const N: usize> Single<N> {
    fn new(gains: &Gains, place: Place, instructions: Instructions) -> Self {
        let (n_samples, is_held) = (gains.n_samples(), gains.sizes().held > 0);
        let (mut before, mut after, mut cut) = (Vec::new(), Vec::new(), None);
        for index in (0..gains.n_stored()).rev() {
            let (count, record) = gains.set(index);
            let fixed = Fixed::new(record, is_held);
            match Cut::new(&fixed, count) {
                // The samples left over from the segments come last, where the costate is exact.
                Some(stretches) if count > 1 => {
                    let n_blocks = count / stretches.block();
                    before = std::mem::take(&mut after);
                    after.push((count - n_blocks * stretches.block(), fixed));
                    cut = Some((fixed, stretches, n_blocks));
                }
                _ => after.push((count, fixed)),
            }
        }
        let n_before = before.len();
        let n_after: usize = after.iter().map(|(count, _)| count).sum();
        let kappa = vec![0.0; n_before + n_after];
        Self { before, cut, after, n_before, n_samples, is_held, instructions, place, kappa }
    }

    /// Solves with (`HELD`) or without a weight of the input.
    #[inline(always)]
    fn sweep<const HELD: bool>(&mut self, wide: impl Wide, run: &mut Run) {
        let Self { before, cut, after, n_before, n_samples, place, kappa, .. } = self;
        let (kappa_before, kappa_after) = kappa.split_at_mut(*n_before);
        let first_after = *n_samples - kappa_after.len();
        let costate = backward::<HELD, N>(after, *place, run, first_after, [0.0; N], kappa_after);
        let mut state = [0.0; N];
        if let Some((gains, cut, n_blocks)) = cut {
            for block in 0..*n_blocks {
                let first = *n_before + block * cut.block();
                let exact = (block + 1 == *n_blocks).then_some(costate);
                let at = (*place, first);
                state = cut.solve::<HELD>(wide, gains, at, run, exact, |run, costate| {
                    if block > 0 {
                        return state;
                    }
                    backward::<HELD, N>(before, *place, run, 0, costate, kappa_before);
                    forward(before, *place, run, 0, state, kappa_before)
                });
            }
        }
        forward(after, *place, run, first_after, state, kappa_after);
    }
}

/// A solver with the run to solve.
struct Solve<'a, 'r, const N: usize>(&'a mut Single<N>, &'a mut Run<'r>);

impl<const N: usize> Work for Solve<'_, '_, N> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Self(single, run) = self;
        if single.is_held {
            single.sweep::<true>(wide, run);
        } else {
            single.sweep::<false>(wide, run);
        }
    }
}

impl<const N: usize> Sweep for Single<N> {
    fn solve(&mut self, run: &mut Run) {
        self.instructions.run(Solve(self, run));
    }
}

/// Sweeps backward over the samples from `first` on and returns the costate at their start.
#[inline(always)]
fn backward<const HELD: bool, const N: usize>(
    sets: &Sets<N>,
    place: Place,
    run: &Run,
    first: usize,
    mut costate: [f64; N],
    kappa: &mut [f64],
) -> [f64; N] {
    let last = (run.error.len() / run.n_outputs).saturating_sub(1);
    let mut k = kappa.len();
    for (count, gains) in sets.iter().rev() {
        let gains = *gains;
        for _ in 0..*count {
            k -= 1;
            // Beyond the end of the run the weight is zero: any finite value will do.
            let sample = (first + k + place.shift).min(last);
            let error = run.error[sample * run.n_outputs + place.output];
            let input =
                if HELD { run.input[(first + k) * run.n_inputs + place.input] } else { 0.0 };
            kappa[k] = gains.backward::<HELD>(&mut costate, input, error);
        }
    }
    costate
}

/// Sweeps forward over the samples from `first` on and returns the state at their end.
#[inline(always)]
fn forward<const N: usize>(
    sets: &Sets<N>,
    place: Place,
    run: &mut Run,
    first: usize,
    mut state: [f64; N],
    kappa: &[f64],
) -> [f64; N] {
    let mut k = 0;
    for (count, gains) in sets {
        let gains = *gains;
        for _ in 0..*count {
            let index = (first + k) * run.n_inputs + place.input;
            run.next[index] = run.input[index] + gains.forward(&mut state, kappa[k]);
            k += 1;
        }
    }
    state
}

#[cfg(test)]
mod tests {
    use super::super::{General, Stage, Stages};
    use super::*;
    use nalgebra::DMatrix;

    /// One axis with constant weights.
    struct Axis {
        stage: Stage,
        n_samples: usize,
    }

    impl Stages for Axis {
        fn n_samples(&self) -> usize {
            self.n_samples
        }

        fn n_targets(&self) -> usize {
            1
        }

        fn stage(&self, _: usize) -> Stage {
            self.stage.clone()
        }

        fn constant(&self) -> std::ops::Range<usize> {
            1..self.n_samples.saturating_sub(2)
        }

        fn holds_input(&self) -> bool {
            self.stage.s[0] > 0.0
        }
    }

    fn axis(n: usize, s: f64, n_samples: usize) -> Axis {
        let value = |i: usize, j: usize| (((i * 7 + j * 3 + n) as f64) * 1.7).sin();
        let a = DMatrix::from_fn(n, n, |i, j| 1.6 * value(i, j) / n as f64);
        let b = DMatrix::from_fn(n, 1, |i, _| value(i, 11));
        let c = DMatrix::from_fn(1, n, |_, j| value(13, j));
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let stage = Stage { a, b, c, d: one(0.7), q: one(2.0), s: one(s), r: one(0.1) };
        Axis { stage, n_samples }
    }

    #[test]
    fn stretches_agree_with_the_plain_sweep_on_every_processor() {
        // From runs too short for a single segment to several blocks with samples left over.
        let short = (64..700).step_by(53).chain([3, 1301]);
        let lengths: Vec<usize> = short.chain([5000, 40_000, 100_003]).collect();
        for n in 1..=MAX_STATES {
            for (&n_samples, s) in lengths.iter().zip([0.0, 0.2].into_iter().cycle()) {
                let gains = Gains::new(&axis(n, s, n_samples), 0).unwrap();
                for width in [1, 2] {
                    agree(&gains, n_samples, width);
                }
            }
        }
    }

    #[test]
    fn a_state_that_outlives_its_segment_is_carried_across_the_cuts() {
        let mut carried = 0;
        for (r, s) in [(1e-3, 0.0), (0.1, 1e-4), (1.0, 0.0), (10.0, 1e-3)] {
            for n_samples in [200, 333, 700, 1300] {
                let mut axis = axis(2, s, n_samples);
                axis.stage.a = DMatrix::from_row_slice(2, 2, &[1.0, 0.1, 0.0, 0.9]);
                axis.stage.b = DMatrix::from_row_slice(2, 1, &[0.005, 0.1]);
                axis.stage.c = DMatrix::from_row_slice(1, 2, &[1.0, 0.0]);
                (axis.stage.d[0], axis.stage.r[0]) = (0.0, r);
                let gains = Gains::new(&axis, 0).unwrap();
                let at = Place { input: 0, output: 0, shift: 1 };
                let Single { cut, .. } = Single::<2>::new(&gains, at, Instructions::best());
                let is_carried = cut.is_some_and(|(_, cut, _)| cut.carries());
                for width in [1, 2] {
                    agree(&gains, n_samples, width);
                }
                carried += usize::from(is_carried);
            }
        }
        assert!(carried >= 6, "{carried} runs of 16");
    }

    /// Solves the same problem by every method, with the axis' signals among those of `width` axes.
    fn agree(gains: &Gains, n_samples: usize, width: usize) {
        let channels = Channels { inputs: vec![width - 1], outputs: vec![0], shifts: vec![1] };
        let wave = |seed: usize| -> Vec<f64> {
            (0..width * n_samples).map(|k| ((k * k + seed) as f64).sin()).collect()
        };
        let (input, error) = (wave(1), wave(2));
        let solve = |sweep: &mut dyn Sweep| {
            let mut next = vec![0.0; input.len()];
            let (input, error) = (&input[..], &error[..]);
            let (n_inputs, n_outputs) = (width, width);
            sweep.solve(&mut Run { input, error, next: &mut next, n_inputs, n_outputs });
            next
        };
        let told = format!("{} states, {n_samples} samples of {width}", gains.n_states());
        let mut quick = single(gains, &channels, Instructions::best()).unwrap();
        let is_cut = format!("{quick:?}").contains("warm_up");
        assert!(is_cut || n_samples < 5000, "{told}");
        let quick = solve(quick.as_mut());
        let mut portable = single(gains, &channels, Instructions::Portable).unwrap();
        assert!(quick == solve(portable.as_mut()), "{told}");
        let plain = solve(&mut General::new(gains.clone(), channels));
        let scale = plain.iter().fold(1.0_f64, |scale, value| scale.max(value.abs()));
        for (k, (quick, plain)) in quick.iter().zip(&plain).enumerate() {
            let told = format!("{told}, at {k}: {quick} and {plain}");
            assert!((quick - plain).abs() <= 1e-14 * scale, "{told}");
        }
    }
}
