//! Communication of every CANopen node: NMT, boot-up, heartbeat, SDO, PDO and EMCY around one dictionary.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{
    AbortCode, Emergency, Heartbeat, NmtCommand, NmtState, NodeId, ObjectAddress, cob_id, emcy,
    sync,
};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Dictionary, Entry, Slot};
use super::pdo_engine::{PdoEngine, Received};
use super::pdo_rules;
use super::sdo_server::{Objects, SdoServer};
use super::standard_objects::HISTORY_MAX;
use super::value::Value;

/// Bit 0 of the error register: any error.
const REGISTER_GENERIC: i64 = 0x01;
/// Bit 4 of the error register: communication.
const REGISTER_COMMUNICATION: i64 = 0x10;
/// Bit 5 of the error register: device profile.
const REGISTER_PROFILE: i64 = 0x20;

/// In 0x1005: this node produces SYNC.
const SYNC_PRODUCER: i64 = 1 << 30;
/// In 0x1005: the identifier.
const SYNC_IDENTIFIER: i64 = 0x7FF;
/// "save", as it is written to 0x1010.
const SAVE: i64 = 0x6576_6173;
/// "load", as it is written to 0x1011.
const LOAD: i64 = 0x6461_6F6C;

/// Meaning of a frame to the device behind the communication.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Incoming {
    /// Nothing.
    Nothing,
    /// An NMT command was executed.
    Nmt(NmtCommand),
    /// Objects were written: by SDO, or by an RPDO with immediate effect.
    Written,
    /// SYNC, while operational: time to sample, take over targets and send.
    Sync,
}

/// Events of passing time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silence {
    /// Nothing is overdue.
    None,
    /// An RPDO timed out.
    Command,
    /// The heartbeat of the controller stopped.
    Heartbeat,
}

/// Objects used by the communication itself.
#[derive(Clone, Copy, Debug)]
struct Slots {
    register: Slot,
    n_errors: Slot,
    history: [Slot; HISTORY_MAX as usize],
    consumer: Slot,
    producer_ms: Slot,
    behaviour: Slot,
    sync: Slot,
    sync_period_us: Slot,
    sync_counter: Slot,
}

/// The CANopen side of a node.
#[derive(Clone, Debug)]
pub struct Communication {
    node: NodeId,
    nmt: NmtState,
    dictionary: Dictionary,
    pdos: PdoEngine,
    sdo: SdoServer,
    slots: Slots,
    heartbeat_us: u64,
    /// Time since this node's last SYNC, if it produces SYNC.
    sync_us: u64,
    /// Time since the controller's last heartbeat; `None` before the first.
    controller_us: Option<u64>,
    last_emergency: Option<u16>,
}

impl Communication {
    /// Creates a node that has not booted yet.
    ///
    /// # Errors
    /// The abort code of a missing object of the communication profile.
    pub fn new(node: NodeId, entries: Vec<Entry>) -> Result<Self, AbortCode> {
        let dictionary = Dictionary::new(entries);
        let slot = |index, sub| dictionary.find(ObjectAddress::new(index, sub));
        let mut history = [Slot::FIRST; HISTORY_MAX as usize];
        for (place, sub) in history.iter_mut().zip(1..) {
            *place = slot(objects::ERROR_HISTORY, sub)?;
        }
        let slots = Slots {
            register: slot(objects::ERROR_REGISTER, 0)?,
            n_errors: slot(objects::ERROR_HISTORY, 0)?,
            history,
            consumer: slot(objects::CONSUMER_HEARTBEAT, 1)?,
            producer_ms: slot(objects::PRODUCER_HEARTBEAT, 0)?,
            behaviour: slot(objects::ERROR_BEHAVIOUR, 1)?,
            sync: slot(objects::COB_ID_SYNC, 0)?,
            sync_period_us: slot(objects::CYCLE_PERIOD, 0)?,
            sync_counter: slot(objects::SYNC_COUNTER_OVERFLOW, 0)?,
        };
        let pdos = PdoEngine::new(&dictionary);
        Ok(Self {
            node,
            nmt: NmtState::BootUp,
            dictionary,
            pdos,
            sdo: SdoServer::default(),
            slots,
            heartbeat_us: 0,
            sync_us: 0,
            controller_us: None,
            last_emergency: None,
        })
    }

