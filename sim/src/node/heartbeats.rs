//! Heartbeats of a node: its own, and the watch over the controller's.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{AbortCode, Heartbeat, NodeId, ObjectAddress};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Dictionary, Slot};

/// The heartbeats of a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heartbeats {
    consumer: Slot,
    producer_ms: Slot,
    /// Time since this node's last heartbeat.
    own_us: u64,
    /// Time since the controller's last heartbeat; `None` before the first.
    controller_us: Option<u64>,
}

impl Heartbeats {
    pub(super) fn find(dictionary: &Dictionary) -> Result<Self, AbortCode> {
        let slot = |index, sub| dictionary.find(ObjectAddress::new(index, sub));
        Ok(Self {
            consumer: slot(objects::CONSUMER_HEARTBEAT, 1)?,
            producer_ms: slot(objects::PRODUCER_HEARTBEAT, 0)?,
            own_us: 0,
            controller_us: None,
        })
    }

    /// Starts the period of this node's own heartbeat again.
    pub(super) fn restart_own(&mut self) {
        self.own_us = 0;
    }

    /// Waits for the controller's first heartbeat again.
    pub(super) fn disarm(&mut self) {
        self.controller_us = None;
    }

    /// Lets time pass and returns true if this node must send its heartbeat now.
    pub(super) fn is_due(&mut self, elapsed_us: u64, dictionary: &Dictionary) -> bool {
        let period_us = u64::try_from(dictionary.number(self.producer_ms)).unwrap_or(0) * 1000;
        self.own_us += elapsed_us;
        let is_due = period_us > 0 && self.own_us >= period_us;
        if is_due {
            self.own_us = 0;
        }
        is_due
    }

    /// Notes the heartbeat of the watched node.
    pub(super) fn hear(&mut self, frame: &Frame, dictionary: &Dictionary) {
        let Some(heartbeat) = Heartbeat::decode(frame) else { return };
        if self.watched(dictionary).is_some_and(|(node, _)| node == heartbeat.node) {
            self.controller_us = Some(0);
        }
    }

    /// Counts the silence of the watched node; each one is reported once.
    pub(super) fn controller_is_silent(
        &mut self,
        elapsed_us: u64,
        dictionary: &Dictionary,
    ) -> bool {
        let (Some(since_us), Some((_, period_us))) = (self.controller_us, self.watched(dictionary))
        else {
            return false;
        };
        let since_us = since_us + elapsed_us;
        let is_silent = since_us > period_us;
        self.controller_us = (!is_silent).then_some(since_us);
        is_silent
    }

    /// Returns node and period of the consumed heartbeat, 0x1016:01.
    fn watched(&self, dictionary: &Dictionary) -> Option<(NodeId, u64)> {
        let [low, high, node, _] =
            u32::try_from(dictionary.number(self.consumer)).unwrap_or(0).to_le_bytes();
        let period_us = u64::from(u16::from_le_bytes([low, high])) * 1000;
        NodeId::new(node).filter(|_| period_us > 0).map(|node| (node, period_us))
    }
}
