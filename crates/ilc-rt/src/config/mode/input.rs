//! The learned input by its quantity: unit, bound, and demands of an experiment.
//!
//! For validation, `design` and `identification`, through [`super`].

use super::super::{Axis, AxisUnit, InputKind, Learning};
use super::{Demand, Peaks, of};

/// Returns the unit of a learned input of an axis measured in `unit`.
pub fn unit_of(input: InputKind, unit: AxisUnit) -> &'static str {
    match (input, unit) {
        (InputKind::Position, _) => unit.symbol(),
        (InputKind::Velocity, AxisUnit::M) => "m/s",
        (InputKind::Velocity, AxisUnit::Rad) => "rad/s",
        (InputKind::Torque, AxisUnit::M) => "N",
        (InputKind::Torque, AxisUnit::Rad) => "N m",
    }
}

/// Returns the key in `[learning]` of the bound of a learned input.
pub fn bound_key(input: InputKind) -> &'static str {
    match input {
        InputKind::Position => "input_max_m",
        InputKind::Velocity => "input_max_m_s",
        InputKind::Torque => "input_max_n",
    }
}

/// Returns the bound of a learned input.
pub fn bound_of(input: InputKind, learning: &Learning) -> f64 {
    match input {
        InputKind::Position => learning.input_max_m,
        InputKind::Velocity => learning.input_max_m_s,
        InputKind::Torque => learning.input_max_n,
    }
}

/// Returns the unit in which the weights of a law count a learned input, per unit of that input.
///
/// A torque counts by the travel that it holds against the loops of the axis, in metres, so that the weights
/// of axes of different mass are alike, and those of a position loop fit; other inputs as they are.
pub fn scale_of(axis: &Axis) -> f64 {
    match axis.input_kind() {
        InputKind::Position | InputKind::Velocity => 1.0,
        InputKind::Torque => of(axis.interface).travel(axis, InputKind::Torque),
    }
}

/// Returns the demands of an excitation on the limits of the input.
pub(super) fn demands(axis: &Axis, learning: &Learning, peaks: Peaks) -> [Demand; 3] {
    let limits = &axis.limits;
    let demand = |what, needed, allowed, unit| Demand { what, needed, allowed, unit };
    match axis.input_kind() {
        InputKind::Position => [
            demand("learning.input_max_m", peaks.value, learning.input_max_m, "m"),
            demand("limits.velocity_max_m_s", peaks.rate, limits.velocity_max_m_s, "m/s"),
            demand(
                "limits.acceleration_max_m_s2",
                peaks.curvature,
                limits.acceleration_max_m_s2,
                "m/s^2",
            ),
        ],
        InputKind::Velocity => [
            demand("learning.input_max_m_s", peaks.value, learning.input_max_m_s, "m/s"),
            demand("limits.velocity_max_m_s", peaks.value, limits.velocity_max_m_s, "m/s"),
            demand(
                "limits.acceleration_max_m_s2",
                peaks.rate,
                limits.acceleration_max_m_s2,
                "m/s^2",
            ),
        ],
        InputKind::Torque => {
            let mass_kg = axis.force.map_or(1.0, |force| force.mass_kg);
            [
                demand("learning.input_max_n", peaks.value, learning.input_max_n, "N"),
                demand(
                    "limits.acceleration_max_m_s2",
                    peaks.value / mass_kg,
                    limits.acceleration_max_m_s2,
                    "m/s^2",
                ),
                demand("limits.jerk_max_m_s3", peaks.rate / mass_kg, limits.jerk_max_m_s3, "m/s^3"),
            ]
        }
    }
}
