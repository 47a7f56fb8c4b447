//! In-place Cholesky factorisation of a small, possibly singular matrix, without allocation.
//!
//! In a null direction of the matrix the cost is flat; the solution's component there is set to
//! zero: of all minimisers, the one that leaves that input unchanged.

#![expect(
    clippy::inline_always,
    reason = "compiled anew for each size, and for the instructions of each processor"
)]

/// A pivot below this share of its diagonal entry is rounding noise.
pub(super) const VANISHED: f64 = 1e-13;

/// Statistics of the pivots of a factorisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pivots {
    /// True if a pivot vanished.
    pub(super) vanished: bool,
    /// Smallest non-zero pivot.
    pub(super) min: f64,
    /// Largest pivot.
    pub(super) max: f64,
}

impl Pivots {
    /// Initial value.
    pub(super) const NONE: Self = Self { vanished: false, min: f64::INFINITY, max: 0.0 };

    /// Counts one pivot and returns true if it is non-zero.
    #[inline]
    pub(super) fn count(&mut self, pivot: f64, diagonal: f64) -> bool {
        if pivot <= VANISHED * diagonal || pivot <= 0.0 {
            self.vanished = true;
            return false;
        }
        self.min = self.min.min(pivot);
        self.max = self.max.max(pivot);
        true
    }
}

/// Replaces the lower triangle of `h` (m x m, column-major) by `L` with `h = L L'`.
///
/// The column of a null direction is zero. Only the first `counted` pivots are reported.
#[inline(always)]
pub(super) fn factorize(h: &mut [f64], m: usize, counted: usize) -> Pivots {
    let (mut pivots, mut others) = (Pivots::NONE, Pivots::NONE);
    for j in 0..m {
        let mut pivot = h[j * m + j];
        for i in 0..j {
            pivot -= h[i * m + j] * h[i * m + j];
        }
        let report = if j < counted { &mut pivots } else { &mut others };
        if !report.count(pivot, h[j * m + j]) {
            for row in j..m {
                h[j * m + row] = 0.0;
            }
            continue;
        }
        let root = f64::sqrt(pivot);
        h[j * m + j] = root;
        for row in j + 1..m {
            let mut value = h[j * m + row];
            for i in 0..j {
                value -= h[i * m + row] * h[i * m + j];
            }
            h[j * m + row] = value / root;
        }
    }
    pivots
}

/// Replaces each diagonal entry by its reciprocal, or 0 in a null direction: the form that
/// [`solve`] takes, because multiplication is much faster than division.
#[inline(always)]
pub(super) fn invert_diagonal(lower: &mut [f64], m: usize) {
    for j in 0..m {
        let pivot = &mut lower[j * m + j];
        *pivot = if *pivot > 0.0 { 1.0 / *pivot } else { 0.0 };
    }
}

/// Replaces `x` by `H^-1 x`, zero in null directions; `lower` is column-major, its diagonal
/// [inverted](invert_diagonal).
#[inline(always)]
pub(super) fn solve(lower: &[f64], m: usize, x: &mut [f64]) {
    for row in 0..m {
        let mut value = x[row];
        for i in 0..row {
            value -= lower[i * m + row] * x[i];
        }
        x[row] = value * lower[row * m + row];
    }
    solve_transposed(lower, m, x);
}

/// Writes `H^-1` (m x m), zero in null directions; nothing without room for it.
#[inline(always)]
pub(super) fn invert(lower: &[f64], m: usize, inverse: &mut [f64]) {
    for (j, column) in inverse.chunks_exact_mut(m).enumerate() {
        column.fill(0.0);
        column[j] = 1.0;
        solve(lower, m, column);
    }
}

/// Replaces `x` by `L'^-1 x`, zero in null directions.
#[inline(always)]
pub(super) fn solve_transposed(lower: &[f64], m: usize, x: &mut [f64]) {
    for row in (0..m).rev() {
        let mut value = x[row];
        for i in row + 1..m {
            value -= lower[row * m + i] * x[i];
        }
        x[row] = value * lower[row * m + row];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_system_is_solved() {
        let mut h = [4.0, 2.0, 2.0, 3.0];
        let mut x = [8.0, 8.0];
        let pivots = factorize(&mut h, 2, 2);
        invert_diagonal(&mut h, 2);
        solve(&h, 2, &mut x);
        assert_eq!(pivots, Pivots { vanished: false, min: 2.0, max: 4.0 });
        assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 2.0).abs() < 1e-14);
    }

    #[test]
    fn a_singular_system_leaves_the_free_direction_alone() {
        let mut h = [4.0, 2.0, 2.0, 1.0];
        let mut x = [8.0, 4.0];
        assert!(factorize(&mut h, 2, 2).vanished);
        invert_diagonal(&mut h, 2);
        solve(&h, 2, &mut x);
        assert!((x[0] - 2.0).abs() < 1e-14 && x[1].abs() < 1e-14);
    }
}
