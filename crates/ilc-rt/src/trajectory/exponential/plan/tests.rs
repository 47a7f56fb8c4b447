//! Promises of E/S: on the path soon, at rest at its ends, no corner passed, α as large as can be.

use super::*;
use crate::trajectory::Quantity;

fn limits(velocity: f64, acceleration: f64, jerk: f64) -> AxisLimits {
    AxisLimits {
        velocity_max_m_s: velocity,
        acceleration_max_m_s2: acceleration,
        jerk_max_m_s3: jerk,
    }
}

fn segment(to_m: &[f64], feed_m_s: f64, amplitude_m: f64, frequency_hz: f64) -> ModulatedSegment {
    ModulatedSegment { to_m: to_m.to_vec(), feed_m_s, amplitude_m, frequency_hz }
}

/// Largest absolute velocity, acceleration and jerk of an axis.
fn peaks(plan: &ExponentialSigmoid, axis: usize, n: u32) -> [f64; 3] {
    (0..=n).fold([0.0; 3], |most, k| {
        let state = plan.at(plan.duration_s() * f64::from(k) / f64::from(n) * (1.0 - 1e-15));
        let values =
            [state.velocity_m_s[axis], state.acceleration_m_s2[axis], state.jerk_m_s3[axis]];
        std::array::from_fn(|i| f64::max(most[i], values[i].abs()))
    })
}

#[test]
fn a_plain_start_has_the_alpha_of_its_scaling() {
    // x = v t (1 - e^{-u³}), u = α^{1/3} t: acceleration v α^{1/3} f''(u), jerk v α^{2/3} f'''(u).
    let f = |u: f64, order: usize| equations_start(u).0[order].abs();
    let peak =
        |order: usize| (0..200_000).map(|i| f(f64::from(i) * 2e-5, order)).fold(0.0, f64::max);
    let (v_peak, a_peak, j_peak) = (peak(1), peak(2), peak(3));
    assert!((v_peak - (1.0 + 3.0 * (-4.0_f64 / 3.0).exp())).abs() < 1e-9, "79 % above the feed");
    let plan = |a: f64, j: f64| {
        ExponentialSigmoid::plan(&[0.0], &[segment(&[1.0], 0.1, 0.0, 0.0)], &[limits(0.2, a, j)])
            .unwrap()
    };
    let by_acceleration = plan(0.5, 1e4).choices()[0].alpha;
    assert!((by_acceleration / (0.5 / 0.1 / a_peak).powi(3) - 1.0).abs() < 1e-6);
    let by_jerk = plan(1e3, 2.0).choices()[0].alpha;
    assert!((by_jerk / (2.0 / 0.1 / j_peak).powf(1.5) - 1.0).abs() < 1e-6);
}

fn equations_start(u: f64) -> crate::trajectory::jet::Jet {
    super::super::equations::startup_linear(u, 1.0, 0.0, 1.0)
}

#[test]
fn there_and_back_comes_to_rest_at_its_ends_and_never_passes_the_corner() {
    let plan = ExponentialSigmoid::plan(
        &[0.0],
        &[segment(&[0.254], 0.254, 0.0, 0.0), segment(&[0.0], 0.127, 0.0, 0.0)],
        &[limits(1.0, 12.7, 2000.0)],
    )
    .unwrap();
    assert!((plan.duration_s() - 3.0).abs() < 1e-12);
    assert_eq!(plan.choices().len(), 3);
    assert_eq!(plan.choices()[1].place, "transition");
    for k in 0..=30_000 {
        let state = plan.at(f64::from(k) * 1e-4);
        assert!(state.position_m[0] <= 0.254 + 1e-15, "the corner is not passed");
        assert!(state.position_m[0] >= -1e-15);
    }
    let corner = plan.at(1.0);
    assert!((corner.position_m[0] - 0.254).abs() < 1e-15);
    assert!(corner.velocity_m_s[0].abs() < 1e-12, "at rest where it turns round");
    for (t, at) in [(0.0, 0.0), (3.0, 0.0), (9.0, 0.0), (-1.0, 0.0)] {
        let state = plan.at(t);
        assert!((state.position_m[0] - at).abs() < 1e-15);
        assert!(state.velocity_m_s[0].abs() < 1e-15 && state.acceleration_m_s2[0].abs() < 1e-15);
    }
    // Far from the ends it is on the programmed path, and on time.
    for t in [0.5, 2.0] {
        let miss = plan.at(t).position_m[0] - plan.programmed_m(t)[0];
        assert!(miss.abs() < 1e-6, "{miss}");
    }
}

