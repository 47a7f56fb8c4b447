//! Properties that the two settings keep and lose.

use super::*;
use crate::interpolate::random::Random;
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

/// A random program of three axes with different limits.
fn random_program(random: &mut Random) -> (Vec<PathSegment>, [AxisLimits; 3]) {
    let limits = std::array::from_fn(|_| AxisLimits {
        velocity_max_m_s: random.log(0.1, 1.0),
        acceleration_max_m_s2: random.log(1.0, 10.0),
        jerk_max_m_s3: random.log(20.0, 1e3),
    });
    let to_m = |random: &mut Random| (0..3).map(|_| 0.1 * random.signed()).collect();
    let moves = (0..20).map(|_| PathSegment::line(to_m(random), random.log(0.02, 0.5)));
    (moves.collect(), limits)
}

#[test]
fn every_completed_move_is_straight_whatever_the_limits_of_its_axes() {
    let mut random = Random(109);
    for _ in 0..50 {
        let (moves, limits) = random_program(&mut random);
        let plan =
            Linear::plan(&[0.0; 3], &moves, &limits, LinearSetting::CompleteEveryMove).unwrap();
        let ends = plan.moves.iter().skip(1).map(|next| next.start_s).chain([plan.duration_s()]);
        let mut from_m = vec![0.0; 3];
        for (index, (planned, end_s)) in plan.moves.iter().zip(ends).enumerate() {
            let to_m = &moves[index].to_m;
            for share in [0.1, 0.3, 0.5, 0.8] {
                let point_m =
                    plan.at(planned.start_s + share * (end_s - planned.start_s)).position_m;
                let along = (point_m[0] - from_m[0]) / (to_m[0] - from_m[0]);
                for axis in 1..3 {
                    let on_line_m = from_m[axis] + along * (to_m[axis] - from_m[axis]);
                    assert!((point_m[axis] - on_line_m).abs() < 1e-12, "move {index} {share}");
                }
            }
            from_m.clone_from(to_m);
        }
    }
}

#[test]
fn no_axis_jumps_when_it_arrives() {
    let (mut random, mut n_arrivals, h) = (Random(110), 0, 1e-9);
    for _ in 0..500 {
        let (moves, limits) = random_program(&mut random);
        let plan = Linear::plan(&[0.0; 3], &moves, &limits, LinearSetting::StartOnTime).unwrap();
        for planned in &plan.moves {
            let Course::Axes(first) = planned.course else { continue };
            for motion in &plan.axes[first..first + 3] {
                let end_s = planned.start_s + motion.duration_s();
                n_arrivals += 1;
                let (before, after) = (plan.at(end_s - h), plan.at(end_s + h));
                for (axis, limit) in limits.iter().enumerate() {
                    let moved_m = after.position_m[axis] - before.position_m[axis];
                    assert!(moved_m.abs() < 2.0 * h * limit.velocity_max_m_s * 1.001 + 1e-13);
                }
            }
        }
    }
    assert!(n_arrivals > 10_000, "{n_arrivals}");
}

#[test]
fn a_program_may_begin_in_motion() {
    let limits = [LIMITS[0]; 2];
    let (points_m, feeds_m_s) = ([0.0, 0.05, 0.2, 0.0, 0.2, 0.1], [0.3, 0.3]);
    let moves = [PathSegment::line(vec![0.2, 0.0], 0.3), PathSegment::line(vec![0.2, 0.1], 0.3)];
    for setting in [LinearSetting::CompleteEveryMove, LinearSetting::StartOnTime] {
        let plan = |velocity_m_s: &[f64]| {
            Linear::through(&points_m, &feeds_m_s, velocity_m_s, &limits, setting)
        };
        let moving = plan(&[0.25, -0.1]).unwrap();
        let start = moving.at(0.0);
        assert_eq!(start.position_m[..2], [0.0, 0.05]);
        assert_eq!(start.velocity_m_s[..2], [0.25, -0.1]);
        assert_eq!(start.acceleration_m_s2[..2], [0.0, 0.0]);
        assert_eq!(moving.at(-1.0), start);
        assert_eq!(moving.at(moving.duration_s() + 1e-9).position_m[..2], [0.2, 0.1]);
        let (n, mut before) = (20_000, start);
        let h = moving.duration_s() / f64::from(n);
        for k in 1..=n {
            let now = moving.at(h * f64::from(k));
            for axis in 0..2 {
                let steps = [
                    (now.position_m, before.position_m, 0.5),
                    (now.velocity_m_s, before.velocity_m_s, 2.0),
                    (now.acceleration_m_s2, before.acceleration_m_s2, 80.0),
                ];
                for (now, before, most) in steps {
                    assert!((now[axis] - before[axis]).abs() <= most * h * 1.001, "{k} {axis}");
                }
            }
            before = now;
        }
        let resting = plan(&[]).unwrap();
        let same = Linear::plan(&points_m[..2], &moves, &limits, setting).unwrap();
        let faster = plan(&[0.25, 0.0]).unwrap();
        assert!(faster.moves[1].start_s <= resting.moves[1].start_s, "{setting:?}");
        for t_s in [0.0, 0.3, 0.7, 1.5] {
            assert_eq!(plan(&[0.0, 0.0]).unwrap().at(t_s), resting.at(t_s));
            assert_eq!(same.at(t_s), resting.at(t_s));
        }
        for (points, feeds) in [(&points_m[..5], 2), (&points_m, 1), (&points_m[..0], 0)] {
            let refused = Linear::through(points, &feeds_m_s[..feeds], &[], &limits, setting);
            assert!(matches!(refused, Err(TrajectoryError::Shape { .. })), "{points:?} {feeds}");
        }
        let none = Linear::through(&points_m[..2], &[], &[], &limits, setting);
        assert!(matches!(none, Err(TrajectoryError::Empty)));
        for bad in [&[0.1][..], &[0.1, 0.0, 0.0]] {
            assert!(matches!(plan(bad), Err(TrajectoryError::Shape { .. })), "{bad:?}");
        }
        for bad in [0.6, -0.6, f64::NAN, f64::INFINITY] {
            let refused = plan(&[0.0, bad]).unwrap_err();
            assert_eq!(refused.axis(), Some(1));
            assert!(refused.to_string().contains("start velocity"), "{refused}");
            assert!(refused.to_string().contains("within 0.5 m/s of 0"), "{refused}");
        }
    }
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

#[test]
fn tables_and_samples_are_those_of_the_motion() {
    let (points_m, feeds_m_s) = ([0.0, 0.02, 0.05], [0.1, 0.2]);
    let plan = Linear::through(&points_m, &feeds_m_s, &[], &LIMITS, LinearSetting::StartOnTime);
    let plan = plan.unwrap();
    let motion = plan.sampled(0.002).unwrap();
    let times_s: Vec<f64> = (0..motion.n_samples()).map(|k| k as f64 * 0.002).collect();
    let [position_m, velocity_m_s, acceleration_m_s2] = plan.tables_at(&times_s);
    assert_eq!(position_m, motion.position_m);
    assert_eq!(velocity_m_s, motion.velocity_m_s);
    assert_eq!(acceleration_m_s2, motion.acceleration_m_s2);
    assert_eq!(position_m.last(), Some(&0.05));
}
