//! Motion of an enabled drive: timing of targets, limits, stops.

use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::bring_up::{DriveSetup, bring_up};
use ilc_rt::fieldbus::canopen::NmtCommand;
use ilc_rt::fieldbus::cia402::{Controlword, Mode, State, Statusword};
use ilc_sim::ClockMode;

use crate::bench::{
    Bench, COUNTS_PER_M, CYCLE_US, DECELERATION_M_S2, START_M, VELOCITY_MAX_M_S, counts, node,
    setup,
};

/// Largest movement of the shaft in a cycle, in counts.
fn reach_counts() -> i32 {
    counts(VELOCITY_MAX_M_S * f64::from(CYCLE_US) * 1e-6) + 1
}

#[test]
fn enabling_holds_the_axis_where_it_is_whatever_the_old_target() {
    let mut bench = Bench::started(Mode::Csp);
    // Targets that arrive before the drive is enabled must be ignored.
    for _ in 0..3 {
        bench.cycle(Controlword::SHUTDOWN, 0);
    }
    bench.cycle(Controlword::SWITCH_ON, 0);
    bench.enable(counts(START_M));
    for _ in 0..20 {
        assert_eq!(bench.sync().position(), counts(START_M));
    }
}

#[test]
fn a_target_is_reached_two_syncs_after_the_one_it_answers() {
    let mut bench = Bench::enabled(Mode::Csp);
    let target = counts(START_M) - 300;
    // Taken over at this SYNC, interpolated over the following cycle, reached at the next.
    assert_eq!(bench.follow(target).position(), counts(START_M));
    let answer = bench.follow(target);
    assert_eq!(answer.position(), target);
    assert!(answer.status.unwrap().statusword.has(Statusword::FOLLOWS_TARGET));
    // The velocity of the last step shows that the motion was uniform, not a jump.
    let velocity = answer.extra.unwrap().velocity_counts_s;
    assert!((velocity + 300_000).abs() < 100, "{velocity}");
}

#[test]
fn a_far_target_is_a_limited_move_then_a_fault_never_a_jump() {
    let mut bench = Bench::enabled(Mode::Csp);
    let mut before = bench.follow(counts(START_M)).position();
    let mut codes = Vec::new();
    for _ in 0..100 {
        let answer = bench.follow(0);
        let moved = (answer.position() - before).abs();
        assert!(moved <= reach_counts(), "moved {moved} counts in one cycle");
        before = answer.position();
        codes.extend(answer.emergencies.iter().copied());
    }
    assert_eq!(codes, [0x8611]);
    assert_eq!(bench.follow(0).state(), State::Fault);
    assert!(before > counts(START_M - 0.02), "stopped at {before}");
}

#[test]
fn without_a_window_a_far_target_is_a_limited_move() {
    let mut bench = Bench::enabled(Mode::Csp);
    bench.write(0x6065, 0, &u32::MAX.to_le_bytes());
    let mut before = counts(START_M);
    let mut was_limited = false;
    for _ in 0..400 {
        let answer = bench.follow(0);
        assert!((answer.position() - before).abs() <= reach_counts());
        before = answer.position();
        was_limited |= answer.status.unwrap().statusword.has(Statusword::INTERNAL_LIMIT);
    }
    assert_eq!(before, 0);
    assert!(was_limited);
}

#[test]
fn position_limits_of_the_drive_hold() {
    let mut bench = Bench::enabled(Mode::Csp);
    bench.write(0x6065, 0, &u32::MAX.to_le_bytes());
    for _ in 0..200 {
        bench.follow(counts(0.5));
    }
    let answer = bench.follow(counts(0.5));
    assert_eq!(answer.position(), counts(0.10));
    assert!(answer.status.unwrap().statusword.has(Statusword::INTERNAL_LIMIT));
}

#[test]
fn velocity_mode_moves_at_the_velocity() {
    let mut bench = Bench::enabled(Mode::Csv);
    let start = bench.follow(-100_000).position();
    for _ in 0..50 {
        bench.follow(-100_000);
    }
    let moved = bench.follow(0).position() - start;
    assert!((moved + 5100).abs() <= 1, "moved {moved} counts at 100 counts a cycle");
    let at_rest = bench.follow(0).position();
    assert_eq!(bench.follow(0).position(), at_rest);
}

/// Brings drive 1 to a constant velocity and returns it, in counts per cycle.
fn moving() -> (Bench, i32, i32) {
    let mut bench = Bench::enabled(Mode::Csp);
    let mut target = counts(START_M);
    for _ in 0..50 {
        target -= 200;
        bench.follow(target);
    }
    (bench, target, 200)
}

