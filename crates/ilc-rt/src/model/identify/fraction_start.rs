//! Initial values for the fit of a second-order model: linear fits, one for each possible delay.

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, DMatrix, DVector};

use super::FrequencyResponse;
use crate::model::unwrap_phase;

/// Delays tried over the range that the phase permits.
const DELAYS: usize = 24;
/// Relative extension of that range at either end.
const MARGIN: f64 = 0.3;
/// Rounds of a linear fit, each weighted by the previous denominator.
const ROUNDS: usize = 6;

/// An initial second-order fraction, without its gain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Begin {
    pub(super) w0_rad_s: f64,
    pub(super) damping: f64,
    pub(super) delay_s: f64,
    /// Sign of the static gain.
    pub(super) sign: f64,
}

/// Returns a fraction for each delay.
///
/// Over the band a fraction with two poles turns the phase by 0 to 180 degrees; the remainder is
/// due to the delay, which therefore is in a range of half the inverse of the band's width. For
/// each delay in it the fraction is found by the linear rounds of Sanathanan and Koerner, wherever
/// its natural frequency is: in the band, below or above. The zero-order hold is divided out first,
/// without its aliasing.
///
/// # Source
/// - \[sanathanan1963\].
pub(super) fn begins(
    measured: &FrequencyResponse,
    root_weight: &[f64],
    dt_s: Option<f64>,
    known_delay_s: Option<f64>,
) -> Vec<Begin> {
    let f = &measured.frequency_hz;
    let delays: Vec<f64> = if let Some(delay_s) = known_delay_s {
        vec![delay_s]
    } else {
        let mut phase: Vec<f64> = measured.response.iter().map(|h| h.arg()).collect();
        unwrap_phase(&mut phase);
        let turned = phase[phase.len() - 1] - phase[0];
        let width = TAU * (f[f.len() - 1] - f[0]);
        let hold_s = 0.5 * dt_s.unwrap_or(0.0);
        let (low, high) = ((-turned - PI) / width - hold_s, -turned / width - hold_s);
        let margin = MARGIN * (high - low);
        let step = (high - low + 2.0 * margin) / (DELAYS - 1) as f64;
        let grid = (0..DELAYS).map(|i| low - margin + step * i as f64);
        grid.chain([0.0]).collect()
    };
    delays.into_iter().filter_map(|delay_s| begin(measured, root_weight, dt_s, delay_s)).collect()
}

/// Fits `b_0 / (s^2 + a_1 s + a_0)`, `s` in units of the middle of the band, to the response without
/// the delay.
fn begin(
    measured: &FrequencyResponse,
    root_weight: &[f64],
    dt_s: Option<f64>,
    delay_s: f64,
) -> Option<Begin> {
    let f = &measured.frequency_hz;
    let w_ref = TAU * (f[0] * f[f.len() - 1]).sqrt();
    let points: Vec<Complex<f64>> = f.iter().map(|f| Complex::new(0.0, TAU * f / w_ref)).collect();
    let response: Vec<Complex<f64>> = measured
        .response
        .iter()
        .zip(f)
        .map(|(h, f)| {
            let held = dt_s.map_or(1.0, |dt_s| {
                let half = PI * f * dt_s;
                if half == 0.0 { 1.0 } else { half.sin() / half }
            });
            let late_s = delay_s + 0.5 * dt_s.unwrap_or(0.0);
            // Where the hold's gain vanishes there is nothing to divide by.
            let gain = if held.abs() < 0.05 { 0.05 } else { held };
            h * Complex::new(0.0, TAU * f * late_s).exp() / gain
        })
        .collect();
    let mut before: Vec<f64> = points.iter().map(|s| s.norm().max(1.0).powi(2)).collect();
    let mut found = None;
    for _ in 0..ROUNDS {
        crate::interrupt::point();
        let n = f.len();
        let (mut a, mut b) = (DMatrix::zeros(2 * n, 3), DVector::zeros(2 * n));
        for k in 0..n {
            let (s, h) = (points[k], response[k]);
            let scale = root_weight[k] / (h.norm() * before[k]);
            let row = [Complex::new(scale, 0.0), -h * s * scale, -h * scale];
            let right = h * s * s * scale;
            for (col, value) in row.iter().enumerate() {
                a[(2 * k, col)] = value.re;
                a[(2 * k + 1, col)] = value.im;
            }
            b[2 * k] = right.re;
            b[2 * k + 1] = right.im;
        }
        let x = a.svd(true, true).solve(&b, 1e-14).ok()?;
        let (b_0, a_1, a_0) = (x[0], x[1], x[2]);
        if ![b_0, a_1, a_0].iter().all(|value| value.is_finite()) {
            break;
        }
        for (size, s) in before.iter_mut().zip(&points) {
            *size = (s * s + s * a_1 + a_0).norm().max(f64::MIN_POSITIVE);
        }
        found = Some((b_0, a_1, a_0));
    }
    let (b_0, a_1, a_0) = found?;
    let w0 = a_0.abs().sqrt();
    let damping = a_1.abs() / (2.0 * w0);
    let begin =
        Begin { w0_rad_s: w0 * w_ref, damping, delay_s, sign: if b_0 < 0.0 { -1.0 } else { 1.0 } };
    (begin.w0_rad_s.is_normal() && damping.is_finite()).then_some(begin)
}
