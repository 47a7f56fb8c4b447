//! Facts that a CAN controller reports about the bus, decoded from an error frame of Linux.
//!
//! For the transport (`socketcan`, hot) and for those who say what to check. Source: `linux/can/error.h`.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use serde::{Deserialize, Serialize};

/// Classes of an error frame: bits of its identifier.
mod class {
    pub(super) const TRANSMIT_TIMEOUT: u32 = 0x001;
    pub(super) const LOST_ARBITRATION: u32 = 0x002;
    pub(super) const CONTROLLER: u32 = 0x004;
    pub(super) const TRANSCEIVER: u32 = 0x010;
    pub(super) const NO_ACKNOWLEDGEMENT: u32 = 0x020;
    pub(super) const BUS_OFF: u32 = 0x040;
    pub(super) const RESTARTED: u32 = 0x100;
}

/// Problems of the controller: bits of the second byte.
mod controller {
    pub(super) const RECEIVE_OVERFLOW: u8 = 0x01;
    pub(super) const TRANSMIT_OVERFLOW: u8 = 0x02;
    pub(super) const WARNING: u8 = 0x04 | 0x08;
    pub(super) const PASSIVE: u8 = 0x10 | 0x20;
}

/// Classes that a receiver asks the system for. Not the single bit errors: on a bad bus there is one for every
/// frame, and the counters, which are reported, sum them up.
pub const CLASSES: u32 = class::TRANSMIT_TIMEOUT
    | class::LOST_ARBITRATION
    | class::CONTROLLER
    | class::TRANSCEIVER
    | class::NO_ACKNOWLEDGEMENT
    | class::BUS_OFF
    | class::RESTARTED;

/// A fact about the bus. Its sentence says what to check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CanFact {
    /// The controller has switched itself off.
    #[error(
        "the CAN controller is off the bus (bus-off): too many of its frames failed; check bit rate, \
         termination (120 Ohm at both ends), wiring and ground; `ip link set INTERFACE type can restart 1` \
         or its `restart-ms` puts it back"
    )]
    BusOff,
    /// The controller was off the bus, and is back.
    #[error(
        "the CAN controller was off the bus (bus-off) and has restarted: frames were lost meanwhile; check \
         bit rate, termination and wiring before the next run"
    )]
    Restarted,
    /// The transceiver reports a fault of the cable; the status as the driver codes it.
    #[error(
        "the CAN transceiver reports a fault of the cable (status 0x{status:02X}): check CAN_H and CAN_L for a \
         break, or a short circuit to supply, ground or each other"
    )]
    Transceiver {
        /// Status.
        status: u8,
    },
    /// One of the error counters has passed 127: its counts, 0 if the driver does not tell.
    #[error(
        "the CAN controller is error passive (error counters {transmit} transmit, {receive} receive): many \
         frames fail; check bit rate, termination, wiring and disturbances"
    )]
    ErrorPassive {
        /// Counter of transmissions.
        transmit: u8,
        /// Counter of receptions.
        receive: u8,
    },
    /// No other node acknowledges a frame.
    #[error(
        "no other node acknowledges frames on the CAN bus: check that a drive has power, that it is connected, and \
         that all nodes have the same bit rate"
    )]
    NoAcknowledgement,
    /// A frame could not be sent in time.
    #[error(
        "the CAN controller could not send a frame in time: check the load of the bus and its wiring"
    )]
    TransmitTimeout,
    /// The controller received more than it could hold.
    #[error(
        "the CAN controller lost received frames (overflow): this computer reads its interface too slowly, or \
         another node floods the bus"
    )]
    ReceiveOverflow,
    /// The controller was given more than it could hold.
    #[error(
        "the CAN controller lost frames that it was to send (overflow): check the load of the bus"
    )]
    TransmitOverflow,
    /// One of the error counters has passed 95: some frames fail, and are repeated.
    #[error(
        "the CAN controller warns of errors (error counters {transmit} transmit, {receive} receive)"
    )]
    Warning {
        /// Counter of transmissions.
        transmit: u8,
        /// Counter of receptions.
        receive: u8,
    },
    /// A frame gave way to a more important one, and is sent later: no error on a bus with several nodes.
    #[error("a frame lost the arbitration at bit {bit} and is sent later")]
    ArbitrationLost {
        /// Bit, 0 if the driver does not tell.
        bit: u8,
    },
}

