//! Faults of a drive, named before they are reset: its error code and the history of its emergencies.

use serde::Serialize;

use super::error::CommissioningError;
use crate::fieldbus::Bus;
use crate::fieldbus::bring_up::{SdoClient, SdoError};
use crate::fieldbus::canopen::emcy;
use crate::fieldbus::cia402::{State, Statusword, objects};

/// Largest number of entries read from an error history.
const HISTORY_MAX: u32 = 16;

/// Faults of a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Faults {
    /// Statusword, object 0x6041.
    pub statusword: u16,
    /// Error code, object 0x603F; 0 without an error.
    pub code: u16,
    /// Emergency codes, object 0x1003, newest first.
    pub history: Vec<u16>,
}

impl Faults {
    /// Returns whether the drive is in fault, or reacting to one.
    pub fn in_fault(&self) -> bool {
        let state = Statusword(self.statusword).state();
        matches!(state, Some(State::Fault | State::FaultReactionActive))
    }

    /// Returns code and meaning of the fault and, if it has no code, the newest of the history.
    pub fn sentence(&self) -> String {
        let code = if self.code == 0 { self.history.first().copied() } else { Some(self.code) };
        let Some(code) = code else { return "no error code says why".to_owned() };
        let mut text = reported(code);
        let earlier: Vec<String> =
            self.history.iter().filter(|each| **each != code).map(|each| reported(*each)).collect();
        if !earlier.is_empty() {
            text = format!("{text}; before: {}", earlier.join(", "));
        }
        text
    }
}

/// Returns an error code with its meaning.
pub fn reported(code: u16) -> String {
    format!("0x{code:04X} {}", emcy::meaning(code))
}

/// Reads state, error code and history of a drive.
///
/// # Errors
/// [`CommissioningError`] of the transfer; [`CommissioningError::NoDrive`] without a statusword.
pub fn faults(bus: &mut dyn Bus, client: &SdoClient) -> Result<Faults, CommissioningError> {
    let Some(statusword) = find(bus, client, objects::STATUSWORD, 0)? else {
        return Err(CommissioningError::NoDrive { node: client.node() });
    };
    let code = find(bus, client, objects::ERROR_CODE, 0)?.unwrap_or(0);
    let n_entries = find(bus, client, objects::ERROR_HISTORY, 0)?.unwrap_or(0).min(HISTORY_MAX);
    let mut history = Vec::new();
    for sub in 1..=n_entries {
        let sub = u8::try_from(sub).unwrap_or(u8::MAX);
        if let Some(entry) = find(bus, client, objects::ERROR_HISTORY, sub)? {
            history.push(low_word(entry));
        }
    }
    Ok(Faults { statusword: low_word(statusword), code: low_word(code), history })
}

/// Reads an object that may be missing.
pub(super) fn find(
    bus: &mut dyn Bus,
    client: &SdoClient,
    index: u16,
    sub: u8,
) -> Result<Option<u32>, CommissioningError> {
    match client.upload_u32(bus, index, sub) {
        Ok(value) => Ok(Some(value)),
        Err(SdoError::Aborted { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Returns the low 16 bits.
pub(super) fn low_word(value: u32) -> u16 {
    let [low, high, ..] = value.to_le_bytes();
    u16::from_le_bytes([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_told_with_what_came_before() {
        let found = Faults { statusword: 0x0218, code: 0x8611, history: vec![0x8611, 0x8130] };
        assert!(found.in_fault());
        let text = found.sentence();
        assert!(text.starts_with("0x8611 ") && text.contains("; before: 0x8130 "), "{text}");
        let silent = Faults { statusword: 0x0250, code: 0, history: Vec::new() };
        assert!(!silent.in_fault());
        assert_eq!(silent.sentence(), "no error code says why");
    }
}
