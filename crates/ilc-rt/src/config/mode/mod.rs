//! Modes of operation in design, one per file: unit and bound of the learned input, nominal model,
//! demands of an experiment, keys of the cell description.
//!
//! For validation, `design` and `identification`, which ask [`of`] and never distinguish modes. The
//! hot half is `servo::mode`.

mod csp;
mod csv;

use super::{Axis, AxisModel, AxisUnit, Learning};
pub use crate::fieldbus::cia402::Mode;
use crate::model::{ModelError, StateSpace};

/// A limit of an axis, and the share of it that an experiment needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Key of the limit.
    pub what: &'static str,
    /// Value needed.
    pub needed: f64,
    /// Value allowed.
    pub allowed: f64,
    /// Unit of both.
    pub unit: &'static str,
}

impl Demand {
    /// Returns the factor by which the amplitude could grow.
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
    /// Returns the unit of the learned input of an axis measured in `unit`.
    fn input_unit(&self, unit: AxisUnit) -> &'static str;

    /// Returns the bound of the learned input.
    fn input_max(&self, learning: &Learning) -> f64;

    /// Returns the keys of `[axis.model]` that the mode needs, with their values.
    fn model_keys(&self, model: &AxisModel) -> Vec<(&'static str, Option<f64>)>;

    /// Returns true if the controller closes the position loop, not the drive: the input is not
    /// part of the set point.
    fn closes_position_loop(&self) -> bool;

    /// Returns the closed loop of the axis from learned input to position, discretised.
    ///
    /// # Errors
    /// [`ModelError`] if the parameters give no model.
    fn nominal_model(&self, axis: &Axis, cycle_s: f64) -> Result<StateSpace, ModelError>;

    /// Returns the input of that model due to the program alone, for a set point and the velocity
    /// to the next one.
    fn feed(&self, axis: &Axis, set_point_m: f64, velocity_m_s: f64) -> f64;

    /// Returns the travel of the axis under an excitation, and its demands on the limits of the
    /// input.
    fn demands(&self, axis: &Axis, learning: &Learning, peaks: Peaks) -> (f64, [Demand; 3]);
}

/// Returns the design half of a mode.
pub fn of(mode: Mode) -> &'static dyn ModeDesign {
    match mode {
        Mode::Csp => &csp::Csp,
        Mode::Csv => &csv::Csv,
    }
}
