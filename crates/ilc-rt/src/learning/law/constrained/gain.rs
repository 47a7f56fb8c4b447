//! Feedback of one sample of the Riccati recursion, and the Cholesky factor that it is solved with.
//!
//! For `riccati` and `interior`, with sizes known at compile time.

#![expect(clippy::needless_range_loop, reason = "matrices are written with their indices")]
#![expect(clippy::inline_always, reason = "one copy in each sweep, its matrices in registers")]

/// A pivot below this part of its diagonal entry is rounding.
const VANISHED: f64 = 1e-13;

/// Feedback and Cholesky factor of one sample; the state is `(x, v_-, v_--)`, truncated to its
/// size.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gain<const M: usize, const NS: usize> {
    pub(super) feedback: [[f64; NS]; M],
    /// Lower factor of `H`, its diagonal inverted; 0 there marks a direction without cost.
    lower: [[f64; M]; M],
}

impl<const M: usize, const NS: usize> Gain<M, NS> {
    pub(super) const NONE: Self = Self { feedback: [[0.0; NS]; M], lower: [[0.0; M]; M] };

    /// Returns true if some direction of the input has no cost.
    pub(super) fn vanished(&self) -> bool {
        (0..M).any(|i| self.lower[i][i] <= 0.0)
    }

    /// Returns the first entry of `H`, the cost of a change of the input.
    pub(super) fn stiffness(&self) -> f64 {
        if self.lower[0][0] > 0.0 { self.lower[0][0].powi(-2) } else { 0.0 }
    }

    /// Factorises `H`; directions without cost are left out.
    #[inline(always)]
    pub(super) fn factorise(&mut self, h: &[[f64; M]; M]) {
        for j in 0..M {
            let mut pivot = h[j][j];
            for i in 0..j {
                pivot -= self.lower[j][i] * self.lower[j][i];
            }
            if !(pivot > VANISHED * h[j][j] && pivot > 0.0) {
                for row in j..M {
                    self.lower[row][j] = 0.0;
                }
                continue;
            }
            let inverse = 1.0 / pivot.sqrt();
            self.lower[j][j] = inverse;
            for row in j + 1..M {
                let mut entry = h[row][j];
                for i in 0..j {
                    entry -= self.lower[row][i] * self.lower[j][i];
                }
                self.lower[row][j] = entry * inverse;
            }
        }
    }

    /// Replaces `right` by `H^-1 right`.
    #[inline(always)]
    pub(super) fn solve<const W: usize>(&self, right: &mut [[f64; W]; M]) {
        for row in 0..M {
            for i in 0..row {
                let factor = self.lower[row][i];
                let known = right[i];
                for col in 0..W {
                    right[row][col] -= factor * known[col];
                }
            }
            for col in 0..W {
                right[row][col] *= self.lower[row][row];
            }
        }
        for row in (0..M).rev() {
            for i in row + 1..M {
                let factor = self.lower[i][row];
                let known = right[i];
                for col in 0..W {
                    right[row][col] -= factor * known[col];
                }
            }
            for col in 0..W {
                right[row][col] *= self.lower[row][row];
            }
        }
    }
}
