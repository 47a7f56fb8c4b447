//! The step of the backward recursion on a square root `U` of the cost, `Pi = U'U`.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::cholesky::{self, Pivots, VANISHED};
use super::record::Sizes;
use super::wide::{HALF, Instructions, Wide, Work};
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
    /// `W`, (m + p + n) x (m + n), column-major, each column filled up with zeros to whole halves.
    stacked: Vec<f64>,
    /// A reflector, zero above its first row.
    reflector: Vec<[f64; HALF]>,
    /// For each first row of a reflector, ones from there on, and a one there alone: single numbers
    /// among those that are taken four at a time would cost more.
    below: Vec<[f64; HALF]>,
    unit: Vec<[f64; HALF]>,
    /// `W'W` or `R'`, (m + n) x (m + n), column-major: only its lower triangle is used.
    lower: Vec<f64>,
    /// Factors of `S + R` (m x m) and `Q` (p x p).
    effort: Factor,
    error: Factor,
}

/// The Cholesky factor of a weight, kept for as long as the weight is the same.
#[derive(Debug, Clone)]
struct Factor {
    weight: Vec<f64>,
    lower: Vec<f64>,
}

impl Factor {
    fn new(side: usize) -> Self {
        Self { weight: vec![f64::NAN; side * side], lower: vec![0.0; side * side] }
    }

    fn of(&mut self, weight: &[f64], side: usize) -> &[f64] {
        if self.weight != weight {
            self.weight.copy_from_slice(weight);
            self.lower.copy_from_slice(weight);
            cholesky::factorize(&mut self.lower, side, side);
        }
        &self.lower
    }
}

impl SquareRoot {
    pub(super) fn new(sizes: Sizes) -> Self {
        let Sizes { n, m, p, .. } = sizes;
        let room = |count: usize| vec![0.0; count];
        let rows = (m + p + n).next_multiple_of(HALF);
        let (stacked, lower) = (room(rows * (m + n)), room((m + n) * (m + n)));
        let masks = |is_set: fn(usize, usize) -> bool| -> Vec<[f64; HALF]> {
            let of_row = |top| (0..rows).map(move |row| f64::from(u8::from(is_set(top, row))));
            (0..rows).flat_map(of_row).collect::<Vec<f64>>().as_chunks().0.to_vec()
        };
        Self {
            sizes,
            stacked,
            reflector: vec![[0.0; HALF]; rows / HALF],
            below: masks(|top, row| row >= top),
            unit: masks(|top, row| row == top),
            lower,
            effort: Factor::new(m),
            error: Factor::new(p),
        }
    }

    /// Writes the `U` of the previous sample, the Cholesky factor of `H` and `K`.
    #[inline(never)]
    pub(super) fn step(
        &mut self,
        form: Form,
        how: Instructions,
        stage: &Stage,
        effort: &[f64],
        (later, earlier): (&[f64], &mut [f64]),
        (lower, feedback): (&mut [f64], &mut [f64]),
    ) -> Pivots {
        let Sizes { n, m, p, .. } = self.sizes;
        let (given, cost, gains) = ((stage, effort), (later, earlier), (lower, feedback));
        macro_rules! choose {
            ($(($n:literal, $m:literal, $p:literal))*) => {
                match (n, m, p) {
                    // The compiler unrolls the same loops where it knows the sizes.
                    $(($n, $m, $p) => self.step_of([$n, $m, $p], form, how, given, cost, gains),)*
                    _ => self.step_of([n, m, p], form, how, given, cost, gains),
                }
            };
        }
        choose!((1, 1, 1)(2, 1, 1)(3, 1, 1)(4, 1, 1)(2, 1, 2)(3, 1, 2)(4, 1, 2)(4, 2, 2)(6, 2, 4))
    }

