//! The first half of a tick: received frames, and fault detection.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

use super::cycle::Cycle;
use super::mailbox::StopReason;
use super::pending::Part;
use super::phase::Phase;
use super::silence::saturate;
use super::spec::Pace;
use crate::fieldbus::canopen::{Emergency, Heartbeat, NmtState, NodeId, emcy};
use crate::fieldbus::cia402::pdo_map::{DRIVE_MOTION_PDO, ENCODER_PDO, STATUS_PDO};
use crate::fieldbus::cia402::{DriveMotionTpdo2, EncoderSample, State, StatusTpdo1};
use crate::fieldbus::{Bus, Frame};

/// Largest number of frames per tick, so that a babbling bus cannot stall the loop.
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

impl Cycle {
    /// Takes every available frame; paced by answers, waits until all have arrived.
    pub(super) fn receive(&mut self) -> Result<(), StopReason> {
        let mut left = Ok(());
        for _ in 0..FRAMES_MAX {
            let timeout = match self.spec.pace {
                Pace::Answers(patience) if !self.pending.all_answered() => patience,
                _ => Duration::ZERO,
            };
            match self.bus.recv(timeout) {
                Ok(Some(frame)) => left = left.and(self.take(&frame)),
                Ok(None) => return left,
                Err(error) => return Err(StopReason::Bus(error)),
            }
        }
        // Answers may be behind the flood.
        self.pending.spoil_next();
        left
    }

    fn take(&mut self, frame: &Frame) -> Result<(), StopReason> {
        if self.take_answer(frame) {
            return Ok(());
        }
        if let Some(stranger) = self.stranger(frame) {
            return Err(StopReason::OtherMaster(stranger));
        }
        if let Some(emergency) = Emergency::decode(frame) {
            let sender = self.spec.axes.iter().position(|axis| axis.node == emergency.node);
            if let Some(axis) = sender {
                self.drives[axis].emergency =
                    Some(emergency.code).filter(|code| *code != emcy::CODE_RESET);
            }
        } else if let Some(heartbeat) = Heartbeat::decode(frame)
            && self.is_ours(heartbeat.node)
        {
            let node = heartbeat.node.get();
            return match heartbeat.state {
                NmtState::Operational => Ok(()),
                NmtState::BootUp => Err(StopReason::NodeLeft { node }),
                state => Err(StopReason::NodeStopped { node, state }),
            };
        }
        Ok(())
    }

    /// Takes a frame if it is an answer to SYNC.
    fn take_answer(&mut self, frame: &Frame) -> bool {
        for axis in 0..self.n_axes() {
            let spec = &self.spec.axes[axis];
            let drive = &mut self.drives[axis];
            if let Some(status) = StatusTpdo1::decode(frame, spec.node) {
                let encoder_m = spec.scale.to_si(status.position_counts);
                #[expect(clippy::cast_precision_loss, reason = "a count of cycles")]
                let cycles = self.pending.silence(Part::Status(axis)).max(1) as f64;
                let way_m = spec.limits.velocity_max_m_s * self.spec.cycle.as_secs_f64() * cycles;
                let step_m = encoder_m - drive.encoder_m;
                if drive.heard
                    && step_m.abs() > JUMP_WAYS * way_m + JUMP_SHARE * spec.following_error_max_m
                {
                    drive.jump_m = drive.jump_m.or(Some(step_m));
                }
                drive.status(status, encoder_m);
                self.pending.answer(Part::Status(axis), [encoder_m, 0.0]);
                return true;
            }
            if let Some(extra) = DriveMotionTpdo2::decode(frame, spec.node) {
                // In a fault it has no demand any more; the last following error before counts.
                if !drive.faulted() {
                    drive.following_error_m = spec.scale.to_si(extra.following_error_counts);
                }
                self.pending.answer(Part::DriveMotion(axis), [0.0; 2]);
                return true;
            }
            let unreadable = [STATUS_PDO, DRIVE_MOTION_PDO]
                .iter()
                .position(|pdo| frame.id() == pdo.default_cob_id(spec.node));
            if let Some(pdo) = unreadable {
                drive.unreadable[pdo] = u8::try_from(frame.payload().len()).ok();
                return true;
            }
        }
        let Some(tool) = self.spec.tool else { return false };
        if let Some(measured) = EncoderSample::decode(frame, tool.node) {
            self.tool_m[0] = tool.scale.to_si(measured.x_counts);
            self.tool_m[1] = tool.scale.to_si(measured.y_counts);
            self.pending.answer(Part::Tool, [self.tool_m[0], self.tool_m[1]]);
            return true;
        }
        if frame.id() == ENCODER_PDO.default_cob_id(tool.node) {
            self.tool_unreadable = u8::try_from(frame.payload().len()).ok();
            return true;
        }
        false
    }

    /// Returns whether a node belongs to this cell.
    pub(super) fn is_ours(&self, node: NodeId) -> bool {
        self.spec.axes.iter().any(|axis| axis.node == node)
            || self.spec.tool.is_some_and(|tool| tool.node == node)
    }

    /// Returns the first reason to stop.
    pub(super) fn find_fault(&mut self) -> Option<StopReason> {
        // Checked in every phase: a lost node must not be waited for again.
        let silence = self.find_silence();
        if matches!(self.phase, Phase::Disabling { .. } | Phase::Stopped) {
            return None;
        }
        let asked = self.mail.asked_to_stop();
        if asked != 0 {
            return Some(StopReason::Asked(asked));
        }
        if self.stall.streak() > self.spec.overrun_cycles_max {
            return Some(StopReason::Overrun { cycles: self.stall.streak() });
        }
        let fault = silence.or_else(|| (0..self.n_axes()).find_map(|axis| self.axis_fault(axis)));
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
            // An earlier fault is reset during enabling; a drive that is not enabled in time is
            // refused.
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
