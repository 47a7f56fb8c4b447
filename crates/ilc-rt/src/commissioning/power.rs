//! Power of a single drive over SDO: switched off, or its fault reset. Nothing here switches power on.

use std::time::{Duration, Instant};

use super::error::CommissioningError;
use super::faults::{find, low_word};
use crate::fieldbus::Bus;
use crate::fieldbus::bring_up::SdoClient;
use crate::fieldbus::cia402::{Controlword, State, Statusword, objects};

/// Time for a quick stop to bring an axis to rest.
const REST: Duration = Duration::from_secs(2);
/// Time for the other transitions.
const TRANSITION: Duration = Duration::from_secs(1);
/// Polling period of the state.
const ASK_EVERY: Duration = Duration::from_millis(5);

/// Disables a drive: a quick stop with the drive's own ramp if it may be moving, then voltage off. Returns whether it
/// had been switched on.
///
/// # Errors
/// [`CommissioningError::State`] if it stays on.
pub fn disable(bus: &mut dyn Bus, client: &SdoClient) -> Result<bool, CommissioningError> {
    let before = state(bus, client)?;
    if is_off(Statusword(before).state()) {
        return Ok(false);
    }
    let may_move = [State::OperationEnabled, State::QuickStopActive, State::FaultReactionActive];
    if Statusword(before).state().is_none_or(|state| may_move.contains(&state)) {
        command(bus, client, Controlword::QUICK_STOP)?;
        // A drive may hold after its ramp, and stays in this state then: at rest by the time that is over.
        wait(bus, client, REST, is_off)?;
    }
    command(bus, client, Controlword::DISABLE_VOLTAGE)?;
    let statusword = wait(bus, client, TRANSITION, is_off)?;
    if is_off(Statusword(statusword).state()) {
        return Ok(true);
    }
    Err(CommissioningError::State {
        node: client.node(),
        what: "it does not switch off",
        statusword,
    })
}

/// Resets the fault of a drive by a rising edge of bit 7; leaves it switched off.
///
/// # Errors
/// [`CommissioningError::State`] if the fault stays.
pub fn reset(bus: &mut dyn Bus, client: &SdoClient) -> Result<(), CommissioningError> {
    let is_over = |state: Option<State>| {
        !matches!(state, Some(State::Fault | State::FaultReactionActive) | None)
    };
    command(bus, client, Controlword::DISABLE_VOLTAGE)?;
    // The drive's own reaction to the fault comes first.
    wait(bus, client, REST, |state| state != Some(State::FaultReactionActive))?;
    command(bus, client, Controlword::FAULT_RESET)?;
    let statusword = wait(bus, client, TRANSITION, is_over)?;
    command(bus, client, Controlword::DISABLE_VOLTAGE)?;
    if is_over(Statusword(statusword).state()) {
        return Ok(());
    }
    let what = "the fault stays after a reset; its cause is still there";
    Err(CommissioningError::State { node: client.node(), what, statusword })
}

fn is_off(state: Option<State>) -> bool {
    matches!(
        state,
        Some(
            State::NotReadyToSwitchOn
                | State::SwitchOnDisabled
                | State::ReadyToSwitchOn
                | State::Fault
        )
    )
}

fn state(bus: &mut dyn Bus, client: &SdoClient) -> Result<u16, CommissioningError> {
    let found = find(bus, client, objects::STATUSWORD, 0)?;
    found.map(low_word).ok_or(CommissioningError::NoDrive { node: client.node() })
}

fn command(
    bus: &mut dyn Bus,
    client: &SdoClient,
    word: Controlword,
) -> Result<(), CommissioningError> {
    Ok(client.download(bus, objects::CONTROLWORD, 0, &word.0.to_le_bytes())?)
}

/// Waits for a state, and returns the last statusword.
fn wait(
    bus: &mut dyn Bus,
    client: &SdoClient,
    span: Duration,
    is_there: impl Fn(Option<State>) -> bool,
) -> Result<u16, CommissioningError> {
    let deadline = Instant::now() + span;
    loop {
        let word = state(bus, client)?;
        if is_there(Statusword(word).state()) || Instant::now() >= deadline {
            return Ok(word);
        }
        std::thread::sleep(ASK_EVERY);
    }
}