impl CanFact {
    /// Returns the gravest fact in an error frame, of its identifier without flags and its eight bytes; `None` if
    /// it reports nothing of these, as a controller that is well again.
    pub fn decode(classes: u32, data: [u8; 8]) -> Option<Self> {
        let [arbitration, problem, _, _, status, _, transmit, receive] = data;
        let has = |class| classes & class != 0;
        let problem = if has(class::CONTROLLER) { problem } else { 0 };
        Some(if has(class::BUS_OFF) {
            Self::BusOff
        } else if has(class::RESTARTED) {
            Self::Restarted
        } else if has(class::TRANSCEIVER) {
            Self::Transceiver { status }
        } else if problem & controller::PASSIVE != 0 {
            Self::ErrorPassive { transmit, receive }
        } else if has(class::NO_ACKNOWLEDGEMENT) {
            Self::NoAcknowledgement
        } else if has(class::TRANSMIT_TIMEOUT) {
            Self::TransmitTimeout
        } else if problem & controller::RECEIVE_OVERFLOW != 0 {
            Self::ReceiveOverflow
        } else if problem & controller::TRANSMIT_OVERFLOW != 0 {
            Self::TransmitOverflow
        } else if problem & controller::WARNING != 0 {
            Self::Warning { transmit, receive }
        } else if has(class::LOST_ARBITRATION) {
            Self::ArbitrationLost { bit: arbitration }
        } else {
            return None;
        })
    }

    /// Returns whether the axes must not go on. The others are what happens on a bus that works.
    pub const fn is_fault(self) -> bool {
        !matches!(self, Self::Warning { .. } | Self::ArbitrationLost { .. })
    }

    /// Returns the class of the error frame, as Linux numbers it.
    pub const fn class(self) -> u32 {
        match self {
            Self::BusOff => class::BUS_OFF,
            Self::Restarted => class::RESTARTED,
            Self::Transceiver { .. } => class::TRANSCEIVER,
            Self::NoAcknowledgement => class::NO_ACKNOWLEDGEMENT,
            Self::TransmitTimeout => class::TRANSMIT_TIMEOUT,
            Self::ArbitrationLost { .. } => class::LOST_ARBITRATION,
            Self::ErrorPassive { .. }
            | Self::ReceiveOverflow
            | Self::TransmitOverflow
            | Self::Warning { .. } => class::CONTROLLER,
        }
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
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn each_class_is_a_fact() {
        let counted = [0, 0, 0, 0, 0, 0, 136, 9];
        let problem = |bits| [0, bits, 0, 0, 0, 0, 136, 9];
        let (transmit, receive) = (136, 9);
        for (classes, data, fact) in [
            (0x040, counted, CanFact::BusOff),
            // Bus-off comes with the counters, and is graver than they.
            (0x244, problem(0x20), CanFact::BusOff),
            (0x100, counted, CanFact::Restarted),
            (0x010, [0, 0, 0, 0, 0x04, 0, 0, 0], CanFact::Transceiver { status: 4 }),
            (0x004, problem(0x10), CanFact::ErrorPassive { transmit, receive }),
            (0x204, problem(0x20), CanFact::ErrorPassive { transmit, receive }),
            (0x020, counted, CanFact::NoAcknowledgement),
            (0x001, counted, CanFact::TransmitTimeout),
            (0x004, problem(0x01), CanFact::ReceiveOverflow),
            (0x004, problem(0x02), CanFact::TransmitOverflow),
            (0x004, problem(0x08), CanFact::Warning { transmit, receive }),
            (0x002, [17, 0, 0, 0, 0, 0, 0, 0], CanFact::ArbitrationLost { bit: 17 }),
        ] {
            assert_eq!(CanFact::decode(classes, data), Some(fact), "0x{classes:03X}");
            assert_ne!(classes & fact.class(), 0);
            assert_eq!(
                fact.is_fault(),
                !matches!(fact, CanFact::Warning { .. } | CanFact::ArbitrationLost { .. })
            );
        }
    }

    #[test]
    fn a_controller_that_is_well_again_and_single_bit_errors_are_none() {
        for (classes, data) in [
            (0x004, [0, 0x40, 0, 0, 0, 0, 0, 0]),
            (0x008, [0xFF; 8]),
            (0x080, [0xFF; 8]),
            (0, [0xFF; 8]),
        ] {
            assert_eq!(CanFact::decode(classes, data), None);
        }
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn any_error_frame_is_a_fact_of_one_line_or_none(classes: u32, data: [u8; 8]) {
            if let Some(fact) = CanFact::decode(classes, data) {
                prop_assert!(!fact.to_string().contains('\n'));
                prop_assert_ne!(classes & fact.class(), 0);
            } else {
                prop_assert_eq!(classes & (CLASSES & !class::CONTROLLER), 0);
            }
        }
    }
}
