//! The object dictionary: objects, access rights and current values.

use ilc_rt::fieldbus::canopen::{AbortCode, ObjectAddress};
use ilc_rt::fieldbus::frame::PAYLOAD_MAX;

use super::drive_mode::DriveMode;
use super::value::Value;

/// Access to an object by SDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Readable and constant.
    Constant,
    /// Read.
    ReadOnly,
    /// Read and write.
    ReadWrite,
    /// Written only.
    WriteOnly,
}

/// PDOs that may carry an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mappable {
    /// None.
    No,
    /// RPDOs.
    Receive,
    /// TPDOs.
    Transmit,
    /// Both.
    Both,
}

/// Values that an object takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Allowed {
    /// All of its type.
    Any,
    /// A range, both ends included.
    Range(i64, i64),
    /// A list.
    OneOf(&'static [i64]),
    /// A mode of operation, or 0 for none.
    Modes,
}

/// An object.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Address.
    pub address: ObjectAddress,
    /// Name, as in an EDS.
    pub name: &'static str,
    /// Access.
    pub access: Access,
    /// PDOs that may carry it.
    pub mappable: Mappable,
    /// Values that it takes.
    pub allowed: Allowed,
    /// Value at power-on.
    pub power_on: Value,
    factory: Value,
    value: Value,
    written: bool,
    /// Absent for everyone but the node itself.
    is_hidden: bool,
}

impl Entry {
    /// Creates a read-only object.
    pub fn read_only(index: u16, sub: u8, name: &'static str, value: Value) -> Self {
        Self {
            address: ObjectAddress::new(index, sub),
            name,
            access: Access::ReadOnly,
            mappable: Mappable::No,
            allowed: Allowed::Any,
            power_on: value,
            factory: value,
            value,
            written: false,
            is_hidden: false,
        }
    }

    /// Creates a constant object.
    pub fn constant(index: u16, sub: u8, name: &'static str, value: Value) -> Self {
        Self { access: Access::Constant, ..Self::read_only(index, sub, name, value) }
    }

    /// Creates an object that can only be written.
    pub fn write_only(index: u16, sub: u8, name: &'static str, value: Value) -> Self {
        Self { access: Access::WriteOnly, ..Self::read_only(index, sub, name, value) }
    }

    /// Creates a readable and writable object.
    pub fn read_write(index: u16, sub: u8, name: &'static str, value: Value) -> Self {
        Self { access: Access::ReadWrite, ..Self::read_only(index, sub, name, value) }
    }

    /// Sets the PDOs that may carry it.
    #[must_use]
    pub fn mappable(self, mappable: Mappable) -> Self {
        Self { mappable, ..self }
    }

    /// Sets the allowed values.
    #[must_use]
    pub fn allowing(self, allowed: Allowed) -> Self {
        Self { allowed, ..self }
    }

    /// Returns whether the object is absent for everyone but the node itself.
    pub fn is_hidden(&self) -> bool {
        self.is_hidden
    }

    /// Returns the current value.
    pub fn value(&self) -> Value {
        self.value
    }
}

/// Index of an object in its dictionary, looked up once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Slot(usize);

impl Slot {
    /// The first object, which every dictionary has.
    pub const FIRST: Self = Self(0);
}

/// All objects of a node, in order.
#[derive(Clone, Debug)]
pub struct Dictionary {
    entries: Vec<Entry>,
    /// Longest PDO, in bytes.
    payload_max: usize,
    /// Number of changes of values.
    version: u64,
}

impl Dictionary {
    /// Sorts the objects.
    pub fn new(mut entries: Vec<Entry>) -> Self {
        entries.sort_by_key(|entry| entry.address);
        Self { entries, payload_max: PAYLOAD_MAX, version: 0 }
    }

    /// Sets the longest PDO, in bytes: 64 on a bus with CAN FD.
    pub fn take_payloads_of(&mut self, n_bytes: usize) {
        self.payload_max = n_bytes;
    }

    /// Returns the longest PDO, in bytes.
    pub fn payload_max(&self) -> usize {
        self.payload_max
    }

    /// Returns a number that differs after any value was set.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Returns all objects, in order.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Hides an object from the bus, as if the node lacked it; its slots keep working.
    pub fn hide(&mut self, index: u16) {
        for entry in self.entries.iter_mut().filter(|entry| entry.address.index == index) {
            entry.is_hidden = true;
        }
    }

