//! Communication of every CANopen node: NMT, boot-up, heartbeat, SDO, PDO and EMCY around one dictionary.

mod answers;

use ilc_rt::config::Quirks;
use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{
    AbortCode, Heartbeat, NmtCommand, NmtState, NodeId, ObjectAddress, cob_id, emcy,
};
use ilc_rt::fieldbus::cia402::objects;

use super::dictionary::{Dictionary, Entry, Slot};
use super::drive_objects;
use super::emergencies::Emergencies;
use super::heartbeats::Heartbeats;
use super::object_access::refuse_under_halt;
use super::pdo_engine::{PdoEngine, Received};
use super::sdo_server::SdoServer;
use super::sync_service::{Heard, SyncService};

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
    behaviour: Slot,
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
    heartbeats: Heartbeats,
    sync: SyncService,
    emergencies: Emergencies,
    habits: Habits,
    /// An SDO answer that is due after some time.
    late_answer: Option<(Frame, u64)>,
    /// Time that has passed without being counted, because nothing falls due within `rest_us`.
    passed_us: u64,
    rest_us: u64,
}

/// Habits of real drives that concern their communication.
#[derive(Clone, Copy, Debug, Default)]
struct Habits {
    keeps_mode_under_halt: bool,
    answer_delay_us: u64,
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
            behaviour: slot(objects::ERROR_BEHAVIOUR, 1)?,
            verified: [
                slot(objects::VERIFY_CONFIGURATION, 1)?,
                slot(objects::VERIFY_CONFIGURATION, 2)?,
            ],
        };
        let pdos = PdoEngine::new(&dictionary);
        let emergencies = Emergencies::find(node, &dictionary)?;
        let heartbeats = Heartbeats::find(&dictionary)?;
        let sync = SyncService::find(&dictionary)?;
        Ok(Self {
            node,
            nmt: NmtState::BootUp,
            dictionary,
            pdos,
            sdo: SdoServer::default(),
            slots,
            heartbeats,
            sync,
            emergencies,
            habits: Habits::default(),
            late_answer: None,
            passed_us: 0,
            rest_us: 0,
        })
    }

    /// Takes over the habits of a real drive: objects that it lacks, slow answers, deaf moments.
    pub fn take_habits(&mut self, quirks: &Quirks) {
        for index in drive_objects::lacking(quirks) {
            self.dictionary.hide(index);
        }
        for (index, sub) in drive_objects::lacking_subs(quirks) {
            self.dictionary.hide_sub(index, sub);
        }
        if quirks.lacks_emergencies {
            self.emergencies.silence();
        }
        self.habits = Habits {
            keeps_mode_under_halt: quirks.keeps_mode_under_halt,
            answer_delay_us: u64::from(quirks.sdo_delay_ms) * 1000,
        };
        self.sync.lose_every(quirks.sync_lost_every);
        self.pdos = PdoEngine::new(&self.dictionary);
    }

    /// Takes PDOs of up to so many bytes: 64 on a bus with CAN FD.
    pub fn take_payloads_of(&mut self, n_bytes: usize) {
        self.dictionary.take_payloads_of(n_bytes);
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

    /// Returns false for frames of others, and those that no node of this kind hears.
    #[inline]
    fn concerns(&self, frame: &Frame) -> bool {
        let id = frame.id();
        id == cob_id::NMT
            || id & 0x780 == cob_id::HEARTBEAT
            || self.is_question(frame)
            || self.sync.has_identifier(id, &self.dictionary)
            || self.pdos.has_receiver(id)
    }

    /// Returns whether `frame` asks this node for an object, so that its values must be fresh.
    pub fn is_question(&self, frame: &Frame) -> bool {
        frame.id() == cob_id::of(cob_id::SDO_REQUEST, self.node)
    }

    /// Sends the boot-up message and becomes pre-operational.
    pub fn boot(&mut self, out: &mut dyn FnMut(Frame)) {
        self.catch_up();
        out(Heartbeat { node: self.node, state: NmtState::BootUp }.encode());
        self.nmt = NmtState::PreOperational;
        self.heartbeats.restart_own();
    }

    /// Handles a frame from the bus.
    #[inline]
    pub fn receive(&mut self, frame: &Frame, out: &mut dyn FnMut(Frame)) -> Incoming {
        if !self.concerns(frame) {
            return Incoming::Nothing;
        }
        self.catch_up();
        if let Some((command, node)) = NmtCommand::decode(frame) {
            if node.is_none_or(|node| node == self.node) {
                self.command(command, out);
                return Incoming::Nmt(command);
            }
            return Incoming::Nothing;
        }
        self.heartbeats.hear(frame, &self.dictionary);
        if self.nmt == NmtState::Stopped || self.nmt == NmtState::BootUp {
            return Incoming::Nothing;
        }
        if self.is_question(frame) {
            return self.answer(frame, out);
        }
        if self.nmt != NmtState::Operational {
            return Incoming::Nothing;
        }
        match self.sync.hear(frame, &self.dictionary) {
            Heard::Foreign => {}
            Heard::Sync => return Incoming::Sync,
            Heard::Missed => return Incoming::Nothing,
            Heard::WithoutCounter => {
                self.emergency(emcy::CODE_SYNC_LENGTH, out);
                return Incoming::Nothing;
            }
        }
        let received = self.pdos.receive(frame, &mut self.dictionary);
        if self.pdos.take_excess() {
            self.emergency(emcy::CODE_PDO_EXCESS, out);
        }
        match received {
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
        self.pdos.transmit_at_sync(self.sync.counter(), &self.dictionary, out);
    }

    /// Lets time pass; returns true if something may be due, for [`attend`](Self::attend).
    #[inline]
    pub fn pass(&mut self, elapsed_us: u64) -> bool {
        if self.nmt == NmtState::BootUp {
            return false;
        }
        self.passed_us += elapsed_us;
        self.passed_us >= self.rest_us
    }

    /// Does what is due: heartbeat, event-driven TPDOs, and timeouts.
    pub fn attend(&mut self, out: &mut dyn FnMut(Frame)) -> Silence {
        self.catch_up();
        let silence = self.do_what_is_due(out);
        self.rest_us = self.time_to_rest_us();
        silence
    }

    /// Counts the time that has passed; the next step looks again for what is due.
    fn catch_up(&mut self) {
        let elapsed_us = std::mem::take(&mut self.passed_us);
        self.rest_us = 0;
        if elapsed_us == 0 {
            return;
        }
        self.heartbeats.pass(elapsed_us, &self.dictionary);
        if self.nmt != NmtState::Stopped {
            self.sync.pass(elapsed_us, &self.dictionary);
        }
        self.emergencies.pass(elapsed_us);
        if let Some((_, left_us)) = &mut self.late_answer {
            *left_us = left_us.saturating_sub(elapsed_us);
        }
        if self.nmt == NmtState::Operational {
            self.pdos.pass(elapsed_us);
        }
    }

    /// Returns the time within which nothing falls due, unless a frame comes or an emergency happens.
    fn time_to_rest_us(&self) -> u64 {
        if self.emergencies.has_waiting() {
            return 0;
        }
        let late_us = self.late_answer.as_ref().map_or(u64::MAX, |(_, left_us)| *left_us);
        let is_operational = self.nmt == NmtState::Operational;
        let pdo_us = if is_operational { self.pdos.rest_us() } else { u64::MAX };
        let dictionary = &self.dictionary;
        let services_us = self.heartbeats.rest_us(dictionary).min(self.sync.rest_us(dictionary));
        services_us.min(late_us).min(pdo_us)
    }

    fn do_what_is_due(&mut self, out: &mut dyn FnMut(Frame)) -> Silence {
        if self.heartbeats.take_due(&self.dictionary) {
            out(Heartbeat { node: self.node, state: self.nmt }.encode());
        }
        if self.nmt != NmtState::Stopped
            && let Some(sync) = self.sync.take_due(&self.dictionary)
        {
            out(sync);
        }
        let may_send = self.may_send_emergencies();
        self.emergencies.send_waiting(may_send, &self.dictionary, out);
        self.answer_late(out);
        if self.nmt == NmtState::Operational {
            self.pdos.transmit_events(&self.dictionary, out);
            if self.pdos.deadline_passed() {
                self.emergency(emcy::CODE_RPDO_TIMEOUT, out);
                return Silence::Command;
            }
        }
        if self.heartbeats.controller_is_silent(&self.dictionary) {
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
        self.catch_up();
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
                self.heartbeats.disarm();
                self.late_answer = None;
                self.sync.restart();
                self.boot(out);
            }
        }
    }
}
