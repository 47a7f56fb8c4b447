//! One step of the backward recursion, in three forms, in preallocated memory.

use super::cholesky::{self, Pivots};
use super::record::Sizes;
use super::square_root::SquareRoot;
use super::wide::Instructions;
use super::{Form, Stage, fixed_step};

/// The cost-to-go, and the workspace of one step.
///
/// All matrices are column-major.
#[derive(Debug, Clone)]
pub(super) struct Recursion {
    form: Form,
    sizes: Sizes,
    instructions: Instructions,
    /// `Pi` (n x n); in the square-root forms an upper triangular `U` with `Pi = U'U`.
    pub(super) cost: Vec<f64>,
    /// The same one sample later.
    later: Vec<f64>,
    /// `Pi B`, `Pi A`, `Q D`, `Q C`.
    cost_b: Vec<f64>,
    cost_a: Vec<f64>,
    weighted_d: Vec<f64>,
    weighted_c: Vec<f64>,
    /// Cholesky factor of `H`, lower (m x m).
    lower: Vec<f64>,
    /// `K` (m x n).
    feedback: Vec<f64>,
    /// `A - B K` (n x n).
    pub(super) transition: Vec<f64>,
    /// `H^-1` (m x m), or no room for it.
    pub(super) inverse: Vec<f64>,
    /// `C - D K` (p x n), and `Q` times it.
    left: Vec<f64>,
    weighted_left: Vec<f64>,
    /// `S + R` (m x m), and times `K` (m x n).
    effort: Vec<f64>,
    weighted_feedback: Vec<f64>,
    root: SquareRoot,
}

impl Recursion {
    pub(super) fn new(form: Form, sizes: Sizes) -> Self {
        let Sizes { n, m, p, .. } = sizes;
        let room = |count: usize| vec![0.0; count];
        Self {
            form,
            sizes,
            instructions: Instructions::best(),
            cost: room(n * n),
            later: room(n * n),
            cost_b: room(n * m),
            cost_a: room(n * n),
            weighted_d: room(p * m),
            weighted_c: room(p * n),
            lower: room(m * m),
            feedback: room(m * n),
            transition: room(n * n),
            inverse: Vec::new(),
            left: room(p * n),
            weighted_left: room(p * n),
            effort: room(m * m),
            weighted_feedback: room(m * n),
            root: SquareRoot::new(sizes),
        }
    }

    /// Restarts from the end of the run, where the cost-to-go is zero.
    pub(super) fn restart(&mut self) {
        self.cost.fill(0.0);
    }

    /// Steps from sample `k + 1` to sample `k` and writes its gains.
    ///
    /// `H = S + R + D'QD + B'Pi B`, `K = H^-1 (D'QC + B'Pi A)`.
    pub(super) fn step(&mut self, stage: &Stage, back: &mut [f64], fore: &mut [f64]) -> Pivots {
        std::mem::swap(&mut self.cost, &mut self.later);
        let Self { form, sizes, instructions, later, cost, lower, feedback, .. } = self;
        let solved = (*form != Form::Joseph).then(|| {
            for (value, (s, r)) in self.effort.iter_mut().zip(stage.s.iter().zip(&stage.r)) {
                *value = s + r;
            }
            let (cost, gains) = ((&later[..], &mut cost[..]), (&mut lower[..], &mut feedback[..]));
            self.root.step(*form, *instructions, stage, &self.effort, cost, gains)
        });
        let given = solved.map(|pivots| (pivots, &lower[..], &feedback[..]));
        let Self { transition, weighted_c, inverse, .. } = self;
        let room = fixed_step::Room { later, cost, transition, weighted_c, inverse };
        fixed_step::step(*instructions, *sizes, stage, given, room, back, fore)
            .unwrap_or_else(|| self.any(stage, solved, back, fore))
    }

