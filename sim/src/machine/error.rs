//! Reason that there is no machine for a cell description.

use ilc_rt::fieldbus::canopen::{AbortCode, NodeId};
use ilc_rt::kinematics::KinematicsError;

/// Reason that a cell description is not a valid machine.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MachineError {
    /// An invalid node number.
    #[error("node {0}: allowed 1 to 127")]
    Node(u8),
    /// An object is missing from a node's own table.
    #[error("node {node}: its object dictionary is incomplete: {code}")]
    Dictionary {
        /// The node.
        node: NodeId,
        /// Abort code of the look-up.
        code: AbortCode,
    },
    /// A mechanism that cannot move.
    #[error("[simulation.delta]: {0}")]
    Mechanism(#[from] KinematicsError),
    /// A plant with a different number of axes than the cell.
    #[error("plant: expected {expected} axes, found {found}")]
    Axes {
        /// Axes of the cell.
        expected: usize,
        /// Axes of the plant.
        found: usize,
    },
}
