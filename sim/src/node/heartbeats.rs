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

    /// Lets time pass; the watched node's counts while one is watched.
    pub(super) fn pass(&mut self, elapsed_us: u64, dictionary: &Dictionary) {
        self.own_us += elapsed_us;
        if self.watched(dictionary).is_some() {
            self.controller_us = self.controller_us.map(|since_us| since_us + elapsed_us);
        }
    }

    /// Returns the time after which one of the two heartbeats is due; none is before.
    pub(super) fn rest_us(&self, dictionary: &Dictionary) -> u64 {
        let own_us =
            self.period_us(dictionary).map(|period_us| period_us.saturating_sub(self.own_us));
        let watched_us = self.controller_us.zip(self.watched(dictionary));
        // It may be as late as its period.
        let other_us =
            watched_us.map(|(since_us, (_, period_us))| (period_us + 1).saturating_sub(since_us));
        own_us.unwrap_or(u64::MAX).min(other_us.unwrap_or(u64::MAX))
    }

    /// Returns true if this node must send its heartbeat now, and begins the next period.
    pub(super) fn take_due(&mut self, dictionary: &Dictionary) -> bool {
        let is_due = self.period_us(dictionary).is_some_and(|period_us| self.own_us >= period_us);
        if is_due {
            self.own_us = 0;
        }
        is_due
    }

    /// Returns the period of this node's own heartbeat, 0x1017.
    fn period_us(&self, dictionary: &Dictionary) -> Option<u64> {
        let period_ms = u64::try_from(dictionary.number(self.producer_ms)).unwrap_or(0);
        (period_ms > 0).then_some(period_ms * 1000)
    }

    /// Notes the heartbeat of the watched node.
    pub(super) fn hear(&mut self, frame: &Frame, dictionary: &Dictionary) {
        let Some(heartbeat) = Heartbeat::decode(frame) else { return };
        if self.watched(dictionary).is_some_and(|(node, _)| node == heartbeat.node) {
            self.controller_us = Some(0);
        }
    }

    /// Returns whether the watched node has been silent for too long; each silence is reported once.
    pub(super) fn controller_is_silent(&mut self, dictionary: &Dictionary) -> bool {
        let (Some(since_us), Some((_, period_us))) = (self.controller_us, self.watched(dictionary))
        else {
            return false;
        };
        let is_silent = since_us > period_us;
        if is_silent {
            self.controller_us = None;
        }
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
