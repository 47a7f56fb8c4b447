//! A CAN data frame with an 11-bit identifier, as CANopen uses it: classical, or of CAN FD.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// Largest payload of a classical CAN frame, in bytes.
pub const PAYLOAD_MAX: usize = 8;
/// Largest payload of a CAN FD frame, in bytes.
pub const FD_PAYLOAD_MAX: usize = 64;
/// Lengths of a CAN FD payload above 8 bytes.
const FD_LENGTHS: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];

/// A CAN data frame.
///
/// The payload alone tells whether it needs CAN FD: more than 8 bytes. The format on the wire is that of the
/// bus. Bytes beyond `len` are zero, so that two equal frames compare equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    id: u16,
    len: u8,
    data: [u8; FD_PAYLOAD_MAX],
}

impl Default for Frame {
    fn default() -> Self {
        Self { id: 0, len: 0, data: [0; FD_PAYLOAD_MAX] }
    }
}

impl Frame {
    /// Returns a frame that every bus carries, or `None` if `id` exceeds 11 bits (0x7FF) or `payload` 8 bytes.
    pub fn new(id: u16, payload: &[u8]) -> Option<Self> {
        if payload.len() > PAYLOAD_MAX { None } else { Self::fd(id, payload) }
    }

    /// Returns a frame that a bus with CAN FD carries, or `None` if `id` exceeds 11 bits, or if CAN FD has no
    /// payload of this length: 0 to 8, 12, 16, 20, 24, 32, 48 and 64 bytes.
    pub fn fd(id: u16, payload: &[u8]) -> Option<Self> {
        if id > 0x7FF
            || payload.len() > FD_PAYLOAD_MAX
            || length_on_bus(payload.len()) != payload.len()
        {
            return None;
        }
        let mut data = [0; FD_PAYLOAD_MAX];
        data[..payload.len()].copy_from_slice(payload);
        #[expect(clippy::cast_possible_truncation, reason = "at most 64, checked above")]
        Some(Self { id, len: payload.len() as u8, data })
    }

    /// Returns the 11-bit identifier (COB-ID).
    pub fn id(&self) -> u16 {
        self.id
    }

    /// Returns the payload, 0 to 64 bytes.
    pub fn payload(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }
}

/// Returns the length of the frame that carries some bytes: the next one that CAN FD has, at most 64.
pub fn length_on_bus(n_bytes: usize) -> usize {
    if n_bytes <= PAYLOAD_MAX {
        return n_bytes;
    }
    FD_LENGTHS.into_iter().find(|&length| length >= n_bytes).unwrap_or(FD_PAYLOAD_MAX)
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "tests are cold")]
mod tests {
    use super::*;

    #[test]
    fn holds_what_it_was_given() {
        let frame = Frame::new(0x181, &[1, 2, 3]).unwrap();
        assert_eq!((frame.id(), frame.payload()), (0x181, &[1, 2, 3][..]));
        let long = Frame::fd(0x181, &[7; 64]).unwrap();
        assert_eq!(long.payload(), &[7; 64][..]);
        assert_eq!(Frame::fd(0x181, &[1, 2, 3]), Some(frame), "the payload alone makes a frame");
    }

    #[test]
    fn refuses_long_identifiers_and_payloads() {
        assert!(Frame::new(0x800, &[]).is_none());
        assert!(Frame::new(0x7FF, &[0; 9]).is_none());
        assert!(Frame::new(0x7FF, &[0; 12]).is_none());
        assert!(Frame::fd(0x800, &[]).is_none());
        assert!(Frame::fd(0x7FF, &[0; 65]).is_none());
    }

    #[test]
    fn fd_has_certain_lengths_only() {
        let lengths = (0..=64).filter(|&n| Frame::fd(1, &[0; 64][..n]).is_some());
        let expected = (0..=8).chain([12, 16, 20, 24, 32, 48, 64]);
        assert!(lengths.eq(expected));
        for (n_bytes, length) in [(0, 0), (8, 8), (9, 12), (17, 20), (25, 32), (33, 48), (64, 64)] {
            assert_eq!(length_on_bus(n_bytes), length);
        }
    }
}