    #[inline(always)]
    fn step_of(
        &mut self,
        [n, m, p]: [usize; 3],
        form: Form,
        how: Instructions,
        (stage, effort): (&Stage, &[f64]),
        (later, earlier): (&[f64], &mut [f64]),
        (lower, feedback): (&mut [f64], &mut [f64]),
    ) -> Pivots {
        let w = m + n;
        self.stack([n, m, p], stage, effort, later);
        let pivots = if form == Form::SquareRoot {
            self.reflect_by(how)
        } else {
            let rows = (m + p + n).next_multiple_of(HALF);
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

    /// Reflects with loops of known length for the usual numbers of rows.
    fn reflect_by(&mut self, how: Instructions) -> Pivots {
        let done = match self.reflector.len() {
            1 => how.run_if_usual(Reflect::<1>(self)),
            2 => how.run_if_usual(Reflect::<2>(self)),
            3 => how.run_if_usual(Reflect::<3>(self)),
            _ => None,
        };
        match done {
            Some(pivots) => pivots,
            None => how.run(Reflect::<0>(self)),
        }
    }

    /// Writes `W`.
    #[inline(always)]
    fn stack(&mut self, [n, m, p]: [usize; 3], stage: &Stage, effort: &[f64], later: &[f64]) {
        let (rows, w) = ((m + p + n).next_multiple_of(HALF), m + n);
        let (effort, error) = (self.effort.of(effort, m), self.error.of(stage.q.as_slice(), p));
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
                *value = if j < m && i <= j { effort[i * m + j] } else { 0.0 };
            }
            for (i, value) in column[m..m + p].iter_mut().enumerate() {
                let factor = &error[i * p..(i + 1) * p];
                *value = (i..p).map(|k| factor[k] * seen[k]).sum();
            }
            for (i, value) in column[m + p..][..n].iter_mut().enumerate() {
                *value = (i..n).map(|k| later[k * n + i] * next[k]).sum();
            }
        }
    }

    /// Writes the transpose of the triangular factor of `W`, with a non-negative diagonal.
    ///
    /// A column with nothing left consumes no row, so that the row's content is kept.
    /// `HALVES` is the length of a column in halves, 0 for one that is known at run time only.
    #[inline(always)]
    fn reflect<const HALVES: usize>(&mut self, wide: impl Wide) -> Pivots {
        let Self { sizes: Sizes { n, m, p, .. }, stacked, reflector, lower, .. } = self;
        let halves = if HALVES > 0 { HALVES } else { reflector.len() };
        let (reflector, w) = (&mut reflector[..halves], *m + *n);
        let mut pivots = Pivots::NONE;
        let mut top = 0;
        lower.fill(0.0);
        for j in 0..w {
            if top == *m + *p + *n {
                break;
            }
            let (_, columns) = stacked.as_chunks_mut::<HALF>().0.split_at_mut(j * halves);
            let (column, others) = columns.split_at_mut(halves);
            let masks = &self.below[top * halves..][..halves];
            let zero = wide.half(&[0.0; HALF]);
            for ((to, from), mask) in reflector.iter_mut().zip(&*column).zip(masks) {
                let half = wide.add_product(zero, wide.half(from), wide.half(mask));
                *to = wide.half_values(half);
            }
            let (before, rest) = (dot(wide, column, column), dot(wide, reflector, reflector));
            let gone = if j < *m { !pivots.count(rest, before) } else { rest <= 0.0 };
            if gone || (j < *m && rest <= VANISHED * before) {
                continue;
            }
            let norm = rest.sqrt();
            let value = column.as_flattened()[top];
            let sign = if value > 0.0 { 1.0 } else { -1.0 };
            let scale = -1.0 / (norm * (norm + value.abs()));
            // The reflector has `reach` more in its first row, which is added where it counts: so nothing but
            // `scale` waits for the root.
            let reach = sign * norm;
            let units = &self.unit[top * halves..][..halves];
            lower[j * w + j] = norm;
            for (i, other) in others.chunks_exact_mut(halves).enumerate() {
                let shadow = dot(wide, reflector, other);
                let along = scale * (shadow + reach * other.as_flattened()[top]);
                add(wide, other, along, reflector);
                add(wide, other, along * reach, units);
                lower[j * w + j + 1 + i] = -sign * other.as_flattened()[top];
            }
            top += 1;
        }
        pivots
    }
}

/// The reflections, for the widest instructions of the processor.
struct Reflect<'a, const HALVES: usize>(&'a mut SquareRoot);

impl<const HALVES: usize> Work for Reflect<'_, HALVES> {
    type Output = Pivots;

    #[inline(always)]
    fn with(self, wide: impl Wide) -> Pivots {
        self.0.reflect::<HALVES>(wide)
    }
}

/// `sum += factor vector`.
#[inline(always)]
fn add(wide: impl Wide, sum: &mut [[f64; HALF]], factor: f64, vector: &[[f64; HALF]]) {
    for (sum, half) in sum.iter_mut().zip(vector) {
        *sum = wide.half_values(wide.add_half(wide.half(sum), factor, wide.half(half)));
    }
}

/// Returns the scalar product of two vectors.
#[inline(always)]
fn dot(wide: impl Wide, left: &[[f64; HALF]], right: &[[f64; HALF]]) -> f64 {
    let mut sum = wide.half(&[0.0; HALF]);
    for (left, right) in left.iter().zip(right) {
        sum = wide.add_product(sum, wide.half(left), wide.half(right));
    }
    let [a, b, c, d] = wide.half_values(sum);
    (a + b) + (c + d)
}
