//! Stribeck friction that truly sticks.
//!
//! An axis at rest stays where it is, exactly, until a force exceeds the static friction; a moving one
//! is braked by `F_c + (F_s − F_c) exp(−(v/v_s)²)`, and friction never reverses it: where a whole step
//! of it would, it takes just the force that stops the carriage at the end of the step.

use super::exact_step::{ExactStep, State};

/// Friction of an axis, and the brake on top of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Coulomb friction.
    pub coulomb_n: f64,
    /// Static friction, not less than the former.
    pub static_n: f64,
    /// Stribeck velocity.
    pub stribeck_m_s: f64,
}

impl Friction {
    /// Friction at a velocity other than 0, as a magnitude.
    pub fn sliding_n(&self, velocity_m_s: f64) -> f64 {
        let ratio = velocity_m_s / self.stribeck_m_s;
        // Beyond six Stribeck velocities the exponential is below the last bit of the sum.
        if ratio * ratio > 36.0 {
            self.coulomb_n
        } else {
            self.coulomb_n + (self.static_n - self.coulomb_n) * (-ratio * ratio).exp()
        }
    }

    /// The state after a step under a motor force, with a brake force added to the friction.
    pub(super) fn step(&self, step: &ExactStep, z: &State, motor_n: f64, brake_n: f64) -> State {
        let static_n = self.static_n + brake_n;
        let (sign, sliding_n) = if z[1] == 0.0 {
            let driving_n = motor_n + step.mode_force_n(z);
            if driving_n.abs() <= static_n {
                return step.locked(z);
            }
            (driving_n.signum(), static_n)
        } else {
            (z[1].signum(), self.sliding_n(z[1]) + brake_n)
        };
        let next = step.free(z, motor_n - sign * sliding_n);
        if sign * next[1] > 0.0 {
            return next;
        }
        // In the direction of the old motion: what friction must take up so that the axis stops. If
        // it turns round by itself, friction leaves it alone for this step: it must not push.
        let stopping_n = step.stopping_force_n(z);
        if sign * (motor_n - stopping_n) < 0.0 {
            return step.free(z, motor_n);
        }
        let mut stopped = step.free(z, stopping_n);
        stopped[1] = 0.0;
        stopped
    }
}
