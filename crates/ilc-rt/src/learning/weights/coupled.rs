//! Weights that are divided between the individual channels and a coupled signal.

use nalgebra::DMatrix;

use super::{Gain, Weight};
use crate::learning::{LearningError, Result};

/// Overall weight, and its division between the individual channels and the coupled signal.
///
/// `Q_k = sigma_k (gamma_k I + (1 - gamma_k) C_k' C_k)`
///
/// `gamma = 1` weights the channels alone (time and place), `gamma = 0` the coupled signal alone,
/// e.g. the contour error. The same form applies to the error, the input and the input's change.
///
/// # Source
/// - \[barton2010\], Eq. (5.2) to (5.7); also (6.1) and (J.17).
#[derive(Debug, Clone, PartialEq)]
pub struct Coupled {
    /// Overall weight `sigma`, not negative.
    pub sigma: Gain,
    /// Share `gamma` of the individual channels, from 0 to 1.
    pub gamma: Gain,
}

impl Coupled {
    /// Returns the weight for the coupling `C_k`.
    ///
    /// # Shapes
    /// - `coupling`: one matrix (any, `p`) per sample, or a single one for all samples; the result:
    ///   `p` channels
    /// # Errors
    /// - [`LearningError::Weight`] for a number out of range, a length other than `n_samples`, or
    ///   matrices of different widths.
    pub fn weight(&self, n_samples: usize, coupling: &[DMatrix<f64>]) -> Result<Weight> {
        self.sigma.check("sigma", n_samples, f64::INFINITY)?;
        self.gamma.check("gamma", n_samples, 1.0)?;
        let p = check_coupling(coupling, n_samples)?;
        let at = |k: usize| {
            let c = &coupling[if coupling.len() == 1 { 0 } else { k }];
            let gamma = self.gamma.at(k);
            (DMatrix::identity(p, p) * gamma + c.transpose() * c * (1.0 - gamma)) * self.sigma.at(k)
        };
        if coupling.len() == 1 && self.sigma.is_constant() && self.gamma.is_constant() {
            return Ok(Weight::Block(at(0)));
        }
        Ok(Weight::Blocks((0..n_samples).map(at).collect()))
    }
}

/// Refuses a coupling that does not match the run; returns its width.
fn check_coupling(coupling: &[DMatrix<f64>], n_samples: usize) -> Result<usize> {
    let refused =
        |sample: usize, reason: String| LearningError::Weight { what: "coupling", sample, reason };
    let count = coupling.len();
    if count != 1 && count != n_samples {
        return Err(refused(0, format!("{count} matrices given; 1 or {n_samples} are needed")));
    }
    let p = coupling[0].ncols();
    for (k, c) in coupling.iter().enumerate() {
        if c.ncols() != p {
            return Err(refused(k, format!("{} columns; {p} are needed", c.ncols())));
        }
        if let Some(entry) = c.iter().find(|entry| !entry.is_finite()) {
            return Err(refused(k, format!("{entry}; only finite values are allowed")));
        }
    }
    Ok(p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_share_goes_from_the_channels_to_the_coupled_signal() {
        let c = DMatrix::from_row_slice(1, 2, &[-0.6, 0.8]);
        let weight = |gamma: f64| {
            let coupled = Coupled { sigma: 2.0.into(), gamma: gamma.into() };
            coupled.weight(3, std::slice::from_ref(&c)).unwrap().at(1, 2)
        };
        assert_eq!(weight(1.0), DMatrix::identity(2, 2) * 2.0);
        let contour = DMatrix::from_row_slice(2, 2, &[0.72, -0.96, -0.96, 1.28]);
        assert!((weight(0.0) - &contour).amax() < 1e-15);
        assert!((weight(0.25) - (contour * 0.75 + DMatrix::identity(2, 2) * 0.5)).amax() < 1e-15);
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let c = DMatrix::from_row_slice(1, 2, &[-0.6, 0.8]);
        let good = Coupled { sigma: 1.0.into(), gamma: 0.5.into() };
        let told = |coupled: &Coupled, coupling: &[DMatrix<f64>]| {
            coupled.weight(3, coupling).unwrap_err().to_string()
        };
        let high = Coupled { gamma: 1.5.into(), ..good.clone() };
        assert!(told(&high, std::slice::from_ref(&c)).contains("gamma"));
        let short = Coupled { sigma: vec![1.0; 2].into(), ..good.clone() };
        assert!(told(&short, std::slice::from_ref(&c)).contains("sigma"));
        assert!(told(&good, &[]).contains("0 matrices"));
        assert!(told(&good, &[c.clone(), c.clone()]).contains("2 matrices"));
        let wide = DMatrix::identity(3, 3);
        assert!(told(&good, &[c.clone(), wide, c.clone()]).contains("sample 1"));
        assert!(told(&good, &[c * f64::INFINITY]).contains("inf"));
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        /// Against the lifted products of the source, built entry by entry.
        #[test]
        fn it_is_the_printed_product(
            gains in prop::collection::vec((0.0..9.0_f64, 0.0..1.0_f64), 1..6),
            entries in prop::collection::vec(-2.0..2.0_f64, 2 * 3 * 6),
        ) {
            let (n, p, rows) = (gains.len(), 3, 2);
            let (sigma, gamma): (Vec<f64>, Vec<f64>) = gains.into_iter().unzip();
            let coupling: Vec<DMatrix<f64>> = (0..n)
                .map(|k| DMatrix::from_row_slice(rows, p, &entries[6 * k..6 * k + 6]))
                .collect();
            let diagonal = |of: &dyn Fn(usize) -> f64| {
                DMatrix::from_fn(n * p, n * p, |i, j| if i == j { of(i / p) } else { 0.0 })
            };
            let lifted_c = DMatrix::from_fn(n * rows, n * p, |i, j| {
                if i / rows == j / p { coupling[j / p][(i % rows, j % p)] } else { 0.0 }
            });
            let printed = diagonal(&|k| sigma[k])
                * (diagonal(&|k| gamma[k])
                    + diagonal(&|k| 1.0 - gamma[k]) * lifted_c.transpose() * lifted_c);
            let coupled = Coupled { sigma: sigma.into(), gamma: gamma.into() };
            let weight = coupled.weight(n, &coupling).unwrap();
            prop_assert!(weight.check("q", n, p).is_ok());
            let found = DMatrix::from_fn(n * p, n * p, |i, j| {
                if i / p == j / p { weight.at(i / p, p)[(i % p, j % p)] } else { 0.0 }
            });
            prop_assert!((found - printed).amax() < 1e-10);
        }
    }
}
