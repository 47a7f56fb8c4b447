//! Fit of a velocity loop behind a position loop of known gain: the model of a csv axis.

use std::f64::consts::TAU;

use nalgebra::{Complex, DVector};

use super::FrequencyResponse;
use super::excitation::refused;
use super::least_squares::{Minimum, minimize};
use crate::model::ModelError;

/// Initial bandwidths over the band, and above it.
const BANDWIDTHS: usize = 8;
/// Bandwidths may lie outside the band by this factor.
const BEYOND_BAND: f64 = 100.0;

/// A first-order velocity loop with delay, in a position loop that is closed in the controller.
///
/// `G / (1 + kv z^-1 G)`, `G` the zero-order hold of `K a / (s (s + a)) exp(-s tau)`: the position
/// in the controller is one cycle old.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityLoop {
    /// Gain `K` of the velocity loop.
    pub gain: f64,
    /// Bandwidth `a / 2 pi`.
    pub bandwidth_hz: f64,
    /// Delay `tau`, beyond that of the hold.
    pub delay_s: f64,
    /// Gain `kv` of the position loop.
    pub position_gain_per_s: f64,
    /// Servo cycle.
    pub dt_s: f64,
}

/// A fitted velocity loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityLoopFit {
    /// The model.
    pub model: VelocityLoop,
    /// Standard deviation of the gain; 0 if the delay was known, and the gain with it.
    pub gain_deviation: f64,
    /// Standard deviation of the bandwidth.
    pub bandwidth_deviation_hz: f64,
    /// Standard deviation of the delay; 0 if known.
    pub delay_deviation_s: f64,
    /// Weighted RMS of the relative difference of measurement and model.
    pub residual_rms: f64,
}

/// Fits a velocity loop to the response from velocity input to position, both in closed loop.
///
/// `min sum_k w_k |ln (H_k / T(f_k))|^2` over `a`, `K` and `tau`; with a known delay the gain is 1 and
/// only the bandwidth is fitted.
///
/// # Shapes
/// - `measured`: more than two frequencies, without 0 Hz
/// # Units
/// - `position_gain_per_s` in 1/s; `dt_s`, `delay_s` in seconds
/// # Errors
/// - [`ModelError::Parameter`], [`ModelError::SampleTime`], and as
///   [`super::fit_second_order`] for the response.
/// # Source
/// - \[pintelon2012\], section 9.8.3: the logarithmic least-squares estimator.
pub fn fit_velocity_loop(
    measured: &FrequencyResponse,
    position_gain_per_s: f64,
    dt_s: f64,
    delay_s: Option<f64>,
) -> Result<VelocityLoopFit, ModelError> {
    let kv = position_gain_per_s;
    if !(dt_s.is_finite() && dt_s > 0.0) {
        return Err(ModelError::SampleTime { dt_s });
    }
    if !(kv.is_finite() && kv > 0.0) {
        let allowed = "it must be finite and greater than 0 1/s";
        return Err(refused("position_gain_per_s", kv, allowed));
    }
    measured.check(3)?;
    delay_s.map_or(Ok(()), |delay_s| measured.check_delay(delay_s))?;
    let answered = measured.answered();
    if 2 * answered.frequency_hz.len() <= 3 {
        let model = VelocityLoop {
            gain: if delay_s.is_some() { 1.0 } else { 0.0 },
            bandwidth_hz: measured.middle_hz(),
            delay_s: delay_s.unwrap_or(0.0),
            position_gain_per_s: kv,
            dt_s,
        };
        return Ok(VelocityLoopFit {
            model,
            gain_deviation: 0.0,
            bandwidth_deviation_hz: model.bandwidth_hz,
            delay_deviation_s: 0.0,
            residual_rms: 1.0,
        });
    }
    let measured = &answered;
    let root_weight: Vec<f64> = measured.weights().iter().map(|weight| weight.sqrt()).collect();
    let f = &measured.frequency_hz;
    let tau_0 = 1.0 / (TAU * f[f.len() - 1]);
    let model = |x: &[f64]| VelocityLoop {
        bandwidth_hz: x[0].exp(),
        gain: x.get(1).map_or(1.0, |gain| gain.exp()),
        delay_s: delay_s.unwrap_or_else(|| tau_0 * x.get(2).copied().unwrap_or(0.0)),
        position_gain_per_s: kv,
        dt_s,
    };
    let residuals = |x: &[f64]| {
        let model = model(x);
        let bandwidths_hz = f[0] / BEYOND_BAND..=f[f.len() - 1] * BEYOND_BAND;
        let is_plausible =
            delay_s.is_some() || (-0.5..=10.0).contains(&(model.delay_s * f[f.len() - 1]));
        if !bandwidths_hz.contains(&model.bandwidth_hz) || !is_plausible {
            return DVector::from_element(2 * f.len(), f64::INFINITY);
        }
        let mut residuals = DVector::zeros(2 * f.len());
        for (k, weight) in root_weight.iter().enumerate() {
            let ratio = measured.response[k] / model.at(f[k]);
            residuals[2 * k] = weight * ratio.norm().ln();
            residuals[2 * k + 1] = weight * ratio.arg();
        }
        residuals
    };
    let (low, high) = (f[0].ln(), (4.0 * f[f.len() - 1]).ln());
    let mut best: Option<Minimum> = None;
    for i in 0..BANDWIDTHS {
        let share = (i as f64 + 0.5) / BANDWIDTHS as f64;
        let mut start = vec![low + share * (high - low)];
        if delay_s.is_none() {
            start.extend([0.0, 0.0]);
        }
        let found = minimize(&start, &[], &residuals);
        if found.cost.is_finite() && best.as_ref().is_none_or(|least| found.cost < least.cost) {
            best = Some(found);
        }
    }
    let minimum = best.ok_or(ModelError::Numerics {
        what: "the fit of the velocity loop",
        reason: "no start gives a finite model",
    })?;
    let model = model(&minimum.parameters);
    let deviation = |i: usize| minimum.deviation.get(i).copied().unwrap_or(0.0);
    let all: f64 = root_weight.iter().map(|weight| weight * weight).sum();
    Ok(VelocityLoopFit {
        bandwidth_deviation_hz: model.bandwidth_hz * deviation(0),
        gain_deviation: model.gain * deviation(1),
        delay_deviation_s: tau_0 * deviation(2),
        residual_rms: (minimum.cost / all).sqrt(),
        model,
    })
}

