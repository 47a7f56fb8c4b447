//! A law whose inputs are counted in another unit than those of the axes: torques by the travel that
//! they hold. For `design`.

use super::{Law, LearningError, Result};

/// A wrapper that converts the inputs of a law: `u = v / scale`, `v` those of the inner law.
///
/// A force that moves a heavy axis is large and that of a light one small, so one weight cannot suit both;
/// the travel that each of them holds against its loop is of the size of the error.
///
/// # Shapes
/// - those of the inner law
/// # Real Time
/// Cold path. Allocates in the first [`Law::update`] only.
#[derive(Debug)]
pub struct Scaled<L> {
    law: L,
    scale: Vec<f64>,
    own: Vec<f64>,
}

impl<L: Law> Scaled<L> {
    /// Wraps a law with the scale of each input: unit of the law per unit of the axis.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] unless every scale is finite and above 0.
    pub fn new(law: L, scale: Vec<f64>) -> Result<Self> {
        if let Some(value) = scale.iter().find(|each| !(each.is_finite() && **each > 0.0)) {
            let allowed = "it must be finite and above 0";
            return Err(LearningError::Parameter { what: "scale", value: *value, allowed });
        }
        Ok(Self { law, scale, own: Vec::new() })
    }

    fn convert(&mut self, input: &[f64]) {
        self.own.clear();
        let scale = self.scale.iter().cycle();
        self.own.extend(input.iter().zip(scale).map(|(value, scale)| value * scale));
    }
}

impl<L: Law> Law for Scaled<L> {
    fn inner(&self) -> Option<&dyn Law> {
        Some(&self.law)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Law> {
        Some(&mut self.law)
    }

    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        self.convert(input);
        self.law.update(&self.own, error, next)?;
        for (value, scale) in next.iter_mut().zip(self.scale.iter().cycle()) {
            *value /= scale;
        }
        Ok(())
    }

    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        self.convert(input);
        self.law.recall(&self.own, error, disturbance)
    }

    fn take_over(&mut self, reference: &[f64], input: &[f64]) -> Result<bool> {
        self.convert(input);
        self.law.take_over(reference, &self.own)
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        let Some(mut input) = self.law.first_input()? else { return Ok(None) };
        for (value, scale) in input.iter_mut().zip(self.scale.iter().cycle()) {
            *value /= scale;
        }
        Ok(Some(input))
    }

    fn reset(&mut self) {
        self.law.reset();
    }

    fn describe(&self) -> String {
        self.law.describe()
    }

    fn earlier_description(&self) -> Option<String> {
        self.law.earlier_description()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::learning::law::norm_optimal::{NormOptimal, Weights};
    use crate::model::{Method, discretize, second_order};

    /// In other units of the input, the same law and weights must give the same motion.
    #[test]
    fn a_law_in_other_units_learns_the_same() {
        let loop_model = second_order(90.0, 0.7).unwrap();
        let model = discretize(&loop_model, 1e-3, Method::ZeroOrderHold).unwrap();
        let weights = Weights { q: 1.0, s: 1e-3, r: 0.1, rate: 5.0 };
        let n = 300;
        let law = || NormOptimal::new(&model, n, weights).unwrap();
        let error: Vec<f64> = (0..n).map(|k| 1e-3 * (k as f64 * 0.05).sin()).collect();
        let (mut plain, mut scaled) = (law(), Scaled::new(law(), vec![1e-6]).unwrap());
        let (mut u, mut next) = (vec![0.0; n], vec![0.0; n]);
        let (mut force_n, mut next_n) = (vec![0.0; n], vec![0.0; n]);
        for _ in 0..3 {
            plain.update(&u, &error, &mut next).unwrap();
            scaled.update(&force_n, &error, &mut next_n).unwrap();
            u.copy_from_slice(&next);
            force_n.copy_from_slice(&next_n);
        }
        let largest = u.iter().fold(0.0_f64, |max, value| max.max(value.abs()));
        assert!(largest > 1e-4);
        for (u, force_n) in u.iter().zip(&force_n) {
            assert!((u - 1e-6 * force_n).abs() < 1e-9 * largest, "{u} {force_n}");
        }
        assert!(
            Scaled::new(law(), vec![0.0]).is_err() && Scaled::new(law(), vec![f64::NAN]).is_err()
        );
    }
}
