//! The lifted system of a model and its adjoint, applied in linear time and matrix-free.

use nalgebra::{DMatrix, DVector, DVectorView, DVectorViewMut};

use super::LearningError;
use super::krylov::{Estimate, largest_in_order};
use crate::model::{StateSpace, Stepper};

/// Largest number of inputs for which the norm is always computed to [`TOLERANCE`].
const SHORT: usize = 2000;
/// Target residual, relative to the square of the norm.
const TOLERANCE: f64 = 1e-12;

/// `y = P u` and `v = P' e` for runs of a fixed number of samples.
///
/// `P` is block lower-triangular Toeplitz, its blocks the Markov parameters of the model.
///
/// # Real Time
/// Cold path. Allocates at creation, never in [`Operator::forward`] or [`Operator::transposed`].
#[derive(Debug, Clone)]
pub(crate) struct Operator {
    forward: Stepper,
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
            forward: Stepper::new([model.a(), model.b(), model.c(), model.d()]),
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
        self.forward.start(None);
        for (u, y) in u.chunks_exact(m).zip(y.chunks_exact_mut(p)) {
            self.forward.step(u, y);
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

    /// Returns the largest singular value for runs of `n_samples`, estimated from below with an
    /// error bound. Infinite if the model's response is unbounded.
    ///
    /// Value plus error is the safe side where a gain must stay below it. In short runs the value
    /// is exact up to rounding; in long ones, where many singular values lie close to the largest,
    /// the error is about one part in 1000.
    pub(crate) fn norm(&mut self, n_samples: usize) -> Estimate {
        let infinite = Estimate { value: f64::INFINITY, error: 0.0 };
        let (m, p) = (self.b.ncols(), self.c.nrows());
        let size = n_samples * m;
        let mut output = vec![0.0; n_samples * p];
        // A smaller basis in long runs: it dominates memory and time.
        let n_basis = if size <= SHORT { 150 } else { (6_000_000 / size).clamp(20, 100) };
        let n_products = if size <= SHORT { 3000 } else { n_basis.max(100) };
        // The default gain of `adjoint` follows from it, which a stored campaign names with all its digits.
        let square = largest_in_order(
            size,
            &mut |u, v| {
                self.forward(u, &mut output);
                self.transposed(&output, v);
                if v.iter().all(|value| value.is_finite()) {
                    return Ok(());
                }
                Err(LearningError::Numerics { what: "|P|", reason: "the model's answer overflows" })
            },
            n_basis,
            n_products,
            TOLERANCE,
        );
        let Ok(square) = square else { return infinite };
        let value = square.value.max(0.0).sqrt();
        // sqrt(value^2 + error) - value, without cancellation.
        let above = (square.value.max(0.0) + square.error).sqrt();
        let error = square.error / (above + value).max(f64::MIN_POSITIVE);
        if above.is_finite() { Estimate { value, error } } else { infinite }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::learning::krylov::noise;

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
            let apart = (found.value - norm).abs();
            prop_assert!(apart <= 1e-11 * norm + 1e-14, "{found:?} {norm}");
            prop_assert!(found.value + found.error >= norm * (1.0 - 1e-13), "{found:?} {norm}");
        }
    }

    /// A hundred varied operators, each against its dense singular values.
    #[test]
    fn the_norm_and_its_bound_hold_for_many_operators() {
        let lag = |pole: f64, gain: f64| {
            let one = |value| DMatrix::from_element(1, 1, value);
            StateSpace::discrete(one(pole), one(gain), one(1.0), one(0.0), 1.0).unwrap()
        };
        for seed in 1..=100_u64 {
            let draws = noise(61, seed);
            let sizes = [1 + seed % 3, 1 + seed / 3 % 3, 1 + seed / 9 % 3];
            let drawn = model(&draws, sizes.map(|size| usize::try_from(size).unwrap()));
            let (model, n_samples) = match seed % 4 {
                // Equal axes: every singular value is double.
                0 => (lag(0.9, 0.1).append(&lag(0.9, 0.1)).unwrap(), 150),
                // A pure gain with dead time: all singular values are equal.
                1 => (lag(0.0, 3.0), 200),
                // A long plateau: a cluster of singular values just below the largest.
                2 => (lag(0.05 + 0.9 * draws[0].abs(), 1.0), 260),
                _ => (drawn, 1 + usize::try_from(seed).unwrap() % 90),
            };
            let norm = model.lifted(n_samples).unwrap().svd(false, false).singular_values.max();
            let found = Operator::new(&model).norm(n_samples);
            assert!((found.value - norm).abs() <= 1e-10 * norm, "seed {seed}: {found:?} {norm}");
            let above = found.value + found.error;
            assert!(above >= norm * (1.0 - 1e-13), "seed {seed}: {found:?} {norm}");
            assert!(found.error <= 1e-5 * norm, "seed {seed}: {found:?} {norm}");
        }
    }

    #[test]
    fn the_norm_of_a_long_operator_is_that_of_its_peak() {
        // A first-order lag has its largest gain at frequency zero: 0.1 / (1 - 0.9) = 1.
        let one = |value| DMatrix::from_element(1, 1, value);
        let lag = StateSpace::discrete(one(0.9), one(0.1), one(1.0), one(0.0), 1.0).unwrap();
        let norm = Operator::new(&lag).norm(20_000);
        assert!((0.998..=1.0 + 1e-12).contains(&norm.value), "{norm:?}");
        assert!(norm.value + norm.error >= 1.0 - 1e-6 && norm.error < 5e-3, "{norm:?}");
    }

    #[test]
    fn an_answer_beyond_all_bounds_has_an_infinite_norm() {
        let one = |value| DMatrix::from_element(1, 1, value);
        let runaway = StateSpace::discrete(one(1e3), one(1.0), one(1.0), one(0.0), 1.0).unwrap();
        assert!(Operator::new(&runaway).norm(400).value.is_infinite());
        let mute = StateSpace::discrete(one(0.5), one(0.0), one(1.0), one(0.0), 1.0).unwrap();
        assert!(Operator::new(&mute).norm(400).value.abs() < 1e-300);
    }
}
