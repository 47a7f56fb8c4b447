//! The fixed process-data maps, eight bytes each, and their codecs.
//!
//! | PDO | bytes 0–1 | 2–5 | 6–7 |
//! |---|---|---|---|
//! | RPDO1, CSP | 6040 controlword | 607A target position | 60B2 torque offset |
//! | RPDO1, CSV | 6040 controlword | 60FF target velocity | 60B2 torque offset |
//! | RPDO1, CST | 6040 controlword | 607A demanded position | 6071 target torque |
//! | TPDO1 | 6041 statusword | 6064 position | 6077 torque |
//!
//! RPDO2, for drives that get a velocity offset only, is 60B1, 32 bits; it has no codec here, as it is
//! written by `process_data` alone.
//! TPDO2 is 606C velocity and 60F4 following error, 32 bits each; TPDO1 of an encoder node is two
//! positions of 32 bits. Little-endian throughout.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::mode::Mode;
use super::objects;
use super::state::{Controlword, Statusword};
use crate::fieldbus::Frame;
use crate::fieldbus::canopen::pdo::{MappedObject, PdoNumber};
use crate::fieldbus::canopen::{NodeId, ObjectAddress};

/// The PDO that carries [`CommandRpdo1`].
pub const COMMAND_PDO: PdoNumber = PdoNumber::receive(0);
/// The PDO that carries the velocity offset.
pub const OFFSET_PDO: PdoNumber = PdoNumber::receive(1);
/// The PDO that carries [`StatusTpdo1`].
pub const STATUS_PDO: PdoNumber = PdoNumber::transmit(0);
/// The PDO that carries [`DriveMotionTpdo2`].
pub const DRIVE_MOTION_PDO: PdoNumber = PdoNumber::transmit(1);
/// The PDO of an encoder node that carries [`EncoderSample`].
pub const ENCODER_PDO: PdoNumber = PdoNumber::transmit(0);

/// The mapping of [`STATUS_PDO`].
pub const STATUS_MAP: [MappedObject; 3] = [
    mapped(objects::STATUSWORD, 0, 16),
    mapped(objects::POSITION_ACTUAL, 0, 32),
    mapped(objects::TORQUE_ACTUAL, 0, 16),
];
/// The mapping of [`DRIVE_MOTION_PDO`].
pub const DRIVE_MOTION_MAP: [MappedObject; 2] =
    [mapped(objects::VELOCITY_ACTUAL, 0, 32), mapped(objects::FOLLOWING_ERROR_ACTUAL, 0, 32)];
/// The mapping of [`ENCODER_PDO`].
pub const ENCODER_MAP: [MappedObject; 2] =
    [mapped(objects::ENCODER_POSITIONS, 1, 32), mapped(objects::ENCODER_POSITIONS, 2, 32)];

/// Returns the mapping of [`COMMAND_PDO`] in `mode`.
pub const fn command_map(mode: Mode) -> [MappedObject; 3] {
    let [word, long, last] = mode.command_objects();
    [mapped(word, 0, 16), mapped(long, 0, 32), mapped(last, 0, 16)]
}

const fn mapped(index: u16, sub: u8, bits: u8) -> MappedObject {
    MappedObject { address: ObjectAddress::new(index, sub), bits }
}

/// RPDO1 of a drive: the command of every cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct CommandRpdo1 {
    /// Controlword.
    pub controlword: Controlword,
    /// Target: position in counts (CSP), velocity in counts/s (CSV); demanded position (CST).
    pub target_counts: i32,
    /// Torque feed-forward, target torque in CST, thousandths of the rated torque.
    pub torque_offset: i16,
    /// Velocity feed-forward, in counts/s: in RPDO2.
    pub velocity_offset: i32,
}

/// TPDO1 of a drive: its status in every cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct StatusTpdo1 {
    /// Statusword.
    pub statusword: Statusword,
    /// Position, in counts.
    pub position_counts: i32,
    /// Torque, thousandths of the rated torque.
    pub torque: i16,
}

/// TPDO2 of a drive: its motion in every cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct DriveMotionTpdo2 {
    /// Velocity, in counts/s.
    pub velocity_counts_s: i32,
    /// Demand minus actual position, in counts.
    pub following_error_counts: i32,
}

/// TPDO1 of an encoder node: its positions in every cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct EncoderSample {
    /// First coordinate, in counts.
    pub x_counts: i32,
    /// Second coordinate, in counts.
    pub y_counts: i32,
}

impl CommandRpdo1 {
    /// Returns the frame of this command to `node`.
    pub fn encode(self, node: NodeId) -> Frame {
        frame(
            COMMAND_PDO,
            node,
            word_long_word(self.controlword.0, self.target_counts, self.torque_offset),
        )
    }

    /// Returns the command if `frame` is a command to `node`.
    pub fn decode(frame: &Frame, node: NodeId) -> Option<Self> {
        let (word, target_counts, torque_offset) =
            split_word_long_word(payload(frame, COMMAND_PDO, node)?);
        Some(Self {
            controlword: Controlword(word),
            target_counts,
            torque_offset,
            ..Self::default()
        })
    }
}

impl StatusTpdo1 {
    /// Returns the frame of this status from `node`.
    pub fn encode(self, node: NodeId) -> Frame {
        frame(
            STATUS_PDO,
            node,
            word_long_word(self.statusword.0, self.position_counts, self.torque),
        )
    }

    /// Returns the status if `frame` is a status of `node`.
    pub fn decode(frame: &Frame, node: NodeId) -> Option<Self> {
        let (word, position_counts, torque) =
            split_word_long_word(payload(frame, STATUS_PDO, node)?);
        Some(Self { statusword: Statusword(word), position_counts, torque })
    }
}

