//! State of one drive in the loop: its last answer, and the last command to it.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use crate::fieldbus::cia402::{CommandRpdo1, Controlword, State, Statusword};
use crate::fieldbus::network::AnswerPart;

/// The last known state of one drive.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts")]
pub(super) struct Drive {
    /// True if it has ever answered.
    pub(super) heard: bool,
    /// Last statusword.
    pub(super) statusword: u16,
    /// Last position.
    pub(super) encoder_m: f64,
    /// Filtered difference of the positions.
    pub(super) encoder_m_s: f64,
    /// Difference of the last two positions, per cycle between them.
    pub(super) raw_m_s: f64,
    /// Answers with the same position, and the command at the first of them.
    pub(super) still: (u32, f64),
    /// Last following error: reported by the drive, or computed.
    pub(super) following_error_m: f64,
    /// True if it reports its following error.
    pub(super) reports_following_error: bool,
    /// Last emergency code since it was enabled.
    pub(super) emergency: Option<u16>,
    /// True if it is lost and only gets commands to stop.
    pub(super) lost: bool,
    /// True if its measurements are no longer trusted.
    pub(super) distrusted: bool,
    /// Distance between the last two positions, if it exceeds the possible motion of the axis.
    pub(super) jump_m: Option<f64>,
    /// Length of the last unreadable TPDO1 and TPDO2, if there was one.
    pub(super) unreadable: [Option<u8>; 2],
    /// Last digital inputs, and the part of the answer that has them.
    pub(super) inputs: Option<u32>,
    pub(super) inputs_part: AnswerPart,
    /// Last velocity, in counts/s, and torque, in thousandths of the rated one, where they are mapped.
    pub(super) velocity_counts_s: Option<i32>,
    pub(super) torque: Option<i16>,
    /// Last command sent.
    pub(super) sent: CommandRpdo1,
}

impl Default for Drive {
    fn default() -> Self {
        Self {
            heard: false,
            statusword: 0,
            encoder_m: 0.0,
            encoder_m_s: 0.0,
            raw_m_s: 0.0,
            still: (0, 0.0),
            following_error_m: 0.0,
            reports_following_error: false,
            emergency: None,
            lost: false,
            distrusted: false,
            jump_m: None,
            unreadable: [None; 2],
            inputs: None,
            inputs_part: AnswerPart::Motion,
            velocity_counts_s: None,
            torque: None,
            sent: CommandRpdo1 {
                controlword: Controlword::DISABLE_VOLTAGE,
                target_counts: 0,
                torque_offset: 0,
                velocity_offset: 0,
            },
        }
    }
}

impl Drive {
    /// Stores a status, its position already in metres.
    pub(super) fn status(&mut self, statusword: Statusword, encoder_m: f64) {
        let was_enabled = self.enabled();
        self.heard = true;
        self.statusword = statusword.0;
        self.encoder_m = encoder_m;
        if self.enabled() && !was_enabled {
            // Reports from before it could be enabled are not the cause of a later fault.
            self.emergency = None;
        }
    }

    /// Derives the velocity from the step to a new position, which took a cycle, or as many as were
    /// not answered: whichever explains it better. Returns the change of the velocity.
    pub(super) fn derive(&mut self, step_m: f64, cycles: f64, share: f64, dt_s: f64) -> f64 {
        let [one_m_s, all_m_s] = [step_m / dt_s, step_m / (dt_s * cycles)];
        let is_late = (one_m_s - self.raw_m_s).abs() <= (all_m_s - self.raw_m_s).abs();
        let velocity_m_s = if is_late { one_m_s } else { all_m_s };
        let change_m_s = velocity_m_s - self.raw_m_s;
        self.raw_m_s = velocity_m_s;
        // Without a filter exactly the difference.
        self.encoder_m_s = if share < 1.0 {
            self.encoder_m_s + share * (velocity_m_s - self.encoder_m_s)
        } else {
            velocity_m_s
        };
        change_m_s
    }

    /// Counts answers with the same position; `command` is the one before this answer.
    pub(super) fn watch_standstill(&mut self, step_m: f64, command: f64) {
        self.still = if step_m.abs() > 0.0 {
            (0, command)
        } else {
            (self.still.0.saturating_add(1), self.still.1)
        };
    }

    /// Returns the state in its statusword, if it is defined.
    pub(super) fn state(&self) -> Option<State> {
        Statusword(self.statusword).state()
    }

    /// Returns whether it follows commands.
    pub(super) fn enabled(&self) -> bool {
        self.heard && self.state() == Some(State::OperationEnabled)
    }

    /// Returns whether it has stopped itself.
    pub(super) fn faulted(&self) -> bool {
        matches!(self.state(), Some(State::Fault | State::FaultReactionActive))
    }
}
