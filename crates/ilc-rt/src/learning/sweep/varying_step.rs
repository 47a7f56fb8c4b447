//! One sample of the two sweeps with gains of its own, eight segments side by side. For
//! [`super::varying`] only.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "compiled anew for the instructions of each processor, which closures are not"
)]

use std::ops::Range;

use nalgebra::DMatrix;

use super::Stage;
use super::wide::{LANES, Wide};

/// The part that all samples share: a model of `N` states, `M` inputs and as many targets.
///
/// If it is `APART`, each input and target has `N / M` states of its own, and only the weights
/// couple them.
#[derive(Debug, Clone)]
pub(super) struct Model<const N: usize, const M: usize, const APART: bool> {
    /// Row by row.
    a: [[f64; N]; N],
    b: [[f64; M]; N],
    c: [[f64; N]; M],
    d: [[f64; M]; M],
}

impl<const N: usize, const M: usize, const APART: bool> Model<N, M, APART> {
    /// Reads the model of a stage.
    pub(super) fn new(stage: &Stage) -> Self {
        Self { a: matrix(&stage.a), b: matrix(&stage.b), c: matrix(&stage.c), d: matrix(&stage.d) }
    }

    /// Returns the states that an input moves and a target shows.
    #[inline(always)]
    fn states(axis: usize) -> Range<usize> {
        if APART { axis * (N / M)..(axis + 1) * (N / M) } else { 0..N }
    }

    /// Returns the states that affect a state.
    #[inline(always)]
    fn neighbours(state: usize) -> Range<usize> {
        if APART { Self::states(state / (N / M)) } else { 0..N }
    }

    /// Returns the inputs and targets of a state.
    #[inline(always)]
    fn axes(state: usize) -> Range<usize> {
        if APART { state / (N / M)..state / (N / M) + 1 } else { 0..M }
    }

    /// Returns the inputs that a target shows at once.
    #[inline(always)]
    fn inputs(target: usize) -> Range<usize> {
        if APART { target..target + 1 } else { 0..M }
    }
}

/// Returns true if each input and target has equally many states of its own, in their order.
pub(super) fn is_apart(stage: &Stage) -> bool {
    let (n, m) = (stage.n_states(), stage.n_inputs());
    if m == 0 || !n.is_multiple_of(m) {
        return false;
    }
    let of_state = |state: usize| state / (n / m).max(1);
    let of_axis = |axis: usize| axis;
    let apart =
        |matrix: &DMatrix<f64>, row: &dyn Fn(usize) -> usize, col: &dyn Fn(usize) -> usize| {
            (0..matrix.ncols())
                .all(|j| (0..matrix.nrows()).all(|i| row(i) == col(j) || matrix[(i, j)] == 0.0))
        };
    apart(&stage.a, &of_state, &of_state)
        && apart(&stage.b, &of_state, &of_axis)
        && apart(&stage.c, &of_axis, &of_state)
        && apart(&stage.d, &of_axis, &of_axis)
}

/// Returns the first rows of a matrix.
fn matrix<const R: usize, const C: usize>(from: &DMatrix<f64>) -> [[f64; C]; R] {
    std::array::from_fn(|row| std::array::from_fn(|col| from[(row, col)]))
}

/// The gains and weights of one sample, each entry for eight segments.
#[derive(Clone, Copy)]
pub(super) struct Entries<'a, const N: usize, const M: usize> {
    /// `-K`.
    feedback: &'a [[[f64; LANES]; N]; M],
    /// `H^-1`.
    inverse: &'a [[[f64; LANES]; M]; M],
    /// `Q` of the targets, which no problem couples to its penalties.
    weight: &'a [[[f64; LANES]; M]; M],
    /// `-S`, if there is any.
    held: Option<&'a [[[f64; LANES]; M]; M]>,
}

impl<'a, const N: usize, const M: usize> Entries<'a, N, M> {
    /// Returns the number of entries.
    pub(super) const fn count(is_held: bool) -> usize {
        M * (N + if is_held { 3 * M } else { 2 * M })
    }

