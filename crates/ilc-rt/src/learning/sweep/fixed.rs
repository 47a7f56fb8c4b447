//! The two sweeps for sizes known at compile time: everything but the gains stays in registers.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use std::ops::Range;

use super::record::{Record, Sizes};
use super::steps::{Steps, below, rows};
use super::wide::{HALF, Instructions, Wide, Work};
use super::{Channels, Run};

/// Solves if the sizes and the processor are supported; otherwise leaves everything unchanged and returns `false`.
pub(super) fn solve(steps: &Steps, channels: &Channels, kappa: &mut [f64], run: &mut Run) -> bool {
    let Sizes { n, m, targets, .. } = steps.sizes();
    macro_rules! choose {
        ($($m:literal: $($n:literal)*;)*) => {
            match (n, m, targets) {
                $($(($n, $m, $m) => {
                    let sweep = Sweep::<$n, $m, { rows($n, $m) / HALF }> { steps, channels, kappa, run };
                    Instructions::best().run_if_usual(sweep).is_some()
                })*)*
                _ => false,
            }
        };
    }
    // One, two, three, four and six axes by 8, 4, 3, 2 and 2 samples.
    choose!(
        8: 1 2 3 4 5 6 7 8 9 10 11 12 16;
        9: 3 4 5 6 7 8 9 12;
        12: 12;
    )
}

/// Sweeps over `N` states, and `M` inputs and targets; the columns of the gains have `G` halves.
struct Sweep<'a, 'r, const N: usize, const M: usize, const G: usize> {
    steps: &'a Steps,
    channels: &'a Channels,
    kappa: &'a mut [f64],
    run: &'a mut Run<'r>,
}

impl<const N: usize, const M: usize, const G: usize> Work for Sweep<'_, '_, N, M, G> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Self { steps, channels, kappa, run } = self;
        let signals = Signals::<M>::new(channels, steps, run);
        let width = below(M);
        let mut costate = [0.0; N];
        let mut end = steps.n_steps();
        for place in 0..steps.n_sets() {
            let (count, gains) = steps.set(place);
            let these = end - count..end;
            end = these.start;
            let kappa = &mut kappa[these.start * width..these.end * width];
            backward::<N, M, G>(wide, gains, &signals, run, &mut costate, these, kappa);
        }
        let mut state = [0.0; N];
        for place in (0..steps.n_sets()).rev() {
            let (count, gains) = steps.set(place);
            let these = end..end + count;
            end = these.end;
            let kappa = &kappa[these.start * width..these.end * width];
            forward::<N, M, G>(wide, gains, &signals, run, &mut state, these, kappa);
        }
    }
}

/// Places of the `M` inputs and targets of a step in a run's signals.
pub(super) struct Signals<const M: usize> {
    is_held: bool,
    inputs: Places<M>,
    outputs: Places<M>,
}

/// Places in one signal.
struct Places<const M: usize> {
    /// Those of the first step.
    first: [usize; M],
    /// Numbers from step to step.
    next: usize,
    /// True if they follow each other.
    are_adjacent: bool,
}

impl<const M: usize> Signals<M> {
    #[inline(always)]
    pub(super) fn new(channels: &Channels, steps: &Steps, run: &Run) -> Self {
        let Channels { inputs, outputs, shifts } = channels;
        let (samples, count) = (steps.samples(), M / steps.samples());
        let (n_inputs, n_outputs) = (run.n_inputs, run.n_outputs);
        let output = |i| (i / count + shifts[i % count]) * n_outputs + outputs[i % count];
        Self {
            is_held: steps.sizes().held > 0,
            inputs: Places::new(|i| i / count * n_inputs + inputs[i % count], samples * n_inputs),
            outputs: Places::new(output, samples * n_outputs),
        }
    }
}

impl<const M: usize> Places<M> {
    fn new(place: impl Fn(usize) -> usize, next: usize) -> Self {
        let first = std::array::from_fn(place);
        Self { first, next, are_adjacent: first.windows(2).all(|pair| pair[0] + 1 == pair[1]) }
    }

    /// Returns the values of a step; zeros beyond the end of the run, where the weight is zero.
    #[inline(always)]
    fn load(&self, signal: &[f64], step: usize) -> [f64; M] {
        let from = signal.get(step * self.next..).unwrap_or_default();
        if self.are_adjacent
            && let Some(values) = from.get(self.first[0]..).and_then(<[f64]>::first_chunk)
        {
            return *values;
        }
        let mut values = [0.0; M];
        for (value, place) in values.iter_mut().zip(self.first) {
            *value = from.get(place).copied().unwrap_or_default();
        }
        values
    }

