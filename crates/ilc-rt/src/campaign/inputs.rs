//! Digital inputs of a cell in words, and the refusal of a start that they do not permit.

use super::error::CampaignError;
use super::options::{Options, StartOn};
use crate::config::{Axis, Cell, Direction, Input, InputUse};
use crate::fieldbus::cia402::State;
use crate::record::{DriveState, InputState};
use crate::servo::{DriveStates, InputBits};

/// Digital inputs of every drive of a cell that has named ones, as read at standstill; `None` for a drive without.
pub(super) type Words = Vec<Option<u32>>;

/// Refuses a start that the inputs do not permit.
///
/// # Errors
/// [`CampaignError::Interlock`] for an open guard, or a stop button that is pressed.
pub(super) fn permit(cell: &Cell, words: &Words) -> Result<(), CampaignError> {
    forbidding(cell, words).map_or(Ok(()), |what| {
        Err(CampaignError::Interlock { file: cell.file.display().to_string(), what })
    })
}

/// Returns the sentence for the first open guard or pressed stop button.
pub(super) fn forbidding(cell: &Cell, words: &Words) -> Option<String> {
    cell.inputs.iter().find_map(|input| match (input.purpose, is_on(cell, input, words)) {
        (InputUse::Guard, false) => Some(open(cell, input)),
        (InputUse::Stop, true) => {
            Some(format!("stop button {} is pressed: release it", place(cell, input)))
        }
        _ => None,
    })
}

/// Returns true if an input may stop all axes.
pub(super) fn stops_all(input: &Input) -> bool {
    matches!(input.purpose, InputUse::Guard | InputUse::Stop)
}

/// Returns the limit switch that an axis has reached in the direction of a move, if it has.
pub(super) fn blocking<'a>(
    cell: &'a Cell,
    words: &Words,
    axis: usize,
    distance_m: f64,
) -> Option<&'a Input> {
    let axis = cell.axes.get(axis)?;
    cell.inputs.iter().find(|input| {
        let sign = input.direction_of(axis).map_or(0.0, Direction::sign);
        input.purpose == InputUse::Limit
            && input.axis == axis.name
            && is_on(cell, input, words)
            && sign * distance_m > 0.0
    })
}

/// Refuses to wait for a button that the cell does not have.
///
/// # Errors
/// [`CampaignError::NoStartInput`].
pub(super) fn require_start(cell: &Cell, options: &Options) -> Result<(), CampaignError> {
    let has_one = cell.inputs.iter().any(|input| input.purpose == InputUse::Start);
    if options.start == StartOn::Input && !has_one {
        return Err(CampaignError::NoStartInput { file: cell.file.display().to_string() });
    }
    Ok(())
}

fn is_on(cell: &Cell, input: &Input, words: &Words) -> bool {
    let axis = cell.axes.iter().position(|axis| axis.name == input.axis);
    let word = axis.and_then(|axis| words.get(axis).copied().flatten());
    word.is_some_and(|word| input.is_on(word))
}

/// Names an input and its wire.
pub(super) fn place(cell: &Cell, input: &Input) -> String {
    let node = cell.axes.iter().find(|axis| axis.name == input.axis).map_or(0, |axis| axis.node);
    format!("{} (bit {} of 0x60FD of axis {}, node {node})", input.name, input.bit, input.axis)
}

/// Returns the sentence for an open guard.
pub(super) fn open(cell: &Cell, input: &Input) -> String {
    format!("guard {} is open: close it, then start again", place(cell, input))
}

/// Returns the states of the drives as published.
pub(super) fn drives(cell: &Cell, states: &DriveStates) -> Vec<DriveState> {
    let of = |(axis, state): (&Axis, &Option<State>)| DriveState {
        axis: axis.name.clone(),
        state: state.map(|state| state.to_string()),
    };
    cell.axes.iter().zip(states).map(of).collect()
}

/// Returns the inputs as published.
pub(super) fn states(cell: &Cell, bits: InputBits) -> Vec<InputState> {
    let numbered = cell.inputs.iter().enumerate();
    numbered
        .map(|(number, input)| InputState {
            name: input.name.clone(),
            purpose: input.purpose.name().to_owned(),
            on: (bits.known >> number & 1 == 1).then_some(bits.on >> number & 1 == 1),
        })
        .collect()
}
