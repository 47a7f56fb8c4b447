//! The last part of a tick: from set point and learned input to bounded commands on the bus.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::StopReason;
use super::phase::Phase;
use crate::fieldbus::Bus;
use crate::fieldbus::canopen::sync;
use crate::fieldbus::cia402::{Controlword, Mode, State, next_command};

impl Cycle {
    /// Sends every drive its command, then SYNC. A frame that the bus has no room for is one that
    /// the drive misses: it goes on for a cycle by itself, and its silence is noticed if that lasts.
    pub(super) fn command(&mut self) {
        let dt_s = self.spec.cycle.as_secs_f64();
        let mut newest = self.commanded_m[0];
        for axis in 0..self.n_axes() {
            let target = self.target(axis, dt_s, &mut newest);
            let spec = &self.spec.axes[axis];
            match spec.scale.to_counts(target) {
                Some(counts) => self.drives[axis].target_counts = counts,
                None => self.begin_stop(StopReason::NotFinite { axis }),
            }
            let controlword = self.controlword(axis);
            self.drives[axis].controlword = controlword;
            let frame = self.drives[axis].command(controlword).encode(self.spec.axes[axis].node);
            let _ = self.bus.send(&frame);
        }
        self.commanded_m = [newest, self.commanded_m[0], self.commanded_m[1]];
        if let Err(error) = self.bus.send(&sync::frame()) {
            self.begin_stop(StopReason::Bus(error));
        }
    }

    /// The bounded target of an axis: m (position-commanded) or m/s (velocity-commanded).
    fn target(
        &self,
        axis: usize,
        dt_s: f64,
        newest: &mut [f64; crate::trajectory::MAX_AXES],
    ) -> f64 {
        let spec = &self.spec.axes[axis];
        let input = self.input.value()[axis];
        match spec.mode {
            Mode::Csp => {
                let last = self.commanded_m[0][axis];
                let step = spec.limits.velocity_max_m_s * dt_s;
                let wanted = self.reference.position_m[axis] + input;
                let target = wanted
                    .max(spec.position_min_m)
                    .min(spec.position_max_m)
                    .max(last - step)
                    .min(last + step);
                newest[axis] = target;
                target
            }
            Mode::Csv => {
                newest[axis] = self.reference.position_m[axis];
                let drive = &self.drives[axis];
                if matches!(self.phase, Phase::Enabling { .. } | Phase::Disabling { .. })
                    || !drive.enabled()
                {
                    return 0.0;
                }
                let most = spec.limits.velocity_max_m_s;
                let control = spec.position_loop.command_m_s(
                    self.reference.position_m[axis],
                    self.reference.velocity_m_s[axis],
                    drive.encoder_m,
                );
                (control + input).max(-most).min(most)
            }
        }
    }

    fn controlword(&self, axis: usize) -> Controlword {
        let drive = &self.drives[axis];
        if drive.lost {
            return Controlword::QUICK_STOP;
        }
        let Some(state) = drive.state().filter(|_| drive.heard) else {
            return Controlword::DISABLE_VOLTAGE;
        };
        match self.phase {
            Phase::Enabling { .. } if state == State::Fault => {
                Controlword::fault_reset_after(drive.controlword)
            }
            Phase::Disabling { .. } | Phase::Stopped => match state {
                State::OperationEnabled | State::SwitchedOn => Controlword::SHUTDOWN,
                _ => Controlword::DISABLE_VOLTAGE,
            },
            _ => next_command(state),
        }
    }
}
