//! Matrix-free eigenvalues and fixed points (Krylov methods).
//!
//! Lanczos for symmetric maps, Arnoldi for others, GMRES for fixed points; no `N x N` matrix of the
//! run's length is stored. [`analysis`](super::analysis) and the norm of the lifted system use it.

use ilc_numerics::Matrix;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::span::{combine, product, products};
use crate::learning::{LearningError, Result};

/// A value with an error estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Estimate of its largest error.
    pub error: f64,
}

impl Estimate {
    /// Returns a value that is exact up to rounding.
    pub(in crate::learning) fn exact(value: f64) -> Self {
        Self { value, error: value.abs() * 1e-12 }
    }
}

type Map<'a> = dyn FnMut(&[f64], &mut [f64]) -> Result + 'a;

/// Returns the largest eigenvalue of a symmetric, positive semidefinite map.
///
/// Thick-restarted Lanczos with full orthogonalisation. The error is the residual of the
/// eigenvector, within which an eigenvalue lies.
pub(in crate::learning) fn largest_symmetric(
    n: usize,
    map: &mut Map,
    n_basis: usize,
    n_products_max: usize,
    tolerance: f64,
) -> Result<Estimate> {
    let enough = |value: f64, residual: f64| residual <= tolerance * value.abs();
    largest_until(n, map, (n_basis, n_products_max), noise(n, 5), &enough)
}

/// [`largest_symmetric`] with every sum in the order of its terms, for what has to be the same bit by bit as ever.
pub(in crate::learning) fn largest_in_order(
    n: usize,
    map: &mut Map,
    n_basis: usize,
    n_products_max: usize,
    tolerance: f64,
) -> Result<Estimate> {
    let enough = |value: f64, residual: f64| residual <= tolerance * value.abs();
    largest(Sums::InOrder, n, map, (n_basis, n_products_max), noise(n, 5), &enough)
}

/// [`largest_symmetric`] from a given start, until `enough` accepts the value with its residual.
pub(in crate::learning) fn largest_until(
    n: usize,
    map: &mut Map,
    (n_basis, n_products_max): (usize, usize),
    start: Vec<f64>,
    enough: &dyn Fn(f64, f64) -> bool,
) -> Result<Estimate> {
    largest(Sums::SideBySide, n, map, (n_basis, n_products_max), start, enough)
}

fn largest(
    sums: Sums,
    n: usize,
    map: &mut Map,
    (n_basis, n_products_max): (usize, usize),
    start: Vec<f64>,
    enough: &dyn Fn(f64, f64) -> bool,
) -> Result<Estimate> {
    let n_basis = n_basis.min(n).max(1);
    let n_kept = n_basis / 3;
    let mut basis: Vec<Vec<f64>> = vec![sums.unit(start)];
    let mut small = DMatrix::<f64>::zeros(n_basis, n_basis);
    let mut n_products = 0;
    let mut at = 0;
    loop {
        let mut left = 0.0;
        while at < n_basis {
            let mut next = vec![0.0; n];
            map(&basis[at], &mut next)?;
            n_products += 1;
            for (i, value) in sums.orthogonalise(&basis, &mut next).into_iter().enumerate() {
                small[(i, at)] = value;
                small[(at, i)] = value;
            }
            left = sums.norm(&next);
            at += 1;
            if left <= 1e-14 * small[(0, 0)].abs().max(f64::MIN_POSITIVE) {
                // The subspace is invariant: its eigenvalues are exact.
                break;
            }
            basis.push(sums.unit(next));
        }
        let eigen = SymmetricEigen::new(small.view((0, 0), (at, at)).into_owned());
        let mut order: Vec<usize> = (0..at).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let value = eigen.eigenvalues[order[0]];
        let residual = left * eigen.eigenvectors[(at - 1, order[0])].abs();
        let done = enough(value, residual) || at == n || basis.len() <= at;
        if done || n_products >= n_products_max || n_kept == 0 {
            let error = residual.min(value.abs()).max(1e-14 * value.abs());
            return Ok(Estimate { value, error });
        }
        let Some(last) = basis.pop() else { return Ok(Estimate { value, error: residual }) };
        let kept: Vec<Vec<f64>> = order[..n_kept]
            .iter()
            .map(|column| {
                let mut sum = vec![0.0; n];
                sums.combine(&basis, eigen.eigenvectors.column(*column).as_slice(), &mut sum);
                sum
            })
            .collect();
        basis = kept;
        small.fill(0.0);
        for (i, column) in order[..n_kept].iter().enumerate() {
            small[(i, i)] = eigen.eigenvalues[*column];
        }
        let mut last = last;
        sums.orthogonalise(&basis, &mut last);
        basis.push(sums.unit(last));
        at = n_kept;
    }
}

