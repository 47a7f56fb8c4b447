//! Objects of every simulated node: communication profile and process-data parameters.

use ilc_rt::fieldbus::canopen::NodeId;
use ilc_rt::fieldbus::canopen::pdo::{COB_INVALID, COB_NO_RTR, Direction, MappedObject, PdoNumber};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Allowed, Entry};
use super::value::{Text, Value};

/// Largest number of objects in a PDO.
pub const MAPPED_MAX: u8 = 8;
/// Entries of the error history, 0x1003.
pub const HISTORY_MAX: u8 = 8;

/// The power-on configuration of a PDO.
#[derive(Clone, Copy, Debug)]
pub struct PdoDefault<'a> {
    /// The PDO.
    pub number: PdoNumber,
    /// Transmission type.
    pub transmission: u8,
    /// Event timer, in milliseconds; 0 for none.
    pub event_ms: u16,
    /// Its mapping; empty if it is invalid.
    pub map: &'a [MappedObject],
}

/// Returns the objects from 0x1000 to 0x1200 of a node.
pub fn communication(
    node: NodeId,
    device_type: u32,
    device_name: &str,
    product: u32,
) -> Vec<Entry> {
    let id = u32::from(node.get());
    let text = |text: &str| Value::Text(Text::new(text.as_bytes()));
    let mut entries = vec![
        Entry::constant(objects::DEVICE_TYPE, 0, "Device type", Value::U32(device_type)),
        Entry::read_only(objects::ERROR_REGISTER, 0, "Error register", Value::U8(0)),
        Entry::read_write(objects::ERROR_HISTORY, 0, "Number of errors", Value::U8(0))
            .allowing(Allowed::OneOf(&[0])),
        // Bit 30: this node produces SYNC itself, every 0x1006 microseconds.
        Entry::read_write(objects::COB_ID_SYNC, 0, "COB-ID SYNC", Value::U32(0x80)),
        Entry::read_write(objects::CYCLE_PERIOD, 0, "Communication cycle period", Value::U32(0)),
        Entry::read_write(objects::SYNC_WINDOW, 0, "Synchronous window length", Value::U32(0)),
        Entry::constant(objects::DEVICE_NAME, 0, "Manufacturer device name", text(device_name)),
        Entry::constant(
            objects::HARDWARE_VERSION,
            0,
            "Manufacturer hardware version",
            text("none"),
        ),
        Entry::constant(
            objects::SOFTWARE_VERSION,
            0,
            "Manufacturer software version",
            text(env!("CARGO_PKG_VERSION")),
        ),
        Entry::constant(objects::STORE_PARAMETERS, 0, "Highest sub-index", Value::U8(1)),
        Entry::read_write(objects::STORE_PARAMETERS, 1, "Save all parameters", Value::U32(1)),
        Entry::constant(objects::RESTORE_DEFAULTS, 0, "Highest sub-index", Value::U8(1)),
        Entry::read_write(objects::RESTORE_DEFAULTS, 1, "Restore all defaults", Value::U32(1)),
        // No node guarding: the objects are there, and refuse to be written.
        Entry::constant(objects::GUARD_TIME, 0, "Guard time", Value::U16(0)),
        Entry::constant(objects::LIFE_TIME_FACTOR, 0, "Life time factor", Value::U8(0)),
        Entry::read_write(objects::INHIBIT_TIME_EMCY, 0, "Inhibit time EMCY", Value::U16(0)),
        Entry::constant(objects::VERIFY_CONFIGURATION, 0, "Highest sub-index", Value::U8(2)),
        Entry::read_write(objects::VERIFY_CONFIGURATION, 1, "Configuration date", Value::U32(0)),
        Entry::read_write(objects::VERIFY_CONFIGURATION, 2, "Configuration time", Value::U32(0)),
        Entry::constant(objects::COB_ID_EMCY, 0, "COB-ID EMCY", Value::U32(0x80 + id)),
        Entry::constant(objects::CONSUMER_HEARTBEAT, 0, "Highest sub-index", Value::U8(1)),
        Entry::read_write(objects::CONSUMER_HEARTBEAT, 1, "Consumer heartbeat time", Value::U32(0)),
        Entry::read_write(objects::PRODUCER_HEARTBEAT, 0, "Producer heartbeat time", Value::U16(0)),
        Entry::constant(objects::IDENTITY, 0, "Highest sub-index", Value::U8(4)),
        Entry::constant(objects::IDENTITY, 1, "Vendor-ID", Value::U32(0)),
        Entry::constant(objects::IDENTITY, 2, "Product code", Value::U32(product)),
        Entry::constant(objects::IDENTITY, 3, "Revision number", Value::U32(1)),
        Entry::constant(objects::IDENTITY, 4, "Serial number", Value::U32(id)),
        Entry::read_write(
            objects::SYNC_COUNTER_OVERFLOW,
            0,
            "Synchronous counter overflow value",
            Value::U8(0),
        )
        .allowing(Allowed::Range(0, 240)),
        Entry::constant(objects::ERROR_BEHAVIOUR, 0, "Highest sub-index", Value::U8(1)),
        // 0: to pre-operational, 1: no change, 2: to stopped.
        Entry::read_write(objects::ERROR_BEHAVIOUR, 1, "Communication error", Value::U8(0))
            .allowing(Allowed::Range(0, 2)),
        Entry::constant(objects::SDO_SERVER, 0, "Highest sub-index", Value::U8(2)),
        Entry::constant(objects::SDO_SERVER, 1, "COB-ID client to server", Value::U32(0x600 + id)),
        Entry::constant(objects::SDO_SERVER, 2, "COB-ID server to client", Value::U32(0x580 + id)),
        Entry::read_write(LABEL, 0, "User label", text("")),
    ];
    entries.extend((1..=HISTORY_MAX).map(|sub| {
        Entry::read_only(objects::ERROR_HISTORY, sub, "Standard error field", Value::U32(0))
    }));
    entries
}