#[test]
fn an_oscillation_passes_no_corner_and_stays_within_the_limits() {
    let two = [limits(0.5, 8.0, 900.0), limits(0.4, 6.0, 700.0)];
    let program = [
        segment(&[0.03, 0.04], 0.02, 0.001, 3.0),
        segment(&[0.0, 0.0], 0.03, 0.0008, 4.0),
        segment(&[0.04, 0.0], 0.02, 0.001, 5.0),
    ];
    let plan = ExponentialSigmoid::plan(&[0.0, 0.0], &program, &two).unwrap();
    let places: Vec<&str> = plan.choices().iter().map(|choice| choice.place).collect();
    assert_eq!(places, ["start-up", "transition", "end", "start-up", "end"]);
    for (axis, limit) in two.iter().enumerate() {
        let found = peaks(&plan, axis, 400_000);
        for ((quantity, most), found) in limit.named().into_iter().zip(found) {
            assert!(found <= most * (1.0 + 1e-9), "axis {axis} {quantity}: {found} {most}");
        }
    }
    let ends = [2.5, 2.5 + 0.05 / 0.03];
    for k in 0..=100_000 {
        let t = plan.duration_s() * f64::from(k) / 100_000.0;
        let p = plan.at(t).position_m;
        if t < ends[1] {
            // Along the first line, in either direction.
            let along = 0.6 * p[0] + 0.8 * p[1];
            assert!(along <= 0.05 + 1e-15, "{t}: {along}");
            assert!((0.8 * p[0] - 0.6 * p[1]).abs() < 1e-15, "stays on the line");
        } else {
            assert!(p[0] <= 0.04 + 1e-15 && p[1].abs() < 1e-15);
        }
    }
    // The oscillation is present in the middle of the legs.
    let middle = (0..1000).map(|k| {
        let t = 1.0 + f64::from(k) * 1e-3;
        let p = plan.at(t).position_m;
        (0.6 * p[0] + 0.8 * p[1] - 0.02 * t).abs()
    });
    let amplitude = middle.fold(0.0, f64::max);
    assert!((amplitude / 0.001 - 1.0).abs() < 1e-2, "{amplitude}");
}

#[test]
fn there_can_be_two_intervals_of_alpha_and_the_larger_is_used() {
    let mut found_two = std::collections::BTreeSet::new();
    for i in 0..60 {
        let (f, a) = (0.5 + 0.1 * f64::from(i % 10), 6.0 + 1.5 * f64::from(i / 10));
        let plan = ExponentialSigmoid::plan(
            &[0.0],
            &[segment(&[3.0], 0.2, 0.3, f)],
            &[limits(10.0, a, 1e4)],
        );
        let Ok(plan) = plan else { continue };
        for choice in plan.choices() {
            assert_eq!(choice.alpha, choice.admissible.last().unwrap().to);
            for pair in choice.admissible.windows(2) {
                assert!(pair[0].to < pair[1].from);
            }
            if choice.admissible.len() > 1 {
                found_two.insert(choice.place);
            }
        }
    }
    assert_eq!(found_two.len(), 2, "at starts and at ends: {found_two:?}");
}

#[test]
fn what_cannot_be_is_refused_with_the_limit() {
    let plan = |feed: f64, amplitude: f64, length: f64| {
        ExponentialSigmoid::plan(
            &[0.0],
            &[segment(&[length], feed, amplitude, 5.0)],
            &[limits(0.1, 8.0, 900.0)],
        )
    };
    assert!(plan(0.05, 0.0, 0.1).is_ok());
    let fast = plan(0.09, 0.0, 0.1).unwrap_err();
    assert!(
        matches!(
            fast,
            TrajectoryError::Alpha { quantity: Quantity::Velocity, place: "start-up", .. }
        ),
        "{fast}"
    );
    println!("{fast}");
    let shaken = plan(0.05, 0.01, 0.1).unwrap_err();
    assert!(
        matches!(shaken, TrajectoryError::Programmed { quantity: Quantity::Velocity, .. }),
        "{shaken}"
    );
    println!("{shaken}");
    let hurried = plan(0.005, 0.0015, 0.002).unwrap_err();
    assert!(matches!(hurried, TrajectoryError::Hurried { .. }), "{hurried}");
    println!("{hurried}");
    for (feed, amplitude) in [(f64::NAN, 0.0), (0.0, 0.0), (0.05, -1.0), (0.05, f64::NAN)] {
        assert!(plan(feed, amplitude, 0.1).is_err());
    }
}

