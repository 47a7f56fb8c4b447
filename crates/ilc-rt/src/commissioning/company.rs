//! Traffic on the bus before anything is sent: other masters, and the nodes that report their state.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::error::CommissioningError;
use crate::fieldbus::bring_up::listen::{Command, LISTEN};
use crate::fieldbus::canopen::{Heartbeat, NmtState, NodeId};
use crate::fieldbus::{Bus, BusError, Frame};

/// Traffic heard during a while of listening.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Company {
    /// First cyclic command or NMT command of another master.
    pub master: Option<Command>,
    /// First node whose objects another master exchanges.
    pub sdo: Option<NodeId>,
    /// NMT state of every node that reported one.
    pub states: BTreeMap<u8, NmtState>,
}

impl Company {
    /// Notes a frame.
    pub fn note(&mut self, frame: &Frame) {
        if let Some(heartbeat) = Heartbeat::decode(frame) {
            self.states.insert(heartbeat.node.get(), heartbeat.state);
            return;
        }
        match Command::of(frame, &every_node()) {
            Some(Command::Sdo(node)) => self.sdo = self.sdo.or(Some(node)),
            Some(command) => self.master = self.master.or(Some(command)),
            None => {}
        }
    }

    /// Refuses a bus on which objects are being exchanged.
    ///
    /// # Errors
    /// [`CommissioningError::SdoTraffic`]
    pub fn lets_read(&self) -> Result<(), CommissioningError> {
        self.sdo.map_or(Ok(()), |node| Err(CommissioningError::SdoTraffic(node)))
    }

    /// Refuses a bus with any other master.
    ///
    /// # Errors
    /// [`CommissioningError::SdoTraffic`] or [`CommissioningError::Occupied`]
    pub fn lets_change(&self) -> Result<(), CommissioningError> {
        self.lets_read()?;
        self.master.map_or(Ok(()), |command| Err(CommissioningError::Occupied(command)))
    }
}

/// Listens for as long as a bring-up does, without sending.
///
/// # Errors
/// [`BusError`] if the bus fails.
pub fn listen(bus: &mut dyn Bus) -> Result<Company, BusError> {
    let mut company = Company::default();
    collect(bus, LISTEN, &mut |frame| company.note(frame))?;
    Ok(company)
}

/// Hands every frame of a span on.
pub(super) fn collect(
    bus: &mut dyn Bus,
    span: Duration,
    take: &mut dyn FnMut(&Frame),
) -> Result<(), BusError> {
    let deadline = Instant::now() + span;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let Some(frame) = bus.recv(left)? else { return Ok(()) };
        take(&frame);
        if left.is_zero() {
            return Ok(());
        }
    }
}

/// Returns all node numbers.
pub(super) fn every_node() -> Vec<NodeId> {
    (1..=127).filter_map(NodeId::new).collect()
}
