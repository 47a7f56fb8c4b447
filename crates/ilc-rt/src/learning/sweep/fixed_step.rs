//! One step of the backward recursion in Joseph form for sizes known at compile time.

#![expect(
    clippy::needless_range_loop,
    clippy::needless_pass_by_value,
    clippy::inline_always,
    reason = "the indices are those of the equations; room is lent and given back; compiled anew for the \
              instructions of each processor"
)]

use super::Stage;
use super::cholesky::{self, Pivots};
use super::record::Sizes;
use super::wide::{Instructions, Wide, Work};

/// Workspace of a step besides the gains; column-major.
pub(super) struct Room<'a> {
    /// `Pi` one sample later (n x n).
    pub(super) later: &'a [f64],
    /// `Pi` (n x n).
    pub(super) cost: &'a mut [f64],
    /// `A - B K` (n x n).
    pub(super) transition: &'a mut [f64],
    /// `Q C` (p x n).
    pub(super) weighted_c: &'a mut [f64],
}

/// Takes the step if the sizes are supported; otherwise leaves everything unchanged.
pub(super) fn step(
    how: Instructions,
    sizes: Sizes,
    stage: &Stage,
    room: Room,
    back: &mut [f64],
    fore: &mut [f64],
) -> Option<Pivots> {
    macro_rules! choose {
        ($(($n:literal, $m:literal, $p:literal))*) => {
            match (sizes.n, sizes.m, sizes.p) {
                $(($n, $m, $p) => Some(widest($m, how).run(Step::<$n, $m, $p> { sizes, stage, room, back, fore })),)*
                _ => None,
            }
        };
    }
    choose!((1, 1, 1)(2, 1, 1)(3, 1, 1)(4, 1, 1)(2, 1, 2)(3, 1, 2)(4, 1, 2)(2, 2, 2)(4, 2, 2)(
        6, 2, 2
    )(8, 2, 2)(4, 2, 4)(6, 2, 4)(6, 3, 3))
}

/// A column-major matrix.
type Columns<const R: usize, const C: usize> = [[f64; R]; C];

/// Returns the instructions for a number of inputs: with one, entering wider ones takes longer than they save.
fn widest(n_inputs: usize, best: Instructions) -> Instructions {
    if n_inputs > 1 { best } else { Instructions::Portable }
}

/// A step of fixed size.
struct Step<'a, const N: usize, const M: usize, const P: usize> {
    sizes: Sizes,
    stage: &'a Stage,
    room: Room<'a>,
    back: &'a mut [f64],
    fore: &'a mut [f64],
}

impl<const N: usize, const M: usize, const P: usize> Work for Step<'_, N, M, P> {
    type Output = Pivots;

    #[inline(always)]
    fn with(self, _: impl Wide) -> Pivots {
        sized::<N, M, P>(self.sizes, self.stage, self.room, self.back, self.fore)
    }
}

