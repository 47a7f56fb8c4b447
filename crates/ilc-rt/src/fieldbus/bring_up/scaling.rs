//! Scaling factors of a drive: one count on its bus must be one count of the cell description.

use super::drive::DriveSetup;
use super::error::BringUpError;
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
/// Position factors are compared and never written: they belong to the mechanics, and a drive may
/// lose its reference when they change.
pub(super) fn check(remote: &mut Remote<'_>, setup: &DriveSetup) -> Result<(), BringUpError> {
    let resolution = remote.ratio(objects::ENCODER_RESOLUTION)?;
    let gear = remote.ratio(objects::GEAR_RATIO)?.unwrap_or(UNITY);
    let feed = remote.ratio(objects::FEED_CONSTANT)?.unwrap_or(UNITY);
    let increments = resolution.unwrap_or(UNITY);
    let product = |factors: [u32; 3]| factors.into_iter().map(u128::from).product::<u128>();
    let counts = product([feed[0], increments[1], gear[1]]);
    let of_increments = product([feed[1], increments[0], gear[0]]);
    if counts != of_increments {
        let setting = Setting::new(objects::ENCODER_RESOLUTION, 0, Kind::U32, Need::Exactly(1));
        let found = format!(
            "{}/{} with 0x6091 = {}/{} and 0x6092 = {}/{}",
            increments[0], increments[1], gear[0], gear[1], feed[0], feed[1]
        );
        let needed = "one count per encoder increment (0x6092 / (0x608F * 0x6091) = 1)".to_owned();
        return Err(remote.unfit_words(&setting, found, needed, None));
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
    if let Some([increments, revolutions]) = resolution {
        let top = u64::from(setup.velocity_max_counts_s) * 60 * u64::from(revolutions);
        let top = top.div_ceil(increments.into()).min(u32::MAX.into());
        let need = Need::AtLeast(top.cast_signed());
        remote.ensure(&Setting::new(objects::MAX_MOTOR_SPEED, 0, Kind::U32, need))?;
    }
    let home = Setting::new(objects::HOME_OFFSET, 0, Kind::I32, Need::Exactly(0));
    match remote.find(home.name(), objects::HOME_OFFSET, 0)? {
        // Writing it would shift the coordinates of an axis that was set up with it, at once or at
        // the next homing; which of the two is unknown.
        Some(found) if found != 0 => {
            let found = home.shown(found.cast_signed().into());
            let needed = "0; positions would be shifted against the cell description".to_owned();
            Err(remote.unfit_words(&home, found, needed, None))
        }
        _ => Ok(()),
    }
}
