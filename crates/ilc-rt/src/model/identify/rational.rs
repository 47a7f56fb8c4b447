//! Fit of a rational transfer function of any order, for axes with more than one resonance.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector, Schur};

use super::FrequencyResponse;
use super::least_squares::minimize;
use crate::model::{ModelError, StateSpace, from_transfer_function};

/// Highest order.
const POLES_MAX: usize = 20;
/// Rounds of linear fits, each weighted by the previous denominator.
const ROUNDS: usize = 40;

/// Residual up to which a fit without reflected poles is accepted.
const GOOD: f64 = 0.25;
/// Factor by which the residual of a lower degree must be smaller to be preferred.
const LOWER_IS_BETTER: f64 = 0.1;
/// Residual above which a fit has failed.
const HOPELESS: f64 = 3.0;

/// A fitted rational transfer function.
#[derive(Debug, Clone, PartialEq)]
pub struct RationalFit {
    /// The model, stable, without the delay.
    pub model: StateSpace,
    /// The delay that was removed beforehand.
    pub delay_s: f64,
    /// Number of unstable poles that were reflected.
    pub reflected_poles: usize,
    /// Weighted RMS of the relative difference of measurement and model.
    pub residual_rms: f64,
}

/// Fits a stable rational transfer function to a frequency response.
///
/// `min sum_k w_k |ln (H_k exp(j w_k tau) / G(f_k))|^2` over fractions `G = N / D` of the given
/// degrees, started with the rounds of Sanathanan and Koerner
/// `min sum_k w_k |(N - H D) / (H D_before)|^2`. The powers are those of `s / w_ref`, or of
/// `(z - 1) / (T w_ref)` if discrete, so that nothing cancels at high sample rates. Unstable poles
/// are reflected and the numerator fitted again.
///
/// # Shapes
/// - `measured`: more frequencies than half the number of coefficients, without 0 Hz
/// # Units
/// - `delay_s`, `dt_s` in seconds; `dt_s` is `None` for a continuous model
/// # Errors
/// - [`ModelError::Parameter`] for degrees out of range, [`ModelError::SampleTime`], and as
///   [`super::fit_second_order`] for the response.
/// - [`ModelError::Numerics`] if the linear fit has no solution; [`ModelError::Parameter`] with the
///   residual if the result has nothing of the response.
/// # Source
/// - \[sanathanan1963\]; \[pintelon2012\], section 9.8.
pub fn fit_rational(
    measured: &FrequencyResponse,
    n_zeros: usize,
    n_poles: usize,
    delay_s: f64,
    dt_s: Option<f64>,
) -> Result<RationalFit, ModelError> {
    if n_poles > POLES_MAX {
        let allowed = "at most 20 poles can be fitted";
        return Err(ModelError::Parameter { what: "n_poles", value: n_poles as f64, allowed });
    }
    if n_zeros > n_poles {
        let allowed = "a proper model has no more zeros than poles";
        return Err(ModelError::Parameter { what: "n_zeros", value: n_zeros as f64, allowed });
    }
    if let Some(dt_s) = dt_s
        && !(dt_s.is_finite() && dt_s > 0.0)
    {
        return Err(ModelError::SampleTime { dt_s });
    }
    measured.check(n_zeros + n_poles + 1)?;
    measured.check_delay(delay_s)?;
    let measured = &measured.answered();
    measured.check(n_zeros + n_poles + 1)?;
    let mut best = fit_degrees(measured, (n_zeros, n_poles), delay_s, dt_s);
    // With more poles than the response has, the excess ones are arbitrary, even unstable, and
    // their reflection is another model. The fraction of lower degree, which is one of the
    // requested ones, has no such poles.
    let is_good = |fit: &RationalFit| fit.reflected_poles == 0 && fit.residual_rms < GOOD;
    for fewer in (1..n_poles).rev() {
        if best.as_ref().is_ok_and(is_good) {
            break;
        }
        let Ok(found) = fit_degrees(measured, (n_zeros.min(fewer), fewer), delay_s, dt_s) else {
            continue;
        };
        let is_better = best
            .as_ref()
            .map_or(true, |fit| found.residual_rms < LOWER_IS_BETTER * fit.residual_rms);
        if is_better && found.reflected_poles == 0 {
            best = Ok(found);
        }
    }
    let best = best?;
    if best.residual_rms.is_nan() || best.residual_rms > HOPELESS {
        return Err(ModelError::Parameter {
            what: "residual of the rational fit",
            value: best.residual_rms,
            allowed: "above 3 the fraction has nothing of the response: try other degrees or a delay",
        });
    }
    Ok(best)
}

/// Fits a fraction of exactly these degrees (zeros, poles).
fn fit_degrees(
    measured: &FrequencyResponse,
    (n_zeros, n_poles): (usize, usize),
    delay_s: f64,
    dt_s: Option<f64>,
) -> Result<RationalFit, ModelError> {
    let problem = Problem::new(measured, n_zeros, n_poles, delay_s, dt_s);
    let mut fraction = problem.linear_rounds()?;
    let reflected_poles = problem.stabilize(&mut fraction)?;
    let refined = problem.refined(&fraction);
    if problem.cost(&refined) < problem.cost(&fraction)
        && problem.unstable(&roots(&refined.denominator)?) == 0
    {
        fraction = refined;
    }
    let all: f64 = problem.root_weight.iter().map(|weight| weight * weight).sum();
    Ok(RationalFit {
        model: problem.state_space(&fraction)?,
        delay_s,
        reflected_poles,
        residual_rms: (problem.cost(&fraction) / all).sqrt(),
    })
}

