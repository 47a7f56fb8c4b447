//! The first half of a tick: what came over the bus, and what is wrong with it.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

use super::cycle::Cycle;
use super::mailbox::StopReason;
use super::phase::Phase;
use super::spec::Pace;
use crate::fieldbus::canopen::{Emergency, Heartbeat, NmtState, emcy};
use crate::fieldbus::cia402::{EncoderSample, Extra, Mode, State, Status};
use crate::fieldbus::{Bus, Frame};

/// Most frames taken in one tick, so that a babbling bus cannot hold the loop.
const FRAMES_MAX: usize = 256;
/// Cycles without an answer after which a position is too old to blame the drive for its distance.
const STALE_CYCLES: u64 = 5;

impl Cycle {
    /// Takes every frame that is there; paced by answers, waits until all have come.
    pub(super) fn receive(&mut self) -> Result<(), StopReason> {
        let mut left = Ok(());
        for _ in 0..FRAMES_MAX {
            let timeout = match self.spec.pace {
                Pace::Answers(patience) if !self.slots.all_answered() => patience,
                _ => Duration::ZERO,
            };
            match self.bus.recv(timeout) {
                Ok(Some(frame)) => left = left.and(self.take(&frame)),
                Ok(None) => break,
                Err(error) => return Err(StopReason::Bus(error)),
            }
        }
        left
    }

    fn take(&mut self, frame: &Frame) -> Result<(), StopReason> {
        for axis in 0..self.n_axes() {
            let spec = &self.spec.axes[axis];
            let drive = &mut self.drives[axis];
            if let Some(status) = Status::decode(frame, spec.node) {
                drive.status(status, spec.scale.to_si(status.position_counts));
                return Ok(());
            }
            // A drive sends this one last, so it completes the answer to a SYNC.
            if let Some(extra) = Extra::decode(frame, spec.node) {
                // In a fault it has no demand any more; what led there is the last one before.
                if !drive.faulted() {
                    drive.following_error_m = spec.scale.to_si(extra.following_error_counts);
                }
                let encoder_m = drive.encoder_m;
                self.slots.answer(axis, |sample| sample.encoder_m[axis] = encoder_m);
                return Ok(());
            }
        }
        if let Some(tool) = self.spec.tool
            && let Some(measured) = EncoderSample::decode(frame, tool.node)
        {
            self.tool_m[0] = tool.scale.to_si(measured.x_counts);
            self.tool_m[1] = tool.scale.to_si(measured.y_counts);
            let tool_m = self.tool_m;
            self.slots.answer(self.n_axes(), |sample| sample.tool_m = tool_m);
            return Ok(());
        }
        if let Some(emergency) = Emergency::decode(frame) {
            let sender = self.spec.axes.iter().position(|axis| axis.node == emergency.node);
            if let Some(axis) = sender {
                self.drives[axis].emergency = emergency.code;
            }
        } else if let Some(heartbeat) = Heartbeat::decode(frame)
            && heartbeat.state != NmtState::Operational
            && self.is_ours(heartbeat)
        {
            return Err(StopReason::NodeLeft { node: heartbeat.node.get() });
        }
        Ok(())
    }

    fn is_ours(&self, heartbeat: Heartbeat) -> bool {
        self.spec.axes.iter().any(|axis| axis.node == heartbeat.node)
            || self.spec.tool.is_some_and(|tool| tool.node == heartbeat.node)
    }

    /// The first thing that is a reason to stop.
    pub(super) fn find_fault(&mut self) -> Option<StopReason> {
        // Asked in every phase: a node that is lost must not be waited for again.
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
        silence.or_else(|| (0..self.n_axes()).find_map(|axis| self.axis_fault(axis)))
    }

    fn find_silence(&mut self) -> Option<StopReason> {
        // Paced by answers, the wait is over when this is asked: one unanswered SYNC is silence.
        let most = match self.spec.pace {
            Pace::Answers(_) => 0,
            Pace::Clock => u64::from(self.spec.silent_cycles_max),
        };
        let mut found = None;
        for axis in 0..self.n_axes() {
            let lag = self.slots.silence(axis);
            if lag > most && !self.drives[axis].lost {
                self.drives[axis].lost = true;
                self.slots.give_up(axis);
                found = found.or(Some(StopReason::SilentAxis { axis, cycles: saturate(lag) }));
            }
        }
        let lag = self.slots.silence(self.n_axes());
        if self.spec.tool.is_some() && lag > most {
            self.slots.give_up(self.n_axes());
            found = found.or(Some(StopReason::SilentTool { cycles: saturate(lag) }));
        }
        found
    }

    fn axis_fault(&self, axis: usize) -> Option<StopReason> {
        let drive = &self.drives[axis];
        let spec = &self.spec.axes[axis];
        if let Phase::Enabling { ticks } = self.phase {
            // A fault from before is reset on the way; what is not enabled in time is refused.
            return (ticks > self.spec.enable_ticks && !drive.enabled())
                .then_some(StopReason::NotEnabled { axis, statusword: drive.statusword });
        }
        if drive.faulted()
            && drive.emergency == emcy::CODE_RPDO_TIMEOUT
            && let Some(cycles) = self.stall.blamed()
        {
            return Some(StopReason::Stalled { axis, cycles });
        }
        if drive.faulted() {
            return Some(StopReason::DriveFault {
                axis,
                code: drive.emergency,
                following_error_m: drive.following_error_m,
            });
        }
        if !drive.enabled() || drive.state() == Some(State::QuickStopActive) {
            return Some(StopReason::NotEnabled { axis, statusword: drive.statusword });
        }
        let wanted_m = match spec.mode {
            Mode::Csp => self.commanded_m[0][axis],
            Mode::Csv => self.reference.position_m[axis],
        };
        let error_m = wanted_m - drive.encoder_m;
        if error_m.abs() <= spec.following_error_max_m {
            return None;
        }
        let silence = self.slots.silence(axis);
        Some(if silence > STALE_CYCLES {
            StopReason::SilentAxis { axis, cycles: saturate(silence) }
        } else {
            StopReason::FollowingError { axis, error_m }
        })
    }
}

fn saturate(cycles: u64) -> u32 {
    u32::try_from(cycles).unwrap_or(u32::MAX)
}