impl DriveMotionTpdo2 {
    /// Returns the frame of this data from `node`.
    pub fn encode(self, node: NodeId) -> Frame {
        frame(
            DRIVE_MOTION_PDO,
            node,
            two_longs(self.velocity_counts_s, self.following_error_counts),
        )
    }

    /// Returns the data if `frame` is motion data of `node`.
    pub fn decode(frame: &Frame, node: NodeId) -> Option<Self> {
        let (velocity_counts_s, following_error_counts) =
            split_two_longs(payload(frame, DRIVE_MOTION_PDO, node)?);
        Some(Self { velocity_counts_s, following_error_counts })
    }
}

impl EncoderSample {
    /// Returns the frame of this sample from `node`.
    pub fn encode(self, node: NodeId) -> Frame {
        frame(ENCODER_PDO, node, two_longs(self.x_counts, self.y_counts))
    }

    /// Returns the sample if `frame` is a sample of `node`.
    pub fn decode(frame: &Frame, node: NodeId) -> Option<Self> {
        let (x_counts, y_counts) = split_two_longs(payload(frame, ENCODER_PDO, node)?);
        Some(Self { x_counts, y_counts })
    }
}

fn frame(number: PdoNumber, node: NodeId, payload: [u8; 8]) -> Frame {
    // A PDO identifier is at most 0x57F and the payload 8 bytes: always a frame.
    Frame::new(number.default_cob_id(node), &payload).unwrap_or_default()
}

fn payload(frame: &Frame, number: PdoNumber, node: NodeId) -> Option<[u8; 8]> {
    if frame.id() != number.default_cob_id(node) {
        return None;
    }
    frame.payload().try_into().ok()
}

fn word_long_word(word: u16, long: i32, last: i16) -> [u8; 8] {
    let ([a, b], [c, d, e, f], [g, h]) =
        (word.to_le_bytes(), long.to_le_bytes(), last.to_le_bytes());
    [a, b, c, d, e, f, g, h]
}

fn split_word_long_word([a, b, c, d, e, f, g, h]: [u8; 8]) -> (u16, i32, i16) {
    (u16::from_le_bytes([a, b]), i32::from_le_bytes([c, d, e, f]), i16::from_le_bytes([g, h]))
}

fn two_longs(first: i32, second: i32) -> [u8; 8] {
    let ([a, b, c, d], [e, f, g, h]) = (first.to_le_bytes(), second.to_le_bytes());
    [a, b, c, d, e, f, g, h]
}

fn split_two_longs([a, b, c, d, e, f, g, h]: [u8; 8]) -> (i32, i32) {
    (i32::from_le_bytes([a, b, c, d]), i32::from_le_bytes([e, f, g, h]))
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_map_fills_eight_bytes() {
        let bits =
            |map: &[MappedObject]| map.iter().map(|object| u32::from(object.bits)).sum::<u32>();
        assert_eq!(bits(&command_map(Mode::Csp)), 64);
        assert_eq!(bits(&command_map(Mode::Csv)), 64);
        assert_eq!(bits(&command_map(Mode::Cst)), 64);
        assert_eq!(bits(&STATUS_MAP), 64);
        assert_eq!(bits(&DRIVE_MOTION_MAP), 64);
        assert_eq!(bits(&ENCODER_MAP), 64);
        assert_eq!(command_map(Mode::Csp)[1].entry(), 0x607A_0020);
        assert_eq!(command_map(Mode::Csv)[1].entry(), 0x60FF_0020);
        assert_eq!(command_map(Mode::Cst)[2].entry(), 0x6071_0010);
    }

    #[test]
    fn a_known_command_has_its_known_bytes() {
        let command = CommandRpdo1 {
            controlword: Controlword::ENABLE_OPERATION,
            target_counts: -2,
            torque_offset: 0x0102,
            ..CommandRpdo1::default()
        };
        let frame = command.encode(NodeId::new(1).unwrap());
        assert_eq!(frame.id(), 0x201);
        assert_eq!(frame.payload(), &[0x0F, 0, 0xFE, 0xFF, 0xFF, 0xFF, 0x02, 0x01]);
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn all_round_trip(id in 1_u8..=127, word: u16, a: i32, b: i32, last: i16) {
            let node = NodeId::new(id).unwrap();
            let command =
                CommandRpdo1 {
                    controlword: Controlword(word),
                    target_counts: a,
                    torque_offset: last,
                    ..CommandRpdo1::default()
                };
            prop_assert_eq!(CommandRpdo1::decode(&command.encode(node), node), Some(command));
            let status =
                StatusTpdo1 { statusword: Statusword(word), position_counts: a, torque: last };
            prop_assert_eq!(StatusTpdo1::decode(&status.encode(node), node), Some(status));
            let extra = DriveMotionTpdo2 { velocity_counts_s: a, following_error_counts: b };
            prop_assert_eq!(DriveMotionTpdo2::decode(&extra.encode(node), node), Some(extra));
            let sample = EncoderSample { x_counts: a, y_counts: b };
            prop_assert_eq!(EncoderSample::decode(&sample.encode(node), node), Some(sample));
        }

        #[test]
        fn foreign_and_short_frames_are_none(
            id in 0_u16..=0x7FF, payload in prop::collection::vec(any::<u8>(), 0..=8)
        ) {
            let node = NodeId::new(7).unwrap();
            let frame = Frame::new(id, &payload).unwrap();
            prop_assert_eq!(
                StatusTpdo1::decode(&frame, node).is_some(), id == 0x187 && payload.len() == 8
            );
            prop_assert_eq!(
                DriveMotionTpdo2::decode(&frame, node).is_some(), id == 0x287 && payload.len() == 8
            );
        }
    }
}
