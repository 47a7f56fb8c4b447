//! What the loop knows of one drive: its last answer, and what it was last told.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use crate::fieldbus::cia402::{Command, Controlword, State, Status, Statusword};

/// One drive as last heard.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    /// Whether it has answered at all.
    pub(super) heard: bool,
    /// Last statusword.
    pub(super) statusword: u16,
    /// Last position.
    pub(super) encoder_m: f64,
    /// Last distance of demand and position as the drive sees it.
    pub(super) following_error_m: f64,
    /// Last emergency code; 0 for none.
    pub(super) emergency: u16,
    /// Whether it is lost and shall only be told to stop.
    pub(super) lost: bool,
    /// Whether what it measures is not to be trusted any more.
    pub(super) distrusted: bool,
    /// Distance of the last two positions, if it is farther than the axis can move.
    pub(super) jump_m: Option<f64>,
    /// Last controlword sent.
    pub(super) controlword: Controlword,
    /// Last target sent.
    pub(super) target_counts: i32,
}

impl Default for Drive {
    fn default() -> Self {
        Self {
            heard: false,
            statusword: 0,
            encoder_m: 0.0,
            following_error_m: 0.0,
            emergency: 0,
            lost: false,
            distrusted: false,
            jump_m: None,
            controlword: Controlword::DISABLE_VOLTAGE,
            target_counts: 0,
        }
    }
}

impl Drive {
    /// Takes over a status, its position already in metres.
    pub(super) fn status(&mut self, status: Status, encoder_m: f64) {
        self.heard = true;
        self.statusword = status.statusword.0;
        self.encoder_m = encoder_m;
    }

    /// The state that its statusword tells, if it tells one.
    pub(super) fn state(&self) -> Option<State> {
        Statusword(self.statusword).state()
    }

    /// Whether it follows commands.
    pub(super) fn enabled(&self) -> bool {
        self.heard && self.state() == Some(State::OperationEnabled)
    }

    /// Whether it has stopped itself.
    pub(super) fn faulted(&self) -> bool {
        matches!(self.state(), Some(State::Fault | State::FaultReactionActive))
    }

    /// The command with this controlword and the last target.
    pub(super) fn command(&self, controlword: Controlword) -> Command {
        Command { controlword, target_counts: self.target_counts, torque_offset: 0 }
    }
}
