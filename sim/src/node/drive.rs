//! A simulated CiA 402 drive: communication, state machine, motion, and the faults between them.

use ilc_rt::config::Quirks;
use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{AbortCode, NmtCommand, NmtState, NodeId, emcy};
use ilc_rt::fieldbus::cia402::State;

use super::communication::{Communication, Incoming, Silence};
use super::dictionary::{Dictionary, Slot};
use super::drive_mode::DriveMode;
use super::drive_objects;
use super::drive_slots::DriveSlots;
use super::homing::Homing;
use super::motion::Motion;
use super::positioning::Positioning;
use super::profile_modes::Dwell;
use super::state_machine::StateMachine;
use super::step_objects::StepObjects;
use super::switches::Switches;
use super::units::Units;
use crate::plant::{Demand, Measured};

/// Controlword that switches the power stage off.
pub(super) const DISABLE_VOLTAGE: u16 = 0;

/// Parameters set by the maker of the drive and the integrator, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveParameters {
    /// Counts per metre; negative for a drive that counts in the other direction than its axis.
    pub counts_per_m: f64,
    /// Position at which it shows 0 after power-on.
    pub zero_m: f64,
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
    /// Cycle of the controller, for a drive that cannot be told.
    pub cycle_us: u32,
    /// Limit and home switches, and index pulses.
    pub switches: Switches,
    /// Further digital inputs that are on, as bits of 0x60FD.
    pub inputs: u32,
    /// Deviations from the profile.
    pub quirks: Quirks,
    /// Longest payload of a frame on its bus, in bytes.
    pub payload_max: usize,
}

/// A simulated drive.
///
/// Frames come in by [`receive`](Self::receive), time by [`step`](Self::step); neither allocates.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "independent flags of the statusword")]
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
    pub(super) is_torque_off: bool,
    /// Time since the following error left its window.
    pub(super) astray_us: u64,
    pub(super) has_following_error: bool,
    /// Controlword of the last evaluation.
    pub(super) controlword: u16,
    pub(super) positioning: Positioning,
    pub(super) homing: Homing,
    /// Place of the home that was found; 0 before.
    pub(super) home_m: f64,
    /// Home was found since power-on, and no other homing was begun.
    pub(super) is_homed: bool,
    /// Position in the last step, for index pulses.
    pub(super) seen_m: f64,
    /// Time at the target.
    pub(super) reached: Dwell,
    /// Time at standstill, in profile velocity.
    pub(super) standing: Dwell,
    /// A limit changed the target of profile velocity.
    pub(super) is_clipped: bool,
    /// Cached from the dictionary.
    pub(super) step_objects: Option<StepObjects>,
    /// Force added to those of the drive's own loops in the last step.
    force_offset_n: f64,
}

impl DriveNode {
    /// Creates a drive that is powered but has not booted.
    ///
    /// # Errors
    /// The abort code of an object missing from the drive's own table.
    pub fn new(node: NodeId, parameters: DriveParameters) -> Result<Self, AbortCode> {
        let mut communication = Communication::new(node, drive_objects::all(node, &parameters))?;
        let slots = DriveSlots::find(communication.dictionary())?;
        communication.take_payloads_of(parameters.payload_max);
        communication.take_habits(&parameters.quirks);
        let units = Units::read(
            communication.dictionary(),
            &slots,
            parameters.counts_per_m,
            parameters.zero_m,
        )
        .within(&parameters.switches);
        Ok(Self {
            communication,
            slots,
            parameters,
            units,
            machine: StateMachine::default(),
            motion: Motion::default(),
            measured: Measured::default(),
            is_halted: false,
            is_torque_off: false,
            astray_us: 0,
            has_following_error: false,
            controlword: 0,
            positioning: Positioning::default(),
            homing: Homing::default(),
            home_m: parameters.zero_m,
            is_homed: false,
            seen_m: 0.0,
            reached: Dwell::default(),
            standing: Dwell::default(),
            is_clipped: false,
            step_objects: None,
            force_offset_n: 0.0,
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

    /// Returns the force of 0x60B2, which the drive adds to its own loops while it follows a target
    /// of position or velocity; as of the last step.
    pub fn force_offset_n(&self) -> f64 {
        self.force_offset_n
    }

    /// Takes the last emergency sent since the last call.
    pub fn take_emergency(&mut self) -> Option<u16> {
        self.communication.take_emergency()
    }

    /// Sets the measurements from now on.
    #[inline]
    pub fn measure(&mut self, measured: Measured) {
        self.measured = measured;
    }

    /// Switches the digital inputs that are on beside the switches of the axis.
    pub fn set_inputs(&mut self, inputs: u32) {
        self.set(self.slots.simulated_inputs, inputs.into());
    }

    /// Activates safe torque off: the power stage is off, and no controlword switches it on; or releases it, which
    /// alone switches nothing on.
    pub fn set_torque_off(&mut self, is_off: bool) {
        self.is_torque_off = is_off;
        if is_off {
            self.command(DISABLE_VOLTAGE);
        }
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
                self.heed_simulated_fault(out);
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
    #[inline]
    pub fn step(&mut self, step_us: u32, out: &mut dyn FnMut(Frame)) -> Demand {
        if self.communication.pass(step_us.into()) {
            // A PDO that is sent on a change may carry it.
            self.show_statusword();
            match self.communication.attend(out) {
                Silence::None => {}
                Silence::Command => self.fault(emcy::CODE_RPDO_TIMEOUT),
                Silence::Heartbeat => self.on_connection_loss(emcy::CODE_HEARTBEAT, None),
            }
        }
        let dt_s = f64::from(step_us) * 1e-6;
        let objects = self.step_objects();
        self.pursue(objects.mode, step_us);
        // A ramp or a hold follows no target, and so none of its offsets.
        let feedforward_m_s =
            if self.motion.follows_target() { objects.velocity_offset_m_s } else { 0.0 };
        let own_limits;
        let limits = if objects.mode == Some(DriveMode::ProfileVelocity) {
            own_limits = self.profile_limits();
            &own_limits
        } else {
            self.units.limits()
        };
        let demand = self.motion.step(
            limits,
            self.measured.position_m,
            self.measured.velocity_m_s,
            feedforward_m_s,
            dt_s,
        );
        self.end_ramp();
        self.watch_following_error(objects.error_window, step_us, out);
        self.force_offset_n =
            if self.motion.follows_target() { objects.force_offset_n } else { 0.0 };
        if self.state() == State::Fault || objects.is_braked { Demand::Off } else { demand }
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
                self.controlword = 0;
                self.homing = Homing::default();
                self.drop_own_motion();
                self.home_m = self.parameters.zero_m;
                self.is_homed = false;
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

    pub(super) fn read_units(&mut self) {
        let dictionary = self.communication.dictionary();
        let counts_per_m = self.parameters.counts_per_m;
        self.units = Units::read(dictionary, &self.slots, counts_per_m, self.home_m)
            .within(&self.parameters.switches);
        self.step_objects = None;
    }

    pub(super) fn number(&self, slot: Slot) -> i64 {
        self.communication.dictionary().number(slot)
    }

    pub(super) fn set(&mut self, slot: Slot, number: i64) {
        self.communication.dictionary_mut().set(slot, number);
    }
}
