//! Properties that the two settings keep and lose.

use super::*;
use crate::trajectory::{ModulatedSegment, points_program};

const LIMITS: [AxisLimits; 1] =
    [AxisLimits { velocity_max_m_s: 0.5, acceleration_max_m_s2: 2.0, jerk_max_m_s3: 80.0 }];

fn six_point(frequency_hz: f64) -> Vec<PathSegment> {
    let segment =
        ModulatedSegment { to_m: vec![0.06], feed_m_s: 0.01, amplitude_m: 0.002, frequency_hz };
    points_program(&[0.0], &segment, 6).unwrap()
}

/// Amplitude and duration of the result, in the middle of the motion.
fn oscillation(plan: &Linear) -> (f64, f64) {
    let n = 20_000;
    let duration_s = plan.duration_s();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for k in n / 4..3 * n / 4 {
        let t = duration_s * f64::from(k) / f64::from(n);
        let off = plan.at(t).position_m[0] - 0.06 * t / duration_s;
        (low, high) = (low.min(off), high.max(off));
    }
    (0.5 * (high - low), duration_s)
}

#[test]
fn completing_every_move_loses_frequency_and_starting_on_time_loses_amplitude() {
    let program = six_point(10.0);
    let plan = |setting| Linear::plan(&[0.0], &program, &LIMITS, setting).unwrap();
    let complete = plan(LinearSetting::CompleteEveryMove);
    let on_time = plan(LinearSetting::StartOnTime);
    let (full, slow_s) = oscillation(&complete);
    let (small, kept_s) = oscillation(&on_time);
    let nominal_s = complete.nominal_s();
    assert!((nominal_s - 6.0).abs() < 1e-9);
    assert!(slow_s > 1.5 * nominal_s, "frequency falls: {slow_s} s for {nominal_s} s");
    assert!((full / 0.002 - 0.866).abs() < 0.06, "amplitude of the six points is kept: {full}");
    assert!(kept_s < 1.05 * nominal_s, "frequency is kept: {kept_s} s");
    assert!(small < 0.8 * full, "amplitude falls: {small} of {full}");
}

#[test]
fn the_end_is_the_target_and_the_state_is_continuous() {
    for setting in [LinearSetting::CompleteEveryMove, LinearSetting::StartOnTime] {
        let plan = Linear::plan(&[0.0], &six_point(4.0), &LIMITS, setting).unwrap();
        let (n, mut before) = (100_000, plan.at(0.0));
        let h = plan.duration_s() / f64::from(n);
        for k in 1..=n {
            let now = plan.at(h * f64::from(k));
            assert!((now.position_m[0] - before.position_m[0]).abs() <= 0.5 * h * 1.001);
            assert!((now.velocity_m_s[0] - before.velocity_m_s[0]).abs() <= 2.0 * h * 1.001);
            assert!(
                (now.acceleration_m_s2[0] - before.acceleration_m_s2[0]).abs() <= 80.0 * h * 1.001
            );
            before = now;
        }
        let end = plan.at(plan.duration_s() + 1.0);
        assert_eq!((end.position_m[0], end.velocity_m_s[0]), (0.06, 0.0));
    }
}

#[test]
fn a_slow_program_is_the_same_in_both_settings_but_for_the_ramps() {
    let moves = [PathSegment::line(vec![0.1, 0.1], 0.05), PathSegment::line(vec![0.0, 0.2], 0.05)];
    let limits = [LIMITS[0]; 2];
    let plan = |setting| Linear::plan(&[0.0, 0.0], &moves, &limits, setting).unwrap();
    let complete = plan(LinearSetting::CompleteEveryMove);
    let on_time = plan(LinearSetting::StartOnTime);
    assert!(on_time.duration_s() < complete.duration_s());
    for t in [0.3, 1.0, 2.0] {
        assert_eq!(complete.at(t), on_time.at(t), "the first move is not touched");
    }
    let middle = complete.at(1.4);
    assert!((middle.position_m[0] - middle.position_m[1]).abs() < 1e-15, "straight");
}

#[test]
fn bad_programs_are_refused() {
    let plan = |to: f64, feed: f64| {
        Linear::plan(
            &[0.0],
            &[PathSegment::line(vec![to], feed)],
            &LIMITS,
            LinearSetting::StartOnTime,
        )
    };
    assert!(plan(0.1, 0.1).is_ok());
    for (to, feed) in [(0.0, 0.1), (f64::NAN, 0.1), (0.1, 0.0), (0.1, f64::INFINITY)] {
        assert!(plan(to, feed).is_err(), "{to} {feed}");
    }
    assert!(Linear::plan(&[0.0], &[], &LIMITS, LinearSetting::StartOnTime).is_err());
}
