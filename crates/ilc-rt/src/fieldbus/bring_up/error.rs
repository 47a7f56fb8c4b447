//! Reasons that a node cannot be brought up, in one line.

use std::time::Duration;

use super::misfit::{Found, Required, Shown};
use super::sdo_client::SdoError;
use super::setting::{Kind, name};
use crate::fieldbus::BusError;
use crate::fieldbus::canopen::{AbortCode, NodeId, ObjectAddress};
use crate::fieldbus::cia402::{Mode, Statusword};

/// Reason that a node cannot be brought up: node, step, expected and found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BringUpError {
    /// No boot-up after the reset.
    #[error(
        "node {node}: no boot-up within {timeout:?} after reset; is it powered, on this bus and set to this number?"
    )]
    NoBootUp {
        /// The node.
        node: NodeId,
        /// Time waited.
        timeout: Duration,
    },
    /// Two nodes with the same number.
    #[error(
        "two nodes answer as node {node}: each question is answered twice; give one of them another \
         number, or stop the second simulator"
    )]
    TwoNodes {
        /// The number.
        node: NodeId,
    },
    /// A node of another kind.
    #[error(
        "node {node}: device type: expected profile {expected}, found {found} (0x1000 = 0x{device_type:08X})"
    )]
    Profile {
        /// The node.
        node: NodeId,
        /// Profile number expected.
        expected: u16,
        /// Profile number found.
        found: u16,
        /// The whole object.
        device_type: u32,
    },
    /// A drive without the mode.
    #[error(
        "node {node}: supported modes: expected {mode}, found 0x6502 = 0x{supported:08X}, which lacks it"
    )]
    ModeNotSupported {
        /// The node.
        node: NodeId,
        /// Requested mode.
        mode: Mode,
        /// Object 0x6502.
        supported: u32,
    },
    /// A drive without the homing mode.
    #[error(
        "node {node}: supported modes: [axis.homing] kind = \"drive\" needs homing, found 0x6502 = 0x{supported:08X}, which lacks it"
    )]
    HomingNotSupported {
        /// The node.
        node: NodeId,
        /// Object 0x6502.
        supported: u32,
    },
    /// Another drive than that of the cell description.
    #[error(
        "node {node}: object 0x1018:{sub:02} ({name}): found 0x{found:08X}, [axis.drive] {name} requires 0x{required:08X}"
    )]
    Identity {
        /// The node.
        node: NodeId,
        /// Key of the cell description.
        name: &'static str,
        /// Sub-index.
        sub: u8,
        /// Number found.
        found: u32,
        /// Number required.
        required: u32,
    },
    /// A drive that does not report the requested mode.
    #[error(
        "node {node}: mode of operation: expected {mode}, found 0x6061 = {found} after {timeout:?}"
    )]
    ModeNotShown {
        /// The node.
        node: NodeId,
        /// Requested mode.
        mode: Mode,
        /// Object 0x6061.
        found: i8,
        /// Time waited.
        timeout: Duration,
    },
    /// A cycle that 0x60C2 cannot represent.
    #[error(
        "node {node}: interpolation period: a cycle of {cycle_us} us is not 1 to 255 times a power of ten; choose one that is, as 2000"
    )]
    Cycle {
        /// The node.
        node: NodeId,
        /// Requested cycle.
        cycle_us: u32,
    },
    /// An object with a value that must not be used, and that cannot be changed.
    #[error(
        "node {node}: object {object} ({}): found {}, needed {}{}",
        name(*object), Shown(*object, *kind, found), Shown(*object, *kind, required),
        because(*refusal)
    )]
    Value {
        /// The node.
        node: NodeId,
        /// The object.
        object: ObjectAddress,
        /// Its type.
        kind: Kind,
        /// Value found.
        found: Found,
        /// Value required.
        required: Required,
        /// Reason why the node rejects another value, if it was asked to take one and gave a
        /// reason.
        refusal: Option<AbortCode>,
    },
    /// A drive that has to be homed, and does not tell that it is.
    #[error("node {node}: not homed: {why}")]
    NotHomed {
        /// The node.
        node: NodeId,
        /// Evidence.
        why: String,
    },
    /// A missing object.
    #[error("node {node}: object {object} ({name}): the node has none, and needs it {purpose}")]
    Missing {
        /// The node.
        node: NodeId,
        /// The object.
        object: ObjectAddress,
        /// Its name.
        name: &'static str,
        /// Purpose.
        purpose: &'static str,
    },
    /// A drive that cannot be disabled.
    #[error(
        "node {node}: the drive was left under power and does not let go: found {} \
         (0x6041 = 0x{:04X}), needed switch on disabled; switch it off and on again",
        statusword.state().map_or_else(|| "no known state".to_owned(), |state| state.to_string()),
        statusword.0
    )]
    UnderPower {
        /// The node.
        node: NodeId,
        /// Object 0x6041.
        statusword: Statusword,
    },
    /// A failed SDO request.
    #[error("{source} (step: {step})")]
    Sdo {
        /// Step.
        step: &'static str,
        /// Error, with node and object.
        source: SdoError,
    },
    /// A failure of the bus.
    #[error("node {node}: {step}: {source}")]
    Bus {
        /// The node.
        node: NodeId,
        /// Step.
        step: &'static str,
        /// Error.
        source: BusError,
    },
}

fn because(refusal: Option<AbortCode>) -> String {
    refusal.map_or_else(String::new, |code| format!("; the node refuses it with {code}"))
}

#[cfg(test)]
mod tests {
    use super::super::setting::Need;
    use super::*;

    #[test]
    fn an_error_is_one_line_that_names_the_node() {
        let node = NodeId::new(1).unwrap();
        let error = BringUpError::NoBootUp { node, timeout: Duration::from_secs(2) };
        assert_eq!(
            error.to_string(),
            "node 1: no boot-up within 2s after reset; is it powered, on this bus and set to this number?"
        );
        let error = BringUpError::Value {
            node,
            object: ObjectAddress::new(0x60B0, 0),
            kind: Kind::I32,
            found: Found::Number(5000),
            required: Required::Number(Need::Exactly(0)),
            refusal: Some(AbortCode::ReadOnly),
        };
        assert_eq!(
            error.to_string(),
            "node 1: object 0x60B0:00 (Position offset): found 5000, needed 0; the node refuses it \
             with 0x06010002 (object is read-only)"
        );
    }
}