#[test]
fn a_peak_right_where_the_oscillation_opens_is_seen() {
    let two = [limits(0.4, 5.43, 16.391_266_494_879_485), limits(1.3, 5.54, 6.865_902_474_544_553)];
    let program = [
        segment(&[-0.102_785_110_738_629_05, 0.056_477_312_171_151_05], 0.019_286_6, 0.0, 1.0),
        segment(
            &[-0.037_880_758_822_929_11, -0.021_175_691_528_672_713],
            0.015_906_310_843_956_318,
            4.021_501_283_935_204_6e-5,
            1.305_710_164_878_690_8,
        ),
    ];
    let plan = ExponentialSigmoid::plan(&[0.0, 0.0], &program, &two).unwrap();
    let found = peaks(&plan, 1, 400_000)[2];
    assert!(found <= two[1].jerk_max_m_s3 * (1.0 + 1e-9), "{found}");
}

/// The ramped sinusoid of Section 2.3: slope 3, amplitude 0.15, "2 Hz" read as 2 rad/s, 10 s.
fn ramped_sinusoid(acceleration: f64) -> Result<ExponentialSigmoid, TrajectoryError> {
    let program = [segment(&[30.0], 3.0, 0.15, 2.0 / std::f64::consts::TAU)];
    let limit = limits(10.0, acceleration, 1e3 * acceleration);
    ExponentialSigmoid::plan(&[0.0], &program, &[limit])
}

#[test]
fn ends_that_reach_into_each_other_are_planned_together() {
    for acceleration in [4.0, 5.0, 7.0, 10.0, 20.0] {
        let plan = ramped_sinusoid(acceleration).unwrap();
        let start = plan.choices()[0].alpha;
        // The windows of the oscillation overlap: the start's is not fully open before the end's
        // begins to close.
        assert!(acceleration > 10.0 || (45.0 / start).sqrt() > 5.0, "{acceleration}: {start}");
        let found = peaks(&plan, 0, 400_000)[1];
        assert!(found <= acceleration * (1.0 + 1e-9), "{acceleration}: {found}");
        assert!(found >= acceleration * (1.0 - 1e-3), "no more is left than has to be: {found}");
        let nearly = plan.duration_s() * (1.0 - 1e-15);
        for (time_s, at) in [(0.0, 0.0), (nearly, 30.0)] {
            let state = plan.at(time_s);
            assert!((state.position_m[0] - at).abs() < 1e-13, "{state:?}");
            assert!(state.velocity_m_s[0].abs() < 1e-12, "{state:?}");
            assert!(state.acceleration_m_s2[0].abs() < 1e-10, "{state:?}");
        }
    }
}

#[test]
fn a_start_that_cannot_be_over_within_its_leg_is_refused() {
    // α T³ has to be 45 for the deviation to have decayed at the end: v α^(1/3) 3.1 = 3.3 m/s².
    let refusal = ramped_sinusoid(3.0).unwrap_err();
    println!("{refusal}");
    let TrajectoryError::Alpha { quantity, place, alpha, reached, .. } = refusal else {
        panic!("{refusal}")
    };
    assert_eq!((quantity, place), (Quantity::Acceleration, "start-up"));
    assert!((alpha - 0.045).abs() < 1e-6 && reached > 3.3, "{refusal}");
}

#[test]
fn no_alpha_is_above_the_one_wanted() {
    let program = [segment(&[0.3], 0.1, 0.0, 0.0), segment(&[0.0], 0.1, 0.0, 0.0)];
    let plan = |alpha_max: &AlphaMax| {
        ExponentialSigmoid::plan_below(&[0.0], &program, &[limits(1.0, 5.0, 400.0)], alpha_max)
    };
    let free = plan(&AlphaMax::default()).unwrap();
    let wanted = AlphaMax { start_up: 40.0, transition: 30.0, ..AlphaMax::default() };
    let found = plan(&wanted).unwrap();
    let alphas: Vec<f64> = found.choices().iter().map(|choice| choice.alpha).collect();
    assert_eq!(alphas, [40.0, 30.0, free.choices()[2].alpha]);
    assert_eq!(found.choices()[0].admissible.last().unwrap().to, 40.0);
    for bad in [0.1, -1.0, f64::NAN] {
        let refusal = plan(&AlphaMax { end: bad, ..wanted }).unwrap_err();
        assert!(matches!(refusal, TrajectoryError::AlphaMax { place: "end", .. }), "{refusal}");
        println!("{refusal}");
    }
}
