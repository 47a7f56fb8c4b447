//! Listening before anything is sent: traffic of another master on this bus. Cold: it waits.

use std::time::{Duration, Instant};

use crate::fieldbus::canopen::pdo::PdoNumber;
use crate::fieldbus::canopen::{NmtCommand, NodeId, cob_id, sync};
use crate::fieldbus::{Bus, BusError, Frame};

/// Listening time: several cycles of any servo loop, and two heartbeats of 100 ms.
pub const LISTEN: Duration = Duration::from_millis(250);

/// Traffic that only a master sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// SYNC.
    Sync,
    /// An NMT command.
    Nmt,
    /// Process data to this node.
    Rpdo(NodeId),
    /// An SDO request to this node.
    Sdo(NodeId),
}

impl std::fmt::Display for Command {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Sync => f.write_str("SYNC"),
            Self::Nmt => f.write_str("NMT commands"),
            Self::Rpdo(node) => write!(f, "process data to node {node}"),
            Self::Sdo(node) => write!(f, "SDO requests to node {node}"),
        }
    }
}

impl Command {
    /// Returns the command in a frame; `nodes` are those whose process data counts.
    pub fn of(frame: &Frame, nodes: &[NodeId]) -> Option<Self> {
        if sync::is_sync(frame) {
            return Some(Self::Sync);
        }
        if NmtCommand::decode(frame).is_some() {
            return Some(Self::Nmt);
        }
        if let Some(node) = cob_id::node_of(cob_id::SDO_REQUEST, frame.id()) {
            return Some(Self::Sdo(node));
        }
        nodes.iter().find_map(|&node| {
            let is_to_it = |number: PdoNumber| number.default_cob_id(node) == frame.id();
            (0..4).map(PdoNumber::receive).any(is_to_it).then_some(Self::Rpdo(node))
        })
    }
}

/// Listens for a while and returns the first command of another master, if one comes.
///
/// A bus in memory has no other master: no wait.
///
/// # Errors
/// [`BusError`] if the bus fails.
pub fn other_master(
    bus: &mut dyn Bus,
    nodes: &[NodeId],
    span: Duration,
) -> Result<Option<Command>, BusError> {
    heard(bus, span, |frame| Command::of(frame, nodes))
}

/// Listens for a while, without sending, and returns the first node of `nodes` that is heard.
///
/// # Errors
/// [`BusError`] if the bus fails.
pub fn present(
    bus: &mut dyn Bus,
    nodes: &[NodeId],
    span: Duration,
) -> Result<Option<NodeId>, BusError> {
    heard(bus, span, |frame| sender(frame, nodes))
}

/// Returns the node of `nodes` that sent a frame, if any.
pub fn sender(frame: &Frame, nodes: &[NodeId]) -> Option<NodeId> {
    let services = [cob_id::SDO_RESPONSE, cob_id::HEARTBEAT, cob_id::EMCY];
    nodes.iter().copied().find(|&node| {
        services.iter().any(|&service| cob_id::of(service, node) == frame.id())
            || (0..4).any(|n| PdoNumber::transmit(n).default_cob_id(node) == frame.id())
    })
}

fn heard<T>(
    bus: &mut dyn Bus,
    span: Duration,
    mut is_it: impl FnMut(&Frame) -> Option<T>,
) -> Result<Option<T>, BusError> {
    let deadline = Instant::now() + span;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let Some(frame) = bus.recv(left)? else { return Ok(None) };
        if let Some(found) = is_it(&frame) {
            return Ok(Some(found));
        }
        if left.is_zero() {
            return Ok(None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fieldbus::canopen::{Emergency, Heartbeat, NmtState};

    fn node(number: u8) -> NodeId {
        NodeId::new(number).unwrap()
    }

    #[test]
    fn only_a_masters_frames_are_commands() {
        let nodes = [node(1), node(2)];
        let frame = |id, bytes: &[u8]| Frame::new(id, bytes).unwrap();
        for (frame, expected) in [
            (sync::frame(), Some(Command::Sync)),
            (frame(0x80, &[7]), Some(Command::Sync)),
            (NmtCommand::Start.frame(None), Some(Command::Nmt)),
            (frame(0x202, &[0; 8]), Some(Command::Rpdo(node(2)))),
            (frame(0x501, &[0; 8]), Some(Command::Rpdo(node(1)))),
            (frame(0x605, &[0x40, 0, 0, 0, 0, 0, 0, 0]), Some(Command::Sdo(node(5)))),
            (frame(0x203, &[0; 8]), None),
            (frame(0x181, &[0; 8]), None),
            (frame(0x581, &[0; 8]), None),
            (frame(0x000, &[0xFF, 0xFF]), None),
            (Heartbeat { node: node(1), state: NmtState::Operational }.encode(), None),
        ] {
            assert_eq!(Command::of(&frame, &nodes), expected, "{frame:?}");
        }
    }

    #[test]
    fn a_node_is_known_by_all_that_it_sends() {
        let nodes = [node(1), node(2)];
        let emergency = Emergency { node: node(2), code: 0x8130, register: 0, vendor: [0; 5] };
        let frames = [
            Heartbeat { node: node(2), state: NmtState::PreOperational }.encode(),
            emergency.encode(),
            Frame::new(0x482, &[1]).unwrap(),
            Frame::new(0x582, &[0; 8]).unwrap(),
        ];
        for frame in frames {
            assert_eq!(sender(&frame, &nodes), Some(node(2)), "{frame:?}");
            assert_eq!(sender(&frame, &nodes[..1]), None);
        }
    }
}
