//! Modes of operation in design, one a file: unit and bound of the learned input, nominal model, demands of
//! an experiment, keys of the cell description.
//!
//! For validation, `design` and `identification`, which ask [`of`] and never what mode it is. The hot half is
//! `servo::mode`.

mod csp;
mod csv;

use super::{Axis, AxisModel, AxisUnit, Learning};
pub use crate::fieldbus::cia402::Mode;
use crate::model::{ModelError, StateSpace};

/// A limit of an axis, and how much of it an experiment needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Key of the limit.
    pub what: &'static str,
    /// Needed of it.
    pub needed: f64,
    /// Allowed.
    pub allowed: f64,
    /// Unit of both.
    pub unit: &'static str,
}

impl Demand {
    /// Factor by which the amplitude could grow.
    pub fn margin(&self) -> f64 {
        self.allowed / self.needed
    }
}

/// The largest values of an excitation and of its first two derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peaks {
    /// Of the excitation.
    pub value: f64,
    /// Of its first derivative.
    pub rate: f64,
    /// Of its second derivative.
    pub curvature: f64,
}

/// A mode in design.
pub trait ModeDesign: Sync {
    /// Unit of the learned input of an axis that is measured in `unit`.
    fn input_unit(&self, unit: AxisUnit) -> &'static str;

    /// Bound of the learned input.
    fn input_max(&self, learning: &Learning) -> f64;

    /// Keys of `[axis.model]` that the mode needs, with their values.
    fn model_keys(&self, model: &AxisModel) -> Vec<(&'static str, Option<f64>)>;

    /// Whether the position loop is here, and not in the drive: the input is not part of the set point.
    fn closes_position_loop(&self) -> bool;

    /// Closed loop of the axis from learned input to position, sampled.
    ///
    /// # Errors
    /// [`ModelError`] if the figures make no model.
    fn nominal_model(&self, axis: &Axis, cycle_s: f64) -> Result<StateSpace, ModelError>;

    /// Input of that model by the program alone, at a set point and its velocity to the next one.
    fn feed(&self, axis: &Axis, set_point_m: f64, velocity_m_s: f64) -> f64;

    /// Travel of the axis under an excitation, and its demands on the limits of the input.
    fn demands(&self, axis: &Axis, learning: &Learning, peaks: Peaks) -> (f64, [Demand; 3]);
}

/// The design half of a mode.
pub fn of(mode: Mode) -> &'static dyn ModeDesign {
    match mode {
        Mode::Csp => &csp::Csp,
        Mode::Csv => &csv::Csv,
    }
}
