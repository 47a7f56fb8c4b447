//! Invariant (transmission) zeros of a model.

use nalgebra::{Complex, DMatrix, Schur};

use super::{ModelError, StateSpace};

/// Singular values below this share of the largest entry, times the size, count as zero.
const RANK: f64 = 1e-13;
/// Largest number of sweeps of the eigenvalue iteration.
const SWEEPS_MAX: usize = 10_000;
/// Largest number of passes of the balancing over all states.
const PASSES_MAX: usize = 50;

impl StateSpace {
    /// Returns the invariant zeros.
    ///
    /// `z` where `[A - z I, B; C, D]` loses rank. The pencil is reduced by orthogonal transforms to
    /// one with a square, invertible `D`; its finite zeros are the eigenvalues of `A - B D^-1 C`.
    /// No zero at infinity appears as a large finite one. The model is balanced first: units of
    /// states, inputs and outputs do not matter.
    ///
    /// # Errors
    /// - [`ModelError::Numerics`] if the transfer matrix is rank-deficient at every frequency
    ///   (redundant inputs or outputs), or the eigenvalue iteration does not converge.
    /// # Source
    /// - \[emami1982\].
    pub fn zeros(&self) -> Result<Vec<Complex<f64>>, ModelError> {
        let balanced = Pencil::of(self).balanced();
        let tolerance = RANK
            * balanced.amax()
            * (self.n_states() + self.n_inputs().max(self.n_outputs())) as f64;
        let rows = balanced.with_full_row_rank(tolerance);
        let full = rows.transposed().with_full_row_rank(tolerance).transposed();
        let (p, m) = full.d.shape();
        if full.a.nrows() == 0 {
            return Ok(Vec::new());
        }
        if p != m {
            return Err(ModelError::Numerics {
                what: "the zeros",
                reason: "the transfer matrix has dependent rows or columns at every frequency",
            });
        }
        let inner = if m == 0 {
            full.a
        } else {
            let inverse = full.d.try_inverse().ok_or(ModelError::Numerics {
                what: "the zeros",
                reason: "the reduced pencil is singular",
            })?;
            full.a - full.b * inverse * full.c
        };
        let schur =
            Schur::try_new(inner, f64::EPSILON, SWEEPS_MAX).ok_or(ModelError::Numerics {
                what: "the zeros",
                reason: "the QR iteration did not converge",
            })?;
        Ok(schur.complex_eigenvalues().iter().copied().collect())
    }
}

/// The system pencil during the reduction to a `D` of full rank.
struct Pencil {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
}

impl Pencil {
    fn of(model: &StateSpace) -> Self {
        Self { a: model.a.clone(), b: model.b.clone(), c: model.c.clone(), d: model.d.clone() }
    }

    fn amax(&self) -> f64 {
        [&self.a, &self.b, &self.c, &self.d].into_iter().map(DMatrix::amax).fold(0.0, f64::max)
    }

    /// Scales states, inputs and outputs by powers of two until each state has rows and columns of
    /// about the same size, and each input and output the size of `A`. The zeros remain.
    fn balanced(mut self) -> Self {
        let size = if self.a.amax() > 0.0 { self.a.amax() } else { 1.0 };
        for _ in 0..PASSES_MAX {
            let mut settled = true;
            for col in 0..self.b.ncols() {
                let scale = f64::from(power_of_two(
                    size / self.b.column(col).amax().max(self.d.column(col).amax()),
                ))
                .exp2();
                self.b.column_mut(col).scale_mut(scale);
                self.d.column_mut(col).scale_mut(scale);
            }
            for row in 0..self.c.nrows() {
                let scale = f64::from(power_of_two(
                    size / self.c.row(row).amax().max(self.d.row(row).amax()),
                ))
                .exp2();
                self.c.row_mut(row).scale_mut(scale);
                self.d.row_mut(row).scale_mut(scale);
            }
            for state in 0..self.a.nrows() {
                let own = self.a[(state, state)].abs();
                let across = self.a.row(state).lp_norm(1) - own + self.b.row(state).lp_norm(1);
                let down = self.a.column(state).lp_norm(1) - own + self.c.column(state).lp_norm(1);
                let power = power_of_two((across / down).sqrt());
                let scale = f64::from(power).exp2();
                settled &= power == 0;
                self.a.column_mut(state).scale_mut(scale);
                self.c.column_mut(state).scale_mut(scale);
                self.a.row_mut(state).unscale_mut(scale);
                self.b.row_mut(state).unscale_mut(scale);
            }
            if settled {
                break;
            }
        }
        self
    }

