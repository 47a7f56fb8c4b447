//! One step of the two sweeps for one axis, eight segments side by side. For [`super::lanes`] only.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "compiled anew for the instructions of each processor, which closures are not"
)]

use super::record::{Record, Sizes};
use super::steps::{below, rows};
use super::wide::Wide;

/// Remainder of a state after the warm-up.
pub(super) const FORGOTTEN: f64 = 1e-18;
/// Largest remainder of a state after a whole segment: rounding errors must fade from cut to cut.
const FADED: f64 = 0.1;

/// Samples per step: more do not stay in registers.
pub(super) const STEP: usize = 2;

/// The gains of a step, with sizes known at compile time, row by row.
///
/// The states from `MODEL` on are the last change of the input ([`super::Rate`]): one, or none. Its row
/// of the forward sweep is the change once more, and its row of the backward one is that of `kappa`
/// times a number, as nothing but the feedback `f` from it depends on it: `p_k = -f H kappa_k`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fixed<const N: usize, const MODEL: usize> {
    /// Of the costate, in this order: from itself, from error and input.
    costate: [[f64; N]; N],
    from_error: [[f64; STEP]; N],
    from_input: [[f64; STEP]; N],
    /// Of `kappa`, which no earlier sample affects.
    kappa: [[f64; N]; STEP],
    kappa_from_error: [[f64; STEP]; STEP],
    kappa_from_input: [[f64; STEP]; STEP],
    /// Of the state and of the change, from the state and from `kappa`, of which no later sample
    /// affects the change.
    state: [[f64; N]; N],
    from_kappa: [[f64; STEP]; N],
    change: [[f64; N]; STEP],
    change_from_kappa: [[f64; STEP]; STEP],
    /// `-f H`.
    last: f64,
}

impl<const N: usize, const MODEL: usize> Fixed<N, MODEL> {
    /// Reads the gains of a step of one input and one target.
    pub(super) fn new(record: Record, sizes: Sizes) -> Self {
        let rows = rows(N, STEP);
        let back = |row: usize, col: usize| record.back[col * rows + row];
        let fore = |row: usize, col: usize| record.fore[col * rows + row];
        let input = |row: usize, s: usize| {
            if sizes.held > 0 { back(row, N + STEP + s) } else { 0.0 }
        };
        // The quotient of these rows wherever it is most exact.
        let columns = || (0..N + STEP).map(|col| (back(N - 1, col), back(below(N), col)));
        let (change, kappa) =
            columns().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or_default();
        Self {
            last: if kappa == 0.0 { 0.0 } else { change / kappa },
            costate: matrix(back),
            from_error: matrix(|i, s| back(i, N + s)),
            from_input: matrix(input),
            kappa: matrix(|s, j| back(below(N) + s, j)),
            kappa_from_error: matrix(|s, from| back(below(N) + s, N + from)),
            kappa_from_input: matrix(|s, from| input(below(N) + s, from)),
            state: matrix(fore),
            from_kappa: matrix(|i, s| fore(i, N + s)),
            change: matrix(|s, j| fore(below(N) + s, j)),
            change_from_kappa: matrix(|s, from| fore(below(N) + s, N + from)),
        }
    }
}

/// Returns a matrix, row by row.
fn matrix<const R: usize, const C: usize>(entry: impl Fn(usize, usize) -> f64) -> [[f64; C]; R] {
    std::array::from_fn(|row| std::array::from_fn(|col| entry(row, col)))
}

