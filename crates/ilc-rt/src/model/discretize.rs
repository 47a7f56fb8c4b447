//! Discretisation of continuous models.

use nalgebra::DMatrix;

use super::{ModelError, StateSpace};

/// Discretisation method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Zero-order hold: exact for an input that is constant between samples.
    ZeroOrderHold,
    /// Tustin's bilinear transform: preserves the shape of a frequency response.
    Tustin,
}

/// Returns the discretised model.
///
/// Zero-order hold: `exp([A B; 0 0] T) = [A_d B_d; 0 I]`. Tustin: `s = 2/T (z - 1)/(z + 1)`.
///
/// # Shapes
/// - the result has the shapes of `model`
/// # Units
/// - `dt_s` in seconds
/// # Errors
/// - [`ModelError::Discrete`] if `model` is discrete already.
/// - [`ModelError::SampleTime`] unless `dt_s` is finite and positive.
/// - [`ModelError::Numerics`] if the model has a pole at `2/T` (Tustin), or the exponential
///   overflows.
/// # Source
/// - \[franklin1998\], Ch. 4 and 6.
pub fn discretize(model: &StateSpace, dt_s: f64, method: Method) -> Result<StateSpace, ModelError> {
    if let Some(dt_s) = model.dt_s() {
        return Err(ModelError::Discrete { action: "discretize", dt_s });
    }
    if !(dt_s.is_finite() && dt_s > 0.0) {
        return Err(ModelError::SampleTime { dt_s });
    }
    match method {
        Method::ZeroOrderHold => zero_order_hold(model, dt_s),
        Method::Tustin => tustin(model, dt_s),
    }
}

fn zero_order_hold(model: &StateSpace, dt_s: f64) -> Result<StateSpace, ModelError> {
    let (n, m) = (model.n_states(), model.n_inputs());
    if n == 0 {
        return StateSpace::static_gain(model.d.clone(), Some(dt_s));
    }
    let mut generator = DMatrix::zeros(n + m, n + m);
    generator.view_mut((0, 0), (n, n)).copy_from(&(&model.a * dt_s));
    generator.view_mut((0, n), (n, m)).copy_from(&(&model.b * dt_s));
    // Scaling by powers of two does not terminate for non-finite values.
    let is_finite = generator.iter().all(|value| value.is_finite());
    let transition = if is_finite { generator.exp() } else { generator };
    if transition.iter().any(|value| !value.is_finite()) {
        return Err(ModelError::Numerics {
            what: "the matrix exponential",
            reason: "the sample time is too long for the fastest pole",
        });
    }
    StateSpace::discrete(
        transition.view((0, 0), (n, n)).into_owned(),
        transition.view((0, n), (n, m)).into_owned(),
        model.c.clone(),
        model.d.clone(),
        dt_s,
    )
}

fn tustin(model: &StateSpace, dt_s: f64) -> Result<StateSpace, ModelError> {
    let n = model.n_states();
    let half = &model.a * (0.5 * dt_s);
    let inverse = (DMatrix::identity(n, n) - &half).try_inverse().ok_or(ModelError::Numerics {
        what: "Tustin's rule",
        reason: "the model has a pole at 2 / dt_s",
    })?;
    let b = &inverse * &model.b * dt_s;
    StateSpace::discrete(
        &inverse * (DMatrix::identity(n, n) + half),
        b.clone(),
        &model.c * inverse,
        &model.d + &model.c * b * 0.5,
        dt_s,
    )
}

#[cfg(test)]
mod tests {
    use super::super::{from_transfer_function, second_order};
    use super::*;

    #[test]
    fn a_held_first_order_lag_is_exact() {
        let lag = from_transfer_function(&[3.0], &[1.0, 2.0], None).unwrap();
        let held = discretize(&lag, 0.1, Method::ZeroOrderHold).unwrap();
        let pole = (-0.2_f64).exp();
        assert!((held.a()[(0, 0)] - pole).abs() < 1e-15);
        assert!((held.markov(2).unwrap()[1][(0, 0)] - 1.5 * (1.0 - pole)).abs() < 1e-15);
    }

    #[test]
    fn a_triple_integrator_keeps_its_tiny_first_response() {
        let plant = from_transfer_function(&[1.0], &[1.0, 0.0, 0.0, 0.0], None).unwrap();
        let held = discretize(&plant, 1e-3, Method::ZeroOrderHold).unwrap();
        let first = held.markov(2).unwrap()[1][(0, 0)];
        assert!((first / (1e-9 / 6.0) - 1.0).abs() < 1e-12, "{first}");
    }

    #[test]
    fn tustin_maps_the_pole_by_its_rule() {
        let lag = from_transfer_function(&[3.0], &[1.0, 2.0], None).unwrap();
        let mapped = discretize(&lag, 0.1, Method::Tustin).unwrap();
        assert!((mapped.a()[(0, 0)] - 0.9 / 1.1).abs() < 1e-15);
    }

    #[test]
    fn both_keep_the_static_gain() {
        let axis = second_order(157.0, 0.5).unwrap();
        for method in [Method::ZeroOrderHold, Method::Tustin] {
            let sampled = discretize(&axis, 2e-3, method).unwrap();
            let y = sampled.simulate(&[1.0; 400], None).unwrap();
            assert!((y[399] - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_sampled_model_is_refused() {
        let axis = second_order(157.0, 0.5).unwrap();
        let sampled = discretize(&axis, 2e-3, Method::Tustin).unwrap();
        let error = discretize(&sampled, 2e-3, Method::Tustin).unwrap_err();
        assert_eq!(error, ModelError::Discrete { action: "discretize", dt_s: 2e-3 });
        assert!(discretize(&axis, f64::NAN, Method::Tustin).is_err());
    }
}
