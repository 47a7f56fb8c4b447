//! Cyclic synchronous position: the command is the set point, plus the learned input unless it is
//! added to the drive's velocity or torque.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::{AxisLoops, AxisMode, Moment};
use crate::fieldbus::cia402::{InputKind, Scale};
use crate::servo::phase::Phase;

pub(super) struct Csp;

impl AxisMode for Csp {
    fn hold(&self, position_m: f64) -> f64 {
        position_m
    }

    fn target(&self, now: &Moment<'_>, loops: &mut AxisLoops) -> f64 {
        // Until it is enabled, an axis is commanded to its own position, wherever that is.
        if matches!(now.phase, Phase::Enabling { .. }) && !now.enabled {
            return now.encoder_m;
        }
        let wanted_m = now.ahead_m() + now.input_to(InputKind::Position);
        loops.gate.position_m(wanted_m, now.last, &now.bounds)
    }

    fn velocity_offset(&self, now: &Moment<'_>) -> f64 {
        now.spec.feedforward.velocity * now.reference_m_s + now.input_to(InputKind::Velocity)
    }

    fn extrapolate(&self, [last, before, _]: [f64; 3]) -> f64 {
        2.0 * last - before
    }

    fn counts(&self, command: f64, scale: Scale) -> Option<i32> {
        scale.position_to_counts(command)
    }

    fn position_m(&self, command: f64, _reference_m: f64) -> f64 {
        command
    }

    fn motion(
        &self,
        [newest, middle, oldest]: [f64; 3],
        _reference_m_s: f64,
        dt_s: f64,
    ) -> [f64; 2] {
        [(newest - middle) / dt_s, (newest - 2.0 * middle + oldest) / (dt_s * dt_s)]
    }

    fn closes_position_loop(&self) -> bool {
        false
    }
}
