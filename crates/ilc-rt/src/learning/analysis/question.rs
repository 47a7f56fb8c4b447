//! Entry point of the analysis: selects the method for each figure.

use super::columns::{COLUMNS_MAX, Columns};
use super::condition::PdCondition;
use super::dense::Dense;
use super::figures::{Analysis, Method};
use super::frequency::Spectrum;
use super::iteration::Iteration;
use super::refuse::transient_growth;
use super::uncertainty::Uncertainty;
use super::verdict;
use super::weakest;
use crate::learning::error::check;
use crate::learning::krylov::{Estimate, fixed_point, largest_symmetric, norm, spectral_radius};
use crate::learning::law::norm_optimal::{NormOptimal, Weights};
use crate::learning::{Law, LearningError, Result, Structure, Surrogate};
use crate::model::StateSpace;

/// Largest number of inputs (samples times channels) for which dense matrices are used.
pub const DENSE_MAX: usize = 640;

/// Largest error of a factor that replaces the one of a dense matrix.
const EXACT: f64 = 1e-10;

/// Optional inputs of the analysis.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// Uncertainty of the model.
    pub uncertainty: Option<Uncertainty>,
    /// Error of a run with input zero, `n_samples` x `n_outputs`: the reference itself if only the
    /// learned input moves the axis, reference minus response if the axis follows the reference.
    pub reference: Option<Vec<f64>>,
    /// Standard deviation of white measurement noise.
    pub noise_std: Option<f64>,
    /// Number of runs for which the expected error is computed.
    pub n_runs: usize,
}

impl Default for Question {
    fn default() -> Self {
        Self { uncertainty: None, reference: None, noise_std: None, n_runs: 20 }
    }
}

