//! Stribeck friction with true stiction.
//!
//! An axis at rest stays exactly where it is until a force exceeds the static friction; a moving
//! one is braked by `F_c + (F_s − F_c) exp(−(v/v_s)²)`. Friction never reverses it: if a whole step
//! would, friction is just the force that stops the carriage at the end of the step.

use super::exact_step::{ExactStep, State};

/// Friction of an axis, including its brake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Coulomb friction.
    pub coulomb_n: f64,
    /// Static friction, at least the Coulomb friction.
    pub static_n: f64,
    /// Stribeck velocity.
    pub stribeck_m_s: f64,
}

impl Friction {
    /// Returns the magnitude of friction at a velocity other than 0.
    #[inline]
    pub fn sliding_n(&self, velocity_m_s: f64) -> f64 {
        let ratio = velocity_m_s / self.stribeck_m_s;
        // Beyond six Stribeck velocities the exponential is below the last bit of the sum.
        if ratio * ratio > 36.0 {
            self.coulomb_n
        } else {
            self.coulomb_n + (self.static_n - self.coulomb_n) * (-ratio * ratio).exp()
        }
    }

    /// Returns the state after a step under a motor force, with a brake force added to the
    /// friction.
    #[inline]
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
        // In the direction of the previous motion: the force that friction must take up to stop the
        // axis. If the axis reverses without it, friction is 0 for this step: it must not push.
        let stopping_n = step.stopping_force_n(z);
        if sign * (motor_n - stopping_n) < 0.0 {
            return step.free(z, motor_n);
        }
        let mut stopped = step.free(z, stopping_n);
        stopped[1] = 0.0;
        stopped
    }
}
