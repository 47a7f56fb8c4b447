//! The process data of a drive as data: which objects its PDOs carry, and their values in a frame.
//!
//! A [`PdoMap`] is chosen at set-up ([`PdoMap::choose`], or object by object), mapped by `bring_up`, and read
//! and written in every tick by `network::canopen`: by value, without allocation. Little-endian throughout.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::mode::Mode;
use super::objects;
use super::pdo_map::CommandRpdo1;
use super::state::Statusword;
use crate::fieldbus::canopen::ObjectAddress;
use crate::fieldbus::canopen::pdo::MappedObject;
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

/// Reason that a map cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MapError {
    /// Too many objects.
    #[error("a PDO of {found} objects is not allowed: at most {OBJECTS_MAX}")]
    Objects {
        /// Their number.
        found: usize,
    },
    /// Too many bytes.
    #[error("a PDO of {found} bytes is not allowed: at most {max} fit a frame of this bus")]
    Bytes {
        /// Its length.
        found: usize,
        /// Largest length.
        max: usize,
    },
    /// An object of another length than the profile gives it.
    #[error("object {object} with {bits} bits is not allowed: it has {needed}")]
    Bits {
        /// Object.
        object: ObjectAddress,
        /// Length in the map.
        bits: u8,
        /// Length in the profile; for others whole bytes.
        needed: &'static str,
    },
    /// An object that a command cannot carry.
    #[error(
        "object {object} in a command is not allowed: 0x6040, the target of the mode, 0x60B0, 0x60B1, \
         0x60B2 and 0x6060 are"
    )]
    NotACommand {
        /// Object.
        object: ObjectAddress,
    },
    /// A missing object.
    #[error("the map has no object {object}, which every {what} needs")]
    Missing {
        /// Object.
        object: ObjectAddress,
        /// RPDO1 or TPDO1.
        what: &'static str,
    },
}

/// Objects that a drive, or a bus, can do without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(clippy::struct_excessive_bools, reason = "a set of four objects")]
pub struct OptionalObjects {
    /// Torque offset (0x60B2) in the command.
    pub torque_offset: bool,
    /// Torque (0x6077).
    pub torque: bool,
    /// Velocity (0x606C).
    pub velocity: bool,
    /// Following error (0x60F4).
    pub following_error: bool,
}

impl OptionalObjects {
    /// All of them.
    pub const ALL: Self =
        Self { torque_offset: true, torque: true, velocity: true, following_error: true };
    /// None of them: the smallest map.
    pub const NONE: Self =
        Self { torque_offset: false, torque: false, velocity: false, following_error: false };

    /// Returns those in both sets: wanted, and supported.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self {
            torque_offset: self.torque_offset && other.torque_offset,
            torque: self.torque && other.torque,
            velocity: self.velocity && other.velocity,
            following_error: self.following_error && other.following_error,
        }
    }
}

/// Way in which a drive notices that commands stop coming.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Supervision {
    /// By the time-out of its commands (event timer of RPDO1), where it is set.
    #[default]
    Commands,
    /// By the heartbeat of the controller: the drive has no such time-out, which CiA 301 makes optional.
    Heartbeat,
}

/// The process data of a drive: RPDO1 carries the command, TPDO1 state and position, TPDO2 what does not
/// fit there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoMap {
    /// RPDO1.
    pub command: PdoLayout,
    /// RPDO2, which carries a velocity offset; empty for a drive that gets none: it is not sent then.
    pub offset: PdoLayout,
    /// TPDO1 and TPDO2; the second one may be empty: it is not sent then.
    pub answers: [PdoLayout; 2],
    /// Supervision of the commands.
    pub supervision: Supervision,
}

