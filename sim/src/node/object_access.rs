//! The dictionary as the SDO server sees it: with the rules of single objects.

use ilc_rt::fieldbus::canopen::{AbortCode, ObjectAddress};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Access, Dictionary};
use super::pdo_rules;
use super::sdo_server::Objects;
use super::value::Value;

/// "save", as it is written to 0x1010.
const SAVE: i64 = 0x6576_6173;
/// "load", as it is written to 0x1011.
const LOAD: i64 = 0x6461_6F6C;
/// Bit 8 of the controlword.
const HALT: i64 = 1 << 8;

/// The dictionary during one SDO request.
pub(super) struct ObjectAccess<'a> {
    pub(super) dictionary: &'a mut Dictionary,
    /// The mode cannot be changed while the halt bit is set.
    pub(super) keeps_mode_under_halt: bool,
    /// The object that was written.
    pub(super) written: Option<ObjectAddress>,
}

impl Objects for ObjectAccess<'_> {
    fn read(&self, address: ObjectAddress) -> Result<Value, AbortCode> {
        let entry = self.dictionary.entry(self.dictionary.find(address)?);
        if entry.access == Access::WriteOnly {
            return Err(AbortCode::WriteOnly);
        }
        Ok(entry.value())
    }

    fn shape(&self, address: ObjectAddress) -> Result<Value, AbortCode> {
        self.dictionary.find(address).map(|slot| self.dictionary.entry(slot).value())
    }

    fn write(&mut self, address: ObjectAddress, bytes: &[u8]) -> Result<(), AbortCode> {
        let slot = self.dictionary.find(address)?;
        let value = self.dictionary.check(slot, bytes)?;
        pdo_rules::check(self.dictionary, address, value.number())?;
        if address.index == objects::MODE_OF_OPERATION && self.keeps_mode_under_halt {
            refuse_under_halt(self.dictionary)?;
        }
        match (address.index, value.number()) {
            (objects::STORE_PARAMETERS, SAVE) => self.dictionary.save(),
            (objects::RESTORE_DEFAULTS, LOAD) => self.dictionary.restore_factory(),
            (objects::STORE_PARAMETERS | objects::RESTORE_DEFAULTS, _) => {
                return Err(AbortCode::CannotStore);
            }
            _ => self.dictionary.store(slot, value),
        }
        self.written = Some(address);
        Ok(())
    }
}

/// Refuses while the halt bit of the controlword is set.
pub(super) fn refuse_under_halt(dictionary: &Dictionary) -> Result<(), AbortCode> {
    let controlword = dictionary.find(ObjectAddress::new(objects::CONTROLWORD, 0))?;
    if dictionary.number(controlword) & HALT == 0 { Ok(()) } else { Err(AbortCode::DeviceState) }
}