    fn transposed(self) -> Self {
        Self {
            a: self.a.transpose(),
            b: self.c.transpose(),
            c: self.b.transpose(),
            d: self.d.transpose(),
        }
    }

    /// Removes states until `D` has full row rank; the finite zeros remain.
    fn with_full_row_rank(mut self, tolerance: f64) -> Self {
        loop {
            let (n, m, p) = (self.a.nrows(), self.b.ncols(), self.c.nrows());
            let (rows, rank_d) = row_compression(&self.d, tolerance);
            if rank_d == p {
                return self;
            }
            let (c, d) = (&rows * &self.c, &rows * &self.d);
            let dead = c.rows(rank_d, p - rank_d).into_owned();
            // Columns of V: first the null space of the dead rows, then its complement.
            let (across, rank_c) = row_compression(&dead.transpose(), tolerance);
            let kept = n - rank_c;
            let mut v = DMatrix::zeros(n, n);
            for col in 0..kept {
                v.set_column(col, &across.row(rank_c + col).transpose());
            }
            for col in 0..rank_c {
                v.set_column(kept + col, &across.row(col).transpose());
            }
            let (a, b) = (v.transpose() * &self.a * &v, v.transpose() * &self.b);
            let c = c.rows(0, rank_d) * &v;
            let mut next = Self {
                a: a.view((0, 0), (kept, kept)).into_owned(),
                b: b.rows(0, kept).into_owned(),
                c: DMatrix::zeros(rank_d + rank_c, kept),
                d: DMatrix::zeros(rank_d + rank_c, m),
            };
            next.c.view_mut((0, 0), (rank_d, kept)).copy_from(&c.columns(0, kept));
            next.d.view_mut((0, 0), (rank_d, m)).copy_from(&d.rows(0, rank_d));
            next.c
                .view_mut((rank_d, 0), (rank_c, kept))
                .copy_from(&a.view((kept, 0), (rank_c, kept)));
            next.d.view_mut((rank_d, 0), (rank_c, m)).copy_from(&b.rows(kept, rank_c));
            self = next;
            if rank_c == 0 {
                return self;
            }
        }
    }
}

/// Returns the exponent of the power of two next to a ratio; 0 for one that is not a positive number.
#[expect(clippy::cast_possible_truncation, reason = "the exponent of a double has four digits")]
fn power_of_two(ratio: f64) -> i32 {
    if ratio.is_finite() && ratio > 0.0 { ratio.log2().round() as i32 } else { 0 }
}

/// Returns an orthogonal `U` such that `U M` has its nonzero rows first, and their number.
fn row_compression(matrix: &DMatrix<f64>, tolerance: f64) -> (DMatrix<f64>, usize) {
    let rows = matrix.nrows();
    if matrix.is_empty() {
        return (DMatrix::identity(rows, rows), 0);
    }
    // Square, so that all left singular vectors are computed.
    let width = rows.max(matrix.ncols());
    let mut padded = DMatrix::zeros(rows, width);
    padded.view_mut((0, 0), matrix.shape()).copy_from(matrix);
    let svd = padded.svd(true, false);
    let rank = svd.singular_values.iter().filter(|value| **value > tolerance).count();
    (svd.u.map_or_else(|| DMatrix::identity(rows, rows), |u| u.transpose()), rank)
}

#[cfg(test)]
mod tests {
    use super::super::{Method, discretize, from_transfer_function};
    use super::*;

    fn sorted(mut zeros: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
        zeros.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
        zeros
    }

    #[test]
    fn zeros_of_a_fraction_are_the_roots_of_its_numerator() {
        // (s + 1)(s + 4) over a denominator of degree 5: three zeros are at infinity.
        let model =
            from_transfer_function(&[2.0, 10.0, 8.0], &[1.0, 2.0, 7.0, 5.0, 3.0, 1.0], None)
                .unwrap();
        let zeros = sorted(model.zeros().unwrap());
        assert_eq!(zeros.len(), 2);
        assert!((zeros[0].re + 4.0).abs() < 1e-10 && (zeros[1].re + 1.0).abs() < 1e-10);
    }