/// Predicts convergence and performance of a law on a model.
///
/// With `u_{j+1} = L_u u_j + L_e e_j` and `e_j = r - P u_j - d_j`,
/// `u_{j+1} = T u_j + L_e (r - d_j)`, `T = L_u - L_e P`.
///
/// The law is used through [`Law::update`] and is reset before each use. A law without declared
/// structure is tested for linearity first. For a gate or ladder the inner law is analysed, with
/// gain 1; for a law with bounds the same law without them: an active bound only holds the input.
///
/// # Shapes
/// - `question.reference`: `n_samples` x `n_outputs`, time first
/// # Real Time
/// Cold path. `O(n^3)` in `n = n_samples n_inputs` up to [`DENSE_MAX`]; beyond, and for an optimal law
/// on its own model without `rate`, uncertainty and noise, some hundred products of `O(n)`, and for a
/// law without [adjoint](Law::apply_adjoint) up to [`COLUMNS_MAX`] `n` of them.
/// # Errors
/// - [`LearningError::NotLinear`] for a nonlinear law.
/// - [`LearningError::Length`], [`LearningError::NotFinite`], [`LearningError::Parameter`] for an
///   invalid question.
/// - any error of the law.
/// # Source
/// - \[barton2010\], Eq. (3.16) to (3.23).
pub fn analyze(
    law: &mut dyn Law,
    model: &StateSpace,
    n_samples: usize,
    question: &Question,
) -> Result<Analysis> {
    refuse_question(question, model, n_samples)?;
    match law.linear_surrogate() {
        Surrogate::Itself => {}
        Surrogate::Inside(inside) => return analyze(inside, model, n_samples, question),
        Surrogate::Unbounded(mut other) => {
            let mut analysis = analyze(other.as_mut(), model, n_samples, question)?;
            analysis.why = verdict::with_bounds(&analysis.why);
            return Ok(analysis);
        }
        Surrogate::Gradient { gain } => {
            let mut descent = verdict::descent(model, n_samples, gain)?;
            let mut analysis = analyze(&mut descent, model, n_samples, question)?;
            analysis.why = verdict::by_gradient(&analysis.why);
            return Ok(analysis);
        }
    }
    let pd_condition = match law.structure() {
        Structure::Pd(gains) => Some(PdCondition::new(gains, model)?),
        _ => None,
    };
    let optimal = match law.structure() {
        Structure::Optimal { model: own, weights } => Some((own == model, weights)),
        _ => None,
    };
    let is_known = !matches!(law.structure(), Structure::Unknown);
    let mut iteration = Iteration::new(law, model, n_samples)?;
    if !is_known {
        iteration.check_linear()?;
    }
    let n_largest = iteration.n_u().max(iteration.n_e());
    let own = match optimal {
        Some((true, Some(weights))) => weakest::factor(&iteration, model, weights)?,
        _ => None,
    };
    // Matrices take longer than everything else, and here add something to two figures only.
    let adds_nothing = own.is_some_and(|own| own.error <= EXACT)
        && question.uncertainty.is_none()
        && question.noise_std.is_none();
    let dense = (n_largest <= DENSE_MAX && !adds_nothing)
        .then(|| Dense::new(&mut iteration))
        .transpose()?;
    let method = if dense.is_some() { Method::Dense } else { Method::Structured };
    let (radius, factor, growth) = match (&dense, own) {
        (Some(dense), own) => of_matrices(dense, own)?,
        (None, Some(factor)) => (factor, Some(factor), factor.value.max(1.0)),
        (None, None) => structured(&mut iteration)?,
    };
    let factor = factor.map(|factor| above_radius(factor, radius)).transpose()?;
    let certain = optimal.is_some_and(|(own, _)| own);
    let converges = certain || verdict::converges(radius, growth);
    let spectrum = match optimal {
        Some((true, Some(weights))) => Some(Spectrum::optimal(model, weights)?),
        _ => Spectrum::new(&mut iteration, model)?,
    };
    let mut analysis = Analysis {
        n_samples,
        method,
        converges,
        monotonic: false,
        why: String::new(),
        spectral_radius: radius,
        monotonic_factor: factor,
        transient_growth: growth,
        frequency_hz: Vec::new(),
        contraction: Vec::new(),
        critical_frequency_hz: None,
        learnable_frequency_hz: None,
        robust_factor: None,
        uncertainty_allowed: None,
        robust_lifted: None,
        initial_error_rms: None,
        converged_input: None,
        converged_error: None,
        converged_error_rms: None,
        expected_rms: Vec::new(),
        expected_rms_limit: None,
        pd_condition,
    };
    if let Some(spectrum) = &spectrum {
        analysis.frequency_hz = spectrum.bins.iter().map(|bin| bin.frequency_hz).collect();
        analysis.contraction = spectrum.contraction();
        analysis.critical_frequency_hz = spectrum.critical_hz();
        analysis.learnable_frequency_hz = spectrum.learnable_hz();
        let dt_s = model.dt_s().unwrap_or(1.0);
        let weight = |hz: f64| question.uncertainty.as_ref().map_or(0.0, |w| w.at(hz, dt_s));
        let (factor, allowed) = spectrum.robust(weight);
        analysis.uncertainty_allowed = Some(allowed);
        analysis.robust_factor = question.uncertainty.as_ref().map(|_| factor);
    }
    if let (Some(dense), Some(uncertainty), Some(factor)) = (&dense, &question.uncertainty, factor)
    {
        let share = dense.learned_share()?;
        analysis.robust_lifted = Some(factor.value + uncertainty.largest() * share);
    }
    if let Some(reference) = &question.reference {
        let weights = optimal.filter(|(own, _)| *own).and_then(|(_, weights)| weights);
        converged(&mut analysis, &mut iteration, dense.as_ref(), model, weights, reference)?;
    }
    expected(&mut analysis, &mut iteration, dense.as_ref(), spectrum.as_ref(), question)?;
    verdict::tell(&mut analysis, certain);
    Ok(analysis)
}

