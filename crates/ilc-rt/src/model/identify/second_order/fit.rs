//! Fit of a second-order model to a frequency response.

use std::f64::consts::TAU;

use nalgebra::DVector;

use super::super::FrequencyResponse;
use super::super::least_squares::{Minimum, minimize};
use super::SecondOrder;
use crate::model::ModelError;

/// Number of initial values that are followed to their minimum.
const FOLLOWED: usize = 10;
/// Cost per unit weight below which the fit is exact.
const EXACT: f64 = 1e-22;
/// Fits whose cost is within this factor of the smallest, 5 % in the RMS residual, are as good.
const AS_GOOD: f64 = 1.1;
/// Natural frequencies may lie outside the band by this factor.
pub(super) const BEYOND_BAND: f64 = 30.0;
/// Damping ratios that are searched.
pub(super) const DAMPING_RANGE: (f64, f64) = (1e-4, 100.0);

/// Parameters that are known and not fitted.
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
    /// Standard deviation of the gain, from the residual of the fit; 0 if known.
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
/// `min sum_k w_k |ln (H_k / G(f_k))|^2`, `w = gamma^2 / (1 - gamma^2)`: relative magnitude and
/// phase in radians, weighted by the coherence. Damping and natural frequency are positive by
/// construction, so the model is stable. An axis that responds at two frequencies or fewer gives a
/// model of gain 0 and a residual of 1, which [`super::super::doubt`] rejects.
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
    measured.check(4)?;
    check_known(measured, known)?;
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
    let constant = fit.constant_slopes();
    let mut ends: Vec<(Minimum, Sign)> = Vec::new();
    for &i in order.iter().take(FOLLOWED) {
        let sign = starts[i].1;
        ends.push((minimize(&points[i], &constant, &|x| fit.residuals(x, sign)), sign));
        if ends.last().is_some_and(|(end, _)| end.cost <= EXACT * all) {
            break;
        }
    }
    let least = ends.iter().map(|(end, _)| end.cost).fold(f64::INFINITY, f64::min);
    let delay_s = |(end, sign): &(Minimum, Sign)| fit.model(&end.parameters, *sign).delay_s.abs();
    // Noisy data hardly distinguish a delay from more damping: of equally good fits, the simplest
    // is taken.
    let as_good = ends.iter().filter(|(end, _)| end.cost <= AS_GOOD * least);
    let plainest = as_good.min_by(|a, b| delay_s(a).total_cmp(&delay_s(b)));
    let (minimum, sign) = plainest.ok_or(ModelError::Numerics {
        what: "the second-order fit",
        reason: "no start gives a finite model",
    })?;
    Ok(fit.result(minimum, *sign))
}

/// Sign of the gain.
pub(super) type Sign = f64;

impl SecondOrderFit {
    /// Returns the fit of an axis that does not respond: no gain, and a residual of 1.
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

fn check_known(measured: &FrequencyResponse, known: Known) -> Result<(), ModelError> {
    if let Some(value) = known.gain.filter(|gain| !gain.is_finite() || *gain == 0.0) {
        let allowed = "a known gain must be finite and not 0";
        return Err(ModelError::Parameter { what: "gain", value, allowed });
    }
    known.delay_s.map_or(Ok(()), |delay_s| measured.check_delay(delay_s))
}

/// Problem of the fit. Parameters: `ln w0`, `ln delta`, then `ln |K|` and
/// `tau / tau_0` unless known.
pub(super) struct Fit<'a> {
    pub(super) measured: &'a FrequencyResponse,
    pub(super) root_weight: Vec<f64>,
    pub(super) dt_s: Option<f64>,
    pub(super) known: Known,
    /// Unit of the delay: a radian at the highest frequency.
    pub(super) tau_0: f64,
    /// Range of delays: from half a period of the highest frequency too early to where the spacing
    /// of the frequencies makes the phase ambiguous.
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

    /// Returns true if a model is in the search range.
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

    /// Returns the derivatives for `ln |K|` and `tau / tau_0`, the same everywhere.
    fn constant_slopes(&self) -> Vec<(usize, DVector<f64>)> {
        let weighted = |slope: &dyn Fn(f64) -> [f64; 2]| {
            let pairs = self.root_weight.iter().zip(&self.measured.frequency_hz);
            let all = pairs.flat_map(|(weight, f)| slope(*f).map(|slope| weight * slope));
            DVector::from_iterator(2 * self.root_weight.len(), all)
        };
        let gain = self.known.gain.is_none().then(|| weighted(&|_| [-1.0, 0.0]));
        let delay = self.known.delay_s.is_none();
        let delay = delay.then(|| weighted(&|f| [0.0, TAU * f * self.tau_0]));
        (2..).zip([gain, delay].into_iter().flatten()).collect()
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