#[test]
fn quick_stop_brakes_on_its_ramp_and_holds() {
    let (mut bench, target, per_cycle) = moving();
    let mut before = bench.cycle(Controlword::QUICK_STOP, target).position();
    let velocity_m_s = f64::from(per_cycle) / COUNTS_PER_M / (f64::from(CYCLE_US) * 1e-6);
    let change_counts = DECELERATION_M_S2 * (f64::from(CYCLE_US) * 1e-6).powi(2) * COUNTS_PER_M;
    let mut velocity = f64::from(per_cycle);
    let mut n_cycles = 0;
    loop {
        let answer = bench.cycle(Controlword::QUICK_STOP, target);
        assert_eq!(answer.state(), State::QuickStopActive);
        let now = f64::from(before - answer.position());
        assert!(velocity - now <= change_counts + 2.0, "from {velocity} to {now} counts a cycle");
        (before, velocity) = (answer.position(), now);
        n_cycles += 1;
        if now.abs() < 0.5 {
            break;
        }
        assert!(n_cycles < 100);
    }
    let expected = velocity_m_s / DECELERATION_M_S2 / (f64::from(CYCLE_US) * 1e-6);
    assert!((f64::from(n_cycles) - expected).abs() <= 2.0, "{n_cycles} cycles, not {expected}");
    for _ in 0..20 {
        let answer = bench.cycle(Controlword::QUICK_STOP, target);
        assert_eq!((answer.state(), answer.position()), (State::QuickStopActive, before));
    }
    // Transition 16: re-enabled at its current position.
    assert_eq!(bench.follow(before).state(), State::OperationEnabled);
    assert_eq!(bench.follow(before).position(), before);
}

#[test]
fn quick_stop_with_option_2_ends_switched_off() {
    let (mut bench, target, _) = moving();
    bench.write(0x605A, 0, &2_i16.to_le_bytes());
    let states: Vec<State> =
        (0..60).map(|_| bench.cycle(Controlword::QUICK_STOP, target).state()).collect();
    assert_eq!(states[0], State::QuickStopActive);
    assert_eq!(states[10], State::QuickStopActive);
    assert_eq!(states[59], State::SwitchOnDisabled);
}

#[test]
fn halt_brakes_and_its_end_does_not_jump_to_the_target() {
    let (mut bench, target, _) = moving();
    let halt = Controlword(Controlword::ENABLE_OPERATION.0 | Controlword::HALT);
    for _ in 0..60 {
        bench.cycle(halt, target);
    }
    let held = bench.cycle(halt, target);
    assert_eq!(held.state(), State::OperationEnabled);
    assert!(!held.status.unwrap().statusword.has(Statusword::FOLLOWS_TARGET));
    assert_eq!(bench.follow(held.position()).position(), held.position());
}

/// A drive with a command timeout, in lock-step, moving 200 counts per cycle.
fn moving_with_deadline() -> (Bench, i32) {
    let mut bench = Bench::new(ClockMode::LockStep);
    let with_deadline = DriveSetup { rpdo_deadline_ms: 20, ..setup(Mode::Csp) };
    bring_up(&mut bench.bus, &with_deadline).unwrap();
    bench.bus.send(&NmtCommand::Start.frame(Some(node(1)))).unwrap();
    bench.enable(counts(START_M));
    let mut target = counts(START_M);
    for _ in 0..50 {
        target -= 200;
        bench.follow(target);
    }
    (bench, target)
}

#[test]
fn one_lost_command_is_bridged() {
    let (mut bench, target) = moving_with_deadline();
    let places = [bench.sync(), bench.follow(target - 400), bench.follow(target - 600)]
        .map(|answer| answer.position());
    assert_eq!(places, [target, target - 200, target - 400]);
}

#[test]
fn a_silent_controller_makes_the_drive_stop_by_itself() {
    let (mut bench, target) = moving_with_deadline();
    let answers: Vec<_> = (0..80).map(|_| bench.sync()).collect();
    let codes: Vec<u16> = answers.iter().flat_map(|answer| answer.emergencies.clone()).collect();
    assert_eq!(codes, [0x8250]);
    let at_deadline = answers.iter().position(|answer| !answer.emergencies.is_empty()).unwrap();
    assert!((18..=22).contains(&at_deadline), "after {at_deadline} cycles");
    assert_eq!(answers[10].state(), State::OperationEnabled);
    assert_eq!(answers[79].state(), State::Fault);
    // Extrapolated for one cycle, then held: the drive does not run on.
    assert_eq!(answers[79].position(), target - 200);
    assert_eq!(bench.read(0x603F, 0), 0x8250);
}

