//! The first half of a tick: received messages, and fault detection.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

use super::cycle::Cycle;
use super::mailbox::StopReason;
use super::mode;
use super::pending::Part;
use super::phase::Phase;
use super::silence::saturate;
use super::spec::Pace;
use crate::fieldbus::BusError;
use crate::fieldbus::canopen::{NmtState, emcy};
use crate::fieldbus::cia402::{Reading, State};
use crate::fieldbus::network::{AnswerPart, Arrival};

/// Largest number of messages per tick, so that a babbling bus cannot stall the loop.
const FRAMES_MAX: usize = 256;
/// Distance, in cycles at full velocity, that an axis may be ahead of its last position.
const JUMP_WAYS: f64 = 2.0;
/// Share of the allowed following error that it may be ahead beyond that, for noise.
const JUMP_SHARE: f64 = 0.1;
/// Share of the allowed following error that an axis may be outside its limits at the start: one
/// that has been at its limit rests off it by noise and friction.
const OUTSIDE_SHARE: f64 = 0.02;
/// Cycles without an answer after which a position is too old to be used for the following error.
const STALE_CYCLES: u64 = 5;

/// Answers with the same position after which an axis counts as standing still.
const STILL_CYCLES: u32 = 5;

impl Cycle {
    /// Takes every available message; paced by answers, waits until all have arrived.
    pub(super) fn receive(&mut self) -> Result<(), StopReason> {
        let mut left = Ok(());
        for _ in 0..FRAMES_MAX {
            let timeout = match self.spec.pace {
                Pace::Answers(patience) if !self.pending.all_answered() => patience,
                _ => Duration::ZERO,
            };
            match self.network.next(timeout) {
                Ok(Some(arrival)) => {
                    self.flight.message(self.network.arrival());
                    left = left.and(self.take(arrival));
                }
                Ok(None) => return left,
                // Frames are behind it.
                Err(error @ BusError::Controller(_)) => {
                    left = left.and(Err(StopReason::Bus(error)));
                }
                Err(error) => return Err(StopReason::Bus(error)),
            }
        }
        // Answers may be behind the flood.
        self.pending.spoil_next();
        left
    }

    /// Ends the first stage in the flight recorder.
    pub(super) fn end_reception(&mut self) {
        let (n_axes, pending) = (self.n_axes(), &self.pending);
        self.flight.received(|place| {
            let lag = |part| pending.lag(part);
            if place == n_axes {
                return lag(Part::Tool) == 0;
            }
            place < n_axes && lag(Part::Status(place)) == 0 && lag(Part::DriveMotion(place)) == 0
        });
    }

    fn take(&mut self, arrival: Arrival) -> Result<(), StopReason> {
        match arrival {
            Arrival::Answer { axis, part, reading } => self.take_answer(axis, part, reading),
            Arrival::Tool(counts) => {
                if let Some(tool) = self.spec.tool {
                    let [x_m, y_m] = counts.map(|count| tool.scale.to_si(count));
                    self.tool_m[..2].copy_from_slice(&[x_m, y_m]);
                    let place = self.n_axes();
                    self.flight.answered(place, self.pending.lag(Part::Tool));
                    self.pending.answer(Part::Tool, [x_m, y_m]);
                }
            }
            Arrival::Unreadable { axis, part, n_bytes } => {
                self.drives[axis].unreadable[part.index()] = Some(n_bytes);
            }
            Arrival::UnreadableTool { n_bytes } => self.tool_unreadable = Some(n_bytes),
            Arrival::Emergency { axis, code } => {
                self.drives[axis].emergency = Some(code).filter(|code| *code != emcy::CODE_RESET);
            }
            Arrival::Node { node, state } => {
                let (node, bit) = (node.get(), 1_u128 << node.get());
                return match state {
                    NmtState::Operational => {
                        self.operational |= bit;
                        Ok(())
                    }
                    // Sent before it was started, and read after. One that stays there falls silent.
                    NmtState::PreOperational
                        if self.operational & bit == 0
                            && matches!(self.phase, Phase::Enabling { .. }) =>
                    {
                        Ok(())
                    }
                    NmtState::BootUp => Err(StopReason::NodeLeft { node }),
                    state => Err(StopReason::NodeStopped { node, state }),
                };
            }
            Arrival::Stranger(stranger) => return Err(StopReason::OtherMaster(stranger)),
            Arrival::Other => {}
        }
        Ok(())
    }