/// Coefficients by rising power; the denominator's highest one is 1.
#[derive(Debug, Clone)]
struct Fraction {
    numerator: Vec<f64>,
    denominator: Vec<f64>,
}

struct Problem {
    /// Points at which the polynomials are evaluated.
    points: Vec<Complex<f64>>,
    /// Response without the delay.
    response: Vec<Complex<f64>>,
    root_weight: Vec<f64>,
    n_zeros: usize,
    n_poles: usize,
    /// Frequency unit of the polynomials' variable.
    w_ref: f64,
    dt_s: Option<f64>,
}

impl Problem {
    fn new(
        measured: &FrequencyResponse,
        n_zeros: usize,
        n_poles: usize,
        delay_s: f64,
        dt_s: Option<f64>,
    ) -> Self {
        let f = &measured.frequency_hz;
        let w_ref = TAU * (f[0] * f[f.len() - 1]).sqrt();
        let point = |f: &f64| match dt_s {
            None => Complex::new(0.0, TAU * f / w_ref),
            Some(dt_s) => (Complex::new(0.0, TAU * f * dt_s).exp() - 1.0) / (dt_s * w_ref),
        };
        let advance = |f: &f64| Complex::new(0.0, TAU * f * delay_s).exp();
        Self {
            points: f.iter().map(point).collect(),
            response: measured.response.iter().zip(f).map(|(h, f)| h * advance(f)).collect(),
            root_weight: measured.weights().iter().map(|weight| weight.sqrt()).collect(),
            n_zeros,
            n_poles,
            w_ref,
            dt_s,
        }
    }

    /// Fits numerator and denominator at once, with the weight from the previous denominator.
    fn linear_rounds(&self) -> Result<Fraction, ModelError> {
        let mut before: Vec<f64> =
            self.points.iter().map(|p| p.norm().max(1.0).powi(exponent(self.n_poles))).collect();
        let mut best: Option<(f64, Fraction)> = None;
        for _ in 0..ROUNDS {
            crate::interrupt::point();
            let count = self.n_zeros + 1 + self.n_poles;
            let rows = |k: usize| {
                let (p, h) = (self.points[k], self.response[k]);
                let scale = self.root_weight[k] / (h.norm() * before[k]);
                let mut row: Vec<Complex<f64>> = Vec::with_capacity(count + 1);
                row.extend((0..=self.n_zeros).map(|i| p.powu(power(i)) * scale));
                row.extend((0..self.n_poles).map(|i| -h * p.powu(power(i)) * scale));
                row.push(h * p.powu(power(self.n_poles)) * scale);
                row
            };
            let x = solve((0..self.points.len()).map(rows), count)?;
            let (numerator, rest) = x.split_at(self.n_zeros + 1);
            let denominator = [rest, &[1.0]].concat();
            let fraction = Fraction { numerator: numerator.to_vec(), denominator };
            let cost = self.cost(&fraction);
            before = self
                .points
                .iter()
                .map(|p| value(&fraction.denominator, *p).norm().max(f64::MIN_POSITIVE))
                .collect();
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, fraction));
            }
        }
        best.map(|(_, fraction)| fraction).ok_or(NO_SOLUTION)
    }

    /// Reflects unstable poles and fits the numerator again.
    fn stabilize(&self, fraction: &mut Fraction) -> Result<usize, ModelError> {
        let mut poles = roots(&fraction.denominator)?;
        let reflected = self.unstable(&poles);
        if reflected == 0 {
            return Ok(0);
        }
        for pole in &mut poles {
            if self.is_unstable(*pole) {
                *pole = match self.dt_s {
                    None => -pole.conj(),
                    Some(dt_s) => {
                        let step = dt_s * self.w_ref;
                        ((*pole * step + 1.0).conj().inv() - 1.0) / step
                    }
                };
            }
        }
        let mut product = vec![Complex::new(1.0, 0.0)];
        for pole in &poles {
            let mut next = vec![Complex::new(0.0, 0.0); product.len() + 1];
            for (i, c) in product.iter().enumerate() {
                next[i + 1] += c;
                next[i] -= c * pole;
            }
            product = next;
        }
        fraction.denominator = product.iter().map(|c| c.re).collect();
        let count = self.n_zeros + 1;
        let rows = |k: usize| {
            let (p, h) = (self.points[k], self.response[k]);
            let d = value(&fraction.denominator, p);
            let scale = Complex::new(self.root_weight[k], 0.0) / (h * d);
            let mut row: Vec<Complex<f64>> =
                (0..=self.n_zeros).map(|i| p.powu(power(i)) * scale).collect();
            row.push(Complex::new(self.root_weight[k], 0.0));
            row
        };
        fraction.numerator = solve((0..self.points.len()).map(rows), count)?;
        Ok(reflected)
    }

    fn refined(&self, fraction: &Fraction) -> Fraction {
        let scale = |c: &f64| if *c == 0.0 { 1.0 } else { *c };
        let start: Vec<f64> = fraction
            .numerator
            .iter()
            .chain(&fraction.denominator[..self.n_poles])
            .copied()
            .collect();
        let scales: Vec<f64> = start.iter().map(scale).collect();
        let at = |x: &[f64]| {
            let mut c: Vec<f64> = x.iter().zip(&scales).map(|(x, scale)| x * scale).collect();
            let mut denominator = c.split_off(self.n_zeros + 1);
            denominator.push(1.0);
            Fraction { numerator: c, denominator }
        };
        let x: Vec<f64> = start.iter().zip(&scales).map(|(c, scale)| c / scale).collect();
        at(&minimize(&x, &[], &|x| self.residuals(&at(x))).parameters)
    }

    fn residuals(&self, fraction: &Fraction) -> DVector<f64> {
        let n = self.points.len();
        let mut residuals = DVector::zeros(2 * n);
        for k in 0..n {
            let p = self.points[k];
            let model = value(&fraction.numerator, p) / value(&fraction.denominator, p);
            let ratio = self.response[k] / model;
            residuals[2 * k] = self.root_weight[k] * ratio.norm().ln();
            residuals[2 * k + 1] = self.root_weight[k] * ratio.arg();
        }
        residuals
    }

    fn cost(&self, fraction: &Fraction) -> f64 {
        let cost = self.residuals(fraction).norm_squared();
        if cost.is_finite() { cost } else { f64::INFINITY }
    }

    fn is_unstable(&self, pole: Complex<f64>) -> bool {
        match self.dt_s {
            None => pole.re > 0.0,
            Some(dt_s) => (pole * (dt_s * self.w_ref) + 1.0).norm() > 1.0,
        }
    }

    fn unstable(&self, poles: &[Complex<f64>]) -> usize {
        poles.iter().filter(|pole| self.is_unstable(**pole)).count()
    }

    fn state_space(&self, fraction: &Fraction) -> Result<StateSpace, ModelError> {
        let falling = |c: &[f64]| c.iter().rev().copied().collect::<Vec<f64>>();
        let plain = from_transfer_function(
            &falling(&fraction.numerator),
            &falling(&fraction.denominator),
            None,
        )?;
        let n = plain.n_states();
        let step = self.dt_s.unwrap_or(1.0) * self.w_ref;
        let mut a = plain.a * step;
        if self.dt_s.is_some() {
            a += DMatrix::identity(n, n);
        }
        StateSpace::new(a, plain.b * step, plain.c, plain.d, self.dt_s)
    }
}

