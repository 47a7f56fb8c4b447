//! The factor of a norm-optimal law on its own model, from the weakest direction of the plant.
//!
//! With a constant weight of the change, `T = r (P'QP + s + r)^-1` is symmetric: its spectral radius, its
//! norm and its growth all follow from the smallest eigenvalue of `P'QP`. Long runs have many
//! eigenvalues of `T` close to the largest one, which no iteration with `T` tells apart; with
//! `(P'QP + shift)^-1`, which the same sweep applies, they lie far from each other.

use super::iteration::Iteration;
use crate::learning::Result;
use crate::learning::krylov::{Estimate, largest_until, noise, norm};
use crate::learning::law::norm_optimal::{NormOptimal, Weights};
use crate::model::StateSpace;

/// Shift relative to the weights of the input, and its least value relative to `|P'QP|`: below it rounding errors
/// grow.
const SHIFT: f64 = 1e-6;
const LEAST: f64 = 1e-9;
/// Target error of the factor.
const TOLERANCE: f64 = 1e-11;
/// Size of the basis, and largest number of products.
const BASIS: usize = 40;
const PRODUCTS: usize = 400;

/// Returns the largest eigenvalue of `T` and at the same time its norm; `None` unless the law weighs the change
/// by `r` alone.
pub(super) fn factor(
    iteration: &Iteration,
    model: &StateSpace,
    weights: Weights,
) -> Result<Option<Estimate>> {
    let Weights { q, s, r, rate } = weights;
    if rate != 0.0 || r <= 0.0 {
        return Ok(None);
    }
    let n = iteration.n_u();
    let mut start = noise(n, 5);
    iteration.clear(&mut start);
    let size = norm(&start);
    if size == 0.0 {
        return Ok(None);
    }
    let (mut error, mut back) = (vec![0.0; iteration.n_e()], vec![0.0; n]);
    iteration.plant.apply(&start, &mut error);
    iteration.plant.apply_transposed(&error, &mut back);
    let shift = (SHIFT * (r + s)).max(LEAST * q * norm(&back) / size);
    let Ok(mut law) =
        NormOptimal::new(model, iteration.n_samples, Weights { q, s: 0.0, r: shift, rate })
    else {
        return Ok(None);
    };
    // The eigenvalue of P'QP, and the factor that belongs to it.
    let weakest = |value: f64| (1.0 / value - shift).max(0.0);
    let factor = |weakest: f64| r / (r + s + weakest);
    let error_of =
        |value: f64, residual: f64| residual / (value * value) * factor(weakest(value)).powi(2) / r;
    let mut is_known = true;
    let map = &mut |x: &[f64], out: &mut [f64]| {
        is_known &= law.solve(x, out)?;
        iteration.clear(out);
        Ok(())
    };
    let enough = |value: f64, residual: f64| error_of(value, residual) <= TOLERANCE;
    let found = largest_until(n, map, (BASIS, PRODUCTS), start, &enough)?;
    if !(is_known && found.value > 0.0 && found.value.is_finite()) {
        return Ok(None);
    }
    let error = error_of(found.value, found.error);
    Ok(Some(Estimate { value: factor(weakest(found.value)), error }))
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::learning::analysis::dense::Dense;
    use crate::model::{Method, discretize, second_order};

    fn axis(natural_rad_s: f64) -> StateSpace {
        let model = second_order(natural_rad_s, 0.5).unwrap();
        discretize(&model, 1e-3, Method::ZeroOrderHold).unwrap()
    }

    /// Slow and quick axes, several at once, with dead time and with a zero outside the unit circle.
    #[test]
    fn the_factor_is_that_of_the_dense_matrix() {
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let backward = StateSpace::discrete(one(0.5), one(1.0), one(1.7), one(1.0), 1e-3).unwrap();
        let skew = DMatrix::from_row_slice(2, 2, &[1.1, 0.4, -0.3, 0.8]);
        let coupled = axis(157.0)
            .append(&axis(900.0))
            .unwrap()
            .series(&StateSpace::static_gain(skew, Some(1e-3)).unwrap())
            .unwrap();
        for (n, model) in [
            (150, axis(157.0)),
            (150, axis(900.0)),
            (120, axis(300.0).delayed(3).unwrap()),
            (100, backward),
            (60, coupled),
        ] {
            for (s, r) in [(0.0, 0.1), (0.0, 1e-6), (1e-3, 10.0), (2.0, 0.5)] {
                let weights = Weights { q: 2.0, s, r, rate: 0.0 };
                let mut law = NormOptimal::new(&model, n, weights).unwrap();
                let mut iteration = Iteration::new(&mut law, &model, n).unwrap();
                let found = factor(&iteration, &model, weights).unwrap().unwrap();
                let dense = Dense::new(&mut iteration).unwrap().monotonic_factor().unwrap();
                let apart = (found.value - dense.value).abs();
                assert!(apart <= 1e-10 + found.error, "{n}, s {s}, r {r}: {found:?}, {dense:?}");
                assert!(found.error <= 1e-8, "{n}, s {s}, r {r}: {found:?}");
            }
        }
    }

    #[test]
    fn a_weight_of_the_rate_is_left_to_the_general_method() {
        let (model, weights) = (axis(157.0), Weights { q: 1.0, s: 0.0, r: 0.1, rate: 1.0 });
        let mut law = NormOptimal::new(&model, 50, weights).unwrap();
        let iteration = Iteration::new(&mut law, &model, 50).unwrap();
        assert_eq!(factor(&iteration, &model, weights).unwrap(), None);
    }
}
