//! The objects of a simulated drive, 0x6000 and above.

use ilc_rt::config::Quirks;
use ilc_rt::fieldbus::canopen::pdo::{MappedObject, PdoNumber, TYPE_EVERY_SYNC};
use ilc_rt::fieldbus::canopen::{NodeId, ObjectAddress};
use ilc_rt::fieldbus::cia402::{Mode, objects, pdo_map};

use super::dictionary::{Allowed, Entry, Mappable};
use super::drive::DriveParameters;
use super::drive_mode::DriveMode;
use super::profile_objects;
use super::standard_objects::{self, PdoDefault};
use super::value::Value;

/// Device type: profile 402, servo drive.
pub const DEVICE_TYPE: u32 = 0x0002_0192;
/// Event-driven transmission.
const TYPE_EVENT: u8 = 255;
/// Some masters treat a TPDO that arrived twice as periodic, and then miss it on a quiet drive.
const DISPLAY_EVENT_MS: u16 = 100;

/// Rated torque, and rated current, in thousandths.
const RATED: u16 = 1000;
/// Rated current, in milliamperes.
const RATED_MA: u32 = 5_000;
/// Voltage of the DC link, in millivolts.
const DC_LINK_MV: u32 = 325_000;
/// Positions in counts of the encoder.
pub(super) const UNIT_COUNTS: u32 = 0x00B5_0000;
/// Velocities in counts of the encoder per second.
const UNIT_COUNTS_PER_S: u32 = 0x00B5_0300;
/// Counts; metres with a prefix of 1, milli, micro and nano.
const POSITION_UNITS: [i64; 5] = [0x00B5_0000, 0x0001_0000, 0xFD01_0000, 0xFA01_0000, 0xF701_0000];
/// The same, per second.
const VELOCITY_UNITS: [i64; 5] = [0x00B5_0300, 0x0001_0300, 0xFD01_0300, 0xFA01_0300, 0xF701_0300];

/// Returns all objects of a drive.
///
/// 0x6502 lists the simulated modes only; option codes allow the simulated reactions only.
pub fn all(node: NodeId, parameters: &DriveParameters) -> Vec<Entry> {
    let mode_map = [mapped(objects::MODE_OF_OPERATION, 8)];
    let display_map = [mapped(objects::MODE_DISPLAY, 8), mapped(objects::ERROR_CODE, 16)];
    let command_map = pdo_map::command_map(Mode::Csp);
    let [command_map, status_map, motion_map] =
        [&command_map[..], &pdo_map::STATUS_MAP, &pdo_map::DRIVE_MOTION_MAP]
            .map(|map| present(map, &parameters.quirks));
    let default = |number, transmission, map| PdoDefault { number, transmission, event_ms: 0, map };
    let status_type =
        if parameters.quirks.statusword_on_event { TYPE_EVENT } else { TYPE_EVERY_SYNC };
    let pdos = [
        default(pdo_map::COMMAND_PDO, TYPE_EVERY_SYNC, &command_map[..]),
        default(PdoNumber::receive(1), TYPE_EVENT, &mode_map[..]),
        default(pdo_map::STATUS_PDO, status_type, &status_map[..]),
        default(pdo_map::DRIVE_MOTION_PDO, TYPE_EVERY_SYNC, &motion_map[..]),
        PdoDefault {
            event_ms: DISPLAY_EVENT_MS,
            ..default(PdoNumber::transmit(2), TYPE_EVENT, &display_map[..])
        },
    ];
    let mut entries =
        standard_objects::communication(node, DEVICE_TYPE, "ilc-sim CiA 402 drive", 402);
    entries.extend(standard_objects::process_data(node, &pdos));
    entries.extend(words_and_options(parameters));
    entries.extend(motion(parameters));
    entries.extend(profile_objects::all(parameters));
    entries
}

/// Returns the objects that a drive with these quirks lacks.
pub fn lacking(quirks: &Quirks) -> impl Iterator<Item = u16> {
    [
        (quirks.lacks_torque_offset, objects::TORQUE_OFFSET),
        (quirks.lacks_torque, objects::TORQUE_ACTUAL),
        (quirks.lacks_following_error, objects::FOLLOWING_ERROR_ACTUAL),
        (quirks.lacks_interpolation_period, objects::INTERPOLATION_PERIOD),
        (quirks.lacks_following_error_time, objects::FOLLOWING_ERROR_TIME),
        (quirks.lacks_emergencies, objects::COB_ID_EMCY),
        (quirks.lacks_emergencies, objects::INHIBIT_TIME_EMCY),
        (quirks.lacks_consumer_heartbeat, objects::CONSUMER_HEARTBEAT),
    ]
    .into_iter()
    .filter_map(|(lacks, index)| lacks.then_some(index))
}

