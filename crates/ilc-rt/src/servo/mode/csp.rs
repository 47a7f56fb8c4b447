//! Cyclic synchronous position: the command is the set point plus the learned input.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::{AxisMode, Moment};
use crate::fieldbus::cia402::Scale;
use crate::interpolate::AxisLimits;
use crate::servo::gate::Gate;
use crate::servo::phase::Phase;

pub(super) struct Csp;

impl AxisMode for Csp {
    fn input_step_max(&self, limits: &AxisLimits, dt_s: f64) -> f64 {
        limits.velocity_max_m_s * dt_s
    }

    fn hold(&self, position_m: f64) -> f64 {
        position_m
    }

    fn target(&self, now: &Moment<'_>, gate: &mut Gate) -> f64 {
        // Until it is enabled, an axis is commanded to its own position, wherever that is.
        if matches!(now.phase, Phase::Enabling { .. }) && !now.enabled {
            return now.encoder_m;
        }
        gate.position_m(now.reference_m + now.input, now.last, &now.bounds)
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

    fn motion(&self, [newest, middle, oldest]: [f64; 3], dt_s: f64) -> [f64; 2] {
        [(newest - middle) / dt_s, (newest - 2.0 * middle + oldest) / (dt_s * dt_s)]
    }

    fn closes_position_loop(&self) -> bool {
        false
    }
}
