//! Inverse of one axis that looks ahead: causal part, and the zeros outside.

use nalgebra::Complex;

use super::{InverseMethod, InverseRule};
use crate::learning::{LearningError, Result};
use crate::model::{StateSpace, relative_degrees};

/// Distance of a zero from the unit circle within which it has no useful inverse.
const ON_CIRCLE: f64 = 1e-6;
/// Decay of the preactuation at which it is cut off, as an exponent: rounding.
const DECAY: f64 = 36.0;
/// Longest tail of the error beyond the run.
const TAIL_MAX: f64 = 20_000.0;

/// `A / (K Bs)` as a causal filter, ahead by its relative degree, after the inverse of `Bu`.
#[derive(Debug, Clone)]
pub(super) struct Inverse {
    n_samples: usize,
    is_zpetc: bool,
    /// Samples by which the causal part is ahead.
    ahead: usize,
    tail: usize,
    /// Polynomials, highest power first.
    bu: Vec<f64>,
    a: Vec<f64>,
    bs: Vec<f64>,
    first: f64,
    held: Vec<f64>,
    filtered: Vec<f64>,
}

impl Inverse {
    /// Factors a model of one input and one output.
    pub(super) fn new(model: &StateSpace, n_samples: usize, rule: InverseRule) -> Result<Self> {
        let none = |reason| LearningError::NoInverse { reason };
        let is_zpetc = rule.method == InverseMethod::Zpetc;
        let degree = relative_degrees(model)?.first().copied().flatten();
        let degree = degree.ok_or_else(|| none("it responds to no input"))?;
        let zeros = model.zeros()?;
        let on_circle = zeros.iter().any(|zero| (zero.norm() - 1.0).abs() < ON_CIRCLE);
        if on_circle && !(is_zpetc && rule.zero_radius < 1.0) {
            return Err(none("a zero is on the unit circle"));
        }
        let (outside, inside): (Vec<_>, Vec<_>) =
            zeros.into_iter().partition(|zero| zero.norm() >= rule.zero_radius);
        let (bu, bs, a) = (polynomial(&outside), polynomial(&inside), polynomial(&model.poles()?));
        if is_zpetc && bu.iter().sum::<f64>().abs() < ON_CIRCLE {
            return Err(none("a zero is at 1, where the gain is zero"));
        }
        let first = model.markov(degree + 1)?[degree][(0, 0)];
        let ahead = a.len().saturating_sub(bs.len());
        let slowest = outside.iter().map(|zero| zero.norm().ln()).fold(f64::INFINITY, f64::min);
        let tail = if is_zpetc || outside.is_empty() { 0.0 } else { (DECAY / slowest).ceil() };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded")]
        let tail = ahead + tail.min(TAIL_MAX) as usize;
        let length = n_samples + tail;
        let (held, filtered) = (vec![0.0; length + ahead], vec![0.0; length + ahead]);
        Ok(Self { n_samples, is_zpetc, ahead, tail, bu, a, bs, first, held, filtered })
    }

    /// Returns the change of the input that an error asks for.
    pub(super) fn apply<'a>(&mut self, error: impl Iterator<Item = &'a f64>) -> &[f64] {
        let (n, length) = (self.n_samples, self.n_samples + self.tail);
        self.held.iter_mut().zip(error).for_each(|(held, e)| *held = *e);
        let last = self.held[n - 1];
        self.held[n..length].fill(last);
        self.outside(length, false);
        let last = self.held[length - 1];
        self.held[length..].fill(last);
        causal(&self.a, &self.bs, self.first, &self.held, &mut self.filtered, false);
        &self.filtered[self.ahead..self.ahead + n]
    }

    /// Returns the transpose of [`Inverse::apply`].
    pub(super) fn transposed<'a>(&mut self, dual: impl Iterator<Item = &'a f64>) -> &[f64] {
        let (n, length) = (self.n_samples, self.n_samples + self.tail);
        self.filtered.fill(0.0);
        self.filtered[self.ahead..].iter_mut().zip(dual).for_each(|(place, dual)| *place = *dual);
        causal(&self.a, &self.bs, self.first, &self.filtered, &mut self.held, true);
        self.held[length - 1] = self.held[length - 1..].iter().sum();
        self.outside(length, true);
        self.held[n - 1] = self.held[n - 1..length].iter().sum();
        &self.held[..n]
    }

    /// Applies the inverse of `Bu` to what is held, or its transpose.
    fn outside(&mut self, length: usize, is_transposed: bool) {
        let order = self.bu.len() - 1;
        if order == 0 {
            return;
        }
        let x = &mut self.held[..length];
        if self.is_zpetc {
            // Bu(1/z) e is the sum of b_i e[k - (order - i)].
            let scale = self.bu.iter().sum::<f64>().powi(2);
            let at = |signal: &[f64], k: usize, lag: usize| {
                let place = if is_transposed { Some(k + lag) } else { k.checked_sub(lag) };
                place.and_then(|place| signal.get(place)).copied().unwrap_or(0.0)
            };
            for k in 0..length {
                let lags = self.bu.iter().enumerate().map(|(i, b)| b * at(x, k, order - i));
                self.filtered[k] = lags.sum::<f64>() / scale;
            }
            x.copy_from_slice(&self.filtered[..length]);
            return;
        }
        // 1/Bu backward in time is stable, as its zeros lie outside; its transpose runs forward.
        for step in 0..length {
            let place =
                |age: usize| if is_transposed { step - age } else { length - 1 - step + age };
            let past = (1..=order.min(step)).map(|age| self.bu[order - age] * x[place(age)]);
            let past: f64 = past.sum();
            x[place(0)] = (x[place(0)] - past) / self.bu[order];
        }
    }
}

/// Filters by `A / (K Bs)` from rest, or by the transpose: the same backward in time.
fn causal(a: &[f64], bs: &[f64], first: f64, x: &[f64], y: &mut [f64], is_backward: bool) {
    let n = x.len();
    for step in 0..n {
        let place = |age: usize| if is_backward { n - 1 - step + age } else { step - age };
        let ahead: f64 = a.iter().take(step + 1).enumerate().map(|(i, a)| a * x[place(i)]).sum();
        let behind = bs.iter().take(step + 1).enumerate().skip(1);
        let behind: f64 = behind.map(|(i, b)| first * b * y[place(i)]).sum();
        y[place(0)] = (ahead - behind) / first;
    }
}

/// Returns the real polynomial with these roots, highest power first.
fn polynomial(roots: &[Complex<f64>]) -> Vec<f64> {
    let mut found = vec![Complex::new(1.0, 0.0)];
    for root in roots {
        found.push(Complex::new(0.0, 0.0));
        for i in (1..found.len()).rev() {
            let lower = found[i - 1];
            found[i] -= root * lower;
        }
    }
    found.into_iter().map(|value| value.re).collect()
}
