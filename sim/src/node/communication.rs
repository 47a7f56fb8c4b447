//! Communication of every CANopen node: NMT, boot-up, heartbeat, SDO, PDO and EMCY around one dictionary.

use ilc_rt::config::Quirks;
use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{
    AbortCode, Heartbeat, NmtCommand, NmtState, NodeId, ObjectAddress, cob_id, emcy, sync,
};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Dictionary, Entry, Mappable, Slot};
use super::drive_objects;
use super::emergencies::Emergencies;
use super::object_access::{ObjectAccess, refuse_under_halt};
use super::pdo_engine::{PdoEngine, Received};
use super::pdo_rules;
use super::sdo_server::SdoServer;

/// In 0x1005: this node produces SYNC.
const SYNC_PRODUCER: i64 = 1 << 30;
/// In 0x1005: the identifier.
const SYNC_IDENTIFIER: i64 = 0x7FF;
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
    consumer: Slot,
    producer_ms: Slot,
    behaviour: Slot,
    sync: Slot,
    sync_period_us: Slot,
    sync_counter: Slot,
    verified: [Slot; 2],
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
    emergencies: Emergencies,
    /// Counter of the last SYNC, if it had one.
    counter: Option<u8>,
    /// Counter of this node's own last SYNC.
    own_counter: u8,
    /// SYNCs on the bus, for the quirk that loses some.
    n_syncs: u32,
    habits: Habits,
    /// An SDO answer that is due after some time.
    late_answer: Option<(Frame, u64)>,
}

/// Habits of real drives that concern their communication.
#[derive(Clone, Copy, Debug, Default)]
struct Habits {
    keeps_mode_under_halt: bool,
    answer_delay_us: u64,
    sync_lost_every: u32,
}

