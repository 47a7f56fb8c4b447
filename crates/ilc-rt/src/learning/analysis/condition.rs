//! The common convergence condition for the gains of PD-type ILC.

use super::plant::first_effects;
use crate::learning::Result;
use crate::learning::law::pd::PdGains;
use crate::model::StateSpace;

/// `|1 - (kp + kd) p_1| < 1` for each channel, `p_1` being the Markov parameter at the law's lead.
///
/// Without a filter it guarantees asymptotic convergence. It does **not** guarantee monotone
/// convergence: that takes a [`monotonic_factor`](super::Analysis::monotonic_factor) below 1, and
/// the error may grow by orders of magnitude before it falls.
///
/// # Source
/// - \[dimarco2016\], Eq. (3.4), which calls it sufficient for monotonic convergence; the norm of
///   the lifted system shows that it is not.
#[derive(Debug, Clone, PartialEq)]
pub struct PdCondition {
    /// Markov parameter of each channel at the law's lead.
    pub markov: Vec<f64>,
    /// `|1 - (kp + kd) p_1|`, the largest of all channels.
    pub factor: f64,
    /// Range of `kp + kd` for which the condition holds in all channels; `None` if it is empty.
    pub gain_range: Option<(f64, f64)>,
    /// Lead that matches the relative degree of each channel.
    pub leads: Vec<Option<usize>>,
}

impl PdCondition {
    /// Evaluates the condition for a square model.
    ///
    /// # Errors
    /// - [`LearningError::Model`](crate::learning::LearningError::Model) for a continuous model.
    pub fn new(gains: PdGains, model: &StateSpace) -> Result<Self> {
        let channels = model.n_inputs().min(model.n_outputs());
        let parameters = model.markov(gains.lead_samples + 1)?;
        let leads = first_effects(model)?;
        let markov: Vec<f64> =
            (0..channels).map(|i| parameters[gains.lead_samples][(i, i)]).collect();
        let sum = gains.kp + gains.kd;
        let factor = markov.iter().map(|p| (1.0 - sum * p).abs()).fold(0.0, f64::max);
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for p in &markov {
            let end = 2.0 / p;
            low = low.max(end.min(0.0));
            high = high.min(end.max(0.0));
        }
        let gain_range = (low < high && high.is_finite() && low.is_finite()).then_some((low, high));
        Ok(Self { markov, factor, gain_range, leads })
    }
}
