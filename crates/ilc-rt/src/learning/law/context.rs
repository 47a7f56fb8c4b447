//! Context in which a law is built and its parameters are checked: cell, model, set points of a run.
//!
//! `config` and `design` create it from a cell description; the laws read it.

use std::fmt::Debug;

use serde::Serialize;
use thiserror::Error;

use super::LawName;
use crate::fieldbus::cia402::InputKind;
use crate::learning::{Law, LearningError};
use crate::model::StateSpace;
use crate::schema::Violation;

/// The part of an axis that laws use.
#[derive(Clone, Copy, Debug)]
pub struct LawAxis<'a> {
    /// Name.
    pub name: &'a str,
    /// Quantity that the learned input is added to.
    pub input: InputKind,
    /// Bound of the learned input.
    pub input_max: f64,
    /// Lowest position.
    pub position_min: f64,
    /// Highest position.
    pub position_max: f64,
    /// Velocity limit.
    pub velocity_max: f64,
    /// Acceleration limit.
    pub acceleration_max: f64,
}

impl LawAxis<'_> {
    /// Returns true if the learned input is added to the set point of a drive that closes the
    /// position loop.
    pub fn corrects_set_point(&self) -> bool {
        self.input == InputKind::Position
    }
}

/// The part of a cell that laws use.
#[derive(Clone, Debug)]
pub struct LawCell<'a> {
    /// The axes, in the order of the channels.
    pub axes: Vec<LawAxis<'a>>,
    /// Sample time.
    pub cycle_s: f64,
    /// The parameters of every law, for wrappers of another one.
    pub tables: &'a dyn LawTables,
}

impl LawCell<'_> {
    /// Returns the refusal of a law by its name.
    pub(super) fn unfit(law: LawName, allowed: impl Into<String>) -> Violation {
        violation("[learning] law", law.as_str(), allowed)
    }
}

/// A run of a cell, for which a law is built.
#[derive(Clone, Copy, Debug)]
pub struct LawContext<'a> {
    /// The cell.
    pub cell: &'a LawCell<'a>,
    /// The model from the learned inputs to the positions of all axes.
    pub model: &'a StateSpace,
    /// Set points, `n_samples` x `n_axes`.
    pub reference_m: &'a [f64],
}

impl LawContext<'_> {
    /// Returns the number of axes.
    pub fn n_axes(&self) -> usize {
        self.cell.axes.len()
    }

    /// Returns the samples of a run.
    pub fn n_samples(&self) -> usize {
        self.reference_m.len() / self.n_axes().max(1)
    }

    /// Builds the inner law of a wrapper.
    ///
    /// # Errors
    /// As [`LawParameters::build`].
    pub fn core(&self, law: LawName) -> Result<Box<dyn Law>, BuildError> {
        match self.cell.tables.parameters(law) {
            Some(parameters) => parameters.build(self),
            None => Err(LawCell::unfit(law, "a law to go round").into()),
        }
    }
}

/// The parameters of every law of a cell, by name.
pub trait LawTables: Debug {
    /// Returns the parameters of a law; `None` for [`LawName::None`].
    fn parameters(&self, law: LawName) -> Option<&dyn LawParameters>;
}

/// The parameters of a law: a table of a cell description.
pub trait LawParameters: Json + Debug {
    /// Checks rules beyond the ranges of the fields, also for a law that is not in use.
    ///
    /// # Errors
    /// [`Violation`] for the first invalid value.
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        let _ = cell;
        Ok(())
    }

    /// Checks the law's requirements on the cell that names it.
    ///
    /// # Errors
    /// [`Violation`] for the first unsatisfied requirement.
    fn requires(&self, cell: &LawCell) -> Result<(), Violation> {
        let _ = cell;
        Ok(())
    }

    /// Returns the inner law of a wrapper.
    fn core(&self) -> Option<LawName> {
        None
    }

    /// Returns true if the law makes runs that only measure: their inputs must be applied as they are, so that
    /// no wrapper but a gate fits.
    fn measures(&self) -> bool {
        false
    }

    /// Builds the law.
    ///
    /// # Errors
    /// [`BuildError`] for parameters that do not suit the run or the model.
    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError>;

    /// Returns cells in which the law learns, for the tests over all laws.
    fn examples(&self) -> &'static [Example];
}

/// A cell in which a law learns.
#[derive(Clone, Copy, Debug)]
pub struct Example {
    /// Its axes have their position loop in the controller.
    pub is_parallel: bool,
    /// Text that follows `[learning]`, the law's name included.
    pub learning: &'static str,
    /// Largest share of the first run's RMS error left after five updates.
    pub error_left: f64,
}

/// A value as canonical JSON: keys in alphabetical order, numbers as they are read back.
pub trait Json {
    /// Returns the value as one line of JSON.
    fn json(&self) -> serde_json::Value;
}

impl<T: Serialize> Json for T {
    fn json(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or_default()
    }
}

/// Reason why a law could not be built.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum BuildError {
    /// A parameter does not suit the cell.
    #[error("{} = {}: {}", .0.key, .0.value, .0.allowed)]
    Refused(Violation),
    /// The law refused.
    #[error(transparent)]
    Learning(#[from] LearningError),
}

impl From<Violation> for BuildError {
    fn from(violation: Violation) -> Self {
        Self::Refused(violation)
    }
}

#[expect(clippy::needless_pass_by_value, reason = "most values are made for the call")]
pub(super) fn violation(key: &str, value: impl ToString, allowed: impl Into<String>) -> Violation {
    Violation { key: key.to_owned(), value: value.to_string(), allowed: allowed.into() }
}

/// Checks the bandwidth of a filter against the sample rate.
pub(super) fn check_cutoff(
    key: &str,
    cutoff_hz: Option<f64>,
    cell: &LawCell,
) -> Result<(), Violation> {
    let nyquist_hz = 0.5 / cell.cycle_s;
    let (low, high) = (1e-3 * nyquist_hz, 0.95 * nyquist_hz);
    match cutoff_hz.filter(|cutoff_hz| !(low..=high).contains(cutoff_hz)) {
        None => Ok(()),
        Some(value) => Err(violation(key, value, format!("allowed {low} to {high}"))),
    }
}

/// Checks that every axis may be given a learned input.
pub(super) fn needs_inputs(law: LawName, cell: &LawCell) -> Result<(), Violation> {
    if cell.axes.iter().all(|axis| axis.input_max > 0.0) {
        return Ok(());
    }
    let allowed = "needs input_max_m (csp axes) and input_max_m_s (csv axes) above 0, and input_max_n of axes that learn \
                   a torque";
    Err(LawCell::unfit(law, allowed))
}

/// Checks that a law can be the inner law of a wrapper.
pub(super) fn check_core(key: &str, core: LawName, cell: &LawCell) -> Result<(), Violation> {
    match cell.tables.parameters(core) {
        Some(parameters) if parameters.core().is_none() && !parameters.measures() => Ok(()),
        Some(parameters) if parameters.measures() => {
            let allowed = "a law that learns from every run; this one makes runs that only measure";
            Err(violation(key, core.as_str(), allowed))
        }
        _ => Err(violation(key, core.as_str(), "a law that goes round no other one")),
    }
}
