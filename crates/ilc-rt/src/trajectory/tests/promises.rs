//! The guarantee of the whole folder: over more than a million random moves of every kind no limit
//! is exceeded by more than 1e-9 of itself, every value is finite, and no duration is negative.

use crate::interpolate::random::Random;
use crate::trajectory::curve::{Butterfly, Curve, Run, RunLimits, Spiral, Spline};
use crate::trajectory::{
    AxisLimits, ExponentialSigmoid, Interpolator, JerkLimited, Linear, LinearSetting,
    ModulatedSegment, MotionState, PathSegment, PathSpec, TrajectoryError,
};

const TOLERANCE: f64 = 1e-9;

fn random_limits(random: &mut Random) -> AxisLimits {
    AxisLimits {
        velocity_max_m_s: random.log(0.05, 2.0),
        acceleration_max_m_s2: random.log(0.3, 30.0),
        jerk_max_m_s3: random.log(5.0, 5e3),
    }
}

fn assert_state(state: &MotionState, limits: &[AxisLimits], what: &dyn std::fmt::Debug) {
    for (axis, limit) in limits.iter().enumerate() {
        let values =
            [state.velocity_m_s[axis], state.acceleration_m_s2[axis], state.jerk_m_s3[axis]];
        assert!(state.position_m[axis].is_finite(), "{what:?}");
        for ((quantity, most), value) in limit.named().into_iter().zip(values) {
            assert!(
                value.abs() <= most * (1.0 + TOLERANCE),
                "{quantity} {value} > {most}: {what:?}"
            );
        }
    }
}

#[test]
fn a_million_profiles() {
    let mut random = Random(101);
    for _ in 0..1_000_000 {
        let [length, v, a, j] = [
            random.log(1e-6, 10.0),
            random.log(1e-4, 10.0),
            random.log(1e-3, 100.0),
            random.log(1e-2, 1e5),
        ];
        let plan = JerkLimited::plan(length, v, a, j).unwrap();
        assert!(plan.duration_s() > 0.0);
        for share in [random.unit(), random.unit(), 0.5] {
            let state = plan.at(share * plan.duration_s());
            assert!((0.0..=length).contains(&state.s_m), "{plan:?}");
            assert!(state.v_m_s <= v * (1.0 + TOLERANCE), "{plan:?}");
            assert!(state.a_m_s2.abs() <= a * (1.0 + TOLERANCE), "{plan:?}");
            assert!(state.j_m_s3.abs() <= j * (1.0 + TOLERANCE), "{plan:?}");
        }
    }
}

#[test]
fn forty_thousand_moves_of_linear_programs_in_both_settings() {
    let mut random = Random(102);
    let mut n_moves = 0;
    for round in 0..2_000 {
        let n_axes = 1 + round % 3;
        let limits: Vec<AxisLimits> = (0..n_axes).map(|_| random_limits(&mut random)).collect();
        let moves: Vec<PathSegment> = (0..10)
            .map(|_| {
                let scale = random.log(1e-4, 0.3);
                let to_m = (0..n_axes).map(|_| scale * random.signed()).collect();
                PathSegment::line(to_m, random.log(1e-3, 1.0))
            })
            .collect();
        for setting in [LinearSetting::CompleteEveryMove, LinearSetting::StartOnTime] {
            let plan = Linear::plan(&vec![0.0; n_axes], &moves, &limits, setting).unwrap();
            n_moves += moves.len();
            let duration_s = plan.duration_s();
            assert!(duration_s > 0.0 && duration_s.is_finite());
            for _ in 0..40 {
                let state = plan.at(duration_s * random.unit());
                assert_state(&state, &limits, &(setting, &moves, &limits));
            }
            let end = plan.at(duration_s * (1.0 + 1e-12));
            let targets = moves.last().unwrap().to_m.iter();
            for (axis, target) in targets.enumerate() {
                assert!((end.position_m[axis] - target).abs() < 1e-12, "{setting:?} {moves:?}");
            }
        }
    }
    assert_eq!(n_moves, 40_000);
}

