//! Axes that stand still, in memory, and answer every exchange at once: for measuring the loop without drives.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

use super::{AnswerPart, Arrival, AxisNetwork};
use crate::fieldbus::bus::BusError;
use crate::fieldbus::cia402::{CommandRpdo1, Controlword, Reading, State, Statusword};

/// Bytes of the answer of an axis: statusword, position and torque.
const ANSWER_BYTES: u8 = 8;

/// Axes at rest; whatever they are commanded, they stay where they are.
#[derive(Clone, Debug)]
pub struct StillAxes {
    axes: Vec<Still>,
    has_tool: bool,
    /// Answers to the last exchange that were not taken yet, the tool's included.
    n_left: usize,
}

#[derive(Clone, Copy, Debug)]
struct Still {
    position_counts: i32,
    state: State,
}

impl StillAxes {
    /// Creates axes that rest at some positions, in counts, with a measurement of the tool or without. Cold.
    pub fn new(position_counts: &[i32], has_tool: bool) -> Self {
        let still = |at: &i32| Still { position_counts: *at, state: State::SwitchOnDisabled };
        Self { axes: position_counts.iter().map(still).collect(), has_tool, n_left: 0 }
    }

    fn n_answers(&self) -> usize {
        self.axes.len() + usize::from(self.has_tool)
    }
}

impl AxisNetwork for StillAxes {
    fn write(&mut self, axis: usize, command: &CommandRpdo1) -> Result<(), BusError> {
        if let Some(still) = self.axes.get_mut(axis) {
            still.state = match command.controlword {
                Controlword::SHUTDOWN => State::ReadyToSwitchOn,
                Controlword::SWITCH_ON => State::SwitchedOn,
                Controlword::ENABLE_OPERATION => State::OperationEnabled,
                _ => State::SwitchOnDisabled,
            };
        }
        Ok(())
    }

    fn exchange(&mut self) -> Result<(), BusError> {
        self.n_left = self.n_answers();
        Ok(())
    }

    fn next(&mut self, _timeout: Duration) -> Result<Option<Arrival>, BusError> {
        let Some(left) = self.n_left.checked_sub(1) else { return Ok(None) };
        let place = self.n_answers() - self.n_left;
        self.n_left = left;
        let Some(still) = self.axes.get(place) else { return Ok(Some(Arrival::Tool([0; 2]))) };
        let (_, coded) = still.state.coding();
        let enabled = match still.state {
            State::OperationEnabled => Statusword::FOLLOWS_TARGET,
            _ => 0,
        };
        let statusword =
            Statusword(coded | Statusword::VOLTAGE_ENABLED | Statusword::REMOTE | enabled);
        let reading = Reading {
            statusword: Some(statusword),
            position_counts: Some(still.position_counts),
            ..Reading::default()
        };
        Ok(Some(Arrival::Answer { axis: place, part: AnswerPart::Status, reading }))
    }

    fn parts(&self, axis: usize) -> [bool; 2] {
        [axis < self.axes.len(), false]
    }

    fn part_bytes(&self, _axis: usize, part: AnswerPart) -> u8 {
        match part {
            AnswerPart::Status => ANSWER_BYTES,
            AnswerPart::Motion => 0,
        }
    }

    fn release(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}
