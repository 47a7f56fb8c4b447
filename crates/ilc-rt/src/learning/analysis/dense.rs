//! The figures of the analysis from dense matrices, for short runs.

use ilc_numerics::Matrix;

use super::iteration::Iteration;
use crate::learning::krylov::{Estimate, largest_symmetric, radius, radius_of};
use crate::learning::{LearningError, Result};

/// The matrices of one iteration, without the inputs that do not affect convergence.
#[derive(Debug)]
pub(super) struct Dense {
    /// `T`
    pub(super) t: Matrix,
    /// `L_e`
    pub(super) learn: Matrix,
    /// `P`
    pub(super) plant: Matrix,
    /// Indices of the inputs that were kept.
    pub(super) kept: Vec<usize>,
    n_inputs: usize,
}

impl Dense {
    /// Computes the matrices by one update per column.
    pub(super) fn new(iteration: &mut Iteration) -> Result<Self> {
        let (n_u, n_e) = (iteration.n_u(), iteration.n_e());
        let kept: Vec<usize> = (0..n_u).filter(|i| !iteration.free().contains(i)).collect();
        let n = kept.len();
        let (mut t, mut learn, mut plant) =
            (Matrix::zeros(n, n), Matrix::zeros(n, n_e), Matrix::zeros(n_e, n));
        let mut unit = vec![0.0; n_u];
        let mut out = vec![0.0; n_u];
        let mut error = vec![0.0; n_e];
        for (col, index) in kept.iter().enumerate() {
            unit[*index] = 1.0;
            iteration.apply(&unit, &mut out)?;
            iteration.plant.apply(&unit, &mut error);
            unit[*index] = 0.0;
            for (row, at) in kept.iter().enumerate() {
                t[(row, col)] = out[*at];
            }
            for (row, value) in error.iter().enumerate() {
                plant[(row, col)] = *value;
            }
        }
        let zero = vec![0.0; n_u];
        error.fill(0.0);
        for col in 0..n_e {
            error[col] = 1.0;
            iteration.law_linear(&zero, &error, &mut out)?;
            error[col] = 0.0;
            for (row, at) in kept.iter().enumerate() {
                learn[(row, col)] = out[*at];
            }
        }
        Ok(Self { t, learn, plant, kept, n_inputs: iteration.n_inputs })
    }

    /// Returns the spectral radius.
    ///
    /// A law without look-ahead has a block lower-triangular `T`: its eigenvalues are those of the
    /// diagonal blocks, whereas a general eigenvalue solver would return the spectrum of the
    /// rounding errors (`T` is far from normal). The radius of a symmetric `T` is its norm, the factor.
    pub(super) fn spectral_radius(&self, factor: Estimate) -> Result<Estimate> {
        let n = self.t.n_rows();
        if n == 0 {
            return Ok(Estimate::exact(0.0));
        }
        if self.is_symmetric() {
            return Ok(factor);
        }
        let m = self.n_inputs;
        let sample = |i: usize| self.kept[i] / m;
        let largest = self.t.norm_max();
        let looks_back = (0..n).all(|col| {
            (0..n)
                .take_while(|row| sample(*row) < sample(col))
                .all(|row| self.t[(row, col)].abs() <= 1e-14 * largest)
        });
        if looks_back {
            let mut value: f64 = 0.0;
            let mut first = 0;
            while first < n {
                let count = (first..n).take_while(|i| sample(*i) == sample(first)).count();
                let block = nalgebra::DMatrix::from_fn(count, count, |row, col| {
                    self.t[(first + row, first + col)]
                });
                value = value.max(radius(&block)?);
                first += count;
            }
            return Ok(Estimate::exact(value));
        }
        radius_of(&self.t).map(Estimate::exact)
    }

    /// Returns the largest singular value of `T`.
    pub(super) fn monotonic_factor(&self) -> Result<Estimate> {
        largest_singular_value(&self.t).map(Estimate::exact)
    }

    /// Returns the largest singular value of `L_e P`, the factor of the model uncertainty.
    pub(super) fn learned_share(&self) -> Result<f64> {
        largest_singular_value(&self.learn.times(&self.plant))
    }

    /// Returns true if `T = T'` up to rounding.
    fn is_symmetric(&self) -> bool {
        let (n, largest) = (self.t.n_rows(), self.t.norm_max());
        (0..n).all(|col| {
            (0..col).all(|row| (self.t[(row, col)] - self.t[(col, row)]).abs() <= 1e-13 * largest)
        })
    }

