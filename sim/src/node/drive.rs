//! A simulated CiA 402 drive: communication, state machine, motion, and the faults between them.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{AbortCode, NmtCommand, NmtState, NodeId, emcy};
use ilc_rt::fieldbus::cia402::{State, Statusword};

use super::communication::{Communication, Incoming, Silence};
use super::dictionary::{Dictionary, Slot};
use super::drive_objects::{self, DriveSlots, rounded};
use super::motion::Motion;
use super::state_machine::StateMachine;
use super::units::Units;
use crate::plant::Demand;

/// Bit 8 of the controlword.
const HALT: u16 = 1 << 8;

/// Parameters set by the maker of the drive and the integrator, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveParameters {
    /// Counts per metre.
    pub counts_per_m: f64,
    /// Lowest position.
    pub position_min_m: f64,
    /// Highest position.
    pub position_max_m: f64,
    /// Velocity limit.
    pub velocity_max_m_s: f64,
    /// Deceleration of quick stop and fault reaction.
    pub deceleration_m_s2: f64,
    /// Following-error window.
    pub following_error_max_m: f64,
    /// Force at 1000 thousandths of torque.
    pub force_max_n: f64,
}

/// Measurements of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Measured {
    /// Position of the encoder.
    pub position_m: f64,
    /// Velocity of the encoder.
    pub velocity_m_s: f64,
    /// Force of the motor.
    pub force_n: f64,
}

/// A simulated drive.
///
/// Frames come in by [`receive`](Self::receive), time by [`step`](Self::step); neither allocates.
#[derive(Clone, Debug)]
pub struct DriveNode {
    pub(super) communication: Communication,
    pub(super) slots: DriveSlots,
    pub(super) parameters: DriveParameters,
    /// Cached from the dictionary; read again when it is written.
    pub(super) units: Units,
    pub(super) machine: StateMachine,
    pub(super) motion: Motion,
    pub(super) measured: Measured,
    pub(super) is_halted: bool,
    /// Time since the following error left its window.
    pub(super) astray_us: u64,
    pub(super) has_following_error: bool,
}

impl DriveNode {
    /// Creates a drive that is powered but has not booted.
    ///
    /// # Errors
    /// The abort code of an object missing from the drive's own table.
    pub fn new(node: NodeId, parameters: DriveParameters) -> Result<Self, AbortCode> {
        let communication = Communication::new(node, drive_objects::all(node, &parameters))?;
        let slots = DriveSlots::find(communication.dictionary())?;
        let units = Units::read(communication.dictionary(), &slots, parameters.counts_per_m);
        Ok(Self {
            communication,
            slots,
            parameters,
            units,
            machine: StateMachine::default(),
            motion: Motion::default(),
            measured: Measured::default(),
            is_halted: false,
            astray_us: 0,
            has_following_error: false,
        })
    }

    /// Returns the node number.
    pub fn node(&self) -> NodeId {
        self.communication.node()
    }

    /// Returns the state of the drive.
    pub fn state(&self) -> State {
        self.machine.state()
    }

    /// Returns the NMT state.
    pub fn nmt(&self) -> NmtState {
        self.communication.nmt()
    }

    /// Returns the objects.
    pub fn dictionary(&self) -> &Dictionary {
        self.communication.dictionary()
    }

    /// Returns the motor's force limit as a share, 0 to 1.
    pub fn force_share(&self) -> f64 {
        self.units.force_share()
    }

    /// Takes the last emergency sent since the last call.
    pub fn take_emergency(&mut self) -> Option<u16> {
        self.communication.take_emergency()
    }

    /// Sets the measurements from now on.
    pub fn measure(&mut self, measured: Measured) {
        self.measured = measured;
    }

    /// Boots: self-test, boot-up message, pre-operational.
    pub fn boot(&mut self, out: &mut dyn FnMut(Frame)) {
        self.machine.initialised();
        self.communication.boot(out);
    }

