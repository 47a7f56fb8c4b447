//! Required values of every node and every drive: the tables, with reasons.
//!
//! A drive keeps what an earlier master wrote: offsets that shift each target, limits that clip it,
//! a deceleration so low that a quick stop never ends. So each object that shapes motion is read at
//! bring-up and corrected if it is wrong; if it cannot be corrected the drive is rejected.

use super::drive::{DriveSetup, FOLLOWING_ERROR_TIME_MS};
use super::own::HomingObjects;
use super::setting::{Kind, Need, Setting};
use crate::fieldbus::canopen::{NodeId, cob_id};
use crate::fieldbus::cia402::objects;

/// The drive's own maximum torque, in thousandths of its rated torque.
const RATED: i64 = 1000;
/// Longest inhibit time of emergency messages that still reports a fault in time, in 0.1 ms.
const EMCY_INHIBIT_MAX: i64 = 100;
/// Multiple of the axis' limit at which a drive's own acceleration limit never acts: a drive that
/// interpolates linearly changes its velocity within one step of its loop, a small part of a cycle.
const ACCELERATION_AMPLE: i64 = 100;
/// Smallest multiple that a drive must allow, as the learned input is added to the set points.
const ACCELERATION_MIN: i64 = 2;
/// The unit of positions: counts, as CiA 303-2 codes increments.
const UNIT_COUNTS: i64 = 0x00B5_0000;
/// The unit of velocities: counts per second.
const UNIT_COUNTS_PER_S: i64 = 0x00B5_0300;

/// Returns the required communication objects of every node.
pub(super) fn communication(node: NodeId, heartbeat_ms: u16, cycle_us: u32) -> Vec<Setting> {
    use Kind::{U8, U16, U32};
    let exactly = |index, sub, kind, value| Setting::new(index, sub, kind, Need::Exactly(value));
    vec![
        // Bit 30 would make the node a second producer of SYNC.
        exactly(objects::COB_ID_SYNC, 0, U32, cob_id::SYNC.into()),
        Setting::new(objects::CYCLE_PERIOD, 0, U32, Need::OneOf(vec![0, cycle_us.into()])),
        // A window or a counter would make the node discard a SYNC, or the data with it.
        exactly(objects::SYNC_WINDOW, 0, U32, 0),
        exactly(objects::SYNC_COUNTER_OVERFLOW, 0, U8, 0),
        // Node guarding is not supported, so a node that waits for it would stop.
        exactly(objects::GUARD_TIME, 0, U16, 0),
        exactly(objects::LIFE_TIME_FACTOR, 0, U8, 0),
        exactly(objects::COB_ID_EMCY, 0, U32, cob_id::of(cob_id::EMCY, node).into()),
        Setting::new(objects::INHIBIT_TIME_EMCY, 0, U16, Need::AtMost(EMCY_INHIBIT_MAX)),
        // To pre-operational or stopped: a node that lost its controller must not continue.
        Setting::new(objects::ERROR_BEHAVIOUR, 1, U8, Need::OneOf(vec![0, 2])),
        exactly(objects::PRODUCER_HEARTBEAT, 0, U16, heartbeat_ms.into()),
    ]
}

/// Returns the required consumer heartbeat entry: empty, as the controller sends no heartbeat.
pub(super) fn watched_heartbeat(sub: u8) -> Setting {
    Setting::new(objects::CONSUMER_HEARTBEAT, sub, Kind::U32, Need::Exactly(0))
}

/// Returns the consumer heartbeat entry of a drive that watches the controller, as it cannot watch its commands.
pub(super) fn controller_heartbeat(controller: NodeId, deadline_ms: u16) -> Setting {
    let entry = i64::from(controller.get()) << 16 | i64::from(deadline_ms);
    Setting::new(objects::CONSUMER_HEARTBEAT, 1, Kind::U32, Need::Exactly(entry)).needed(
        "to stop when commands stop coming: it has no time-out of its commands (0x1400:05), which would do as well",
    )
}

/// Returns the required settings of every kind of stop.
pub(super) fn reactions(setup: &DriveSetup) -> Vec<Setting> {
    use Kind::{I16, U32};
    let option = |index, values: &[i64]| Setting::new(index, 0, I16, Need::OneOf(values.to_vec()));
    let [connection_loss, quick_stop, fault] = setup.own.reactions;
    let or = |own: Option<i16>, index, values: &[i64]| match own {
        Some(value) => Setting::new(index, 0, I16, Need::Exactly(value.into()))
            .needed("as [axis.drive] states its reaction"),
        None => option(index, values),
    };
    let rate = |index| {
        Setting::new(index, 0, U32, Need::Near(setup.acceleration_max_counts_s2.max(1).into()))
    };
    vec![
        rate(objects::QUICK_STOP_DECELERATION),
        rate(objects::PROFILE_DECELERATION),
        rate(objects::PROFILE_ACCELERATION),
        // Fault or quick stop; neither continue nor coast.
        or(connection_loss, objects::CONNECTION_LOSS_OPTION, &[1, 3]),
        // The quick-stop ramp, then off or held.
        if setup.mode.targets_torque() {
            or(quick_stop, objects::QUICK_STOP_OPTION, &[2, 6])
                .needed("to brake in every controlled stop")
        } else {
            or(quick_stop, objects::QUICK_STOP_OPTION, &[2, 6])
        },
        // Applied to an axis at rest: disabled at once, or by a ramp.
        option(objects::SHUTDOWN_OPTION, &[0, 1]),
        option(objects::DISABLE_OPTION, &[1, 0]),
        option(objects::HALT_OPTION, &[1, 2]),
        or(fault, objects::FAULT_REACTION_OPTION, &[2, 1]),
    ]
}

