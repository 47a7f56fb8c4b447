//! Contradictions within `[axis.drive]`.

use super::checker::Checker;
use crate::config::{Axis, ConfigError, Drive, HomingKind, ObjectName, StartUp};
use crate::fieldbus::bring_up::{is_keepable, is_set};
use crate::fieldbus::cia402::objects;

/// Largest number of start-up objects.
const START_UP_MAX: usize = 500;
/// Polarity of a drive that reverses positions and velocities itself.
const REVERSED: u8 = 0xC0;

/// Checks what an axis states of its drive, on a bus with frames of up to `payload_max` bytes.
pub(super) fn check(axis: &Axis, payload_max: usize, v: &Checker) -> Result<(), ConfigError> {
    let at = |key: &str| format!("[[axis]] {}: drive.{key}", axis.name);
    let drive = &axis.drive;
    v.that(
        [0, REVERSED].contains(&drive.polarity),
        &at("polarity"),
        &drive.polarity,
        "0, or 192 (positions and velocities reversed)",
    )?;
    // 0 coasts, or goes on.
    let reactions = [
        ("quick_stop_option", drive.quick_stop_option, &[0_i16][..]),
        ("fault_reaction_option", drive.fault_reaction_option, &[0]),
        ("connection_loss_option", drive.connection_loss_option, &[0, 2]),
    ];
    for (key, option, forbidden) in reactions {
        if let Some(option) = option.filter(|option| forbidden.contains(option)) {
            return Err(v.refuse(&at(key), &option, "a reaction that brakes the axis"));
        }
    }
    for kept in &drive.keep {
        keep(axis, *kept, v)?;
    }
    v.that(
        drive.start_up.len() <= START_UP_MAX,
        &at("start_up"),
        &drive.start_up.len(),
        &format!("at most {START_UP_MAX} objects"),
    )?;
    drive.start_up.iter().try_for_each(|object| start_up(axis, object, v))?;
    v.that(
        axis.homing.kind != HomingKind::Drive || !drive.keeps(objects::HOME_OFFSET, 0),
        &at("keep"),
        &"0x607C",
        "not with homing.kind = \"drive\", which starts from home_offset",
    )?;
    pdo(axis, payload_max, v)
}

/// Refuses to keep what a stop depends on, and what bring-up never sets.
fn keep(axis: &Axis, kept: ObjectName, v: &Checker) -> Result<(), ConfigError> {
    let at = format!("[[axis]] {}: drive.keep", axis.name);
    if !is_set(kept.index) {
        return Err(v.refuse(&at, &kept, "an object that bring-up sets; remove it"));
    }
    if let Some((of, reason)) = ramp(&axis.drive, kept.index) {
        let allowed = format!("the {of} depends on it, {reason}");
        return Err(v.refuse(&at, &kept, &allowed));
    }
    let is_ramp =
        matches!(kept.index, objects::PROFILE_DECELERATION | objects::QUICK_STOP_DECELERATION);
    v.that(
        is_keepable(kept.index) || is_ramp,
        &at,
        &kept,
        "an object on which neither a stop nor the place of a target depends",
    )
}

/// Returns the stop that brakes by a deceleration, and the way to change that.
fn ramp(drive: &Drive, index: u16) -> Option<(&'static str, &'static str)> {
    let uses = |option: Option<i16>, of: &[i16], by_default| {
        option.map_or(by_default, |option| of.contains(&option))
    };
    let (quick, fault) = match index {
        objects::QUICK_STOP_DECELERATION => (
            uses(drive.quick_stop_option, &[2, 6], true),
            uses(drive.fault_reaction_option, &[2], true),
        ),
        // By default a drive may have either reaction to a fault.
        objects::PROFILE_DECELERATION => (
            uses(drive.quick_stop_option, &[1, 5], false),
            uses(drive.fault_reaction_option, &[1], true),
        ),
        _ => return None,
    };
    if quick {
        Some(("quick stop", "unless quick_stop_option names another ramp"))
    } else if fault {
        Some(("reaction to a fault", "unless fault_reaction_option names another ramp"))
    } else {
        None
    }
}

fn start_up(axis: &Axis, object: &StartUp, v: &Checker) -> Result<(), ConfigError> {
    let at = format!("[[axis]] {}: drive.start_up {}", axis.name, object.object);
    let address = object.object.address();
    let is_free = !is_set(address.index) || axis.drive.keeps(address.index, address.sub);
    v.that(
        is_free,
        &at,
        &object.value,
        "bring-up sets this object itself, from other keys; remove it, or name it in keep as well",
    )?;
    let (low, high) = object.kind.range();
    let allowed = format!("allowed {low} to {high} in this type");
    v.that((low..=high).contains(&object.value), &at, &object.value, &allowed)
}

/// Checks that the process data hold what the loop cannot do without.
fn pdo(axis: &Axis, payload_max: usize, v: &Checker) -> Result<(), ConfigError> {
    match axis.drive.pdo.map(axis.interface, payload_max) {
        Ok(_) => Ok(()),
        Err((key, reason)) => {
            Err(v.refuse(&format!("[[axis]] {}: drive.pdo.{key}", axis.name), &"a list", &reason))
        }
    }
}
