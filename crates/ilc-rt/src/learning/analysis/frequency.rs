//! Frequency-domain analysis of one iteration, in the middle of a run.
//!
//! The response of a time-invariant law to an impulse in the middle of an empty run determines the
//! law: its spectrum is the law's frequency response. So a law written in Python is analysed like a
//! built-in one.

use ilc_numerics::fourier;
use nalgebra::{Complex, DMatrix};

use super::iteration::{FLOOR, Iteration};
use crate::learning::Result;
use crate::learning::law::norm_optimal::Weights;
use crate::model::{ModelError, StateSpace};

type Matrix = DMatrix<Complex<f64>>;

/// Largest response left at the ends of the run, relative to its peak.
const CUT_OFF: f64 = 1e-4;
/// Largest change of the response with the sample of the impulse, relative to its size.
const VARYING: f64 = 1e-4;
/// A filter counts as blocking below this gain.
const SILENT: f64 = 1e-6;
/// Remainder of the past whose square is lost in rounding.
const VANISHED: f64 = 1e-12;
/// A frequency counts as growing above this contraction.
const GROWING: f64 = 1.0 + 1e-9;

/// Law and plant at one frequency.
#[derive(Debug)]
pub(in crate::learning) struct Bin {
    pub(in crate::learning) frequency_hz: f64,
    /// `L_u`
    keep: Matrix,
    /// `L_e`
    learn: Matrix,
    /// `P`
    plant: Matrix,
    /// `L_u - L_e P`
    pub(super) t: Matrix,
}

/// Frequency responses of law and plant.
#[derive(Debug)]
pub(in crate::learning) struct Spectrum {
    pub(in crate::learning) bins: Vec<Bin>,
}

impl Spectrum {
    /// Returns `None` for a time-varying law, or one whose impulse response is longer than the run.
    pub(super) fn new(iteration: &mut Iteration, model: &StateSpace) -> Result<Option<Self>> {
        let (n_samples, m, p) = (iteration.n_samples, iteration.n_inputs, iteration.n_outputs);
        let Some(dt_s) = model.dt_s().filter(|_| n_samples >= 16) else { return Ok(None) };
        let (keep, learn) = responses(iteration, n_samples / 2)?;
        let (keep_early, learn_early) = responses(iteration, n_samples / 3)?;
        let shift = n_samples / 2 - n_samples / 3;
        let largest = |part: &[f64]| part.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
        for (late, early) in [(&keep, &keep_early), (&learn, &learn_early)] {
            // Relative to all channels together: a channel that does not act on another leaves only
            // rounding.
            let peak = late.iter().map(|response| largest(response)).fold(0.0, f64::max);
            let edge = n_samples / 16;
            for (late, early) in late.iter().zip(early) {
                let ends = largest(&late[..edge]).max(largest(&late[n_samples - edge..]));
                let apart = late[shift..].iter().zip(early).map(|(a, b)| (a - b).abs());
                if ends > CUT_OFF * peak || apart.fold(0.0, f64::max) > VARYING * peak {
                    return Ok(None);
                }
            }
        }
        let n_fft = (2 * n_samples).max(2048).next_power_of_two();
        let fft = fourier::forward(n_fft);
        let centre = n_samples / 2;
        let transform = |response: &Vec<f64>| -> Vec<Complex<f64>> {
            let mut bins = vec![Complex::new(0.0, 0.0); n_fft];
            for (k, value) in response.iter().enumerate() {
                bins[(n_fft + k - centre) % n_fft].re = *value;
            }
            fft.process(&mut bins);
            bins
        };
        let keep: Vec<_> = keep.iter().map(transform).collect();
        let learn: Vec<_> = learn.iter().map(transform).collect();
        let stride = (n_fft / 2) / n_bins(model).min(n_fft / 2);
        let mut bins = Vec::new();
        for at in (0..=n_fft / 2).step_by(stride) {
            crate::interrupt::point();
            let frequency_hz = at as f64 / (n_fft as f64 * dt_s);
            let Some(plant) = response(model, std::f64::consts::TAU * at as f64 / n_fft as f64)
            else {
                // A pole on the unit circle: the response is infinite there.
                continue;
            };
            let keep = Matrix::from_fn(m, m, |row, col| keep[col * m + row][at]);
            let learn = Matrix::from_fn(m, p, |row, col| learn[col * m + row][at]);
            let t = &keep - &learn * &plant;
            bins.push(Bin { frequency_hz, keep, learn, plant, t });
        }
        Ok(Some(Self { bins }))
    }

