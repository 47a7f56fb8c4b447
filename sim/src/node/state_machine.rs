//! The CiA 402 state machine of a drive: controlword in, state out.

use ilc_rt::fieldbus::cia402::State;

/// Bit 0: switch on.
const SWITCH_ON: u16 = 1 << 0;
/// Bit 1: enable voltage.
const ENABLE_VOLTAGE: u16 = 1 << 1;
/// Bit 2: quick stop when clear.
const QUICK_STOP: u16 = 1 << 2;
/// Bit 3: enable operation.
const ENABLE_OPERATION: u16 = 1 << 3;
/// Bit 7: fault reset, on its rising edge.
const FAULT_RESET: u16 = 1 << 7;

/// Demand of a controlword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Request {
    DisableVoltage,
    QuickStop,
    Shutdown,
    SwitchOn,
    EnableOperation,
    FaultReset,
}

impl Request {
    fn decode(controlword: u16) -> Self {
        let has = |bits| controlword & bits == bits;
        if has(FAULT_RESET) {
            Self::FaultReset
        } else if !has(ENABLE_VOLTAGE) {
            Self::DisableVoltage
        } else if !has(QUICK_STOP) {
            Self::QuickStop
        } else if !has(SWITCH_ON) {
            Self::Shutdown
        } else if !has(ENABLE_OPERATION) {
            Self::SwitchOn
        } else {
            Self::EnableOperation
        }
    }
}

/// State of a drive, with the memory of the reset's edge.
#[derive(Clone, Copy, Debug)]
pub struct StateMachine {
    state: State,
    previous: u16,
}

impl Default for StateMachine {
    /// As after power-on.
    fn default() -> Self {
        Self { state: State::NotReadyToSwitchOn, previous: 0 }
    }
}

impl StateMachine {
    /// Returns the state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Transitions 0 and 1: the self-test is done.
    pub fn initialised(&mut self) {
        if self.state == State::NotReadyToSwitchOn {
            self.state = State::SwitchOnDisabled;
        }
    }

    /// Evaluates a controlword, even if equal to the last: masters repeat it.
    ///
    /// One transition per evaluation, except that "enable operation" takes both steps (3 and 4)
    /// from ready to switch on. Bit 7 counts on its rising edge and in [`State::Fault`] only.
    pub fn command(&mut self, controlword: u16) -> State {
        let rises = controlword & FAULT_RESET & !self.previous != 0;
        self.previous = controlword;
        self.state = next(self.state, Request::decode(controlword), rises);
        self.state
    }

    /// Transition 13, followed by 14 if nothing moves: the drive has a fault.
    pub fn fault(&mut self) {
        self.state = match self.state {
            State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive => {
                State::FaultReactionActive
            }
            State::NotReadyToSwitchOn
            | State::SwitchOnDisabled
            | State::ReadyToSwitchOn
            | State::SwitchedOn
            | State::Fault => State::Fault,
        };
    }

    /// Transition 14: the fault reaction is over.
    pub fn fault_reaction_done(&mut self) {
        if self.state == State::FaultReactionActive {
            self.state = State::Fault;
        }
    }

    /// Automatic transition 12: a quick stop that does not hold is over.
    pub fn quick_stop_done(&mut self) {
        if self.state == State::QuickStopActive {
            self.state = State::SwitchOnDisabled;
        }
    }
}

