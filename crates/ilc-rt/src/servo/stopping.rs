//! Start of a stop: every axis ramps from its last command to rest, for any failure.
//!
//! A stop is open loop in every mode. Its set points start from the last commands, learned input
//! included, so that nothing steps; no measurement takes part in it, so that a frozen, late or
//! false one can neither drive the axis on nor hold it back. A drive in torque mode brakes
//! by its own quick stop. Only then are the drives disabled.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::{Message, StopReason};
use super::mode;
use super::phase::Phase;
use crate::interpolate::{ControlledStop, MAX_AXES};

/// Number of cycles before a stop that are reported with it.
pub(super) const CYCLES_TOLD: u64 = 32;

impl Cycle {
    /// Begins a controlled stop of all axes, unless one is in progress or nothing moves any more.
    pub(super) fn begin_stop(&mut self, reason: StopReason) {
        if let Some(reason) = self.better_reason(reason) {
            self.stopping = Some(reason);
            self.mail.tell(Message::Stopping(reason));
            return;
        }
        if self.stopping.is_some() || matches!(self.phase, Phase::Disabling { .. } | Phase::Stopped)
        {
            return;
        }
        self.stopping = Some(reason);
        if !matches!(reason, StopReason::Asked(_) | StopReason::StopButton { .. }) {
            self.flight.stop();
        }
        for sample in self.pending.last(CYCLES_TOLD) {
            self.mail.tell(Message::Before(sample));
        }
        self.mail.tell(Message::Stopping(reason));
        if let Some(axis) = reason.distrusted() {
            self.drives[axis.min(MAX_AXES - 1)].distrusted = true;
        }
        if matches!(self.phase, Phase::Enabling { .. }) {
            self.phase = Phase::Disabling { ticks: 0 };
            return;
        }
        let dt_s = self.spec.cycle.as_secs_f64();
        let mut position_m = self.reference.position_m;
        let mut velocity_m_s = [0.0; MAX_AXES];
        let mut acceleration_m_s2 = [0.0; MAX_AXES];
        for axis in 0..self.n_axes() {
            let mode = mode::of(self.spec.axes[axis].mode);
            let last = self.commanded.map(|command| command[axis]);
            position_m[axis] = mode.position_m(last[0], position_m[axis]);
            [velocity_m_s[axis], acceleration_m_s2[axis]] =
                mode.motion(last, self.reference.velocity_m_s[axis], dt_s);
        }
        // It is part of the last commands, from which the stop continues; in an offset it fades out.
        let stays = |axis: usize| {
            self.has_offset[axis] && {
                let spec = &self.spec.axes[axis];
                spec.input != spec.mode.inputs()[0]
            }
        };
        let stays: [bool; MAX_AXES] = std::array::from_fn(stays);
        self.input.absorb(&stays);
        let stop = ControlledStop::new(
            &position_m,
            &velocity_m_s,
            &acceleration_m_s2,
            self.n_axes(),
            &self.limits,
        );
        self.phase = Phase::Stopping { stop, rest_ticks: 0 };
    }
}
