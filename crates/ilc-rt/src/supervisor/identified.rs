//! What an experiment showed: the response of the axis, a model of it, and what the model leaves over.

use super::error::SupervisorError;
use super::experiment::Experiment;
use crate::config::{Cell, Interface};
use crate::model::ModelError;
use crate::model::identify::{
    Averaging, FrequencyResponse, Known, SecondOrderFit, Uncertainty, fit_second_order,
    frequency_response, uncertainty,
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
    /// The same within what `[axis.model]` can say: unit gain, whole cycles of delay (csp).
    pub described: SecondOrderFit,
    /// What the model leaves over.
    pub uncertainty: Uncertainty,
    interface: Interface,
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
            let whole_s = fit.model.delay_samples() as f64 * dt_s;
            let gain = match axis.interface {
                Interface::Csp => Some(1.0),
                Interface::Csv => {
                    axis.position_loop.map(|position_loop| 1.0 / position_loop.gain_per_s)
                }
            };
            let known = Known { gain, delay_s: Some(whole_s) };
            let described = fit_second_order(&measured, Some(dt_s), known)?;
            let model = described.model.response(&measured.frequency_hz);
            let uncertainty = uncertainty(&measured, &model, DEVIATIONS)?;
            Ok(Self { measured, fit, described, uncertainty, interface: axis.interface })
        };
        evaluate().map_err(|source| SupervisorError::Model {
            file: cell.file.display().to_string(),
            source,
        })
    }

    /// Returns the section `[axis.model]` that says so, to be pasted into the cell description.
    ///
    /// A velocity loop of bandwidth `a` under a position loop of gain `kv` is
    /// `a / (s^2 + a s + a kv)`, so `a = 2 delta w0`.
    pub fn section(&self) -> String {
        let model = &self.described.model;
        let (frequency_hz, damping) = (model.natural_frequency_hz, model.damping);
        let loop_lines = match self.interface {
            Interface::Csp => {
                format!("natural_frequency_hz = {frequency_hz:.3}\ndamping = {damping:.4}")
            }
            Interface::Csv => {
                format!("velocity_bandwidth_hz = {:.3}", 2.0 * damping * frequency_hz)
            }
        };
        format!("[axis.model]\n{loop_lines}\ndelay_samples = {}\n", model.delay_samples())
    }
}