impl VelocityLoop {
    /// Returns the response from velocity input to position, with the position loop closed.
    ///
    /// # Units
    /// - `frequency_hz` in Hz
    pub fn response(&self, frequency_hz: &[f64]) -> Vec<Complex<f64>> {
        frequency_hz.iter().map(|f| self.at(*f)).collect()
    }

    /// Returns the delay in whole cycles.
    pub fn delay_samples(&self) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "casts of floats saturate; a negative delay is 0 samples"
        )]
        let samples = (self.delay_s / self.dt_s).round().max(0.0) as usize;
        samples
    }

    /// `Z{a / (s (s + a))} = T / (z - 1) - (1 - E) / (a (z - E))`, `E = exp(-a T)`; multiplied by `z - 1`, so
    /// that frequency zero, where only the position loop remains, is no exception.
    fn at(&self, frequency_hz: f64) -> Complex<f64> {
        let (a, w) = (TAU * self.bandwidth_hz, TAU * frequency_hz);
        let z = Complex::new(0.0, w * self.dt_s).exp();
        let decay = (-a * self.dt_s).exp();
        let held = self.dt_s - (z - 1.0) * (z - decay).inv() * ((1.0 - decay) / a);
        let open = held * self.gain * Complex::new(0.0, -w * self.delay_s).exp();
        open / (z - 1.0 + z.inv() * open * self.position_gain_per_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Method, StateSpace, discretize, from_transfer_function};

    #[test]
    fn the_response_tends_to_the_position_loop_at_rest() {
        let model = truth();
        for hz in [0.0, 2e-200, -2e-200, 1e-300, 1e-12] {
            let response = model.response(&[hz])[0];
            assert!(
                (response - 1.0 / model.position_gain_per_s).norm() < 1e-12,
                "{hz}: {response}"
            );
        }
    }

    fn truth() -> VelocityLoop {
        VelocityLoop {
            gain: 0.97,
            bandwidth_hz: 30.0,
            delay_s: 2e-3,
            position_gain_per_s: 40.0,
            dt_s: 1e-3,
        }
    }

    fn measured(truth: &VelocityLoop) -> FrequencyResponse {
        let frequency_hz: Vec<f64> = (1..100).map(|k| 0.5 * f64::from(k)).collect();
        FrequencyResponse {
            response: truth.response(&frequency_hz),
            coherence: vec![0.99; frequency_hz.len()],
            frequency_hz,
            n_averages: 4.0,
        }
    }

    #[test]
    fn the_response_is_that_of_the_loop_that_learning_believes_in() {
        let (truth, a) = (truth(), TAU * 30.0);
        let plant = from_transfer_function(&[0.97 * a], &[1.0, a, 0.0], None).unwrap();
        let held = discretize(&plant, 1e-3, Method::ZeroOrderHold).unwrap().delayed(2).unwrap();
        let controller = StateSpace::static_gain(nalgebra::dmatrix![40.0], Some(1e-3))
            .unwrap()
            .delayed(1)
            .unwrap();
        let closed = held.feedback(&controller).unwrap();
        for f in [0.5, 7.0, 60.0, 300.0] {
            let expected = closed.frequency_response(&[TAU * f]).unwrap()[0][(0, 0)];
            assert!((truth.at(f) - expected).norm() < 1e-10 * expected.norm(), "{f} Hz");
        }
    }

    #[test]
    fn gain_bandwidth_and_delay_are_found_again() {
        let found = fit_velocity_loop(&measured(&truth()), 40.0, 1e-3, None).unwrap();
        assert!((found.model.bandwidth_hz - 30.0).abs() < 1e-5, "{found:?}");
        assert!(
            (found.model.gain - 0.97).abs() < 1e-7 && (found.model.delay_s - 2e-3).abs() < 1e-8
        );
        assert_eq!(found.model.delay_samples(), 2);
        let known = fit_velocity_loop(&measured(&truth()), 40.0, 1e-3, Some(2e-3)).unwrap();
        assert!((known.model.gain - 1.0).abs() < 1e-15 && known.delay_deviation_s <= 0.0);
        assert!((known.model.bandwidth_hz / 30.0 - 1.0).abs() < 0.2);
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let data = measured(&truth());
        assert!(fit_velocity_loop(&data, 0.0, 1e-3, None).is_err());
        assert!(fit_velocity_loop(&data, 40.0, 0.0, None).is_err());
        assert!(fit_velocity_loop(&data, 40.0, 1e-3, Some(f64::NAN)).is_err());
        assert!(fit_velocity_loop(&data.band(1.0, 1.2), 40.0, 1e-3, None).is_err());
    }
}
