//! Cholesky factor of a small matrix that may be singular.

use nalgebra::DMatrix;

/// Below this part of a diagonal entry, what is left of it after elimination is rounding.
const VANISHED: f64 = 1e-13;

/// `H = L L'` for a positive semidefinite `H`.
///
/// A direction in which `H` vanishes costs nothing, so its share of every solution is set to zero:
/// of all minimisers this is one, and the one that leaves that input as it was.
pub(super) struct Cholesky {
    lower: DMatrix<f64>,
    vanished: bool,
}

impl Cholesky {
    pub(super) fn new(h: &DMatrix<f64>) -> Self {
        let m = h.nrows();
        let mut lower = DMatrix::zeros(m, m);
        let mut vanished = false;
        for j in 0..m {
            let pivot = h[(j, j)] - (0..j).map(|i| lower[(j, i)] * lower[(j, i)]).sum::<f64>();
            if pivot <= VANISHED * h[(j, j)] || pivot <= 0.0 {
                vanished = true;
                continue;
            }
            let root = f64::sqrt(pivot);
            lower[(j, j)] = root;
            for row in j + 1..m {
                let known: f64 = (0..j).map(|i| lower[(row, i)] * lower[(j, i)]).sum();
                lower[(row, j)] = (h[(row, j)] - known) / root;
            }
        }
        Self { lower, vanished }
    }

    /// Returns whether some direction vanished.
    pub(super) fn vanished(&self) -> bool {
        self.vanished
    }

    /// Returns `H^-1 right`, zero in the directions that vanished.
    pub(super) fn solve(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let m = self.lower.nrows();
        let mut solution = right.clone();
        for col in 0..right.ncols() {
            for row in 0..m {
                let pivot = self.lower[(row, row)];
                let known: f64 = (0..row).map(|i| self.lower[(row, i)] * solution[(i, col)]).sum();
                solution[(row, col)] =
                    if pivot > 0.0 { (solution[(row, col)] - known) / pivot } else { 0.0 };
            }
            for row in (0..m).rev() {
                let pivot = self.lower[(row, row)];
                let known: f64 =
                    (row + 1..m).map(|i| self.lower[(i, row)] * solution[(i, col)]).sum();
                solution[(row, col)] =
                    if pivot > 0.0 { (solution[(row, col)] - known) / pivot } else { 0.0 };
            }
        }
        solution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_system_is_solved() {
        let h = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 3.0]);
        let factor = Cholesky::new(&h);
        let found = factor.solve(&DMatrix::from_row_slice(2, 1, &[8.0, 8.0]));
        assert!(!factor.vanished());
        assert!((found[(0, 0)] - 1.0).abs() < 1e-14 && (found[(1, 0)] - 2.0).abs() < 1e-14);
    }

    #[test]
    fn a_singular_system_leaves_the_free_direction_alone() {
        let h = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 1.0]);
        let factor = Cholesky::new(&h);
        let found = factor.solve(&DMatrix::from_row_slice(2, 1, &[8.0, 4.0]));
        assert!(factor.vanished());
        assert!((found[(0, 0)] - 2.0).abs() < 1e-14 && found[(1, 0)].abs() < 1e-14);
    }
}
