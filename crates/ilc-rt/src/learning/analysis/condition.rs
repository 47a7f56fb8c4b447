//! The condition by which gains of proportional-derivative learning are often chosen.

use super::plant::first_effects;
use crate::learning::LearningError;
use crate::learning::law::pd::PdGains;
use crate::model::StateSpace;

/// `|1 - (kp + kd) p_1| < 1` for each channel, `p_1` being the first Markov parameter that the law's
/// lead meets.
///
/// It makes the error die out sooner or later if no filter is used. It does **not** make it fall from
/// run to run: that takes a [`monotonic_factor`](super::Analysis::monotonic_factor) below 1, and the
/// error can grow beyond all measure before it falls.
///
/// # Source
/// - \[dimarco2016\], Eq. (3.4), which calls it sufficient for monotonic convergence; the lifted norm
///   shows that it is not.
#[derive(Debug, Clone, PartialEq)]
pub struct PdCondition {
    /// Markov parameter at the law's lead, of each channel.
    pub markov: Vec<f64>,
    /// `|1 - (kp + kd) p_1|`, the largest of all channels.
    pub factor: f64,
    /// Range of `kp + kd` in which the condition holds for all channels; `None` if there is none.
    pub gain_range: Option<(f64, f64)>,
    /// The lead at which the first effect of each channel's input is met.
    pub leads: Vec<Option<usize>>,
}

impl PdCondition {
    /// Works the condition out for a model with as many outputs as inputs.
    ///
    /// # Errors
    /// - [`LearningError::Model`] for a continuous model.
    pub fn new(gains: PdGains, model: &StateSpace) -> Result<Self, LearningError> {
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
