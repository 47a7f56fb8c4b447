//! Multisine: many sines at once, with phases that keep the peak low.

use ilc_numerics::fourier::{self, Complex};

use super::excitation::{check, refused};
use crate::model::ModelError;

/// Returns one period of a sum of sines of equal amplitude, one at each harmonic of the period in a
/// band.
///
/// `u[k] = c sum_h cos(2 pi h k / N + phi_h)`, `phi_i = - pi i (i - 1) / H` for the i-th of `H`
/// lines, with `c` such that the peak is `amplitude`, and shifted in time to begin at its smallest
/// value.
///
/// # Shapes
/// - returns `n_samples`
/// # Units
/// - `amplitude` in the unit of the input; `band_hz` (from, to) in Hz; `dt_s` in seconds
/// # Errors
/// - [`ModelError::Parameter`] or [`ModelError::SampleTime`] for a value out of range, or if no
///   harmonic of the period is in the band.
/// # Source
/// - \[schroeder1970\]: the phases; \[pintelon2012\], section 5.2.
pub fn multisine(
    amplitude: f64,
    band_hz: (f64, f64),
    n_samples: usize,
    dt_s: f64,
) -> Result<Vec<f64>, ModelError> {
    check(amplitude, band_hz, dt_s)?;
    let period_s = n_samples as f64 * dt_s;
    let in_band = |line: &usize| {
        let line = *line as f64;
        line >= band_hz.0 * period_s - 1e-9 && line <= band_hz.1 * period_s + 1e-9
    };
    let lines: Vec<usize> = (1..n_samples / 2).filter(in_band).collect();
    if lines.is_empty() {
        let allowed = "no harmonic of the period lies in the band: a longer period is needed";
        return Err(refused("from_hz", band_hz.0, allowed));
    }
    let count = lines.len() as f64;
    let mut spectrum = vec![Complex::new(0.0, 0.0); n_samples];
    for (i, &line) in lines.iter().enumerate() {
        let i = i as f64 + 1.0;
        let phase = -std::f64::consts::PI * i * (i - 1.0) / count;
        spectrum[line] = Complex::from_polar(0.5, phase);
        spectrum[n_samples - line] = spectrum[line].conj();
    }
    fourier::inverse(n_samples).process(&mut spectrum);
    let mut values: Vec<f64> = spectrum.iter().map(|u| u.re).collect();
    let smallest = (0..n_samples).min_by(|&a, &b| values[a].abs().total_cmp(&values[b].abs()));
    values.rotate_left(smallest.unwrap_or(0));
    let peak = values.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    // Rounded down: the product with the peak must not exceed the amplitude.
    let scale = amplitude / peak * (1.0 - f64::EPSILON);
    for u in &mut values {
        *u *= scale;
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crest_factor_is_far_below_that_of_sines_in_phase() {
        for (band, n) in [((1.0, 60.0), 4000), ((0.5, 20.0), 10_000), ((5.0, 100.0), 2000)] {
            let u = multisine(1.0, band, n, 2e-3).unwrap();
            let rms = (u.iter().map(|u| u * u).sum::<f64>() / n as f64).sqrt();
            assert!(1.0 / rms < 2.0, "crest factor {}", 1.0 / rms);
        }
    }

    #[test]
    fn a_band_between_two_harmonics_is_refused() {
        assert!(multisine(1.0, (1.1, 1.9), 500, 2e-3).is_err());
    }
}