    /// Reads the entries in the order of the fields; `None` if there are fewer.
    #[inline(always)]
    pub(super) fn new(rows: &'a [[f64; LANES]]) -> Option<Self> {
        let (feedback, rest) = rows.split_at_checked(M * N)?;
        let mut matrices = rest.as_chunks::<M>().0.as_chunks::<M>().0.iter();
        let feedback = feedback.as_chunks::<N>().0.first_chunk()?;
        let (inverse, weight) = (matrices.next()?, matrices.next()?);
        Some(Self { feedback, inverse, weight, held: matrices.next() })
    }
}

/// Goes back one sample and returns its `kappa`.
///
/// `t = B'p_{k+1} + D'Q e - S u`, `kappa = H^-1 t`, `p_k = A'p_{k+1} + C'Q e - K't`.
#[inline(always)]
pub(super) fn backward<const N: usize, const M: usize, const APART: bool, W: Wide>(
    wide: W,
    model: &Model<N, M, APART>,
    entries: Entries<N, M>,
    costate: &mut [W::Row; N],
    error: &[W::Row; M],
    input: &[W::Row; M],
) -> [W::Row; M] {
    let weighted = product(wide, entries.weight, error);
    let mut drive = weighted;
    for i in 0..M {
        let Range { start: first, end } = Model::<N, M, APART>::inputs(i);
        drive[i] = wide.scale(model.d[first][i], weighted[first]);
        for target in first + 1..end {
            drive[i] = wide.add(drive[i], wide.scale(model.d[target][i], weighted[target]));
        }
    }
    if let Some(held) = entries.held {
        let held = product(wide, held, input);
        for i in 0..M {
            drive[i] = wide.add(drive[i], held[i]);
        }
    }
    for i in 0..M {
        for state in Model::<N, M, APART>::states(i) {
            drive[i] = wide.add(drive[i], wide.scale(model.b[state][i], costate[state]));
        }
    }
    let mut earlier = *costate;
    for j in 0..N {
        let Range { start: first, end } = Model::<N, M, APART>::axes(j);
        earlier[j] = wide.scale(model.c[first][j], weighted[first]);
        for target in first + 1..end {
            earlier[j] = wide.add(earlier[j], wide.scale(model.c[target][j], weighted[target]));
        }
        for state in Model::<N, M, APART>::neighbours(j) {
            earlier[j] = wide.add(earlier[j], wide.scale(model.a[state][j], costate[state]));
        }
        for i in 0..M {
            let feedback = wide.row(&entries.feedback[i][j]);
            earlier[j] = wide.add(earlier[j], wide.multiply(feedback, drive[i]));
        }
    }
    *costate = earlier;
    product(wide, entries.inverse, &drive)
}

/// Goes on one sample and returns the change of the input.
///
/// `v = kappa - K x_k`, `x_{k+1} = A x_k + B v`.
#[inline(always)]
pub(super) fn forward<const N: usize, const M: usize, const APART: bool, W: Wide>(
    wide: W,
    model: &Model<N, M, APART>,
    entries: Entries<N, M>,
    state: &mut [W::Row; N],
    kappa: &[W::Row; M],
) -> [W::Row; M] {
    let mut change = *kappa;
    for i in 0..M {
        for j in 0..N {
            let feedback = wide.row(&entries.feedback[i][j]);
            change[i] = wide.add(change[i], wide.multiply(feedback, state[j]));
        }
    }
    let mut later = *state;
    for i in 0..N {
        let Range { start: first, end } = Model::<N, M, APART>::neighbours(i);
        later[i] = wide.scale(model.a[i][first], state[first]);
        for j in first + 1..end {
            later[i] = wide.add(later[i], wide.scale(model.a[i][j], state[j]));
        }
        for axis in Model::<N, M, APART>::axes(i) {
            later[i] = wide.add(later[i], wide.scale(model.b[i][axis], change[axis]));
        }
    }
    *state = later;
    change
}

/// Returns a matrix times a vector.
#[inline(always)]
fn product<const M: usize, W: Wide>(
    wide: W,
    matrix: &[[[f64; LANES]; M]; M],
    vector: &[W::Row; M],
) -> [W::Row; M] {
    let mut result = *vector;
    for i in 0..M {
        result[i] = wide.multiply(wide.row(&matrix[i][0]), vector[0]);
        for j in 1..M {
            result[i] = wide.add(result[i], wide.multiply(wide.row(&matrix[i][j]), vector[j]));
        }
    }
    result
}