#[test]
fn random_exponential_sigmoid_moves() {
    let mut random = Random(103);
    let (mut planned, mut refused) = (0, 0);
    for round in 0..120 {
        let n_axes = 1 + round % 3;
        let limits: Vec<AxisLimits> = (0..n_axes).map(|_| random_limits(&mut random)).collect();
        let mut to_m = vec![0.0; n_axes];
        let mut program = Vec::new();
        let turn = random.unit() < 0.5;
        for leg in 0..2 {
            let scale = random.log(0.05, 0.5);
            let sign = if turn && leg == 1 { -0.7 } else { 1.0 };
            for (axis, to) in to_m.iter_mut().enumerate() {
                let share = if turn { 1.0 / (1.0 + axis as f64) } else { random.signed() };
                *to += sign * scale * share;
            }
            let oscillates = random.unit() < 0.5;
            program.push(ModulatedSegment {
                to_m: to_m.clone(),
                feed_m_s: random.log(0.01, 0.2),
                amplitude_m: if oscillates { random.log(1e-5, 2e-3) } else { 0.0 },
                frequency_hz: random.log(0.5, 10.0),
            });
        }
        match ExponentialSigmoid::plan(&vec![0.0; n_axes], &program, &limits) {
            Ok(plan) => {
                planned += 1;
                let duration_s = plan.duration_s();
                assert!(duration_s > 0.0);
                for k in 0..4_000 {
                    let t = duration_s * (f64::from(k) + random.unit()) / 4_000.0;
                    assert_state(&plan.at(t), &limits, &(t, &program, &limits));
                }
                for choice in plan.choices() {
                    // Dense where the ends have an effect.
                    let corner_s = if choice.place == "start-up" { 0.0 } else { duration_s };
                    for k in 0..500 {
                        let t = (corner_s - duration_s * 0.2 * f64::from(k) / 500.0).abs();
                        assert_state(&plan.at(t), &limits, &(t, &program, &limits));
                    }
                }
            }
            Err(
                TrajectoryError::Alpha { .. }
                | TrajectoryError::Hurried { .. }
                | TrajectoryError::Programmed { .. },
            ) => refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
    println!("E/S: {planned} planned, {refused} refused");
    assert!(planned > 24 && refused > 8, "both must occur: {planned}, {refused}");
}

/// The set points, their stated derivatives and their finite differences.
fn assert_run(curve: &impl Curve, limits: &RunLimits, dt_s: f64) {
    let run = match Run::plan(curve, limits, dt_s) {
        Ok(run) => run,
        Err(error) => panic!("{error}: {limits:?}"),
    };
    let motion = run.motion();
    let n = motion.n_axes;
    for (axis, limit) in limits.axes.iter().enumerate() {
        let column =
            |values: &[f64]| -> Vec<f64> { values.iter().skip(axis).step_by(n).copied().collect() };
        let bounds = limit.named();
        for (order, stated) in [&motion.velocity_m_s, &motion.acceleration_m_s2].iter().enumerate()
        {
            for value in column(stated) {
                assert!(value.abs() <= bounds[order].1 * (1.0 + TOLERANCE));
            }
        }
        let mut values = column(&motion.position_m);
        for (order, (quantity, most)) in bounds.into_iter().enumerate() {
            values = values.windows(2).map(|pair| (pair[1] - pair[0]) / dt_s).collect();
            let rounding = 4e-16 / dt_s.powi(i32::try_from(order).unwrap() + 1);
            for value in &values {
                assert!(
                    value.abs() <= most * (1.0 + TOLERANCE) + rounding,
                    "axis {axis} {quantity}: {value} > {most}"
                );
            }
        }
    }
    for (rest, values) in [(0, &motion.velocity_m_s), (0, &motion.acceleration_m_s2)] {
        assert!(
            values[..n]
                .iter()
                .chain(&values[values.len() - n..])
                .all(|v| v.abs() <= f64::from(rest))
        );
    }
}

#[test]
fn random_curves() {
    let mut random = Random(104);
    for round in 0..30 {
        let limits = RunLimits {
            feed_m_s: random.log(0.03, 0.2),
            curvature_acceleration_max_m_s2: if round % 2 == 0 {
                f64::INFINITY
            } else {
                random.log(0.05, 5.0)
            },
            axes: vec![random_limits(&mut random), random_limits(&mut random)],
        };
        match round % 3 {
            0 => {
                let n_points = 3 + round % 7;
                let points: Vec<Vec<f64>> = (0..n_points)
                    .map(|_| vec![0.1 * random.signed(), 0.1 * random.signed()])
                    .collect();
                assert_run(&Spline::through(&points).unwrap(), &limits, 0.002);
            }
            1 => {
                let spiral =
                    Spiral::new(random.log(1e-3, 1e-2), 1.0 + 4.0 * random.unit(), [0.0; 2]);
                assert_run(&spiral.unwrap(), &limits, 0.002);
            }
            _ => {
                let butterfly = Butterfly::new(random.log(1e-3, 1e-2), 1.0, [0.01, 0.0]);
                assert_run(&butterfly.unwrap(), &limits, 0.002);
            }
        }
    }
}

#[test]
fn random_paths_of_lines_and_arcs_with_exact_stops() {
    let mut random = Random(105);
    let dt_s = 1e-3;
    for _ in 0..300 {
        let limits = [random_limits(&mut random), random_limits(&mut random)];
        let radius = random.log(1e-3, 0.1);
        let sweep = 0.1 + 6.0 * random.unit();
        let clockwise = random.unit() < 0.5;
        let angle = if clockwise { -sweep } else { sweep };
        let arc = crate::trajectory::ArcSpec { plane: [0, 1], center_m: [0.0, 0.0], clockwise };
        let spec = PathSpec {
            start_m: vec![radius, 0.0],
            segments: vec![
                PathSegment {
                    to_m: vec![radius * angle.cos(), radius * angle.sin()],
                    feed_m_s: random.log(0.01, 1.0),
                    arc: Some(arc),
                    dwell_s: 0.01 * random.unit(),
                },
                PathSegment::line(vec![0.0, 0.0], random.log(0.01, 1.0)),
            ],
            blend_s: None,
            dwell_before_s: 0.01,
            dwell_after_s: 0.01,
        };
        let plan = Interpolator::plan(&spec, &limits, dt_s).unwrap();
        let reference = plan.reference();
        for (axis, limit) in limits.iter().enumerate() {
            let mut values: Vec<f64> = reference.iter().skip(axis).step_by(2).copied().collect();
            for (order, (quantity, most)) in limit.named().into_iter().enumerate() {
                values = values.windows(2).map(|pair| (pair[1] - pair[0]) / dt_s).collect();
                let rounding = 4e-16 / dt_s.powi(i32::try_from(order).unwrap() + 1);
                let found = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                assert!(
                    found <= most * (1.0 + TOLERANCE) + rounding,
                    "{quantity} {found} > {most} {spec:?}"
                );
            }
        }
        let on_arc =
            reference.chunks(2).take_while(|p| (p[0].hypot(p[1]) - radius).abs() < 1e-12).count();
        assert!(on_arc > 3, "the arc keeps its radius");
        let last = &reference[reference.len() - 2..];
        assert!(last.iter().all(|value| value.abs() <= 0.0));
    }
}
