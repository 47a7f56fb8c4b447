//! Events of a node for people.

use ilc_rt::fieldbus::canopen::{NmtState, NodeId, emcy};
use ilc_rt::fieldbus::cia402::State;

/// A change of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// Time of the machine since power-on.
    pub time_us: u64,
    /// Node.
    pub node: NodeId,
    /// Event.
    pub change: Change,
}

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A new NMT state.
    Nmt(NmtState),
    /// A new drive state.
    Drive(State),
    /// An emergency message with this code.
    Emergency(u16),
    /// Loss of power.
    Muted,
}

impl std::fmt::Display for Event {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3} s  node {}: ", self.time_us as f64 * 1e-6, self.node)?;
        match self.change {
            Change::Nmt(state) => write!(f, "{state}"),
            Change::Drive(state) => write!(f, "{state}"),
            Change::Emergency(emcy::CODE_RESET) => write!(f, "error reset"),
            Change::Emergency(code) => write!(f, "EMCY 0x{code:04X}, {}", emcy::meaning(code)),
            Change::Muted => write!(f, "lost power"),
        }
    }
}
