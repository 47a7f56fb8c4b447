//! Settings of maker and integrator in the drive of an axis, from the cell description.

use ilc_rt::config::{Axis, Cell, HomingKind};

use crate::node::DriveParameters;
use crate::node::switches::Switches;

/// Returns the parameters of the drive of an axis.
pub(super) fn of(cell: &Cell, axis: &Axis) -> DriveParameters {
    DriveParameters {
        counts_per_m: counts_per_m(axis),
        zero_m: zero_m(axis),
        position_min_m: axis.limits.position_min_m,
        position_max_m: axis.limits.position_max_m,
        velocity_max_m_s: axis.limits.velocity_max_m_s,
        deceleration_m_s2: axis.limits.acceleration_max_m_s2,
        following_error_max_m: axis.limits.following_error_max_m,
        force_max_n: axis.simulation.force_max_n,
        cycle_us: cell.cell.cycle_us,
        switches: Switches::of(axis),
        inputs: axis.simulation.digital_inputs,
        quirks: axis.simulation.quirks,
        payload_max: cell.format(axis.bus).payload_max(),
    }
}

/// Returns the place at which a drive shows 0 after power-on: with an encoder that is not absolute, wherever the axis is.
fn zero_m(axis: &Axis) -> f64 {
    match axis.homing.kind {
        HomingKind::Drive => axis.simulation.position_start_m,
        HomingKind::None | HomingKind::Absolute => axis.homing.offset_m,
    }
}

/// Returns the counts of a drive's encoder along its axis: on the bus they grow with the axis unless it is reversed, and
/// the polarity of the drive turns them on their way there.
fn counts_per_m(axis: &Axis) -> f64 {
    let is_turned = axis.drive.polarity != 0;
    if axis.reversed == is_turned { axis.counts_per_m } else { -axis.counts_per_m }
}
