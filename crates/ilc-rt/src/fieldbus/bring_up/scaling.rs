//! Scaling factors of a drive: one count on its bus must be one count of the cell description.

use super::drive::DriveSetup;
use super::error::BringUpError;
use super::misfit::{Found, Required};
use super::remote::Remote;
use super::setting::{Kind, Need, Setting};
use crate::fieldbus::cia402::objects;

/// The ratio of a missing object.
const UNITY: [u32; 2] = [1, 1];

/// Checks that the drive counts encoder increments, and that its velocities use the same counts;
/// then sets the speed limit of the motor, which is in revolutions.
///
/// `position = increments * feed constant / (encoder resolution * gear ratio)`
///
/// Position factors are compared and never written, unless the cell description states them: they
/// belong to the mechanics, and a drive may lose its reference when they change.
pub(super) fn check(remote: &mut Remote<'_>, setup: &DriveSetup) -> Result<(), BringUpError> {
    if setup.own.states_ratios() {
        state_ratios(remote, setup)?;
    }
    let resolution = remote.ratio(objects::ENCODER_RESOLUTION)?;
    let gear = remote.ratio(objects::GEAR_RATIO)?.unwrap_or(UNITY);
    let feed = remote.ratio(objects::FEED_CONSTANT)?.unwrap_or(UNITY);
    let increments = resolution.unwrap_or(UNITY);
    let product = |factors: [u32; 3]| factors.into_iter().map(u128::from).product::<u128>();
    let counts = product([feed[0], increments[1], gear[1]]);
    let of_increments = product([feed[1], increments[0], gear[0]]);
    if counts != of_increments && !setup.own.states_ratios() {
        let found = Found::Scaling {
            encoder_resolution: increments,
            gear_ratio: gear,
            feed_constant: feed,
        };
        let required = Required::CountPerIncrement;
        return Err(remote.unfit_ratio(objects::ENCODER_RESOLUTION, found, required));
    }
    let same = |index, ratio: [u32; 2]| {
        [1, 2].map(|sub| {
            let value = ratio[usize::from(sub) - 1];
            Setting::new(index, sub, Kind::U32, Need::Exactly(value.into()))
        })
    };
    remote.ensure_all(&same(objects::VELOCITY_RESOLUTION, increments))?;
    remote.ensure_all(&same(objects::VELOCITY_FACTOR, UNITY))?;
    remote.ensure_all(&same(objects::ACCELERATION_FACTOR, UNITY))?;
    if resolution.is_some() {
        // revolutions per minute = 60 * velocity * gear ratio / feed constant
        let velocity = u128::from(setup.velocity_max_counts_s);
        let top = (velocity * 60 * u128::from(gear[0]) * u128::from(feed[1]))
            .div_ceil(u128::from(gear[1]) * u128::from(feed[0]))
            .min(u32::MAX.into());
        let need = Need::AtLeast(i64::try_from(top).unwrap_or(i64::MAX));
        remote.ensure(&Setting::new(objects::MAX_MOTOR_SPEED, 0, Kind::U32, need))?;
    }
    home_offset(remote, setup)
}

/// Writes the ratios that the cell description states, and refuses a drive with others beside them:
/// `counts_per_m` holds for all three together.
fn state_ratios(remote: &mut Remote<'_>, setup: &DriveSetup) -> Result<(), BringUpError> {
    let ratios = [objects::ENCODER_RESOLUTION, objects::GEAR_RATIO, objects::FEED_CONSTANT];
    for (index, stated) in ratios.into_iter().zip(setup.own.ratios) {
        let Some(ratio) = stated else {
            if let Some(ratio) = remote.ratio(index)? {
                let found = Found::Ratio(ratio);
                return Err(remote.unfit_ratio(index, found, Required::StatedRatio));
            }
            continue;
        };
        for (sub, value) in (1..).zip(ratio) {
            let setting = Setting::new(index, sub, Kind::U32, Need::Exactly(value.into()));
            remote.ensure(&setting.needed("as [axis.drive] states it"))?;
        }
    }
    Ok(())
}

/// Sets the home offset that the cell description states, or that a homing starts from. Otherwise it
/// is compared: writing it would shift the coordinates of an axis that was set up with it, at once or
/// at the next homing; which of the two is unknown.
fn home_offset(remote: &mut Remote<'_>, setup: &DriveSetup) -> Result<(), BringUpError> {
    let own = &setup.own;
    let value = own.home_offset.unwrap_or(0);
    let home = Setting::new(objects::HOME_OFFSET, 0, Kind::I32, Need::Exactly(value.into()));
    if own.home_offset.is_some_and(|offset| offset != 0) {
        return remote.ensure(&home.needed("as [axis.drive] home_offset states it")).map(|_| ());
    }
    if own.home_offset.is_some() || own.homing.is_some() || own.keeps(home.address) {
        return remote.ensure(&home).map(|_| ());
    }
    match remote.find(home.name(), objects::HOME_OFFSET, 0)? {
        Some(found) if found != 0 => {
            let found = Found::Number(found.cast_signed().into());
            Err(BringUpError::Value {
                node: remote.node,
                object: home.address,
                kind: home.kind,
                found,
                required: Required::NoHomeOffset,
                refusal: None,
            })
        }
        _ => Ok(()),
    }
}
