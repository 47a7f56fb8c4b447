//! Second-order model with delay, adequate for most axes: gain, natural frequency, damping and
//! delay.
//!
//! `fit` fits it to a frequency response, from the initial values of `starts`.

mod fit;
mod starts;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

use nalgebra::Complex;

use crate::model::{Method, ModelError, StateSpace, discretize, second_order};

pub use fit::{Known, SecondOrderFit, fit_second_order};

/// A second-order model with delay.
///
/// `G(s) = K w0^2 / (s^2 + 2 delta w0 s + w0^2) exp(-s tau)`; if discrete, the fraction with a
/// zero-order hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondOrder {
    /// Static gain `K`.
    pub gain: f64,
    /// Natural frequency `w0 / 2 pi`.
    pub natural_frequency_hz: f64,
    /// Damping ratio `delta`.
    pub damping: f64,
    /// Delay (dead time) `tau`, beyond that of the hold if discrete.
    pub delay_s: f64,
    /// Sample time of the hold; `None` for a continuous model.
    pub dt_s: Option<f64>,
}

/// A second-order model prepared for evaluation at many frequencies.
struct Shape {
    model: SecondOrder,
    /// `(b_1 z + b_2) / (z^2 + a_1 z + a_2)` of the discrete fraction.
    sampled: Option<[f64; 4]>,
}

impl Shape {
    fn at(&self, frequency_hz: f64) -> Complex<f64> {
        let w = TAU * frequency_hz;
        let m = &self.model;
        let fraction = if let (Some([b1, b2, a1, a2]), Some(dt_s)) = (self.sampled, m.dt_s) {
            let z = Complex::new(0.0, w * dt_s).exp();
            (z * b1 + b2) / (z * z + z * a1 + a2)
        } else {
            let share = frequency_hz / m.natural_frequency_hz;
            Complex::new(1.0 - share * share, 2.0 * m.damping * share).inv()
        };
        fraction * m.gain * Complex::new(0.0, -w * m.delay_s).exp()
    }
}

impl SecondOrder {
    fn shape(&self) -> Shape {
        let sampled = self.dt_s.and_then(|dt_s| {
            let fraction = second_order(TAU * self.natural_frequency_hz, self.damping).ok()?;
            let held = discretize(&fraction, dt_s, Method::ZeroOrderHold).ok()?;
            let markov = held.markov(3).ok()?;
            let (a1, a2) = (-held.a().trace(), held.a().determinant());
            let (m1, m2) = (markov[1][(0, 0)], markov[2][(0, 0)]);
            Some([m1, m2 + a1 * m1, a1, a2])
        });
        Shape { model: *self, sampled }
    }

    /// Returns the response at some frequencies.
    ///
    /// # Units
    /// - `frequency_hz` in Hz
    pub fn response(&self, frequency_hz: &[f64]) -> Vec<Complex<f64>> {
        let shape = self.shape();
        frequency_hz.iter().map(|f| shape.at(*f)).collect()
    }

    /// Returns the state-space model: discrete with whole samples of delay, or continuous without
    /// the delay.
    ///
    /// # Errors
    /// - [`ModelError::Parameter`] for an invalid frequency or damping.
    pub fn state_space(&self) -> Result<StateSpace, ModelError> {
        let mut fraction = second_order(TAU * self.natural_frequency_hz, self.damping)?;
        fraction.c *= self.gain;
        match self.dt_s {
            None => Ok(fraction),
            Some(dt_s) => {
                let held = discretize(&fraction, dt_s, Method::ZeroOrderHold)?;
                held.delayed(self.delay_samples())
            }
        }
    }

    /// Returns the delay in whole samples, 0 for a continuous model or a delay below half a sample.
    pub fn delay_samples(&self) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "casts of floats saturate; a negative delay is 0 samples"
        )]
        self.dt_s.map_or(0, |dt_s| (self.delay_s / dt_s).round().max(0.0) as usize)
    }
}
