//! Network management: commands to nodes, their state, boot-up and heartbeat.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cob_id;
use super::node_id::NodeId;
use crate::fieldbus::Frame;

/// A command of the NMT master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NmtCommand {
    /// Go to Operational: PDOs begin.
    Start = 0x01,
    /// Go to Stopped: only NMT and heartbeat remain.
    Stop = 0x02,
    /// Go to Pre-operational: SDO, but no PDO.
    PreOperational = 0x80,
    /// Restart the node as after power-on.
    ResetNode = 0x81,
    /// Restart the communication with its power-on settings.
    ResetCommunication = 0x82,
}

impl NmtCommand {
    /// Returns the frame of this command to `node`, or to all nodes with `None`.
    pub fn frame(self, node: Option<NodeId>) -> Frame {
        Frame::new(cob_id::NMT, &[self as u8, node.map_or(0, NodeId::get)]).unwrap_or_default()
    }

    /// Returns command and node (`None`: all nodes), or `None` if `frame` is not an NMT command.
    pub fn decode(frame: &Frame) -> Option<(Self, Option<NodeId>)> {
        let (cob_id::NMT, &[command, number]) = (frame.id(), frame.payload()) else {
            return None;
        };
        let command = match command {
            0x01 => Self::Start,
            0x02 => Self::Stop,
            0x80 => Self::PreOperational,
            0x81 => Self::ResetNode,
            0x82 => Self::ResetCommunication,
            _ => return None,
        };
        match number {
            0 => Some((command, None)),
            _ => NodeId::new(number).map(|node| (command, Some(node))),
        }
    }
}

/// The NMT state of a node, as reported by its heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NmtState {
    /// The node has just booted; it is Pre-operational from now on.
    BootUp = 0x00,
    /// NMT and heartbeat only.
    Stopped = 0x04,
    /// All services, including PDOs.
    Operational = 0x05,
    /// SDO, but no PDO.
    PreOperational = 0x7F,
}

impl std::fmt::Display for NmtState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::BootUp => "boot-up",
            Self::Stopped => "stopped",
            Self::Operational => "operational",
            Self::PreOperational => "pre-operational",
        })
    }
}

/// A boot-up or heartbeat message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// Sender.
    pub node: NodeId,
    /// The sender's state.
    pub state: NmtState,
}

impl Heartbeat {
    /// Returns the frame of this message.
    pub fn encode(self) -> Frame {
        cob_id::frame(cob_id::HEARTBEAT, self.node, &[self.state as u8])
    }

    /// Returns the message, or `None` if `frame` is not one.
    pub fn decode(frame: &Frame) -> Option<Self> {
        let node = cob_id::node_of(cob_id::HEARTBEAT, frame.id())?;
        let &[byte] = frame.payload() else { return None };
        // Bit 7 is the toggle of node guarding; a heartbeat has it clear.
        let state = match byte & 0x7F {
            0x00 => NmtState::BootUp,
            0x04 => NmtState::Stopped,
            0x05 => NmtState::Operational,
            0x7F => NmtState::PreOperational,
            _ => return None,
        };
        Some(Self { node, state })
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
    fn commands_round_trip() {
        let commands = [
            NmtCommand::Start,
            NmtCommand::Stop,
            NmtCommand::PreOperational,
            NmtCommand::ResetNode,
            NmtCommand::ResetCommunication,
        ];
        for command in commands {
            for node in [None, NodeId::new(1), NodeId::new(127)] {
                assert_eq!(NmtCommand::decode(&command.frame(node)), Some((command, node)));
            }
        }
        assert_eq!(NmtCommand::Start.frame(NodeId::new(5)).payload(), &[0x01, 5]);
    }

    #[test]
    fn heartbeats_round_trip_and_foreign_frames_are_none() {
        let node = NodeId::new(9).unwrap();
        for state in
            [NmtState::BootUp, NmtState::Stopped, NmtState::Operational, NmtState::PreOperational]
        {
            let heartbeat = Heartbeat { node, state };
            assert_eq!(Heartbeat::decode(&heartbeat.encode()), Some(heartbeat));
        }
        for (id, payload) in [(0x700, &[0][..]), (0x709, &[]), (0x709, &[1]), (0x780, &[5])] {
            assert_eq!(Heartbeat::decode(&Frame::new(id, payload).unwrap()), None);
        }
    }
}
