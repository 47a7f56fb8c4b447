//! Another master on the bus: frames that only this controller may send, received from another
//! node.
//!
//! No transport returns a sender's own frames, so each of these was sent by another master.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::{StopReason, Stranger};
use crate::fieldbus::Frame;
use crate::fieldbus::canopen::{NmtCommand, NodeId, cob_id, sync};

/// Bases of the identifiers of the four receive PDOs.
const RPDOS: [u16; 4] = [0x200, 0x300, 0x400, 0x500];

impl Cycle {
    /// Returns the trace of another master in a frame, if any. Traffic with nodes outside this cell
    /// is ignored.
    pub(super) fn stranger(&self, frame: &Frame) -> Option<Stranger> {
        if sync::is_sync(frame) {
            return Some(Stranger::Sync);
        }
        if let Some((command, node)) = NmtCommand::decode(frame) {
            return node
                .is_none_or(|node| self.is_ours(node))
                .then_some(Stranger::Nmt(command, node));
        }
        let to = |base| cob_id::node_of(base, frame.id()).filter(|node| self.is_ours(*node));
        if let Some(node) = to(cob_id::SDO_REQUEST).filter(|_| !only_reads(frame)) {
            return Some(Stranger::Request(node));
        }
        RPDOS.iter().find_map(|base| to(*base)).map(Stranger::Command)
    }

    /// Returns the cause of a stop if a later frame names it: a silent drive reports that it was
    /// stopped or restarted, or a command to it is seen.
    pub(super) fn better_reason(&self, later: StopReason) -> Option<StopReason> {
        let silent: NodeId = match self.stopping? {
            StopReason::SilentAxis { axis, .. } => self.spec.axes.get(axis)?.node,
            StopReason::SilentTool { .. } => self.spec.tool?.node,
            _ => return None,
        };
        let is_why = match later {
            StopReason::NodeLeft { node } | StopReason::NodeStopped { node, .. } => {
                node == silent.get()
            }
            StopReason::OtherMaster(Stranger::Nmt(_, node)) => {
                node.is_none_or(|node| node == silent)
            }
            _ => false,
        };
        is_why.then_some(later)
    }
}

/// Returns whether an SDO request changes nothing: an upload, its segment, or an abort. The loop itself exchanges no
/// objects, so that the answers confuse none of its own requests.
fn only_reads(frame: &Frame) -> bool {
    matches!(frame.payload().first().map(|command| command >> 5), Some(2..=5))
}
