//! The layout of one PDO: its objects, and their values in a payload. For the map of a drive, in its parent module.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::MapError;
use crate::fieldbus::canopen::ObjectAddress;
use crate::fieldbus::canopen::pdo::MappedObject;
use crate::fieldbus::cia402::mode::Mode;
use crate::fieldbus::cia402::objects;
use crate::fieldbus::cia402::pdo_map::CommandRpdo1;
use crate::fieldbus::cia402::state::Statusword;
use crate::fieldbus::frame::length_on_bus;

/// Largest number of objects in a PDO.
pub const OBJECTS_MAX: usize = 8;

/// The objects of one PDO, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoLayout {
    objects: [MappedObject; OBJECTS_MAX],
    len: u8,
}

const NOTHING: MappedObject = MappedObject { address: ObjectAddress::new(0, 0), bits: 0 };

impl PdoLayout {
    /// No object: the PDO is not used.
    pub const EMPTY: Self = Self { objects: [NOTHING; OBJECTS_MAX], len: 0 };

    /// Returns the layout of some objects, in their order.
    ///
    /// # Errors
    /// [`MapError::Objects`] if there are more than [`OBJECTS_MAX`].
    pub fn new(objects: &[MappedObject]) -> Result<Self, MapError> {
        let mut layout = Self::EMPTY;
        let found = objects.len();
        let Some(room) = layout.objects.get_mut(..found) else {
            return Err(MapError::Objects { found });
        };
        room.copy_from_slice(objects);
        layout.len = u8::try_from(found).unwrap_or(0);
        Ok(layout)
    }

    /// Returns the objects.
    pub fn objects(&self) -> &[MappedObject] {
        self.objects.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Returns whether the PDO is not used.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the length of the objects.
    pub fn n_bytes(&self) -> usize {
        self.objects().iter().map(|object| usize::from(object.bits / 8)).sum()
    }

    /// Returns the length of its frame: that of the objects, filled up to the next one that CAN FD has.
    pub fn frame_bytes(&self) -> usize {
        length_on_bus(self.n_bytes())
    }

    /// Returns whether an object of sub-index 0 is in it.
    pub fn carries(&self, index: u16) -> bool {
        self.objects().iter().any(|object| object.address == ObjectAddress::new(index, 0))
    }

    pub(super) fn without(self, index: u16) -> Self {
        let mut left = Self::EMPTY;
        let others = self.objects().iter().filter(|object| object.address.index != index);
        for (room, object) in left.objects.iter_mut().zip(others) {
            *room = *object;
            left.len += 1;
        }
        left
    }

    /// Adds an object; one more than there is room for is dropped.
    pub(super) fn add(&mut self, index: u16, bits: u8) {
        if let Some(room) = self.objects.get_mut(usize::from(self.len)) {
            *room = MappedObject { address: ObjectAddress::new(index, 0), bits };
            self.len += 1;
        }
    }

    /// Returns the objects with their bytes in a payload; none if its length is not that of the map.
    fn split<'a>(&'a self, payload: &'a [u8]) -> impl Iterator<Item = (ObjectAddress, &'a [u8])> {
        let mut rest = payload;
        self.objects().iter().map_while(move |object| {
            let (bytes, later) = rest.split_at_checked(usize::from(object.bits / 8))?;
            rest = later;
            Some((object.address, bytes))
        })
    }

    /// Writes a command; returns the bytes used.
    pub fn write(&self, mode: Mode, command: &CommandRpdo1, payload: &mut [u8]) -> usize {
        let mut at = 0;
        for object in self.objects() {
            let n_bytes = usize::from(object.bits / 8);
            let value = match object.address.index {
                objects::CONTROLWORD => i32::from(command.controlword.0),
                // In torque mode it is the target, to which the drive would add its offset.
                objects::TORQUE_OFFSET if mode.targets_torque() => 0,
                objects::TARGET_TORQUE | objects::TORQUE_OFFSET => i32::from(command.torque_offset),
                objects::VELOCITY_OFFSET => command.velocity_offset,
                objects::MODE_OF_OPERATION => i32::from(mode.code()),
                objects::POSITION_OFFSET => 0,
                _ => command.target_counts,
            };
            if let (Some(room), Some(bytes)) =
                (payload.get_mut(at..at + n_bytes), value.to_le_bytes().get(..n_bytes))
            {
                room.copy_from_slice(bytes);
            }
            at += n_bytes;
        }
        at
    }

    /// Reads an answer; `None` if its length is not that of the map.
    pub fn read(&self, payload: &[u8]) -> Option<Reading> {
        if payload.len() != self.frame_bytes() {
            return None;
        }
        let mut reading = Reading::default();
        for (object, bytes) in self.split(payload) {
            if object.sub != 0 {
                continue;
            }
            let word = || bytes.first_chunk().map(|bytes| u16::from_le_bytes(*bytes));
            let long = || bytes.first_chunk().map(|bytes| i32::from_le_bytes(*bytes));
            match object.index {
                objects::STATUSWORD => reading.statusword = word().map(Statusword),
                objects::POSITION_ACTUAL => reading.position_counts = long(),
                objects::VELOCITY_ACTUAL => reading.velocity_counts_s = long(),
                objects::TORQUE_ACTUAL => reading.torque = word().map(u16::cast_signed),
                objects::FOLLOWING_ERROR_ACTUAL => reading.following_error_counts = long(),
                objects::DIGITAL_INPUTS => reading.digital_inputs = long().map(i32::cast_unsigned),
                _ => {}
            }
        }
        Some(reading)
    }
}

/// Values in an answer; `None` for those that it does not carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Reading {
    /// Statusword.
    pub statusword: Option<Statusword>,
    /// Position, in counts.
    pub position_counts: Option<i32>,
    /// Velocity, in counts/s.
    pub velocity_counts_s: Option<i32>,
    /// Torque, in thousandths of the rated torque.
    pub torque: Option<i16>,
    /// Demand minus actual position, in counts.
    pub following_error_counts: Option<i32>,
    /// Digital inputs.
    pub digital_inputs: Option<u32>,
}
