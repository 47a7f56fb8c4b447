//! One CAN frame in one datagram, as python-can's `udp_multicast` interface writes it.
//!
//! A msgpack map from the names of `can.Message`'s fields to their values. python-can refuses a map
//! with unknown names, so [`encode()`] writes exactly its eleven; [`decode()`] skips unknown names,
//! accepts any order, and refuses anything but a data frame with an 11-bit identifier, in the format of the bus:
//! classical, or CAN FD and classical.
//!
//! Source: python-can 4, `can/interfaces/udp_multicast/utils.py`, `pack_message` and `unpack_message`.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use rmp::Marker;
use rmp::decode::{self, Bytes, RmpRead};
use rmp::encode::{self, RmpWrite};

use super::super::frame::{FD_PAYLOAD_MAX, Frame, PAYLOAD_MAX};

/// Buffer size for every encoded frame; the longest takes 218.
pub const ENCODED_MAX_BYTES: usize = 256;

/// An encoded frame.
#[derive(Clone, Copy, Debug)]
pub struct Encoded {
    bytes: [u8; ENCODED_MAX_BYTES],
    len: usize,
}

impl Encoded {
    /// Returns the datagram.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

/// Returns the datagram for a frame of classical CAN, or `None` if it has more than 8 bytes.
pub fn encode(frame: &Frame) -> Option<Encoded> {
    encode_in(false, frame)
}

/// Returns the datagram for a frame of CAN FD with bit rate switch, or of classical CAN; `None` if classical CAN
/// does not carry it.
pub fn encode_in(is_fd: bool, frame: &Frame) -> Option<Encoded> {
    if !is_fd && frame.payload().len() > PAYLOAD_MAX {
        return None;
    }
    let mut bytes = [0; ENCODED_MAX_BYTES];
    let n_left = write(&mut bytes, frame, is_fd)?;
    let len = ENCODED_MAX_BYTES - n_left;
    Some(Encoded { bytes, len })
}

/// Writes the map and returns the number of bytes of `bytes` left.
fn write(bytes: &mut [u8], frame: &Frame, is_fd: bool) -> Option<usize> {
    let payload = frame.payload();
    let mut rest = bytes;
    let out = &mut rest;
    encode::write_map_len(out, 11).ok()?;
    // The receiver replaces it by its own time of arrival.
    key(out, "timestamp")?;
    encode::write_f64(out, 0.0).ok()?;
    key(out, "arbitration_id")?;
    encode::write_uint(out, u64::from(frame.id())).ok()?;
    flag(out, "is_extended_id", false)?;
    flag(out, "is_remote_frame", false)?;
    flag(out, "is_error_frame", false)?;
    key(out, "channel")?;
    encode::write_nil(out).ok()?;
    key(out, "dlc")?;
    encode::write_uint(out, payload.len() as u64).ok()?;
    key(out, "data")?;
    encode::write_bin(out, payload).ok()?;
    flag(out, "is_fd", is_fd)?;
    flag(out, "bitrate_switch", is_fd)?;
    flag(out, "error_state_indicator", false)?;
    Some(rest.len())
}

fn key<W: RmpWrite>(out: &mut W, name: &str) -> Option<()> {
    encode::write_str(out, name).ok()
}

fn flag<W: RmpWrite>(out: &mut W, name: &str, value: bool) -> Option<()> {
    key(out, name)?;
    encode::write_bool(out, value).ok()
}

/// Returns the frame in a datagram, or `None` if it contains no CANopen frame of classical CAN: malformed
/// bytes, extended, remote, error and FD frames, or a length that does not match the data.
pub fn decode(datagram: &[u8]) -> Option<Frame> {
    decode_in(false, datagram)
}

/// Returns the frame in a datagram, of CAN FD too if `is_fd`.
pub fn decode_in(is_fd: bool, datagram: &[u8]) -> Option<Frame> {
    let mut bytes = Bytes::new(datagram);
    let n_entries = decode::read_map_len(&mut bytes).ok()?;
    let mut fields = Fields::default();
    for _ in 0..n_entries {
        fields.read_entry(&mut bytes)?;
    }
    if bytes.remaining_slice().is_empty() { fields.frame(is_fd) } else { None }
}

/// The fields of `can.Message` that determine the frame.
#[derive(Default)]
struct Fields<'a> {
    arbitration_id: u32,
    /// Remote or error.
    foreign: bool,
    is_fd: bool,
    /// python-can treats a message without this field as extended.
    standard: bool,
    dlc: Option<u32>,
    data: &'a [u8],
}

