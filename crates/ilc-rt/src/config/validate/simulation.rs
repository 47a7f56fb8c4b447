//! Contradictions within `[axis.simulation]`.

use super::checker::Checker;
use crate::config::{Axis, AxisUnit, Cell, ConfigError, DeltaSimulation};
use crate::kinematics::Delta;

/// Checks what the simulated drive of an axis can be.
pub(super) fn check(axis: &Axis, step_us: u32, v: &Checker) -> Result<(), ConfigError> {
    let at = |key: &str| format!("[[axis]] {}: {key}", axis.name);
    let s = &axis.simulation;
    v.range(&at("simulation.coulomb_n"), s.coulomb_n, 0.0, s.force_max_n)?;
    v.range(&at("simulation.static_n"), s.static_n, s.coulomb_n, s.force_max_n)?;
    v.range(&at("simulation.mode_mass_kg"), s.mode_mass_kg, 0.0, 0.9 * s.mass_kg)?;
    v.that(
        s.backlash_m == 0.0 || s.mode_mass_kg > 0.0,
        &at("simulation.backlash_m"),
        &s.backlash_m,
        "0 without simulation.mode_mass_kg: the play is between the carriage and that mass",
    )?;
    let step_s = f64::from(step_us) * 1e-6;
    let carriage_kg = s.mass_kg - s.mode_mass_kg;
    v.that(
        s.bristle_stiffness_n_m * step_s * step_s <= 0.5 * carriage_kg
            && s.bristle_damping_n_s_m * step_s <= 0.5 * carriage_kg,
        &at("simulation.bristle_stiffness_n_m"),
        &s.bristle_stiffness_n_m,
        "bristles that [simulation] step_us resolves: stiffness * step^2 and damping * step at most half of \
         the carriage's mass",
    )?;
    // Any position that can be expressed in counts: an axis that starts outside its limits is worth
    // simulating.
    let (farthest_m, zero_m) = (f64::from(i32::MAX) / axis.counts_per_m, axis.homing.offset_m);
    let (low, high) = (zero_m - farthest_m, zero_m + farthest_m);
    v.range(&at("simulation.position_start_m"), s.position_start_m, low, high)?;
    for (key, place_m) in [
        ("simulation.switch_min_m", s.switch_min_m),
        ("simulation.switch_max_m", s.switch_max_m),
        ("simulation.switch_home_m", s.switch_home_m),
    ] {
        v.range(&at(key), place_m.unwrap_or(0.0), low, high)?;
    }
    if let (Some(low_m), Some(high_m)) = (s.switch_min_m, s.switch_max_m) {
        v.that(low_m < high_m, &at("simulation.switch_min_m"), &low_m, "below switch_max_m")?;
    }
    let option = s.quirks.quick_stop_option;
    let key = at("simulation.quirks.quick_stop_option");
    v.that([0, 1, 2, 5, 6].contains(&option), &key, &option, "0, 1, 2, 5 or 6")
}

/// Checks delta mechanisms: three rotary axes each that it can close with, and nothing that it does not have.
pub(super) fn delta(cell: &Cell, delta: &DeltaSimulation, v: &Checker) -> Result<(), ConfigError> {
    let n_axes = cell.axes.len();
    let allowed = "3, 6, 9 or 12 with [simulation.delta]";
    v.that(n_axes.is_multiple_of(3), "[[axis]] count", &n_axes, allowed)?;
    for axis in &cell.axes {
        let at = |key: &str| format!("[[axis]] {}: {key}", axis.name);
        let allowed = "\"rad\" with [simulation.delta]";
        v.that(axis.unit == AxisUnit::Rad, &at("unit"), &axis.unit.symbol(), allowed)?;
        let s = &axis.simulation;
        for (key, value) in [
            ("simulation.mode_mass_kg", s.mode_mass_kg),
            ("simulation.backlash_m", s.backlash_m),
            ("simulation.bristle_stiffness_n_m", s.bristle_stiffness_n_m),
            ("simulation.cogging_n", s.cogging_n),
            ("simulation.resistance_per_k", s.resistance_per_k),
            ("simulation.expansion_per_k", s.expansion_per_k),
        ] {
            v.that(value == 0.0, &at(key), &value, "0 with [simulation.delta]")?;
        }
    }
    for change in &cell.simulation.changes {
        let is_axis = change.axis.is_some() && change.payload_kg.is_some();
        v.that(
            change.force_n.is_none() && change.temperature_k.is_none() && !is_axis,
            "[[simulation.change]] after_s",
            &change.after_s,
            "of force_n, temperature_k and the payload of one axis nothing with [simulation.delta]: the payload is \
             on each platform",
        )?;
    }
    let starts_rad: Vec<f64> =
        cell.axes.iter().map(|axis| axis.simulation.position_start_m).collect();
    let (starts_rad, _) = starts_rad.as_chunks::<3>();
    let closes = Delta::new(delta.base_m, delta.crank_m, delta.rod_m).and_then(|mechanism| {
        starts_rad.iter().try_for_each(|start_rad| mechanism.jacobian(*start_rad).map(|_| ()))
    });
    closes.map_err(|error| {
        let allowed = format!("a mechanism that can move from position_start_m: {error}");
        v.refuse("[simulation.delta] rod_m", &delta.rod_m, &allowed)
    })
}
