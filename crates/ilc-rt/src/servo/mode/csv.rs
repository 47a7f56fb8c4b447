//! Cyclic synchronous velocity: the command is the output of the controller's position loop, plus
//! the learned input unless it is added to the drive's torque.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::{AxisLoops, AxisMode, Moment};
use crate::fieldbus::cia402::{InputKind, Scale};
use crate::servo::gate::Gate;
use crate::servo::phase::Phase;

pub(super) struct Csv;

impl AxisMode for Csv {
    fn hold(&self, _position_m: f64) -> f64 {
        0.0
    }

    fn target(&self, now: &Moment<'_>, _loops: &mut AxisLoops) -> f64 {
        match now.phase {
            Phase::Enabling { .. } | Phase::Disabling { .. } | Phase::Stopped => 0.0,
            // Open loop: the measurement may have failed.
            Phase::Stopping { .. } => now.reference_m_s,
            Phase::Returning(_) | Phase::Settling { .. } | Phase::Running { .. } => {
                let control = now.spec.position_loop.command_m_s(
                    now.ahead_m(),
                    now.reference_m_s,
                    now.encoder_m,
                );
                let wanted_m_s = control + now.input_to(InputKind::Velocity);
                Gate::velocity_m_s(wanted_m_s, now.last[0], now.encoder_m, &now.bounds)
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

    fn motion(&self, [newest, middle, _]: [f64; 3], _reference_m_s: f64, dt_s: f64) -> [f64; 2] {
        [newest, (newest - middle) / dt_s]
    }

    fn closes_position_loop(&self) -> bool {
        true
    }
}
