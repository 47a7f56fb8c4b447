//! PDO configuration of a node: PDOs left by others are disabled, those of the loop mapped.

use super::error::BringUpError;
use super::misfit::Found;
use super::remote::Remote;
use super::setting::{Kind, Need, Setting};
use crate::fieldbus::canopen::pdo::{
    COB_INVALID, COB_NO_RTR, Direction, MappedObject, PdoNumber, TYPE_EVERY_SYNC,
};
use crate::fieldbus::cia402::objects;

/// Objects without which the loop runs: torque offset and torque, velocity and following error of the drive.
pub(super) const OPTIONAL: [u16; 4] = [
    objects::TORQUE_OFFSET,
    objects::TORQUE_ACTUAL,
    objects::VELOCITY_ACTUAL,
    objects::FOLLOWING_ERROR_ACTUAL,
];
/// Largest number of PDOs per direction.
const PDOS_MAX: u16 = 512;
/// PDOs that are probed even if an earlier one is missing.
const PDOS_USUAL: u16 = 4;
/// In a COB-ID entry: the identifier.
const IDENTIFIER: u32 = 0x1FFF_FFFF;

/// Disables every PDO of the node, whatever its identifier.
///
/// A left-over RPDO would take targets of another master from the bus, and a TPDO would cost bus
/// time unknown to the load check.
pub(super) fn close_all(remote: &mut Remote<'_>) -> Result<(), BringUpError> {
    for first in [PdoNumber::receive(0), PdoNumber::transmit(0)] {
        for offset in 0..PDOS_MAX {
            let index = first.communication_index() + offset;
            match remote.find("switching off PDOs", index, 1)? {
                None if offset >= PDOS_USUAL => break,
                None => {}
                Some(cob_id) if cob_id & COB_INVALID != 0 => {}
                Some(cob_id) => {
                    let off = i64::from(cob_id | COB_INVALID);
                    remote.ensure(&Setting::new(index, 1, Kind::U32, Need::Exactly(off)))?;
                }
            }
        }
    }
    Ok(())
}

/// Maps a disabled PDO and enables it: transmission type, times, objects, identifier.
///
/// A command is expected at least every `deadline_ms`, unless that is 0.
pub(super) fn open(
    remote: &mut Remote<'_>,
    number: PdoNumber,
    map: &[MappedObject],
    deadline_ms: u16,
) -> Result<(), BringUpError> {
    let communication = number.communication_index();
    let every_sync = Need::Exactly(i64::from(TYPE_EVERY_SYNC));
    remote.ensure(
        &Setting::new(communication, 2, Kind::U8, every_sync).needed("to be read at every SYNC"),
    )?;
    let timer = Setting::new(communication, 5, Kind::U16, Need::Exactly(deadline_ms.into()));
    match number.direction {
        Direction::Receive if deadline_ms > 0 => {
            remote.ensure(&timer.needed("to stop when commands stop coming"))?;
        }
        Direction::Receive => {
            remote.ensure(&timer)?;
        }
        Direction::Transmit => remote.ensure_all(&[
            Setting::new(communication, 3, Kind::U16, Need::Exactly(0)),
            timer,
            Setting::new(communication, 6, Kind::U8, Need::Exactly(0)),
        ])?,
    }
    let step = "mapping process data";
    if !is_mapped(remote, step, number, map)? {
        let mapping = number.mapping_index();
        remote.write(step, mapping, 0, &[0])?;
        let mut n_objects = 0;
        for object in map {
            n_objects += 1;
            remote.write(step, mapping, n_objects, &object.entry().to_le_bytes())?;
        }
        remote.write(step, mapping, 0, &[n_objects])?;
        for (sub, object) in (1..).zip(map) {
            let entry = Need::Exactly(object.entry().into());
            remote.ensure(&Setting::new(mapping, sub, Kind::U32, entry))?;
        }
    }
    let cob_id = u32::from(number.default_cob_id(remote.node));
    remote.write(step, communication, 1, &(cob_id | COB_NO_RTR).to_le_bytes())?;
    let found = remote.read(step, communication, 1)?;
    if found & (COB_INVALID | IDENTIFIER) == cob_id {
        return Ok(());
    }
    let setting = Setting::new(communication, 1, Kind::U32, Need::Exactly(cob_id.into()));
    Err(remote.unfit(&setting, Found::Number(found.into()), None))
}

/// Returns whether the node has this very mapping already.
fn is_mapped(
    remote: &mut Remote<'_>,
    step: &'static str,
    number: PdoNumber,
    map: &[MappedObject],
) -> Result<bool, BringUpError> {
    let mapping = number.mapping_index();
    if usize::try_from(remote.read(step, mapping, 0)?) != Ok(map.len()) {
        return Ok(false);
    }
    for (sub, object) in (1..).zip(map) {
        if remote.find(step, mapping, sub)? != Some(object.entry()) {
            return Ok(false);
        }
    }
    Ok(true)
}
