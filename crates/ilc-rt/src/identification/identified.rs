//! What an experiment showed: the response of the axis, a model of it, and what the model leaves over.

use super::error::IdentificationError;
use super::experiment::Experiment;
use crate::config::Cell;
use crate::model::ModelError;
use crate::model::identify::{
    Averaging, Doubt, FrequencyResponse, Known, SecondOrder, SecondOrderFit, Uncertainty,
    VelocityLoop, doubt, fit_second_order, fit_velocity_loop, frequency_response, uncertainty,
};
use crate::record::IterationRecord;

/// Standard deviations of the measurement that the uncertainty allows for.
const DEVIATIONS: f64 = 3.0;

/// Residual relative to the best at which fewer cycles of delay are as good: the data hardly tell a
/// cycle of delay from a lower natural frequency, and the plainer model learns as well.
const WORTH_A_CYCLE: f64 = 1.05;
/// Most cycles of delay that a cell description takes.
const DELAY_MAX: usize = 20;
/// Share of the input below which an output is none.
const STILL: f64 = 1e-6;

/// An identified axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// Response from the learned input to the measurement, in the band that was excited.
    pub measured: FrequencyResponse,
    /// Second-order model with delay, sampled with the servo cycle.
    pub fit: SecondOrderFit,
    /// What `[axis.model]` can say of it: unit gain and whole cycles of delay.
    pub described: Described,
    /// Relative RMS of what that description leaves over.
    pub residual_rms: f64,
    /// What the model leaves over.
    pub uncertainty: Uncertainty,
    /// Why the description should not be used, if anything speaks against it.
    pub doubt: Option<Doubt>,
}

/// The model of an axis as a cell describes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Described {
    /// The position loop of a csp axis.
    Position(SecondOrder),
    /// The velocity loop of a csv axis, in the position loop of the controller.
    Velocity(VelocityLoop),
}

impl Described {
    /// Returns what a cell description does not take of it.
    fn beyond_cell(&self) -> Option<Doubt> {
        let (first, second, delay) = match self {
            Self::Position(model) => (
                ("natural frequency in Hz", model.natural_frequency_hz, 0.1, 1000.0),
                ("damping", model.damping, 0.05, 5.0),
                model.delay_samples(),
            ),
            Self::Velocity(model) => {
                let bandwidth = ("velocity bandwidth in Hz", model.bandwidth_hz, 0.1, 10_000.0);
                (bandwidth, bandwidth, model.delay_samples())
            }
        };
        let delay = ("delay in cycles", delay as f64, 0.0, DELAY_MAX as f64);
        [first, second, delay]
            .into_iter()
            .find(|(_, value, low, high)| !(low..=high).contains(&value))
            .map(|(what, value, low, high)| Doubt::BeyondCell { what, value, low, high })
    }
}

/// Returns the model of least delay among those that a cell takes and that leave least.
fn plainest(tried: &[(Described, f64)]) -> Option<(Described, f64)> {
    let possible = |(described, _): &&(Described, f64)| described.beyond_cell().is_none();
    let any = tried.iter().any(|each| possible(&each));
    let among = || tried.iter().filter(|each| !any || possible(each));
    let least = among().map(|(_, left)| *left).fold(f64::INFINITY, f64::min);
    among().find(|(_, left)| *left <= WORTH_A_CYCLE * least).copied()
}

/// Returns how many whole delays are tried: none to two beyond the one that was found.
fn delays(model: &SecondOrder, dt_s: f64) -> usize {
    let found = (model.delay_s / dt_s).ceil().clamp(0.0, (DELAY_MAX - 2) as f64);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 18")]
    let found = found as usize;
    found + 3
}

/// Returns the response of an axis that rests as that of nothing, not as one of rounding.
fn without_rounding(mut measured: FrequencyResponse, u: &[f64], y: &[f64]) -> FrequencyResponse {
    let range = |values: &[f64]| {
        let (low, high) = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
        high - low
    };
    if range(y) <= STILL * range(u) {
        for (response, coherence) in measured.response.iter_mut().zip(&mut measured.coherence) {
            (response.re, response.im, *coherence) = (0.0, 0.0, 0.0);
        }
    }
    measured
}