    /// Handles a frame from the bus.
    pub fn receive(&mut self, frame: &Frame, out: &mut dyn FnMut(Frame)) {
        if self.communication.is_question(frame) {
            self.show();
        }
        match self.communication.receive(frame, out) {
            Incoming::Nothing => {}
            Incoming::Nmt(command) => {
                self.on_nmt(command, out);
                self.read_units();
            }
            Incoming::Written => {
                self.read_units();
                self.show_mode();
                self.heed_controlword(out);
            }
            Incoming::Sync => {
                // In this order: sample, take over, send. The values sent were measured at SYNC.
                self.communication.apply_latched();
                self.show_mode();
                self.heed_controlword(out);
                self.take_target();
                self.show();
                self.communication.transmit_at_sync(out);
            }
        }
    }

    /// Advances by one step of the drive's own loop and returns the demand for its axis.
    pub fn step(&mut self, step_us: u32, out: &mut dyn FnMut(Frame)) -> Demand {
        self.show_statusword();
        match self.communication.advance(step_us.into(), out) {
            Silence::None => {}
            Silence::Command => self.fault(emcy::CODE_RPDO_TIMEOUT),
            Silence::Heartbeat => self.on_connection_loss(emcy::CODE_HEARTBEAT, None),
        }
        let dt_s = f64::from(step_us) * 1e-6;
        let demand = self.motion.step(
            self.units.limits(),
            self.measured.position_m,
            self.measured.velocity_m_s,
            self.units.velocity_m_s(self.number(self.slots.velocity_offset)),
            dt_s,
        );
        self.end_ramp();
        self.watch_following_error(step_us, out);
        if self.machine.state() == State::Fault { Demand::Off } else { demand }
    }

    fn on_nmt(&mut self, command: NmtCommand, out: &mut dyn FnMut(Frame)) {
        match command {
            NmtCommand::Start => {}
            NmtCommand::Stop | NmtCommand::PreOperational | NmtCommand::ResetCommunication => {
                self.on_connection_loss(emcy::CODE_COMMUNICATION, Some(out));
            }
            NmtCommand::ResetNode => {
                self.machine = StateMachine::default();
                self.machine.initialised();
                self.motion.off();
                self.is_halted = false;
                self.has_following_error = false;
            }
        }
    }

    /// Executes option 0x6007 when the controller is lost while the drive is energised.
    fn on_connection_loss(&mut self, code: u16, announce: Option<&mut dyn FnMut(Frame)>) {
        if !matches!(self.state(), State::OperationEnabled | State::QuickStopActive) {
            return;
        }
        match self.number(self.slots.connection_loss_option) {
            0 => {}
            2 => self.command(0x0000),
            3 => self.command(0x0002),
            _ => {
                if let Some(out) = announce {
                    self.communication.emergency(code, out);
                }
                self.fault(code);
            }
        }
    }

    fn heed_controlword(&mut self, out: &mut dyn FnMut(Frame)) {
        if !self.communication.dictionary_mut().take_written(self.slots.controlword) {
            return;
        }
        let controlword = u16::try_from(self.number(self.slots.controlword)).unwrap_or(0);
        let was_fault = self.state() == State::Fault;
        self.command(controlword);
        if was_fault && self.state() != State::Fault {
            self.has_following_error = false;
            self.set(self.slots.error_code, 0);
            self.communication.emergency(emcy::CODE_RESET, out);
        }
        self.heed_halt(controlword & HALT != 0);
    }

    /// Runs the state machine and starts the motion of the new state.
    fn command(&mut self, controlword: u16) {
        let before = self.state();
        let after = self.machine.command(controlword);
        if before == after {
            return;
        }
        match after {
            State::OperationEnabled => {
                // An earlier target must not move the axis: it counts from the next SYNC on.
                self.forget_targets();
                self.motion.hold(self.measured.position_m);
                self.is_halted = false;
                self.astray_us = 0;
            }
            State::QuickStopActive => match self.number(self.slots.quick_stop_option) {
                0 => {
                    self.machine.quick_stop_done();
                    self.motion.off();
                }
                1 | 5 => self.slow_down(),
                _ => self.stop_quickly(),
            },
            State::ReadyToSwitchOn
                if before == State::OperationEnabled
                    && self.number(self.slots.shutdown_option) == 1 =>
            {
                self.slow_down();
            }
            State::SwitchedOn
                if before == State::OperationEnabled
                    && self.number(self.slots.disable_option) == 1 =>
            {
                self.slow_down();
            }
            State::NotReadyToSwitchOn
            | State::SwitchOnDisabled
            | State::ReadyToSwitchOn
            | State::SwitchedOn
            | State::FaultReactionActive
            | State::Fault => self.motion.off(),
        }
    }

