//! Contradictions within `[axis.homing]`.

use super::checker::Checker;
use crate::config::homing::HOMING_METHODS;
use crate::config::{Axis, ConfigError, Homing, HomingKind};

/// Checks that a homing has what its kind and method need, and nothing else.
pub(super) fn check(axis: &Axis, v: &Checker) -> Result<(), ConfigError> {
    let at = |key: &str| format!("[[axis]] {}: homing.{key}", axis.name);
    let homing = &axis.homing;
    v.that(
        homing.kind != HomingKind::None || homing.offset_m == 0.0,
        &at("offset_m"),
        &homing.offset_m,
        "0 with kind = \"none\"; kind = \"absolute\" has an offset",
    )?;
    let speeds =
        [("speed_switch_m_s", homing.speed_switch_m_s), ("speed_zero_m_s", homing.speed_zero_m_s)];
    if homing.kind != HomingKind::Drive {
        let method = homing.method.map(f64::from);
        let rest = [("method", method), ("acceleration_m_s2", homing.acceleration_m_s2)];
        let given = speeds.into_iter().chain(rest).find_map(|(key, value)| Some((key, value?)));
        return match given {
            Some((key, value)) => {
                Err(v.refuse(&at(key), &value, "for kind = \"drive\" only; remove it"))
            }
            None => Ok(()),
        };
    }
    let methods = HOMING_METHODS.map(|method| method.to_string()).join(", ");
    let Some(method) = homing.method else {
        return Err(v.refuse(&at("method"), &"missing", &format!("one of {methods}")));
    };
    v.that(HOMING_METHODS.contains(&method), &at("method"), &method, &format!("one of {methods}"))?;
    let needed = [Homing::searches_switch(method), Homing::moves(method)];
    for ((key, speed), is_needed) in speeds.into_iter().zip(needed) {
        match speed {
            None if is_needed => {
                return Err(v.refuse(&at(key), &"missing", &format!("needed by method {method}")));
            }
            Some(speed) if !is_needed => {
                let allowed = format!("not used by method {method}; remove it");
                return Err(v.refuse(&at(key), &speed, &allowed));
            }
            Some(speed) => {
                let max = axis.limits.velocity_max_m_s;
                let allowed = format!("at most limits.velocity_max_m_s = {max}");
                v.that(speed <= max, &at(key), &speed, &allowed)?;
            }
            None => {}
        }
    }
    if let Some(acceleration) = homing.acceleration_m_s2 {
        let max = axis.limits.acceleration_max_m_s2;
        let allowed = format!("at most limits.acceleration_max_m_s2 = {max}");
        v.that(acceleration <= max, &at("acceleration_m_s2"), &acceleration, &allowed)?;
    }
    Ok(())
}