    #[test]
    fn sampling_a_triple_integrator_puts_zeros_where_they_are_known() {
        let plant = from_transfer_function(&[1.0], &[1.0, 0.0, 0.0, 0.0], None).unwrap();
        assert!(plant.zeros().unwrap().is_empty());
        let held = discretize(&plant, 0.1, Method::ZeroOrderHold).unwrap();
        // The roots of z^2 + 4 z + 1.
        let zeros = sorted(held.zeros().unwrap());
        assert!((zeros[0].re + 2.0 + 3.0_f64.sqrt()).abs() < 1e-6, "{zeros:?}");
        assert!((zeros[1].re + 2.0 - 3.0_f64.sqrt()).abs() < 1e-6, "{zeros:?}");
    }

    #[test]
    fn units_do_not_matter() {
        // A third-order loop given in seconds: the entries of its matrices differ by millions. The zeros are
        // those of the ratio of two polynomials, by arithmetic with 50 digits.
        let plant = from_transfer_function(&[2e6], &[1.0, 220.0, 24e3, 2e6], None).unwrap();
        let held = discretize(&plant, 0.001, Method::ZeroOrderHold).unwrap();
        let zeros = sorted(held.zeros().unwrap());
        assert_eq!(zeros.len(), 2, "{zeros:?}");
        assert!((zeros[0].re + 3.531_156_329_4).abs() < 1e-8, "{zeros:?}");
        assert!((zeros[1].re + 0.253_697_194_3).abs() < 1e-8, "{zeros:?}");
    }

    #[test]
    fn other_units_of_states_inputs_and_outputs_have_the_same_zeros() {
        let first = from_transfer_function(&[1.0, 2.0], &[1.0, 2.0, 9.0], None).unwrap();
        let second =
            from_transfer_function(&[3.0, 1.0, 40.0], &[1.0, 2.0, 9.0, 5.0], None).unwrap();
        let model = first.append(&second).unwrap();
        let expected = sorted(model.zeros().unwrap());
        for draw in 0..20_u32 {
            let mut exponent = (0..).map(|k: u32| {
                f64::from((k + 1).wrapping_mul(2_654_435_761).wrapping_add(draw * 40_503) % 13)
                    - 6.0
            });
            let mut scale = |n: usize| -> DMatrix<f64> {
                let powers = exponent.by_ref().take(n).map(|power| 10_f64.powf(power));
                DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(n, powers))
            };
            let (states, inputs, outputs) = (scale(5), scale(2), scale(2));
            let back = states.clone().try_inverse().unwrap();
            let scaled = StateSpace::continuous(
                &back * &model.a * &states,
                &back * &model.b * &inputs,
                &outputs * &model.c * &states,
                &outputs * &model.d * &inputs,
            )
            .unwrap();
            let zeros = sorted(scaled.zeros().unwrap());
            assert_eq!(zeros.len(), expected.len(), "draw {draw}: {zeros:?}");
            for (zero, expected) in zeros.iter().zip(&expected) {
                assert!((zero - expected).norm() < 1e-9, "draw {draw}: {zeros:?}");
            }
        }
    }

    #[test]
    fn a_model_that_does_nothing_has_the_modes_that_nothing_shows() {
        let a = DMatrix::from_row_slice(2, 2, &[0.5, 1.0, 0.0, 0.25]);
        let (b, c) = (DMatrix::from_row_slice(2, 1, &[0.0, 1.0]), DMatrix::zeros(1, 2));
        let mute = StateSpace::discrete(a, b, c, DMatrix::zeros(1, 1), 1.0).unwrap();
        assert!(mute.zeros().unwrap().is_empty());
        let gain = StateSpace::static_gain(DMatrix::from_element(1, 1, 2.0), None).unwrap();
        assert!(gain.zeros().unwrap().is_empty());
    }

    #[test]
    fn axes_side_by_side_have_the_zeros_of_both() {
        let first = from_transfer_function(&[1.0, 2.0], &[1.0, 2.0, 9.0], None).unwrap();
        let second = from_transfer_function(&[1.0, 0.0, 4.0], &[1.0, 2.0, 9.0], None).unwrap();
        let zeros = sorted(first.append(&second).unwrap().zeros().unwrap());
        assert_eq!(zeros.len(), 3);
        assert!((zeros[0] - Complex::new(-2.0, 0.0)).norm() < 1e-12);
        assert!((zeros[2] - Complex::new(0.0, 2.0)).norm() < 1e-12);
    }
}
