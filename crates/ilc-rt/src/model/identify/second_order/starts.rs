//! Initial values of the fit: from linear fits, and from a grid over the band.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::super::fraction_start::{Begin, begins};
use super::SecondOrder;
use super::fit::{BEYOND_BAND, DAMPING_RANGE, Fit, Sign};
use crate::model::unwrap_phase;

/// Natural frequencies of the grid.
const FREQUENCIES: usize = 16;
/// Damping ratios of the grid.
const DAMPINGS: [f64; 4] = [0.05, 0.2, 0.7, 1.5];
/// Delays of the grid, in periods of the highest frequency.
const DELAYS: [f64; 5] = [0.0, 0.1, 0.25, 0.5, 1.0];

impl Fit<'_> {
    /// Returns the fractions of linear fits, each with its best gain, and with either sign.
    pub(super) fn linear_starts(&self) -> Vec<(Vec<f64>, Sign)> {
        let f = &self.measured.frequency_hz;
        let (low_hz, high_hz) = (f[0] / BEYOND_BAND, f[f.len() - 1] * BEYOND_BAND);
        let mut starts = Vec::new();
        for begin in begins(self.measured, &self.root_weight, self.dt_s, self.known.delay_s) {
            let Begin { w0_rad_s, damping, delay_s, sign } = begin;
            let natural_frequency_hz =
                (w0_rad_s / TAU).clamp(low_hz * (1.0 + 1e-6), high_hz * (1.0 - 1e-6));
            let damping = damping.clamp(2.0 * DAMPING_RANGE.0, 0.5 * DAMPING_RANGE.1);
            let dt_s = self.dt_s;
            let bare = SecondOrder { gain: 1.0, natural_frequency_hz, damping, delay_s, dt_s };
            let shape = bare.shape();
            let (mut log, mut all) = (0.0, 0.0);
            for (k, f) in f.iter().enumerate() {
                let weight = self.root_weight[k].powi(2);
                log += weight * (self.measured.response[k] / shape.at(*f)).norm().ln();
                all += weight;
            }
            for sign in [sign, -sign] {
                if self.known.gain.is_some_and(|gain| gain * sign < 0.0) {
                    continue;
                }
                let mut start = vec![(TAU * natural_frequency_hz).ln(), damping.ln()];
                if self.known.gain.is_none() {
                    start.push(log / all);
                }
                if self.known.delay_s.is_none() {
                    start.push(delay_s / self.tau_0);
                }
                starts.push((start, sign));
            }
        }
        starts
    }

    /// Returns natural frequencies and dampings over the band, each with its best gain and delay.
    pub(super) fn starts(&self) -> Vec<(Vec<f64>, Sign)> {
        let f = &self.measured.frequency_hz;
        let mut phase: Vec<f64> = self.measured.response.iter().map(|h| h.arg()).collect();
        unwrap_phase(&mut phase);
        // Measured phases are ambiguous by whole turns; the first one is near that of the gain.
        let mut starts = Vec::new();
        let (low, high) = (f[0].ln(), f[f.len() - 1].ln());
        for i in 0..FREQUENCIES {
            let share = (i as f64 + 0.5) / FREQUENCIES as f64;
            let w0 = TAU * (low + share * (high - low)).exp();
            for damping in DAMPINGS {
                crate::interrupt::point();
                let bare = SecondOrder {
                    gain: 1.0,
                    natural_frequency_hz: w0 / TAU,
                    damping,
                    delay_s: 0.0,
                    dt_s: self.dt_s,
                };
                let shape = bare.shape();
                let model: Vec<Complex<f64>> = f.iter().map(|f| shape.at(*f)).collect();
                let mut model_phase: Vec<f64> = model.iter().map(|g| g.arg()).collect();
                unwrap_phase(&mut model_phase);
                for sign in [1.0, -1.0] {
                    crate::interrupt::point();
                    if self.known.gain.is_some_and(|gain| gain * sign < 0.0) {
                        continue;
                    }
                    let shift = if sign < 0.0 { std::f64::consts::PI } else { 0.0 };
                    let first = phase[0] - model_phase[0] - shift;
                    let turns = TAU * (first / TAU).round();
                    let (mut num, mut den, mut log, mut all) = (0.0, 0.0, 0.0, 0.0);
                    for k in 0..f.len() {
                        let (w, weight) = (TAU * f[k], self.root_weight[k].powi(2));
                        num -= weight * w * (phase[k] - model_phase[k] - shift - turns);
                        den += weight * w * w;
                        log += weight * (self.measured.response[k].norm() / model[k].norm()).ln();
                        all += weight;
                    }
                    let mut start = vec![w0.ln(), damping.ln()];
                    if self.known.gain.is_none() {
                        start.push(log / all);
                    }
                    if self.known.delay_s.is_some() {
                        starts.push((start, sign));
                        continue;
                    }
                    // The slope of the phase gives the delay, unless noise made it jump.
                    for tau in DELAYS.iter().map(|t| TAU * t).chain([num / den / self.tau_0]) {
                        let mut start = start.clone();
                        start.push(tau);
                        starts.push((start, sign));
                    }
                }
            }
        }
        starts
    }
}
