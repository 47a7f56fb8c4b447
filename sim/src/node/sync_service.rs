//! SYNC of a node: the one that it hears, and the one that it produces itself.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{AbortCode, ObjectAddress, cob_id, sync};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Dictionary, Slot};

/// In 0x1005: this node produces SYNC.
const PRODUCER: i64 = 1 << 30;
/// In 0x1005: the identifier.
const IDENTIFIER: i64 = 0x7FF;

/// Meaning of a frame to the SYNC consumer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Heard {
    /// No SYNC.
    Foreign,
    /// A SYNC without the counter that is required.
    WithoutCounter,
    /// A SYNC that this drive does not hear.
    Missed,
    Sync,
}

/// The SYNC consumer and producer of a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct SyncService {
    cob_id: Slot,
    period_us: Slot,
    overflow: Slot,
    /// Time since this node's last SYNC, if it produces SYNC.
    since_us: u64,
    /// Counter of this node's own last SYNC.
    own_counter: u8,
    /// Counter of the last SYNC that was heard, if it had one.
    counter: Option<u8>,
    /// SYNCs on the bus, for the quirk that loses some.
    n_syncs: u32,
    lost_every: u32,
}

impl SyncService {
    pub(super) fn find(dictionary: &Dictionary) -> Result<Self, AbortCode> {
        let slot = |index| dictionary.find(ObjectAddress::new(index, 0));
        Ok(Self {
            cob_id: slot(objects::COB_ID_SYNC)?,
            period_us: slot(objects::CYCLE_PERIOD)?,
            overflow: slot(objects::SYNC_COUNTER_OVERFLOW)?,
            since_us: 0,
            own_counter: 0,
            counter: None,
            n_syncs: 0,
            lost_every: 0,
        })
    }

    /// Loses one SYNC in so many from now on; 0 for none.
    pub(super) fn lose_every(&mut self, n_syncs: u32) {
        self.lost_every = n_syncs;
    }

    /// Counts this node's own SYNC from the beginning.
    pub(super) fn restart(&mut self) {
        self.own_counter = 0;
    }

    /// Returns the counter of the last SYNC, if it had one.
    pub(super) fn counter(&self) -> Option<u8> {
        self.counter
    }

    /// Returns whether a frame with this identifier is a SYNC.
    pub(super) fn has_identifier(&self, cob_id: u16, dictionary: &Dictionary) -> bool {
        i64::from(cob_id) == dictionary.number(self.cob_id) & IDENTIFIER
    }

    /// Interprets a frame.
    pub(super) fn hear(&mut self, frame: &Frame, dictionary: &Dictionary) -> Heard {
        if !self.has_identifier(frame.id(), dictionary) || frame.payload().len() > 1 {
            return Heard::Foreign;
        }
        if dictionary.number(self.overflow) != 0 && frame.payload().is_empty() {
            return Heard::WithoutCounter;
        }
        self.counter = frame.payload().first().copied();
        self.n_syncs = self.n_syncs.wrapping_add(1);
        if self.lost_every > 0 && self.n_syncs.is_multiple_of(self.lost_every) {
            Heard::Missed
        } else {
            Heard::Sync
        }
    }

    /// Returns the period of the SYNC that this node produces, if it does.
    fn own_period_us(&self, dictionary: &Dictionary) -> Option<u64> {
        let produces = dictionary.number(self.cob_id) & PRODUCER != 0;
        let period_us = u64::try_from(dictionary.number(self.period_us)).unwrap_or(0);
        (produces && period_us > 0).then_some(period_us)
    }

    /// Lets time pass.
    pub(super) fn pass(&mut self, elapsed_us: u64, dictionary: &Dictionary) {
        let produces = self.own_period_us(dictionary).is_some();
        self.since_us = if produces { self.since_us + elapsed_us } else { 0 };
    }

    /// Returns the time after which this node must produce a SYNC; none is due before.
    pub(super) fn rest_us(&self, dictionary: &Dictionary) -> u64 {
        let period_us = self.own_period_us(dictionary);
        period_us.map_or(u64::MAX, |period_us| period_us.saturating_sub(self.since_us))
    }

    /// Returns the SYNC that this node must produce now.
    pub(super) fn take_due(&mut self, dictionary: &Dictionary) -> Option<Frame> {
        if self.since_us < self.own_period_us(dictionary)? {
            return None;
        }
        self.since_us = 0;
        let overflow = u8::try_from(dictionary.number(self.overflow)).unwrap_or(0);
        if overflow == 0 {
            return Some(sync::frame());
        }
        self.own_counter = if self.own_counter >= overflow { 1 } else { self.own_counter + 1 };
        Frame::new(cob_id::SYNC, &[self.own_counter])
    }
}
