//! The middle of a tick: transitions of the phase, and the resulting set point.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::StopReason;
use super::mode;
use super::phase::Phase;
use crate::fieldbus::cia402::State;
use crate::interpolate::{MAX_AXES, PointToPoint};

/// Time-out for the drives to switch off.
const DISABLE_S: f64 = 0.5;

impl Cycle {
    /// Advances the phase and sets reference and learned input of this tick; returns run and sample
    /// during a run.
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
                    self.waits = !self.may_start();
                    if !self.waits {
                        return self.start_run();
                    }
                } else {
                    self.phase = Phase::Disabling { ticks: 0 };
                }
            }
            Phase::Running { sample } => {
                if (sample as usize) < self.path.n_samples() {
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
                } else if f64::from(rest_ticks) * dt_s < self.rest_s {
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
            // Until a drive is enabled, its command is its position: the transfer is bumpless.
            if !self.drives[axis].enabled() {
                let encoder_m = self.drives[axis].encoder_m;
                self.reference.position_m[axis] = encoder_m;
                self.hold(axis, encoder_m);
            }
        }
        if (0..self.n_axes()).all(|axis| self.drives[axis].enabled()) {
            self.move_to_start(self.spec.approach_feed_m_s);
        } else {
            self.phase = Phase::Enabling { ticks: ticks + 1 };
        }
    }

    /// Assumes that an axis has been commanded to a position for long.
    fn hold(&mut self, axis: usize, position_m: f64) {
        let command = mode::of(self.spec.axes[axis].mode).hold(position_m);
        for past in &mut self.commanded {
            past[axis] = command;
        }
        self.loops[axis].begin(command);
    }

    fn return_to_start(&mut self) {
        self.move_to_start(self.spec.return_feed_m_s);
    }

    fn move_to_start(&mut self, feed_m_s: f64) {
        let plan = PointToPoint::new(
            &self.reference.position_m,
            &self.start_m,
            self.n_axes(),
            &self.limits,
            feed_m_s,
        );
        match plan {
            Ok(plan) => self.phase = Phase::Returning(plan),
            Err(_) => self.begin_stop(StopReason::NotFinite { axis: 0 }),
        }
    }

    fn start_run(&mut self) -> Option<(u32, u32)> {
        self.take_table();
        self.path.restart();
        self.feed.reset(self.mail.seen.scale());
        (self.run_overruns, self.run_scaled) = (0, 0);
        self.running(0)
    }

    /// Goes on along the path; `next` is the sample of the run that was not reached yet. Returns the
    /// sample in the tick that reaches it: a run slowed down has ticks between its samples.
    fn running(&mut self, next: u32) -> Option<(u32, u32)> {
        let mut scale = self.feed.scale();
        if next > 0 {
            scale = self.feed.next(self.mail.seen.scale());
            self.path.advance(scale);
        }
        self.run_scaled = self.run_scaled.saturating_add(u32::from(scale < 1.0));
        let (place, fraction) = self.path.place();
        let row = self.scaled_row(place, fraction, scale);
        let n_axes = self.n_axes();
        if let Err(axis) = self.input.follow(&row[..n_axes]) {
            self.begin_stop(StopReason::NotFinite { axis });
            // The stop has absorbed the learned input, so the set point of this tick is the stop's.
            return self.advance();
        }
        self.reference = self.path.setpoint(scale);
        if place < next as usize {
            return None;
        }
        self.phase = Phase::Running { sample: next + 1 };
        Some((self.run, next))
    }

    /// Returns the learned input at a place of the path: it was learned at the whole feed, and fades out
    /// with the scale, so that held axes rest on the path and not beside it.
    fn scaled_row(&self, place: usize, fraction: f64, scale: f64) -> [f64; MAX_AXES] {
        let row = self.table_row(place);
        if scale >= 1.0 && fraction <= 0.0 {
            return row;
        }
        let mut mixed = self.table_row((place + 1).min(self.path.n_samples() - 1));
        for (mixed, from) in mixed.iter_mut().zip(row) {
            *mixed = scale * (from + fraction * (*mixed - from));
        }
        mixed
    }
}