impl Communication {
    /// Creates a node that has not booted yet.
    ///
    /// # Errors
    /// The abort code of a missing object of the communication profile.
    pub fn new(node: NodeId, entries: Vec<Entry>) -> Result<Self, AbortCode> {
        let dictionary = Dictionary::new(entries);
        let slot = |index, sub| dictionary.find(ObjectAddress::new(index, sub));
        let slots = Slots {
            consumer: slot(objects::CONSUMER_HEARTBEAT, 1)?,
            producer_ms: slot(objects::PRODUCER_HEARTBEAT, 0)?,
            behaviour: slot(objects::ERROR_BEHAVIOUR, 1)?,
            sync: slot(objects::COB_ID_SYNC, 0)?,
            sync_period_us: slot(objects::CYCLE_PERIOD, 0)?,
            sync_counter: slot(objects::SYNC_COUNTER_OVERFLOW, 0)?,
            verified: [
                slot(objects::VERIFY_CONFIGURATION, 1)?,
                slot(objects::VERIFY_CONFIGURATION, 2)?,
            ],
        };
        let pdos = PdoEngine::new(&dictionary);
        let emergencies = Emergencies::find(node, &dictionary)?;
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
            emergencies,
            counter: None,
            own_counter: 0,
            n_syncs: 0,
            habits: Habits::default(),
            late_answer: None,
        })
    }

    /// Takes over the habits of a real drive: objects that it lacks, slow answers, deaf moments.
    pub fn take_habits(&mut self, quirks: &Quirks) {
        for index in drive_objects::lacking(quirks) {
            self.dictionary.hide(index);
        }
        if quirks.lacks_emergencies {
            self.emergencies.silence();
        }
        self.habits = Habits {
            keeps_mode_under_halt: quirks.keeps_mode_under_halt,
            answer_delay_us: u64::from(quirks.sdo_delay_ms) * 1000,
            sync_lost_every: quirks.sync_lost_every,
        };
        self.pdos = PdoEngine::new(&self.dictionary);
    }

    /// Returns whether the mode may be changed now.
    pub fn may_change_mode(&self) -> bool {
        !self.habits.keeps_mode_under_halt || refuse_under_halt(&self.dictionary).is_ok()
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
        self.emergencies.take_last()
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
            self.counter = frame.payload().first().copied();
            return if self.misses_sync() { Incoming::Nothing } else { Incoming::Sync };
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
        self.pdos.transmit_at_sync(self.counter, &self.dictionary, out);
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
            out(self.own_sync());
        }
        let may_send = self.may_send_emergencies();
        self.emergencies.advance(elapsed_us, may_send, &self.dictionary, out);
        self.answer_late(elapsed_us, out);
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
        let may_send = self.may_send_emergencies();
        self.emergencies.report(code, may_send, &mut self.dictionary, out);
    }

    fn may_send_emergencies(&self) -> bool {
        matches!(self.nmt, NmtState::PreOperational | NmtState::Operational)
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
                self.late_answer = None;
                self.own_counter = 0;
                self.boot(out);
            }
        }
    }

    fn answer(&mut self, frame: &Frame, out: &mut dyn FnMut(Frame)) -> Incoming {
        let mut server = self.sdo;
        let keeps_mode_under_halt = self.habits.keeps_mode_under_halt;
        let mut access =
            ObjectAccess { dictionary: &mut self.dictionary, keeps_mode_under_halt, written: None };
        let answer = server.answer(frame.payload(), &mut access);
        let written = access.written;
        self.sdo = server;
        if let Some(answer) = answer {
            let id = cob_id::of(cob_id::SDO_RESPONSE, self.node);
            if let Some(frame) = Frame::new(id, &answer.encode()) {
                self.answer_in_time(frame, out);
            }
        }
        let Some(address) = written else { return Incoming::Nothing };
        self.forget_verification(address);
        if pdo_rules::pdo_at(address.index).is_some() {
            self.pdos = PdoEngine::new(&self.dictionary);
        }
        match address.index {
            objects::PRODUCER_HEARTBEAT => self.heartbeat_us = 0,
            objects::CONSUMER_HEARTBEAT => self.controller_us = None,
            objects::ERROR_HISTORY => self.emergencies.clear(&mut self.dictionary),
            _ => {}
        }
        Incoming::Written
    }

    /// Sends an SDO answer, at once or after the time that this drive takes.
    fn answer_in_time(&mut self, answer: Frame, out: &mut dyn FnMut(Frame)) {
        if let Some((earlier, _)) = self.late_answer.take() {
            out(earlier);
        }
        if self.habits.answer_delay_us == 0 {
            out(answer);
        } else {
            self.late_answer = Some((answer, self.habits.answer_delay_us));
        }
    }

    fn answer_late(&mut self, elapsed_us: u64, out: &mut dyn FnMut(Frame)) {
        let Some((answer, left_us)) = self.late_answer else { return };
        let left_us = left_us.saturating_sub(elapsed_us);
        self.late_answer = (left_us > 0).then_some((answer, left_us));
        if left_us == 0 {
            out(answer);
        }
    }

    /// Clears 0x1020 when the configuration that it stands for is changed.
    fn forget_verification(&mut self, written: ObjectAddress) {
        let is_configuration = !matches!(
            written.index,
            objects::VERIFY_CONFIGURATION | objects::STORE_PARAMETERS | objects::ERROR_HISTORY
        ) && self
            .dictionary
            .find(written)
            .is_ok_and(|slot| self.dictionary.entry(slot).mappable == Mappable::No);
        if is_configuration {
            for slot in self.slots.verified {
                self.dictionary.set(slot, 0);
            }
        }
    }

    /// Counts SYNCs and returns true for one that this drive does not hear.
    fn misses_sync(&mut self) -> bool {
        self.n_syncs = self.n_syncs.wrapping_add(1);
        self.habits.sync_lost_every > 0 && self.n_syncs.is_multiple_of(self.habits.sync_lost_every)
    }

    /// Returns this node's own SYNC, with a counter if one is set.
    fn own_sync(&mut self) -> Frame {
        let overflow = u8::try_from(self.dictionary.number(self.slots.sync_counter)).unwrap_or(0);
        if overflow == 0 {
            return sync::frame();
        }
        self.own_counter = if self.own_counter >= overflow { 1 } else { self.own_counter + 1 };
        Frame::new(cob_id::SYNC, &[self.own_counter]).unwrap_or_default()
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
