//! A classical CAN data frame with an 11-bit identifier, as CANopen uses it.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// Largest payload of a classical CAN frame, in bytes.
pub const PAYLOAD_MAX: usize = 8;

/// A classical CAN data frame.
///
/// Bytes beyond `len` are zero, so that two equal frames compare equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Frame {
    id: u16,
    len: u8,
    data: [u8; PAYLOAD_MAX],
}

impl Frame {
    /// Returns a frame, or `None` if `id` exceeds 11 bits (0x7FF) or `payload` 8 bytes.
    pub fn new(id: u16, payload: &[u8]) -> Option<Self> {
        if id > 0x7FF || payload.len() > PAYLOAD_MAX {
            return None;
        }
        let mut data = [0; PAYLOAD_MAX];
        data[..payload.len()].copy_from_slice(payload);
        #[expect(clippy::cast_possible_truncation, reason = "at most 8, checked above")]
        Some(Self { id, len: payload.len() as u8, data })
    }

    /// Returns the 11-bit identifier (COB-ID).
    pub fn id(&self) -> u16 {
        self.id
    }

    /// Returns the payload, 0 to 8 bytes.
    pub fn payload(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "tests are cold")]
mod tests {
    use super::*;

    #[test]
    fn holds_what_it_was_given() {
        let frame = Frame::new(0x181, &[1, 2, 3]).unwrap();
        assert_eq!((frame.id(), frame.payload()), (0x181, &[1, 2, 3][..]));
    }

    #[test]
    fn refuses_long_identifiers_and_payloads() {
        assert!(Frame::new(0x800, &[]).is_none());
        assert!(Frame::new(0x7FF, &[0; 9]).is_none());
    }
}
