//! Emergency messages (EMCY): the reason of a node's fault.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cob_id;
use super::node_id::NodeId;
use crate::fieldbus::Frame;

/// No error (error reset).
pub const CODE_RESET: u16 = 0x0000;
/// A PDO shorter than its mapping was not processed.
pub const CODE_PDO_LENGTH: u16 = 0x8210;
/// A PDO was too long, and its first bytes were used.
pub const CODE_PDO_EXCESS: u16 = 0x8220;
/// An RPDO timed out.
pub const CODE_RPDO_TIMEOUT: u16 = 0x8250;
/// A SYNC was longer or shorter than the node expects.
pub const CODE_SYNC_LENGTH: u16 = 0x8240;
/// Communication was lost, as defined by the drive profile.
pub const CODE_COMMUNICATION: u16 = 0x7500;
/// The consumed heartbeat of another node stopped.
pub const CODE_HEARTBEAT: u16 = 0x8130;
/// Following error: demand and actual position differ too much.
pub const CODE_FOLLOWING_ERROR: u16 = 0x8611;

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Sender.
    pub node: NodeId,
    /// Error code, as in object 0x603F.
    pub code: u16,
    /// Error register, object 0x1001.
    pub register: u8,
    /// Manufacturer-specific bytes.
    pub vendor: [u8; 5],
}

impl Emergency {
    /// Returns the frame of this message.
    pub fn encode(self) -> Frame {
        let [low, high] = self.code.to_le_bytes();
        let [a, b, c, d, e] = self.vendor;
        cob_id::frame(cob_id::EMCY, self.node, &[low, high, self.register, a, b, c, d, e])
    }

    /// Returns the message, or `None` if `frame` is not one (SYNC has the same base identifier).
    pub fn decode(frame: &Frame) -> Option<Self> {
        let node = cob_id::node_of(cob_id::EMCY, frame.id())?;
        let &[low, high, register, a, b, c, d, e] = frame.payload() else { return None };
        let code = u16::from_le_bytes([low, high]);
        Some(Self { node, code, register, vendor: [a, b, c, d, e] })
    }

    /// Returns the meaning of the code in words.
    pub fn meaning(self) -> &'static str {
        meaning(self.code)
    }
}

/// Returns the meaning of an error code (EMCY, object 0x603F) in words; that of its group for an
/// unknown one.
pub fn meaning(code: u16) -> &'static str {
    match code {
        CODE_RESET => "error reset",
        0x1000..=0x10FF => "generic error",
        0x2000..=0x3FFF => power(code),
        0x4000..=0x4FFF => temperature(code),
        0x5000..=0x6FFF => device(code),
        0x7000..=0x7FFF => additional(code),
        0x8000..=0x8FFF => monitoring(code),
        0x9000..=0x90FF => "external error",
        0xF000..=0xF0FF => match code {
            0xF001 => "deceleration",
            0xF002 => "sub-synchronous run",
            0xF003 => "stroke operation",
            _ => "additional functions",
        },
        0xFF00..=0xFFFF => "specific to the device",
        _ => "unknown error",
    }
}

/// Current and voltage.
fn power(code: u16) -> &'static str {
    match code {
        0x2110 | 0x2130..=0x213F => "short circuit or earth leakage at the input",
        0x2120..=0x212F => "earth leakage at the input",
        0x2100..=0x21FF => "current at the input",
        0x2211 | 0x2212 => "over-current inside the drive",
        0x2213 => "over-current in the ramp function",
        0x2214 => "over-current in the sequence",
        0x2220..=0x222F => "continuous over-current inside the drive",
        0x2230..=0x223F => "short circuit or earth leakage inside the drive",
        0x2240..=0x224F => "earth leakage inside the drive",
        0x2250..=0x225F => "short circuit inside the drive",
        0x2200..=0x22FF => "current inside the drive",
        0x2310..=0x231F => "continuous over-current",
        0x2320..=0x232F => "short circuit or earth leakage at the motor",
        0x2330..=0x233F => "earth leakage at the motor",
        0x2340..=0x234F => "short circuit at the motor",
        0x2300..=0x23FF => "current at the motor",
        0x2000..=0x2FFF => "current",
        0x3110..=0x311F => "over-voltage of the mains",
        0x3120..=0x312F => "under-voltage of the mains",
        0x3130..=0x313F => "phase failure of the mains",
        0x3140..=0x314F => "frequency of the mains",
        0x3100..=0x31FF => "mains voltage",
        0x3210..=0x321F => "over-voltage of the DC link",
        0x3220..=0x322F => "under-voltage of the DC link",
        0x3230..=0x323F => "load error of the DC link",
        0x3200..=0x32FF => "voltage of the DC link",
        0x3310..=0x331F => "over-voltage at the motor",
        0x3320..=0x332F => "armature circuit",
        0x3330..=0x333F => "field circuit",
        0x3300..=0x33FF => "voltage at the motor",
        _ => "voltage",
    }
}

fn temperature(code: u16) -> &'static str {
    match code {
        0x4110..=0x411F => "ambient temperature too high",
        0x4120..=0x412F => "ambient temperature too low",
        0x4100..=0x41FF => "ambient temperature",
        0x4210..=0x421F => "device too hot",
        0x4220..=0x422F => "device too cold",
        0x4200..=0x42FF => "temperature of the device",
        0x4310..=0x431F => "drive too hot",
        0x4320..=0x432F => "drive too cold",
        0x4300..=0x43FF => "temperature of the drive",
        0x4400..=0x44FF => "temperature of the supply",
        _ => "temperature",
    }
}

