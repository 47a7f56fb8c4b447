//! Contradictions within the entry point of the learned input, and in the sections of torques and
//! feed-forwards.

use super::checker::Checker;
use crate::config::{Axis, ConfigError, InputKind, mode};
use crate::fieldbus::cia402::objects;

/// Checks the entry point of the learned input, and the sections that torques and feed-forwards need.
pub(super) fn check(axis: &Axis, payload_max: usize, v: &Checker) -> Result<(), ConfigError> {
    let at = |key: &str| format!("[[axis]] {}: {key}", axis.name);
    let (name, design) = (axis.interface.name(), mode::of(axis.interface));
    let input = axis.input_kind();
    let allowed: Vec<&str> = axis.interface.inputs().iter().map(|kind| kind.name()).collect();
    v.that(
        axis.interface.inputs().contains(&input),
        &at("input"),
        &input.name(),
        &format!("interface \"{name}\" has {}", allowed.join(", ")),
    )?;
    let needs = design.needs_cascade();
    v.that(
        needs == axis.cascade.is_some(),
        &at("cascade"),
        &if needs { "missing" } else { "given" },
        &if needs {
            format!("interface \"{name}\" needs [axis.cascade]")
        } else {
            format!("interface \"{name}\" has its cascade in the drive; remove it")
        },
    )?;
    let forward = axis.feedforward.unwrap_or_default();
    v.that(
        forward.velocity <= 0.0 || !design.needs_position_loop(),
        &at("feedforward.velocity"),
        &forward.velocity,
        "0; this interface has it in position_loop.velocity_feedforward",
    )?;
    let forces = input == InputKind::Torque || forward.acceleration > 0.0 || forward.friction > 0.0;
    v.that(
        !forces || axis.force.is_some(),
        &at("force"),
        &"missing",
        "a torque needs [axis.force] rated_n and mass_kg",
    )?;
    if axis.has_torque_offset()
        && let Ok(Some(map)) = axis.drive.pdo.map(axis.interface, payload_max)
        && !map.command.carries(objects::TORQUE_OFFSET)
    {
        let needed = "0x60B2 among them, for the torque that this axis gets";
        return Err(v.refuse(&at("drive.pdo.command"), &"without 0x60B2", needed));
    }
    let Some(force) = axis.force else { return Ok(()) };
    // A command has 16 bits.
    v.that(
        force.max_n() <= f64::from(i16::MAX) * 1e-3 * force.rated_n,
        &at("force.max_n"),
        &force.max_n(),
        "at most 32.767 times force.rated_n",
    )?;
    if let Some(filter_hz) = axis.cascade.and_then(|cascade| cascade.velocity_filter_hz) {
        let least_hz = mode::of(axis.interface).natural_frequency_hz(axis);
        v.that(
            filter_hz >= least_hz,
            &at("cascade.velocity_filter_hz"),
            &filter_hz,
            &format!("at least {least_hz:.3}, the natural frequency of the loop"),
        )?;
    }
    Ok(())
}
