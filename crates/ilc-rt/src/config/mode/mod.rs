//! Modes of operation in design, one per file: nominal model of each learned input, response to the
//! program, keys of the cell description. Unit, bound and demands belong to the quantity that is
//! learned.
//!
//! For validation, `design` and `identification`, which ask [`of`] and never distinguish modes. The
//! hot half is `servo::mode`.

mod csp;
mod cst;
mod csv;
mod drive;
mod effort;
mod input;
mod program;

use super::{Axis, AxisModel, Feedforward, InputKind, Learning};
pub use crate::fieldbus::cia402::Mode;
use crate::model::{ModelError, StateSpace};
pub(crate) use cst::cascade_gains;
pub use effort::{Effort, effort};
pub use input::{bound_key, bound_of, scale_of, unit_of};
pub use program::AxisProgram;

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
    /// Returns the keys of `[axis.model]` that the mode needs, with their values.
    fn model_keys(&self, model: &AxisModel) -> Vec<(&'static str, Option<f64>)>;

    /// Returns true if the controller closes the position loop, not the drive.
    fn closes_position_loop(&self) -> bool;

    /// Returns true if the mode needs `[axis.position_loop]`; others refuse it.
    fn needs_position_loop(&self) -> bool {
        false
    }

    /// Returns true if the mode needs `[axis.cascade]`; others refuse it.
    fn needs_cascade(&self) -> bool {
        false
    }

    /// Returns the closed loop of the axis from an input to its position, discretised.
    ///
    /// # Errors
    /// [`ModelError`] if the parameters give no model.
    fn nominal_model(
        &self,
        axis: &Axis,
        input: InputKind,
        cycle_s: f64,
    ) -> Result<StateSpace, ModelError>;

    /// Returns the inputs of those models due to the program alone.
    fn feed(&self, axis: &Axis, program: &AxisProgram) -> Vec<(InputKind, Vec<f64>)>;

    /// Returns the integral time of the velocity loop that acts on the axis, wherever it is closed.
    fn integral_time_s(&self, axis: &Axis) -> Option<f64> {
        axis.force.and_then(|force| force.integral_time_s)
    }

    /// Returns the lag of the nominal model that the axis has not: of the hold, where a drive interpolates.
    fn hold_s(&self, _axis: &Axis, _cycle_s: f64) -> f64 {
        0.0
    }

    /// Returns the axis with the whole velocity of the program fed forward.
    fn told_velocity(&self, axis: &Axis) -> Axis {
        let mut told = axis.clone();
        told.feedforward =
            Some(Feedforward { velocity: 1.0, ..axis.feedforward.unwrap_or_default() });
        told
    }

    /// Returns the travel of the axis per unit of a constant input.
    fn travel(&self, axis: &Axis, input: InputKind) -> f64;

    /// Returns the natural frequency of the position loop.
    fn natural_frequency_hz(&self, axis: &Axis) -> f64;

    /// Returns an axis that differs from its description: by factors of the natural frequency of what the
    /// model describes, and of its damping if that is described.
    fn perturbed(&self, axis: &Axis, frequency: f64, damping: f64) -> Axis;
}

/// Returns the response of an axis to its program alone, by the models of `plant`, which may differ from the
/// axis that the controller knows.
///
/// # Shapes
/// - the result: one position relative to the start for each sample of the program
/// # Errors
/// [`ModelError`] if the parameters give no model.
pub fn program_response(
    axis: &Axis,
    plant: &Axis,
    program: &AxisProgram,
) -> Result<Vec<f64>, ModelError> {
    let design = of(axis.interface);
    let mut response_m = vec![0.0; program.way_m.len()];
    for (input, fed) in design.feed(axis, program) {
        let moved = design.nominal_model(plant, input, program.cycle_s)?.simulate(&fed, None)?;
        response_m.iter_mut().zip(moved).for_each(|(all, moved)| *all += moved);
    }
    Ok(response_m)
}

/// Returns the model of an axis that learning uses: from its learned input to its position.
///
/// # Errors
/// [`ModelError`] if the parameters give no model.
pub fn learned_model(axis: &Axis, cycle_s: f64) -> Result<StateSpace, ModelError> {
    of(axis.interface).nominal_model(axis, axis.input_kind(), cycle_s)
}

/// Returns the model of `plant` from the learned input of `axis`, counted in the unit of its weights.
///
/// # Errors
/// [`ModelError`] if the parameters give no model.
pub fn weighed_model(axis: &Axis, plant: &Axis, cycle_s: f64) -> Result<StateSpace, ModelError> {
    let model = learned_model(plant, cycle_s)?;
    let scale = scale_of(axis);
    StateSpace::new(
        model.a().clone(),
        model.b() / scale,
        model.c().clone(),
        model.d() / scale,
        model.dt_s(),
    )
}

/// Returns the travel of an axis under an excitation, and its demands on the limits of the input.
pub fn demands(axis: &Axis, learning: &Learning, peaks: Peaks) -> (f64, [Demand; 3]) {
    let travel = of(axis.interface).travel(axis, axis.input_kind());
    (peaks.value * travel, input::demands(axis, learning, peaks))
}

/// Returns the design half of a mode.
pub fn of(mode: Mode) -> &'static dyn ModeDesign {
    match mode {
        Mode::Csp => &csp::Csp,
        Mode::Csv => &csv::Csv,
        Mode::Cst => &cst::Cst,
    }
}
