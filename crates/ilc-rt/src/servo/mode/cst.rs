//! Cyclic synchronous torque: the command is the force of the controller's cascade plus the learned
//! input.
//!
//! A stop is the drive's own quick-stop ramp: its velocity loop is next to its encoder, so that no
//! value that came over the bus takes part in it. No force that is computed here could be trusted to
//! brake once the measurement has failed.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::{AxisLoops, AxisMode, Moment};
use crate::control::CascadeReference;
use crate::fieldbus::cia402::{CommandRpdo1, Scale};
use crate::servo::gate::Gate;
use crate::servo::phase::Phase;

/// Unanswered cycles up to which the position is extrapolated; from then on the loops are open, and
/// only feed-forward and integral act until the axis is found silent.
const BLIND_CYCLES: f64 = 2.0;

pub(super) struct Cst;

impl AxisMode for Cst {
    fn hold(&self, _position_m: f64) -> f64 {
        0.0
    }

    fn target(&self, now: &Moment<'_>, loops: &mut AxisLoops) -> f64 {
        let idle = match now.phase {
            Phase::Enabling { .. } => !now.enabled,
            Phase::Stopping { .. } | Phase::Disabling { .. } | Phase::Stopped => true,
            Phase::Returning(_) | Phase::Settling { .. } | Phase::Running { .. } => false,
        };
        let (false, Some(force)) = (idle, &now.spec.force) else {
            loops.cascade.reset();
            return 0.0;
        };
        let reference = CascadeReference {
            position_m: now.ahead_m(),
            velocity_m_s: now.reference_m_s,
            acceleration_m_s2: now.reference_m_s2,
        };
        let at_m = now.encoder_m + now.encoder_m_s * now.bounds.dt_s * now.unanswered;
        let measured = if now.unanswered > BLIND_CYCLES {
            let share = now.spec.cascade.velocity_feedforward;
            [now.ahead_m(), share * now.reference_m_s]
        } else {
            [at_m, now.encoder_m_s]
        };
        let extra_n = now.input + now.spec.feedforward.friction_n(now.reference_m_s);
        let asked = loops.cascade.step(reference, measured[0], measured[1], extra_n);
        if !asked.finite {
            return f64::NAN;
        }
        let motion = [at_m, now.encoder_m_s];
        let given_n = Gate::force_n(asked.value, now.last[0], motion, force, &now.bounds);
        loops.cascade.given(given_n);
        given_n
    }

    fn extrapolate(&self, [last, _, _]: [f64; 3]) -> f64 {
        last
    }

    /// No target of its is in counts.
    fn counts(&self, _command: f64, _scale: Scale) -> Option<i32> {
        None
    }

    fn write(&self, command: f64, now: &Moment<'_>, frame: &mut CommandRpdo1) {
        if let Some(counts) = now.spec.scale.position_to_counts(now.reference_m) {
            frame.target_counts = counts;
        }
        frame.torque_offset = now.spec.per_mille(command);
    }

    fn position_m(&self, _command: f64, reference_m: f64) -> f64 {
        reference_m
    }

    /// The drive brakes by itself; the set points of the stop are an estimate of its position.
    fn motion(&self, _last: [f64; 3], reference_m_s: f64, _dt_s: f64) -> [f64; 2] {
        [reference_m_s, 0.0]
    }

    fn closes_position_loop(&self) -> bool {
        true
    }

    fn closes_velocity_loop(&self) -> bool {
        true
    }
}