fn refuse_question(question: &Question, model: &StateSpace, n_samples: usize) -> Result {
    if let Some(uncertainty) = &question.uncertainty {
        uncertainty.check()?;
    }
    if let Some(reference) = &question.reference {
        check("reference", reference, n_samples, model.n_outputs())?;
    }
    if let Some(value) = question.noise_std
        && !(value.is_finite() && value >= 0.0)
    {
        let allowed = "a standard deviation must be finite and not negative";
        return Err(LearningError::Parameter { what: "noise_std", value, allowed });
    }
    Ok(())
}

/// Returns the three factors from dense matrices; `own` is the second one, if it is known.
fn of_matrices(dense: &Dense, own: Option<Estimate>) -> Result<(Estimate, Option<Estimate>, f64)> {
    let factor = match own.filter(|own| own.error <= EXACT) {
        Some(own) => own,
        None => dense.monotonic_factor()?,
    };
    Ok((dense.spectral_radius(factor)?, Some(factor), dense.transient_growth(factor)?))
}

/// Returns the three factors, matrix-free.
pub(super) fn structured(iteration: &mut Iteration) -> Result<(Estimate, Option<Estimate>, f64)> {
    let n = iteration.n_u();
    // A smaller basis in long runs: it dominates the memory.
    let n_basis = if n <= 1000 { 200 } else { (6_000_000 / n).clamp(20, 60) };
    let radius = spectral_radius(n, &mut |u, out| iteration.apply(u, out), 20, n_basis)?;
    let products = (10_000_000 / n).clamp(60, 1500);
    let factor = if iteration.has_transpose() {
        let mut middle = vec![0.0; n];
        let map = &mut |u: &[f64], out: &mut [f64]| {
            iteration.apply(u, &mut middle)?;
            iteration.apply_transposed(&middle, out)
        };
        Some(largest_symmetric(n, map, n_basis, products, 1e-10)?)
    } else if n <= COLUMNS_MAX {
        let columns = Columns::new(iteration)?;
        let mut middle = vec![0.0; n];
        let map = &mut |u: &[f64], out: &mut [f64]| {
            columns.apply(u, &mut middle);
            columns.apply_transposed(&middle, out);
            Ok(())
        };
        Some(largest_symmetric(n, map, n_basis, products, 1e-10)?)
    } else {
        None
    };
    let factor = factor.map(|square| {
        let value = square.value.max(0.0).sqrt();
        let error = square.error / (2.0 * value).max(square.error.sqrt()).max(f64::MIN_POSITIVE);
        Estimate { value, error }
    });
    let (growth, _) = transient_growth(iteration, 60)?;
    // A random start need not meet the worst error of a single run, nor that of many.
    let least = factor.map_or(radius.value, |factor| factor.value.max(radius.value));
    Ok((radius, factor, growth.max(least)))
}

/// Raises the norm to the spectral radius, its lower bound; both are estimates from below with an
/// error.
fn above_radius(factor: Estimate, radius: Estimate) -> Result<Estimate> {
    let (highest, lowest) = (factor.value + factor.error, radius.value - radius.error);
    if lowest > highest * (1.0 + 1e-6) + 1e-9 {
        return Err(LearningError::Numerics {
            what: "monotonic factor",
            reason: "it was found to lie below the spectral radius, which no norm can",
        });
    }
    Ok(Estimate { value: factor.value.max(radius.value), ..factor })
}

