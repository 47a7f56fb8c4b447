//! The lifted operator of a model and its transpose, applied in linear time and never formed.

use nalgebra::{DMatrix, DVector, DVectorView, DVectorViewMut, SymmetricEigen};

use crate::model::StateSpace;

/// Lanczos steps for the norm: the largest singular value is then known to about one part in 1000
/// for operators of any length, and far better for those up to a few hundred samples.
const LANCZOS_STEPS: usize = 100;

/// `y = P u` and `v = P' e` for runs of a fixed number of samples.
///
/// `P` is block lower-triangular Toeplitz, its blocks the Markov parameters of the model.
///
/// # Real Time
/// Cold path. Allocates when it is made, never in [`Operator::forward`] or [`Operator::transposed`].
#[derive(Debug, Clone)]
pub(crate) struct Operator {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    state: DVector<f64>,
    other: DVector<f64>,
}

impl Operator {
    pub(crate) fn new(model: &StateSpace) -> Self {
        let n = model.n_states();
        Self {
            a: model.a().clone(),
            b: model.b().clone(),
            c: model.c().clone(),
            d: model.d().clone(),
            state: DVector::zeros(n),
            other: DVector::zeros(n),
        }
    }

    /// Simulates the model from rest: `x[k+1] = A x[k] + B u[k]`, `y[k] = C x[k] + D u[k]`.
    pub(crate) fn forward(&mut self, u: &[f64], y: &mut [f64]) {
        let (m, p) = (self.b.ncols(), self.c.nrows());
        self.state.fill(0.0);
        for (u, y) in u.chunks_exact(m).zip(y.chunks_exact_mut(p)) {
            let u = DVectorView::from_slice(u, m);
            let mut y = DVectorViewMut::from_slice(y, p);
            y.gemv(1.0, &self.c, &self.state, 0.0);
            y.gemv(1.0, &self.d, &u, 1.0);
            self.other.gemv(1.0, &self.a, &self.state, 0.0);
            self.other.gemv(1.0, &self.b, &u, 1.0);
            std::mem::swap(&mut self.state, &mut self.other);
        }
    }

    /// Simulates the adjoint model backward: `v[k] = B' l[k+1] + D' e[k]`,
    /// `l[k] = A' l[k+1] + C' e[k]`, `l[N] = 0`.
    pub(crate) fn transposed(&mut self, e: &[f64], v: &mut [f64]) {
        let (m, p) = (self.b.ncols(), self.c.nrows());
        self.state.fill(0.0);
        for (e, v) in e.chunks_exact(p).rev().zip(v.chunks_exact_mut(m).rev()) {
            let e = DVectorView::from_slice(e, p);
            let mut v = DVectorViewMut::from_slice(v, m);
            v.gemv_tr(1.0, &self.b, &self.state, 0.0);
            v.gemv_tr(1.0, &self.d, &e, 1.0);
            self.other.gemv_tr(1.0, &self.a, &self.state, 0.0);
            self.other.gemv_tr(1.0, &self.c, &e, 1.0);
            std::mem::swap(&mut self.state, &mut self.other);
        }
    }

    /// Returns the largest singular value for runs of `n_samples`, approached from below.
    pub(crate) fn norm(&mut self, n_samples: usize) -> f64 {
        let (m, p) = (self.b.ncols(), self.c.nrows());
        let size = n_samples * m;
        let mut before = DVector::zeros(size);
        // Any start with a part along the dominant direction will do; this one is no signal's.
        let mut seed = 1_u64;
        let mut now = DVector::from_fn(size, |_, _| {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / 9_007_199_254_740_992.0 - 0.5
        });
        let length = now.norm();
        now /= length;
        let (mut output, mut next) = (vec![0.0; n_samples * p], DVector::zeros(size));
        let (mut diagonal, mut beside) = (Vec::new(), Vec::new());
        for _ in 0..LANCZOS_STEPS {
            self.forward(now.as_slice(), &mut output);
            self.transposed(&output, next.as_mut_slice());
            let along = next.dot(&now);
            next.axpy(-along, &now, 1.0);
            next.axpy(-beside.last().copied().unwrap_or(0.0), &before, 1.0);
            diagonal.push(along);
            let rest = next.norm();
            if !rest.is_finite() {
                return f64::INFINITY;
            }
            if rest <= 1e-13 * diagonal.iter().copied().fold(0.0, f64::max) {
                break;
            }
            beside.push(rest);
            next /= rest;
            std::mem::swap(&mut before, &mut now);
            std::mem::swap(&mut now, &mut next);
        }
        let steps = diagonal.len();
        let projected = DMatrix::from_fn(steps, steps, |row, col| match row.abs_diff(col) {
            0 => diagonal[row],
            1 => beside[row.min(col)],
            _ => 0.0,
        });
        SymmetricEigen::new(projected).eigenvalues.max().max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn model(values: &[f64], [n, m, p]: [usize; 3]) -> StateSpace {
        let mut given = values.iter().copied().cycle();
        let mut matrix = |rows, cols| DMatrix::from_fn(rows, cols, |_, _| given.next().unwrap());
        let (a, b, c, d) = (matrix(n, n) * 0.4, matrix(n, m), matrix(p, n), matrix(p, m));
        StateSpace::discrete(a, b, c, d, 1.0).unwrap()
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn both_directions_and_the_norm_are_those_of_the_dense_operator(
            values in prop::collection::vec(-1.0..1.0_f64, 61),
            sizes in [1_usize..4, 1..4, 1..4],
            n_samples in 1_usize..30,
        ) {
            let model = model(&values, sizes);
            let dense = model.lifted(n_samples).unwrap();
            let mut operator = Operator::new(&model);
            let u: Vec<f64> = (0..dense.ncols()).map(|k| values[k % 61]).collect();
            let e: Vec<f64> = (0..dense.nrows()).map(|k| values[60 - k % 61]).collect();
            let (mut y, mut v) = (vec![0.0; e.len()], vec![0.0; u.len()]);
            operator.forward(&u, &mut y);
            operator.transposed(&e, &mut v);
            let expected_y = &dense * DVector::from_vec(u);
            let expected_v = dense.transpose() * DVector::from_vec(e);
            let scale = 1.0 + dense.norm();
            prop_assert!(y.iter().zip(&expected_y).all(|(a, b)| (a - b).abs() < 1e-12 * scale));
            prop_assert!(v.iter().zip(&expected_v).all(|(a, b)| (a - b).abs() < 1e-12 * scale));
            let norm = dense.svd(false, false).singular_values.max();
            let found = operator.norm(n_samples);
            prop_assert!((found - norm).abs() <= 1e-9 * norm + 1e-12, "{found} {norm}");
        }
    }

    #[test]
    fn the_norm_of_a_long_operator_is_that_of_its_peak() {
        // A first-order lag has its largest gain at frequency zero: 0.1 / (1 - 0.9) = 1.
        let one = |value| DMatrix::from_element(1, 1, value);
        let lag = StateSpace::discrete(one(0.9), one(0.1), one(1.0), one(0.0), 1.0).unwrap();
        let norm = Operator::new(&lag).norm(20_000);
        assert!((0.998..=1.0).contains(&norm), "{norm}");
    }
}
