//! The two sweeps for sizes known at compile time: everything but the gains stays in registers.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::factor::Gains;
use super::record::Sizes;
use super::wide::{Instructions, Wide, Work};
use super::{Channels, Run};

/// Solves if the sizes and the processor are supported; otherwise leaves everything unchanged and returns `false`.
pub(super) fn solve(gains: &Gains, channels: &Channels, kappa: &mut [f64], run: &mut Run) -> bool {
    let Sizes { n, m, targets, .. } = gains.sizes();
    macro_rules! choose {
        ($($m:literal: $($n:literal)*;)*) => {
            match (n, m, targets) {
                $($(($n, $m, $m) => {
                    let sweep = Sweep::<$n, $m, $m, { $n + $m }> { gains, channels, kappa, run };
                    Instructions::best().run_if_usual(sweep).is_some()
                })*)*
                _ => false,
            }
        };
    }
    choose!(
        1: 1 2 3 4 5 6 7 8 9 10 11 12 16;
        2: 1 2 3 4 5 6 7 8 10 12;
        3: 1 2 3 4 5 6 7 8 9 12;
        4: 8 12;
        6: 12;
    )
}

/// Sweeps over `N` states, `M` inputs and `P` targets; the columns of the gains have `R = N + M` rows.
struct Sweep<'a, 'r, const N: usize, const M: usize, const P: usize, const R: usize> {
    gains: &'a Gains,
    channels: &'a Channels,
    kappa: &'a mut [f64],
    run: &'a mut Run<'r>,
}

impl<const N: usize, const M: usize, const P: usize, const R: usize> Work
    for Sweep<'_, '_, N, M, P, R>
{
    type Output = ();

    #[inline(always)]
    fn with(self, _: impl Wide) {
        let Self { gains, channels, kappa, run } = self;
        let is_held = gains.sizes().held > 0;
        let last = gains.n_samples().saturating_sub(1);
        let inputs: [usize; M] = std::array::from_fn(|i| channels.inputs[i]);
        let outputs: [usize; P] = std::array::from_fn(|i| channels.outputs[i]);
        let shifts: [usize; P] = std::array::from_fn(|i| channels.shifts[i]);
        let (kappa, _) = kappa.as_chunks_mut::<M>();

        let mut state = [0.0; N];
        let mut k = gains.n_samples();
        for place in 0..gains.n_stored() {
            let (count, at) = gains.set(place);
            let Some((from_state, fresh)) = at.back.as_chunks::<R>().0.split_first_chunk::<N>()
            else {
                return;
            };
            let Some((from_error, from_input)) = fresh.split_first_chunk::<P>() else { return };
            for _ in 0..count {
                k -= 1;
                let mut sum = [0.0; R];
                for (i, column) in from_error.iter().enumerate() {
                    // Beyond the end of the run the weight is zero: any finite value will do.
                    let sample = (k + shifts[i]).min(last);
                    add(&mut sum, column, run.error[sample * run.n_outputs + outputs[i]]);
                }
                if is_held {
                    for (i, column) in from_input.iter().enumerate() {
                        add(&mut sum, column, run.input[k * run.n_inputs + inputs[i]]);
                    }
                }
                for (value, column) in state.iter().zip(from_state) {
                    add(&mut sum, column, *value);
                }
                state = std::array::from_fn(|i| sum[i]);
                kappa[k] = std::array::from_fn(|i| sum[N + i]);
            }
        }

        let mut state = [0.0; N];
        for place in (0..gains.n_stored()).rev() {
            let (count, at) = gains.set(place);
            let (from_state, from_drive) = at.fore.split_at(N * R);
            let Some(from_state) = from_state.as_chunks::<R>().0.first_chunk::<N>() else { return };
            let Some(from_drive) = from_drive.as_chunks::<N>().0.first_chunk::<M>() else { return };
            for _ in 0..count {
                let drive = kappa[k];
                let mut later = [0.0; N];
                for (value, column) in drive.iter().zip(from_drive) {
                    add(&mut later, column, *value);
                }
                let mut sum: [f64; R] =
                    std::array::from_fn(|i| if i < N { later[i] } else { drive[i - N] });
                for (value, column) in state.iter().zip(from_state) {
                    add(&mut sum, column, *value);
                }
                state = std::array::from_fn(|i| sum[i]);
                for i in 0..M {
                    let index = k * run.n_inputs + inputs[i];
                    run.next[index] = run.input[index] + sum[N + i];
                }
                k += 1;
            }
        }
    }
}

/// Adds a multiple of a column.
#[inline(always)]
fn add<const R: usize>(sum: &mut [f64; R], column: &[f64; R], factor: f64) {
    for (sum, value) in sum.iter_mut().zip(column) {
        *sum += value * factor;
    }
}
