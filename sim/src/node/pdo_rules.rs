//! Rules that refuse writes to process-data parameters.

use ilc_rt::fieldbus::canopen::pdo::{COB_INVALID, COB_NO_RTR, Direction, MappedObject, PdoNumber};
use ilc_rt::fieldbus::canopen::{AbortCode, ObjectAddress};

use super::dictionary::{Dictionary, Mappable};
use super::standard_objects::MAPPED_MAX;

/// Returns the PDO whose parameters are at `index`, if there is one.
pub fn pdo_at(index: u16) -> Option<PdoNumber> {
    let offset = u8::try_from(index & 0x1FF).ok().filter(|offset| *offset < 4)?;
    match index & 0xFE00 {
        0x1400 | 0x1600 => Some(PdoNumber::receive(offset)),
        0x1800 | 0x1A00 => Some(PdoNumber::transmit(offset)),
        _ => None,
    }
}

/// Checks a write of `number` to a process-data parameter; all other objects pass.
///
/// A mapping is written while the PDO is disabled and its number of objects is zero; writing the
/// final number checks the whole mapping.
///
/// # Errors
/// The abort code of the refusal.
pub fn check(
    dictionary: &Dictionary,
    address: ObjectAddress,
    number: i64,
) -> Result<(), AbortCode> {
    let Some(pdo) = pdo_at(address.index) else { return Ok(()) };
    let value = u32::try_from(number).map_err(|_| AbortCode::ValueRange)?;
    if address.index == pdo.communication_index() {
        return match address.sub {
            1 => check_cob_id(parameter(dictionary, address), value),
            2 if (241..=253).contains(&value) => Err(AbortCode::ValueRange),
            3 | 6 if is_valid(dictionary, pdo) => Err(AbortCode::DeviceState),
            _ => Ok(()),
        };
    }
    if is_valid(dictionary, pdo) {
        return Err(AbortCode::DeviceState);
    }
    let n_mapped = parameter(dictionary, ObjectAddress::new(address.index, 0));
    match address.sub {
        0 => check_count(dictionary, pdo, value),
        _ if n_mapped != 0 => Err(AbortCode::UnsupportedAccess),
        _ if value == 0 => Ok(()),
        _ => check_object(dictionary, pdo.direction, value).map(|_| ()),
    }
}

/// Returns whether the PDO exists on the bus.
pub fn is_valid(dictionary: &Dictionary, pdo: PdoNumber) -> bool {
    parameter(dictionary, ObjectAddress::new(pdo.communication_index(), 1)) & COB_INVALID == 0
}

/// Returns the current value of a parameter; 0 if it does not exist.
pub fn parameter(dictionary: &Dictionary, address: ObjectAddress) -> u32 {
    let number = dictionary.find(address).map_or(0, |slot| dictionary.number(slot));
    u32::try_from(number).unwrap_or(0)
}

fn check_cob_id(present: u32, wanted: u32) -> Result<(), AbortCode> {
    let identifier = wanted & !(COB_INVALID | COB_NO_RTR);
    // Bit 29 requests 29-bit identifiers; the others are reserved for NMT, SYNC, EMCY, SDO and
    // heartbeat.
    let reserved = matches!(
        identifier,
        0..=0x17F | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..=0x77F | 0x780..
    );
    if reserved {
        return Err(AbortCode::ValueRange);
    }
    let stays_valid = (present | wanted) & COB_INVALID == 0;
    let present_identifier = present & !(COB_INVALID | COB_NO_RTR);
    if stays_valid && identifier != present_identifier {
        return Err(AbortCode::DeviceState);
    }
    Ok(())
}

fn check_count(dictionary: &Dictionary, pdo: PdoNumber, count: u32) -> Result<(), AbortCode> {
    let count = u8::try_from(count).ok().filter(|count| *count <= MAPPED_MAX);
    let count = count.ok_or(AbortCode::PdoTooLong)?;
    let mut n_bytes = 0_usize;
    for sub in 1..=count {
        let entry = parameter(dictionary, ObjectAddress::new(pdo.mapping_index(), sub));
        n_bytes += usize::from(check_object(dictionary, pdo.direction, entry)?);
    }
    if n_bytes > dictionary.payload_max() { Err(AbortCode::PdoTooLong) } else { Ok(()) }
}

/// Returns the length in bytes of the object of a mapping entry, if the PDO may carry it.
fn check_object(
    dictionary: &Dictionary,
    direction: Direction,
    entry: u32,
) -> Result<u8, AbortCode> {
    let mapped = MappedObject::from_entry(entry);
    let object = dictionary.entry(dictionary.find(mapped.address)?);
    let fits = match direction {
        Direction::Receive => matches!(object.mappable, Mappable::Receive | Mappable::Both),
        Direction::Transmit => matches!(object.mappable, Mappable::Transmit | Mappable::Both),
    };
    if !fits || usize::from(mapped.bits) != 8 * object.value().len() {
        return Err(AbortCode::NotMappable);
    }
    Ok(mapped.bits / 8)
}
