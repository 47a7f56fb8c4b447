//! Fit of the model that most axes are near to: gain, natural frequency, damping and delay.

use std::f64::consts::TAU;

use nalgebra::{Complex, DVector};

use super::FrequencyResponse;
use super::fraction_start::{Begin, begins};
use super::least_squares::{Minimum, minimize};
use crate::model::{Method, ModelError, StateSpace, discretize, second_order, unwrap_phase};

/// Natural frequencies tried over the band to begin from.
const FREQUENCIES: usize = 16;
/// Damping ratios tried to begin from.
const DAMPINGS: [f64; 4] = [0.05, 0.2, 0.7, 1.5];
/// Starts that are followed to their minimum.
const FOLLOWED: usize = 10;
/// Cost of each frequency's weight below which a start has led to the model itself.
const EXACT: f64 = 1e-22;
/// Fits whose cost is within this factor of the least, 5 % in the RMS of what they leave over, are as good.
const AS_GOOD: f64 = 1.1;
/// Delays tried to begin from, in periods of the highest frequency.
const DELAYS: [f64; 5] = [0.0, 0.1, 0.25, 0.5, 1.0];
/// Natural frequencies may lie outside the band by this factor.
const BEYOND_BAND: f64 = 30.0;
/// Damping ratios that are searched.
const DAMPING_RANGE: (f64, f64) = (1e-4, 100.0);

/// A second-order model with delay.
///
/// `G(s) = K w0^2 / (s^2 + 2 delta w0 s + w0^2) exp(-s tau)`; if sampled, the fraction is that of a
/// zero-order hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondOrder {
    /// Static gain `K`.
    pub gain: f64,
    /// Natural frequency `w0 / 2 pi`.
    pub natural_frequency_hz: f64,
    /// Damping ratio `delta`.
    pub damping: f64,
    /// Delay `tau`, beyond that of the hold if sampled.
    pub delay_s: f64,
    /// Sample time of the hold; `None` for a continuous model.
    pub dt_s: Option<f64>,
}

/// What is known beforehand and not fitted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Known {
    /// Static gain.
    pub gain: Option<f64>,
    /// Delay.
    pub delay_s: Option<f64>,
}

/// A fitted second-order model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondOrderFit {
    /// The model.
    pub model: SecondOrder,
    /// Standard deviation of the gain, from what the fit leaves over; 0 if known.
    pub gain_deviation: f64,
    /// Standard deviation of the natural frequency.
    pub natural_frequency_deviation_hz: f64,
    /// Standard deviation of the damping ratio.
    pub damping_deviation: f64,
    /// Standard deviation of the delay; 0 if known.
    pub delay_deviation_s: f64,
    /// Weighted RMS of the relative difference of measurement and model.
    pub residual_rms: f64,
}

/// Fits a second-order model with delay to a frequency response.
///
/// `min sum_k w_k |ln (H_k / G(f_k))|^2`, `w = gamma^2 / (1 - gamma^2)`: magnitude counts in relative
/// terms and phase in radians, both as much as the coherence trusts them. Damping and natural
/// frequency are positive by construction, so the model is stable. An axis that answers at two
/// frequencies or fewer gives a model without gain and a residual of 1, which [`super::doubt`] speaks
/// against.
///
/// # Shapes
/// - `measured`: more than two frequencies, without 0 Hz
/// # Units
/// - `dt_s` in seconds: the hold's, for a response from a sampled input; `None` for a continuous one
/// # Errors
/// - [`ModelError::Length`], [`ModelError::Parameter`] or [`ModelError::NotFinite`] for a response
///   that cannot be fitted; [`ModelError::SampleTime`].
/// # Source
/// - \[pintelon2012\], section 9.8.3: the logarithmic least-squares estimator.
pub fn fit_second_order(
    measured: &FrequencyResponse,
    dt_s: Option<f64>,
    known: Known,
) -> Result<SecondOrderFit, ModelError> {
    if let Some(dt_s) = dt_s
        && !(dt_s.is_finite() && dt_s > 0.0)
    {
        return Err(ModelError::SampleTime { dt_s });
    }
    check_known(known)?;
    measured.check(4)?;
    let answered = measured.answered();
    if 2 * answered.frequency_hz.len() <= 4 {
        return Ok(SecondOrderFit::of_silence(measured, dt_s, known));
    }
    let fit = Fit::new(&answered, dt_s, known);
    let mut starts: Vec<(f64, Sign)> = Vec::new();
    let mut points = Vec::new();
    for start in fit.linear_starts().into_iter().chain(fit.starts()) {
        let cost = fit.residuals(&start.0, start.1).norm_squared();
        if cost.is_finite() {
            starts.push((cost, start.1));
            points.push(start.0);
        }
    }
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| starts[a].0.total_cmp(&starts[b].0));
    let all: f64 = fit.root_weight.iter().map(|weight| weight * weight).sum();
    let mut ends: Vec<(Minimum, Sign)> = Vec::new();
    for &i in order.iter().take(FOLLOWED) {
        let sign = starts[i].1;
        ends.push((minimize(&points[i], &|x| fit.residuals(x, sign)), sign));
        if ends.last().is_some_and(|(end, _)| end.cost <= EXACT * all) {
            break;
        }
    }
    let least = ends.iter().map(|(end, _)| end.cost).fold(f64::INFINITY, f64::min);
    let delay_s = |(end, sign): &(Minimum, Sign)| fit.model(&end.parameters, *sign).delay_s.abs();
    // Noisy data hardly tell a delay from more damping: of fits that are as good, the plainest.
    let as_good = ends.iter().filter(|(end, _)| end.cost <= AS_GOOD * least);
    let plainest = as_good.min_by(|a, b| delay_s(a).total_cmp(&delay_s(b)));
    let (minimum, sign) = plainest.ok_or(ModelError::Numerics {
        what: "the second-order fit",
        reason: "no start gives a finite model",
    })?;
    Ok(fit.result(minimum, *sign))
}