/// Returns the spectral radius of a map, by Arnoldi after some power iterations.
///
/// The error is the change of the estimate over the last sixth of the basis.
pub(in crate::learning) fn spectral_radius(
    n: usize,
    map: &mut Map,
    n_plain: usize,
    n_basis: usize,
) -> Result<Estimate> {
    let n_basis = n_basis.min(n).max(1);
    let mut start = unit(noise(n, 9));
    let mut next = vec![0.0; n];
    for _ in 0..n_plain {
        map(&start, &mut next)?;
        let size = norm(&next);
        if size == 0.0 {
            // A nilpotent map, as that of a law that inverts in one step.
            return Ok(Estimate { value: 0.0, error: 0.0 });
        }
        for (value, from) in start.iter_mut().zip(&next) {
            *value = from / size;
        }
    }
    let mut basis = vec![start];
    let mut small = DMatrix::<f64>::zeros(n_basis, n_basis);
    let mut size = n_basis;
    for at in 0..n_basis {
        map(&basis[at], &mut next)?;
        for (i, value) in orthogonalise(&basis, &mut next).into_iter().enumerate() {
            small[(i, at)] = value;
        }
        let left = norm(&next);
        if left <= 1e-13 * small.column(at).norm().max(f64::MIN_POSITIVE) {
            size = at + 1;
            break;
        }
        if at + 1 < n_basis {
            small[(at + 1, at)] = left;
            basis.push(unit(next.clone()));
        }
    }
    let value = radius(&small.view((0, 0), (size, size)).into_owned())?;
    if size < n_basis || size == n {
        return Ok(Estimate { value, error: 1e-10 * value });
    }
    let before = size - (size / 6).max(1).min(size - 1);
    let earlier = radius(&small.view((0, 0), (before, before)).into_owned())?;
    Ok(Estimate { value, error: (value - earlier).abs().max(1e-12 * value) })
}

/// Solves `x = map(x) + right` by restarted GMRES; returns the solution and its relative residual.
pub(in crate::learning) fn fixed_point(
    map: &mut Map,
    right: &[f64],
    n_basis: usize,
    n_restarts: usize,
    tolerance: f64,
) -> Result<(Vec<f64>, f64)> {
    let n = right.len();
    let n_basis = n_basis.min(n);
    let scale = norm(right);
    let mut x = vec![0.0; n];
    if scale == 0.0 {
        return Ok((x, 0.0));
    }
    let mut image = vec![0.0; n];
    let mut residual = right.to_vec();
    for _ in 0..n_restarts {
        let start = norm(&residual);
        if start <= tolerance * scale {
            break;
        }
        let mut basis = vec![unit(residual.clone())];
        let mut small = DMatrix::<f64>::zeros(n_basis + 1, n_basis);
        let mut size = n_basis;
        for at in 0..n_basis {
            map(&basis[at], &mut image)?;
            let mut next: Vec<f64> = basis[at].iter().zip(&image).map(|(x, t)| x - t).collect();
            for (i, value) in orthogonalise(&basis, &mut next).into_iter().enumerate() {
                small[(i, at)] = value;
            }
            let left = norm(&next);
            small[(at + 1, at)] = left;
            if left <= 1e-14 * start {
                size = at + 1;
                break;
            }
            basis.push(unit(next));
        }
        let mut target = DVector::zeros(size + 1);
        target[0] = start;
        let system = small.view((0, 0), (size + 1, size)).into_owned();
        let Ok(weights) = system.svd(true, true).solve(&target, 1e-14) else { break };
        combine(&basis, weights.as_slice(), &mut x);
        map(&x, &mut image)?;
        for i in 0..n {
            residual[i] = right[i] - (x[i] - image[i]);
        }
    }
    let left = norm(&residual) / scale;
    Ok((x, left))
}

