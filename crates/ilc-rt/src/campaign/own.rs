//! The values of a drive that the cell description states, in the drive's own units.

use crate::config::Axis;
use crate::fieldbus::bring_up::{DriveOwn, HomingObjects, StartUpObject};

/// Returns what an axis states of its drive.
pub(super) fn of(axis: &Axis) -> DriveOwn {
    let drive = &axis.drive;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let counts = |value_si: f64| (value_si * axis.counts_per_m).round() as u32;
    let start_up = drive.start_up.iter().map(|object| StartUpObject {
        address: object.object.address(),
        kind: object.kind,
        value: object.value,
        read_back: object.read_back,
    });
    let homing = axis.homing.by_drive(axis.limits.acceleration_max_m_s2);
    let speed = |speed_m_s: f64| (speed_m_s > 0.0).then(|| counts(speed_m_s));
    DriveOwn {
        identity: [drive.vendor, drive.product, drive.revision, drive.serial],
        keep: drive.keep.iter().map(|kept| (kept.index, kept.sub)).collect(),
        home_offset: drive.home_offset,
        polarity: drive.polarity,
        ratios: [drive.encoder_resolution, drive.gear_ratio, drive.feed_constant],
        following_error_time_ms: drive.following_error_time_ms,
        reactions: [
            drive.connection_loss_option,
            drive.quick_stop_option,
            drive.fault_reaction_option,
        ],
        start_up: start_up.collect(),
        homing: homing.map(|homing| HomingObjects {
            method: homing.method,
            speed_switch_counts_s: speed(homing.speed_switch_m_s),
            speed_zero_counts_s: speed(homing.speed_zero_m_s),
            acceleration_counts_s2: counts(homing.acceleration_m_s2),
        }),
    }
}