    /// Returns the node number.
    pub fn node(&self) -> NodeId {
        self.node
    }

    /// Returns the NMT state.
    pub fn nmt(&self) -> NmtState {
        self.nmt
    }

    /// Returns the objects.
    pub fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// Returns the objects, for the device to store its values.
    pub fn dictionary_mut(&mut self) -> &mut Dictionary {
        &mut self.dictionary
    }

    /// Returns whether the sender of RPDO1 has promised to be cyclic.
    pub fn has_deadline(&self) -> bool {
        self.pdos.has_deadline()
    }

    /// Takes the last emergency sent since the last call.
    pub fn take_emergency(&mut self) -> Option<u16> {
        self.last_emergency.take()
    }

    /// Returns whether `frame` asks this node for an object, so that its values must be fresh.
    pub fn is_question(&self, frame: &Frame) -> bool {
        frame.id() == cob_id::of(cob_id::SDO_REQUEST, self.node)
    }

    /// Sends the boot-up message and becomes pre-operational.
    pub fn boot(&mut self, out: &mut dyn FnMut(Frame)) {
        out(Heartbeat { node: self.node, state: NmtState::BootUp }.encode());
        self.nmt = NmtState::PreOperational;
        self.heartbeat_us = 0;
    }

    /// Handles a frame from the bus.
    pub fn receive(&mut self, frame: &Frame, out: &mut dyn FnMut(Frame)) -> Incoming {
        if let Some((command, node)) = NmtCommand::decode(frame) {
            if node.is_none_or(|node| node == self.node) {
                self.command(command, out);
                return Incoming::Nmt(command);
            }
            return Incoming::Nothing;
        }
        self.hear_heartbeat(frame);
        if self.nmt == NmtState::Stopped || self.nmt == NmtState::BootUp {
            return Incoming::Nothing;
        }
        if self.is_question(frame) {
            return self.answer(frame, out);
        }
        if self.nmt != NmtState::Operational {
            return Incoming::Nothing;
        }
        if self.is_sync(frame) {
            if self.dictionary.number(self.slots.sync_counter) != 0 && frame.payload().is_empty() {
                self.emergency(emcy::CODE_SYNC_LENGTH, out);
                return Incoming::Nothing;
            }
            return Incoming::Sync;
        }
        match self.pdos.receive(frame, &mut self.dictionary) {
            Received::Applied => Incoming::Written,
            Received::TooShort => {
                self.emergency(emcy::CODE_PDO_LENGTH, out);
                Incoming::Nothing
            }
            Received::Foreign | Received::Latched => Incoming::Nothing,
        }
    }

    /// Applies the RPDOs that arrived since the last SYNC.
    pub fn apply_latched(&mut self) {
        self.pdos.apply_latched(&mut self.dictionary);
    }

    /// Sends the TPDOs due at this SYNC.
    pub fn transmit_at_sync(&mut self, out: &mut dyn FnMut(Frame)) {
        self.pdos.transmit_at_sync(&self.dictionary, out);
    }

