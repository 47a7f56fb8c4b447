//! The step of the backward recursion on a square root `U` of the cost, `Pi = U'U`.

use super::cholesky::{self, Pivots, VANISHED};
use super::record::Sizes;
use super::{Form, Stage};

/// Workspace of one step in [`Form::Cholesky`] or [`Form::SquareRoot`].
///
/// With `W = [(S+R)^(1/2) 0; Q^(1/2)[D C]; U[B A]]` both compute the upper triangular `R = [R11
/// R12; 0 U_k]` with `R'R = W'W`: one as a Cholesky factor of `W'W`, the other by Householder
/// reflections of `W` (QR), so that nothing is squared. Then `H = R11'R11`, `K = R11^-1 R12` and
/// `Pi_k = U_k'U_k`.
#[derive(Debug, Clone)]
pub(super) struct SquareRoot {
    sizes: Sizes,
    /// `W`, (m + p + n) x (m + n), column-major.
    stacked: Vec<f64>,
    /// `W'W` or `R'`, (m + n) x (m + n), column-major: only its lower triangle is used.
    lower: Vec<f64>,
    /// Factors of `S + R` (m x m) and `Q` (p x p).
    effort: Vec<f64>,
    error: Vec<f64>,
}

impl SquareRoot {
    pub(super) fn new(sizes: Sizes) -> Self {
        let Sizes { n, m, p, .. } = sizes;
        let room = |count: usize| vec![0.0; count];
        let (stacked, lower) = (room((m + p + n) * (m + n)), room((m + n) * (m + n)));
        Self { sizes, stacked, lower, effort: room(m * m), error: room(p * p) }
    }

    /// Writes the `U` of the previous sample, the Cholesky factor of `H` and `K`.
    pub(super) fn step(
        &mut self,
        form: Form,
        stage: &Stage,
        effort: &[f64],
        (later, earlier): (&[f64], &mut [f64]),
        (lower, feedback): (&mut [f64], &mut [f64]),
    ) -> Pivots {
        let Sizes { n, m, .. } = self.sizes;
        let w = m + n;
        self.stack(stage, effort, later);
        let pivots = if form == Form::SquareRoot {
            self.reflect()
        } else {
            let rows = self.stacked.len() / w;
            for j in 0..w {
                for i in j..w {
                    let (left, right) = (&self.stacked[i * rows..], &self.stacked[j * rows..]);
                    self.lower[j * w + i] =
                        (0..rows).map(|k| left[k] * right[k]).fold(0.0, |sum, term| sum + term);
                }
            }
            cholesky::factorize(&mut self.lower, w, m)
        };
        for j in 0..m {
            lower[j * m..(j + 1) * m].copy_from_slice(&self.lower[j * w..j * w + m]);
        }
        cholesky::invert_diagonal(lower, m);
        for (j, column) in feedback.chunks_exact_mut(m).enumerate() {
            for (i, value) in column.iter_mut().enumerate() {
                *value = self.lower[i * w + m + j];
            }
            cholesky::solve_transposed(lower, m, column);
        }
        for j in 0..n {
            for i in 0..n {
                earlier[j * n + i] = if i <= j { self.lower[(m + i) * w + m + j] } else { 0.0 };
            }
        }
        pivots
    }

    /// Writes `W`.
    fn stack(&mut self, stage: &Stage, effort: &[f64], later: &[f64]) {
        let Sizes { n, m, p, .. } = self.sizes;
        let (rows, w) = (m + p + n, m + n);
        self.effort.copy_from_slice(effort);
        cholesky::factorize(&mut self.effort, m, m);
        self.error.copy_from_slice(stage.q.as_slice());
        cholesky::factorize(&mut self.error, p, p);
        let (a, b) = (stage.a.as_slice(), stage.b.as_slice());
        let (c, d) = (stage.c.as_slice(), stage.d.as_slice());
        for j in 0..w {
            let (next, seen) = if j < m {
                (&b[j * n..(j + 1) * n], &d[j * p..(j + 1) * p])
            } else {
                (&a[(j - m) * n..(j - m + 1) * n], &c[(j - m) * p..(j - m + 1) * p])
            };
            let column = &mut self.stacked[j * rows..(j + 1) * rows];
            for (i, value) in column[..m].iter_mut().enumerate() {
                *value = if j < m && i <= j { self.effort[i * m + j] } else { 0.0 };
            }
            for (i, value) in column[m..m + p].iter_mut().enumerate() {
                let factor = &self.error[i * p..(i + 1) * p];
                *value = (i..p).map(|k| factor[k] * seen[k]).sum();
            }
            for (i, value) in column[m + p..].iter_mut().enumerate() {
                *value = (i..n).map(|k| later[k * n + i] * next[k]).sum();
            }
        }
    }

    /// Writes the transpose of the triangular factor of `W`, with a non-negative diagonal.
    ///
    /// A column with nothing left consumes no row, so that the row's content is kept.
    fn reflect(&mut self) -> Pivots {
        let Sizes { n, m, p, .. } = self.sizes;
        let (rows, w) = (m + p + n, m + n);
        let mut pivots = Pivots::NONE;
        let mut top = 0;
        self.lower.fill(0.0);
        for j in 0..w {
            let (column, others) = self.stacked[j * rows..].split_at_mut(rows);
            let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
            let (before, rest) = (square(column), square(&column[top.min(rows)..]));
            let gone = if j < m { !pivots.count(rest, before) } else { rest <= 0.0 };
            if gone || (j < m && rest <= VANISHED * before) {
                continue;
            }
            let norm = rest.sqrt();
            let sign = if column[top] > 0.0 { 1.0 } else { -1.0 };
            let reflector = &mut column[top..];
            reflector[0] += sign * norm;
            let scale = 2.0 / (2.0 * norm * (norm + (reflector[0] - sign * norm).abs()));
            self.lower[j * w + j] = norm;
            for (i, other) in others.chunks_exact_mut(rows).enumerate() {
                let other = &mut other[top..];
                let along: f64 = reflector.iter().zip(&*other).map(|(v, x)| v * x).sum();
                for (value, v) in other.iter_mut().zip(&*reflector) {
                    *value -= scale * along * v;
                }
                self.lower[j * w + j + 1 + i] = -sign * other[0];
            }
            top += 1;
        }
        pivots
    }
}