    /// Returns the spectrum of a norm-optimal law in closed form: `L_e = (q P*P + s + h)^-1 q P*`,
    /// `L_u = (q P*P + s + h)^-1 (q P*P + h)`, with `h = r + rate^2 |1 - z^-1|^2`.
    ///
    /// # Errors
    /// - [`ModelError::Continuous`] for a continuous model.
    pub(in crate::learning) fn optimal(
        model: &StateSpace,
        weights: Weights,
    ) -> Result<Self, ModelError> {
        let Some(dt_s) = model.dt_s() else {
            return Err(ModelError::Continuous { action: "tuning" });
        };
        let n_bins = n_bins(model);
        let responses = (0..=n_bins).filter_map(|at| {
            crate::interrupt::point();
            let omega_rad = std::f64::consts::PI * at as f64 / n_bins as f64;
            Some((omega_rad / (std::f64::consts::TAU * dt_s), response(model, omega_rad)?))
        });
        Ok(Self::weighed(responses, dt_s, weights))
    }

    /// Returns the spectrum of the law with other weights on the same model, from [`Spectrum::optimal`].
    pub(in crate::learning) fn with(&self, model: &StateSpace, weights: Weights) -> Self {
        let responses = self.bins.iter().map(|bin| (bin.frequency_hz, bin.plant.clone()));
        Self::weighed(responses, model.dt_s().unwrap_or(1.0), weights)
    }

    fn weighed(
        responses: impl Iterator<Item = (f64, Matrix)>,
        dt_s: f64,
        weights: Weights,
    ) -> Self {
        let real = |value: f64| Complex::new(value, 0.0);
        let mut bins = Vec::new();
        for (frequency_hz, plant) in responses {
            crate::interrupt::point();
            let omega_rad = frequency_hz * (std::f64::consts::TAU * dt_s);
            let eye = Matrix::identity(plant.ncols(), plant.ncols());
            let square = plant.adjoint() * &plant * real(weights.q);
            let hold = weights.r + (2.0 * weights.rate * (0.5 * omega_rad).sin()).powi(2);
            let cost = &square + &eye * real(weights.s + hold);
            let Some(inverse) = cost.try_inverse() else { continue };
            let learn = &inverse * plant.adjoint() * real(weights.q);
            let keep = &inverse * (square + &eye * real(hold));
            let t = &inverse * real(hold);
            bins.push(Bin { frequency_hz, keep, learn, plant, t });
        }
        Self { bins }
    }

    /// Returns the largest singular value of the plant at each frequency.
    pub(in crate::learning) fn plant_gain(&self) -> Vec<f64> {
        self.bins.iter().map(|bin| gain(&bin.plant)).collect()
    }

    /// Returns the largest singular value of `T` at each frequency.
    pub(in crate::learning) fn contraction(&self) -> Vec<f64> {
        self.bins.iter().map(|bin| gain(&bin.t)).collect()
    }

    /// Returns the first frequency at which an iteration amplifies the error.
    pub(super) fn critical_hz(&self) -> Option<f64> {
        crossing(self.bins.iter().map(|bin| (bin.frequency_hz, Some(gain(&bin.t)))))
    }

    /// Returns the first frequency at which the law without its filter `L_u` amplifies the error,
    /// `|1 - L P| >= 1` with `L_e = L_u L`: a Q-filter must suppress everything above.
    pub(super) fn learnable_hz(&self) -> Option<f64> {
        crossing(self.bins.iter().map(|bin| {
            if gain(&bin.keep) < SILENT {
                return (bin.frequency_hz, None);
            }
            let m = bin.keep.nrows();
            let contraction =
                bin.keep.clone().try_inverse().map(|inverse| {
                    gain(&(Matrix::identity(m, m) - inverse * &bin.learn * &bin.plant))
                });
            (bin.frequency_hz, contraction)
        }))
    }

    /// Returns the largest `|T| + |W| |L_e P|` over frequency, and the largest
    /// frequency-independent uncertainty `w` for which that sum stays below 1.
    pub(in crate::learning) fn robust(&self, weight: impl Fn(f64) -> f64) -> (f64, f64) {
        let (mut factor, mut allowed) = (0.0_f64, f64::INFINITY);
        for bin in &self.bins {
            let (kept, learned) = (gain(&bin.t), gain(&(&bin.learn * &bin.plant)));
            factor = factor.max(kept + weight(bin.frequency_hz) * learned);
            if learned > SILENT {
                allowed = allowed.min(((1.0 - kept) / learned).max(0.0));
            }
        }
        (factor, allowed)
    }