    /// Advances time: heartbeat, event-driven TPDOs, and timeouts.
    pub fn advance(&mut self, elapsed_us: u64, out: &mut dyn FnMut(Frame)) -> Silence {
        if self.nmt == NmtState::BootUp {
            return Silence::None;
        }
        let period_us = self.microseconds(self.slots.producer_ms);
        self.heartbeat_us += elapsed_us;
        if period_us > 0 && self.heartbeat_us >= period_us {
            self.heartbeat_us = 0;
            out(Heartbeat { node: self.node, state: self.nmt }.encode());
        }
        if self.nmt != NmtState::Stopped && self.is_sync_due(elapsed_us) {
            out(sync::frame());
        }
        if self.nmt == NmtState::Operational {
            self.pdos.transmit_events(elapsed_us, &self.dictionary, out);
            if self.pdos.deadline_passed(elapsed_us) {
                self.emergency(emcy::CODE_RPDO_TIMEOUT, out);
                return Silence::Command;
            }
        }
        if self.controller_is_silent(elapsed_us) {
            self.emergency(emcy::CODE_HEARTBEAT, out);
            match self.dictionary.number(self.slots.behaviour) {
                0 => self.nmt = NmtState::PreOperational,
                2 => self.nmt = NmtState::Stopped,
                _ => {}
            }
            return Silence::Heartbeat;
        }
        Silence::None
    }

    /// Sends an emergency message, unless stopped, and adds it to the history.
    pub fn emergency(&mut self, code: u16, out: &mut dyn FnMut(Frame)) {
        let group = if code >> 8 == 0x81 || code >> 8 == 0x82 {
            REGISTER_COMMUNICATION
        } else {
            REGISTER_PROFILE
        };
        let register = if code == emcy::CODE_RESET {
            0
        } else {
            self.remember(code);
            self.dictionary.number(self.slots.register) | REGISTER_GENERIC | group
        };
        self.dictionary.set(self.slots.register, register);
        self.last_emergency = Some(code);
        if matches!(self.nmt, NmtState::PreOperational | NmtState::Operational) {
            let register = u8::try_from(register).unwrap_or(u8::MAX);
            out(Emergency { node: self.node, code, register, vendor: [0; 5] }.encode());
        }
    }

    /// Adds a code at the head of the history, 0x1003.
    fn remember(&mut self, code: u16) {
        for at in (1..self.slots.history.len()).rev() {
            let older = self.dictionary.number(self.slots.history[at - 1]);
            self.dictionary.set(self.slots.history[at], older);
        }
        self.dictionary.set(self.slots.history[0], code.into());
        let n_errors = self.dictionary.number(self.slots.n_errors) + 1;
        self.dictionary.set(self.slots.n_errors, n_errors.min(HISTORY_MAX.into()));
    }

    fn command(&mut self, command: NmtCommand, out: &mut dyn FnMut(Frame)) {
        match command {
            NmtCommand::Start => {
                if self.nmt != NmtState::Operational {
                    self.pdos = PdoEngine::new(&self.dictionary);
                }
                self.nmt = NmtState::Operational;
            }
            NmtCommand::Stop => self.nmt = NmtState::Stopped,
            NmtCommand::PreOperational => self.nmt = NmtState::PreOperational,
            NmtCommand::ResetNode | NmtCommand::ResetCommunication => {
                let last = if command == NmtCommand::ResetNode { u16::MAX } else { 0x1FFF };
                self.dictionary.reset(0x1000, last);
                self.pdos = PdoEngine::new(&self.dictionary);
                self.sdo = SdoServer::default();
                self.controller_us = None;
                self.boot(out);
            }
        }
    }

    fn answer(&mut self, frame: &Frame, out: &mut dyn FnMut(Frame)) -> Incoming {
        let mut server = self.sdo;
        let mut access = DictionaryAccess { dictionary: &mut self.dictionary, written: None };
        let answer = server.answer(frame.payload(), &mut access);
        let written = access.written;
        self.sdo = server;
        if let Some(answer) = answer {
            let id = cob_id::of(cob_id::SDO_RESPONSE, self.node);
            if let Some(frame) = Frame::new(id, &answer.encode()) {
                out(frame);
            }
        }
        let Some(address) = written else { return Incoming::Nothing };
        if pdo_rules::pdo_at(address.index).is_some() {
            self.pdos = PdoEngine::new(&self.dictionary);
        }
        match address.index {
            objects::PRODUCER_HEARTBEAT => self.heartbeat_us = 0,
            objects::CONSUMER_HEARTBEAT => self.controller_us = None,
            objects::ERROR_HISTORY => {
                for slot in self.slots.history {
                    self.dictionary.set(slot, 0);
                }
            }
            _ => {}
        }
        Incoming::Written
    }

