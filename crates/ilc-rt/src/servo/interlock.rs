//! Digital inputs in the loop: guards, stop buttons and limit switches stop the axes, a press of a start button
//! releases a run.
//!
//! A stop acts at once, a permission only after debouncing: an open guard stops the axes in the tick that
//! sees it, a closed one permits power after some cycles. An input of a drive that has fallen silent permits nothing;
//! that silence itself stops the axes (`silence`).

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::inputs::{InputBits, InputRole};
use super::mailbox::{Message, StopReason};
use super::pending::Part;
use super::phase::Phase;
use crate::fieldbus::network::AnswerPart;

/// Cycles without an answer after which an input is too old to permit anything.
const STALE_CYCLES: u64 = 5;

impl Cycle {
    /// Takes the inputs of this tick, and tells their changes.
    pub(super) fn read_inputs(&mut self) {
        self.is_pressed = false;
        let mut bits = InputBits::default();
        for (number, (input, spec)) in self.inputs.iter_mut().zip(&self.spec.inputs).enumerate() {
            let drive = &self.drives[spec.axis];
            let part = match drive.inputs_part {
                AnswerPart::Status => Part::Status(spec.axis),
                AnswerPart::Motion => Part::DriveMotion(spec.axis),
            };
            let is_fresh = self.pending.silence(part) <= STALE_CYCLES;
            let level = drive.inputs.map(|word| (word & spec.mask != 0) == spec.is_high);
            let went_on = input.see(level.filter(|_| is_fresh), spec.debounce_cycles);
            self.is_pressed |= went_on && spec.role == InputRole::Start;
            bits.known |= u16::from(input.is_on.is_some()) << number;
            bits.on |= u16::from(input.is_on == Some(true)) << number;
        }
        if bits != self.input_bits {
            self.input_bits = bits;
            self.mail.tell(Message::Inputs(bits));
        }
    }

    /// Returns true if every input is known and every guard is steadily closed: the drives may be switched on.
    pub(super) fn inputs_permit(&self) -> bool {
        self.inputs.iter().zip(&self.spec.inputs).all(|(input, spec)| match spec.role {
            InputRole::Guard => input.is_steadily_on(spec.debounce_cycles),
            InputRole::Start | InputRole::Stop | InputRole::Limit(_) => input.is_on.is_some(),
        })
    }

    /// Returns true if the run that waits may start; a press releases it, unless the path is held.
    pub(super) fn may_start(&mut self) -> bool {
        if self.is_pressed
            && self.spec.starts_on_input
            && !self.mail.seen.is_paused
            && self.inputs_permit()
        {
            self.mail.release(self.run);
        }
        self.mail.seen.may_start(self.run)
    }

    /// Returns the first reason of an input to stop.
    pub(super) fn input_fault(&self) -> Option<StopReason> {
        let inputs = self.inputs.iter().zip(&self.spec.inputs);
        inputs.enumerate().find_map(|(input, (seen, spec))| {
            let is_on = seen.is_on?;
            match spec.role {
                InputRole::Guard if !is_on => Some(StopReason::GuardOpen { input }),
                InputRole::Stop if is_on => Some(StopReason::StopButton { input }),
                InputRole::Limit(sign) if is_on && self.moves(spec.axis, sign) => {
                    Some(StopReason::LimitSwitch { input, axis: spec.axis })
                }
                _ => None,
            }
        })
    }

    /// Returns true if the set point of an axis moves in the direction of the sign. The set point alone: noise of a
    /// position loop at rest is no motion.
    fn moves(&self, axis: usize, sign: f64) -> bool {
        matches!(self.phase, Phase::Returning(_) | Phase::Running { .. })
            && sign * self.reference.velocity_m_s[axis] > 0.0
    }
}