/// Returns the spectral radius of a small matrix.
pub(in crate::learning) fn radius(matrix: &DMatrix<f64>) -> Result<f64> {
    radius_of(&Matrix::square(matrix.nrows(), matrix.as_slice()))
}

/// Returns the spectral radius of a dense matrix.
pub(in crate::learning) fn radius_of(matrix: &Matrix) -> Result<f64> {
    matrix.spectral_radius().ok_or(LearningError::Numerics {
        what: "spectral radius",
        reason: "the eigenvalue iteration did not end",
    })
}

/// Order of the terms of a sum over a vector.
#[derive(Clone, Copy, Debug)]
enum Sums {
    /// Partial sums side by side: quick.
    SideBySide,
    /// One after the other.
    InOrder,
}

impl Sums {
    fn norm(self, x: &[f64]) -> f64 {
        match self {
            Self::SideBySide => norm(x),
            Self::InOrder => x.iter().map(|value| value * value).sum::<f64>().sqrt(),
        }
    }

    fn unit(self, vector: Vec<f64>) -> Vec<f64> {
        let size = self.norm(&vector);
        scaled(vector, size)
    }

    /// `sum += factor_1 vector_1 + ..`
    fn combine(self, basis: &[Vec<f64>], factors: &[f64], sum: &mut [f64]) {
        match self {
            Self::SideBySide => combine(basis, factors, sum),
            Self::InOrder => {
                for (vector, factor) in basis.iter().zip(factors) {
                    for (value, part) in sum.iter_mut().zip(vector) {
                        *value += factor * part;
                    }
                }
            }
        }
    }

    /// Removes the parts along a basis, twice, and returns them.
    fn orthogonalise(self, basis: &[Vec<f64>], next: &mut [f64]) -> Vec<f64> {
        if matches!(self, Self::SideBySide) {
            return orthogonalise(basis, next);
        }
        crate::interrupt::point();
        let mut parts = vec![0.0; basis.len()];
        for _ in 0..2 {
            for (vector, part) in basis.iter().zip(&mut parts) {
                let share: f64 = vector.iter().zip(&*next).map(|(v, x)| v * x).sum();
                for (value, v) in next.iter_mut().zip(vector) {
                    *value -= share * v;
                }
                *part += share;
            }
        }
        parts
    }
}

/// Orthogonalises `next` against the basis, twice because of rounding; returns the coefficients.
fn orthogonalise(basis: &[Vec<f64>], next: &mut [f64]) -> Vec<f64> {
    crate::interrupt::point();
    let mut parts = vec![0.0; basis.len()];
    for _ in 0..2 {
        let mut shares = products(basis, next);
        for (part, share) in parts.iter_mut().zip(&mut shares) {
            *part += *share;
            *share = -*share;
        }
        combine(basis, &shares, next);
    }
    parts
}

fn unit(vector: Vec<f64>) -> Vec<f64> {
    let size = norm(&vector);
    scaled(vector, size)
}

fn scaled(mut vector: Vec<f64>, size: f64) -> Vec<f64> {
    if size > 0.0 {
        for value in &mut vector {
            *value /= size;
        }
    }
    vector
}

/// Returns the Euclidean norm.
pub(in crate::learning) fn norm(x: &[f64]) -> f64 {
    product(x, x).sqrt()
}

/// Returns pseudo-random numbers between -1 and 1, reproducible.
pub(in crate::learning) fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut word = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    (0..count)
        .map(|_| {
            word ^= word << 13;
            word ^= word >> 7;
            word ^= word << 17;
            (word >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        })
        .collect()
}
