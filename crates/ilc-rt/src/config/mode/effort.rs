//! Force that a learned torque takes to remove the lag of an axis: its loops work against it.
//!
//! For `design`, through [`super`].

use super::super::{Axis, InputKind};
use super::{AxisProgram, of, program_response};
use crate::model::ModelError;

/// Integral times after which a ramp is followed steadily.
const STEADY: f64 = 20.0;
/// Time after which it is without an integral, in periods of the natural frequency.
const PERIODS: f64 = 10.0;
/// Largest number of samples of a ramp.
const SAMPLES_MAX: usize = 100_000;

/// The learned torque that an axis needs before it learns anything else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Its largest value.
    pub peak_n: f64,
    /// Time by which the axis is behind a steady motion.
    pub lag_s: f64,
    /// The lead with which it would not be, with the whole velocity fed forward.
    pub lead_s: f64,
}

/// Returns the effort of an axis that learns a torque; `None` for other quantities.
///
/// To follow the program `r` without the lag `tau`, the axis must be `tau r'` away from where its loops want
/// it: `F = tau (r' + (r - r_0) / T) / c`, with `c` the travel that a force holds and `T` the integral time of
/// the velocity loop. An integral cancels a steady force, so that it must grow with the way.
///
/// # Errors
/// [`ModelError`] if the parameters give no model.
pub fn effort(axis: &Axis, program: &AxisProgram) -> Result<Option<Effort>, ModelError> {
    if axis.input_kind() != InputKind::Torque {
        return Ok(None);
    }
    let design = of(axis.interface);
    let integral_time_s = design.integral_time_s(axis);
    let lag_s = lag_s(axis, program.cycle_s)?;
    let per_way = integral_time_s.map_or(0.0, |time_s| 1.0 / time_s);
    let stiffness = lag_s / design.travel(axis, InputKind::Torque);
    let peak_n = program
        .way_m
        .iter()
        .zip(&program.velocity_m_s)
        .map(|(way_m, velocity_m_s)| (stiffness * (velocity_m_s + way_m * per_way)).abs())
        .fold(0.0, f64::max);
    let told = design.told_velocity(axis);
    let own_s = told.feedforward.map_or(0.0, |forward| forward.lead_s);
    Ok(Some(Effort { peak_n, lag_s, lead_s: own_s + self::lag_s(&told, program.cycle_s)? }))
}

/// Returns the time by which an axis is behind a steady motion, by its model.
fn lag_s(axis: &Axis, cycle_s: f64) -> Result<f64, ModelError> {
    let design = of(axis.interface);
    let settling_s = PERIODS / design.natural_frequency_hz(axis)
        + STEADY * design.integral_time_s(axis).unwrap_or(0.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, bounded"
    )]
    let n_samples = (settling_s / cycle_s).min(SAMPLES_MAX as f64) as usize + 2;
    let ramp = AxisProgram::ramp(n_samples, cycle_s);
    let response_m = program_response(axis, axis, &ramp)?;
    let ends = ramp.way_m.last().zip(response_m.last());
    let held_s = design.hold_s(axis, cycle_s);
    Ok(ends.map_or(0.0, |(wanted_m, reached_m)| wanted_m - reached_m - held_s))
}
