//! The drive's own motion: profile position and profile velocity.

use ilc_rt::fieldbus::cia402::{Controlword, Mode, State};

use crate::bench::{Answer, Bench, COUNTS_PER_M, START_M, counts};

const ENABLED: u16 = Controlword::ENABLE_OPERATION.0;
const NEW_SET_POINT: u16 = ENABLED | 1 << 4;
const IMMEDIATE: u16 = 1 << 5;
const RELATIVE: u16 = 1 << 6;
const HALT: u16 = 1 << 8;
const BLEND: u16 = 1 << 9;
const REACHED: u16 = 1 << 10;
const LIMITED: u16 = 1 << 11;
const BIT_12: u16 = 1 << 12;

fn word(answer: &Answer) -> u16 {
    answer.status.expect("a status every cycle").statusword.0
}

/// An enabled drive in a mode of its own, with profiles of 0.1 m/s and 2 m/s2.
fn in_mode(code: u8) -> Bench {
    let mut bench = Bench::enabled(Mode::Csp);
    bench.write(0x6081, 0, &100_000_u32.to_le_bytes());
    for index in [0x6083, 0x6084] {
        bench.write(index, 0, &2_000_000_u32.to_le_bytes());
    }
    bench.write(0x6060, 0, &[code]);
    assert_eq!(bench.read(0x6061, 0), u32::from(code));
    bench
}

fn run(bench: &mut Bench, controlword: u16, target: i32, n_cycles: usize) -> Vec<Answer> {
    (0..n_cycles).map(|_| bench.cycle(Controlword(controlword), target)).collect()
}

#[test]
fn a_set_point_is_acknowledged_reached_and_told() {
    let mut bench = in_mode(1);
    let target = counts(START_M) - 20_000;
    let idle = run(&mut bench, ENABLED, target, 20);
    assert_eq!(idle[19].position(), counts(START_M), "a target alone moves nothing");
    let taken = bench.cycle(Controlword(NEW_SET_POINT), target);
    assert_eq!(word(&taken) & (BIT_12 | REACHED), BIT_12, "taken, and no longer reached");
    let ended = bench.cycle(Controlword(ENABLED), target);
    assert_eq!(word(&ended) & (BIT_12 | REACHED), 0);
    let moved = run(&mut bench, ENABLED, 0, 400);
    // 20 mm at 0.1 m/s, and a ramp of 50 ms at each end.
    let arrival = moved.iter().position(|answer| word(answer) & REACHED != 0).unwrap();
    assert!((245..265).contains(&arrival), "{arrival} cycles");
    assert_eq!(moved[399].position(), target);
    let steps = moved.windows(2).map(|two| two[1].position() - two[0].position());
    assert!(steps.clone().all(|step| (-101..=0).contains(&step)), "faster than 0x6081");
    let changes: Vec<i32> = steps.collect();
    assert!(changes.windows(2).all(|two| (two[1] - two[0]).abs() <= 3), "beyond 2 m/s2");
}

#[test]
fn set_points_queue_follow_at_once_or_add_up() {
    let start = counts(START_M);
    for (bits, second, expected, must_pass) in [
        (0, start - 5_000, start - 5_000, true),
        (IMMEDIATE, start - 5_000, start - 5_000, false),
        (RELATIVE, 3_000, start - 7_000, true),
    ] {
        let mut bench = in_mode(1);
        let first = start - 10_000;
        bench.cycle(Controlword(NEW_SET_POINT), first);
        let begun = run(&mut bench, ENABLED, first, 30);
        assert!(begun[29].position() > start - 5_000, "still on its way");
        let taken = bench.cycle(Controlword(NEW_SET_POINT | bits), second);
        assert_eq!(word(&taken) & BIT_12, BIT_12);
        // A queued one leaves no room until the first is reached.
        let waiting = bench.cycle(Controlword(ENABLED), second);
        assert_eq!(word(&waiting) & BIT_12 != 0, bits & IMMEDIATE == 0, "bits {bits:#x}");
        let rest = run(&mut bench, ENABLED, second, 500);
        let lowest = rest.iter().map(Answer::position).min().unwrap();
        assert_eq!(lowest <= first, must_pass, "bits {bits:#x}: down to {lowest}");
        assert_eq!(rest[499].position(), expected, "bits {bits:#x}");
        assert_eq!(word(&rest[499]) & (REACHED | BIT_12), REACHED);
    }
}

