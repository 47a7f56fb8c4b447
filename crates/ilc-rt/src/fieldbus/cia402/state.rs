//! The CiA 402 state machine as the controller sees it: statusword in, controlword out.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// A statusword, object 0x6041.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Statusword(pub u16);

/// A controlword, object 0x6040.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Controlword(pub u16);

/// The state of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Starting up; left automatically.
    NotReadyToSwitchOn,
    /// Switch-on disabled: idle, without power.
    SwitchOnDisabled,
    /// Ready to switch on: power may be applied.
    ReadyToSwitchOn,
    /// Switched on: power applied, no motion.
    SwitchedOn,
    /// Operation enabled: follows targets.
    OperationEnabled,
    /// Stopping, or stopped and held, after a quick stop.
    QuickStopActive,
    /// Stopping after a fault; left automatically.
    FaultReactionActive,
    /// Faulted, without power; left by a fault reset only.
    Fault,
}

impl State {
    /// All states.
    pub const ALL: [Self; 8] = [
        Self::NotReadyToSwitchOn,
        Self::SwitchOnDisabled,
        Self::ReadyToSwitchOn,
        Self::SwitchedOn,
        Self::OperationEnabled,
        Self::QuickStopActive,
        Self::FaultReactionActive,
        Self::Fault,
    ];

    /// The bits of the statusword that this state fixes, as `(mask, value)`.
    ///
    /// # Source
    /// CiA 402-2, statusword: state coding.
    pub const fn coding(self) -> (u16, u16) {
        match self {
            Self::NotReadyToSwitchOn => (0x4F, 0x00),
            Self::SwitchOnDisabled => (0x4F, 0x40),
            Self::ReadyToSwitchOn => (0x6F, 0x21),
            Self::SwitchedOn => (0x6F, 0x23),
            Self::OperationEnabled => (0x6F, 0x27),
            Self::QuickStopActive => (0x6F, 0x07),
            Self::FaultReactionActive => (0x4F, 0x0F),
            Self::Fault => (0x4F, 0x08),
        }
    }
}

impl std::fmt::Display for State {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NotReadyToSwitchOn => "not ready to switch on",
            Self::SwitchOnDisabled => "switch on disabled",
            Self::ReadyToSwitchOn => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::OperationEnabled => "operation enabled",
            Self::QuickStopActive => "quick stop active",
            Self::FaultReactionActive => "fault reaction active",
            Self::Fault => "fault",
        })
    }
}

impl Statusword {
    /// Bit 4: the power stage has voltage.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// Bit 7: warning.
    pub const WARNING: u16 = 1 << 7;
    /// Bit 9: the drive obeys the controlword.
    pub const REMOTE: u16 = 1 << 9;
    /// Bit 11: a limit of the drive is active.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// Bit 12 in cyclic modes: the drive follows the target.
    pub const FOLLOWS_TARGET: u16 = 1 << 12;
    /// Bit 10 in homing mode: the axis is at rest.
    pub const TARGET_REACHED: u16 = 1 << 10;
    /// Bit 12 in homing mode: home was found.
    pub const HOMING_ATTAINED: u16 = 1 << 12;
    /// Bit 13 in homing mode: home could not be found.
    pub const HOMING_ERROR: u16 = 1 << 13;
    /// Bit 13 in CSP: following error.
    pub const FOLLOWING_ERROR: u16 = 1 << 13;

    /// Returns the state, or `None` for an undefined combination of bits.
    pub fn state(self) -> Option<State> {
        State::ALL.into_iter().find(|state| {
            let (mask, value) = state.coding();
            self.0 & mask == value
        })
    }

    /// Returns whether all bits of `bits` are set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }
}

