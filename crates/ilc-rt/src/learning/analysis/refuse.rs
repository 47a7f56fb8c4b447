//! The quick part of the analysis: refuses a diverging law before the first run.

use super::iteration::Iteration;
use super::verdict::{GROWTH_MAX, by_gradient, converges, descent, with_bounds};
use crate::learning::krylov::{Estimate, noise, norm, spectral_radius};
use crate::learning::{Law, LearningError, Result, Structure, Surrogate};
use crate::model::StateSpace;

/// A run with more inputs (samples times channels) counts as long.
const LONG: usize = 20_000;

/// Convergence of a law, predicted before it starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// True if the error converges.
    pub converges: bool,
    /// Spectral radius: asymptotic factor per run.
    pub spectral_radius: f64,
    /// Largest transient growth of a random error.
    pub transient_growth: f64,
    /// True if that error grew in any run.
    pub rises: bool,
    /// The figures as a sentence.
    pub why: String,
}

/// Predicts convergence of a law on a model; `None` for a nonlinear law, which is not analysed. For
/// gates, ladders and bounds the inner law is analysed, as in [`analyze`](super::analyze).
///
/// Up to runs of 60 000 samples this takes less than a second: a law that is norm-optimal for this
/// very model converges for any weights, and for others only as many products are computed as the
/// verdict needs.
///
/// # Errors
/// - any error of the law.
pub fn divergence(
    law: &mut dyn Law,
    model: &StateSpace,
    n_samples: usize,
) -> Result<Option<Verdict>> {
    match law.linear_surrogate() {
        Surrogate::Itself => {}
        Surrogate::Inside(inside) => return divergence(inside, model, n_samples),
        Surrogate::Unbounded(mut other) => {
            let verdict = divergence(other.as_mut(), model, n_samples)?;
            return Ok(verdict.map(|found| Verdict { why: with_bounds(&found.why), ..found }));
        }
        Surrogate::Gradient { gain } => {
            let mut descent = descent(model, n_samples, gain)?;
            let verdict = divergence(&mut descent, model, n_samples)?;
            return Ok(verdict.map(|found| Verdict { why: by_gradient(&found.why), ..found }));
        }
    }
    let is_known = match law.structure() {
        Structure::Optimal { model: own, .. } if own == model => {
            let why = "the law minimises a cost of its own model".to_owned();
            return Ok(Some(Verdict {
                converges: true,
                spectral_radius: 1.0,
                transient_growth: 1.0,
                rises: false,
                why,
            }));
        }
        Structure::Unknown => false,
        _ => true,
    };
    let mut iteration = Iteration::new(law, model, n_samples)?;
    if !is_known {
        match iteration.check_linear() {
            Err(LearningError::NotLinear { .. }) => return Ok(None),
            other => other?,
        }
    }
    let n = iteration.n_u();
    // In long runs each product takes time, and fewer of them suffice to tell growth from decay.
    let (n_runs, n_plain, n_basis) = if n > LONG { (16, 4, 14) } else { (30, 10, 24) };
    let (growth, rises) = transient_growth(&mut iteration, n_runs)?;
    let radius = if growth < GROWTH_MAX {
        spectral_radius(n, &mut |u, out| iteration.apply(u, out), n_plain, n_basis)?
    } else {
        Estimate { value: f64::NAN, error: f64::NAN }
    };
    let fine = growth < GROWTH_MAX && converges(radius, growth);
    let why = if growth < GROWTH_MAX {
        format!("each run multiplies the error by {:.6} in the long run", radius.value)
    } else {
        format!("within {n_runs} runs the error grows more than {GROWTH_MAX:.0}-fold")
    };
    Ok(Some(Verdict {
        converges: fine,
        spectral_radius: radius.value,
        transient_growth: growth,
        rises,
        why,
    }))
}

/// Refuses a law that is predicted to diverge on the model.
///
/// A law that cannot be analysed is accepted.
///
/// # Errors
/// - [`LearningError::Divergent`] with the figures.
/// - any error of the law.
pub fn refuse_divergent(law: &mut dyn Law, model: &StateSpace, n_samples: usize) -> Result {
    match divergence(law, model, n_samples)? {
        Some(Verdict { converges: false, why, .. }) => Err(LearningError::Divergent { why }),
        _ => Ok(()),
    }
}

/// Returns the largest growth of a random start over some runs, at least 1, and whether any run
/// amplified it; infinite as soon as the growth exceeds all bounds.
pub(super) fn transient_growth(iteration: &mut Iteration, n_runs: usize) -> Result<(f64, bool)> {
    const HOPELESS: f64 = 1e6;
    let n = iteration.n_u();
    let mut state = noise(n, 21);
    for index in iteration.free().to_vec() {
        state[index] = 0.0;
    }
    let start = norm(&state);
    let mut next = vec![0.0; n];
    let (mut largest, mut before, mut rises) = (1.0_f64, 1.0, false);
    for _ in 0..n_runs {
        if start == 0.0 {
            break;
        }
        iteration.apply(&state, &mut next)?;
        std::mem::swap(&mut state, &mut next);
        let growth = norm(&state) / start;
        largest = largest.max(growth);
        rises |= growth > before * (1.0 + 1e-9);
        before = growth;
        if growth.is_nan() || growth >= HOPELESS {
            return Ok((f64::INFINITY, true));
        }
        if growth < 1e-9 {
            break;
        }
    }
    Ok((largest, rises))
}