    /// Takes a part of the answer of an axis.
    fn take_answer(&mut self, axis: usize, part: AnswerPart, reading: Reading) {
        let spec = &self.spec.axes[axis];
        let drive = &mut self.drives[axis];
        if let (Some(statusword), Some(counts)) = (reading.statusword, reading.position_counts) {
            let encoder_m = spec.scale.position_m(counts);
            #[expect(clippy::cast_precision_loss, reason = "a count of cycles")]
            let cycles = self.pending.silence(Part::Status(axis)).max(1) as f64;
            let way_m = spec.limits.velocity_max_m_s * self.spec.cycle.as_secs_f64() * cycles;
            let step_m = encoder_m - drive.encoder_m;
            if drive.heard
                && step_m.abs() > JUMP_WAYS * way_m + JUMP_SHARE * spec.following_error_max_m
            {
                drive.jump_m = drive.jump_m.or(Some(step_m));
            }
            if drive.heard {
                let (dt_s, before_m_s) = (self.spec.cycle.as_secs_f64(), drive.raw_m_s);
                let change_m_s = drive.derive(step_m, cycles, spec.velocity_share, dt_s);
                drive.watch_standstill(step_m, self.commanded[0][axis]);
                if mode::of(spec.mode).closes_velocity_loop()
                    && change_m_s.abs() > spec.velocity_jump_m_s(dt_s)
                {
                    drive.jump_m = drive.jump_m.or(Some(step_m - before_m_s * dt_s));
                }
            }
            drive.status(statusword, encoder_m);
        }
        drive.velocity_counts_s = reading.velocity_counts_s.or(drive.velocity_counts_s);
        drive.torque = reading.torque.or(drive.torque);
        if let Some(word) = reading.digital_inputs {
            (drive.inputs, drive.inputs_part) = (Some(word), part);
        }
        // In a fault it has no demand any more; the last following error before counts.
        if let Some(counts) = reading.following_error_counts {
            drive.reports_following_error = true;
            if !drive.faulted() {
                drive.following_error_m = spec.scale.to_si(counts);
            }
        }
        let (part, value) = match part {
            AnswerPart::Status => (Part::Status(axis), [drive.encoder_m, 0.0]),
            AnswerPart::Motion => (Part::DriveMotion(axis), [0.0; 2]),
        };
        self.flight.answered(axis, self.pending.lag(part));
        self.pending.answer(part, value);
        // Without a report it is computed from the command that this position answers.
        if !drive.reports_following_error
            && !drive.faulted()
            && let Some(commanded_m) = self.pending.answered_command_m(axis)
        {
            drive.following_error_m = commanded_m - drive.encoder_m;
        }
    }

    /// Returns the first reason to stop.
    pub(super) fn find_fault(&mut self) -> Option<StopReason> {
        // Checked in every phase: a lost node must not be waited for again.
        let silence = self.find_silence();
        if matches!(self.phase, Phase::Disabling { .. } | Phase::Stopped) {
            return silence.filter(|silence| self.better_reason(*silence).is_some());
        }
        let asked = self.mail.asked;
        if asked != 0 {
            return Some(StopReason::Asked(asked));
        }
        if self.stall.streak() > self.spec.overrun_cycles_max {
            return Some(StopReason::Overrun { cycles: self.stall.streak() });
        }
        // An open guard may have taken the power of a drive as well, and is the cause then.
        let fault = silence
            .or_else(|| self.input_fault())
            .or_else(|| (0..self.n_axes()).find_map(|axis| self.axis_fault(axis)));
        for drive in &mut self.drives {
            drive.jump_m = None;
        }
        fault
    }

    fn axis_fault(&self, axis: usize) -> Option<StopReason> {
        let drive = &self.drives[axis];
        let spec = &self.spec.axes[axis];
        if let Phase::Enabling { ticks } = self.phase {
            let slack_m = OUTSIDE_SHARE * spec.following_error_max_m;
            let position_m = drive.encoder_m;
            if drive.heard
                && (position_m < spec.position_min_m - slack_m
                    || position_m > spec.position_max_m + slack_m)
            {
                return Some(StopReason::OutsideLimits { axis, position_m });
            }
            if drive.heard && drive.faulted() && !self.spec.resets_faults {
                return Some(StopReason::DriveFault {
                    axis,
                    code: drive.emergency.unwrap_or(emcy::CODE_RESET),
                    following_error_m: drive.following_error_m,
                });
            }
            // A drive that is not enabled in time, or whose fault returns, is refused.
            if ticks <= self.spec.enable_ticks || drive.enabled() {
                return None;
            }
            if !drive.heard {
                return Some(self.silent_axis(axis, self.pending.silence(Part::Status(axis))));
            }
            return Some(StopReason::NotEnabled { axis, statusword: drive.statusword });
        }
        if drive.faulted()
            && drive.emergency == Some(emcy::CODE_RPDO_TIMEOUT)
            && let Some(cycles) = self.stall.blamed()
        {
            return Some(StopReason::Stalled { axis, cycles });
        }
        if drive.faulted() {
            return Some(StopReason::DriveFault {
                axis,
                code: drive.emergency.unwrap_or(emcy::CODE_RESET),
                following_error_m: drive.following_error_m,
            });
        }
        if !drive.enabled() || drive.state() == Some(State::QuickStopActive) {
            return Some(StopReason::NotEnabled { axis, statusword: drive.statusword });
        }
        if let Some(step_m) = drive.jump_m {
            return Some(StopReason::Jump { axis, step_m });
        }
        if mode::of(spec.mode).closes_velocity_loop() && drive.still.0 >= STILL_CYCLES {
            let force_n = self.commanded[0][axis] - drive.still.1;
            if force_n.abs() > spec.moving_force_n() {
                return Some(StopReason::NoMotion { axis, force_n });
            }
        }
        // A late position answers an earlier command; one that is long overdue is compared with the
        // newest.
        let silence = self.pending.silence(Part::Status(axis));
        let stale = silence > STALE_CYCLES;
        let commanded_m = match self.pending.answered_command_m(axis) {
            Some(commanded_m) if !stale => commanded_m,
            _ => self.commanded_position_m()[axis],
        };
        let error_m = commanded_m - drive.encoder_m;
        if error_m.abs() <= spec.following_error_max_m {
            return None;
        }
        Some(if stale {
            StopReason::SilentAxis { axis, cycles: saturate(silence) }
        } else {
            StopReason::FollowingError { axis, error_m }
        })
    }
}
