//! Tests of the gantry as a machine that ages, heats up and is loaded: cogging, heat, payload, play.

use ilc_rt::config::SimulationChange;

use super::*;

fn change() -> SimulationChange {
    SimulationChange {
        after_s: 0.0,
        over_s: 0.0,
        axis: None,
        temperature_k: None,
        payload_kg: None,
        force_n: None,
        digital_inputs: None,
        torque_off: None,
    }
}

fn with(axis: AxisSimulation, simulation: &Simulation) -> Gantry {
    Gantry::new(&[axis], simulation)
}

fn hold(gantry: &mut Gantry, position_m: f64, seconds: f64) {
    for _ in 0..(seconds / STEP_S).round() as usize {
        gantry.step(&[Demand::Position { position_m, velocity_m_s: 0.0 }], STEP_S);
    }
}

#[test]
fn a_held_motor_carries_cogging_and_load() {
    // At rest at x, the motor's force is that of cogging and load, reversed.
    let simulation = Simulation {
        changes: vec![SimulationChange { force_n: Some(-7.0), ..change() }],
        ..Simulation::default()
    };
    let axis =
        AxisSimulation { cogging_n: 5.0, cogging_pitch_m: 0.032, ..AxisSimulation::default() };
    for x in [0.0, 0.004, 0.008, 0.02] {
        let mut gantry = with(axis, &simulation);
        hold(&mut gantry, x, 3.0);
        let wanted_n = 7.0 - 5.0 * (TAU * x / 0.032).sin();
        assert!((gantry.force_n(0) - wanted_n).abs() < 1e-3, "{x}: {}", gantry.force_n(0));
        assert!((gantry.encoder_m(0) - x).abs() < 1e-7);
    }
}

#[test]
fn viscous_friction_is_carried_at_speed() {
    let axis = AxisSimulation { viscous_n_s_m: 40.0, ..AxisSimulation::default() };
    let mut gantry = with(axis, &Simulation::default());
    for _ in 0..16_000 {
        gantry.step(&[Demand::Velocity { velocity_m_s: 0.25 }], STEP_S);
    }
    assert!((gantry.force_n(0) - 10.0).abs() < 1e-3, "{}", gantry.force_n(0));
}

/// Velocity after 0.1 s at the force limit of 100 N.
fn sprint(axis: AxisSimulation, simulation: &Simulation) -> f64 {
    let mut gantry = with(AxisSimulation { force_max_n: 100.0, ..axis }, simulation);
    for _ in 0..800 {
        gantry.step(&[Demand::Velocity { velocity_m_s: 50.0 }], STEP_S);
    }
    gantry.encoder_velocity_m_s(0)
}

#[test]
fn a_warm_motor_is_weaker_and_a_payload_slower() {
    let axis = AxisSimulation { resistance_per_k: 0.004, ..AxisSimulation::default() };
    let warm = Simulation { temperature_k: 343.15, ..Simulation::default() };
    let laden = Simulation {
        changes: vec![SimulationChange { payload_kg: Some(5.0), ..change() }],
        ..Simulation::default()
    };
    assert!((sprint(axis, &Simulation::default()) - 0.5).abs() < 1e-9);
    assert!((sprint(axis, &warm) - 0.5 / 1.2).abs() < 1e-9);
    assert!((sprint(axis, &laden) - 0.4).abs() < 1e-9);
}

#[test]
fn the_tool_grows_with_heat_and_the_encoder_does_not_see_it() {
    let axis = AxisSimulation {
        expansion_per_k: 12e-6,
        position_start_m: 0.1,
        ..AxisSimulation::default()
    };
    let warm = Simulation { temperature_k: 313.15, ..Simulation::default() };
    let mut gantry = with(axis, &warm);
    hold(&mut gantry, 0.1, 0.5);
    let seen_m = gantry.tool_m(0) - gantry.encoder_m(0);
    assert!((seen_m - 0.1 * 12e-6 * 20.0).abs() < 1e-12, "{seen_m}");
}

#[test]
fn a_tool_behind_backlash_lags_by_its_half() {
    let axis = AxisSimulation {
        mode_mass_kg: 5.0,
        mode_frequency_hz: 60.0,
        backlash_m: 2e-4,
        ..AxisSimulation::default()
    };
    let mut gantry = with(axis, &Simulation::default());
    // Pushed at constant velocity, the load lies against one side of the play.
    for _ in 0..16_000 {
        gantry.step(&[Demand::Velocity { velocity_m_s: 0.02 }], STEP_S);
    }
    assert!(gantry.deflection_m(0).abs() <= 1.02e-4, "{}", gantry.deflection_m(0));
    let plain = AxisSimulation { backlash_m: 0.0, ..axis };
    let mut stiff = with(plain, &Simulation::default());
    for _ in 0..16_000 {
        stiff.step(&[Demand::Velocity { velocity_m_s: 0.02 }], STEP_S);
    }
    assert!(stiff.deflection_m(0).abs() < 1e-6, "{}", stiff.deflection_m(0));
}

#[test]
fn bristles_let_a_held_axis_creep_where_stiction_does_not() {
    let sticky = AxisSimulation { coulomb_n: 15.0, static_n: 25.0, ..AxisSimulation::default() };
    let bristly =
        AxisSimulation { bristle_stiffness_n_m: 1e6, bristle_damping_n_s_m: 4e3, ..sticky };
    let moved = |axis: AxisSimulation| {
        let mut gantry = with(axis, &Simulation::default());
        // About 9 N: below the static friction.
        hold(&mut gantry, 5e-5, 0.01);
        gantry.encoder_m(0)
    };
    assert_eq!(moved(sticky), 0.0);
    let crept_m = moved(bristly);
    assert!((1e-6..2e-5).contains(&crept_m), "{crept_m}");
}
