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
use super::wide::{HALF, Instructions, Wide, Work};

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
    /// `H^-1` (m x m), or no room for it.
    pub(super) inverse: &'a mut [f64],
}

/// Pivots, Cholesky factor of `H` and `K` (m x n) that another form has found, with its cost.
pub(super) type Given<'a> = Option<(Pivots, &'a [f64], &'a [f64])>;

/// Takes the step if the sizes are supported; otherwise leaves everything unchanged.
pub(super) fn step(
    how: Instructions,
    sizes: Sizes,
    stage: &Stage,
    given: Given,
    room: Room,
    back: &mut [f64],
    fore: &mut [f64],
) -> Option<Pivots> {
    macro_rules! choose {
        ($(($n:literal, $m:literal, $p:literal))*) => {
            match (sizes.n, sizes.m, sizes.p) {
                $(($n, $m, $p) => Some(widest($m, how).run(Step::<$n, $m, $p> { sizes, stage, given, room, back, fore })),)*
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
    given: Given<'a>,
    room: Room<'a>,
    back: &'a mut [f64],
    fore: &'a mut [f64],
}

impl<const N: usize, const M: usize, const P: usize> Work for Step<'_, N, M, P> {
    type Output = Pivots;

    #[inline(always)]
    fn with(self, wide: impl Wide) -> Pivots {
        let Self { sizes, stage, given, room, back, fore } = self;
        sized::<N, M, P>(wide, sizes, stage, given, room, back, fore)
    }
}

#[inline(always)]
fn sized<const N: usize, const M: usize, const P: usize>(
    wide: impl Wide,
    Sizes { targets, held, .. }: Sizes,
    stage: &Stage,
    given: Given,
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
    let weighted_d = product(wide, &q, &d);
    let weighted_c = product(wide, &q, &c);

    let mut factor: Columns<M, M>;
    let mut feedback: Columns<M, N>;
    let pivots = if let Some((pivots, lower, gain)) = given {
        (factor, feedback) = (read(lower), read(gain));
        pivots
    } else {
        factor = effort;
        add_product(wide, &mut factor, &dt, &weighted_d);
        add_product(wide, &mut factor, &bt, &product(wide, &later, &b));
        let lower = factor.as_flattened_mut();
        let pivots = cholesky::factorize(lower, M, M);
        cholesky::invert_diagonal(lower, M);
        feedback = product(wide, &dt, &weighted_c);
        add_product(wide, &mut feedback, &bt, &product(wide, &later, &a));
        for column in &mut feedback {
            cholesky::solve(lower, M, column);
        }
        pivots
    };
    let lower = factor.as_flattened();

    let minus: Columns<M, N> = feedback.map(|column| column.map(|value| -value));
    let (mut transition, mut left) = (a, c);
    add_product(wide, &mut transition, &b, &minus);
    add_product(wide, &mut left, &d, &minus);
    let weighted_left = product(wide, &q, &left);
    let transition_t = transposed(&transition);
    let weighted_left_t: Columns<N, P> = transposed(&weighted_left);
    let feedback_t: Columns<N, M> = transposed(&feedback);
    if given.is_none() {
        let mut cost = product(wide, &transition_t, &product(wide, &later, &transition));
        add_product(wide, &mut cost, &weighted_left_t, &left);
        add_product(wide, &mut cost, &feedback_t, &product(wide, &effort, &feedback));
        for col in 0..N {
            for row in 0..col {
                cost[row][col] = cost[col][row];
            }
        }
        room.cost.copy_from_slice(cost.as_flattened());
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
        let held = product(wide, &feedback_t, &s);
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
    room.transition.copy_from_slice(transition.as_flattened());
    room.weighted_c.copy_from_slice(weighted_c.as_flattened());
    cholesky::invert(lower, M, room.inverse);
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
    wide: impl Wide,
    left: &Columns<R, K>,
    right: &Columns<K, C>,
) -> Columns<R, C> {
    let mut matrix = [[0.0; R]; C];
    add_product(wide, &mut matrix, left, right);
    matrix
}

/// `sum += left right`.
#[inline(always)]
fn add_product<const R: usize, const K: usize, const C: usize>(
    wide: impl Wide,
    sum: &mut Columns<R, C>,
    left: &Columns<R, K>,
    right: &Columns<K, C>,
) {
    for (column, factors) in sum.iter_mut().zip(right) {
        let mut total = *column;
        if R.is_multiple_of(HALF) {
            // The compiler would take such columns apart.
            for (g, total) in total.as_chunks_mut::<HALF>().0.iter_mut().enumerate() {
                let mut half = wide.half(total);
                for (values, factor) in left.iter().zip(factors) {
                    half = wide.add_half(half, *factor, wide.half(&values.as_chunks().0[g]));
                }
                *total = wide.half_values(half);
            }
        } else {
            for (values, factor) in left.iter().zip(factors) {
                for row in 0..R {
                    total[row] += values[row] * factor;
                }
            }
        }
        *column = total;
    }
}