impl Identified {
    /// Evaluates the record of an experiment.
    ///
    /// `H = Y / U` over the periods that count, of the measurement that is learned from, less its set
    /// point, which rests
    ///
    /// # Errors
    /// [`IdentificationError::Experiment`] or [`IdentificationError::Model`] if the record is of something
    /// else, or cannot be fitted.
    pub fn new(
        cell: &Cell,
        experiment: &Experiment,
        record: &IterationRecord,
    ) -> Result<Self, IdentificationError> {
        let (index, axis) = experiment.axis(cell)?;
        let signal = experiment.signal(cell)?;
        let n_axes = cell.n_axes();
        if record.input.len() != signal.values.len() * n_axes {
            let found = format!("{} samples", record.input.len() / n_axes);
            let allowed = format!("{} samples of this experiment", signal.values.len());
            return Err(experiment.refused(cell, "record", &found, &allowed));
        }
        let rows = signal.evaluated();
        let column = |values: &[f64], sign: f64| -> Vec<f64> {
            let rows = rows.start * n_axes..rows.end * n_axes;
            values[rows].chunks_exact(n_axes).map(|row| sign * row[index]).collect()
        };
        let averaging = Averaging::Periods { period_samples: signal.period_samples };
        let (from_hz, to_hz) = (experiment.excitation.from_hz, experiment.excitation.to_hz);
        let evaluate = || -> Result<Self, ModelError> {
            let dt_s = cell.cycle_s();
            let (u, y) = (column(&record.input, 1.0), column(&record.error_m, -1.0));
            let whole = frequency_response(&u, &y, dt_s, averaging)?.band(from_hz, to_hz);
            let measured = without_rounding(whole, &u, &y);
            let fit = fit_second_order(&measured, Some(dt_s), Known::default())?;
            let delays = 0..delays(&fit.model, dt_s);
            let tried: Vec<(Described, f64)> = match axis.position_loop {
                None => delays
                    .map(|n| {
                        let known = Known { gain: Some(1.0), delay_s: Some(n as f64 * dt_s) };
                        let found = fit_second_order(&measured, Some(dt_s), known)?;
                        Ok((Described::Position(found.model), found.residual_rms))
                    })
                    .collect::<Result<_, ModelError>>()?,
                Some(position_loop) => delays
                    .map(|n| {
                        let (kv, delay_s) = (position_loop.gain_per_s, Some(n as f64 * dt_s));
                        let found = fit_velocity_loop(&measured, kv, dt_s, delay_s)?;
                        Ok((Described::Velocity(found.model), found.residual_rms))
                    })
                    .collect::<Result<_, ModelError>>()?,
            };
            let (described, residual_rms) = plainest(&tried).unwrap_or(tried[0]);
            let model = match described {
                Described::Position(model) => model.response(&measured.frequency_hz),
                Described::Velocity(model) => model.response(&measured.frequency_hz),
            };
            let uncertainty = uncertainty(&measured, &model, DEVIATIONS)?;
            let doubt = doubt(&measured, residual_rms).or_else(|| described.beyond_cell());
            Ok(Self { measured, fit, described, residual_rms, uncertainty, doubt })
        };
        evaluate().map_err(|source| IdentificationError::Model {
            file: cell.file.display().to_string(),
            source,
        })
    }

    /// Returns the section `[axis.model]` that says so, to be pasted into the cell description.
    pub fn section(&self) -> String {
        match self.described {
            Described::Position(model) => format!(
                "[axis.model]\nnatural_frequency_hz = {:.3}\ndamping = {:.4}\ndelay_samples = {}\n",
                model.natural_frequency_hz,
                model.damping,
                model.delay_samples()
            ),
            Described::Velocity(model) => format!(
                "[axis.model]\nvelocity_bandwidth_hz = {:.3}\ndelay_samples = {}\n",
                model.bandwidth_hz,
                model.delay_samples()
            ),
        }
    }
}