/// Returns the other settings that affect the following of targets.
pub(super) fn motion(setup: &DriveSetup) -> Vec<Setting> {
    use Kind::{I32, U16, U32};
    let at_least = |index, kind, value| Setting::new(index, 0, kind, Need::AtLeast(value));
    let times = |multiple: i64| {
        (i64::from(setup.acceleration_max_counts_s2) * multiple).min(i64::from(u32::MAX))
    };
    let margin = Need::Ample(times(ACCELERATION_AMPLE), times(ACCELERATION_MIN));
    let velocity = i64::from(setup.velocity_max_counts_s);
    let (min, max) = (i64::from(setup.position_min_counts), i64::from(setup.position_max_counts));
    let limit = |sub, value| Setting::new(objects::POSITION_LIMIT, sub, I32, Need::Exactly(value));
    vec![
        polarity(setup.own.polarity),
        limit(1, min),
        limit(2, max),
        // Wrap-around of positions; never inside the axis' range.
        Setting::new(objects::POSITION_RANGE_LIMIT, 1, I32, Need::AtMost(i32::MIN.into())),
        Setting::new(objects::POSITION_RANGE_LIMIT, 2, I32, Need::AtLeast(i32::MAX.into())),
        at_least(objects::MAX_VELOCITY, U32, velocity),
        Setting::new(objects::MAX_ACCELERATION, 0, U32, margin.clone()),
        Setting::new(objects::MAX_DECELERATION, 0, U32, margin),
        at_least(objects::MAX_TORQUE, U16, RATED.max(setup.torque_max.into())),
        at_least(objects::MAX_CURRENT, U16, RATED.max(setup.torque_max.into())),
        at_least(objects::POSITIVE_TORQUE_LIMIT, U16, RATED.max(setup.torque_max.into())),
        at_least(objects::NEGATIVE_TORQUE_LIMIT, U16, RATED.max(setup.torque_max.into())),
        Setting::new(
            objects::FOLLOWING_ERROR_WINDOW,
            0,
            U32,
            Need::Near(setup.following_error_max_counts.into()),
        ),
        Setting::new(
            objects::FOLLOWING_ERROR_TIME,
            0,
            U16,
            Need::Exactly(
                setup.own.following_error_time_ms.unwrap_or(FOLLOWING_ERROR_TIME_MS).into(),
            ),
        ),
        unit(objects::POSITION_UNIT, UNIT_COUNTS, setup.position_unit),
        unit(objects::VELOCITY_UNIT, UNIT_COUNTS_PER_S, setup.velocity_unit),
    ]
}

/// A polarity other than 0 is stated by the cell description, so the drive needs the object.
fn polarity(value: u8) -> Setting {
    let setting = Setting::new(objects::POLARITY, 0, Kind::U8, Need::Exactly(value.into()));
    if value == 0 { setting } else { setting.needed("as [axis.drive] polarity states it") }
}

/// Returns the settings of a homing that the drive carries out.
pub(super) fn homing(homing: &HomingObjects) -> Vec<Setting> {
    let needed = |index, sub, kind, need| {
        Setting::new(index, sub, kind, need).needed("to be homed by [axis.homing]")
    };
    let near = |value: u32| Need::Near(value.max(1).into());
    let speed = |sub, speed: u32| needed(objects::HOMING_SPEEDS, sub, Kind::U32, near(speed));
    let method = Need::Exactly(homing.method.into());
    let mut all = vec![needed(objects::HOMING_METHOD, 0, Kind::I8, method)];
    all.extend(homing.speed_switch_counts_s.map(|value| speed(1, value)));
    if let Some(value) = homing.speed_zero_counts_s {
        all.push(speed(2, value));
        let acceleration = near(homing.acceleration_counts_s2);
        all.push(needed(objects::HOMING_ACCELERATION, 0, Kind::U32, acceleration));
    }
    all
}

/// Returns the required offsets of targets: 0. Checked last, as setting a mode may change them.
pub(super) fn offsets() -> [Setting; 3] {
    let none = |index, kind| Setting::new(index, 0, kind, Need::Exactly(0));
    [
        none(objects::POSITION_OFFSET, Kind::I32),
        none(objects::VELOCITY_OFFSET, Kind::I32),
        none(objects::TORQUE_OFFSET, Kind::I16),
    ]
}

/// Returns the required target of a drive in torque mode: no force before it is commanded.
pub(super) fn no_torque() -> Setting {
    Setting::new(objects::TARGET_TORQUE, 0, Kind::I16, Need::Exactly(0))
}

/// Returns the interpolation period; a drive without it uses the period of SYNC.
pub(super) fn interpolation((value, exponent): (u8, i8)) -> [Setting; 2] {
    let part = |sub, kind, value| {
        Setting::new(objects::INTERPOLATION_PERIOD, sub, kind, Need::Exactly(value))
    };
    [part(1, Kind::U8, value.into()), part(2, Kind::I8, exponent.into())]
}

/// 0 means unspecified.
fn unit(index: u16, counts: i64, other: Option<u32>) -> Setting {
    let mut allowed = vec![counts, 0];
    allowed.extend(other.map(i64::from));
    Setting::new(index, 0, Kind::U32, Need::OneOf(allowed))
}
