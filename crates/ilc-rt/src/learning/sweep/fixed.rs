//! The two sweeps for sizes known at compile time: everything but the gains stays in registers.

use super::factor::Gains;
use super::record::Sizes;
use super::{Channels, Run};

/// Solves if the sizes are supported; otherwise leaves everything unchanged and returns `false`.
pub(super) fn solve(gains: &Gains, channels: &Channels, kappa: &mut [f64], run: &mut Run) -> bool {
    let Sizes { n, m, targets, .. } = gains.sizes();
    macro_rules! choose {
        ($($n:literal)*) => {
            match (n, m, targets) {
                $(
                    ($n, 1, 1) => sweep::<$n, 1, 1>(gains, channels, kappa, run),
                    ($n, 2, 2) => sweep::<$n, 2, 2>(gains, channels, kappa, run),
                    ($n, 3, 3) => sweep::<$n, 3, 3>(gains, channels, kappa, run),
                )*
                _ => return false,
            }
        };
    }
    choose!(1 2 3 4 5 6 7 8);
    true
}

fn sweep<const N: usize, const M: usize, const P: usize>(
    gains: &Gains,
    channels: &Channels,
    kappa: &mut [f64],
    run: &mut Run,
) {
    let rows = N + M;
    let is_held = gains.sizes().held > 0;
    let last = gains.n_samples().saturating_sub(1);
    let inputs: [usize; M] = std::array::from_fn(|i| channels.inputs[i]);
    let outputs: [usize; P] = std::array::from_fn(|i| channels.outputs[i]);
    let shifts: [usize; P] = std::array::from_fn(|i| channels.shifts[i]);

    let mut state = [0.0; N];
    let mut k = gains.n_samples();
    for place in 0..gains.n_stored() {
        let (count, at) = gains.set(place);
        let (from_state, fresh) = at.back.split_at(N * rows);
        for _ in 0..count {
            k -= 1;
            let (mut earlier, mut drive) = ([0.0; N], [0.0; M]);
            let mut columns = fresh.chunks_exact(rows);
            for (i, column) in (0..P).zip(columns.by_ref()) {
                // Beyond the end of the run the weight is zero: any finite value will do.
                let sample = (k + shifts[i]).min(last);
                add(
                    &mut earlier,
                    &mut drive,
                    column,
                    run.error[sample * run.n_outputs + outputs[i]],
                );
            }
            if is_held {
                for (i, column) in (0..M).zip(columns) {
                    add(&mut earlier, &mut drive, column, run.input[k * run.n_inputs + inputs[i]]);
                }
            }
            for (value, column) in state.iter().zip(from_state.chunks_exact(rows)) {
                add(&mut earlier, &mut drive, column, *value);
            }
            state = earlier;
            kappa[k * M..(k + 1) * M].copy_from_slice(&drive);
        }
    }

    let mut state = [0.0; N];
    for place in (0..gains.n_stored()).rev() {
        let (count, at) = gains.set(place);
        let (from_state, from_drive) = at.fore.split_at(N * rows);
        for _ in 0..count {
            let drive: [f64; M] = std::array::from_fn(|i| kappa[k * M + i]);
            let (mut later, mut change) = ([0.0; N], drive);
            for (value, column) in drive.iter().zip(from_drive.chunks_exact(N)) {
                for i in 0..N {
                    later[i] += column[i] * value;
                }
            }
            for (value, column) in state.iter().zip(from_state.chunks_exact(rows)) {
                add(&mut later, &mut change, column, *value);
            }
            state = later;
            for i in 0..M {
                let index = k * run.n_inputs + inputs[i];
                run.next[index] = run.input[index] + change[i];
            }
            k += 1;
        }
    }
}

/// Adds a multiple of a column, its first rows to one sum and the others to another.
#[inline]
fn add<const N: usize, const M: usize>(
    first: &mut [f64; N],
    others: &mut [f64; M],
    column: &[f64],
    factor: f64,
) {
    for i in 0..N {
        first[i] += column[i] * factor;
    }
    for i in 0..M {
        others[i] += column[N + i] * factor;
    }
}