    /// Returns the largest norm among `T, T^2, T^4, ...`: the transient growth of the error; `factor` is the
    /// norm of `T`.
    pub(super) fn transient_growth(&self, factor: Estimate) -> Result<f64> {
        const DOUBLINGS: usize = 9;
        if factor.value <= 1.0 {
            return Ok(1.0);
        }
        let mut power = self.t.times(&self.t);
        let mut largest = factor.value;
        for _ in 0..DOUBLINGS {
            crate::interrupt::point();
            let size = power.norm_max() * power.n_rows() as f64;
            if !(size.is_finite() && size < 1e100) {
                return Ok(f64::INFINITY);
            }
            if size < 1e-3 {
                break;
            }
            if bound_of_norm(&power) > largest {
                largest = largest.max(norm_of(&power)?);
            }
            power = power.times(&power);
        }
        Ok(largest)
    }

    /// Solves `(I - T) u = right`; the omitted inputs stay zero.
    pub(super) fn fixed_point(&self, right: &[f64]) -> Vec<f64> {
        let n = self.t.n_rows();
        let mut system = Matrix::zeros(n, n);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            system[(i, j)] = f64::from(u8::from(i == j)) - self.t[(i, j)];
        }
        let target: Vec<f64> = self.kept.iter().map(|at| right[*at]).collect();
        let mut input = vec![0.0; right.len()];
        for (value, at) in system.solve(&target).into_iter().zip(&self.kept) {
            input[*at] = value;
        }
        input
    }

    /// Returns `tr(P Sigma_j P')` for the runs `0..n_runs` and, if learning converges, the limit.
    ///
    /// `Sigma_{j+1} = T Sigma_j T' + L_e L_e'`, from zero: white measurement noise of variance 1 in
    /// every run.
    pub(super) fn noise(&self, n_runs: usize, converges: bool) -> (Vec<f64>, Option<f64>) {
        const DOUBLINGS: usize = 48;
        let gram = self.plant.transposed_times(&self.plant);
        let share = |sigma: &Matrix| -> f64 {
            let mut sum = 0.0;
            for j in 0..sigma.n_columns() {
                for i in 0..sigma.n_rows() {
                    sum += sigma[(i, j)] * gram[(i, j)];
                }
            }
            sum
        };
        let fresh = self.learn.times_transposed(&self.learn);
        let n = self.t.n_rows();
        let mut sigma = Matrix::zeros(n, n);
        let mut shares = Vec::with_capacity(n_runs);
        for run in 0..n_runs {
            shares.push(share(&sigma));
            if run + 1 < n_runs {
                sigma = self.t.times(&sigma).times_transposed(&self.t).plus(&fresh);
            }
        }
        if !converges {
            return (shares, None);
        }
        // Doubling: after k steps sigma holds 2^k runs.
        let (mut sigma, mut power) = (fresh, self.t.clone());
        let mut before = share(&sigma);
        for _ in 0..DOUBLINGS {
            crate::interrupt::point();
            sigma = sigma.plus(&power.times(&sigma).times_transposed(&power));
            let now = share(&sigma);
            if !now.is_finite() {
                return (shares, None);
            }
            if (now - before).abs() <= 1e-14 * now {
                return (shares, Some(now));
            }
            before = now;
            power = power.times(&power);
        }
        (shares, None)
    }
}

/// Returns a bound of the largest singular value, of little work: the Frobenius norm or `sqrt(|M|_1 |M|_inf)`.
fn bound_of_norm(matrix: &Matrix) -> f64 {
    let (mut columns, mut rows) = (0.0_f64, vec![0.0; matrix.n_rows()]);
    for j in 0..matrix.n_columns() {
        let mut sum = 0.0;
        for (i, row) in rows.iter_mut().enumerate() {
            let size = matrix[(i, j)].abs();
            sum += size;
            *row += size;
        }
        columns = columns.max(sum);
    }
    matrix.norm_l2().min((columns * rows.into_iter().fold(0.0, f64::max)).sqrt())
}

/// Returns the largest singular value, from products with single vectors if a few hundred of them tell it.
fn norm_of(matrix: &Matrix) -> Result<f64> {
    let n = matrix.n_columns();
    let square = largest_symmetric(
        n,
        &mut |x, out| {
            matrix.gram_times(x, out);
            Ok(())
        },
        60,
        300,
        1e-12,
    )?;
    if square.error <= 1e-11 * square.value {
        Ok(square.value.sqrt())
    } else {
        largest_singular_value(matrix)
    }
}

fn largest_singular_value(matrix: &Matrix) -> Result<f64> {
    matrix.largest_singular_value().ok_or(LearningError::Numerics {
        what: "monotonic factor",
        reason: "the singular value iteration did not end",
    })
}