const NO_SOLUTION: ModelError = ModelError::Numerics {
    what: "the rational fit",
    reason: "the linear equations have no solution: try fewer poles",
};

/// Solves rows `[A | b]` of complex numbers for real unknowns, with columns of equal size.
fn solve(
    rows: impl Iterator<Item = Vec<Complex<f64>>>,
    count: usize,
) -> Result<Vec<f64>, ModelError> {
    let mut flat = Vec::new();
    for row in rows {
        flat.extend(row.iter().map(|c| c.re));
        flat.extend(row.iter().map(|c| c.im));
    }
    let whole = DMatrix::from_row_slice(flat.len() / (count + 1), count + 1, &flat);
    let mut a = whole.columns(0, count).into_owned();
    let sizes: Vec<f64> = a.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    for (mut column, size) in a.column_iter_mut().zip(&sizes) {
        column /= *size;
    }
    let b = DVector::from_column_slice(whole.column(count).as_slice());
    let x = a.svd(true, true).solve(&b, 1e-14).map_err(|_| NO_SOLUTION)?;
    if x.iter().any(|value| !value.is_finite()) {
        return Err(NO_SOLUTION);
    }
    Ok(x.iter().zip(&sizes).map(|(x, size)| x / size).collect())
}

/// Returns the roots of a monic polynomial.
fn roots(rising: &[f64]) -> Result<Vec<Complex<f64>>, ModelError> {
    let n = rising.len() - 1;
    if n == 0 {
        return Ok(Vec::new());
    }
    let mut companion = DMatrix::zeros(n, n);
    for i in 0..n {
        companion[(0, i)] = -rising[n - 1 - i];
        if i > 0 {
            companion[(i, i - 1)] = 1.0;
        }
    }
    let schur = Schur::try_new(companion, f64::EPSILON, 10_000).ok_or(NO_SOLUTION)?;
    Ok(schur.complex_eigenvalues().iter().copied().collect())
}

fn value(rising: &[f64], p: Complex<f64>) -> Complex<f64> {
    rising.iter().rev().fold(Complex::new(0.0, 0.0), |sum, c| sum * p + c)
}

fn power(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

fn exponent(i: usize) -> i32 {
    i32::try_from(i).unwrap_or(i32::MAX)
}

#[cfg(test)]
mod tests;
