//! What an experiment showed: the response of the axis, a model of it, and what the model leaves over.

use super::error::SupervisorError;
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

/// An identified axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// Response from the learned input to the measurement, in the band that was excited.
    pub measured: FrequencyResponse,
    /// Second-order model with delay, sampled with the servo cycle.
    pub fit: SecondOrderFit,
    /// What `[axis.model]` can say of it: unit gain and whole cycles of delay.
    pub described: Described,
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

impl Identified {
    /// Evaluates the record of an experiment.
    ///
    /// `H = Y / U` over the periods that count, of the measurement that is learned from, less its set
    /// point, which rests
    ///
    /// # Errors
    /// [`SupervisorError::Experiment`] or [`SupervisorError::Model`] if the record is of something
    /// else, or cannot be fitted.
    pub fn new(
        cell: &Cell,
        experiment: &Experiment,
        record: &IterationRecord,
    ) -> Result<Self, SupervisorError> {
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
            let measured = frequency_response(&u, &y, dt_s, averaging)?.band(from_hz, to_hz);
            let fit = fit_second_order(&measured, Some(dt_s), Known::default())?;
            let (described, residual_rms, model) = match axis.position_loop {
                None => {
                    let whole_s = fit.model.delay_samples() as f64 * dt_s;
                    let known = Known { gain: Some(1.0), delay_s: Some(whole_s) };
                    let found = fit_second_order(&measured, Some(dt_s), known)?;
                    let (model, left) = (found.model, found.residual_rms);
                    (Described::Position(model), left, model.response(&measured.frequency_hz))
                }
                Some(position_loop) => {
                    let kv = position_loop.gain_per_s;
                    let free = fit_velocity_loop(&measured, kv, dt_s, None)?.model;
                    let whole_s = free.delay_samples() as f64 * dt_s;
                    let found = fit_velocity_loop(&measured, kv, dt_s, Some(whole_s))?;
                    let (model, left) = (found.model, found.residual_rms);
                    (Described::Velocity(model), left, model.response(&measured.frequency_hz))
                }
            };
            let uncertainty = uncertainty(&measured, &model, DEVIATIONS)?;
            let doubt = doubt(&measured, residual_rms);
            Ok(Self { measured, fit, described, uncertainty, doubt })
        };
        evaluate().map_err(|source| SupervisorError::Model {
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
