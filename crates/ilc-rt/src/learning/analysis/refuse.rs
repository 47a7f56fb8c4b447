//! Whether a law may start: the quick part of the analysis.

use super::iteration::Iteration;
use super::verdict::{GROWTH_MAX, converges, with_bounds};
use crate::learning::krylov::{Estimate, noise, norm, spectral_radius};
use crate::learning::{Law, LearningError, Structure, Surrogate};
use crate::model::StateSpace;

/// Inputs (samples times channels) above which a run counts as long.
const LONG: usize = 20_000;

/// What is known before a law starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Whether the error will converge.
    pub converges: bool,
    /// Factor of a run in the long run.
    pub spectral_radius: f64,
    /// Largest growth of an error without pattern on its way.
    pub transient_growth: f64,
    /// Whether that error grew in any run.
    pub rises: bool,
    /// The figures as a sentence.
    pub why: String,
}

/// Says whether a law will converge with a model; `None` for a law that is not linear, of which
/// nothing can be said. Of gates, ladders and bounds the law within is looked at, as in
/// [`analyze`](super::analyze).
///
/// Up to a run of 60 000 samples this takes less than a second: a law that minimises a cost of this
/// very model converges whatever its weights, and of others only as many products are formed as the
/// verdict takes.
///
/// # Errors
/// - whatever the law itself refuses.
pub fn divergence(
    law: &mut dyn Law,
    model: &StateSpace,
    n_samples: usize,
) -> Result<Option<Verdict>, LearningError> {
    match law.linear_surrogate() {
        Surrogate::Itself => {}
        Surrogate::Inside(inside) => return divergence(inside, model, n_samples),
        Surrogate::Unbounded(mut other) => {
            let verdict = divergence(other.as_mut(), model, n_samples)?;
            return Ok(verdict.map(|found| Verdict { why: with_bounds(&found.why), ..found }));
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
    // In long runs the time of a product counts, and fewer of them still tell growth from decay.
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

/// Refuses a law that will not converge with the model.
///
/// A law of which nothing can be said is let through.
///
/// # Errors
/// - [`LearningError::Divergent`] with the figures.
/// - whatever the law itself refuses.
pub fn refuse_divergent(
    law: &mut dyn Law,
    model: &StateSpace,
    n_samples: usize,
) -> Result<(), LearningError> {
    match divergence(law, model, n_samples)? {
        Some(Verdict { converges: false, why, .. }) => Err(LearningError::Divergent { why }),
        _ => Ok(()),
    }
}

/// Returns the largest growth over some runs of a start without pattern, at least 1, and whether any
/// run made it grow; infinite as soon as nothing can save it.
pub(super) fn transient_growth(
    iteration: &mut Iteration,
    n_runs: usize,
) -> Result<(f64, bool), LearningError> {
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
