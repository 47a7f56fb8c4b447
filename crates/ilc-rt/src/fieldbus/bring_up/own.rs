//! The values of one drive that its cell description states: identity, objects, start-up list.
//!
//! For `campaign`, which fills it in, and `config`, which checks it by [`is_set`] and [`is_keepable`].

use crate::fieldbus::canopen::ObjectAddress;
use crate::fieldbus::cia402::objects;

use super::setting::Kind;

/// Values of one drive that its cell description states; empty by default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DriveOwn {
    /// Vendor, product, revision and serial number that the drive must have.
    pub identity: [Option<u32>; 4],
    /// Objects that are left as they are: index, and sub-index if only one of a record.
    pub keep: Vec<(u16, Option<u8>)>,
    /// Home offset, in units of the drive; written if the drive has another.
    pub home_offset: Option<i32>,
    /// Polarity.
    pub polarity: u8,
    /// Encoder resolution, gear ratio and feed constant of the mechanics.
    pub ratios: [Option<[u32; 2]>; 3],
    /// Time that the following error may exceed its window, in ms.
    pub following_error_time_ms: Option<u16>,
    /// Reactions to a loss of connection, a quick stop and a fault.
    pub reactions: [Option<i16>; 3],
    /// Objects written at bring-up, in order.
    pub start_up: Vec<StartUpObject>,
    /// Homing that the drive carries out.
    pub homing: Option<HomingObjects>,
}

/// An object that bring-up writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StartUpObject {
    /// The object.
    pub address: ObjectAddress,
    /// Its type.
    pub kind: Kind,
    /// Its value.
    pub value: i64,
    /// Read first, written if different and read back; otherwise written only.
    pub read_back: bool,
}

/// The objects of a homing, in units of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HomingObjects {
    /// Method.
    pub method: i8,
    /// Speed of the search for the switch, if the method has one.
    pub speed_switch_counts_s: Option<u32>,
    /// Speed of the search for the zero, if the method has one.
    pub speed_zero_counts_s: Option<u32>,
    /// Acceleration.
    pub acceleration_counts_s2: u32,
}

impl DriveOwn {
    /// Returns true if an object is left as it is.
    pub(super) fn keeps(&self, address: ObjectAddress) -> bool {
        self.keep
            .iter()
            .any(|(index, sub)| *index == address.index && sub.is_none_or(|sub| sub == address.sub))
    }

    /// Returns true if the ratios of the mechanics are stated.
    pub(super) fn states_ratios(&self) -> bool {
        self.ratios.iter().any(Option::is_some)
    }
}

/// Objects of bring-up on which no stop depends.
const KEEPABLE: [u16; 21] = [
    objects::CYCLE_PERIOD,
    objects::INHIBIT_TIME_EMCY,
    objects::CONSUMER_HEARTBEAT,
    objects::SHUTDOWN_OPTION,
    objects::DISABLE_OPTION,
    objects::HALT_OPTION,
    objects::FOLLOWING_ERROR_WINDOW,
    objects::FOLLOWING_ERROR_TIME,
    objects::MAX_TORQUE,
    objects::MAX_CURRENT,
    objects::POSITIVE_TORQUE_LIMIT,
    objects::NEGATIVE_TORQUE_LIMIT,
    objects::HOME_OFFSET,
    objects::POSITION_LIMIT,
    objects::MAX_VELOCITY,
    objects::MAX_MOTOR_SPEED,
    objects::PROFILE_ACCELERATION,
    objects::POSITION_UNIT,
    objects::VELOCITY_UNIT,
    objects::INTERPOLATION_PERIOD,
    objects::MAX_ACCELERATION,
];

/// Objects of bring-up on which a stop depends, or the place to which a target leads.
const NEVER_KEPT: [u16; 27] = [
    objects::COB_ID_SYNC,
    objects::SYNC_WINDOW,
    objects::SYNC_COUNTER_OVERFLOW,
    objects::GUARD_TIME,
    objects::LIFE_TIME_FACTOR,
    objects::COB_ID_EMCY,
    objects::ERROR_BEHAVIOUR,
    objects::PRODUCER_HEARTBEAT,
    objects::CONNECTION_LOSS_OPTION,
    objects::QUICK_STOP_OPTION,
    objects::FAULT_REACTION_OPTION,
    objects::CONTROLWORD,
    objects::MODE_OF_OPERATION,
    objects::PROFILE_DECELERATION,
    objects::QUICK_STOP_DECELERATION,
    objects::MAX_DECELERATION,
    objects::POLARITY,
    objects::POSITION_RANGE_LIMIT,
    objects::ENCODER_RESOLUTION,
    objects::VELOCITY_RESOLUTION,
    objects::GEAR_RATIO,
    objects::FEED_CONSTANT,
    objects::VELOCITY_FACTOR,
    objects::ACCELERATION_FACTOR,
    objects::POSITION_OFFSET,
    objects::VELOCITY_OFFSET,
    objects::TORQUE_OFFSET,
];

/// Returns true if bring-up sets the object itself.
pub fn is_set(index: u16) -> bool {
    matches!(index, 0x1400..=0x1BFF)
        || KEEPABLE.contains(&index)
        || NEVER_KEPT.contains(&index)
        || matches!(
            index,
            objects::HOMING_METHOD | objects::HOMING_SPEEDS | objects::HOMING_ACCELERATION
        )
}

/// Returns true if bring-up may leave the object as it is, as no stop depends on it.
pub fn is_keepable(index: u16) -> bool {
    KEEPABLE.contains(&index)
}