#[inline(always)]
fn sized<const N: usize, const M: usize, const P: usize>(
    Sizes { targets, held, .. }: Sizes,
    stage: &Stage,
    room: Room,
    back: &mut [f64],
    fore: &mut [f64],
) -> Pivots {
    let a: Columns<N, N> = read(stage.a.as_slice());
    let b: Columns<N, M> = read(stage.b.as_slice());
    let c: Columns<P, N> = read(stage.c.as_slice());
    let d: Columns<P, M> = read(stage.d.as_slice());
    let q: Columns<P, P> = read(stage.q.as_slice());
    let s: Columns<M, M> = read(stage.s.as_slice());
    let r: Columns<M, M> = read(stage.r.as_slice());
    let later: Columns<N, N> = read(room.later);
    let effort: Columns<M, M> =
        std::array::from_fn(|col| std::array::from_fn(|row| s[col][row] + r[col][row]));
    let (bt, dt): (Columns<M, N>, Columns<M, P>) = (transposed(&b), transposed(&d));
    let weighted_d = product(&q, &d);
    let weighted_c = product(&q, &c);

    let mut h = effort;
    add_product(&mut h, &dt, &weighted_d);
    add_product(&mut h, &bt, &product(&later, &b));
    let lower = h.as_flattened_mut();
    let pivots = cholesky::factorize(lower, M, M);
    cholesky::invert_diagonal(lower, M);
    let mut feedback = product(&dt, &weighted_c);
    add_product(&mut feedback, &bt, &product(&later, &a));
    for column in &mut feedback {
        cholesky::solve(lower, M, column);
    }

    let minus: Columns<M, N> = feedback.map(|column| column.map(|value| -value));
    let (mut transition, mut left) = (a, c);
    add_product(&mut transition, &b, &minus);
    add_product(&mut left, &d, &minus);
    let weighted_left = product(&q, &left);
    let transition_t = transposed(&transition);
    let weighted_left_t: Columns<N, P> = transposed(&weighted_left);
    let mut cost = product(&transition_t, &product(&later, &transition));
    add_product(&mut cost, &weighted_left_t, &left);
    let feedback_t: Columns<N, M> = transposed(&feedback);
    add_product(&mut cost, &feedback_t, &product(&effort, &feedback));
    for col in 0..N {
        for row in 0..col {
            cost[row][col] = cost[col][row];
        }
    }

    let mut columns = back.chunks_exact_mut(N + M);
    let mut put = |first: &[f64; N], mut others: [f64; M]| {
        cholesky::solve(lower, M, &mut others);
        if let Some(column) = columns.next() {
            column[..N].copy_from_slice(first);
            column[N..].copy_from_slice(&others);
        }
    };
    for j in 0..N {
        put(&transition_t[j], bt[j]);
    }
    for j in 0..targets.min(P) {
        put(&weighted_left_t[j], std::array::from_fn(|i| weighted_d[i][j]));
    }
    if held > 0 {
        let held = product(&feedback_t, &s);
        for j in 0..M {
            put(&held[j], s[j].map(|value| -value));
        }
    }
    let (from_state, from_drive) = fore.split_at_mut(N * (N + M));
    for (column, (moved, fed)) in
        from_state.chunks_exact_mut(N + M).zip(transition.iter().zip(&minus))
    {
        column[..N].copy_from_slice(moved);
        column[N..].copy_from_slice(fed);
    }
    from_drive.copy_from_slice(b.as_flattened());
    room.cost.copy_from_slice(cost.as_flattened());
    room.transition.copy_from_slice(transition.as_flattened());
    room.weighted_c.copy_from_slice(weighted_c.as_flattened());
    pivots
}

#[inline(always)]
fn read<const R: usize, const C: usize>(values: &[f64]) -> Columns<R, C> {
    let mut matrix = [[0.0; R]; C];
    for (column, values) in matrix.iter_mut().zip(values.chunks_exact(R)) {
        column.copy_from_slice(values);
    }
    matrix
}

#[inline(always)]
fn transposed<const R: usize, const C: usize>(matrix: &Columns<R, C>) -> Columns<C, R> {
    std::array::from_fn(|col| std::array::from_fn(|row| matrix[row][col]))
}

#[inline(always)]
fn product<const R: usize, const K: usize, const C: usize>(
    left: &Columns<R, K>,
    right: &Columns<K, C>,
) -> Columns<R, C> {
    let mut matrix = [[0.0; R]; C];
    add_product(&mut matrix, left, right);
    matrix
}

/// `sum += left right`.
#[inline(always)]
fn add_product<const R: usize, const K: usize, const C: usize>(
    sum: &mut Columns<R, C>,
    left: &Columns<R, K>,
    right: &Columns<K, C>,
) {
    for (column, factors) in sum.iter_mut().zip(right) {
        let mut total = *column;
        for (values, factor) in left.iter().zip(factors) {
            for row in 0..R {
                total[row] += values[row] * factor;
            }
        }
        *column = total;
    }
}
