//! Cause of a silence, as a later message names it, or a further silence of the same node.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::StopReason;
use crate::fieldbus::canopen::NodeId;
use crate::fieldbus::network::Stranger;

impl Cycle {
    /// Returns the cause of a stop if a later message names it: a silent drive reports that it was
    /// stopped or restarted, or a command to it is seen.
    pub(super) fn better_reason(&self, later: StopReason) -> Option<StopReason> {
        let silent: NodeId = match self.stopping? {
            // In lock-step the first PDO may be missed alone, in the cycle in which the node falls silent.
            StopReason::SilentPdo { axis, .. } => {
                let is_node =
                    matches!(later, StopReason::SilentAxis { axis: other, .. } if other == axis);
                return is_node.then_some(later);
            }
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