/// Goes back one step and returns its `kappa`.
#[inline(always)]
pub(super) fn backward<const HELD: bool, const N: usize, const MODEL: usize, W: Wide>(
    wide: W,
    gains: &Fixed<N, MODEL>,
    costate: &mut [W::Row; N],
    input: &[W::Row; STEP],
    error: &[W::Row; STEP],
) -> [W::Row; STEP] {
    // Column by column: the processor has many sums under way, and those that do not wait for the
    // previous step come first.
    let mut earlier = *costate;
    let mut kappa = *error;
    for i in 0..MODEL {
        earlier[i] = wide.scale(gains.from_error[i][0], error[0]);
    }
    for s in 0..STEP {
        kappa[s] = wide.scale(gains.kappa_from_error[s][s], error[s]);
    }
    for from in 1..STEP {
        for i in 0..MODEL {
            earlier[i] = wide.add(earlier[i], wide.scale(gains.from_error[i][from], error[from]));
        }
        for s in 0..from {
            kappa[s] = wide.add(kappa[s], wide.scale(gains.kappa_from_error[s][from], error[from]));
        }
    }
    if HELD {
        for from in 0..STEP {
            for i in 0..MODEL {
                earlier[i] =
                    wide.add(earlier[i], wide.scale(gains.from_input[i][from], input[from]));
            }
            for s in 0..=from {
                kappa[s] =
                    wide.add(kappa[s], wide.scale(gains.kappa_from_input[s][from], input[from]));
            }
        }
    }
    for j in 0..N {
        for s in 0..STEP {
            kappa[s] = wide.add(kappa[s], wide.scale(gains.kappa[s][j], costate[j]));
        }
        for i in 0..MODEL {
            earlier[i] = wide.add(earlier[i], wide.scale(gains.costate[i][j], costate[j]));
        }
    }
    for i in MODEL..N {
        earlier[i] = wide.scale(gains.last, kappa[0]);
    }
    *costate = earlier;
    kappa
}

/// Goes on one step and returns the changes of the input.
#[inline(always)]
pub(super) fn forward<const N: usize, const MODEL: usize, W: Wide>(
    wide: W,
    gains: &Fixed<N, MODEL>,
    state: &mut [W::Row; N],
    kappa: &[W::Row; STEP],
) -> [W::Row; STEP] {
    let mut later = *state;
    let mut change = *kappa;
    for i in 0..MODEL {
        later[i] = wide.scale(gains.from_kappa[i][0], kappa[0]);
    }
    for from in 0..STEP {
        for s in from + 1..STEP {
            change[s] =
                wide.add(change[s], wide.scale(gains.change_from_kappa[s][from], kappa[from]));
        }
        if from > 0 {
            for i in 0..MODEL {
                later[i] = wide.add(later[i], wide.scale(gains.from_kappa[i][from], kappa[from]));
            }
        }
    }
    for j in 0..N {
        for s in 0..STEP {
            change[s] = wide.add(change[s], wide.scale(gains.change[s][j], state[j]));
        }
        for i in 0..MODEL {
            later[i] = wide.add(later[i], wide.scale(gains.state[i][j], state[j]));
        }
    }
    for i in MODEL..N {
        later[i] = change[STEP - 1];
    }
    *state = later;
    change
}

/// Remainder of a state after some time.
pub(super) enum Fade<const N: usize> {
    /// Nothing in double precision, after so many steps.
    Forgotten(usize),
    /// This transition after the whole time.
    To([[f64; N]; N]),
    /// Too much of it.
    Never,
}

impl<const N: usize, const MODEL: usize> Fixed<N, MODEL> {
    /// Returns the remainder of a state after `longest` steps.
    pub(super) fn fade(&self, longest: usize) -> Fade<N> {
        let mut power: [[f64; N]; N] =
            std::array::from_fn(|col| std::array::from_fn(|row| f64::from(u8::from(row == col))));
        // Relative to the largest so far, as the states may have different units.
        let mut largest = 0.0_f64;
        for k in 0..=longest {
            let size = power.iter().flatten().fold(0.0_f64, |size, value| size.max(value.abs()));
            largest = largest.max(size);
            if size < FORGOTTEN * largest {
                return Fade::Forgotten(k);
            }
            if k == longest {
                return if size <= FADED * largest { Fade::To(power) } else { Fade::Never };
            }
            power = std::array::from_fn(|col| {
                std::array::from_fn(|row| (0..N).map(|i| self.state[row][i] * power[col][i]).sum())
            });
        }
        Fade::Never
    }
}
