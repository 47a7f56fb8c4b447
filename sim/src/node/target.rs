//! Targets of a simulated drive: applied at SYNC according to its mode, and monitored.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::emcy;
use ilc_rt::fieldbus::cia402::{InputKind, State};

use super::drive::DriveNode;
use super::drive_mode::DriveMode;
use super::homing::Homing;

impl DriveNode {
    pub(super) fn forget_targets(&mut self) {
        let dictionary = self.communication.dictionary_mut();
        dictionary.take_written(self.slots.target_position);
        dictionary.take_written(self.slots.target_velocity);
        dictionary.take_written(self.slots.target_torque);
    }

    /// Applies the target of the active mode at SYNC.
    pub(super) fn take_target(&mut self) {
        if self.state() != State::OperationEnabled || self.is_halted {
            self.forget_targets();
            return;
        }
        let dictionary = self.communication.dictionary_mut();
        let has_position = dictionary.take_written(self.slots.target_position);
        let has_velocity = dictionary.take_written(self.slots.target_velocity);
        let has_torque = dictionary.take_written(self.slots.target_torque);
        // The drive's own modes take their targets when they need them.
        let Some(DriveMode::Cyclic(mode)) = self.mode() else { return };
        match mode.targeted() {
            InputKind::Position => self.take_position(has_position),
            InputKind::Velocity => self.take_velocity(has_velocity),
            InputKind::Torque => self.take_torque(has_torque),
        }
    }

    fn take_position(&mut self, is_new: bool) {
        if is_new {
            let counts =
                self.number(self.slots.target_position) + self.number(self.slots.position_offset);
            self.motion.position_target(self.units.place_m(counts), self.period_s());
        } else if self.communication.has_deadline() {
            // Without a timeout a target persists, e.g. when it is set by SDO.
            self.motion.extrapolate_once(self.period_s());
        }
    }

    fn take_velocity(&mut self, is_new: bool) {
        if is_new {
            let velocity_m_s = self.units.velocity_m_s(self.number(self.slots.target_velocity))
                + self.units.velocity_m_s(self.number(self.slots.velocity_offset));
            self.motion.velocity_target(velocity_m_s);
        }
    }

    fn take_torque(&mut self, is_new: bool) {
        if is_new {
            let force_n = self.force_n(self.number(self.slots.target_torque))
                + self.force_n(self.number(self.slots.torque_offset));
            self.motion.force_target(force_n);
        }
    }

    /// Converts thousandths of the rated torque.
    pub(super) fn force_n(&self, thousandths: i64) -> f64 {
        // A reversed motor turns the other way for the same torque.
        let force_max_n = self.parameters.force_max_n.copysign(self.parameters.counts_per_m);
        thousandths as f64 * 1e-3 * force_max_n
    }

    /// Reports the active mode; a change while enabled begins with a hold.
    pub(super) fn show_mode(&mut self) {
        let dictionary = self.communication.dictionary_mut();
        if !dictionary.take_written(self.slots.mode) {
            return;
        }
        let (wanted, shown) =
            (dictionary.number(self.slots.mode), dictionary.number(self.slots.mode_display));
        if wanted == shown {
            return;
        }
        if !self.communication.may_change_mode() {
            self.set(self.slots.mode, shown);
            return;
        }
        let dictionary = self.communication.dictionary_mut();
        dictionary.set(self.slots.mode_display, wanted);
        self.forget_targets();
        self.drop_own_motion();
        self.homing = Homing::default();
        if self.state() == State::OperationEnabled && !self.motion.is_ramping() {
            // From a profile under way the axis slows down first.
            if self.motion.has_arrived() || !self.motion.is_profile() {
                self.motion.hold(self.measured.position_m);
            } else {
                self.slow_down();
            }
        }
    }

    /// Monitors the following error; `None` for no window.
    #[inline]
    pub(super) fn watch_following_error(
        &mut self,
        window: Option<i64>,
        step_us: u32,
        out: &mut dyn FnMut(Frame),
    ) {
        let window = window.filter(|_| self.state() == State::OperationEnabled);
        // Half a count more would be rounded to the next one.
        let is_outside = |window: i64| self.following_error_counts().abs() >= window as f64 + 0.5;
        if !window.is_some_and(is_outside) {
            self.astray_us = 0;
            return;
        }
        self.astray_us += u64::from(step_us);
        let patience_us = u64::try_from(self.number(self.slots.error_time_ms)).unwrap_or(0) * 1000;
        if self.astray_us > patience_us {
            self.has_following_error = true;
            self.communication.emergency(emcy::CODE_FOLLOWING_ERROR, out);
            self.fault(emcy::CODE_FOLLOWING_ERROR);
        }
    }

    /// Returns the demand before limits minus the actual position; 0 if position is not controlled.
    #[inline]
    pub(super) fn following_error_counts(&self) -> f64 {
        let demand_m = self.motion.demand_m().unwrap_or(self.measured.position_m);
        self.units.distance(demand_m - self.measured.position_m)
    }

    pub(super) fn mode(&self) -> Option<DriveMode> {
        DriveMode::from_code(self.number(self.slots.mode_display))
    }

    pub(super) fn period_s(&self) -> f64 {
        let exponent = i32::try_from(self.number(self.slots.period_exponent)).unwrap_or(-3);
        self.number(self.slots.period) as f64 * 10.0_f64.powi(exponent)
    }
}