#[test]
fn a_silent_controller_in_velocity_mode_ends_in_a_ramp() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let with_deadline = DriveSetup { rpdo_deadline_ms: 20, ..setup(Mode::Csv) };
    bring_up(&mut bench.bus, &with_deadline).unwrap();
    bench.bus.send(&NmtCommand::Start.frame(Some(node(1)))).unwrap();
    bench.enable(0);
    for _ in 0..10 {
        bench.follow(-200_000);
    }
    let answers: Vec<_> = (0..80).map(|_| bench.sync()).collect();
    let states: Vec<State> = answers.iter().map(super::bench::Answer::state).collect();
    let reaction = states.iter().filter(|s| **s == State::FaultReactionActive).count();
    // 0.2 m/s at 10 m/s² is 20 ms.
    assert!((18..=22).contains(&reaction), "a ramp of {reaction} cycles");
    assert_eq!(states[79], State::Fault);
    assert_eq!(answers[79].position(), answers[60].position());
}

#[test]
fn a_silent_controller_is_survived_whatever_an_earlier_master_left() {
    // Each of these alone would let the axis run on, or coast.
    let left: [(u16, &[u8]); 6] = [
        (0x6085, &1_u32.to_le_bytes()),
        (0x6084, &1_u32.to_le_bytes()),
        (0x60C6, &1_u32.to_le_bytes()),
        (0x605E, &0_i16.to_le_bytes()),
        (0x6007, &0_i16.to_le_bytes()),
        (0x605A, &0_i16.to_le_bytes()),
    ];
    for (index, bytes) in left {
        let mut bench = Bench::new(ClockMode::LockStep);
        bench.write(index, 0, bytes);
        let with_deadline = DriveSetup { rpdo_deadline_ms: 20, ..setup(Mode::Csv) };
        bring_up(&mut bench.bus, &with_deadline).unwrap();
        bench.bus.send(&NmtCommand::Start.frame(Some(node(1)))).unwrap();
        bench.enable(0);
        for _ in 0..10 {
            bench.follow(-200_000);
        }
        let answers: Vec<_> = (0..80).map(|_| bench.sync()).collect();
        let way = answers[0].position() - answers[79].position();
        // 20 ms at 0.2 m/s and a ramp of 2 mm; a cycle or two of latency.
        assert!((5_000..7_000).contains(&way), "0x{index:04X}: {way} counts");
        assert_eq!(answers[79].position(), answers[60].position(), "0x{index:04X}");
        let ramps = answers.iter().any(|answer| answer.state() == State::FaultReactionActive);
        assert!(ramps, "0x{index:04X}: no ramp");
    }
}

#[test]
fn a_drive_left_under_power_is_brought_to_rest_before_anything_is_set() {
    let mut bench = Bench::enabled(Mode::Csv);
    // A reset leaves it alone: the previous master wanted it so.
    bench.write(0x6007, 0, &0_i16.to_le_bytes());
    bench.write(0x6085, 0, &1_u32.to_le_bytes());
    for _ in 0..5 {
        bench.follow(-200_000);
    }
    bring_up(&mut bench.bus, &setup(Mode::Csp)).unwrap();
    assert_eq!(bench.bus.responder().drive_state(node(1)), Some(State::SwitchOnDisabled));
    assert_eq!(bench.read(0x6085, 0), 10_000_000);
}

#[test]
fn option_codes_have_their_ramps() {
    // 0.2 m/s: at 10 m/s2 at rest after 20 ms, at 2 m/s2 after 100 ms.
    for (option, n_cycles, ends_in) in [
        (0, 0_usize, State::SwitchOnDisabled),
        (1, 100, State::SwitchOnDisabled),
        (2, 20, State::SwitchOnDisabled),
        (5, 100, State::QuickStopActive),
        (6, 20, State::QuickStopActive),
    ] {
        let mut bench = Bench::enabled(Mode::Csv);
        bench.write(0x605A, 0, &i16::to_le_bytes(option));
        bench.write(0x6084, 0, &2_000_000_u32.to_le_bytes());
        for _ in 0..10 {
            bench.follow(-200_000);
        }
        let answers: Vec<_> =
            (0..150).map(|_| bench.cycle(Controlword::QUICK_STOP, -200_000)).collect();
        let moving = answers.windows(2).filter(|two| two[0].position() != two[1].position());
        let n_moving = moving.count();
        let allowed = n_cycles.saturating_sub(2)..=n_cycles + 2;
        assert!(allowed.contains(&n_moving), "605A = {option}: {n_moving} cycles");
        assert_eq!(answers[149].state(), ends_in, "605A = {option}");
    }
}