impl PdoMap {
    /// Returns the smallest map of a mode with the objects that are wanted and supported, in frames of up
    /// to `bytes_max` (8, or 64 with CAN FD).
    ///
    /// Command: 6040, target, 60B2. TPDO1: 6041, 6064, then 6077, 606C and 60F4 as far as they fit; the rest
    /// is in TPDO2.
    pub fn choose(
        mode: Mode,
        wanted: OptionalObjects,
        supported: OptionalObjects,
        bytes_max: usize,
    ) -> Self {
        let extra = wanted.and(supported);
        let [controlword, long, word] = mode.command_objects();
        let mut command = PdoLayout::EMPTY;
        command.add(controlword, 16);
        // All three if the optional one, whichever it is in this mode, is there.
        for (index, bits) in [(long, 32), (word, 16)] {
            if extra.torque_offset || index == mode.target().0 {
                command.add(index, bits);
            }
        }
        let mut status = PdoLayout::EMPTY;
        status.add(objects::STATUSWORD, 16);
        status.add(objects::POSITION_ACTUAL, 32);
        let mut motion = PdoLayout::EMPTY;
        for (is_there, index, bits) in [
            (extra.torque, objects::TORQUE_ACTUAL, 16),
            (extra.velocity, objects::VELOCITY_ACTUAL, 32),
            (extra.following_error, objects::FOLLOWING_ERROR_ACTUAL, 32),
        ] {
            if !is_there {
                continue;
            }
            if motion.is_empty() && status.n_bytes() + usize::from(bits / 8) <= bytes_max {
                status.add(index, bits);
            } else {
                motion.add(index, bits);
            }
        }
        let answers = [status, motion];
        Self { command, offset: PdoLayout::EMPTY, answers, supervision: Supervision::default() }
    }

    /// Returns the map with the velocity offset (0x60B1): in RPDO2, unless the command carries it.
    #[must_use]
    pub fn with_velocity_offset(mut self) -> Self {
        if !self.carries(objects::VELOCITY_OFFSET) {
            self.offset.add(objects::VELOCITY_OFFSET, 32);
        }
        self
    }

    /// Returns the map with everything that the profile offers, on classical CAN: three PDOs of 8 bytes.
    pub fn full(mode: Mode) -> Self {
        Self::choose(mode, OptionalObjects::ALL, OptionalObjects::ALL, 8)
    }

    /// Returns the smallest map: two PDOs of 6 bytes.
    pub fn small(mode: Mode) -> Self {
        Self::choose(mode, OptionalObjects::NONE, OptionalObjects::ALL, 8)
    }

    /// Returns the map of a homing: a command without a target, as the drive makes its own.
    pub fn of_homing() -> Self {
        let mut command = PdoLayout::EMPTY;
        command.add(objects::CONTROLWORD, 16);
        let mut status = PdoLayout::EMPTY;
        status.add(objects::STATUSWORD, 16);
        status.add(objects::POSITION_ACTUAL, 32);
        let (offset, answers) = (PdoLayout::EMPTY, [status, PdoLayout::EMPTY]);
        Self { command, offset, answers, supervision: Supervision::default() }
    }

    /// Returns the map with the digital inputs (0x60FD) in its answers, if it has none yet: where they fit into
    /// TPDO1 or TPDO2 of up to `bytes_max`, or in the place of the velocity, which the loop can do without.
    #[must_use]
    pub fn with_inputs(self, bytes_max: usize) -> Self {
        if self.carries(objects::DIGITAL_INPUTS) {
            return self;
        }
        let added = |mut map: Self, part: usize| {
            let layout = map.answers.get_mut(part)?;
            layout.add(objects::DIGITAL_INPUTS, 32);
            (layout.n_bytes() <= bytes_max && layout.carries(objects::DIGITAL_INPUTS))
                .then_some(map)
        };
        added(self, 0)
            .or_else(|| added(self, 1))
            .or_else(|| added(self.without(objects::VELOCITY_ACTUAL), 1))
            .unwrap_or(self)
    }

