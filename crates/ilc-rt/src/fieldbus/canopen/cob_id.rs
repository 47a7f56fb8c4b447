//! The predefined connection set: identifiers of the services of each node.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::node_id::NodeId;
use crate::fieldbus::Frame;

/// NMT commands, for all nodes.
pub const NMT: u16 = 0x000;
/// SYNC.
pub const SYNC: u16 = 0x080;
/// EMCY of a node.
pub const EMCY: u16 = 0x080;
/// First TPDO of a node; the next ones are 0x100 apart.
pub const TPDO1: u16 = 0x180;
/// First RPDO of a node; the next ones are 0x100 apart.
pub const RPDO1: u16 = 0x200;
/// SDO answers of a node.
pub const SDO_RESPONSE: u16 = 0x580;
/// SDO requests to a node.
pub const SDO_REQUEST: u16 = 0x600;
/// Boot-up and heartbeat of a node.
pub const HEARTBEAT: u16 = 0x700;

/// Returns the identifier of `service` of `node`: `service + node`.
pub const fn of(service: u16, node: NodeId) -> u16 {
    service + node.get() as u16
}

/// Returns the node if `id` is `service` of any node.
pub fn node_of(service: u16, id: u16) -> Option<NodeId> {
    id.checked_sub(service).and_then(|number| u8::try_from(number).ok()).and_then(NodeId::new)
}

/// Returns the frame of `service` of `node`. All services here are at most 0x700, so the identifier
/// fits 11 bits; a payload over 8 bytes gives an empty NMT frame, which all nodes ignore.
pub(crate) fn frame(service: u16, node: NodeId, payload: &[u8]) -> Frame {
    Frame::new(of(service, node), payload).unwrap_or_default()
}
