//! State-space realisations of transfer functions.

use nalgebra::DMatrix;

use super::{ModelError, StateSpace};

/// Largest number of polynomial coefficients: beyond it, zeros are numerically indistinguishable.
const MAX_COEFFICIENTS: usize = 1000;

/// Returns the controllable canonical form of a transfer function with one input and one output.
///
/// `G = (b_0 s^n + ... + b_n) / (a_0 s^n + ... + a_n)`, highest power first; `z` in place of `s` if
/// `dt_s` is given.
///
/// # Shapes
/// - `numerator`: at most as long as `denominator`, leading zeros aside
/// # Units
/// - `dt_s` in seconds
/// # Errors
/// - [`ModelError::Improper`] if the numerator has the higher degree.
/// - [`ModelError::Parameter`] if the denominator is zero.
/// - [`ModelError::Length`] for an empty polynomial, [`ModelError::TooMany`] for more than 1000
///   coefficients.
/// - [`ModelError::NotFinite`] for a coefficient that is infinite or NaN.
pub fn from_transfer_function(
    numerator: &[f64],
    denominator: &[f64],
    dt_s: Option<f64>,
) -> Result<StateSpace, ModelError> {
    for (what, polynomial) in [("numerator", numerator), ("denominator", denominator)] {
        if polynomial.is_empty() {
            let found = 0;
            let allowed = "at least one coefficient is needed".to_owned();
            return Err(ModelError::Length { what, found, allowed });
        }
        if polynomial.len() > MAX_COEFFICIENTS {
            let (value, allowed) = (polynomial.len(), MAX_COEFFICIENTS);
            return Err(ModelError::TooMany { what, value, allowed });
        }
    }
    let numerator = significant("numerator", numerator)?;
    let denominator = significant("denominator", denominator)?;
    let Some((&leading, rest)) = denominator.split_first() else {
        return Err(ModelError::Parameter {
            what: "denominator",
            value: 0.0,
            allowed: "at least one coefficient must differ from 0",
        });
    };
    let n = rest.len();
    if numerator.len() > n + 1 {
        return Err(ModelError::Improper { numerator: numerator.len() - 1, denominator: n });
    }
    let mut b = vec![0.0; n + 1 - numerator.len()];
    b.extend(numerator.iter().map(|value| value / leading));
    let direct = b[0];

    let mut a = DMatrix::zeros(n, n);
    let mut c = DMatrix::zeros(1, n);
    for (i, value) in rest.iter().enumerate() {
        a[(0, i)] = -value / leading;
        c[(0, i)] = b[i + 1] - direct * (value / leading);
        if i > 0 {
            a[(i, i - 1)] = 1.0;
        }
    }
    let mut input = DMatrix::zeros(n, 1);
    if n > 0 {
        input[(0, 0)] = 1.0;
    }
    StateSpace::new(a, input, c, DMatrix::from_element(1, 1, direct), dt_s)
}

/// Returns the continuous second-order model of a position loop.
///
/// `G(s) = w0^2 / (s^2 + 2 delta w0 s + w0^2)`
///
/// # Units
/// - `natural_frequency_rad_s` (`w0`) in rad/s; `damping` (`delta`) is dimensionless
/// # Errors
/// - [`ModelError::Parameter`] unless the frequency is positive and the damping is not negative.
/// # Source
/// - \[haas2016\], Eq. (13).
pub fn second_order(natural_frequency_rad_s: f64, damping: f64) -> Result<StateSpace, ModelError> {
    let w0 = natural_frequency_rad_s;
    if !(w0.is_finite() && w0 > 0.0) {
        return Err(ModelError::Parameter {
            what: "natural_frequency_rad_s",
            value: w0,
            allowed: "it must be finite and greater than 0 rad/s",
        });
    }
    if !(damping.is_finite() && damping >= 0.0) {
        return Err(ModelError::Parameter {
            what: "damping",
            value: damping,
            allowed: "it must be finite and not negative",
        });
    }
    from_transfer_function(&[w0 * w0], &[1.0, 2.0 * damping * w0, w0 * w0], None)
}

/// Strips leading zeros after checking every coefficient.
fn significant<'a>(what: &'static str, polynomial: &'a [f64]) -> Result<&'a [f64], ModelError> {
    if let Some(col) = polynomial.iter().position(|value| !value.is_finite()) {
        return Err(ModelError::NotFinite { what, row: 0, col, value: polynomial[col] });
    }
    let start = polynomial.iter().position(|value| *value != 0.0).unwrap_or(polynomial.len());
    Ok(&polynomial[start..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_discrete_fraction_gives_its_long_division() {
        // (1 + 2 z^-1) / (1 - 0.5 z^-1) = 1 + 2.5 z^-1 + 1.25 z^-2 + ...
        let model = from_transfer_function(&[2.0, 4.0], &[2.0, -1.0], Some(1.0)).unwrap();
        let response = model.simulate(&[1.0, 0.0, 0.0, 0.0], None).unwrap();
        assert_eq!(response, [1.0, 2.5, 1.25, 0.625]);
    }

    #[test]
    fn a_constant_has_no_state() {
        let model = from_transfer_function(&[0.0, 3.0], &[0.0, 2.0], Some(1.0)).unwrap();
        assert_eq!(model.n_states(), 0);
        assert_eq!(model.simulate(&[2.0], None).unwrap(), [3.0]);
    }

    #[test]
    fn bad_fractions_are_refused() {
        let error = from_transfer_function(&[1.0, 0.0], &[1.0], None).unwrap_err();
        assert_eq!(error, ModelError::Improper { numerator: 1, denominator: 0 });
        assert!(from_transfer_function(&[1.0], &[0.0, 0.0], None).is_err());
        for (numerator, denominator, what) in
            [(&[][..], &[1.0, 1.0][..], "numerator"), (&[1.0], &[], "denominator")]
        {
            let line =
                from_transfer_function(numerator, denominator, None).unwrap_err().to_string();
            assert!(line.contains(what) && line.contains("holds 0 values"), "{line}");
        }
        let long = vec![1.0; 1001];
        assert!(
            from_transfer_function(&[1.0], &long, None).unwrap_err().to_string().contains("1001")
        );
        assert!(from_transfer_function(&[f64::NAN], &[1.0], None).is_err());
        assert!(second_order(0.0, 0.5).is_err() && second_order(1.0, -0.1).is_err());
    }
}
