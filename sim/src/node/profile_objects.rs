//! The objects of a drive's own profiles, of homing and of its inputs and outputs.

use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Allowed, Entry};
use super::drive::DriveParameters;
use super::drive_objects::{input, output, rounded, setting};
use super::homing;
use super::value::Value;

/// Further digital inputs that are on, as bits of 0x60FD: what a cable would do to a real drive.
pub use ilc_rt::fieldbus::network::SIMULATED_INPUTS;

/// Writing an error code makes the drive fail with it.
pub const SIMULATED_FAULT: u16 = 0x2002;

/// Share of the velocity limit with which a profile moves at power-on.
const PROFILE_SHARE: f64 = 0.5;
/// Share of the velocity limit with which homing searches a switch at power-on.
const HOMING_SHARE: f64 = 0.1;
/// Share of the velocity limit with which homing searches an edge at power-on.
const CREEP_SHARE: f64 = 0.01;
/// Position window at power-on.
const WINDOW_M: f64 = 1e-4;
/// Velocity window, and threshold of standstill, at power-on.
const WINDOW_M_S: f64 = 1e-3;
/// Time within a window at power-on, in milliseconds.
const WINDOW_MS: u16 = 5;
/// Highest value of a 32-bit object.
const U32_MAX: i64 = 0xFFFF_FFFF;

/// Returns the objects.
pub(super) fn all(parameters: &DriveParameters) -> Vec<Entry> {
    let unsigned = |value_si: f64| {
        Value::U32(0).with_number(rounded(value_si * parameters.counts_per_m.abs()).max(1))
    };
    let short = |value_si: f64| {
        Value::U16(0).with_number(rounded(value_si * parameters.counts_per_m.abs()).max(1))
    };
    let speed = |share: f64| unsigned(share * parameters.velocity_max_m_s);
    let positive = Allowed::Range(1, U32_MAX);
    let speeds = objects::HOMING_SPEEDS;
    let outputs = objects::DIGITAL_OUTPUTS;
    let mut entries = vec![
        setting(objects::POSITION_WINDOW, 0, unsigned(WINDOW_M)),
        setting(objects::POSITION_WINDOW_TIME, 0, Value::U16(WINDOW_MS)),
        setting(objects::VELOCITY_WINDOW, 0, short(WINDOW_M_S)),
        setting(objects::VELOCITY_WINDOW_TIME, 0, Value::U16(WINDOW_MS)),
        setting(objects::VELOCITY_THRESHOLD, 0, short(WINDOW_M_S)),
        setting(objects::VELOCITY_THRESHOLD_TIME, 0, Value::U16(WINDOW_MS)),
        input(objects::PROFILE_VELOCITY, speed(PROFILE_SHARE)),
        // 0: a trapezoidal velocity profile.
        setting(objects::PROFILE_TYPE, 0, Value::I16(0)).allowing(Allowed::OneOf(&[0])),
        setting(objects::HOMING_METHOD, 0, Value::I8(0)).allowing(Allowed::OneOf(&homing::METHODS)),
        Entry::constant(speeds, 0, "Highest sub-index", Value::U8(2)),
        setting(speeds, 1, speed(HOMING_SHARE)).allowing(positive),
        setting(speeds, 2, speed(CREEP_SHARE)).allowing(positive),
        setting(objects::HOMING_ACCELERATION, 0, unsigned(parameters.deceleration_m_s2))
            .allowing(positive),
        // Bits 0 and 1: limit switches, 2: home switch, 3: interlock, 16 to 31: the maker's.
        output(objects::DIGITAL_INPUTS, Value::U32(0)),
        Entry::constant(outputs, 0, "Highest sub-index", Value::U8(2)),
        // Bit 0: the brake is applied.
        input_of(outputs, 1, Value::U32(1)),
        setting(outputs, 2, Value::U32(0xFFFF_0000)),
        Entry::read_write(
            SIMULATED_INPUTS,
            0,
            "Simulated digital inputs",
            Value::U32(parameters.inputs),
        ),
        Entry::write_only(SIMULATED_FAULT, 0, "Simulated fault", Value::U16(0)),
    ];
    let methods = objects::HOMING_METHODS;
    let implemented = homing::METHODS.iter().filter(|method| **method != 0);
    let n_methods = u8::try_from(implemented.clone().count()).unwrap_or(u8::MAX);
    entries.push(Entry::constant(methods, 0, "Highest sub-index", Value::U8(n_methods)));
    for (sub, method) in (1..).zip(implemented) {
        let code = Value::I8(0).with_number(*method);
        entries.push(Entry::constant(methods, sub, "Supported homing method", code));
    }
    entries
}

/// Creates one part of an object that the controller writes, also by RPDO.
fn input_of(index: u16, sub: u8, value: Value) -> Entry {
    setting(index, sub, value).mappable(super::dictionary::Mappable::Both)
}