#[test]
fn a_change_on_set_point_passes_the_first_one_without_a_stop() {
    let start = counts(START_M);
    let first = start - 10_000;
    // Beyond the first: at its velocity. So near that it must slow down. Back: a stop between.
    for (second, slowest) in [(start - 30_000, 95), (start - 10_300, 20), (start - 2_000, 0)] {
        let mut bench = in_mode(1);
        bench.cycle(Controlword(NEW_SET_POINT), first);
        run(&mut bench, ENABLED, first, 30);
        bench.cycle(Controlword(NEW_SET_POINT | BLEND), second);
        let waiting = bench.cycle(Controlword(ENABLED | BLEND), second);
        assert_eq!(word(&waiting) & BIT_12, BIT_12, "no room until the first is passed");
        let rest = run(&mut bench, ENABLED, second, 600);
        assert_eq!(rest[599].position(), second);
        assert_eq!(word(&rest[599]) & (REACHED | BIT_12), REACHED);
        let passed = rest.windows(2).find(|two| two[1].position() <= first).unwrap();
        let step = passed[0].position() - passed[1].position();
        assert!(step >= slowest && (slowest > 0 || step < 20), "{second}: {step} counts a cycle");
        let lowest = rest.iter().map(Answer::position).min().unwrap();
        assert_eq!(lowest, first.min(second), "no overshoot");
        let steps = rest.windows(2).map(|two| two[1].position() - two[0].position());
        let changes: Vec<i32> = steps.collect();
        assert!(changes.windows(2).all(|two| (two[1] - two[0]).abs() <= 3), "beyond 2 m/s2");
    }
}

#[test]
fn a_halt_between_blended_set_points_goes_on_through_them() {
    let mut bench = in_mode(1);
    let start = counts(START_M);
    bench.cycle(Controlword(NEW_SET_POINT), start - 10_000);
    run(&mut bench, ENABLED, 0, 30);
    bench.cycle(Controlword(NEW_SET_POINT | BLEND), start - 30_000);
    let halted = run(&mut bench, ENABLED | HALT, 0, 100);
    assert_eq!(halted[99].position(), halted[60].position());
    assert!(halted[99].position() > start - 10_000, "before the first");
    let rest = run(&mut bench, ENABLED, 0, 600);
    let passed = rest.windows(2).find(|two| two[1].position() <= start - 10_000).unwrap();
    assert!(passed[0].position() - passed[1].position() > 90, "passed at speed");
    assert_eq!(rest[599].position(), start - 30_000);
}

#[test]
fn a_halted_set_point_waits_and_goes_on() {
    let mut bench = in_mode(1);
    let target = counts(START_M) - 20_000;
    bench.cycle(Controlword(NEW_SET_POINT), target);
    run(&mut bench, ENABLED, target, 100);
    let halted = run(&mut bench, ENABLED | HALT, target, 100);
    assert_eq!(halted[99].position(), halted[60].position());
    assert_ne!(halted[99].position(), target);
    assert_eq!(word(&halted[99]) & REACHED, REACHED, "halted: at rest");
    let resumed = run(&mut bench, ENABLED, 0, 400);
    assert_eq!(word(&resumed[0]) & REACHED, 0);
    assert_eq!(resumed[399].position(), target);
}