type Sign = f64;

impl SecondOrderFit {
    /// The fit to an axis that does not answer: no gain, and all of the response left over.
    fn of_silence(measured: &FrequencyResponse, dt_s: Option<f64>, known: Known) -> Self {
        let model = SecondOrder {
            gain: known.gain.unwrap_or(0.0),
            natural_frequency_hz: measured.middle_hz(),
            damping: 1.0,
            delay_s: known.delay_s.unwrap_or(0.0),
            dt_s,
        };
        Self {
            model,
            gain_deviation: 0.0,
            natural_frequency_deviation_hz: model.natural_frequency_hz,
            damping_deviation: 1.0,
            delay_deviation_s: 0.0,
            residual_rms: 1.0,
        }
    }
}

fn check_known(known: Known) -> Result<(), ModelError> {
    let bad = |value: f64| !value.is_finite();
    if let Some(value) = known.gain.filter(|gain| bad(*gain) || *gain == 0.0) {
        let allowed = "a known gain must be finite and not 0";
        return Err(ModelError::Parameter { what: "gain", value, allowed });
    }
    if let Some(value) = known.delay_s.filter(|delay_s| bad(*delay_s)) {
        let allowed = "a known delay must be finite";
        return Err(ModelError::Parameter { what: "delay_s", value, allowed });
    }
    Ok(())
}

/// The response on its way into the fit. Parameters: `ln w0`, `ln delta`, then `ln |K|` and
/// `tau / tau_0` unless known.
struct Fit<'a> {
    measured: &'a FrequencyResponse,
    root_weight: Vec<f64>,
    dt_s: Option<f64>,
    known: Known,
    /// Unit of the delay: a radian at the highest frequency.
    tau_0: f64,
    /// Delays that are searched: from half a period of the highest frequency too early to where the
    /// spacing of the frequencies no longer tells turns apart.
    delay_range_s: (f64, f64),
}

impl<'a> Fit<'a> {
    fn new(measured: &'a FrequencyResponse, dt_s: Option<f64>, known: Known) -> Self {
        let highest_hz = measured.frequency_hz.last().copied().unwrap_or(1.0);
        let root_weight = measured.weights().iter().map(|weight| weight.sqrt()).collect();
        let f = &measured.frequency_hz;
        let gap_hz = f.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        Self {
            measured,
            root_weight,
            dt_s,
            known,
            tau_0: 1.0 / (TAU * highest_hz),
            delay_range_s: (-0.5 / highest_hz, 0.5 / gap_hz),
        }
    }

    /// Whether a model lies where one is looked for.
    fn is_searched(&self, model: &SecondOrder) -> bool {
        let f = &self.measured.frequency_hz;
        let (low_hz, high_hz) = (f[0] / BEYOND_BAND, f[f.len() - 1] * BEYOND_BAND);
        let (early_s, late_s) = self.delay_range_s;
        (low_hz..=high_hz).contains(&model.natural_frequency_hz)
            && (DAMPING_RANGE.0..=DAMPING_RANGE.1).contains(&model.damping)
            && (self.known.delay_s.is_some() || (early_s..=late_s).contains(&model.delay_s))
    }