fn next(state: State, request: Request, reset_rises: bool) -> State {
    match (state, request) {
        (State::Fault, Request::FaultReset) if reset_rises => State::SwitchOnDisabled,
        (
            State::ReadyToSwitchOn
            | State::SwitchedOn
            | State::OperationEnabled
            | State::QuickStopActive,
            Request::DisableVoltage,
        )
        | (State::ReadyToSwitchOn | State::SwitchedOn, Request::QuickStop) => {
            State::SwitchOnDisabled
        }
        (State::OperationEnabled, Request::QuickStop) => State::QuickStopActive,
        (
            State::SwitchOnDisabled | State::SwitchedOn | State::OperationEnabled,
            Request::Shutdown,
        ) => State::ReadyToSwitchOn,
        (State::ReadyToSwitchOn | State::OperationEnabled, Request::SwitchOn) => State::SwitchedOn,
        (
            State::ReadyToSwitchOn | State::SwitchedOn | State::QuickStopActive,
            Request::EnableOperation,
        ) => State::OperationEnabled,
        (state, _) => state,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// For each state, the state that follows each of: disable voltage, quick stop, shutdown,
    /// switch on, enable operation, rising fault reset.
    #[test]
    fn every_transition_is_the_profiles() {
        use State::{
            Fault, FaultReactionActive as Reaction, NotReadyToSwitchOn as NotReady,
            OperationEnabled as Enabled, QuickStopActive as QuickStop, ReadyToSwitchOn as Ready,
            SwitchOnDisabled as Disabled, SwitchedOn as On,
        };
        let words = [0x00, 0x02, 0x06, 0x07, 0x0F, 0x80];
        let table = [
            (NotReady, [NotReady, NotReady, NotReady, NotReady, NotReady, NotReady]),
            (Disabled, [Disabled, Disabled, Ready, Disabled, Disabled, Disabled]),
            (Ready, [Disabled, Disabled, Ready, On, Enabled, Ready]),
            (On, [Disabled, Disabled, Ready, On, Enabled, On]),
            (Enabled, [Disabled, QuickStop, Ready, On, Enabled, Enabled]),
            (QuickStop, [Disabled, QuickStop, QuickStop, QuickStop, Enabled, QuickStop]),
            (Reaction, [Reaction, Reaction, Reaction, Reaction, Reaction, Reaction]),
            (Fault, [Fault, Fault, Fault, Fault, Fault, Disabled]),
        ];
        for (state, followers) in table {
            for (word, follower) in words.into_iter().zip(followers) {
                let mut machine = StateMachine { state, previous: 0 };
                assert_eq!(machine.command(word), follower, "{state} under 0x{word:02X}");
            }
        }
    }

    /// Mask and value of a controlword, and its transitions.
    type Command = (u16, u16, &'static [(State, State)]);

    /// The commands of the profile.
    const COMMANDS: [Command; 6] = {
        use State::{
            OperationEnabled as Enabled, QuickStopActive as QuickStop, ReadyToSwitchOn as Ready,
            SwitchOnDisabled as Disabled, SwitchedOn as On,
        };
        [
            (0x87, 0x06, &[(Disabled, Ready), (On, Ready), (Enabled, Ready)]),
            (0x8F, 0x07, &[(Ready, On), (Enabled, On)]),
            (0x8F, 0x0F, &[(Ready, Enabled), (On, Enabled), (QuickStop, Enabled)]),
            (
                0x82,
                0x00,
                &[(Ready, Disabled), (On, Disabled), (Enabled, Disabled), (QuickStop, Disabled)],
            ),
            (0x86, 0x02, &[(Ready, Disabled), (On, Disabled), (Enabled, QuickStop)]),
            (0x80, 0x80, &[]),
        ]
    };

    #[derive(Clone, Copy, Debug)]
    enum Happening {
        Word(u16),
        Fault,
        ReactionDone,
        StopDone,
    }

    /// Returns what the tables of the profile say.
    fn expected(state: State, previous: u16, happening: Happening) -> State {
        use State::{
            Fault, FaultReactionActive, OperationEnabled, QuickStopActive, SwitchOnDisabled,
        };
        match (happening, state) {
            (Happening::Word(word), Fault) => {
                if word & !previous & 0x80 == 0 {
                    Fault
                } else {
                    SwitchOnDisabled
                }
            }
            (Happening::Word(word), _) => COMMANDS
                .iter()
                .find(|(mask, value, _)| word & mask == *value)
                .and_then(|(_, _, moves)| moves.iter().find(|(from, _)| *from == state))
                .map_or(state, |(_, to)| *to),
            (Happening::Fault, OperationEnabled | QuickStopActive | FaultReactionActive) => {
                FaultReactionActive
            }
            (Happening::Fault, _) | (Happening::ReactionDone, FaultReactionActive) => Fault,
            (Happening::StopDone, QuickStopActive) => SwitchOnDisabled,
            (Happening::ReactionDone | Happening::StopDone, _) => state,
        }
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn any_sequence_of_events_follows_the_tables(
            happenings in prop::collection::vec(
                prop_oneof![
                    4 => prop_oneof![
                        Just(0x06_u16), Just(0x07), Just(0x0F), Just(0x02), Just(0x00), Just(0x80),
                        any::<u16>(),
                    ].prop_map(Happening::Word),
                    1 => Just(Happening::Fault),
                    1 => Just(Happening::ReactionDone),
                    1 => Just(Happening::StopDone),
                ],
                1..60,
            )
        ) {
            let mut machine = StateMachine::default();
            machine.initialised();
            let (mut state, mut previous) = (State::SwitchOnDisabled, 0);
            for happening in happenings {
                state = expected(state, previous, happening);
                match happening {
                    Happening::Word(word) => {
                        machine.command(word);
                        previous = word;
                    }
                    Happening::Fault => machine.fault(),
                    Happening::ReactionDone => machine.fault_reaction_done(),
                    Happening::StopDone => machine.quick_stop_done(),
                }
                prop_assert_eq!(machine.state(), state, "after {:?}", happening);
            }
        }
    }

    #[test]
    fn only_a_rising_edge_resets_a_fault() {
        let mut machine = StateMachine { state: State::Fault, previous: 0x80 };
        assert_eq!(machine.command(0x80), State::Fault);
        assert_eq!(machine.command(0x00), State::Fault);
        assert_eq!(machine.command(0x80), State::SwitchOnDisabled);
    }

    #[test]
    fn faults_react_where_something_moves() {
        for state in State::ALL {
            let mut machine = StateMachine { state, previous: 0 };
            machine.fault();
            let reacts = matches!(
                state,
                State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive
            );
            let expected = if reacts { State::FaultReactionActive } else { State::Fault };
            assert_eq!(machine.state(), expected, "{state}");
            machine.fault_reaction_done();
            assert_eq!(machine.state(), State::Fault);
        }
    }
}