impl<'a> Fields<'a> {
    fn read_entry(&mut self, bytes: &mut Bytes<'a>) -> Option<()> {
        let n_name = decode::read_str_len(bytes).ok()?;
        match take(bytes, n_name)? {
            b"arbitration_id" => self.arbitration_id = decode::read_int(bytes).ok()?,
            b"is_extended_id" => self.standard = !decode::read_bool(bytes).ok()?,
            b"is_fd" => self.is_fd = decode::read_bool(bytes).ok()?,
            b"is_remote_frame" | b"is_error_frame" => {
                self.foreign |= decode::read_bool(bytes).ok()?;
            }
            b"dlc" => self.dlc = Some(decode::read_int(bytes).ok()?),
            b"data" => {
                let n_data = decode::read_bin_len(bytes).ok()?;
                self.data = take(bytes, n_data)?;
            }
            _ => skip(bytes)?,
        }
        Some(())
    }

    fn frame(&self, takes_fd: bool) -> Option<Frame> {
        let len_agrees = self.dlc.is_none_or(|dlc| dlc as usize == self.data.len());
        let len_max = if self.is_fd { FD_PAYLOAD_MAX } else { PAYLOAD_MAX };
        let is_known = !self.foreign && (takes_fd || !self.is_fd);
        if !is_known || !self.standard || !len_agrees || self.data.len() > len_max {
            return None;
        }
        Frame::fd(u16::try_from(self.arbitration_id).ok()?, self.data)
    }
}

/// Returns the next `n` bytes, or `None` if there are fewer.
fn take<'a>(bytes: &mut Bytes<'a>, n: u32) -> Option<&'a [u8]> {
    let (head, tail) = bytes.remaining_slice().split_at_checked(n as usize)?;
    *bytes = Bytes::new(tail);
    Some(head)
}

/// Skips one value of any kind, in one pass: nested values are counted, not recursed into, so that
/// no datagram can exhaust the stack.
fn skip(bytes: &mut Bytes<'_>) -> Option<()> {
    let mut n_values: u64 = 1;
    while n_values > 0 {
        n_values -= 1;
        let marker = decode::read_marker(bytes).ok()?;
        let n_bytes = match marker {
            Marker::Null | Marker::True | Marker::False | Marker::FixPos(_) | Marker::FixNeg(_) => {
                0
            }
            Marker::U8 | Marker::I8 => 1,
            Marker::U16 | Marker::I16 | Marker::FixExt1 => 2,
            Marker::FixExt2 => 3,
            Marker::U32 | Marker::I32 | Marker::F32 => 4,
            Marker::FixExt4 => 5,
            Marker::U64 | Marker::I64 | Marker::F64 => 8,
            Marker::FixExt8 => 9,
            Marker::FixExt16 => 17,
            Marker::FixStr(n) => u32::from(n),
            Marker::Str8 | Marker::Bin8 => u32::from(bytes.read_data_u8().ok()?),
            Marker::Str16 | Marker::Bin16 => u32::from(bytes.read_data_u16().ok()?),
            Marker::Str32 | Marker::Bin32 => bytes.read_data_u32().ok()?,
            Marker::Ext8 => u32::from(bytes.read_data_u8().ok()?) + 1,
            Marker::Ext16 => u32::from(bytes.read_data_u16().ok()?) + 1,
            Marker::Ext32 => bytes.read_data_u32().ok()?.checked_add(1)?,
            Marker::FixArray(n) => count(&mut n_values, u64::from(n)),
            Marker::Array16 => count(&mut n_values, u64::from(bytes.read_data_u16().ok()?)),
            Marker::Array32 => count(&mut n_values, u64::from(bytes.read_data_u32().ok()?)),
            Marker::FixMap(n) => count(&mut n_values, 2 * u64::from(n)),
            Marker::Map16 => count(&mut n_values, 2 * u64::from(bytes.read_data_u16().ok()?)),
            Marker::Map32 => count(&mut n_values, 2 * u64::from(bytes.read_data_u32().ok()?)),
            Marker::Reserved => return None,
        };
        take(bytes, n_bytes)?;
    }
    Some(())
}

