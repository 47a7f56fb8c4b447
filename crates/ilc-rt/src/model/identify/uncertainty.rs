//! Bound of the model error, for a test of robust convergence.

use nalgebra::Complex;

use super::FrequencyResponse;
use crate::model::ModelError;

/// Half the width of the moving maximum: a sixth of an octave.
const HALF_WIDTH: f64 = 1.122_462_048_309_373;

/// A bound of the multiplicative uncertainty, `|H(f) / G(f) - 1| <= bound(f)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// Frequencies, ascending.
    pub frequency_hz: Vec<f64>,
    /// Bound at each of them.
    pub bound: Vec<f64>,
}

/// Bounds the residual of a model over a measured frequency response.
///
/// `bound(f) = max { |H/G - 1| + z sigma |H/G| }` over a third of an octave around `f`: the
/// observed difference, plus `z` standard deviations of the measurement.
///
/// # Shapes
/// - `model`: the model's response at `measured.frequency_hz`
/// # Units
/// - `deviations` (`z`), dimensionless
/// # Errors
/// - [`ModelError::Length`] if the lengths differ; [`ModelError::NotFinite`] or
///   [`ModelError::Parameter`] for a model that is 0 somewhere, or `deviations` below 0.
/// # Source
/// - \[barton2010\], section 3.3: multiplicative uncertainty; \[bendat2010\], section 9.2.
pub fn uncertainty(
    measured: &FrequencyResponse,
    model: &[Complex<f64>],
    deviations: f64,
) -> Result<Uncertainty, ModelError> {
    measured.check(0)?;
    if model.len() != measured.frequency_hz.len() {
        return Err(ModelError::Length {
            what: "model",
            found: model.len(),
            allowed: format!("one for each of the {} frequencies", measured.frequency_hz.len()),
        });
    }
    if !(deviations.is_finite() && deviations >= 0.0) {
        let allowed = "it must be finite and not negative";
        return Err(ModelError::Parameter { what: "deviations", value: deviations, allowed });
    }
    let sigma = measured.relative_deviation();
    let mut pointwise = Vec::with_capacity(model.len());
    for (row, ((h, g), sigma)) in measured.response.iter().zip(model).zip(&sigma).enumerate() {
        // Without a response the relative error is 1.
        let ratio = if h.norm() > 0.0 { h / g } else { Complex::new(0.0, 0.0) };
        let spread = if h.norm() > 0.0 { deviations * sigma * ratio.norm() } else { 0.0 };
        let value = (ratio - 1.0).norm() + spread;
        if !value.is_finite() {
            return Err(ModelError::NotFinite { what: "the uncertainty", row, col: 0, value });
        }
        pointwise.push(value);
    }
    let f = &measured.frequency_hz;
    let bound = |k: usize| {
        let near = |i: &usize| f[*i] >= f[k] / HALF_WIDTH && f[*i] <= f[k] * HALF_WIDTH;
        (0..f.len()).filter(near).map(|i| pointwise[i]).fold(0.0, f64::max)
    };
    Ok(Uncertainty { frequency_hz: f.clone(), bound: (0..f.len()).map(bound).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_covers_difference_and_noise_of_the_neighbourhood() {
        let mut measured = FrequencyResponse {
            frequency_hz: vec![10.0, 11.0, 12.5, 40.0],
            response: vec![Complex::new(1.0, 0.0); 4],
            coherence: vec![1.0; 4],
            n_averages: 2.0,
        };
        let model = [
            Complex::new(1.0, 0.0),
            Complex::new(0.5, 0.0),
            Complex::new(1.0, 0.0),
            Complex::new(0.0, 1.0),
        ];
        let bound = uncertainty(&measured, &model, 3.0).unwrap().bound;
        for (found, expected) in bound.iter().zip([1.0, 1.0, 0.0, 2.0_f64.sqrt()]) {
            assert!((found - expected).abs() < 1e-12, "{bound:?}");
        }
        // gamma^2 = 0.8 with 2 averages: sigma = 1/4.
        measured.coherence[3] = 0.8;
        let bound = uncertainty(&measured, &model, 3.0).unwrap().bound;
        assert!((bound[3] - (2.0_f64.sqrt() + 0.75)).abs() < 1e-12);
        assert!(uncertainty(&measured, &model[1..], 3.0).is_err());
        assert!(uncertainty(&measured, &model, -1.0).is_err());
        assert!(uncertainty(&measured, &[Complex::new(0.0, 0.0); 4], 3.0).is_err());
    }
}
