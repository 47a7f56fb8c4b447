//! Promises of the interpolator: limits, end points, repeatability, refusals.

use super::*;
use crate::interpolate::random::Random;
use crate::trajectory::{PathSegment, Quantity};

const CYCLE_S: f64 = 0.002;

fn limits(velocity: f64, acceleration: f64, jerk: f64) -> AxisLimits {
    AxisLimits {
        velocity_max_m_s: velocity,
        acceleration_max_m_s2: acceleration,
        jerk_max_m_s3: jerk,
    }
}

fn segment(to_m: &[f64], feed_m_s: f64) -> PathSegment {
    PathSegment::line(to_m.to_vec(), feed_m_s)
}

fn contour(blend_s: Option<f64>, feed: f64) -> PathSpec {
    let corners = [[0.08, 0.04], [0.06, 0.06], [0.0, 0.06], [0.0, 0.0], [0.08, 0.0]];
    PathSpec {
        start_m: vec![0.08, 0.0],
        segments: corners.iter().map(|to| segment(to, feed)).collect(),
        blend_s,
        dwell_before_s: 0.1,
        dwell_after_s: 0.2,
    }
}

fn gantry() -> [AxisLimits; 2] {
    [limits(0.5, 8.0, 1000.0); 2]
}

/// Largest finite differences of an axis, with rest before and after.
fn peaks(reference: &[f64], n_axes: usize, axis: usize, cycle_s: f64) -> [f64; 3] {
    let column: Vec<f64> = reference.iter().skip(axis).step_by(n_axes).copied().collect();
    let (first, last) = (column[0], column[column.len() - 1]);
    let mut values = [vec![first; 3], column, vec![last; 3]].concat();
    let mut peaks = [0.0_f64; 3];
    for peak in &mut peaks {
        values = values.windows(2).map(|pair| (pair[1] - pair[0]) / cycle_s).collect();
        *peak = values.iter().fold(0.0, |most, value| most.max(value.abs()));
    }
    peaks
}

fn assert_holds(plan: &Interpolator, limits: &[AxisLimits], what: &str) {
    let reference = plan.reference();
    for (axis, limit) in limits.iter().enumerate() {
        let found = peaks(&reference, limits.len(), axis, plan.cycle_s());
        for ((quantity, most), found) in limit.named().into_iter().zip(found) {
            assert!(
                found <= most * (1.0 + 1e-6) + 1e-5,
                "{what}: axis {axis} {quantity} {found} > {most}"
            );
        }
    }
}

#[test]
fn the_example_contour_is_blended_at_its_feed() {
    let plan = Interpolator::plan(&contour(Some(0.04), 0.1), &gantry(), CYCLE_S).unwrap();
    assert_holds(&plan, &gantry(), "contour");
    // 268.28 mm at 0.1 m/s, two dwells, and slightly more than the window.
    let motion_s = 0.268_284_27 / 0.1 + 0.3 + 0.04;
    let lasts_s = (plan.n_samples() - 1) as f64 * CYCLE_S;
    assert!((lasts_s - motion_s).abs() < 0.015, "{lasts_s} s");
    let reference = plan.reference();
    let found = peaks(&reference, 2, 1, CYCLE_S);
    assert!((found[0] - 0.1).abs() < 1e-9, "the feed is kept on the straight");
    assert!((found[1] - 2.5).abs() < 1e-6, "0.1 m/s in 40 ms");
    assert!((found[2] - 625.0).abs() < 1e-3, "two ticks are the shortest second window that does");
    // A right-angled corner is cut by at most feed * window / 4 / sqrt(2), plus a little for the
    // second.
    let nearest = |x: f64, y: f64| {
        reference.chunks(2).map(|p| (p[0] - x).hypot(p[1] - y)).fold(f64::INFINITY, f64::min)
    };
    let cut = nearest(0.0, 0.06);
    assert!((0.0006..0.0008).contains(&cut), "{cut}");
}