/// Adds the values inside an array or map to those still to skip; it has no bytes of its own.
fn count(n_values: &mut u64, n_inside: u64) -> u32 {
    *n_values += n_inside;
    0
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

    /// Returns a datagram as written by python-can for
    /// `Message(arbitration_id=0x181, data=[1, 2, 3])`.
    fn from_python_can() -> Vec<u8> {
        let mut bytes = Vec::new();
        encode::write_map_len(&mut bytes, 11).unwrap();
        let out = &mut bytes;
        key(out, "timestamp").unwrap();
        encode::write_f64(out, 0.0).unwrap();
        key(out, "arbitration_id").unwrap();
        out.extend_from_slice(&[0xCD, 0x01, 0x81]);
        for name in ["is_extended_id", "is_remote_frame", "is_error_frame"] {
            flag(out, name, false).unwrap();
        }
        key(out, "channel").unwrap();
        out.push(0xC0);
        key(out, "dlc").unwrap();
        out.push(3);
        key(out, "data").unwrap();
        out.extend_from_slice(&[0xC4, 3, 1, 2, 3]);
        for name in ["is_fd", "bitrate_switch", "error_state_indicator"] {
            flag(out, name, false).unwrap();
        }
        bytes
    }

    fn map(entries: &[(&str, Value)]) -> Vec<u8> {
        let mut bytes = Vec::new();
        encode::write_map_len(&mut bytes, u32::try_from(entries.len()).unwrap()).unwrap();
        for (name, value) in entries {
            key(&mut bytes, name).unwrap();
            match value {
                Value::Uint(number) => {
                    encode::write_uint(&mut bytes, *number).unwrap();
                }
                Value::Bool(value) => encode::write_bool(&mut bytes, *value).unwrap(),
                Value::Bin(data) => encode::write_bin(&mut bytes, data).unwrap(),
                Value::Raw(raw) => bytes.extend_from_slice(raw),
            }
        }
        bytes
    }

    #[derive(Clone, Debug)]
    enum Value {
        Uint(u64),
        Bool(bool),
        Bin(Vec<u8>),
        Raw(Vec<u8>),
    }

    fn plain() -> Vec<(&'static str, Value)> {
        vec![
            ("arbitration_id", Value::Uint(0x181)),
            ("is_extended_id", Value::Bool(false)),
            ("dlc", Value::Uint(2)),
            ("data", Value::Bin(vec![7, 8])),
        ]
    }

    fn with(name: &'static str, value: Value) -> Vec<u8> {
        let mut entries = plain();
        entries.retain(|(existing, _)| *existing != name);
        entries.push((name, value));
        map(&entries)
    }

    #[test]
    fn writes_what_python_can_writes() {
        let frame = Frame::new(0x181, &[1, 2, 3]).unwrap();
        assert_eq!(encode(&frame).unwrap().as_bytes(), from_python_can());
        assert_eq!(decode(&from_python_can()), Some(frame));
    }

    #[test]
    fn the_longest_frame_fits_with_room() {
        let encoded = encode(&Frame::new(0x7FF, &[0xFF; 8]).unwrap()).unwrap();
        assert_eq!(encoded.as_bytes().len(), 162);
        let encoded = encode_in(true, &Frame::fd(0x7FF, &[0xFF; 64]).unwrap()).unwrap();
        assert_eq!(encoded.as_bytes().len(), 218);
    }

    #[test]
    fn fd_is_for_buses_with_it() {
        let long = Frame::fd(0x181, &[5; 12]).unwrap();
        let short = Frame::new(0x181, &[5; 3]).unwrap();
        assert!(encode(&long).is_none());
        for frame in [long, short] {
            let datagram = encode_in(true, &frame).unwrap();
            assert_eq!(decode_in(true, datagram.as_bytes()), Some(frame));
            assert_eq!(decode(datagram.as_bytes()), None);
        }
        // Classical frames are frames of such a bus, but not longer ones.
        assert_eq!(decode_in(true, encode(&short).unwrap().as_bytes()), Some(short));
        let nine = [("is_fd", Value::Bool(true)), ("data", Value::Bin(vec![0; 9]))];
        let classical = [("is_fd", Value::Bool(false)), ("data", Value::Bin(vec![0; 12]))];
        for entries in [nine, classical] {
            let mut all = plain();
            all.retain(|(name, _)| !["dlc", "data"].contains(name));
            all.extend(entries);
            assert_eq!(decode_in(true, &map(&all)), None);
        }
    }

    #[test]
    fn foreign_frames_are_not_frames() {
        assert_eq!(decode(&map(&plain())), Frame::new(0x181, &[7, 8]));
        for (name, value) in [
            ("is_extended_id", Value::Bool(true)),
            ("is_remote_frame", Value::Bool(true)),
            ("is_error_frame", Value::Bool(true)),
            ("is_fd", Value::Bool(true)),
            ("arbitration_id", Value::Uint(0x800)),
            ("arbitration_id", Value::Uint(0x1_0181)),
            ("dlc", Value::Uint(3)),
            ("data", Value::Bin(vec![0; 9])),
            ("data", Value::Bool(true)),
        ] {
            assert_eq!(decode(&with(name, value.clone())), None, "{name} = {value:?}");
        }
        let without_is_extended = map(&[("arbitration_id", Value::Uint(1))]);
        assert_eq!(decode(&without_is_extended), None, "python-can takes it for extended");
    }

    #[test]
    fn unknown_fields_are_passed_over() {
        let nested = Value::Raw(vec![
            0x82, 0xA1, b'a', 0x93, 1, 2, 0xC0, 0xA1, b'b', 0xCB, 0, 0, 0, 0, 0, 0, 0, 0,
        ]);
        let entries = [vec![("note", nested)], plain()].concat();
        assert_eq!(decode(&map(&entries)), Frame::new(0x181, &[7, 8]));
    }

    #[test]
    fn deep_nesting_and_trailing_bytes_are_refused() {
        assert_eq!(decode(&with("note", Value::Raw(vec![0x91; 60_000]))), None);
        let mut longer = map(&plain());
        longer.push(0);
        assert_eq!(decode(&longer), None);
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn every_frame_comes_back(id in 0_u16..=0x7FF, payload in prop::collection::vec(any::<u8>(), 0..=8)) {
            let frame = Frame::new(id, &payload).unwrap();
            prop_assert_eq!(decode(encode(&frame).unwrap().as_bytes()), Some(frame));
        }

        #[test]
        fn every_fd_frame_comes_back(id in 0_u16..=0x7FF, payload in prop::collection::vec(any::<u8>(), 64), n in 0_usize..=64) {
            if let Some(frame) = Frame::fd(id, &payload[..n]) {
                prop_assert_eq!(decode_in(true, encode_in(true, &frame).unwrap().as_bytes()), Some(frame));
            }
        }

        #[test]
        fn garbage_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = decode_in(true, &bytes);
        }

        #[test]
        fn damaged_frames_never_panic(
            id in 0_u16..=0x7FF,
            damage in prop::collection::vec((0_usize..200, any::<u8>()), 1..6),
            cut in 0_usize..200,
        ) {
            let mut bytes = encode(&Frame::new(id, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap()).unwrap().as_bytes().to_vec();
            for (at, value) in damage {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = value;
                }
            }
            bytes.truncate(cut.max(1));
            let _ = decode(&bytes);
        }
    }
}
