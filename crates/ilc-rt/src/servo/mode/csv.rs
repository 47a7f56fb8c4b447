//! Cyclic synchronous velocity: the command is the output of the controller's position loop plus
//! the learned input.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::{AxisMode, Moment};
use crate::fieldbus::cia402::Scale;
use crate::interpolate::AxisLimits;
use crate::servo::gate::Gate;
use crate::servo::phase::Phase;

pub(super) struct Csv;

impl AxisMode for Csv {
    fn input_step_max(&self, limits: &AxisLimits, dt_s: f64) -> f64 {
        limits.acceleration_max_m_s2 * dt_s
    }

    fn hold(&self, _position_m: f64) -> f64 {
        0.0
    }

    fn target(&self, now: &Moment<'_>, _gate: &mut Gate) -> f64 {
        match now.phase {
            Phase::Enabling { .. } | Phase::Disabling { .. } | Phase::Stopped => 0.0,
            // Open loop: the measurement may have failed.
            Phase::Stopping { .. } => now.reference_m_s,
            Phase::Returning(_) | Phase::Settling { .. } | Phase::Running { .. } => {
                let control = now.spec.position_loop.command_m_s(
                    now.reference_m,
                    now.reference_m_s,
                    now.encoder_m,
                );
                Gate::velocity_m_s(control + now.input, now.last[0], now.encoder_m, &now.bounds)
            }
        }
    }

    fn extrapolate(&self, [last, _, _]: [f64; 3]) -> f64 {
        last
    }

    fn counts(&self, command: f64, scale: Scale) -> Option<i32> {
        scale.to_counts(command)
    }

    fn position_m(&self, _command: f64, reference_m: f64) -> f64 {
        reference_m
    }

    fn motion(&self, [newest, middle, _]: [f64; 3], dt_s: f64) -> [f64; 2] {
        [newest, (newest - middle) / dt_s]
    }

    fn closes_position_loop(&self) -> bool {
        true
    }
}