/// Returns the sub-indices that the PDOs of a drive with these quirks lack.
pub fn lacking_subs(quirks: &Quirks) -> impl Iterator<Item = (u16, u8)> {
    let all = (0..4).flat_map(|offset| {
        let status = PdoNumber::transmit(offset).communication_index();
        let of_status = [3, 5, 6].map(|sub| (quirks.lacks_status_times, (status, sub)));
        let command = PdoNumber::receive(offset).communication_index();
        of_status.into_iter().chain([(quirks.lacks_command_timeout, (command, 5))])
    });
    all.filter_map(|(lacks, address)| lacks.then_some(address))
}

/// Returns the part of a map whose objects exist.
fn present(map: &[MappedObject], quirks: &Quirks) -> Vec<MappedObject> {
    let exists =
        |object: &&MappedObject| lacking(quirks).all(|index| index != object.address.index);
    map.iter().filter(exists).copied().collect()
}

const fn mapped(index: u16, bits: u8) -> MappedObject {
    MappedObject { address: ObjectAddress::new(index, 0), bits }
}

/// Creates an object of this profile, with the profile's name.
pub(super) fn object(index: u16, value: Value) -> Entry {
    Entry::read_only(index, 0, objects::name(index).unwrap_or("Object"), value)
}

/// Creates an object that the controller writes, also by RPDO.
pub(super) fn input(index: u16, value: Value) -> Entry {
    let name = objects::name(index).unwrap_or("Object");
    Entry::read_write(index, 0, name, value).mappable(Mappable::Both)
}

/// Creates an object that the drive provides, also by TPDO.
pub(super) fn output(index: u16, value: Value) -> Entry {
    object(index, value).mappable(Mappable::Transmit)
}

/// Creates an object that is configured once.
pub(super) fn setting(index: u16, sub: u8, value: Value) -> Entry {
    Entry::read_write(index, sub, objects::name(index).unwrap_or("Object"), value)
}

fn words_and_options(parameters: &DriveParameters) -> Vec<Entry> {
    let quick_stop = parameters.quirks.quick_stop_option;
    vec![
        // 0: no action, 1: fault, 2: disable voltage, 3: quick stop.
        setting(objects::CONNECTION_LOSS_OPTION, 0, Value::I16(1)).allowing(Allowed::Range(0, 3)),
        output(objects::ERROR_CODE, Value::U16(0)),
        input(objects::CONTROLWORD, Value::U16(0)),
        output(objects::STATUSWORD, Value::U16(0)),
        // 0: power off; 1, 2: slow and quick ramp, then power off; 5, 6: the same, and hold.
        setting(objects::QUICK_STOP_OPTION, 0, Value::I16(quick_stop))
            .allowing(Allowed::OneOf(&[0, 1, 2, 5, 6])),
        // 0: power off, 1: slow ramp, then power off.
        setting(objects::SHUTDOWN_OPTION, 0, Value::I16(0)).allowing(Allowed::OneOf(&[0, 1])),
        setting(objects::DISABLE_OPTION, 0, Value::I16(0)).allowing(Allowed::OneOf(&[0, 1])),
        // 1, 2: slow and quick ramp.
        setting(objects::HALT_OPTION, 0, Value::I16(2)).allowing(Allowed::OneOf(&[1, 2])),
        // 0: power off; 1, 2: slow and quick ramp, then power off.
        setting(objects::FAULT_REACTION_OPTION, 0, Value::I16(2))
            .allowing(Allowed::OneOf(&[0, 1, 2])),
        input(objects::MODE_OF_OPERATION, Value::I8(0)).allowing(Allowed::Modes),
        output(objects::MODE_DISPLAY, Value::I8(0)),
        Entry::constant(
            objects::SUPPORTED_MODES,
            0,
            "Supported drive modes",
            Value::U32(DriveMode::supported()),
        ),
    ]
}