    /// Hides a sub-index from the bus, as if the node lacked it.
    pub fn hide_sub(&mut self, index: u16, sub: u8) {
        let address = ObjectAddress::new(index, sub);
        for entry in self.entries.iter_mut().filter(|entry| entry.address == address) {
            entry.is_hidden = true;
        }
    }

    /// Finds an object.
    ///
    /// # Errors
    /// [`AbortCode::NoObject`], or [`AbortCode::NoSubIndex`] if only the sub-index is missing.
    pub fn find(&self, address: ObjectAddress) -> Result<Slot, AbortCode> {
        match self.entries.binary_search_by_key(&address, |entry| entry.address) {
            Ok(place) if self.entries[place].is_hidden => {
                let is_left = self
                    .entries
                    .iter()
                    .any(|entry| entry.address.index == address.index && !entry.is_hidden);
                Err(if is_left { AbortCode::NoSubIndex } else { AbortCode::NoObject })
            }
            Ok(place) => Ok(Slot(place)),
            Err(place) => {
                let near = [place.checked_sub(1), Some(place)];
                let known = near.into_iter().flatten().any(|place| {
                    self.entries.get(place).is_some_and(|e| e.address.index == address.index)
                });
                Err(if known { AbortCode::NoSubIndex } else { AbortCode::NoObject })
            }
        }
    }

    /// Returns the object at `slot`.
    #[inline]
    pub fn entry(&self, slot: Slot) -> &Entry {
        &self.entries[slot.0]
    }

    /// Returns the value at `slot`, as a number.
    #[inline]
    pub fn number(&self, slot: Slot) -> i64 {
        self.entries[slot.0].value.number()
    }

    /// Sets a value from inside the node, saturated to its type.
    #[inline]
    pub fn set(&mut self, slot: Slot, number: i64) {
        self.version += 1;
        let entry = &mut self.entries[slot.0];
        entry.value = entry.value.with_number(number);
    }

    /// Checks that `bytes` may be written to `slot` by SDO and returns the value they encode.
    ///
    /// # Errors
    /// The abort code of the refusal.
    pub fn check(&self, slot: Slot, bytes: &[u8]) -> Result<Value, AbortCode> {
        let entry = self.entry(slot);
        if !matches!(entry.access, Access::ReadWrite | Access::WriteOnly) {
            return Err(AbortCode::ReadOnly);
        }
        let value = entry.value.decode_like(bytes)?;
        entry.admits(value)?;
        Ok(value)
    }

    /// Stores a value from the bus and marks the object as written.
    pub fn store(&mut self, slot: Slot, value: Value) {
        self.version += 1;
        let entry = &mut self.entries[slot.0];
        entry.value = value;
        entry.written = true;
    }

    /// Stores bytes from a PDO; values that the object does not allow are ignored.
    pub fn store_from_pdo(&mut self, slot: Slot, bytes: &[u8]) {
        let entry = self.entry(slot);
        if let Ok(value) = entry.value.decode_like(bytes)
            && entry.admits(value).is_ok()
        {
            self.store(slot, value);
        }
    }

    /// Returns true if the object was written since the last call, even with an equal value.
    pub fn take_written(&mut self, slot: Slot) -> bool {
        std::mem::take(&mut self.entries[slot.0].written)
    }

    /// Makes the written values the power-on values, as in non-volatile memory.
    pub fn save(&mut self) {
        for entry in &mut self.entries {
            if entry.access == Access::ReadWrite {
                entry.power_on = entry.value;
            }
        }
    }

    /// Restores the factory values, from the next reset on.
    pub fn restore_factory(&mut self) {
        for entry in &mut self.entries {
            entry.power_on = entry.factory;
        }
    }

    /// Resets the objects from `first` to `last` to their power-on values.
    pub fn reset(&mut self, first: u16, last: u16) {
        self.version += 1;
        for entry in &mut self.entries {
            if (first..=last).contains(&entry.address.index) {
                entry.value = entry.power_on;
                entry.written = false;
            }
        }
    }
}

impl Entry {
    fn admits(&self, value: Value) -> Result<(), AbortCode> {
        let number = value.number();
        match self.allowed {
            Allowed::Range(_, high) if number > high => Err(AbortCode::ValueTooHigh),
            Allowed::Range(low, _) if number < low => Err(AbortCode::ValueTooLow),
            Allowed::OneOf(values) if !values.contains(&number) => Err(AbortCode::ValueRange),
            Allowed::Modes if number != 0 && DriveMode::from_code(number).is_none() => {
                Err(AbortCode::ValueRange)
            }
            _ => Ok(()),
        }
    }
}