/// A writable text: a name for the drive, and a test of segmented downloads.
pub const LABEL: u16 = 0x2000;

/// Returns the communication and mapping parameters of the four PDOs of each direction.
pub fn process_data(node: NodeId, defaults: &[PdoDefault<'_>]) -> Vec<Entry> {
    let numbers = (0..4).map(PdoNumber::receive).chain((0..4).map(PdoNumber::transmit));
    numbers
        .flat_map(|number| {
            let default = defaults.iter().find(|default| default.number == number);
            one_pdo(node, number, default)
        })
        .collect()
}

fn one_pdo(node: NodeId, number: PdoNumber, default: Option<&PdoDefault<'_>>) -> Vec<Entry> {
    let map = default.map_or(&[][..], |default| default.map);
    let invalid = if map.is_empty() { COB_INVALID } else { 0 };
    let cob_id = u32::from(number.default_cob_id(node)) | COB_NO_RTR | invalid;
    let transmission = default.map_or(1, |default| default.transmission);
    let event_ms = default.map_or(0, |default| default.event_ms);
    let communication = number.communication_index();
    let highest = if number.direction == Direction::Transmit { 6 } else { 5 };
    let mut entries = vec![
        Entry::constant(communication, 0, "Highest sub-index", Value::U8(highest)),
        Entry::read_write(communication, 1, "COB-ID", Value::U32(cob_id)),
        Entry::read_write(communication, 2, "Transmission type", Value::U8(transmission)),
        Entry::read_write(communication, 5, "Event timer", Value::U16(event_ms)),
    ];
    if number.direction == Direction::Transmit {
        entries.push(Entry::read_write(communication, 3, "Inhibit time", Value::U16(0)));
        entries.push(
            Entry::read_write(communication, 6, "SYNC start value", Value::U8(0))
                .allowing(Allowed::Range(0, 240)),
        );
    }
    let mapping = number.mapping_index();
    let n_mapped = u8::try_from(map.len()).unwrap_or(MAPPED_MAX);
    entries.push(Entry::read_write(mapping, 0, "Number of mapped objects", Value::U8(n_mapped)));
    entries.extend((1..=MAPPED_MAX).zip(map.iter().map(Some).chain(std::iter::repeat(None))).map(
        |(sub, object)| {
            let entry = object.map_or(0, |object| object.entry());
            Entry::read_write(mapping, sub, "Mapped object", Value::U32(entry))
        },
    ));
    entries
}
