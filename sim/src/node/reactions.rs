//! Reactions of a simulated drive to controlwords, halts and faults: transitions and their ramps.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::emcy;
use ilc_rt::fieldbus::cia402::State;

use super::drive::{DISABLE_VOLTAGE, DriveNode};
use super::drive_mode::DriveMode;

/// Bit 8 of the controlword.
const HALT: u16 = 1 << 8;

impl DriveNode {
    pub(super) fn heed_controlword(&mut self, out: &mut dyn FnMut(Frame)) {
        if !self.communication.dictionary_mut().take_written(self.slots.controlword) {
            return;
        }
        let controlword = u16::try_from(self.number(self.slots.controlword)).unwrap_or(0);
        let was_fault = self.state() == State::Fault;
        let was_enabled = self.state() == State::OperationEnabled;
        // A fault can be reset without torque, but nothing more.
        let is_held = self.is_torque_off && !was_fault;
        self.command(if is_held { DISABLE_VOLTAGE } else { controlword });
        if was_fault && self.state() != State::Fault {
            self.has_following_error = false;
            self.set(self.slots.error_code, 0);
            self.communication.emergency(emcy::CODE_RESET, out);
        }
        self.heed_halt(controlword & HALT != 0);
        self.heed_mode_bits(controlword, was_enabled);
    }

    /// Runs the state machine and starts the motion of the new state.
    pub(super) fn command(&mut self, controlword: u16) {
        let before = self.state();
        let after = self.machine.command(controlword);
        if before == after {
            return;
        }
        match after {
            State::OperationEnabled => {
                // An earlier target must not move the axis: it counts from the next SYNC on.
                self.forget_targets();
                self.drop_own_motion();
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
        self.reached.restart();
        if asked {
            self.homing.interrupt();
        }
        if asked && self.number(self.slots.halt_option) == 1 {
            self.slow_down();
        } else if asked {
            self.stop_quickly();
        } else if matches!(self.mode(), Some(DriveMode::Cyclic(_)) | None) {
            self.forget_targets();
            self.motion.hold(self.measured.position_m);
        }
        // A profile goes on from where the ramp of the halt ends.
    }

    pub(super) fn slow_down(&mut self) {
        self.motion.ramp_down(self.measured.velocity_m_s, self.units.slow_deceleration_m_s2());
    }

    fn stop_quickly(&mut self) {
        self.motion.ramp_down(self.measured.velocity_m_s, self.units.quick_deceleration_m_s2());
    }

    /// Executes the transition after a ramp.
    #[inline]
    pub(super) fn end_ramp(&mut self) {
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

    /// Fails with the code that was written for it; without power as well.
    pub(super) fn heed_simulated_fault(&mut self, out: &mut dyn FnMut(Frame)) {
        if !self.communication.dictionary_mut().take_written(self.slots.simulated_fault) {
            return;
        }
        let code = u16::try_from(self.number(self.slots.simulated_fault)).unwrap_or(0);
        if code == emcy::CODE_RESET || self.state() == State::Fault {
            return;
        }
        self.communication.emergency(code, out);
        self.fault(code);
        if self.state() != State::FaultReactionActive {
            self.set(self.slots.error_code, code.into());
            self.machine.fault();
            self.motion.off();
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
}
