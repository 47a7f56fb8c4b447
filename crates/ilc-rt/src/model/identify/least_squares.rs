//! Nonlinear least squares for a handful of parameters.

use nalgebra::{DMatrix, DVector};

/// Largest number of steps.
const STEPS_MAX: usize = 200;
/// Relative decrease of the cost at which the search ends.
const DECREASE: f64 = 1e-14;
/// Largest damping: no step reduces the cost any more.
const DAMPING_MAX: f64 = 1e12;

/// A minimum.
#[derive(Debug, Clone)]
pub(super) struct Minimum {
    pub(super) parameters: Vec<f64>,
    /// Sum of the squares of the residuals.
    pub(super) cost: f64,
    /// Standard deviation of each parameter, from the remaining residuals.
    pub(super) deviation: Vec<f64>,
}

/// Minimises the squared residuals from `start` (Levenberg-Marquardt).
///
/// Derivatives are central differences, except for those that are `constant`, each with its parameter;
/// parameters should be of the order of 1. Non-finite residuals count as infinitely bad.
pub(super) fn minimize(
    start: &[f64],
    constant: &[(usize, DVector<f64>)],
    residuals: &dyn Fn(&[f64]) -> DVector<f64>,
) -> Minimum {
    let size = |r: &DVector<f64>| {
        let cost = r.norm_squared();
        if cost.is_finite() { cost } else { f64::INFINITY }
    };
    let mut x = DVector::from_column_slice(start);
    let mut r = residuals(x.as_slice());
    let (mut cost, mut damping) = (size(&r), 1e-3);
    let mut jacobian = DMatrix::zeros(r.len(), x.len());
    for (i, slope) in constant {
        jacobian.set_column(*i, slope);
    }
    let varying: Vec<usize> =
        (0..x.len()).filter(|i| constant.iter().all(|(known, _)| known != i)).collect();
    slopes(&x, &varying, residuals, &mut jacobian);
    for _ in 0..STEPS_MAX {
        crate::interrupt::point();
        let (gradient, normal) = (jacobian.tr_mul(&r), jacobian.tr_mul(&jacobian));
        let mut damped = normal.clone();
        for i in 0..x.len() {
            damped[(i, i)] += damping * normal[(i, i)].max(f64::MIN_POSITIVE);
        }
        let step = damped.cholesky().map(|factor| factor.solve(&gradient));
        let tried = step.map(|step| {
            let x = &x - step;
            let r = residuals(x.as_slice());
            (x, r)
        });
        match tried {
            Some((new_x, new_r)) if size(&new_r) < cost => {
                let decrease = (cost - size(&new_r)) / cost;
                (x, r) = (new_x, new_r);
                cost = size(&r);
                damping = (damping * 0.3).max(1e-12);
                if decrease < DECREASE {
                    break;
                }
                slopes(&x, &varying, residuals, &mut jacobian);
            }
            _ => {
                damping *= 4.0;
                if damping > DAMPING_MAX {
                    break;
                }
            }
        }
    }
    let freedom = r.len().saturating_sub(x.len()).max(1) as f64;
    let covariance = jacobian.tr_mul(&jacobian).try_inverse();
    let deviation = (0..x.len())
        .map(|i| {
            covariance
                .as_ref()
                .map_or(f64::INFINITY, |inverse| (inverse[(i, i)].max(0.0) * cost / freedom).sqrt())
        })
        .collect();
    Minimum { parameters: x.as_slice().to_vec(), cost, deviation }
}

/// Sets the columns of some parameters.
fn slopes(
    x: &DVector<f64>,
    varying: &[usize],
    residuals: &dyn Fn(&[f64]) -> DVector<f64>,
    jacobian: &mut DMatrix<f64>,
) {
    for &i in varying {
        crate::interrupt::point();
        let h = 1e-6 * x[i].abs().max(1.0);
        let (mut up, mut down) = (x.clone(), x.clone());
        up[i] += h;
        down[i] -= h;
        let column = (residuals(up.as_slice()) - residuals(down.as_slice())) / (2.0 * h);
        jacobian.set_column(i, &column);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_valley_of_rosenbrock_ends_at_one() {
        let known = [(1, DVector::from_column_slice(&[10.0, 0.0]))];
        for constant in [&[][..], &known] {
            let found = minimize(&[-1.2, 1.0], constant, &|x| {
                DVector::from_column_slice(&[10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]])
            });
            assert!(found.cost < 1e-20);
            assert!(found.parameters.iter().all(|x| (x - 1.0).abs() < 1e-9), "{found:?}");
        }
    }
}
