//! The process data of a drive as data: which objects its PDOs carry, and their values in a frame.
//!
//! A [`PdoMap`] is chosen at set-up ([`PdoMap::choose`], or object by object), mapped by `bring_up`, and read
//! and written in every tick by `network::canopen`: by value, without allocation. Little-endian throughout.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

mod layout;

pub use layout::{OBJECTS_MAX, PdoLayout, Reading};

use super::mode::Mode;
use super::objects;
use crate::fieldbus::canopen::ObjectAddress;

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

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests;
