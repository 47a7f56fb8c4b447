//! Least squares with columns of any size: pseudo-inverse, and what it leaves alone.

use nalgebra::{DMatrix, DVector};

/// `x = K b + N x0`: the smallest change of `x0` that minimises `|M x - b|`, with columns scaled alike.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    /// `K`, one row per unknown.
    pub(super) inverse: DMatrix<f64>,
    /// `N`: projection on what the matrix does not determine; `None` if it determines everything.
    null: Option<DMatrix<f64>>,
}

impl Fit {
    /// Factorises `M` by an orthogonal decomposition and the singular values of its triangle.
    pub(super) fn new(mut matrix: DMatrix<f64>) -> Self {
        let (n_rows, n_unknowns) = matrix.shape();
        let size: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
        let excited: Vec<usize> = (0..n_unknowns).filter(|i| size[*i] > 0.0).collect();
        let mut inverse = DMatrix::zeros(n_unknowns, n_rows);
        let mut null = DMatrix::identity(n_unknowns, n_unknowns);
        if excited.is_empty() {
            return Self { inverse, null: Some(null) };
        }
        for (mut column, size) in matrix.column_iter_mut().zip(&size) {
            column /= if *size > 0.0 { *size } else { 1.0 };
        }
        let (q, r) = matrix.select_columns(&excited).qr().unpack();
        let parts = r.svd(true, true);
        let (Some(left), Some(right)) = (parts.u, parts.v_t) else {
            return Self { inverse, null: Some(null) };
        };
        let largest = parts.singular_values.max();
        let least = f64::EPSILON * n_rows.max(excited.len()) as f64 * largest;
        let kept: Vec<usize> = (0..parts.singular_values.len())
            .filter(|i| parts.singular_values[*i] > least)
            .collect();
        let right = right.select_rows(&kept).transpose();
        let over = DVector::from_iterator(
            kept.len(),
            kept.iter().map(|i| 1.0 / parts.singular_values[*i]),
        );
        // Undo the scale of the columns: rows of K by 1 / size, of N from both sides.
        let found = &right * DMatrix::from_diagonal(&over) * left.select_columns(&kept).transpose();
        let found = found * q.transpose();
        for (place, column) in excited.iter().enumerate() {
            inverse.row_mut(*column).copy_from(&(found.row(place) / size[*column]));
        }
        if kept.len() == n_unknowns {
            return Self { inverse, null: None };
        }
        let scale = |place: usize| size[excited[place]];
        let project = &right * right.transpose();
        for (i, row) in excited.iter().enumerate() {
            for (j, column) in excited.iter().enumerate() {
                null[(*row, *column)] -= project[(i, j)] * scale(j) / scale(i);
            }
        }
        Self { inverse, null: Some(null) }
    }

    /// Returns the part of `x0` that stays.
    pub(super) fn left(&self, x0: &DVector<f64>) -> DVector<f64> {
        self.null.as_ref().map_or_else(|| DVector::zeros(x0.len()), |null| null * x0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_determined_is_solved_and_the_rest_stays() {
        // Columns of very different size; the third is the sum of two, the fourth is zero.
        let rows = 30;
        let matrix = DMatrix::from_fn(rows, 4, |k, column| {
            let x = k as f64;
            match column {
                0 => 1e6 * x.sin(),
                1 => 1e-6 * x.cos(),
                2 => 1e6 * x.sin() + 1e-6 * x.cos(),
                _ => 0.0,
            }
        });
        let full = Fit::new(matrix.columns(0, 2).into_owned());
        let wanted = DVector::from_vec(vec![3.0, -2e6]);
        let right = matrix.columns(0, 2) * &wanted;
        let found = &full.inverse * &right;
        assert!((found - &wanted).abs().max() < 1e-3, "the second is of the size 1e6");
        assert_eq!(full.left(&wanted), DVector::zeros(2));

        let fit = Fit::new(matrix.clone());
        let start = DVector::from_vec(vec![1.0, 5.0, -3.0, 0.7]);
        let found = &fit.inverse * &right + fit.left(&start);
        assert!(((&matrix * &found) - &right).norm() < 1e-9 * right.norm());
        assert!((found[3] - 0.7).abs() < 1e-15, "not excited: it stays");
        // Nothing to change: everything stays.
        let same = &fit.inverse * (&matrix * &start) + fit.left(&start);
        assert!(
            (same - start).abs().max() < 1e-2,
            "rounding of a large answer, over a small column"
        );
    }
}
