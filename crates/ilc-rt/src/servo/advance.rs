//! The middle of a tick: what the axes do next, and the set point that follows from it.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::{Message, StopReason};
use super::phase::Phase;
use crate::fieldbus::cia402::{Mode, State};
use crate::trajectory::{ControlledStop, MAX_AXES, PointToPoint};

/// How long the axes shall rest after a stop before the drives are switched off.
const REST_S: f64 = 0.1;
/// How long the drives may take to switch off.
const DISABLE_S: f64 = 0.5;

impl Cycle {
    /// Moves the phase on and sets reference and learned input of this tick; returns run and sample
    /// if a run is on.
    pub(super) fn advance(&mut self) -> Option<(u32, u32)> {
        let dt_s = self.spec.cycle.as_secs_f64();
        match self.phase {
            Phase::Enabling { ticks } => self.enabling(ticks),
            Phase::Returning(mut plan) => {
                self.input.fade();
                self.reference = plan.next(dt_s);
                self.phase = if self.reference.done {
                    Phase::Settling { ticks_left: self.spec.settle_ticks }
                } else {
                    Phase::Returning(plan)
                };
            }
            Phase::Settling { ticks_left } => {
                self.input.fade();
                if ticks_left > 0 || !self.input.faded() {
                    self.phase = Phase::Settling { ticks_left: ticks_left.saturating_sub(1) };
                } else if self.run < self.spec.runs.end {
                    self.take_table();
                    self.interpolator.restart();
                    self.run_overruns = 0;
                    return self.running(0);
                } else {
                    self.phase = Phase::Disabling { ticks: 0 };
                }
            }
            Phase::Running { sample } => {
                if (sample as usize) < self.interpolator.n_samples() {
                    return self.running(sample);
                }
                self.run += 1;
                self.return_to_start();
            }
            Phase::Stopping { mut stop, rest_ticks } => {
                self.input.fade();
                self.reference = stop.next(dt_s);
                self.phase = if !self.reference.done || !self.input.faded() {
                    Phase::Stopping { stop, rest_ticks }
                } else if f64::from(rest_ticks) * dt_s < REST_S {
                    Phase::Stopping { stop, rest_ticks: rest_ticks + 1 }
                } else {
                    Phase::Disabling { ticks: 0 }
                };
            }
            Phase::Disabling { ticks } => {
                let off = |axis: usize| {
                    let drive = &self.drives[axis];
                    drive.lost
                        || matches!(drive.state(), Some(State::SwitchOnDisabled | State::Fault))
                };
                let all_off = (0..self.n_axes()).all(off);
                self.phase = if all_off || f64::from(ticks) * dt_s > DISABLE_S {
                    Phase::Stopped
                } else {
                    Phase::Disabling { ticks: ticks + 1 }
                };
            }
            Phase::Stopped => {}
        }
        None
    }

    fn enabling(&mut self, ticks: u32) {
        for axis in 0..self.n_axes() {
            // Until a drive follows, its command is where it is: nothing can jump when it does.
            if !self.drives[axis].enabled() {
                self.reference.position_m[axis] = self.drives[axis].encoder_m;
                for past in &mut self.commanded_m {
                    past[axis] = self.drives[axis].encoder_m;
                }
            }
        }
        if (0..self.n_axes()).all(|axis| self.drives[axis].enabled()) {
            self.return_to_start();
        } else {
            self.phase = Phase::Enabling { ticks: ticks + 1 };
        }
    }

    fn return_to_start(&mut self) {
        let plan = PointToPoint::new(
            &self.reference.position_m,
            &self.start_m,
            self.n_axes(),
            &self.limits,
            self.spec.return_feed_m_s,
        );
        match plan {
            Ok(plan) => self.phase = Phase::Returning(plan),
            Err(_) => self.begin_stop(StopReason::NotFinite { axis: 0 }),
        }
    }

    fn running(&mut self, sample: u32) -> Option<(u32, u32)> {
        let row = self.table_row(sample as usize);
        let n_axes = self.n_axes();
        if let Err(axis) = self.input.follow(&row[..n_axes]) {
            self.begin_stop(StopReason::NotFinite { axis });
            // The stop has taken over the learned input, so the set point of this tick is the stop's.
            return self.advance();
        }
        self.reference = self.interpolator.next();
        self.phase = Phase::Running { sample: sample + 1 };
        Some((self.run, sample))
    }

    /// Begins a controlled stop of all axes, unless one is under way or nothing moves any more.
    pub(super) fn begin_stop(&mut self, reason: StopReason) {
        if self.stopping.is_some() || matches!(self.phase, Phase::Disabling { .. } | Phase::Stopped)
        {
            return;
        }
        self.stopping = Some(reason);
        self.mail.tell(Message::Stopping(reason));
        if matches!(self.phase, Phase::Enabling { .. }) {
            self.phase = Phase::Disabling { ticks: 0 };
            return;
        }
        let dt_s = self.spec.cycle.as_secs_f64();
        let [newest, middle, oldest] = self.commanded_m;
        let mut position_m = self.reference.position_m;
        let mut velocity_m_s = self.reference.velocity_m_s;
        let mut acceleration_m_s2 = [0.0; MAX_AXES];
        let mut absorb = false;
        for axis in 0..self.n_axes() {
            if self.spec.axes[axis].mode == Mode::Csp {
                // The stop starts from what was commanded, learned input included.
                position_m[axis] = newest[axis];
                velocity_m_s[axis] = (newest[axis] - middle[axis]) / dt_s;
                acceleration_m_s2[axis] =
                    (newest[axis] - 2.0 * middle[axis] + oldest[axis]) / (dt_s * dt_s);
                absorb = true;
            }
        }
        if absorb {
            self.input.absorb();
        }
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