    /// [`Recursion::step`] for any sizes and forms.
    #[expect(clippy::too_many_lines, reason = "one recursion, product by product")]
    fn any(
        &mut self,
        stage: &Stage,
        solved: Option<Pivots>,
        back: &mut [f64],
        fore: &mut [f64],
    ) -> Pivots {
        let Sizes { n, m, p, targets, held } = self.sizes;
        let Self { feedback, transition, left, weighted_left, effort, lower, .. } = self;
        let (a, b) = (&stage.a.as_slice()[..n * n], &stage.b.as_slice()[..n * m]);
        let (c, d) = (&stage.c.as_slice()[..p * n], &stage.d.as_slice()[..p * m]);
        let q = &stage.q.as_slice()[..p * p];
        let (s, r) = (&stage.s.as_slice()[..m * m], &stage.r.as_slice()[..m * m]);
        for (value, (s, r)) in effort.iter_mut().zip(s.iter().zip(r)) {
            *value = s + r;
        }
        multiply(&mut self.weighted_d[..p * m], q, d, p, p, m);
        multiply(&mut self.weighted_c[..p * n], q, c, p, p, n);

        let pivots = match solved {
            None => {
                let later = &self.later[..n * n];
                multiply(&mut self.cost_b[..n * m], later, b, n, n, m);
                multiply(&mut self.cost_a[..n * n], later, a, n, n, n);
                lower[..m * m].copy_from_slice(&effort[..m * m]);
                add_transposed(&mut lower[..m * m], d, &self.weighted_d[..p * m], m, p, m);
                add_transposed(&mut lower[..m * m], b, &self.cost_b[..n * m], m, n, m);
                let pivots = cholesky::factorize(&mut lower[..m * m], m, m);
                cholesky::invert_diagonal(&mut lower[..m * m], m);
                let feedback = &mut feedback[..m * n];
                feedback.fill(0.0);
                add_transposed(feedback, d, &self.weighted_c[..p * n], m, p, n);
                add_transposed(feedback, b, &self.cost_a[..n * n], m, n, n);
                for column in feedback.chunks_exact_mut(m) {
                    cholesky::solve(&lower[..m * m], m, column);
                }
                pivots
            }
            Some(pivots) => pivots,
        };

        let (feedback, transition) = (&feedback[..m * n], &mut transition[..n * n]);
        let (left, weighted_left) = (&mut left[..p * n], &mut weighted_left[..p * n]);
        transition.copy_from_slice(a);
        subtract(transition, b, feedback, n, m, n);
        left.copy_from_slice(c);
        subtract(left, d, feedback, p, m, n);
        multiply(weighted_left, q, left, p, p, n);
        if solved.is_none() {
            // Joseph form, `(C-DK)'Q(C-DK) + K'(S+R)K + (A-BK)'Pi(A-BK)`: a sum of squares, which
            // stays positive semidefinite under rounding.
            let moved = &mut self.cost_a[..n * n];
            multiply(moved, &self.later[..n * n], transition, n, n, n);
            let weighted = &mut self.weighted_feedback[..m * n];
            multiply(weighted, &effort[..m * m], feedback, m, m, n);
            let cost = &mut self.cost[..n * n];
            for j in 0..n {
                for i in 0..=j {
                    let mut value = 0.0;
                    for k in 0..n {
                        value += transition[i * n + k] * moved[j * n + k];
                    }
                    for k in 0..p {
                        value += left[i * p + k] * weighted_left[j * p + k];
                    }
                    for k in 0..m {
                        value += feedback[i * m + k] * weighted[j * m + k];
                    }
                    cost[j * n + i] = value;
                    cost[i * n + j] = value;
                }
            }
        }

        let lower = &lower[..m * m];
        let rows = n + m;
        let mut columns = back.chunks_exact_mut(rows);
        for j in 0..n {
            let Some(target) = columns.next() else { break };
            for i in 0..n {
                target[i] = transition[i * n + j];
            }
            for i in 0..m {
                target[n + i] = b[i * n + j];
            }
            cholesky::solve(lower, m, &mut target[n..]);
        }
        for j in 0..targets {
            let Some(target) = columns.next() else { break };
            for i in 0..n {
                target[i] = weighted_left[i * p + j];
            }
            for i in 0..m {
                target[n + i] = self.weighted_d[i * p + j];
            }
            cholesky::solve(lower, m, &mut target[n..]);
        }
        for j in 0..held {
            let Some(target) = columns.next() else { break };
            for i in 0..n {
                let mut value = 0.0;
                for k in 0..m {
                    value += feedback[i * m + k] * s[j * m + k];
                }
                target[i] = value;
            }
            for i in 0..m {
                target[n + i] = -s[j * m + i];
            }
            cholesky::solve(lower, m, &mut target[n..]);
        }
        for j in 0..n {
            let target = &mut fore[j * rows..(j + 1) * rows];
            target[..n].copy_from_slice(&transition[j * n..(j + 1) * n]);
            for i in 0..m {
                target[n + i] = -feedback[j * m + i];
            }
        }
        fore[n * rows..].copy_from_slice(b);
        cholesky::invert(lower, m, &mut self.inverse);
        pivots
    }

    /// Returns the largest entry of the cost's change in the last step.
    pub(super) fn change(&self) -> f64 {
        let pairs = self.cost.iter().zip(&self.later);
        pairs.map(|(new, old)| (new - old).abs()).fold(0.0, f64::max)
    }

    /// Returns the size of the cost, including that of the sample itself.
    pub(super) fn scale(&self, stage: &Stage) -> f64 {
        let p = self.sizes.p;
        let own = (0..self.sizes.n)
            .map(|j| (0..p).map(|i| stage.c[(i, j)] * self.weighted_c[j * p + i]).sum::<f64>());
        let own = own.fold(0.0, f64::max);
        let own = if self.form == Form::Joseph { own } else { own.sqrt() };
        self.cost.iter().fold(own, |scale, value| scale.max(own + value.abs()))
    }
}

/// `out = left right`, (rows, inner) times (inner, cols).
#[inline]
fn multiply(out: &mut [f64], left: &[f64], right: &[f64], rows: usize, inner: usize, cols: usize) {
    for j in 0..cols {
        let out = &mut out[j * rows..(j + 1) * rows];
        out.fill(0.0);
        for k in 0..inner {
            let factor = right[j * inner + k];
            let column = &left[k * rows..(k + 1) * rows];
            for i in 0..rows {
                out[i] += column[i] * factor;
            }
        }
    }
}

/// `out -= left right`, (rows, inner) times (inner, cols).
#[inline]
fn subtract(out: &mut [f64], left: &[f64], right: &[f64], rows: usize, inner: usize, cols: usize) {
    for j in 0..cols {
        let out = &mut out[j * rows..(j + 1) * rows];
        for k in 0..inner {
            let factor = right[j * inner + k];
            let column = &left[k * rows..(k + 1) * rows];
            for i in 0..rows {
                out[i] -= column[i] * factor;
            }
        }
    }
}

/// `out += left' right`, left (inner, rows), right (inner, cols).
#[inline]
fn add_transposed(
    out: &mut [f64],
    left: &[f64],
    right: &[f64],
    rows: usize,
    inner: usize,
    cols: usize,
) {
    for j in 0..cols {
        let right = &right[j * inner..(j + 1) * inner];
        for i in 0..rows {
            let left = &left[i * inner..(i + 1) * inner];
            let mut value = out[j * rows + i];
            for k in 0..inner {
                value += left[k] * right[k];
            }
            out[j * rows + i] = value;
        }
    }
}
