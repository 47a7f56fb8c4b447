//! Emergencies of a node: message, error register, and history.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{AbortCode, Emergency, NodeId, ObjectAddress, emcy};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Dictionary, Slot};
use super::standard_objects::HISTORY_MAX;

/// Bit 0 of the error register: any error.
const REGISTER_GENERIC: i64 = 0x01;
/// Bit 4 of the error register: communication.
const REGISTER_COMMUNICATION: i64 = 0x10;
/// Bit 5 of the error register: device profile.
const REGISTER_PROFILE: i64 = 0x20;
/// Unit of the inhibit time.
const INHIBIT_UNIT_US: u64 = 100;

/// The emergencies of a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emergencies {
    node: NodeId,
    register: Slot,
    n_errors: Slot,
    history: [Slot; HISTORY_MAX as usize],
    inhibit: Slot,
    /// The drive lacks them: only register and history are kept.
    is_mute: bool,
    /// Time since the last message.
    since_us: Option<u64>,
    /// Waits for the end of the inhibit time; the newest counts.
    waiting: Option<Emergency>,
    last: Option<u16>,
}

impl Emergencies {
    pub(super) fn find(node: NodeId, dictionary: &Dictionary) -> Result<Self, AbortCode> {
        let slot = |index, sub| dictionary.find(ObjectAddress::new(index, sub));
        let mut history = [Slot::FIRST; HISTORY_MAX as usize];
        for (place, sub) in history.iter_mut().zip(1..) {
            *place = slot(objects::ERROR_HISTORY, sub)?;
        }
        Ok(Self {
            node,
            register: slot(objects::ERROR_REGISTER, 0)?,
            n_errors: slot(objects::ERROR_HISTORY, 0)?,
            history,
            inhibit: slot(objects::INHIBIT_TIME_EMCY, 0)?,
            is_mute: false,
            since_us: None,
            waiting: None,
            last: None,
        })
    }

    /// Sends no message from now on.
    pub(super) fn silence(&mut self) {
        self.is_mute = true;
    }

    /// Takes the last code reported since the last call.
    pub(super) fn take_last(&mut self) -> Option<u16> {
        self.last.take()
    }

    /// Enters an error into register and history, and sends its message if the node may.
    pub(super) fn report(
        &mut self,
        code: u16,
        may_send: bool,
        dictionary: &mut Dictionary,
        out: &mut dyn FnMut(Frame),
    ) {
        let group = if code >> 8 == 0x81 || code >> 8 == 0x82 {
            REGISTER_COMMUNICATION
        } else {
            REGISTER_PROFILE
        };
        let register = if code == emcy::CODE_RESET {
            0
        } else {
            self.remember(code, dictionary);
            dictionary.number(self.register) | REGISTER_GENERIC | group
        };
        dictionary.set(self.register, register);
        self.last = Some(code);
        if !may_send || self.is_mute {
            return;
        }
        let register = u8::try_from(register).unwrap_or(u8::MAX);
        self.waiting = Some(Emergency { node: self.node, code, register, vendor: [0; 5] });
        self.send(dictionary, out);
    }

    /// Lets time pass.
    pub(super) fn pass(&mut self, elapsed_us: u64) {
        self.since_us = self.since_us.map(|since_us| since_us.saturating_add(elapsed_us));
    }

    /// Returns whether a message waits for its time.
    pub(super) fn has_waiting(&self) -> bool {
        self.waiting.is_some()
    }

    /// Sends a message that waited, if its time has come.
    pub(super) fn send_waiting(
        &mut self,
        may_send: bool,
        dictionary: &Dictionary,
        out: &mut dyn FnMut(Frame),
    ) {
        if may_send {
            self.send(dictionary, out);
        } else {
            self.waiting = None;
        }
    }

    fn send(&mut self, dictionary: &Dictionary, out: &mut dyn FnMut(Frame)) {
        let inhibit = u64::try_from(dictionary.number(self.inhibit)).unwrap_or(0);
        if self.since_us.is_some_and(|since_us| since_us < inhibit * INHIBIT_UNIT_US) {
            return;
        }
        if let Some(emergency) = self.waiting.take() {
            self.since_us = Some(0);
            out(emergency.encode());
        }
    }

    /// Empties the history, 0x1003.
    pub(super) fn clear(&self, dictionary: &mut Dictionary) {
        for slot in self.history {
            dictionary.set(slot, 0);
        }
    }

    /// Adds a code at the head of the history.
    fn remember(&self, code: u16, dictionary: &mut Dictionary) {
        for at in (1..self.history.len()).rev() {
            let older = dictionary.number(self.history[at - 1]);
            dictionary.set(self.history[at], older);
        }
        dictionary.set(self.history[0], code.into());
        let n_errors = dictionary.number(self.n_errors) + 1;
        dictionary.set(self.n_errors, n_errors.min(HISTORY_MAX.into()));
    }
}
