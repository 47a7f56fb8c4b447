//! Contradictions within `[axis.simulation]`.

use super::checker::Checker;
use crate::config::{Axis, ConfigError};

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