#[test]
fn a_set_point_beyond_a_limit_ends_at_the_limit() {
    let mut bench = in_mode(1);
    bench.cycle(Controlword(NEW_SET_POINT), counts(0.5));
    let last = run(&mut bench, ENABLED, 0, 500).pop().unwrap();
    assert_eq!(last.position(), counts(0.10));
    assert_eq!(word(&last) & LIMITED, LIMITED);
}

#[test]
fn another_mode_ends_a_profile_with_its_ramp() {
    let mut bench = in_mode(1);
    let target = counts(START_M) - 50_000;
    bench.cycle(Controlword(NEW_SET_POINT), target);
    let before = run(&mut bench, ENABLED, target, 100)[99].position();
    bench.write(0x6060, 0, &[0]);
    let after = run(&mut bench, ENABLED, target, 200);
    // 0.1 m/s at 2 m/s2: 2.5 mm.
    let way = before - after[199].position();
    assert!((2_300..2_900).contains(&way), "{way} counts");
    bench.write(0x6060, 0, &[1]);
    assert_eq!(run(&mut bench, ENABLED, target, 50)[49].position(), after[199].position());
}

#[test]
fn a_velocity_is_reached_with_its_acceleration_and_told() {
    let mut bench = in_mode(3);
    bench.write(0x60FF, 0, &(-100_000_i32).to_le_bytes());
    let answers = run(&mut bench, ENABLED, 0, 100);
    let velocity = |answer: &Answer| answer.extra.unwrap().velocity_counts_s;
    assert!((velocity(&answers[25]) + 50_000).abs() < 5_000, "{}", velocity(&answers[25]));
    assert_eq!(velocity(&answers[99]), -100_000);
    assert_eq!(word(&answers[20]) & REACHED, 0);
    assert_eq!(word(&answers[99]) & (REACHED | BIT_12), REACHED);
    let halted = run(&mut bench, ENABLED | HALT, 0, 100);
    assert_eq!(velocity(&halted[99]), 0);
    assert_eq!(word(&halted[99]) & (REACHED | BIT_12), REACHED | BIT_12);
    let again = run(&mut bench, ENABLED, 0, 100);
    assert_eq!(velocity(&again[99]), -100_000);
    // Towards the limit it brakes in time.
    let at_limit = run(&mut bench, ENABLED, 0, 2_000);
    let lowest = at_limit.iter().map(Answer::position).min().unwrap();
    assert!((counts(-0.02) - lowest).abs() <= 100, "{lowest}");
    assert_eq!(word(&at_limit[1_999]) & LIMITED, LIMITED);
    let steps = at_limit.windows(2).map(|two| two[1].position() - two[0].position());
    let changes: Vec<i32> = steps.collect();
    assert!(changes.windows(2).all(|two| (two[1] - two[0]).abs() <= 4), "beyond 2 m/s2");
}

#[test]
fn a_stuck_axis_in_a_profile_is_a_following_error() {
    let mut bench = in_mode(1);
    bench.is_stuck.store(true, std::sync::atomic::Ordering::Relaxed);
    bench.cycle(Controlword(NEW_SET_POINT), counts(START_M) - 50_000);
    let answers = run(&mut bench, ENABLED, 0, 300);
    let codes: Vec<u16> = answers.iter().flat_map(|answer| answer.emergencies.clone()).collect();
    assert_eq!(codes, [0x8611]);
    assert_eq!(answers[299].state(), State::Fault);
}

/// Homes by a method from `START_M`; returns the bench, the words, and the place of home.
fn homed(method: u8) -> (Bench, Vec<u16>, f64) {
    let mut bench = in_mode(6);
    bench.write(0x6098, 0, &[method]);
    let idle = run(&mut bench, ENABLED, 0, 3);
    assert_eq!(word(&idle[2]) & 0x3400, 0x0400, "idle");
    let mut words = Vec::new();
    let mut last = 0;
    for _ in 0..12_000 {
        let answer = bench.cycle(Controlword(NEW_SET_POINT), 0);
        words.push(word(&answer) & 0x3400);
        last = answer.position();
        if words.last() != Some(&0) {
            break;
        }
    }
    let home_m = bench.bus.responder().plant().encoder_m(0) - f64::from(last) / COUNTS_PER_M;
    (bench, words, home_m)
}

