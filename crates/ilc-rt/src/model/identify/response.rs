//! Estimate of the frequency response from a measurement, with its coherence.

use nalgebra::Complex;
use thiserror::Error;

use super::spectra::{Averaging, Spectra};
use crate::model::ModelError;

/// Frequencies with an input power below this share of the largest are skipped.
const EXCITED: f64 = 1e-16;
/// Coherence above which an estimate counts as perfect; remaining differences are the model's.
const COHERENCE_MAX: f64 = 0.9999;
/// Most turns of a known delay at the highest frequency: beyond, its phase is rounding.
const TURNS_MAX: f64 = 1e6;

/// A measured frequency response.
///
/// # Shapes
/// - all vectors have one entry per frequency, ascending
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyResponse {
    /// Frequencies.
    pub frequency_hz: Vec<f64>,
    /// Output over input.
    pub response: Vec<Complex<f64>>,
    /// Share of the output's power that depends linearly on the input, 0 to 1.
    pub coherence: Vec<f64>,
    /// Independent averages behind each estimate.
    pub n_averages: f64,
}

/// Refusal of numbers that are no measured response.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ResponseError {
    /// Another number of entries than frequencies.
    #[error("{what} has {found} entries; {needed}, one for each frequency, are needed")]
    Length {
        /// Name of the entries.
        what: &'static str,
        /// Entries given.
        found: usize,
        /// Number of frequencies.
        needed: usize,
    },
    /// A coherence out of range.
    #[error("coherence holds {value}; allowed 0 to 1")]
    Coherence {
        /// Value given.
        value: f64,
    },
    /// Less than one average.
    #[error("n_averages = {value}; at least 1 is needed")]
    Averages {
        /// Value given.
        value: f64,
    },
}

impl FrequencyResponse {
    /// Refuses a response whose numbers do not belong together, e.g. one from elsewhere.
    ///
    /// # Errors
    /// [`ResponseError`] for another number of entries than frequencies, a coherence beyond 0 to 1, or less than one
    /// average.
    pub fn checked(self) -> Result<Self, ResponseError> {
        let needed = self.frequency_hz.len();
        let lengths = [("response", self.response.len()), ("coherence", self.coherence.len())];
        if let Some((what, found)) = lengths.into_iter().find(|(_, found)| *found != needed) {
            return Err(ResponseError::Length { what, found, needed });
        }
        let is_out = |value: &f64| !(0.0..=1.0).contains(value);
        if let Some(value) = self.coherence.iter().copied().find(is_out) {
            return Err(ResponseError::Coherence { value });
        }
        let value = self.n_averages;
        let is_enough = value.is_finite() && value >= 1.0;
        if is_enough { Ok(self) } else { Err(ResponseError::Averages { value }) }
    }
}

/// Estimates the frequency response from input and output.
///
/// `H_1 = S_uy / S_uu`, `gamma^2 = |S_uy|^2 / (S_uu S_yy)`; frequencies without excitation are
/// omitted. With a single average the coherence is always 1.
///
/// # Shapes
/// - `input`, `output`: one channel each, of the same length
/// # Units
/// - `dt_s` in seconds
/// # Errors
/// - [`ModelError::Length`] if the signals differ in length, [`ModelError::NotFinite`],
///   [`ModelError::SampleTime`], or [`ModelError::Parameter`] if they contain no segment or no
///   input.
/// # Source
/// - \[pintelon2012\], section 2.5; \[bendat2010\], sections 6.1 and 9.1.
pub fn frequency_response(
    input: &[f64],
    output: &[f64],
    dt_s: f64,
    averaging: Averaging,
) -> Result<FrequencyResponse, ModelError> {
    if !(dt_s.is_finite() && dt_s > 0.0) {
        return Err(ModelError::SampleTime { dt_s });
    }
    if input.len() != output.len() {
        return Err(ModelError::Length {
            what: "output",
            found: output.len(),
            allowed: format!("as many as the input's {} are needed", input.len()),
        });
    }
    for (what, signal) in [("input", input), ("output", output)] {
        if let Some(row) = signal.iter().position(|value| !value.is_finite()) {
            return Err(ModelError::NotFinite { what, row, col: 0, value: signal[row] });
        }
    }
    let spectra = Spectra::of(input, output, averaging)?;
    let most = spectra.input.iter().copied().fold(0.0, f64::max);
    if most <= 0.0 {
        return Err(ModelError::Parameter {
            what: "power of the input",
            value: 0.0,
            allowed: "an input that excites nothing identifies nothing",
        });
    }
    let mut measured = FrequencyResponse {
        frequency_hz: Vec::new(),
        response: Vec::new(),
        coherence: Vec::new(),
        n_averages: spectra.n_averages,
    };
    for (bin, (&uu, &yy)) in spectra.input.iter().zip(&spectra.output).enumerate() {
        if uu <= EXCITED * most {
            continue;
        }
        let cross = spectra.cross[bin];
        measured.frequency_hz.push(bin as f64 / (spectra.n as f64 * dt_s));
        measured.response.push(cross / uu);
        // A zero output does not depend on the input.
        let coherence = if yy > 0.0 { cross.norm_sqr() / (uu * yy) } else { 0.0 };
        measured.coherence.push(coherence.min(1.0));
    }
    Ok(measured)
}

