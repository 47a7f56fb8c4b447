//! The two sweeps for one input and one output.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use std::ops::Range;

use super::factor::Gains;
use super::fixed::{self, Signals};
use super::lane_step::{self, Fixed};
use super::lanes::{Cut, Place};
use super::steps::{Steps, rows};
use super::wide::{HALF, Instructions, Wide, Work};
use super::{Channels, Run, Sweep};

/// Largest number of states, including that of a rate penalty, that [`single`] supports.
#[cfg(test)]
const MAX_STATES: usize = 3;

/// Samples per step of what is solved step by step.
const STEP: usize = 4;

/// Returns the solver for a single axis.
///
/// `None` unless the gains are for one input, one output and 1 to 3 states: the caller then uses
/// [`super::General`].
pub(super) fn single(
    gains: &Gains,
    channels: &Channels,
    how: Instructions,
) -> Option<Box<dyn Sweep>> {
    if gains.n_inputs() != 1 || gains.n_targets() != 1 {
        return None;
    }
    macro_rules! choose {
        ($($n:literal $changes:literal)*) => {
            match (gains.n_states(), usize::from(gains.remembers_change())) {
                $(($n, $changes) => Box::new(
                    Single::<$n, { rows($n, STEP) / HALF }, { $n - $changes }>::new(gains, channels, how)
                ),)*
                _ => return None,
            }
        };
    }
    // With more states the waiting is hidden by the products of one step.
    Some(choose!(1 0 2 0 3 0 2 1 3 1))
}

/// The solver for `N` states, `MODEL` of them that of the model; the columns of the gains have `G`
/// halves.
#[derive(Debug)]
struct Single<const N: usize, const G: usize, const MODEL: usize> {
    alone: Alone<N, G>,
    parallel: Option<Parallel<N, MODEL>>,
    channels: Channels,
    instructions: Instructions,
}

/// The steps that are solved one after the other.
#[derive(Debug)]
struct Alone<const N: usize, const G: usize> {
    steps: Steps,
    /// Their number for each set, in the order of the recursion, and the place of their `kappa`.
    counts: Vec<usize>,
    places: Vec<Range<usize>>,
    kappa: Vec<f64>,
}

/// The steps of one set of gains that are solved in several segments at a time.
#[derive(Debug)]
struct Parallel<const N: usize, const MODEL: usize> {
    set: usize,
    gains: Fixed<N, MODEL>,
    cut: Cut<N>,
    n_blocks: usize,
}

impl<const N: usize, const G: usize, const MODEL: usize> Single<N, G, MODEL> {
    fn new(gains: &Gains, channels: &Channels, instructions: Instructions) -> Self {
        let steps = Steps::new(gains, STEP);
        let mut counts: Vec<usize> = (0..steps.n_sets()).map(|set| steps.set(set).0).collect();
        let settled = Steps::settled(gains, lane_step::STEP);
        let longest = (0..counts.len()).max_by_key(|set| counts[*set]);
        let parallel = settled.zip(longest).and_then(|(settled, set)| {
            let gains = Fixed::new(settled.set(0).1, settled.sizes());
            let cut = Cut::new(&gains, counts[set] * STEP)?;
            // The steps left over from the segments come last, where the costate is exact.
            let n_blocks = counts[set] * STEP / cut.block();
            counts[set] -= n_blocks * cut.block() / STEP;
            Some(Parallel { set, gains, cut, n_blocks })
        });
        let mut n_kappa = 0;
        let places = counts.iter().map(|count| {
            let first = n_kappa;
            n_kappa += count * STEP;
            first..n_kappa
        });
        let places = places.collect();
        let alone = Alone { steps, counts, places, kappa: vec![0.0; n_kappa] };
        Self { alone, parallel, channels: channels.clone(), instructions }
    }

