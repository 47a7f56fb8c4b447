//! The objects in which a simulated drive shows what it does: measurements, demands, status, inputs.

use ilc_rt::fieldbus::cia402::{State, Statusword};

use super::drive::DriveNode;
use super::drive_mode::DriveMode;
use super::drive_objects::rounded;
use crate::plant::Measured;

/// Bit 10 of the statusword: the target is reached.
const TARGET_REACHED: u16 = 1 << 10;
/// Bit 12 of the statusword; its meaning is the mode's.
const BIT_12: u16 = 1 << 12;
/// Bit 13 of the statusword; its meaning is the mode's.
const BIT_13: u16 = 1 << 13;
/// Bit 0 of the digital outputs: the brake is applied.
const BRAKE: i64 = 1 << 0;

impl DriveNode {
    /// Stores measurements and demands in the dictionary.
    pub(super) fn show(&mut self) {
        let units = &self.units;
        let Measured { position_m, velocity_m_s, force_n } = self.measured;
        let demand_m = self.motion.demand_m().unwrap_or(position_m);
        // A reversed motor turns the other way for the same force.
        let force_max_n = self.parameters.force_max_n.copysign(self.parameters.counts_per_m);
        let values = [
            (self.slots.position_demand, units.position(demand_m)),
            (self.slots.position_internal, rounded(position_m * self.parameters.counts_per_m)),
            (self.slots.position_actual, units.position(position_m)),
            (self.slots.velocity_demand, units.velocity(self.motion.demand_m_s())),
            (self.slots.velocity_actual, units.velocity(velocity_m_s)),
            (self.slots.torque_demand, {
                let demand_n = self.motion.demand_n().unwrap_or(force_n);
                rounded(demand_n / force_max_n * 1000.0)
            }),
            (self.slots.torque_actual, rounded(force_n / force_max_n * 1000.0)),
            (self.slots.following_error, rounded(self.following_error_counts())),
        ];
        for (slot, number) in values {
            self.set(slot, number);
        }
        self.show_inputs();
        self.show_statusword();
    }

    /// Stores switches and further inputs, and the state of the brake while the drive commands it.
    fn show_inputs(&mut self) {
        let switches = self.parameters.switches.bits(self.measured.position_m);
        let inputs = switches | self.number(self.slots.simulated_inputs);
        self.set(self.slots.digital_inputs, inputs);
        if self.number(self.slots.output_mask) & BRAKE == 0 {
            let is_free = matches!(
                self.state(),
                State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive
            );
            let others = self.number(self.slots.digital_outputs) & !BRAKE;
            let brake = if is_free { 0 } else { BRAKE };
            self.set(self.slots.digital_outputs, others | brake);
        }
    }

    /// Returns whether the controller has taken over the brake, and applied it.
    pub(super) fn is_braked(&self) -> bool {
        self.number(self.slots.output_mask) & self.number(self.slots.digital_outputs) & BRAKE != 0
    }

    pub(super) fn show_statusword(&mut self) {
        let (_, coding) = self.state().coding();
        let mut word = coding | Statusword::REMOTE;
        if self.state() != State::NotReadyToSwitchOn {
            word |= Statusword::VOLTAGE_ENABLED;
        }
        if self.is_limited() {
            word |= Statusword::INTERNAL_LIMIT;
        }
        if self.state() == State::OperationEnabled {
            word |= self.mode_bits();
        } else if self.is_homed && self.mode() == Some(DriveMode::Homing) {
            // A master can ask without power whether the axis is homed.
            word |= BIT_12;
        }
        if self.has_following_error {
            word |= Statusword::FOLLOWING_ERROR;
        }
        self.set(self.slots.statusword, word.into());
    }

    fn is_limited(&self) -> bool {
        match self.mode() {
            Some(DriveMode::ProfilePosition) => self.positioning.is_limited(),
            Some(DriveMode::ProfileVelocity) => self.is_clipped,
            _ => self.motion.is_limited(),
        }
    }

    /// Returns bits 10, 12 and 13 of an enabled drive.
    fn mode_bits(&self) -> u16 {
        let bit = |holds, bit| if holds { bit } else { 0 };
        let is_stopped = self.is_halted && !self.motion.is_ramping();
        match self.mode() {
            None => 0,
            Some(DriveMode::Cyclic(_)) => bit(!self.is_halted, Statusword::FOLLOWS_TARGET),
            Some(DriveMode::ProfilePosition) => {
                let window_ms = self.number(self.slots.position_window_ms);
                let is_there = !self.is_halted && self.reached.has_lasted(window_ms);
                bit(is_there || is_stopped, TARGET_REACHED)
                    | bit(self.positioning.is_acknowledged(), BIT_12)
            }
            Some(DriveMode::ProfileVelocity) => {
                let window_ms = self.number(self.slots.velocity_window_ms);
                let threshold_ms = self.number(self.slots.velocity_threshold_ms);
                let is_there = !self.is_halted && self.reached.has_lasted(window_ms);
                bit(is_there || is_stopped, TARGET_REACHED)
                    | bit(self.standing.has_lasted(threshold_ms), BIT_12)
            }
            Some(DriveMode::Homing) => {
                let is_at_rest = !self.motion.is_ramping() && self.motion.demand_m_s().abs() <= 0.0;
                bit(is_at_rest && !self.homing.is_under_way(), TARGET_REACHED)
                    | bit(self.homing.is_done() || self.is_homed, BIT_12)
                    | bit(self.homing.has_failed(), BIT_13)
            }
        }
    }
}