#[test]
fn random_paths_hold_the_limits_and_end_exactly_under_both_rules() {
    let mut random = Random(21);
    let mut refused = 0;
    for round in 0..60 {
        let n_axes = 1 + round % 4;
        let axes: Vec<AxisLimits> = (0..n_axes)
            .map(|_| limits(random.log(0.2, 1.0), random.log(1.0, 20.0), random.log(50.0, 5e3)))
            .collect();
        let point = |random: &mut Random| -> Vec<f64> {
            (0..n_axes).map(|_| 0.2 * random.signed()).collect()
        };
        let mut spec = PathSpec {
            start_m: point(&mut random),
            segments: (0..5)
                .map(|_| PathSegment::line(point(&mut random), random.log(0.08, 0.4)))
                .collect(),
            blend_s: None,
            dwell_before_s: 0.03 * random.unit(),
            dwell_after_s: if round % 3 == 0 { 0.0 } else { 0.05 * random.unit() },
        };
        for blend_s in [None, Some(random.log(0.004, 0.3))] {
            spec.blend_s = blend_s;
            let mut plan = match Interpolator::plan(&spec, &axes, CYCLE_S) {
                Ok(plan) => plan,
                Err(TrajectoryError::Exceeds { .. }) => {
                    refused += 1;
                    continue;
                }
                Err(other) => panic!("{other}"),
            };
            assert_holds(&plan, &axes, &format!("round {round} {blend_s:?}"));
            let first = plan.next();
            assert_eq!(first.velocity_m_s, [0.0; crate::interpolate::MAX_AXES]);
            for (position, start) in first.position_m.iter().zip(&spec.start_m) {
                assert!((position - start).abs() <= 1e-12);
            }
            let mut last = first;
            for sample in 1..plan.n_samples() {
                assert!(!last.done, "sample {sample} of {}", plan.n_samples());
                last = plan.next();
            }
            assert!(last.done);
            assert_eq!(last.velocity_m_s, [0.0; crate::interpolate::MAX_AXES]);
            for (position, end) in last.position_m.iter().zip(&spec.segments[4].to_m) {
                assert!((position - end).abs() <= 1e-12, "{position} {end}");
            }
            assert_eq!(plan.next(), last, "the last set point is held");
        }
    }
    assert!((10..50).contains(&refused), "{refused} of 60 blends refused: both cases must occur");
}

#[test]
fn a_run_repeats_bit_by_bit_and_is_the_reference() {
    for blend_s in [None, Some(0.04)] {
        let mut plan = Interpolator::plan(&contour(blend_s, 0.1), &gantry(), CYCLE_S).unwrap();
        let reference = plan.reference();
        assert_eq!(reference.len(), 2 * plan.n_samples());
        for stop_at in [plan.n_samples() / 3, plan.n_samples(), plan.n_samples() + 50] {
            plan.restart();
            for k in 0..stop_at {
                let setpoint = plan.next();
                let at = 2 * k.min(plan.n_samples() - 1);
                assert_eq!(setpoint.position_m[0].to_bits(), reference[at].to_bits());
                assert_eq!(setpoint.position_m[1].to_bits(), reference[at + 1].to_bits());
            }
        }
    }
}

#[test]
fn velocities_are_the_slope_of_the_positions() {
    for blend_s in [None, Some(0.04)] {
        let mut plan = Interpolator::plan(&contour(blend_s, 0.1), &gantry(), CYCLE_S).unwrap();
        let setpoints: Vec<Setpoint> = (0..plan.n_samples()).map(|_| plan.next()).collect();
        for around in setpoints.windows(3) {
            let slope = (around[2].position_m[0] - around[0].position_m[0]) / (2.0 * CYCLE_S);
            // A jerk of 1000 m/s3 changes the slope by at most j dt^2 / 6.
            assert!((around[1].velocity_m_s[0] - slope).abs() < 1e-3, "{around:?}");
        }
    }
}

#[test]
fn exact_stops_rest_at_every_corner_and_pass_through_it() {
    let spec = contour(None, 0.1);
    let mut plan = Interpolator::plan(&spec, &gantry(), 1e-4).unwrap();
    let setpoints: Vec<Setpoint> = (0..plan.n_samples()).map(|_| plan.next()).collect();
    for corner in &spec.segments {
        let nearest = setpoints
            .iter()
            .map(|s| (s.position_m[0] - corner.to_m[0]).hypot(s.position_m[1] - corner.to_m[1]))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-8, "{corner:?}: {nearest}");
    }
}

#[test]
fn a_long_run_does_not_drift() {
    let feed = 0.4;
    let mut segments = Vec::new();
    for _ in 0..2_000 {
        segments.push(segment(&[0.100_000_1, 0.033_333_3], feed));
        segments.push(segment(&[0.0, 0.0], feed));
    }
    let spec = PathSpec {
        start_m: vec![0.0, 0.0],
        segments,
        blend_s: Some(0.2),
        dwell_before_s: 0.0,
        dwell_after_s: 0.0,
    };
    let mut plan = Interpolator::plan(&spec, &gantry(), CYCLE_S).unwrap();
    let mut last = plan.next();
    while !last.done {
        last = plan.next();
    }
    assert_eq!(last.position_m, [0.0; crate::interpolate::MAX_AXES]);
}

