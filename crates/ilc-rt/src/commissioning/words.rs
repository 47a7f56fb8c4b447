//! Numbers of a drive in words: modes, inputs, warnings, a lost power stage.

use crate::fieldbus::cia402::{State, Statusword};

/// Modes of operation by their code, and their bit in object 0x6502, which is one less.
const MODES: [(i8, &str); 10] = [
    (1, "pp"),
    (2, "vl"),
    (3, "pv"),
    (4, "tq"),
    (6, "hm"),
    (7, "ip"),
    (8, "csp"),
    (9, "csv"),
    (10, "cst"),
    (11, "cstca"),
];

/// Inputs of object 0x60FD whose meaning CiA 402 fixes; those of the manufacturer begin at bit 16.
const INPUTS: [(u32, &str); 4] = [
    (0, "negative limit switch"),
    (1, "positive limit switch"),
    (2, "home switch"),
    (3, "interlock"),
];

/// Returns the name of a mode of operation, objects 0x6060 and 0x6061.
pub fn mode_name(code: i8) -> String {
    let found = MODES.iter().find(|(number, _)| *number == code);
    match (found, code) {
        (Some((_, name)), _) => (*name).to_owned(),
        (None, 0) => "none".to_owned(),
        (None, code) => format!("mode {code}"),
    }
}

/// Returns the names of the supported modes, object 0x6502.
pub fn mode_names(supported: u32) -> Vec<&'static str> {
    let has = |code: i8| u32::try_from(code - 1).is_ok_and(|bit| supported & (1 << bit) != 0);
    MODES.iter().filter(|(code, _)| has(*code)).map(|(_, name)| *name).collect()
}

/// Returns the active inputs in words, object 0x60FD.
pub fn input_names(inputs: u32) -> Vec<String> {
    (0..32)
        .filter(|bit| inputs & (1 << bit) != 0)
        .map(|bit| {
            let known = INPUTS.iter().find(|(number, _)| *number == bit);
            known.map_or_else(|| format!("input {bit}"), |(_, name)| (*name).to_owned())
        })
        .collect()
}

/// Returns the remarks of a statusword that are not its state.
pub fn warning_names(statusword: u16) -> Vec<&'static str> {
    let word = Statusword(statusword);
    let mut found = Vec::new();
    if word.has(Statusword::WARNING) {
        found.push("warning");
    }
    if word.has(Statusword::INTERNAL_LIMIT) {
        found.push("limit of the drive active");
    }
    if !word.has(Statusword::REMOTE) {
        found.push("under local control");
    }
    found
}

/// Returns whether a drive that had been enabled has lost its power stage without a fault, as an emergency stop or
/// STO takes it away.
pub fn power_lost(statusword: u16) -> bool {
    let word = Statusword(statusword);
    match word.state() {
        Some(State::SwitchOnDisabled) => true,
        Some(State::ReadyToSwitchOn | State::NotReadyToSwitchOn) => {
            !word.has(Statusword::VOLTAGE_ENABLED)
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_and_inputs_have_their_names() {
        assert_eq!(mode_names(0x3A5), ["pp", "pv", "hm", "csp", "csv", "cst"]);
        assert_eq!((mode_name(8).as_str(), mode_name(0).as_str()), ("csp", "none"));
        assert_eq!(mode_name(-3), "mode -3");
        assert_eq!(mode_names(0), [""; 0]);
        assert_eq!(input_names(0b101), ["negative limit switch", "home switch"]);
        assert_eq!(input_names(1 << 17), ["input 17"]);
    }

    #[test]
    fn a_lost_power_stage_is_no_fault() {
        assert!(power_lost(0x0240) && power_lost(0x0250) && power_lost(0x0221));
        assert!(!power_lost(0x0231) && !power_lost(0x0218) && !power_lost(0x0237));
    }
}