    /// Writes the inputs of a step, as far as the run goes.
    #[inline(always)]
    fn store(&self, run: &mut Run, step: usize, change: [f64; M]) {
        let (input, next) = (&run.input[step * self.next..], &mut run.next[step * self.next..]);
        let first = self.first[0];
        if self.are_adjacent
            && let Some(input) = input.get(first..).and_then(<[f64]>::first_chunk::<M>)
            && let Some(next) = next.get_mut(first..).and_then(<[f64]>::first_chunk_mut::<M>)
        {
            for ((next, input), change) in next.iter_mut().zip(input).zip(change) {
                *next = input + change;
            }
            return;
        }
        for (place, change) in self.first.iter().zip(change) {
            if let (Some(input), Some(next)) = (input.get(*place), next.get_mut(*place)) {
                *next = input + change;
            }
        }
    }
}

/// Sweeps backward over some steps of the same gains, and writes their `kappa`, for these steps alone.
#[inline(always)]
pub(super) fn backward<const N: usize, const M: usize, const G: usize>(
    wide: impl Wide,
    gains: Record,
    signals: &Signals<M>,
    run: &Run,
    costate: &mut [f64; N],
    steps: Range<usize>,
    kappa: &mut [f64],
) {
    let columns = gains.back.as_chunks::<HALF>().0.as_chunks::<G>().0;
    let Some((from_costate, fresh)) = columns.split_first_chunk::<N>() else { return };
    let Some((from_error, from_input)) = fresh.split_first_chunk::<M>() else { return };
    let kappa = kappa.as_chunks_mut::<HALF>().0;
    let halves = G - below(N) / HALF;
    for (i, step) in steps.enumerate().rev() {
        // The terms that do not wait for the previous step come first.
        let mut sum = [wide.half(&[0.0; HALF]); G];
        for (value, column) in signals.outputs.load(run.error, step).iter().zip(from_error) {
            add(wide, &mut sum, *value, column);
        }
        if signals.is_held {
            for (value, column) in signals.inputs.load(run.input, step).iter().zip(from_input) {
                add(wide, &mut sum, *value, column);
            }
        }
        for (value, column) in costate.iter().zip(from_costate) {
            add(wide, &mut sum, *value, column);
        }
        read(wide, &sum, 0, costate);
        for (kappa, half) in kappa[i * halves..].iter_mut().zip(&sum[G - halves..]) {
            *kappa = wide.half_values(*half);
        }
    }
}

/// Sweeps forward over some steps of the same gains, and writes their inputs.
#[inline(always)]
pub(super) fn forward<const N: usize, const M: usize, const G: usize>(
    wide: impl Wide,
    gains: Record,
    signals: &Signals<M>,
    run: &mut Run,
    state: &mut [f64; N],
    steps: Range<usize>,
    kappa: &[f64],
) {
    let columns = gains.fore.as_chunks::<HALF>().0.as_chunks::<G>().0;
    let Some((from_state, from_kappa)) = columns.split_first_chunk::<N>() else { return };
    let Some(from_kappa) = from_kappa.first_chunk::<M>() else { return };
    let kappa = kappa.as_chunks::<HALF>().0;
    let halves = G - below(N) / HALF;
    for (i, step) in steps.enumerate() {
        let kappa = &kappa[i * halves..][..halves];
        let mut sum = [wide.half(&[0.0; HALF]); G];
        for (half, kappa) in sum[G - halves..].iter_mut().zip(kappa) {
            *half = wide.half(kappa);
        }
        for (value, column) in kappa.as_flattened().iter().zip(from_kappa) {
            add(wide, &mut sum, *value, column);
        }
        for (value, column) in state.iter().zip(from_state) {
            add(wide, &mut sum, *value, column);
        }
        read(wide, &sum, 0, state);
        let mut change = [0.0; M];
        read(wide, &sum, G - halves, &mut change);
        signals.inputs.store(run, step, change);
    }
}

/// Adds a multiple of a column.
#[inline(always)]
fn add<W: Wide, const G: usize>(
    wide: W,
    sum: &mut [W::Half; G],
    factor: f64,
    column: &[[f64; HALF]; G],
) {
    for (sum, column) in sum.iter_mut().zip(column) {
        *sum = wide.add_half(*sum, factor, wide.half(column));
    }
}

/// Reads the rows from that half on.
#[inline(always)]
fn read<W: Wide, const G: usize, const C: usize>(
    wide: W,
    sum: &[W::Half; G],
    first: usize,
    to: &mut [f64; C],
) {
    for (to, half) in to.chunks_mut(HALF).zip(&sum[first..]) {
        to.copy_from_slice(&wide.half_values(*half)[..to.len()]);
    }
}
