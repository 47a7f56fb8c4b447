//! Refusals and failures of commissioning, in one line each.

use crate::fieldbus::BusError;
use crate::fieldbus::bring_up::SdoError;
use crate::fieldbus::bring_up::listen::Command;
use crate::fieldbus::canopen::{NodeId, ObjectAddress};
use crate::fieldbus::cia402::Statusword;

/// A refusal or a failure, in one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CommissioningError {
    /// Another master commands the bus, so nothing may be changed on it.
    #[error("another master is at work on this bus ({0} heard); nothing was sent; stop it first")]
    Occupied(Command),
    /// Another master exchanges objects with this node; two at once get each other's answers.
    #[error(
        "another master reads or writes objects of node {0}; nothing was sent; try again when it is done"
    )]
    SdoTraffic(NodeId),
    /// The bus failed.
    #[error("{0}")]
    Bus(#[from] BusError),
    /// A node did not take part in a transfer.
    #[error("{0}")]
    Sdo(#[from] SdoError),
    /// A value that does not fit its type.
    #[error("value {value}: {allowed}")]
    Value {
        /// The value, as typed.
        value: String,
        /// Values that fit.
        allowed: String,
    },
    /// Text that is not an address.
    #[error("object {0}: allowed INDEX or INDEX:SUB in hexadecimal, as 6041, 0x6041 or 1018:1")]
    Address(String),
    /// A type is needed, as the size of the object does not tell it.
    #[error("object {address} has {n_bytes} bytes: its type is needed, as in --type {types}")]
    TypeNeeded {
        /// The object.
        address: ObjectAddress,
        /// Its size.
        n_bytes: usize,
        /// Names of the types.
        types: String,
    },
    /// A node that is not a drive.
    #[error("node {node} is not a drive: it has no statusword (0x6041)")]
    NoDrive {
        /// The node.
        node: NodeId,
    },
    /// A drive that did not reach a state.
    #[error("node {node}: {what}: statusword {}", told(*statusword))]
    State {
        /// The node.
        node: NodeId,
        /// Purpose.
        what: &'static str,
        /// Statusword found.
        statusword: u16,
    },
}

fn told(statusword: u16) -> String {
    match Statusword(statusword).state() {
        Some(state) => format!("0x{statusword:04X}, {state}"),
        None => format!("0x{statusword:04X}, no known state"),
    }
}