#[test]
fn a_blend_beyond_the_limits_is_refused_with_what_would_do() {
    let spec = contour(Some(0.04), 0.1);
    let weak = [limits(0.5, 8.0, 1000.0), limits(0.5, 1.0, 1000.0)];
    let error = Interpolator::plan(&spec, &weak, CYCLE_S).unwrap_err();
    let TrajectoryError::Exceeds {
        axis,
        quantity,
        reached,
        limit,
        feed_admissible,
        window_admissible_s,
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert_eq!((axis, quantity), (1, Quantity::Acceleration));
    assert!((reached - 2.5).abs() < 1e-6 && (limit - 1.0).abs() < 1e-15);
    assert!((feed_admissible - 0.04).abs() < 1e-3, "1 m/s2 in 40 ms: {feed_admissible}");
    let window_s = window_admissible_s.unwrap();
    assert!((window_s - 0.1).abs() < 3e-3, "0.1 m/s at 1 m/s2: {window_s}");
    let line = error.to_string();
    println!("{line}");
    assert!(line.starts_with("axis 2: acceleration reaches 2.5 m/s^2, limit 1 m/s^2"), "{line}");
    assert!(!line.contains('\n'));

    let slower = contour(Some(0.04), feed_admissible);
    assert_holds(&Interpolator::plan(&slower, &weak, CYCLE_S).unwrap(), &weak, "slower");
    let wider = contour(Some(window_s), 0.1);
    assert_holds(&Interpolator::plan(&wider, &weak, CYCLE_S).unwrap(), &weak, "wider");
}

#[test]
fn a_feed_beyond_an_axis_is_refused_and_no_window_is_offered() {
    let slow = [limits(0.05, 8.0, 1000.0), limits(0.5, 8.0, 1000.0)];
    let error = Interpolator::plan(&contour(Some(0.04), 0.1), &slow, CYCLE_S).unwrap_err();
    let TrajectoryError::Exceeds { axis, quantity, feed_factor, window_admissible_s, .. } = error
    else {
        panic!("{error}");
    };
    assert_eq!((axis, quantity, window_admissible_s), (0, Quantity::Velocity, None));
    assert!((feed_factor - 0.5).abs() < 1e-3, "{feed_factor}");
}

#[test]
fn bad_values_are_refused_one_at_a_time() {
    let good = contour(Some(0.04), 0.1);
    let plan = |spec: &PathSpec| Interpolator::plan(spec, &gantry(), CYCLE_S).map(|_| ());
    assert!(plan(&good).is_ok());
    let broken = |change: &dyn Fn(&mut PathSpec)| {
        let mut spec = good.clone();
        change(&mut spec);
        let error = plan(&spec).unwrap_err().to_string();
        assert!(!error.contains('\n'), "{error}");
        error
    };
    assert!(broken(&|s| s.start_m.clear()).contains("0 axes"));
    assert!(broken(&|s| s.start_m = vec![0.0; MAX_AXES + 1]).contains("13 axes: allowed 1 to 12"));
    assert!(broken(&|s| s.start_m = vec![0.0; 3]).contains("limits of 2 axes"));
    assert!(broken(&|s| s.start_m[1] = f64::NAN).contains("axis 2: position NaN"));
    assert!(broken(&|s| s.segments.clear()).contains("0 segments"));
    assert!(broken(&|s| s.segments[2].to_m.truncate(1)).contains("segment 3: 1 coordinates"));
    assert!(broken(&|s| s.segments[2].to_m[0] = 1e9).contains("axis 1: position"));
    assert!(broken(&|s| s.segments[0].feed_m_s = 0.0).contains("segment 1: feed 0"));
    assert!(
        broken(&|s| s.segments[1].to_m = s.segments[0].to_m.clone()).contains("segment 2: ends")
    );
    assert!(broken(&|s| s.dwell_before_s = -0.1).contains("dwell before"));
    assert!(broken(&|s| s.dwell_after_s = f64::NAN).contains("dwell after"));
    assert!(broken(&|s| s.blend_s = Some(0.0)).contains("blend window"));
    assert!(broken(&|s| s.blend_s = Some(11.0)).contains("blend window"));
    assert!(broken(&|s| s.segments[0].feed_m_s = 1e-7).contains("samples"));
    assert!(Interpolator::plan(&good, &gantry(), f64::NAN).is_err());
    assert!(Interpolator::plan(&good, &gantry(), 0.0).is_err());
}

#[test]
fn a_hold_rests_and_says_when_it_is_over() {
    let mut hold = Interpolator::hold(&[0.3, -0.1], 4, 1e-3).unwrap();
    assert_eq!((hold.n_samples(), hold.n_axes()), (4, 2));
    for k in 0..6 {
        let setpoint = hold.next();
        assert_eq!(setpoint.position_m[..2], [0.3, -0.1]);
        assert_eq!(setpoint.velocity_m_s, [0.0; MAX_AXES]);
        assert_eq!(setpoint.done, k >= 3);
    }
    hold.restart();
    assert!(!hold.next().done);
    assert_eq!(hold.reference(), [0.3, -0.1].repeat(4));
    assert!(Interpolator::hold(&[], 4, 1e-3).is_err());
    assert!(Interpolator::hold(&[f64::NAN], 4, 1e-3).is_err());
    assert!(Interpolator::hold(&[0.0], 0, 1e-3).is_err());
    assert!(Interpolator::hold(&[0.0], 4, 0.0).is_err());
}
