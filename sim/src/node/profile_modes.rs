//! The modes in which the drive makes its own motion: profile position, profile velocity, homing.

use ilc_rt::fieldbus::cia402::State;

use super::drive::DriveNode;
use super::drive_mode::DriveMode;
use super::homing::Order;
use super::motion::MotionLimits;
use super::positioning::Positioning;
use super::profile::{Goal, ProfileLaw, brakeable_m_s};
use super::switches::Seen;

/// Bit 4 of the controlword: new set-point, or start of homing.
const GO: u16 = 1 << 4;

/// Time for which something has held without a break.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Dwell {
    /// `None`: it does not hold.
    held_us: Option<u64>,
}

impl Dwell {
    /// Notes whether it held during a step.
    pub(super) fn note(&mut self, holds: bool, step_us: u32) {
        self.held_us = holds.then(|| self.held_us.map_or(0, |us| us + u64::from(step_us)));
    }

    /// Begins again.
    pub(super) fn restart(&mut self) {
        self.held_us = None;
    }

    /// Returns whether it has held for so long.
    pub(super) fn has_lasted(&self, least_ms: i64) -> bool {
        let least_us = u64::try_from(least_ms).unwrap_or(0) * 1000;
        self.held_us.is_some_and(|us| us >= least_us)
    }
}

impl DriveNode {
    /// Executes bit 4 of a controlword. An edge that comes with the enabling itself starts nothing.
    pub(super) fn heed_mode_bits(&mut self, controlword: u16, was_enabled: bool) {
        let before = std::mem::replace(&mut self.controlword, controlword);
        if !was_enabled || self.state() != State::OperationEnabled {
            return;
        }
        let rises = controlword & !before & GO != 0;
        let falls = before & !controlword & GO != 0;
        match self.mode() {
            Some(DriveMode::ProfilePosition) => {
                if rises {
                    self.take_set_point(controlword);
                }
                self.positioning.end_acknowledgement(self.asks_for_motion());
            }
            Some(DriveMode::Homing) if rises && !self.is_halted => {
                let method = self.number(self.slots.homing_method);
                let switches = self.parameters.switches;
                let here_m = self.measured.position_m;
                self.is_homed = false;
                self.homing.start(method, &switches.see(here_m, here_m));
            }
            Some(DriveMode::Homing) if falls => self.homing.interrupt(),
            _ => {}
        }
    }

    /// Returns whether bit 4 is set.
    pub(super) fn asks_for_motion(&self) -> bool {
        self.controlword & GO != 0
    }

    /// Forgets set-points and breaks homing off.
    pub(super) fn drop_own_motion(&mut self) {
        self.positioning = Positioning::default();
        self.homing.interrupt();
        self.reached.restart();
    }

    /// Makes the drive's own motion for the next step.
    #[inline]
    pub(super) fn pursue(&mut self, mode: Option<DriveMode>, step_us: u32) {
        let now_m = self.measured.position_m;
        let before_m = std::mem::replace(&mut self.seen_m, now_m);
        if self.state() != State::OperationEnabled {
            self.drop_own_motion();
            return;
        }
        match mode {
            Some(DriveMode::ProfilePosition) => {
                self.pursue_set_points();
                let window = self.number(self.slots.position_window);
                let is_inside = self.motion.has_arrived()
                    && !self.positioning.has_queued()
                    && self.following_error_counts().abs() <= window as f64;
                self.reached.note(is_inside, step_us);
            }
            Some(DriveMode::ProfileVelocity) => self.pursue_velocity(step_us),
            Some(DriveMode::Homing) => {
                let seen = self.parameters.switches.see(before_m, now_m);
                self.pursue_home(&seen);
            }
            Some(DriveMode::Cyclic(_)) | None => {}
        }
    }

    fn pursue_velocity(&mut self, step_us: u32) {
        let target = self.number(self.slots.target_velocity);
        let units = &self.units;
        let limits = units.limits();
        let law = units.profile();
        let asked_m_s = units.velocity_m_s(target);
        let here_m = self.measured.position_m;
        // The speed from which the way to a limit suffices to stop.
        let dt_s = f64::from(step_us) * 1e-6;
        let brakeable = |way_m: f64| brakeable_m_s(way_m.max(0.0), law.deceleration_m_s2, dt_s);
        let up_m_s = brakeable(limits.position_max_m - here_m);
        let down_m_s = brakeable(here_m - limits.position_min_m);
        let wanted_m_s = asked_m_s
            .clamp(-limits.velocity_max_m_s, limits.velocity_max_m_s)
            .clamp(-down_m_s, up_m_s);
        self.is_clipped = wanted_m_s.to_bits() != asked_m_s.to_bits();
        let shown = units.velocity(self.measured.velocity_m_s);
        let is_near = (shown - target).abs() <= self.number(self.slots.velocity_window);
        let is_slow = shown.abs() <= self.number(self.slots.velocity_threshold);
        if !self.is_halted {
            self.motion.velocity_target(wanted_m_s);
        }
        self.reached.note(is_near, step_us);
        self.standing.note(is_slow, step_us);
    }

    fn pursue_home(&mut self, seen: &Seen) {
        let law = *self.units.homing();
        let creep_m_s = self.units.homing_creep_m_s();
        let is_at_rest = self.motion.demand_m_s().abs() <= 0.0;
        let velocity_m_s = match self.homing.step(seen, is_at_rest) {
            Order::None => return,
            Order::Move { sign, is_quick } => {
                let sign = sign * self.parameters.switches.sign();
                sign * if is_quick { law.velocity_m_s } else { creep_m_s }
            }
            Order::Rest => 0.0,
            Order::Done { home_m } => {
                if let Some(home_m) = home_m {
                    self.home_m = home_m;
                    self.is_homed = true;
                    self.read_units();
                }
                return;
            }
        };
        // Creeping may be set faster than searching.
        let law = ProfileLaw { velocity_m_s: law.velocity_m_s.max(creep_m_s), ..law };
        self.motion.pursue(Goal::Speed { velocity_m_s }, law);
    }

    /// Returns the limits in profile velocity: with the accelerations of the profile.
    pub(super) fn profile_limits(&self) -> MotionLimits {
        let limits = *self.units.limits();
        let law = self.units.profile();
        MotionLimits {
            acceleration_max_m_s2: law.acceleration_m_s2,
            deceleration_max_m_s2: law.deceleration_m_s2,
            ..limits
        }
    }
}
