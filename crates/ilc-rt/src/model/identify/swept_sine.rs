//! Swept sine (chirp) with smooth ends.

use std::f64::consts::TAU;

use super::excitation::{check, refused, rise};
use crate::model::ModelError;

/// Share of the sweep for fading in and out, each at constant frequency.
const RAMP: f64 = 0.1;

/// Rise of the frequency over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spacing {
    /// Equal increments of frequency in equal times.
    Linear,
    /// Equal ratios of frequency in equal times: low frequencies get more time.
    Logarithmic,
}

/// Returns a sine that sweeps through a band.
///
/// `u(t) = A w(t) sin(phi(t))`, `d phi / dt = 2 pi f(t)`: `f` stays at `from_hz` while the half-cosine
/// window `w` rises, over a tenth of the time, goes through the band, and stays at `to_hz` while `w`
/// falls.
///
/// # Shapes
/// - returns `n_samples`
/// # Units
/// - `amplitude` in the unit of the input; `band_hz` (from, to) in Hz; `dt_s` in seconds
/// # Errors
/// - [`ModelError::Parameter`] or [`ModelError::SampleTime`] for a value out of range.
/// # Source
/// - \[pintelon2012\], section 5.2: swept sines.
pub fn swept_sine(
    amplitude: f64,
    band_hz: (f64, f64),
    n_samples: usize,
    dt_s: f64,
    spacing: Spacing,
) -> Result<Vec<f64>, ModelError> {
    check(amplitude, band_hz, dt_s)?;
    if n_samples < 8 {
        return Err(refused("n_samples", n_samples as f64, "at least 8 samples are needed"));
    }
    let (from_hz, to_hz) = band_hz;
    let whole_s = (n_samples - 1) as f64 * dt_s;
    let ramp_s = RAMP * whole_s;
    let sweep_s = whole_s - 2.0 * ramp_s;
    let turns = |t_s: f64| {
        let before = from_hz * t_s.min(ramp_s);
        let t = (t_s - ramp_s).clamp(0.0, sweep_s);
        let within = match spacing {
            Spacing::Linear => from_hz * t + (to_hz - from_hz) * t * t / (2.0 * sweep_s),
            Spacing::Logarithmic => {
                let rate = (to_hz / from_hz).ln() / sweep_s;
                from_hz * (rate * t).exp_m1() / rate
            }
        };
        before + within + to_hz * (t_s - ramp_s - sweep_s).max(0.0)
    };
    let sample = |k: usize| {
        let t_s = k as f64 * dt_s;
        let window = rise(t_s / ramp_s) * rise((whole_s - t_s) / ramp_s);
        amplitude * window * (TAU * turns(t_s)).sin()
    };
    Ok((0..n_samples).map(sample).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_sweep_has_the_mean_frequency_of_its_spacing() {
        let (n, dt_s) = (20_001, 1e-3);
        for (spacing, expected) in
            [(Spacing::Linear, 20.5), (Spacing::Logarithmic, 40.0_f64.sqrt())]
        {
            let u = swept_sine(1.0, (1.0, 40.0), n, dt_s, spacing).unwrap();
            // Upward zero crossings around the middle.
            let ups: Vec<f64> = (9_000..11_000)
                .filter(|&k| u[k] <= 0.0 && u[k + 1] > 0.0)
                .map(|k| k as f64 + u[k] / (u[k] - u[k + 1]))
                .collect();
            let before = ups.iter().rposition(|t| *t < 10_000.0).unwrap();
            let found = 1.0 / ((ups[before + 1] - ups[before]) * dt_s);
            assert!((found / expected - 1.0).abs() < 0.03, "{spacing:?}: {found} Hz");
        }
    }

    #[test]
    fn too_few_samples_are_refused() {
        assert!(swept_sine(1.0, (1.0, 2.0), 7, 0.1, Spacing::Linear).is_err());
    }
}