    fn model(&self, x: &[f64], sign: Sign) -> SecondOrder {
        let mut rest = x[2..].iter();
        let mut next = || rest.next().copied().unwrap_or(0.0);
        SecondOrder {
            natural_frequency_hz: x[0].exp() / TAU,
            damping: x[1].exp(),
            gain: self.known.gain.unwrap_or_else(|| sign * next().exp()),
            delay_s: self.known.delay_s.unwrap_or_else(|| self.tau_0 * next()),
            dt_s: self.dt_s,
        }
    }

    fn residuals(&self, x: &[f64], sign: Sign) -> DVector<f64> {
        let model = self.model(x, sign);
        let n = self.root_weight.len();
        if !self.is_searched(&model) {
            return DVector::from_element(2 * n, f64::INFINITY);
        }
        let mut residuals = DVector::zeros(2 * n);
        let shape = model.shape();
        for (k, weight) in self.root_weight.iter().enumerate() {
            let ratio = self.measured.response[k] / shape.at(self.measured.frequency_hz[k]);
            residuals[2 * k] = weight * ratio.norm().ln();
            residuals[2 * k + 1] = weight * ratio.arg();
        }
        residuals
    }

    /// The fractions of linear fits, each with the gain that suits it, and with either sign.
    fn linear_starts(&self) -> Vec<(Vec<f64>, Sign)> {
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

    /// Natural frequencies and dampings over the band, each with the gain and the delay that suit it.
    fn starts(&self) -> Vec<(Vec<f64>, Sign)> {
        let f = &self.measured.frequency_hz;
        let mut phase: Vec<f64> = self.measured.response.iter().map(|h| h.arg()).collect();
        unwrap_phase(&mut phase);
        // Measured phases are known up to whole turns; the first one is near that of the gain.
        let mut starts = Vec::new();
        let (low, high) = (f[0].ln(), f[f.len() - 1].ln());
        for i in 0..FREQUENCIES {
            let share = (i as f64 + 0.5) / FREQUENCIES as f64;
            let w0 = TAU * (low + share * (high - low)).exp();
            for damping in DAMPINGS {
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
                    // The phase's slope says what the delay is, unless noise made it jump.
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

    fn result(&self, minimum: &Minimum, sign: Sign) -> SecondOrderFit {
        let model = self.model(&minimum.parameters, sign);
        let mut rest = minimum.deviation[2..].iter();
        let mut next = || rest.next().copied().unwrap_or(0.0);
        let all: f64 = self.root_weight.iter().map(|weight| weight * weight).sum();
        SecondOrderFit {
            model,
            natural_frequency_deviation_hz: model.natural_frequency_hz * minimum.deviation[0],
            damping_deviation: model.damping * minimum.deviation[1],
            gain_deviation: match self.known.gain {
                Some(_) => 0.0,
                None => model.gain.abs() * next(),
            },
            delay_deviation_s: match self.known.delay_s {
                Some(_) => 0.0,
                None => self.tau_0 * next(),
            },
            residual_rms: (minimum.cost / all).sqrt(),
        }
    }
}

/// A second-order model, ready to be evaluated at many frequencies.
struct Shape {
    model: SecondOrder,
    /// `(b_1 z + b_2) / (z^2 + a_1 z + a_2)` of the sampled fraction.
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

    /// Returns the model in state space: sampled with whole samples of delay, or continuous without
    /// the delay, which has no state space there.
    ///
    /// # Errors
    /// - [`ModelError::Parameter`] unless frequency and damping can be used.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn measured(truth: &SecondOrder, frequency_hz: Vec<f64>) -> FrequencyResponse {
        FrequencyResponse {
            response: truth.response(&frequency_hz),
            coherence: vec![0.99; frequency_hz.len()],
            frequency_hz,
            n_averages: 4.0,
        }
    }

    fn band() -> Vec<f64> {
        (1..160).map(|k| 0.5 * f64::from(k)).collect()
    }

    #[test]
    fn the_sampled_response_is_that_of_the_state_space() {
        let truth = SecondOrder {
            gain: 1.3,
            natural_frequency_hz: 15.0,
            damping: 0.4,
            delay_s: 6e-3,
            dt_s: Some(2e-3),
        };
        let model = truth.state_space().unwrap();
        let w: Vec<f64> = band().iter().map(|f| TAU * f).collect();
        let expected = model.frequency_response(&w).unwrap();
        for (found, expected) in truth.response(&band()).iter().zip(expected) {
            assert!((found - expected[(0, 0)]).norm() < 1e-11 * found.norm());
        }
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(40))]
        #[test]
        fn any_second_order_model_is_found_again(
            gain in prop_oneof![-3.0..-0.3, 0.3..3.0],
            natural_frequency_hz in 3.0..40.0,
            damping in 0.05..1.2,
            delay_s in 0.0..0.01,
            is_sampled: bool,
        ) {
            let dt_s = is_sampled.then_some(2e-3);
            let truth = SecondOrder { gain, natural_frequency_hz, damping, delay_s, dt_s };
            let found = fit_second_order(&measured(&truth, band()), dt_s, Known::default())
                .map_err(|error| TestCaseError::fail(error.to_string()))?;
            let model = found.model;
            prop_assert!((model.gain / gain - 1.0).abs() < 1e-6, "{model:?}");
            prop_assert!((model.natural_frequency_hz / natural_frequency_hz - 1.0).abs() < 1e-6);
            prop_assert!((model.damping / damping - 1.0).abs() < 1e-5);
            prop_assert!((model.delay_s - delay_s).abs() < 1e-8);
            prop_assert!(found.residual_rms < 1e-6);
        }
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(60))]
        #[test]
        fn a_resonance_below_or_above_the_band_is_found_too(
            low_hz in 1.0..40.0_f64,
            width in 1.6..6.0_f64,
            place in prop_oneof![0.25..1.0, 1.0..2.5_f64],
            damping in 0.05..1.5,
            gain in prop_oneof![-3.0..-0.3, 0.3..3.0],
            delay_s in prop::sample::select(vec![0.0, 2e-3, 6e-3, 0.0133]),
            is_sampled: bool,
        ) {
            let dt_s = is_sampled.then_some(2e-3);
            let high_hz = low_hz * width;
            // Below the lower end or above the upper one.
            let natural_frequency_hz = place * if place < 1.0 { low_hz } else { high_hz };
            let truth = SecondOrder { gain, natural_frequency_hz, damping, delay_s, dt_s };
            let frequency_hz: Vec<f64> =
                (0..90).map(|k| low_hz + (high_hz - low_hz) * f64::from(k) / 89.0).collect();
            prop_assume!(high_hz < 220.0 && natural_frequency_hz < 220.0);
            let found = fit_second_order(&measured(&truth, frequency_hz), dt_s, Known::default())
                .map_err(|error| TestCaseError::fail(error.to_string()))?;
            let model = found.model;
            prop_assert!(found.residual_rms < 1e-7, "{found:?} {truth:?}");
            prop_assert!((model.natural_frequency_hz / natural_frequency_hz - 1.0).abs() < 1e-2);
            prop_assert!((model.gain / gain - 1.0).abs() < 1e-2, "{model:?} {truth:?}");
        }
    }

    #[test]
    fn bands_far_above_the_resonance_are_extrapolated() {
        for (natural_frequency_hz, damping, low, high) in [(12.0, 0.5, 36, 80), (12.0, 0.1, 24, 60)]
        {
            let (gain, dt_s) = (1.0, Some(2e-3));
            let truth = SecondOrder { gain, natural_frequency_hz, damping, delay_s: 0.0, dt_s };
            let frequency_hz: Vec<f64> = (2 * low..=2 * high).map(|k| 0.5 * f64::from(k)).collect();
            let data = measured(&truth, frequency_hz);
            for known in [
                Known::default(),
                Known { gain: Some(1.0), delay_s: None },
                Known { gain: None, delay_s: Some(0.0) },
                Known { gain: Some(1.0), delay_s: Some(0.0) },
            ] {
                let found = fit_second_order(&data, dt_s, known).unwrap();
                let off = found.model.natural_frequency_hz / natural_frequency_hz - 1.0;
                assert!(off.abs() < 1e-5 && found.residual_rms < 1e-8, "{found:?}");
                assert!((found.model.gain - 1.0).abs() < 1e-4, "{found:?}");
            }
        }
    }

    #[test]
    fn an_axis_that_does_not_answer_has_no_gain_and_all_left_over() {
        let n = band().len();
        let silence = FrequencyResponse {
            frequency_hz: band(),
            response: vec![Complex::new(0.0, 0.0); n],
            coherence: vec![0.0; n],
            n_averages: 4.0,
        };
        for dt_s in [None, Some(2e-3)] {
            let found = fit_second_order(&silence, dt_s, Known::default()).unwrap();
            assert!(found.model.gain.abs() < 1e-300 && (found.residual_rms - 1.0).abs() < 1e-15);
            let doubt = super::super::doubt(&silence, found.residual_rms).unwrap();
            assert!(doubt.to_string().contains("does not answer"), "{doubt}");
            let bound =
                super::super::uncertainty(&silence, &found.model.response(&band()), 3.0).unwrap();
            assert!(bound.bound.iter().all(|bound| (bound - 1.0).abs() < 1e-12), "{bound:?}");
        }
        // Silence at some frequencies, between others that answer, is left out.
        let truth = SecondOrder {
            gain: 1.3,
            natural_frequency_hz: 15.0,
            damping: 0.4,
            delay_s: 6e-3,
            dt_s: Some(2e-3),
        };
        let mut data = measured(&truth, band());
        for k in (0..n).step_by(3) {
            data.response[k] = Complex::new(0.0, 0.0);
            data.coherence[k] = 0.0;
        }
        let found = fit_second_order(&data, Some(2e-3), Known::default()).unwrap();
        assert!((found.model.natural_frequency_hz - 15.0).abs() < 1e-5, "{found:?}");
    }

    #[test]
    fn a_bad_estimate_with_low_coherence_does_not_count() {
        let truth = SecondOrder {
            gain: 1.0,
            natural_frequency_hz: 12.0,
            damping: 0.6,
            delay_s: 3e-3,
            dt_s: None,
        };
        let mut data = measured(&truth, band());
        data.response[30] *= 3.0;
        let fooled = fit_second_order(&data, None, Known::default()).unwrap();
        data.coherence[30] = 1e-9;
        let found = fit_second_order(&data, None, Known::default()).unwrap();
        assert!((found.model.natural_frequency_hz - 12.0).abs() < 1e-6);
        assert!(fooled.residual_rms > 1e3 * found.residual_rms);
        assert!(
            found.natural_frequency_deviation_hz < 1e-3 * fooled.natural_frequency_deviation_hz
        );
    }

    #[test]
    fn a_response_without_sense_ends_in_some_model_and_says_how_bad_it_is() {
        let mut state = 7_u64;
        let mut random = || {
            state =
                state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let frequency_hz = band();
        let response = frequency_hz.iter().map(|_| Complex::new(random(), random())).collect();
        let n = frequency_hz.len();
        let noise =
            FrequencyResponse { frequency_hz, response, coherence: vec![0.5; n], n_averages: 2.0 };
        for dt_s in [None, Some(2e-3)] {
            let found = fit_second_order(&noise, dt_s, Known::default()).unwrap();
            assert!(found.residual_rms > 0.8, "{found:?}");
            assert!(found.model.delay_s.abs() <= 1.0 && found.model.natural_frequency_hz < 2400.0);
        }
    }

    #[test]
    fn what_is_known_stays() {
        let truth = SecondOrder {
            gain: 1.02,
            natural_frequency_hz: 12.0,
            damping: 0.6,
            delay_s: 3.3e-3,
            dt_s: Some(1e-3),
        };
        let known = Known { gain: Some(1.0), delay_s: Some(3e-3) };
        let found = fit_second_order(&measured(&truth, band()), Some(1e-3), known).unwrap();
        assert!(found.gain_deviation <= 0.0 && found.delay_deviation_s <= 0.0);
        assert!((found.model.gain - 1.0).abs() < 1e-15 && found.model.delay_samples() == 3);
        assert!((found.model.natural_frequency_hz / 12.0 - 1.0).abs() < 0.05);
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_named() {
        let truth = SecondOrder {
            gain: 1.0,
            natural_frequency_hz: 12.0,
            damping: 0.6,
            delay_s: 0.0,
            dt_s: None,
        };
        let good = measured(&truth, band());
        let wrong = |change: &dyn Fn(&mut FrequencyResponse)| {
            let mut bad = good.clone();
            change(&mut bad);
            fit_second_order(&bad, None, Known::default()).unwrap_err().to_string()
        };
        assert!(wrong(&|d| d.frequency_hz[0] = 0.0).contains("frequency_hz = 0"));
        assert!(wrong(&|d| d.frequency_hz.swap(3, 4)).contains("rise"));
        assert!(
            wrong(&|d| d.response[2] = Complex::new(f64::NAN, 0.0)).contains("response holds NaN")
        );
        assert!(wrong(&|d| d.response[2] = Complex::new(0.0, 0.0)).contains("no logarithm"));
        assert!(wrong(&|d| d.coherence[2] = 1.5).contains("coherence holds 1.5"));
        assert!(wrong(&|d| d.response.truncate(5)).contains("response holds 5"));
        assert!(wrong(&|d| *d = d.band(1.0, 1.6)).contains("frequency_hz holds 2"));
        assert!(fit_second_order(&good, Some(0.0), Known::default()).is_err());
        let known = Known { gain: Some(0.0), delay_s: None };
        assert!(fit_second_order(&good, None, known).is_err());
    }
}