fn motion(parameters: &DriveParameters) -> Vec<Entry> {
    let unsigned = |counts: f64| Value::U32(0).with_number(rounded(counts));
    let signed = |counts: f64| Value::I32(0).with_number(rounded(counts));
    let counts = |value_si: f64| value_si * parameters.counts_per_m.abs();
    let ends = [parameters.position_min_m, parameters.position_max_m]
        .map(|position_m| (position_m - parameters.zero_m) * parameters.counts_per_m);
    let limit = objects::POSITION_LIMIT;
    let period = objects::INTERPOLATION_PERIOD;
    let range = objects::POSITION_RANGE_LIMIT;
    let (cycle, exponent) = power_on_period(parameters);
    let deceleration = unsigned(counts(parameters.deceleration_m_s2));
    let mut entries = vec![
        output(objects::POSITION_DEMAND, Value::I32(0)),
        output(objects::POSITION_INTERNAL, Value::I32(0)),
        output(objects::POSITION_ACTUAL, Value::I32(0)),
        setting(
            objects::FOLLOWING_ERROR_WINDOW,
            0,
            unsigned(counts(parameters.following_error_max_m)),
        ),
        setting(objects::FOLLOWING_ERROR_TIME, 0, Value::U16(10)),
        output(objects::VELOCITY_DEMAND, Value::I32(0)),
        output(objects::VELOCITY_ACTUAL, Value::I32(0)),
        setting(objects::MAX_TORQUE, 0, Value::U16(RATED)),
        setting(objects::MAX_CURRENT, 0, Value::U16(RATED)),
        setting(objects::POSITIVE_TORQUE_LIMIT, 0, Value::U16(RATED)),
        setting(objects::NEGATIVE_TORQUE_LIMIT, 0, Value::U16(RATED)),
        Entry::constant(
            objects::RATED_TORQUE,
            0,
            "Motor rated torque",
            unsigned(parameters.force_max_n * 1000.0),
        ),
        Entry::constant(objects::RATED_CURRENT, 0, "Motor rated current", Value::U32(RATED_MA)),
        object(objects::DC_LINK_VOLTAGE, Value::U32(DC_LINK_MV)),
        input(objects::TARGET_TORQUE, Value::I16(0)),
        output(objects::TORQUE_DEMAND, Value::I16(0)),
        output(objects::TORQUE_ACTUAL, Value::I16(0)),
        input(objects::TARGET_POSITION, Value::I32(0)),
        Entry::constant(limit, 0, "Highest sub-index", Value::U8(2)),
        setting(limit, 1, signed(ends[0].min(ends[1]))),
        setting(limit, 2, signed(ends[0].max(ends[1]))),
        setting(objects::MAX_VELOCITY, 0, unsigned(counts(parameters.velocity_max_m_s))),
        Entry::constant(range, 0, "Highest sub-index", Value::U8(2)),
        setting(range, 1, Value::I32(i32::MIN)),
        setting(range, 2, Value::I32(i32::MAX)),
        setting(objects::HOME_OFFSET, 0, Value::I32(0)),
        // Bit 7: positions, bit 6: velocities.
        setting(objects::POLARITY, 0, Value::U8(0))
            .allowing(Allowed::OneOf(&[0, 0x40, 0x80, 0xC0])),
        setting(objects::MAX_MOTOR_SPEED, 0, Value::U32(u32::MAX)),
        setting(objects::PROFILE_ACCELERATION, 0, deceleration)
            .allowing(Allowed::Range(1, i64::from(u32::MAX))),
        setting(objects::PROFILE_DECELERATION, 0, deceleration)
            .allowing(Allowed::Range(1, i64::from(u32::MAX))),
        setting(objects::QUICK_STOP_DECELERATION, 0, deceleration)
            .allowing(Allowed::Range(1, i64::from(u32::MAX))),
        setting(objects::MAX_ACCELERATION, 0, Value::U32(u32::MAX)),
        setting(objects::MAX_DECELERATION, 0, Value::U32(u32::MAX)),
        setting(objects::POSITION_UNIT, 0, Value::U32(UNIT_COUNTS))
            .allowing(Allowed::OneOf(&POSITION_UNITS)),
        setting(objects::VELOCITY_UNIT, 0, Value::U32(UNIT_COUNTS_PER_S))
            .allowing(Allowed::OneOf(&VELOCITY_UNITS)),
        input(objects::POSITION_OFFSET, Value::I32(0)),
        input(objects::VELOCITY_OFFSET, Value::I32(0)),
        input(objects::TORQUE_OFFSET, Value::I16(0)),
        Entry::constant(period, 0, "Highest sub-index", Value::U8(2)),
        setting(period, 1, Value::U8(cycle)).allowing(Allowed::Range(1, 255)),
        setting(period, 2, Value::I8(exponent)).allowing(Allowed::Range(-6, 0)),
        output(objects::FOLLOWING_ERROR_ACTUAL, Value::I32(0)),
        input(objects::TARGET_VELOCITY, Value::I32(0)),
    ];
    let ratios = [
        objects::ENCODER_RESOLUTION,
        objects::VELOCITY_RESOLUTION,
        objects::GEAR_RATIO,
        objects::FEED_CONSTANT,
        objects::VELOCITY_FACTOR,
        objects::ACCELERATION_FACTOR,
    ];
    for ratio in ratios {
        entries.push(Entry::constant(ratio, 0, "Highest sub-index", Value::U8(2)));
        for sub in [1, 2] {
            let positive = Allowed::Range(1, i64::from(u32::MAX));
            entries.push(setting(ratio, sub, Value::U32(1)).allowing(positive));
        }
    }
    entries
}

/// Returns 0x60C2 at power-on: one millisecond, or the cell's cycle where it cannot be written.
fn power_on_period(parameters: &DriveParameters) -> (u8, i8) {
    if !parameters.quirks.lacks_interpolation_period {
        return (1, -3);
    }
    let mut exact = [(1, -6), (10, -5), (100, -4), (1000, -3), (10_000, -2)]
        .into_iter()
        .filter_map(|(unit_us, exponent)| {
            let n_units = u8::try_from(parameters.cycle_us / unit_us).ok()?;
            (u32::from(n_units) * unit_us == parameters.cycle_us).then_some((n_units, exponent))
        });
    exact.next().unwrap_or((1, -3))
}

/// Returns the integer nearest to a count, as wide as any object needs.
#[expect(clippy::cast_possible_truncation, reason = "saturates; no count is NaN")]
pub(super) fn rounded(counts: f64) -> i64 {
    counts.round() as i64
}