/// Hardware and software of the device.
fn device(code: u16) -> &'static str {
    match code {
        0x5100..=0x51FF => "supply of the drive's electronics",
        0x5210..=0x521F => "measurement circuit",
        0x5220..=0x522F => "computing circuit",
        0x5200..=0x52FF => "control hardware",
        0x5300..=0x53FF => "operating unit",
        0x5410..=0x541F => "output stages",
        0x5420..=0x542F => "brake chopper",
        0x5430..=0x543F => "input stages",
        0x5440..=0x544F => "contacts",
        0x5450..=0x545F => "fuses",
        0x5400..=0x54FF => "power section",
        0x5500..=0x55FF => "data storage",
        0x5000..=0x5FFF => "drive hardware",
        0x6010..=0x601F => "software reset (watchdog)",
        0x6100..=0x61FF => "internal software",
        0x6200..=0x62FF => "user software",
        0x6310..=0x631F => "loss of parameters",
        0x6320..=0x632F => "parameter error",
        0x6300..=0x63FF => "data record",
        _ => "drive software",
    }
}

/// Codes of the drive beyond its own hardware: brake, motor, sensors, communication.
fn additional(code: u16) -> &'static str {
    match code {
        0x7111 => "brake chopper failed",
        0x7112 => "over-current of the brake chopper",
        0x7113 => "protective circuit of the brake chopper",
        0x7110..=0x711F => "brake chopper",
        0x7121 => "motor blocked",
        0x7122 => "motor error or commutation failed",
        0x7123 => "motor tilted",
        0x7120..=0x712F => "motor",
        0x7100..=0x71FF => "power",
        0x7200..=0x72FF => "measurement circuit",
        0x7301 => "tachometer fault",
        0x7302 => "tachometer with wrong polarity",
        0x7303 | 0x7304 => "resolver fault",
        0x7305..=0x7307 => "incremental position sensor fault",
        0x7310..=0x731F => "speed sensor",
        0x7300..=0x73FF => "position sensor",
        0x7400..=0x74FF => "computation circuit",
        0x7510..=0x752F => "communication over the serial interface",
        0x7500..=0x75FF => "communication",
        0x7600..=0x76FF => "external data storage",
        _ => "additional modules",
    }
}

fn monitoring(code: u16) -> &'static str {
    match code {
        0x8110..=0x811F => "CAN messages lost",
        0x8120..=0x812F => "CAN in error passive mode",
        CODE_HEARTBEAT => "heartbeat of the controller lost",
        0x8140 => "recovered from bus-off",
        0x8150 => "CAN identifier used twice",
        0x8100..=0x81FF => "communication",
        CODE_PDO_LENGTH => "PDO too short",
        CODE_PDO_EXCESS => "PDO too long",
        0x8230 => "PDO with an unknown destination",
        CODE_SYNC_LENGTH => "SYNC of unexpected length",
        CODE_RPDO_TIMEOUT => "no command (RPDO) in time",
        0x8200..=0x82FF => "protocol error",
        0x8311 => "excessive torque",
        0x8312 => "difficult start",
        0x8313 => "standstill torque",
        0x8321 => "insufficient torque",
        0x8300..=0x83FF => "torque control",
        0x8400..=0x84FF => "velocity control",
        0x8500..=0x85FF => "position control",
        CODE_FOLLOWING_ERROR => "following error",
        0x8612 => "position beyond its limits",
        0x8600..=0x86FF => "positioning",
        0x8700..=0x87FF => "synchronisation",
        0x8800..=0x88FF => "winding control",
        0x8900..=0x89FF => "process data",
        0x8A00..=0x8AFF => "control",
        _ => "monitoring",
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
    fn codes_have_the_words_of_the_standard() {
        for (code, words) in [
            (0x1000, "generic error"),
            (0x2310, "continuous over-current"),
            (0x2340, "short circuit at the motor"),
            (0x3130, "phase failure of the mains"),
            (0x3220, "under-voltage of the DC link"),
            (0x4210, "device too hot"),
            (0x5530, "data storage"),
            (0x6320, "parameter error"),
            (0x7121, "motor blocked"),
            (0x7305, "incremental position sensor fault"),
            (CODE_COMMUNICATION, "communication"),
            (0x7510, "communication over the serial interface"),
            (0x7700, "additional modules"),
            (0x8130, "heartbeat of the controller lost"),
            (0x8150, "CAN identifier used twice"),
            (0x8250, "no command (RPDO) in time"),
            (0x8311, "excessive torque"),
            (0x8611, "following error"),
            (0x9000, "external error"),
            (0xFF12, "specific to the device"),
            (0xA000, "unknown error"),
        ] {
            assert_eq!(meaning(code), words, "0x{code:04X}");
        }
    }

    #[test]
    fn sync_and_tpdo_are_no_emergencies() {
        assert_eq!(Emergency::decode(&Frame::new(0x80, &[]).unwrap()), None);
        assert_eq!(Emergency::decode(&Frame::new(0x80, &[0; 8]).unwrap()), None);
        assert_eq!(Emergency::decode(&Frame::new(0x181, &[0; 8]).unwrap()), None);
    }
}