    /// Returns whether `frame` is a SYNC on the identifier that this node listens to.
    fn is_sync(&self, frame: &Frame) -> bool {
        let identifier = self.dictionary.number(self.slots.sync) & SYNC_IDENTIFIER;
        i64::from(frame.id()) == identifier && frame.payload().len() <= 1
    }

    /// Advances time and returns true if this node must produce a SYNC now.
    fn is_sync_due(&mut self, elapsed_us: u64) -> bool {
        let produces = self.dictionary.number(self.slots.sync) & SYNC_PRODUCER != 0;
        let period_us =
            u64::try_from(self.dictionary.number(self.slots.sync_period_us)).unwrap_or(0);
        if !produces || period_us == 0 {
            self.sync_us = 0;
            return false;
        }
        self.sync_us += elapsed_us;
        let is_due = self.sync_us >= period_us;
        if is_due {
            self.sync_us = 0;
        }
        is_due
    }

    /// Returns node and period of the consumed heartbeat, 0x1016:01.
    fn watched(&self) -> Option<(NodeId, u64)> {
        let [low, high, node, _] =
            u32::try_from(self.dictionary.number(self.slots.consumer)).unwrap_or(0).to_le_bytes();
        let period_us = u64::from(u16::from_le_bytes([low, high])) * 1000;
        NodeId::new(node).filter(|_| period_us > 0).map(|node| (node, period_us))
    }

    fn hear_heartbeat(&mut self, frame: &Frame) {
        let Some(heartbeat) = Heartbeat::decode(frame) else { return };
        if self.watched().is_some_and(|(node, _)| node == heartbeat.node) {
            self.controller_us = Some(0);
        }
    }

    /// Counts the silence of the watched heartbeat; each one is reported once.
    fn controller_is_silent(&mut self, elapsed_us: u64) -> bool {
        let (Some(since_us), Some((_, period_us))) = (self.controller_us, self.watched()) else {
            return false;
        };
        let since_us = since_us + elapsed_us;
        let is_silent = since_us > period_us;
        self.controller_us = (!is_silent).then_some(since_us);
        is_silent
    }

    fn microseconds(&self, milliseconds: Slot) -> u64 {
        u64::try_from(self.dictionary.number(milliseconds)).unwrap_or(0) * 1000
    }
}

/// The dictionary for the SDO server, with the rules of process-data parameters.
struct DictionaryAccess<'a> {
    dictionary: &'a mut Dictionary,
    written: Option<ObjectAddress>,
}

impl Objects for DictionaryAccess<'_> {
    fn read(&self, address: ObjectAddress) -> Result<Value, AbortCode> {
        self.dictionary.find(address).map(|slot| self.dictionary.entry(slot).value())
    }

    fn write(&mut self, address: ObjectAddress, bytes: &[u8]) -> Result<(), AbortCode> {
        let slot = self.dictionary.find(address)?;
        let value = self.dictionary.check(slot, bytes)?;
        pdo_rules::check(self.dictionary, address, value.number())?;
        match (address.index, value.number()) {
            (objects::STORE_PARAMETERS, SAVE) => self.dictionary.save(),
            (objects::RESTORE_DEFAULTS, LOAD) => self.dictionary.restore_factory(),
            (objects::STORE_PARAMETERS | objects::RESTORE_DEFAULTS, _) => {
                return Err(AbortCode::CannotStore);
            }
            _ => self.dictionary.store(slot, value),
        }
        self.written = Some(address);
        Ok(())
    }
}