    /// Checks a map that was put together object by object, for frames of up to `bytes_max`.
    ///
    /// # Errors
    /// [`MapError`] for an object that is missing, has the wrong length, or cannot be commanded.
    pub fn check(&self, mode: Mode, bytes_max: usize) -> Result<(), MapError> {
        let (target, target_bits) = mode.target();
        for layout in [&self.command, &self.offset, &self.answers[0], &self.answers[1]] {
            if layout.n_bytes() > bytes_max {
                return Err(MapError::Bytes { found: layout.n_bytes(), max: bytes_max });
            }
            for object in layout.objects() {
                let needed = match object.address.index {
                    objects::CONTROLWORD
                    | objects::STATUSWORD
                    | objects::TARGET_TORQUE
                    | objects::TORQUE_OFFSET
                    | objects::TORQUE_ACTUAL => (16, "16"),
                    objects::POSITION_ACTUAL
                    | objects::VELOCITY_ACTUAL
                    | objects::FOLLOWING_ERROR_ACTUAL
                    | objects::DIGITAL_INPUTS
                    | objects::POSITION_OFFSET
                    | objects::VELOCITY_OFFSET => (32, "32"),
                    objects::MODE_OF_OPERATION => (8, "8"),
                    index if index == target => (target_bits, "32"),
                    objects::TARGET_POSITION => (32, "32"),
                    // Of others the value is skipped.
                    _ => (object.bits.next_multiple_of(8).max(8), "whole bytes"),
                };
                if object.bits != needed.0 {
                    let (object, bits) = (object.address, object.bits);
                    return Err(MapError::Bits { object, bits, needed: needed.1 });
                }
            }
        }
        let [_, long, _] = mode.command_objects();
        let commands = [
            objects::CONTROLWORD,
            target,
            long,
            objects::POSITION_OFFSET,
            objects::VELOCITY_OFFSET,
            objects::TORQUE_OFFSET,
            objects::MODE_OF_OPERATION,
        ];
        if let Some(other) =
            self.command.objects().iter().find(|object| !commands.contains(&object.address.index))
        {
            return Err(MapError::NotACommand { object: other.address });
        }
        for (layout, index, what) in [
            (&self.command, objects::CONTROLWORD, "RPDO1"),
            (&self.command, target, "RPDO1"),
            (&self.answers[0], objects::STATUSWORD, "TPDO1"),
            (&self.answers[0], objects::POSITION_ACTUAL, "TPDO1"),
        ] {
            if !layout.carries(index) {
                return Err(MapError::Missing { object: ObjectAddress::new(index, 0), what });
            }
        }
        Ok(())
    }

    /// Returns whether a PDO carries an object of sub-index 0.
    pub fn carries(&self, index: u16) -> bool {
        self.command.carries(index)
            || self.offset.carries(index)
            || self.answers.iter().any(|answer| answer.carries(index))
    }

    /// Returns the map without an object.
    #[must_use]
    pub fn without(self, index: u16) -> Self {
        let [first, second] = self.answers;
        Self {
            command: self.command.without(index),
            offset: self.offset.without(index),
            answers: [first.without(index), second.without(index)],
            supervision: self.supervision,
        }
    }

    /// Returns the lengths of the frames of a cycle, in bytes: commands, then answers.
    pub fn frame_bytes(&self) -> impl Iterator<Item = usize> {
        let [first, second] = self.answers;
        [self.command, self.offset, first, second]
            .into_iter()
            .filter(|layout| !layout.is_empty())
            .map(|layout| layout.frame_bytes())
    }
}

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

    fn without(self, index: u16) -> Self {
        let mut left = Self::EMPTY;
        let others = self.objects().iter().filter(|object| object.address.index != index);
        for (room, object) in left.objects.iter_mut().zip(others) {
            *room = *object;
            left.len += 1;
        }
        left
    }

    /// Adds an object; one more than there is room for is dropped.
    fn add(&mut self, index: u16, bits: u8) {
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
                objects::TARGET_TORQUE | objects::TORQUE_OFFSET => {
                    i32::from(command.torque_offset)
                }
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

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests;