#[test]
fn every_method_finds_its_home() {
    // Limit switches a twentieth of 120 mm beyond the limits; an index pulse every 10 mm.
    for (method, expected_m) in [
        (1, -0.02),
        (2, 0.10),
        (17, -0.026),
        (18, 0.106),
        (33, 0.08),
        (34, 0.09),
        (35, START_M),
        (37, START_M),
        (0, 0.0),
    ] {
        let (mut bench, words, home_m) = homed(method);
        assert_eq!(words[0], 0, "method {method}: under way in the same cycle");
        assert_eq!(words.last(), Some(&0x1400), "method {method}");
        assert!((home_m - expected_m).abs() < 3e-6, "method {method}: home at {home_m}");
        // Its end keeps the word, and the axis rests.
        let after = run(&mut bench, ENABLED, 0, 20);
        assert_eq!(word(&after[19]) & 0x3400, 0x1400);
        assert_eq!(after[19].position(), after[0].position());
    }
}

#[test]
fn a_home_offset_counts_from_home() {
    let mut bench = in_mode(6);
    bench.write(0x607C, 0, &2_000_i32.to_le_bytes());
    bench.write(0x6098, 0, &[35]);
    let last = run(&mut bench, NEW_SET_POINT, 0, 5).pop().unwrap();
    assert_eq!(last.position(), -2_000, "zero lies at home plus the offset");
    bench.write(0x6060, 0, &[1]);
    bench.cycle(Controlword(ENABLED), -5_000);
    bench.cycle(Controlword(NEW_SET_POINT), -5_000);
    let last = run(&mut bench, ENABLED, 0, 300).pop().unwrap();
    assert_eq!(last.position(), -5_000);
    let place_m = bench.bus.responder().plant().encoder_m(0);
    assert!((place_m - (START_M - 0.003)).abs() < 1e-9, "{place_m}");
}

#[test]
fn homing_is_broken_off_by_its_bit_and_by_halt() {
    for stop in [ENABLED, NEW_SET_POINT | HALT] {
        let mut bench = in_mode(6);
        bench.write(0x6098, 0, &[17]);
        run(&mut bench, NEW_SET_POINT, 0, 200);
        let stopped = run(&mut bench, stop, 0, 100);
        assert_eq!(word(&stopped[99]) & 0x3400, 0x0400, "{stop:#x}: interrupted");
        assert_eq!(stopped[99].position(), stopped[70].position());
        assert!(stopped[99].position() > counts(0.0), "no new zero");
    }
}

#[test]
fn inputs_show_switches_and_what_a_test_sets() {
    let mut bench = in_mode(3);
    assert_eq!(bench.read(0x60FD, 0), 0);
    bench.write(0x2001, 0, &0x0001_0008_u32.to_le_bytes());
    assert_eq!(bench.read(0x60FD, 0), 0x0001_0008);
    assert_eq!(bench.read(0x60FE, 1) & 1, 0, "the brake is open while enabled");
    // Beyond its limit, onto the switch.
    bench.write(0x607D, 2, &200_000_i32.to_le_bytes());
    bench.write(0x60FF, 0, &100_000_i32.to_le_bytes());
    let last = run(&mut bench, ENABLED, 0, 1_000).pop().unwrap();
    assert!((last.position() - counts(0.106)).abs() <= 100, "{}", last.position());
    assert_eq!(bench.read(0x60FD, 0), 0x0001_000A);
    bench.cycle(Controlword::SHUTDOWN, 0);
    assert_eq!(bench.read(0x60FE, 1) & 1, 1);
}
