//! Promises of the gate for any sum of program and learned input: random commands, fixed cases.

use proptest::prelude::*;

use super::*;

const BOUNDS: Bounds = Bounds {
    limits: AxisLimits { velocity_max_m_s: 0.5, acceleration_max_m_s2: 8.0, jerk_max_m_s3: 1000.0 },
    position_min_m: -0.02,
    position_max_m: 0.08,
    dt_s: 0.001,
};
const FORCE: ForceSpec =
    ForceSpec { rated_n: 250.0, max_n: 400.0, mass_kg: 20.0, coulomb_n: 0.0, integral_time_s: 0.0 };

/// Commands that jump, hold and ramp, far beyond every limit.
fn wild(size: f64) -> impl Strategy<Value = Vec<f64>> {
    let piece = (1_usize..60, -size..size, -size..size).prop_map(move |(n, from, to)| {
        (0..n).map(|k| from + (to - from) * k as f64 / n as f64).collect::<Vec<f64>>()
    });
    prop::collection::vec(piece, 1..25).prop_map(|pieces| pieces.concat())
}

proptest! {
    #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

    #[test]
    fn no_position_command_leaves_the_limits_or_steps(wanted in wild(0.3), start_m in -0.02..0.08) {
        let mut gate = Gate::default();
        gate.begin(start_m);
        let mut last = [start_m; 3];
        let [mut before_m_s, mut before_m_s2] = [0.0; 2];
        for wanted_m in wanted {
            let at_m = gate.position_m(wanted_m, last, &BOUNDS);
            let velocity_m_s = (at_m - last[0]) / BOUNDS.dt_s;
            prop_assert!((-0.02..=0.08).contains(&at_m), "{at_m} m");
            prop_assert!(velocity_m_s.abs() <= 0.5 * (1.0 + 1e-6), "{velocity_m_s} m/s");
            let acceleration = (velocity_m_s - before_m_s) / BOUNDS.dt_s;
            prop_assert!(acceleration.abs() <= LEARNED_SHARE * 8.0 * 1.01, "{acceleration} m/s2");
            let jerk = (acceleration - before_m_s2) / BOUNDS.dt_s;
            let most = LEARNED_SHARE * LEARNED_JERK * 1000.0;
            prop_assert!(jerk.abs() <= most * 1.01, "{jerk} m/s3");
            last = [at_m, last[0], last[1]];
            (before_m_s, before_m_s2) = (velocity_m_s, acceleration);
        }
    }

    #[test]
    fn no_velocity_command_carries_an_axis_beyond_its_limits(
        wanted in wild(3.0), start_m in -0.02..0.08
    ) {
        let (mut at_m, mut last_m_s) = (start_m, 0.0);
        for wanted_m_s in wanted {
            let given_m_s = Gate::velocity_m_s(wanted_m_s, last_m_s, at_m, &BOUNDS);
            prop_assert!(given_m_s.abs() <= 0.5);
            let change = (given_m_s - last_m_s).abs() / BOUNDS.dt_s;
            prop_assert!(change <= LEARNED_SHARE * 8.0 * (1.0 + 1e-9), "{change} m/s2");
            at_m += given_m_s * BOUNDS.dt_s;
            prop_assert!((-0.02 - 1e-9..=0.08 + 1e-9).contains(&at_m), "{at_m} m");
            last_m_s = given_m_s;
        }
    }

    /// With a mass that the gate sees a cycle late, and that differs from the described one.
    #[test]
    fn no_force_drives_an_axis_too_fast_or_beyond_its_limits(
        wanted in wild(3000.0), start_m in 0.0..0.06, share in 0.8_f64..1.25
    ) {
        let (mut at_m, mut velocity_m_s, mut last_n) = (start_m, 0.0, 0.0_f64);
        let mut seen = [start_m, 0.0];
        for wanted_n in wanted {
            let given_n = Gate::force_n(wanted_n, last_n, seen, &FORCE, &BOUNDS);
            prop_assert!(given_n.abs() <= 400.0);
            prop_assert!((given_n - last_n).abs() <= 4.0 * 20.0 * 1000.0 * BOUNDS.dt_s * (1.0 + 1e-9));
            seen = [at_m, velocity_m_s];
            let acceleration = given_n / (share * FORCE.mass_kg);
            at_m += BOUNDS.dt_s * (velocity_m_s + 0.5 * BOUNDS.dt_s * acceleration);
            velocity_m_s += BOUNDS.dt_s * acceleration;
            last_n = given_n;
            prop_assert!(velocity_m_s.abs() <= 0.5 * 1.25, "{velocity_m_s} m/s");
            prop_assert!((-0.022..=0.082).contains(&at_m), "{at_m} m");
        }
    }
}
