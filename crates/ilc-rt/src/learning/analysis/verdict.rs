//! The verdict of an analysis, as a sentence.

use super::columns::COLUMNS_MAX;
use super::figures::{Analysis, Method};
use crate::learning::Result;
use crate::learning::krylov::Estimate;
use crate::learning::law::adjoint::Adjoint;
use crate::learning::law::q_filter::QFilter;
use crate::model::StateSpace;

/// Largest transient growth that counts as convergence.
pub(super) const GROWTH_MAX: f64 = 1e3;
/// Tolerance above a spectral radius of 1, for rounding.
const ROUNDING: f64 = 1e-9;

/// Returns true if the error converges without excessive transient growth.
///
/// A law whose eigenvalues promise convergence after transient growth by many orders of magnitude
/// converges neither on a machine nor in floating-point numbers.
pub(super) fn converges(radius: Estimate, growth: f64) -> bool {
    radius.value < 1.0 + ROUNDING && growth < GROWTH_MAX
}

/// Returns gradient descent on a model, as a law measures it on that plant.
pub(super) fn descent(model: &StateSpace, n_samples: usize, gain: Option<f64>) -> Result<Adjoint> {
    Adjoint::new(model, n_samples, gain, QFilter::None)
}

/// Returns the sentence for a law that measures its gradient: one run of the descent takes several.
pub(super) fn by_gradient(why: &str) -> String {
    format!("as gradient descent on this model, between learning runs: {why}")
}

/// Returns the verdict on a law with bounds, from that on the law without them.
pub(super) fn with_bounds(why: &str) -> String {
    format!("without its bounds, which can only hold the input where they are reached: {why}")
}

/// Sets the verdict.
pub(super) fn tell(analysis: &mut Analysis, certain: bool) {
    let radius = analysis.spectral_radius.value;
    let factor = analysis.monotonic_factor;
    let growing = analysis.critical_frequency_hz.map_or_else(String::new, |hz| {
        format!("; from {hz:.3} Hz on the error grows (largest contraction {:.4})", peak(analysis))
    });
    // The upper bound of the factor counts: "in every run" is a guarantee.
    analysis.monotonic = analysis.converges
        && factor.is_some_and(|factor| factor.value + factor.error < 1.0 + ROUNDING);
    let worst = factor.map(said);
    analysis.why = if !analysis.converges {
        if radius >= 1.0 + ROUNDING {
            format!("each run multiplies the error by {radius:.6} in the long run{growing}")
        } else {
            format!(
                "the error grows {:.3e}-fold before it falls (spectral radius {radius:.6}){growing}",
                analysis.transient_growth
            )
        }
    } else if let (true, Some(worst)) = (analysis.monotonic, &worst) {
        format!(
            "every run brings the input nearer to its final value: the worst factor of a run is \
             {worst}, in the long run {radius:.6}"
        )
    } else if certain {
        format!(
            "the law minimises a cost of its own model, so that the error converges (factor {radius:.6} \
             in the long run); a single run may take the input away from its end by up to {}",
            worst.unwrap_or_else(|| "an unknown factor".to_owned())
        )
    } else if let (None, Method::Structured) = (&worst, analysis.method) {
        let over = if analysis.contraction.is_empty() {
            String::new()
        } else {
            format!(
                " (over frequency, the ends of the run left aside, it is {:.6})",
                peak(analysis)
            )
        };
        format!(
            "the error converges (factor {radius:.6} in the long run); whether it falls in every run is \
             not known: the worst factor of a run takes a law with a transpose, or a run of at most \
             {COLUMNS_MAX} inputs{over}{growing}"
        )
    } else {
        format!(
            "the error converges (factor {radius:.6} in the long run), but not in every run: it may \
             first grow {:.3}-fold{}{growing}",
            analysis.transient_growth,
            worst.map_or_else(String::new, |worst| format!(
                ", the worst factor of a run being {worst}"
            )),
        )
    };
}

/// Formats a factor, with its upper bound if that differs within six digits.
fn said(factor: Estimate) -> String {
    let Estimate { value, error } = factor;
    if error < 5e-7 * value.max(1.0) {
        format!("{value:.6}")
    } else {
        format!("{value:.6} to {:.6}", value + error)
    }
}

fn peak(analysis: &Analysis) -> f64 {
    analysis.contraction.iter().copied().fold(0.0, f64::max)
}
