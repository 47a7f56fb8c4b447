//! One step of a state-space model, from the entries of its matrices that are not zero: axes side by
//! side and delays are mostly zeros. For simulations in the model and its lifted operator.

use nalgebra::DMatrix;

/// The model at work on signals, with its state.
///
/// Sums run along a row from its first column, so that zeros change no bit of them.
///
/// # Real Time
/// Cold path. Allocates at creation, never in [`Stepper::step`].
#[derive(Debug, Clone)]
pub(crate) struct Stepper {
    /// `[A B]` and `[C D]`.
    moves: Rows,
    shows: Rows,
    /// `[x; u]` of this sample, and of the next one.
    now: Vec<f64>,
    next: Vec<f64>,
    n_states: usize,
}

impl Stepper {
    /// Creates it at rest, of the model's `A`, `B`, `C`, `D`.
    pub(crate) fn new([a, b, c, d]: [&DMatrix<f64>; 4]) -> Self {
        let now = vec![0.0; b.nrows() + b.ncols()];
        let (moves, shows) = (Rows::new(a, b), Rows::new(c, d));
        Self { moves, shows, next: now.clone(), now, n_states: b.nrows() }
    }

    /// Sets the state: `n_states` numbers, or zero.
    pub(crate) fn start(&mut self, x0: Option<&[f64]>) {
        let state = &mut self.now[..self.n_states];
        match x0 {
            Some(x0) => state.copy_from_slice(x0),
            None => state.fill(0.0),
        }
    }

    /// `y = C x + D u`, then `x = A x + B u`.
    pub(crate) fn step(&mut self, u: &[f64], y: &mut [f64]) {
        self.now[self.n_states..].copy_from_slice(u);
        self.shows.multiply(&self.now, y);
        self.moves.multiply(&self.now, &mut self.next);
        std::mem::swap(&mut self.now, &mut self.next);
    }
}

/// The entries of a matrix that are not zero, row by row.
#[derive(Debug, Clone)]
struct Rows {
    /// Number of entries in each row.
    counts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl Rows {
    /// Of two matrices side by side.
    fn new(left: &DMatrix<f64>, right: &DMatrix<f64>) -> Self {
        let mut rows = Self { counts: Vec::new(), entries: Vec::new() };
        for row in 0..left.nrows() {
            let n_before = rows.entries.len();
            let (left, right) = (left.row(row), right.row(row));
            let both = left.iter().chain(right.iter()).copied().enumerate();
            rows.entries.extend(both.filter(|(_, value)| *value != 0.0));
            rows.counts.push(rows.entries.len() - n_before);
        }
        rows
    }

    fn multiply(&self, vector: &[f64], out: &mut [f64]) {
        let mut rest = &self.entries[..];
        for (count, out) in self.counts.iter().zip(out) {
            let (row, after) = rest.split_at(*count);
            *out = row.iter().fold(0.0, |sum, (column, value)| sum + value * vector[*column]);
            rest = after;
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn every_bit_is_that_of_whole_matrices(
            values in prop::collection::vec(-1.0..1.0_f64, 61),
            gaps in prop::collection::vec(0_usize..3, 37),
            [n, m, p] in [0_usize..12, 1..4, 1..4],
        ) {
            let mut given = values.iter().zip(gaps.iter().cycle()).cycle();
            let mut matrix = |rows, columns| {
                DMatrix::from_fn(rows, columns, |_, _| match given.next().unwrap() {
                    (value, 0) => *value,
                    _ => 0.0,
                })
            };
            let (a, b, c, d) = (matrix(n, n) * 0.4, matrix(n, m), matrix(p, n), matrix(p, m));
            let mut stepper = Stepper::new([&a, &b, &c, &d]);
            let mut x = DVector::from_fn(n, |i, _| values[i]);
            stepper.start(Some(x.as_slice()));
            let mut y = vec![0.0; p];
            for k in 0..30 {
                let u = DVector::from_fn(m, |i, _| values[(k * m + i) % 61]);
                stepper.step(u.as_slice(), &mut y);
                let mut expected = &c * &x;
                expected.gemv(1.0, &d, &u, 1.0);
                prop_assert_eq!(&y[..], expected.as_slice());
                x = &a * x;
                x.gemv(1.0, &b, &u, 1.0);
            }
        }
    }
}
