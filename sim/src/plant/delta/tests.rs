//! The mechanism against conservation laws and an independent potential.

use super::*;

const DT_S: f64 = 125e-6;
const START_RAD: Vector = [0.3, 0.5, 0.7];

const PLAIN: DeltaSimulation = DeltaSimulation {
    base_m: 0.037,
    crank_m: 0.060,
    rod_m: 0.145,
    crank_kg_m2: 0.002,
    platform_kg: 0.5,
    gravity_m_s2: 9.81,
};

/// Returns a mechanism without friction.
fn free(description: DeltaSimulation) -> Delta {
    let crank = Crank {
        drive: DriveLoop::tuned(0.004, TAU * 15.0, 1.0, 0.1, 20.0),
        friction: Friction { coulomb_n: 0.0, static_n: 0.0, stribeck_m_s: 0.01 },
        viscous_n_s_m: 0.0,
        force_max_n: 20.0,
        integral_n: 0.0,
        feedforward_n: 0.0,
        force_n: 0.0,
        noise_rad: 0.0,
    };
    let mechanism =
        kinematics::Delta::new(description.base_m, description.crank_m, description.rod_m).unwrap();
    Delta {
        tool_m: mechanism.forward(START_RAD).unwrap(),
        mechanism,
        description,
        cranks: [crank; LEGS],
        angle_rad: START_RAD,
        rate_rad_s: [0.0; LEGS],
        noise_m: 0.0,
        noise: Noise::new(1),
        environment: Environment::new(&ilc_rt::config::Simulation::default(), &["a", "b", "c"]),
    }
}

/// Moves the mechanism on without motors, brakes and friction.
fn coast(delta: &mut Delta, n_steps: usize, dt_s: f64) {
    for _ in 0..n_steps {
        let rates = delta.rates_after(&[0.0; LEGS], [false; LEGS], dt_s).unwrap();
        for (angle_rad, rate) in delta.angle_rad.iter_mut().zip(rates) {
            *angle_rad += rate * dt_s;
        }
        delta.rate_rad_s = rates;
    }
}

/// Energy of platform and cranks, from the position of the tool alone.
fn energy(delta: &Delta) -> f64 {
    let at = |sign: f64| {
        let moved =
            std::array::from_fn(|leg| delta.angle_rad[leg] + sign * 1e-6 * delta.rate_rad_s[leg]);
        delta.mechanism.forward(moved).unwrap()
    };
    let (after, before) = (at(1.0), at(-1.0));
    let platform: f64 = (0..LEGS).map(|axis| ((after[axis] - before[axis]) / 2e-6).powi(2)).sum();
    let cranks: f64 = delta.rate_rad_s.iter().map(|rate| rate * rate).sum();
    let DeltaSimulation { platform_kg, crank_kg_m2, gravity_m_s2, .. } = delta.description;
    let height_m = delta.mechanism.forward(delta.angle_rad).unwrap()[2];
    0.5 * platform_kg * platform
        + 0.5 * crank_kg_m2 * cranks
        + platform_kg * gravity_m_s2 * height_m
}

#[test]
fn energy_is_conserved_without_friction_and_motors() {
    let mut drifts = Vec::new();
    for (n_steps, dt_s) in [(320, DT_S), (1280, DT_S / 4.0)] {
        let mut delta = free(PLAIN);
        delta.rate_rad_s = [2.0, -1.0, 0.5];
        let before = energy(&delta);
        let kinetic = before - 0.5 * 9.81 * delta.tool_m[2];
        coast(&mut delta, n_steps, dt_s);
        assert!(delta.rate_rad_s[0] < 1.0, "gravity has changed its motion");
        drifts.push((energy(&delta) - before).abs() / kinetic);
    }
    // Of first order in the step.
    assert!(drifts[0] < 0.05 && drifts[1] < 0.3 * drifts[0], "{drifts:?}");
}

#[test]
fn gravity_is_the_gradient_of_the_height_of_the_platform() {
    let mut delta = free(PLAIN);
    let (_, torque) = delta.dynamics(&START_RAD, &[0.0; LEGS]).unwrap();
    for leg in 0..LEGS {
        let height = |sign: f64| {
            let mut moved = START_RAD;
            moved[leg] += sign * 1e-6;
            delta.mechanism.forward(moved).unwrap()[2]
        };
        let expected = 0.5 * 9.81 * (height(1.0) - height(-1.0)) / 2e-6;
        assert!((torque[leg] - expected).abs() < 1e-6, "{leg}: {} {expected}", torque[leg]);
    }
}

#[test]
fn a_push_at_one_crank_moves_the_others_through_the_platform() {
    let weightless = DeltaSimulation { gravity_m_s2: 0.0, ..PLAIN };
    let mut delta = free(weightless);
    let rates = delta.rates_after(&[1.0, 0.0, 0.0], [false; LEGS], DT_S).unwrap();
    assert!(rates[0] > 0.0 && rates[1].abs() > 0.01 * rates[0] && rates[2].abs() > 0.01 * rates[0]);
    let mut apart = free(DeltaSimulation { platform_kg: 0.0, ..weightless });
    let alone = apart.rates_after(&[1.0, 0.0, 0.0], [false; LEGS], DT_S).unwrap();
    assert!((alone[0] - DT_S / 0.002).abs() < 1e-12 && alone[1] == 0.0 && alone[2] == 0.0);
    assert!(rates[0] < alone[0], "the platform is heavy");
}

#[test]
fn brakes_hold_and_friction_holds_what_it_can() {
    let mut delta = free(PLAIN);
    for _ in 0..2000 {
        delta.step(&[Demand::Off; LEGS], DT_S);
    }
    assert_eq!((delta.angle_rad, delta.rate_rad_s), (START_RAD, [0.0; LEGS]));
    // One crank driven, two braked: only that one moves.
    let target = Demand::Position { position_m: 0.4, velocity_m_s: 0.0 };
    for _ in 0..8000 {
        delta.step(&[target, Demand::Off, Demand::Off], DT_S);
    }
    assert_eq!(delta.angle_rad[1..], START_RAD[1..]);
    assert!((delta.angle_rad[0] - 0.4).abs() < 1e-3, "{:?}", delta.angle_rad);
    // Friction above the weight holds without a brake; below it does not.
    for (static_n, holds) in [(5.0, true), (0.001, false)] {
        let mut delta = free(PLAIN);
        for crank in &mut delta.cranks {
            (crank.friction.coulomb_n, crank.friction.static_n) = (static_n, static_n);
        }
        for _ in 0..400 {
            delta.rate_rad_s = delta.rates_after(&[0.0; LEGS], [false; LEGS], DT_S).unwrap();
        }
        assert_eq!(delta.rate_rad_s == [0.0; LEGS], holds, "{:?}", delta.rate_rad_s);
    }
}

#[test]
fn it_stands_where_it_cannot_close() {
    let mut delta = free(DeltaSimulation { gravity_m_s2: 0.0, ..PLAIN });
    let out = Demand::Velocity { velocity_m_s: -30.0 };
    for _ in 0..20_000 {
        delta.step(&[out; LEGS], DT_S);
        assert!(delta.angle_rad.iter().all(|angle| angle.is_finite()));
        assert!(delta.mechanism.jacobian(delta.angle_rad).is_ok());
    }
}
