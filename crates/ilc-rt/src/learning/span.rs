//! Products and combinations of long vectors, four vectors at a time.
//!
//! A sum that grows number by number waits for each addition. Here eight partial sums of each of four
//! vectors grow side by side, with the widest instructions of the processor and in an order that does
//! not depend on them.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "compiled anew for the instructions of each processor, which closures are not"
)]

use super::sweep::wide::{Instructions, LANES, Wide, Work};

/// Vectors that share one pass over the other operand.
const GROUP: usize = 4;

/// Returns the scalar products of vectors of one length with `x`.
pub(super) fn products(vectors: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    let mut found = vec![0.0; vectors.len()];
    Instructions::best().run(Products { vectors, x, found: &mut found });
    found
}

/// `sum += factor_1 vector_1 + factor_2 vector_2 + ..`, vectors without a factor being left out.
pub(super) fn combine(vectors: &[Vec<f64>], factors: &[f64], sum: &mut [f64]) {
    Instructions::best().run(Combine { vectors, factors, sum });
}

/// Returns the scalar product of two vectors.
pub(super) fn product(left: &[f64], right: &[f64]) -> f64 {
    Instructions::best().run(Product { left, right })
}

struct Product<'a> {
    left: &'a [f64],
    right: &'a [f64],
}

impl Work for Product<'_> {
    type Output = f64;

    #[inline(always)]
    fn with(self, wide: impl Wide) -> f64 {
        // Four rows, so that four additions are under way at a time.
        let mut sums = [wide.row(&[0.0; LANES]); GROUP];
        let length = self.left.len().min(self.right.len());
        let (left, right) = (&self.left[..length], &self.right[..length]);
        let mut rows = left.chunks_exact(LANES * GROUP).zip(right.chunks_exact(LANES * GROUP));
        for (left, right) in rows.by_ref() {
            for i in 0..GROUP {
                let (left, right) = (row(wide, left, i * LANES), row(wide, right, i * LANES));
                sums[i] = wide.add(sums[i], wide.multiply(left, right));
            }
        }
        let done = length - length % (LANES * GROUP);
        let both = wide.add(wide.add(sums[0], sums[1]), wide.add(sums[2], sums[3]));
        total(wide.values(both)) + rest(&left[done..], &right[done..])
    }
}

struct Products<'a> {
    vectors: &'a [Vec<f64>],
    x: &'a [f64],
    found: &'a mut [f64],
}

impl Work for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Self { vectors, x, found } = self;
        let done = x.len() - x.len() % LANES;
        for (group, found) in vectors.chunks(GROUP).zip(found.chunks_mut(GROUP)) {
            let mut sums = [wide.row(&[0.0; LANES]); GROUP];
            if let [a, b, c, d] = group {
                for at in (0..done).step_by(LANES) {
                    let x = row(wide, x, at);
                    sums[0] = wide.add(sums[0], wide.multiply(row(wide, a, at), x));
                    sums[1] = wide.add(sums[1], wide.multiply(row(wide, b, at), x));
                    sums[2] = wide.add(sums[2], wide.multiply(row(wide, c, at), x));
                    sums[3] = wide.add(sums[3], wide.multiply(row(wide, d, at), x));
                }
            } else {
                for (sum, vector) in sums.iter_mut().zip(group) {
                    for at in (0..done).step_by(LANES) {
                        let x = row(wide, x, at);
                        *sum = wide.add(*sum, wide.multiply(row(wide, vector, at), x));
                    }
                }
            }
            for i in 0..found.len() {
                found[i] = total(wide.values(sums[i])) + rest(&group[i][done..], &x[done..]);
            }
        }
    }
}

struct Combine<'a> {
    vectors: &'a [Vec<f64>],
    factors: &'a [f64],
    sum: &'a mut [f64],
}

impl Work for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Self { vectors, factors, sum } = self;
        let done = sum.len() - sum.len() % LANES;
        for (group, factors) in vectors.chunks(GROUP).zip(factors.chunks(GROUP)) {
            if let ([a, b, c, d], [fa, fb, fc, fd]) = (group, factors) {
                for at in (0..done).step_by(LANES) {
                    let mut value = wide.add(row(wide, sum, at), wide.scale(*fa, row(wide, a, at)));
                    value = wide.add(value, wide.scale(*fb, row(wide, b, at)));
                    value = wide.add(value, wide.scale(*fc, row(wide, c, at)));
                    value = wide.add(value, wide.scale(*fd, row(wide, d, at)));
                    sum[at..at + LANES].copy_from_slice(&wide.values(value));
                }
            } else {
                for (vector, factor) in group.iter().zip(factors) {
                    for at in (0..done).step_by(LANES) {
                        let part = wide.scale(*factor, row(wide, vector, at));
                        let value = wide.add(row(wide, sum, at), part);
                        sum[at..at + LANES].copy_from_slice(&wide.values(value));
                    }
                }
            }
            for (vector, factor) in group.iter().zip(factors) {
                for at in done..sum.len() {
                    sum[at] += factor * vector[at];
                }
            }
        }
    }
}

/// Returns eight numbers of a vector; zeros beyond its end.
#[inline(always)]
fn row<W: Wide>(wide: W, vector: &[f64], at: usize) -> W::Row {
    vector[at..].first_chunk().map_or_else(|| wide.row(&[0.0; LANES]), |row| wide.row(row))
}

#[inline(always)]
fn total([a, b, c, d, e, f, g, h]: [f64; LANES]) -> f64 {
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

#[inline(always)]
fn rest(left: &[f64], right: &[f64]) -> f64 {
    let mut sum = 0.0;
    for i in 0..left.len().min(right.len()) {
        sum += left[i] * right[i];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(count: usize, seed: usize) -> Vec<f64> {
        (0..count).map(|k| ((k * k + 31 * seed) as f64).sin()).collect()
    }

    /// Lengths and numbers of vectors with and without a remainder, against plain sums.
    #[test]
    fn products_and_combinations_are_those_of_plain_sums() {
        for n in [1, 7, 8, 31, 32, 33, 64, 1003] {
            for count in [0, 1, 3, 4, 5, 8, 11] {
                let vectors: Vec<Vec<f64>> = (0..count).map(|i| noise(n, 3 + i)).collect();
                let x = noise(n, 77);
                let found = products(&vectors, &x);
                let mut sum = x.clone();
                combine(&vectors, &found, &mut sum);
                let mut expected = x.clone();
                assert_eq!(found.len(), vectors.len());
                for (vector, found) in vectors.iter().zip(&found) {
                    let plain: f64 = vector.iter().zip(&x).map(|(v, x)| v * x).sum();
                    assert!((plain - found).abs() <= 1e-15 * n as f64, "{n} {count}");
                    assert!((product(vector, &x) - plain).abs() <= 1e-15 * n as f64);
                    for (sum, v) in expected.iter_mut().zip(vector) {
                        *sum += found * v;
                    }
                }
                for (found, expected) in sum.iter().zip(&expected) {
                    assert!((found - expected).abs() <= 1e-13 * n as f64, "{n} {count}");
                }
            }
        }
    }
}
