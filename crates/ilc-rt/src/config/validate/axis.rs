//! Contradictions within `[[axis]]`.

use super::checker::Checker;
use super::{drive, homing, simulation, torque};
use crate::config::{Axis, AxisModel, Cell, ConfigError, Mode, mode};
use crate::record::{NAME_MAX, is_hidden};

/// Highest CANopen node number.
const NODE_MAX: u8 = 127;

/// Checks names: unique, and without control characters.
///
/// Names that differ only in case or spaces would share a column of a table, or a file.
pub(super) fn names(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let mut taken: Vec<(String, &str)> = Vec::new();
    for axis in &cell.axes {
        let name = axis.name.as_str();
        v.that(
            !name.is_empty()
                && name.trim() == name
                && name.chars().take(NAME_MAX + 1).count() <= NAME_MAX
                && !name.chars().any(is_hidden),
            "[[axis]] name",
            &name,
            &format!(
                "1 to {NAME_MAX} characters without control characters and spaces around, as \"x\""
            ),
        )?;
        let plain: String =
            name.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect();
        if let Some((_, other)) = taken.iter().find(|(seen, _)| *seen == plain) {
            let allowed =
                format!("a name of its own, also without case and spaces; there is {other}");
            return Err(v.refuse("[[axis]] name", &name, &allowed));
        }
        taken.push((plain, name));
    }
    Ok(())
}

/// Checks nodes: unique.
pub(super) fn nodes(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let mut taken: Vec<(u8, String)> = Vec::new();
    let axes = cell.axes.iter().map(|axis| (axis.node, format!("[[axis]] {} node", axis.name)));
    let tcp = cell.tcp_encoder.iter().map(|tcp| (tcp.node, "[tcp_encoder] node".to_owned()));
    let own = cell.safety.controller_node.map(|node| (node, "[safety] controller_node".to_owned()));
    for (node, key) in axes.chain(tcp).chain(own) {
        v.that((1..=NODE_MAX).contains(&node), &key, &node, "1 to 127")?;
        if let Some((_, other)) = taken.iter().find(|(seen, _)| *seen == node) {
            return Err(v.refuse(
                &key,
                &node,
                &format!("a number of its own; {other} has it already"),
            ));
        }
        taken.push((node, key));
    }
    Ok(())
}

/// Checks buses: each axis on one that exists.
pub(super) fn buses(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let n_extra = cell.extra_buses.len();
    for axis in &cell.axes {
        v.that(
            usize::from(axis.bus) <= n_extra,
            &format!("[[axis]] {}: bus", axis.name),
            &axis.bus,
            &match n_extra {
                0 => "0, which is [bus]; there is no [[extra_bus]]".to_owned(),
                n => format!("0, which is [bus], to {n}, the last [[extra_bus]]"),
            },
        )?;
    }
    Ok(())
}

/// Checks the ranges of an axis, and the requirements of its interface.
pub(super) fn check(axis: &Axis, cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let at = |key: &str| format!("[[axis]] {}: {key}", axis.name);
    let l = &axis.limits;
    v.that(
        l.position_min_m < l.position_max_m,
        &at("limits.position_max_m"),
        &l.position_max_m,
        "above limits.position_min_m",
    )?;
    let farthest = |position_m: f64| (position_m - axis.homing.offset_m).abs();
    let counts = axis.counts_per_m * farthest(l.position_min_m).max(farthest(l.position_max_m));
    v.that(
        counts <= f64::from(i32::MAX),
        &at("counts_per_m"),
        &axis.counts_per_m,
        "counts_per_m times the farthest position must fit 32 bits",
    )?;
    v.that(
        axis.counts_per_m * l.velocity_max_m_s <= f64::from(i32::MAX),
        &at("limits.velocity_max_m_s"),
        &l.velocity_max_m_s,
        "counts_per_m times velocity_max_m_s must fit 32 bits",
    )?;
    if let Some(model) = &axis.model {
        check_model(axis, model, v)?;
    }
    let design = mode::of(axis.interface);
    let name = axis.interface.name();
    if design.needs_position_loop() != axis.position_loop.is_some() {
        let (found, allowed) = if design.needs_position_loop() {
            ("missing", format!("interface \"{name}\" needs [axis.position_loop] gain_per_s"))
        } else {
            let place = if design.closes_position_loop() { "[axis.cascade]" } else { "the drive" };
            ("given", format!("interface \"{name}\" has its position loop in {place}; remove it"))
        };
        return Err(v.refuse(&at("position_loop"), &found, &allowed));
    }
    torque::check(axis, cell.format(axis.bus).payload_max(), v)?;
    homing::check(axis, v)?;
    drive::check(axis, cell.format(axis.bus).payload_max(), v)?;
    simulation::check(axis, cell.simulation.step_us, v)
}

/// Checks that a model has what the interface needs, and nothing else.
fn check_model(axis: &Axis, model: &AxisModel, v: &Checker) -> Result<(), ConfigError> {
    let at = |key: &str| format!("[[axis]] {}: {key}", axis.name);
    let wanted = mode::of(axis.interface).model_keys(model);
    for (key, value) in &wanted {
        v.that(
            value.is_some(),
            &at(&format!("model.{key}")),
            &"missing",
            "needed by this interface",
        )?;
    }
    let all = Mode::ALL.into_iter().flat_map(|other| mode::of(other).model_keys(model));
    let unwanted = all.filter(|(key, _)| wanted.iter().all(|(needed, _)| needed != key));
    for (key, value) in unwanted {
        if let Some(value) = value {
            return Err(v.refuse(
                &at(&format!("model.{key}")),
                &value,
                "not used by this interface; remove it",
            ));
        }
    }
    Ok(())
}