    /// Returns `tr(P Sigma_j P')` per sample, averaged over frequency, for white noise of variance
    /// 1: for the runs `0..n_runs`, and the limit if it exists.
    pub(in crate::learning) fn noise(&self, n_runs: usize) -> (Vec<f64>, Option<f64>) {
        const DOUBLINGS: usize = 40;
        let mut shares = vec![0.0; n_runs];
        let (mut limit, mut weights) = (0.0, 0.0);
        let mut settles = true;
        for (i, bin) in self.bins.iter().enumerate() {
            crate::interrupt::point();
            // Trapezoidal rule: the two ends count half.
            let weight = if i == 0 || i + 1 == self.bins.len() { 0.5 } else { 1.0 };
            weights += weight;
            let m = bin.plant.ncols();
            // tr(P Sigma P') = tr(P'P Sigma), without the product.
            let gram = bin.plant.adjoint() * &bin.plant;
            let share = |sigma: &Matrix| -> f64 {
                let column = |j: usize| (0..m).map(move |i| (i, j));
                let terms = (0..m).flat_map(column).map(|(i, j)| gram[(j, i)] * sigma[(i, j)]);
                terms.map(|term| term.re).sum()
            };
            let fresh = &bin.learn * bin.learn.adjoint();
            let mut sigma = fresh.map(|_| Complex::new(0.0, 0.0));
            for run in &mut shares {
                *run += weight * share(&sigma);
                sigma = &bin.t * &sigma * bin.t.adjoint() + &fresh;
            }
            let (mut sigma, mut power) = (fresh, bin.t.clone());
            for _ in 0..DOUBLINGS {
                sigma = &sigma + &power * &sigma * power.adjoint();
                power = &power * &power;
                // What is left of the sum is far below its rounding.
                if power.norm() < VANISHED {
                    break;
                }
            }
            let last = share(&sigma);
            settles &= last.is_finite() && gain(&power) < 0.5;
            limit += weight * last;
        }
        for run in &mut shares {
            *run /= weights;
        }
        (shares, (settles && weights > 0.0).then_some(limit / weights))
    }
}

/// Responses of the law to impulses of each input and of each error at one sample: one signal per
/// impulse.
type Responses = (Vec<Vec<f64>>, Vec<Vec<f64>>);

fn responses(iteration: &mut Iteration, at: usize) -> Result<Responses> {
    let (m, p) = (iteration.n_inputs, iteration.n_outputs);
    let (n_u, n_e) = (iteration.n_u(), iteration.n_e());
    let (mut u, mut e, mut out) = (vec![FLOOR; n_u], vec![FLOOR; n_e], vec![0.0; n_u]);
    let (mut keep, mut learn) = (Vec::new(), Vec::new());
    let split = |out: &[f64], into: &mut Vec<Vec<f64>>| {
        for row in 0..m {
            into.push(out.iter().skip(row).step_by(m).copied().collect());
        }
    };
    for col in 0..m {
        u[at * m + col] = 1.0;
        iteration.law_linear(&u, &e, &mut out)?;
        u[at * m + col] = FLOOR;
        split(&out, &mut keep);
    }
    for col in 0..p {
        e[at * p + col] = 1.0;
        iteration.law_linear(&u, &e, &mut out)?;
        e[at * p + col] = FLOOR;
        split(&out, &mut learn);
    }
    Ok((keep, learn))
}

/// Returns `C (z I - A)^-1 B + D` on the unit circle; `None` at a pole.
fn response(model: &StateSpace, omega_rad: f64) -> Option<Matrix> {
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let d = complex(model.d());
    if model.n_states() == 0 {
        return Some(d);
    }
    let n = model.n_states();
    let z = Complex::from_polar(1.0, omega_rad);
    let system = Matrix::from_diagonal_element(n, n, z) - complex(model.a());
    let states = system.lu().solve(&complex(model.b()))?;
    let found = complex(model.c()) * states + d;
    found.iter().all(|value| value.norm() < 1e9).then_some(found)
}

/// Number of frequencies: fewer for models with many states.
fn n_bins(model: &StateSpace) -> usize {
    let n = model.n_states().max(4);
    (4_000_000 / (n * n * n)).clamp(64, 1024)
}

/// Returns the largest singular value.
fn gain(matrix: &Matrix) -> f64 {
    match matrix.len() {
        0 => 0.0,
        1 => matrix[(0, 0)].norm(),
        _ => matrix.clone().svd(false, false).singular_values.max(),
    }
}

/// Returns the frequency at which a contraction first reaches 1 from below, interpolated linearly
/// between the bins.
///
/// Bins before the first contracting one are skipped: at the lowest frequencies a plant that
/// integrates or differentiates learns nothing, and loses nothing.
fn crossing(contractions: impl Iterator<Item = (f64, Option<f64>)>) -> Option<f64> {
    let mut before: Option<(f64, f64)> = None;
    for (frequency_hz, contraction) in contractions {
        let contraction = contraction?;
        if contraction > GROWING {
            return Some(before.map_or(frequency_hz, |(hz, level)| {
                let share = (1.0 - level) / (contraction - level);
                hz + (frequency_hz - hz) * share.clamp(0.0, 1.0)
            }));
        }
        before = Some((frequency_hz, contraction));
    }
    None
}