impl FrequencyResponse {
    /// Returns the part in a band, including both ends.
    ///
    /// # Units
    /// - `from_hz`, `to_hz` in Hz
    #[must_use]
    pub fn band(&self, from_hz: f64, to_hz: f64) -> Self {
        let slack = 1e-9 * to_hz.abs();
        let inside: Vec<usize> = (0..self.frequency_hz.len())
            .filter(|&i| {
                self.frequency_hz[i] >= from_hz - slack && self.frequency_hz[i] <= to_hz + slack
            })
            .collect();
        let pick = |values: &[f64]| inside.iter().map(|&i| values[i]).collect();
        Self {
            frequency_hz: pick(&self.frequency_hz),
            response: inside.iter().map(|&i| self.response[i]).collect(),
            coherence: pick(&self.coherence),
            n_averages: self.n_averages,
        }
    }

    /// Ensures that the phase of a known delay is a number at every frequency.
    ///
    /// # Errors
    /// - [`ModelError::Parameter`] beyond a million turns.
    pub(super) fn check_delay(&self, delay_s: f64) -> Result<(), ModelError> {
        let highest_hz = self.frequency_hz.iter().copied().fold(0.0, f64::max);
        // False for a number that is not finite.
        if delay_s.abs() * highest_hz <= TURNS_MAX {
            return Ok(());
        }
        let allowed =
            "a known delay must be finite, and at most a million periods of the highest frequency";
        Err(ModelError::Parameter { what: "delay_s", value: delay_s, allowed })
    }

    /// Returns the part with a non-zero response: a response of 0 has no logarithm.
    pub(super) fn answered(&self) -> Self {
        let answers: Vec<usize> =
            (0..self.response.len()).filter(|&i| self.response[i].norm() > 0.0).collect();
        let pick = |values: &[f64]| answers.iter().map(|&i| values[i]).collect();
        Self {
            frequency_hz: pick(&self.frequency_hz),
            response: answers.iter().map(|&i| self.response[i]).collect(),
            coherence: pick(&self.coherence),
            n_averages: self.n_averages,
        }
    }

    /// Returns the centre of the band, the default of a natural frequency.
    pub(super) fn middle_hz(&self) -> f64 {
        let ends = (self.frequency_hz.first(), self.frequency_hz.last());
        if let (Some(low), Some(high)) = ends { (low * high).sqrt() } else { 1.0 }
    }

    /// Returns the relative standard deviation of each estimate's magnitude, and of its phase in
    /// rad.
    ///
    /// `sigma = sqrt((1 - gamma^2) / (2 gamma^2 n))`
    ///
    /// # Source
    /// - \[bendat2010\], section 9.2.
    pub fn relative_deviation(&self) -> Vec<f64> {
        let deviation = |gamma2: &f64| {
            ((1.0 - gamma2) / (2.0 * gamma2.max(f64::MIN_POSITIVE) * self.n_averages.max(1.0)))
                .sqrt()
        };
        self.coherence.iter().map(deviation).collect()
    }

    /// Returns the weight of each estimate in a fit: its inverse variance, up to a factor.
    ///
    /// `w = gamma^2 / (1 - gamma^2)`, bounded for a perfect coherence, and 1 throughout for a
    /// single average
    pub fn weights(&self) -> Vec<f64> {
        if self.n_averages < 1.5 {
            return vec![1.0; self.coherence.len()];
        }
        let weight = |gamma2: &f64| {
            let gamma2 = gamma2.clamp(0.0, COHERENCE_MAX);
            gamma2 / (1.0 - gamma2)
        };
        self.coherence.iter().map(weight).collect()
    }