/// Returns the converged input and error.
fn converged(
    analysis: &mut Analysis,
    iteration: &mut Iteration,
    dense: Option<&Dense>,
    model: &StateSpace,
    weights: Option<Weights>,
    reference: &[f64],
) -> Result {
    const TOLERANCE: f64 = 1e-9;
    let (n_samples, n_u) = (iteration.n_samples, iteration.n_u());
    analysis.initial_error_rms = Some(rms(reference, n_samples));
    if !analysis.converges {
        return Ok(());
    }
    let zero = vec![0.0; n_u];
    let mut right = vec![0.0; n_u];
    iteration.law(&zero, reference, &mut right)?;
    for index in iteration.free().to_vec() {
        right[index] = 0.0;
    }
    let direct = match weights {
        // The fixed point of a norm-optimal law does not depend on the weight of the change.
        Some(weights) if dense.is_none() => {
            let ends = Weights { r: 0.0, rate: 0.0, ..weights };
            NormOptimal::new(model, n_samples, ends).ok().and_then(|mut law| {
                let mut input = zero.clone();
                law.update(&zero, reference, &mut input).ok().map(|()| input)
            })
        }
        _ => None,
    };
    let input = match (dense, direct) {
        (Some(dense), _) => Some(dense.fixed_point(&right)),
        (None, Some(input)) => Some(input),
        (None, None) => {
            let map = &mut |u: &[f64], out: &mut [f64]| iteration.apply(u, out);
            let (input, residual) = fixed_point(map, &right, 40, 8, TOLERANCE)?;
            (residual <= 1e-6).then_some(input)
        }
    };
    let Some(input) = input.filter(|input| input.iter().all(|value| value.is_finite())) else {
        return Ok(());
    };
    let mut error = vec![0.0; reference.len()];
    iteration.plant.apply(&input, &mut error);
    for (value, reference) in error.iter_mut().zip(reference) {
        *value = reference - *value;
    }
    analysis.converged_error_rms = Some(rms(&error, n_samples));
    analysis.converged_input = Some(input);
    analysis.converged_error = Some(error);
    Ok(())
}

/// Returns the expected errors under white noise: the repeatable part, past noise learned by the
/// input, and the noise of the run itself.
///
/// `E |e_j|^2 = |r - P u_j|^2 + tr(P Sigma_j P') + tr(I) sigma^2`
fn expected(
    analysis: &mut Analysis,
    iteration: &mut Iteration,
    dense: Option<&Dense>,
    spectrum: Option<&Spectrum>,
    question: &Question,
) -> Result {
    let Some(noise_std) = question.noise_std else { return Ok(()) };
    let n_samples = iteration.n_samples as f64;
    let shares = match (dense, spectrum) {
        (Some(dense), _) => {
            let (runs, limit) = dense.noise(question.n_runs, analysis.converges);
            let per_sample = runs.into_iter().map(|share| share / n_samples).collect();
            Some((per_sample, limit.map(|share| share / n_samples)))
        }
        (None, Some(spectrum)) => Some(spectrum.noise(question.n_runs)),
        (None, None) => None,
    };
    let Some((shares, limit)) = shares else { return Ok(()) };
    let shares: Vec<f64> = shares;
    let variance = noise_std * noise_std;
    let fresh = variance * iteration.n_outputs as f64;
    let zero = vec![0.0; iteration.n_e()];
    let reference = question.reference.as_ref().unwrap_or(&zero);
    let (mut input, mut next) = (vec![0.0; iteration.n_u()], vec![0.0; iteration.n_u()]);
    let mut error = vec![0.0; iteration.n_e()];
    for share in &shares {
        iteration.plant.apply(&input, &mut error);
        for (value, reference) in error.iter_mut().zip(reference) {
            *value = reference - *value;
        }
        let repeated = norm(&error).powi(2) / n_samples;
        analysis.expected_rms.push((repeated + variance * share + fresh).sqrt());
        iteration.law(&input, &error, &mut next)?;
        std::mem::swap(&mut input, &mut next);
    }
    let repeated = match (&question.reference, analysis.converged_error_rms) {
        (None, _) => Some(0.0),
        (Some(_), error) => error,
    };
    analysis.expected_rms_limit = match (limit, repeated) {
        (Some(share), Some(repeated)) if analysis.converges => {
            Some((repeated * repeated + variance * share + fresh).sqrt())
        }
        _ => None,
    };
    Ok(())
}

/// RMS over time of the Euclidean norm.
fn rms(signal: &[f64], n_samples: usize) -> f64 {
    norm(signal) / (n_samples as f64).sqrt()
}