    fn heed_halt(&mut self, asked: bool) {
        if self.state() != State::OperationEnabled || asked == self.is_halted {
            return;
        }
        self.is_halted = asked;
        if asked && self.number(self.slots.halt_option) == 1 {
            self.slow_down();
        } else if asked {
            self.stop_quickly();
        } else {
            self.forget_targets();
            self.motion.hold(self.measured.position_m);
        }
    }

    fn slow_down(&mut self) {
        self.motion.ramp_down(self.measured.velocity_m_s, self.units.slow_deceleration_m_s2());
    }

    fn stop_quickly(&mut self) {
        self.motion.ramp_down(self.measured.velocity_m_s, self.units.quick_deceleration_m_s2());
    }

    /// Executes the transition after a ramp.
    fn end_ramp(&mut self) {
        if self.motion.is_ramping() {
            return;
        }
        match self.state() {
            State::FaultReactionActive => {
                self.machine.fault_reaction_done();
                self.motion.off();
            }
            State::QuickStopActive
                if !matches!(self.number(self.slots.quick_stop_option), 5 | 6) =>
            {
                self.machine.quick_stop_done();
                self.motion.off();
            }
            // The ramp of a shutdown, or of a disabled operation, is over.
            State::ReadyToSwitchOn | State::SwitchedOn => self.motion.off(),
            _ => {}
        }
    }

    /// Enters the fault reaction. A drive that is not energised only reports a lost command.
    pub(super) fn fault(&mut self, code: u16) {
        if !matches!(self.state(), State::OperationEnabled | State::QuickStopActive) {
            return;
        }
        self.set(self.slots.error_code, code.into());
        self.machine.fault();
        self.astray_us = 0;
        match self.number(self.slots.fault_reaction_option) {
            0 => {
                self.machine.fault_reaction_done();
                self.motion.off();
            }
            1 => self.slow_down(),
            _ => self.stop_quickly(),
        }
    }

    fn read_units(&mut self) {
        let dictionary = self.communication.dictionary();
        self.units = Units::read(dictionary, &self.slots, self.parameters.counts_per_m);
    }

    pub(super) fn number(&self, slot: Slot) -> i64 {
        self.communication.dictionary().number(slot)
    }

    pub(super) fn set(&mut self, slot: Slot, number: i64) {
        self.communication.dictionary_mut().set(slot, number);
    }

    /// Stores measurements and demands in the dictionary.
    fn show(&mut self) {
        let units = &self.units;
        let Measured { position_m, velocity_m_s, force_n } = self.measured;
        let demand_m = self.motion.demand_m().unwrap_or(position_m);
        let values = [
            (self.slots.position_demand, units.position(demand_m)),
            (self.slots.position_internal, rounded(position_m * self.parameters.counts_per_m)),
            (self.slots.position_actual, units.position(position_m)),
            (self.slots.velocity_demand, units.velocity(self.motion.demand_m_s())),
            (self.slots.velocity_actual, units.velocity(velocity_m_s)),
            (self.slots.torque_actual, rounded(force_n / self.parameters.force_max_n * 1000.0)),
            (self.slots.following_error, rounded(self.following_error_counts())),
        ];
        for (slot, number) in values {
            self.set(slot, number);
        }
        self.show_statusword();
    }

    fn show_statusword(&mut self) {
        let (_, coding) = self.state().coding();
        let mut word = coding | Statusword::REMOTE;
        if self.state() != State::NotReadyToSwitchOn {
            word |= Statusword::VOLTAGE_ENABLED;
        }
        if self.motion.is_limited() {
            word |= Statusword::INTERNAL_LIMIT;
        }
        let is_cyclic = self.mode().is_some();
        if self.state() == State::OperationEnabled && is_cyclic && !self.is_halted {
            word |= Statusword::FOLLOWS_TARGET;
        }
        if self.has_following_error {
            word |= Statusword::FOLLOWING_ERROR;
        }
        self.set(self.slots.statusword, word.into());
    }
}