impl Controlword {
    /// Power off: to switch-on disabled (transitions 7, 9, 10, 12).
    pub const DISABLE_VOLTAGE: Self = Self(0x0000);
    /// To ready to switch on (transitions 2, 6, 8).
    pub const SHUTDOWN: Self = Self(0x0006);
    /// To switched on (transition 3); from operation enabled it disables operation (5).
    pub const SWITCH_ON: Self = Self(0x0007);
    /// To operation enabled (transitions 4, 16).
    pub const ENABLE_OPERATION: Self = Self(0x000F);
    /// Quick stop (transition 11; 7 and 10 if not enabled).
    pub const QUICK_STOP: Self = Self(0x0002);
    /// Fault reset, bit 7: works on its rising edge only (transition 15).
    pub const FAULT_RESET: Self = Self(0x0080);
    /// Bit 8: halt.
    pub const HALT: u16 = 1 << 8;

    /// Returns the command that resets a fault, given the previous controlword: bit 7 must rise, so
    /// it is lowered for one command if it is set.
    ///
    /// Sent every cycle until the drive leaves [`State::Fault`], it retries every second cycle.
    pub const fn fault_reset_after(previous: Self) -> Self {
        if previous.0 & Self::FAULT_RESET.0 == 0 {
            Self::FAULT_RESET
        } else {
            Self::DISABLE_VOLTAGE
        }
    }
}

/// Returns the command that takes a drive in `state` one step nearer to operation enabled.
///
/// A fault is not reset on the way, since no person has examined it: in [`State::Fault`] the
/// command is [`Controlword::DISABLE_VOLTAGE`], which also arms the edge of
/// [`Controlword::fault_reset_after`]. A quick stop is left through switch-on disabled.
pub const fn next_command(state: State) -> Controlword {
    match state {
        State::SwitchOnDisabled => Controlword::SHUTDOWN,
        State::ReadyToSwitchOn => Controlword::SWITCH_ON,
        State::SwitchedOn | State::OperationEnabled => Controlword::ENABLE_OPERATION,
        State::NotReadyToSwitchOn
        | State::QuickStopActive
        | State::FaultReactionActive
        | State::Fault => Controlword::DISABLE_VOLTAGE,
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::*;

    #[test]
    fn statuswords_seen_on_drives_decode() {
        let table = [
            (0x0250, State::SwitchOnDisabled),
            (0x0231, State::ReadyToSwitchOn),
            (0x0233, State::SwitchedOn),
            (0x1637, State::OperationEnabled),
            (0x0217, State::QuickStopActive),
            (0x021F, State::FaultReactionActive),
            (0x0218, State::Fault),
            (0x2238, State::Fault),
            (0x0000, State::NotReadyToSwitchOn),
        ];
        for (word, state) in table {
            assert_eq!(Statusword(word).state(), Some(state), "0x{word:04X}");
        }
    }

    #[test]
    fn each_statusword_has_at_most_one_state() {
        for word in 0..=u16::MAX {
            let matching = State::ALL.iter().filter(|state| {
                let (mask, value) = state.coding();
                word & mask == value
            });
            assert!(matching.count() <= 1, "0x{word:04X}");
        }
        assert_eq!(Statusword(0x000A).state(), None);
    }

    #[test]
    fn commands_walk_up_and_leave_faults_alone() {
        assert_eq!(next_command(State::SwitchOnDisabled), Controlword(0x06));
        assert_eq!(next_command(State::ReadyToSwitchOn), Controlword(0x07));
        assert_eq!(next_command(State::SwitchedOn), Controlword(0x0F));
        assert_eq!(next_command(State::OperationEnabled), Controlword(0x0F));
        assert_eq!(next_command(State::Fault), Controlword(0x00));
    }

    #[test]
    fn fault_reset_has_an_edge_every_second_command() {
        let mut word = Controlword::ENABLE_OPERATION;
        let mut edges = 0;
        for _ in 0..10 {
            let next = Controlword::fault_reset_after(word);
            edges += u32::from(word.0 & 0x80 == 0 && next.0 & 0x80 != 0);
            word = next;
        }
        assert_eq!(edges, 5);
    }
}