    /// Checks that there is something to fit.
    pub(super) fn check(&self, n_parameters: usize) -> Result<(), ModelError> {
        let n = self.frequency_hz.len();
        for (what, found) in
            [("response", self.response.len()), ("coherence", self.coherence.len())]
        {
            if found != n {
                return Err(ModelError::Length {
                    what,
                    found,
                    allowed: format!("one for each of the {n} frequencies is needed"),
                });
            }
        }
        if 2 * n <= n_parameters {
            return Err(ModelError::Length {
                what: "frequency_hz",
                found: n,
                allowed: format!("more than half of the {n_parameters} parameters are needed"),
            });
        }
        for row in 0..n {
            let (f, g, c) = (self.frequency_hz[row], self.response[row], self.coherence[row]);
            let bad = |what, value| Err(ModelError::NotFinite { what, row, col: 0, value });
            if !(f.is_finite() && f > 0.0 && (row == 0 || f > self.frequency_hz[row - 1])) {
                return Err(ModelError::Parameter {
                    what: "frequency_hz",
                    value: f,
                    allowed: "frequencies must be greater than 0 Hz and rise",
                });
            }
            if !(g.re.is_finite() && g.im.is_finite()) {
                return bad("response", g.norm());
            }
            if !(0.0..=1.0).contains(&c) {
                return bad("coherence", c);
            }
            // Without coherence a response of 0 is that of a silent axis; with it, a contradiction.
            if g.norm() <= 0.0 && c > 0.0 {
                return Err(ModelError::Parameter {
                    what: "response",
                    value: 0.0,
                    allowed: "a response of 0 has no logarithm: leave the frequency out",
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_do_not_belong_together_are_refused() {
        let response = |coherence: Vec<f64>, n_averages| FrequencyResponse {
            frequency_hz: vec![1.0, 2.0],
            response: vec![Complex::new(1.0, 0.0); 2],
            coherence,
            n_averages,
        };
        assert!(response(vec![0.0, 1.0], 1.0).checked().is_ok());
        for (refused, sentence) in [
            (response(vec![1.0], 1.0), "coherence has 1 entries; 2, one for each frequency,"),
            (response(vec![0.5, 1.5], 1.0), "coherence holds 1.5; allowed 0 to 1"),
            (response(vec![0.5, f64::NAN], 1.0), "coherence holds NaN"),
            (response(vec![0.5, 0.5], 0.5), "n_averages = 0.5; at least 1"),
            (response(vec![0.5, 0.5], f64::INFINITY), "n_averages = inf"),
        ] {
            let told = refused.checked().unwrap_err().to_string();
            assert!(told.starts_with(sentence), "{told}");
        }
    }

    #[test]
    fn a_periodic_signal_gives_the_response_of_the_model_exactly() {
        use crate::model::{Method, discretize, identify::multisine, second_order};
        let axis =
            discretize(&second_order(90.0, 0.4).unwrap(), 2e-3, Method::ZeroOrderHold).unwrap();
        let period = multisine(1e-3, (1.0, 60.0), 2000, 2e-3).unwrap();
        let u = period.repeat(4);
        let y = axis.simulate(&u, None).unwrap();
        // The first period contains the transient.
        let averaging = Averaging::Periods { period_samples: 2000 };
        let found = frequency_response(&u[2000..], &y[2000..], 2e-3, averaging).unwrap();
        assert_eq!(found.frequency_hz.len(), 237);
        let w: Vec<f64> = found.frequency_hz.iter().map(|f| std::f64::consts::TAU * f).collect();
        let expected = axis.frequency_response(&w).unwrap();
        for ((found, expected), coherence) in
            found.response.iter().zip(expected).zip(&found.coherence)
        {
            assert!((found - expected[(0, 0)]).norm() < 1e-9 * found.norm());
            assert!((coherence - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_named() {
        let averaging = Averaging::Periods { period_samples: 16 };
        let (good, zeros) = (vec![1.0; 32], vec![0.0; 32]);
        let wrong = |u: &[f64], y: &[f64], dt_s| {
            frequency_response(u, y, dt_s, averaging).unwrap_err().to_string()
        };
        assert!(wrong(&good, &good[1..], 1.0).contains("output holds 31"));
        assert!(wrong(&good[..8], &good[..8], 1.0).contains("samples of a period"));
        assert!(wrong(&good, &good, -1.0).contains("dt_s"));
        assert!(wrong(&zeros, &good, 1.0).contains("excites nothing"));
        let mut nan = good.clone();
        nan[3] = f64::NAN;
        assert!(wrong(&nan, &good, 1.0).contains("input holds NaN"));
        assert!(wrong(&good, &nan, 1.0).contains("output holds NaN"));
        let bad = Averaging::Welch { segment_samples: 16, overlap_samples: 16 };
        assert!(frequency_response(&good, &good, 1.0, bad).is_err());
    }
}