    /// Solves with (`HELD`) or without a weight of the input.
    #[inline(always)]
    fn sweep<const HELD: bool>(&mut self, wide: impl Wide, run: &mut Run) {
        let Self { alone, parallel, channels, .. } = self;
        let (n_steps, n_sets) = (alone.steps.n_steps(), alone.counts.len());
        let signals = Signals::new(channels, &alone.steps, run);
        let n_last = parallel.as_ref().map_or(n_sets, |parallel| parallel.set + 1);
        let (costate, last) = alone.backward(wide, 0..n_last, n_steps, [0.0; N], &signals, run);
        let mut state = [0.0; N];
        if let Some(Parallel { gains, cut, n_blocks, .. }) = parallel {
            let first = last - *n_blocks * cut.block() / STEP;
            for block in 0..*n_blocks {
                let exact = (block + 1 == *n_blocks).then_some(costate);
                let at = Place::new(channels, first * STEP + block * cut.block());
                state = cut.solve::<HELD, MODEL>(wide, gains, at, run, exact, |run, costate| {
                    if block > 0 {
                        return state;
                    }
                    alone.backward(wide, n_last..n_sets, first, costate, &signals, run);
                    alone.forward(wide, n_last..n_sets, 0, [0.0; N], &signals, run)
                });
            }
        }
        alone.forward(wide, 0..n_last, last, state, &signals, run);
    }
}

impl<const N: usize, const G: usize> Alone<N, G> {
    /// Sweeps backward over some sets that end at step `end`, and returns the costate and the step
    /// at their start.
    #[inline(always)]
    fn backward(
        &mut self,
        wide: impl Wide,
        sets: Range<usize>,
        mut end: usize,
        mut costate: [f64; N],
        signals: &Signals<STEP>,
        run: &Run,
    ) -> ([f64; N], usize) {
        for set in sets {
            let steps = end - self.counts[set]..end;
            end = steps.start;
            let (_, gains) = self.steps.set(set);
            let kappa = &mut self.kappa[self.places[set].clone()];
            fixed::backward::<N, STEP, G>(wide, gains, signals, run, &mut costate, steps, kappa);
        }
        (costate, end)
    }

    /// Sweeps forward over some sets that begin at step `begin`, and returns the state at their end.
    #[inline(always)]
    fn forward(
        &self,
        wide: impl Wide,
        sets: Range<usize>,
        mut begin: usize,
        mut state: [f64; N],
        signals: &Signals<STEP>,
        run: &mut Run,
    ) -> [f64; N] {
        for set in sets.rev() {
            let steps = begin..begin + self.counts[set];
            begin = steps.end;
            let (_, gains) = self.steps.set(set);
            let kappa = &self.kappa[self.places[set].clone()];
            fixed::forward::<N, STEP, G>(wide, gains, signals, run, &mut state, steps, kappa);
        }
        state
    }
}

/// A solver with the run to solve.
struct Solve<'a, 'r, const N: usize, const G: usize, const MODEL: usize>(
    &'a mut Single<N, G, MODEL>,
    &'a mut Run<'r>,
);

impl<const N: usize, const G: usize, const MODEL: usize> Work for Solve<'_, '_, N, G, MODEL> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Self(single, run) = self;
        if single.alone.steps.sizes().held > 0 {
            single.sweep::<true>(wide, run);
        } else {
            single.sweep::<false>(wide, run);
        }
    }
}

impl<const N: usize, const G: usize, const MODEL: usize> Sweep for Single<N, G, MODEL> {
    fn solve(&mut self, run: &mut Run) {
        self.instructions.run(Solve(self, run));
    }
}

#[cfg(test)]
mod tests {
    use super::super::{General, Rate, Stage, Stages};
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
                let axis = axis(n, s, n_samples);
                let gains = Gains::new(&axis, 0).unwrap();
                let rate = Rate { inner: axis, weight: 0.5 };
                let rated = (n < MAX_STATES).then(|| Gains::new(&rate, 0).unwrap());
                for (gains, width) in [Some(gains), rated].iter().flatten().zip([1, 2]) {
                    agree(gains, n_samples, width);
                    agree(gains, n_samples, 3 - width);
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
                let channels = Channels { inputs: vec![0], outputs: vec![0], shifts: vec![1] };
                let how = Instructions::best();
                let solver = Single::<2, { rows(2, STEP) / HALF }, 2>::new(&gains, &channels, how);
                let is_carried = solver.parallel.is_some_and(|parallel| parallel.cut.carries());
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
        let plain = solve(&mut General::by_sample(gains, channels));
        let scale = plain.iter().fold(1.0_f64, |scale, value| scale.max(value.abs()));
        for (k, (quick, plain)) in quick.iter().zip(&plain).enumerate() {
            let told = format!("{told}, at {k}: {quick} and {plain}");
            assert!((quick - plain).abs() <= 1e-14 * scale, "{told}");
        }
    }
}
