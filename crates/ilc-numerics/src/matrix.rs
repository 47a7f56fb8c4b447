//! Dense matrices of some thousand rows.

use std::ops::{Index, IndexMut};

use faer::linalg::solvers::Solve;
use faer::{ColRef, Mat};

/// A matrix of real numbers; operations on matrices whose shapes do not fit panic.
#[derive(Clone, Debug)]
pub struct Matrix(Mat<f64>);

impl Matrix {
    /// Creates a matrix of zeros.
    pub fn zeros(n_rows: usize, n_columns: usize) -> Self {
        Self(Mat::zeros(n_rows, n_columns))
    }

    /// Creates a square matrix from its columns, one after the other.
    ///
    /// # Panics
    /// If there are not `n * n` numbers.
    pub fn square(n: usize, columns: &[f64]) -> Self {
        assert_eq!(columns.len(), n * n, "numbers of a square matrix");
        Self(Mat::from_fn(n, n, |row, column| columns[column * n + row]))
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.0.nrows()
    }

    /// Number of columns.
    pub fn n_columns(&self) -> usize {
        self.0.ncols()
    }

    /// Returns `A B`.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        Self(&self.0 * &other.0)
    }

    /// Returns `A B'`.
    #[must_use]
    pub fn times_transposed(&self, other: &Self) -> Self {
        Self(&self.0 * other.0.transpose())
    }

    /// Returns `A' B`.
    #[must_use]
    pub fn transposed_times(&self, other: &Self) -> Self {
        Self(self.0.transpose() * &other.0)
    }

    /// Returns `A + B`.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self(&self.0 + &other.0)
    }

    /// Writes `A' A x`.
    pub fn gram_times(&self, x: &[f64], out: &mut [f64]) {
        let image = &self.0 * ColRef::from_slice(x);
        let back = self.0.transpose() * image;
        out.iter_mut().zip(back.iter()).for_each(|(out, value)| *out = *value);
    }

    /// Returns the largest magnitude of an element.
    pub fn norm_max(&self) -> f64 {
        self.0.norm_max()
    }

    /// Returns the Frobenius norm.
    pub fn norm_l2(&self) -> f64 {
        self.0.norm_l2()
    }

    /// Returns the largest singular value; `None` if the iteration does not end.
    pub fn largest_singular_value(&self) -> Option<f64> {
        if self.n_rows() == 0 || self.n_columns() == 0 {
            return Some(0.0);
        }
        Some(self.0.singular_values().ok()?.into_iter().fold(0.0, f64::max))
    }

    /// Returns the largest magnitude of an eigenvalue; `None` if the iteration does not end.
    pub fn spectral_radius(&self) -> Option<f64> {
        let values = self.0.eigenvalues().ok()?;
        Some(values.iter().map(|value| value.re.hypot(value.im)).fold(0.0, f64::max))
    }

    /// Returns the solution of `A x = right`, by a factorisation with partial pivoting; it is not finite
    /// for a singular matrix.
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let right = Mat::from_fn(right.len(), 1, |row, _| right[row]);
        self.0.partial_piv_lu().solve(&right).col(0).iter().copied().collect()
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    fn index(&self, at: (usize, usize)) -> &f64 {
        &self.0[at]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, at: (usize, usize)) -> &mut f64 {
        &mut self.0[at]
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact where exactness is promised")]
mod tests {
    use super::*;

    /// `[[1, 2], [3, 4]]`
    fn example() -> Matrix {
        Matrix::square(2, &[1.0, 3.0, 2.0, 4.0])
    }

    fn columns(matrix: &Matrix) -> Vec<f64> {
        let at = |column| (0..matrix.n_rows()).map(move |row| (row, column));
        (0..matrix.n_columns()).flat_map(at).map(|at| matrix[at]).collect()
    }

    #[test]
    fn products_and_sums_are_those_by_hand() {
        let a = example();
        assert_eq!(columns(&a.times(&a)), [7.0, 15.0, 10.0, 22.0]);
        assert_eq!(columns(&a.times_transposed(&a)), [5.0, 11.0, 11.0, 25.0]);
        assert_eq!(columns(&a.transposed_times(&a)), [10.0, 14.0, 14.0, 20.0]);
        assert_eq!(columns(&a.plus(&a)), [2.0, 6.0, 4.0, 8.0]);
        let mut out = [0.0; 2];
        a.gram_times(&[1.0, -1.0], &mut out);
        assert_eq!(out, [-4.0, -6.0]);
    }

    #[test]
    fn norms_eigenvalues_and_solutions_are_those_by_hand() {
        let a = example();
        assert_eq!(a.norm_max(), 4.0);
        assert!((a.norm_l2() - 30.0_f64.sqrt()).abs() < 1e-15);
        let root = |sum: f64, product: f64| 0.5 * (sum + (sum * sum - 4.0 * product).sqrt());
        let near = |found: Option<f64>, wanted: f64| (found.unwrap() / wanted - 1.0).abs() < 1e-14;
        assert!(near(a.spectral_radius(), root(5.0, -2.0)));
        assert!(near(a.largest_singular_value(), root(30.0, 4.0).sqrt()));
        assert_eq!(Matrix::zeros(0, 3).largest_singular_value(), Some(0.0));
        let solution = a.solve(&[5.0, 11.0]);
        assert!((solution[0] - 1.0).abs() < 1e-14 && (solution[1] - 2.0).abs() < 1e-14);
        assert_eq!(Matrix::square(1, &[f64::NAN]).spectral_radius(), None);
    }
}
