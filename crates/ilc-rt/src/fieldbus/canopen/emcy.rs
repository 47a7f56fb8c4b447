//! Emergency messages: why a node faulted, in the moment it does.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cob_id;
use super::node_id::NodeId;
use crate::fieldbus::Frame;

/// No error any more.
pub const CODE_RESET: u16 = 0x0000;
/// A PDO shorter than its mapping was not processed.
pub const CODE_PDO_LENGTH: u16 = 0x8210;
/// An RPDO with a deadline did not come in time.
pub const CODE_RPDO_TIMEOUT: u16 = 0x8250;
/// The consumed heartbeat of another node stopped.
pub const CODE_HEARTBEAT: u16 = 0x8130;
/// Demand and actual position are too far apart.
pub const CODE_FOLLOWING_ERROR: u16 = 0x8611;

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Who sent it.
    pub node: NodeId,
    /// Error code, as in object 0x603F.
    pub code: u16,
    /// Error register, object 0x1001.
    pub register: u8,
    /// The maker's own bytes.
    pub vendor: [u8; 5],
}

impl Emergency {
    /// Returns the frame of this message.
    pub fn encode(self) -> Frame {
        let [low, high] = self.code.to_le_bytes();
        let [a, b, c, d, e] = self.vendor;
        cob_id::frame(cob_id::EMCY, self.node, &[low, high, self.register, a, b, c, d, e])
    }

    /// Returns the message, or `None` if `frame` is none (SYNC has the same base identifier).
    pub fn decode(frame: &Frame) -> Option<Self> {
        let node = cob_id::node_of(cob_id::EMCY, frame.id())?;
        let &[low, high, register, a, b, c, d, e] = frame.payload() else { return None };
        let code = u16::from_le_bytes([low, high]);
        Some(Self { node, code, register, vendor: [a, b, c, d, e] })
    }

    /// What the code means, in words.
    pub fn meaning(self) -> &'static str {
        meaning(self.code)
    }
}

/// Returns what an error code (EMCY, object 0x603F) means, in words; by its group if it is not known.
pub fn meaning(code: u16) -> &'static str {
    match code {
        CODE_RESET => "error reset",
        0x2310 => "continuous over-current",
        0x3210 => "over-voltage of the DC link",
        0x3220 => "under-voltage of the DC link",
        0x4310 => "drive too hot",
        0x7300 | 0x7305 => "position sensor",
        0x8110 => "CAN messages lost",
        0x8120 => "CAN in error passive mode",
        CODE_HEARTBEAT => "heartbeat of the controller lost",
        0x8140 => "recovered from bus-off",
        CODE_PDO_LENGTH => "PDO too short",
        0x8220 => "PDO too long",
        0x8240 => "SYNC of unexpected length",
        CODE_RPDO_TIMEOUT => "no command (RPDO) in time",
        CODE_FOLLOWING_ERROR => "following error",
        0x1000..=0x10FF => "generic error",
        0x2000..=0x2FFF => "current",
        0x3000..=0x3FFF => "voltage",
        0x4000..=0x4FFF => "temperature",
        0x5000..=0x5FFF => "drive hardware",
        0x6000..=0x6FFF => "drive software",
        0x7000..=0x7FFF => "additional modules",
        0x8000..=0x8FFF => "monitoring",
        0x9000..=0x90FF => "external error",
        0xFF00..=0xFFFF => "specific to the device",
        _ => "unknown error",
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::*;

    #[test]
    fn round_trips() {
        let node = NodeId::new(3).unwrap();
        let emergency = Emergency { node, code: 0x8611, register: 0x21, vendor: [1, 2, 3, 4, 5] };
        let frame = emergency.encode();
        assert_eq!(frame.id(), 0x83);
        assert_eq!(frame.payload(), &[0x11, 0x86, 0x21, 1, 2, 3, 4, 5]);
        assert_eq!(Emergency::decode(&frame), Some(emergency));
    }

    #[test]
    fn sync_and_tpdo_are_no_emergencies() {
        assert_eq!(Emergency::decode(&Frame::new(0x80, &[]).unwrap()), None);
        assert_eq!(Emergency::decode(&Frame::new(0x80, &[0; 8]).unwrap()), None);
        assert_eq!(Emergency::decode(&Frame::new(0x181, &[0; 8]).unwrap()), None);
    }
}
