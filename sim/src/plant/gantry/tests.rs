//! Tests of the gantry against closed forms: second-order response, stiction, decay, energy,
//! determinism.

use super::*;

fn axis() -> AxisSimulation {
    AxisSimulation::default()
}

fn alone(axis: AxisSimulation) -> Gantry {
    Gantry::new(&[axis], &Simulation::default())
}

fn position(position_m: f64) -> [Demand; 1] {
    [Demand::Position { position_m, velocity_m_s: 0.0 }]
}

/// Step response of `w² / (s² + 2 d w s + w²)`.
fn second_order(t: f64, w: f64, d: f64) -> f64 {
    if d < 1.0 {
        let damped = w * (1.0 - d * d).sqrt();
        1.0 - (-d * w * t).exp() * ((damped * t).cos() + d * w / damped * (damped * t).sin())
    } else {
        1.0 - (-w * t).exp() * (1.0 + w * t)
    }
}

#[test]
fn an_ideal_axis_answers_a_step_as_the_second_order_model() {
    for damping in [0.5, 0.6, 1.0] {
        let mut gantry =
            alone(AxisSimulation { damping, integral_time_s: 1e9, force_max_n: 1e9, ..axis() });
        let w = TAU * 15.0;
        let mut worst = 0.0_f64;
        for n in 1..=4000_u32 {
            gantry.step(&position(0.01), STEP_S);
            // The drive samples: on average its force is delayed by half a step, which the model
            // omits.
            let wanted = 0.01 * second_order(f64::from(n) * STEP_S, w, damping);
            worst = worst.max((gantry.encoder_m(0) - wanted).abs());
        }
        assert!(worst < 0.01 * 0.01, "1 % of the step for damping {damping}, found {worst} m");
        assert!((gantry.encoder_m(0) - 0.01).abs() < 1e-9);
    }
}

#[test]
fn the_sampled_drive_approaches_the_model_with_the_step() {
    let worst = |dt: f64| {
        let mut gantry = alone(AxisSimulation { integral_time_s: 1e9, force_max_n: 1e9, ..axis() });
        let mut worst = 0.0_f64;
        for n in 1..=((0.1 / dt) as u32) {
            gantry.step(&position(1.0), dt);
            worst = worst.max(
                (gantry.encoder_m(0) - second_order(f64::from(n) * dt, TAU * 15.0, 1.0)).abs(),
            );
        }
        worst
    };
    let ratio = worst(125e-6) / worst(12.5e-6);
    assert!((8.0..12.0).contains(&ratio), "first order in the step: {ratio}");
}

#[test]
fn a_velocity_demand_settles_at_that_velocity() {
    let mut gantry = alone(AxisSimulation { coulomb_n: 15.0, static_n: 25.0, ..axis() });
    for _ in 0..16_000 {
        gantry.step(&[Demand::Velocity { velocity_m_s: 0.05 }], STEP_S);
    }
    assert!(
        (gantry.encoder_velocity_m_s(0) - 0.05).abs() < 1e-6,
        "the integral carries the friction"
    );
    assert!((gantry.force_n(0) - 15.0).abs() < 0.1);
}

#[test]
fn below_static_friction_nothing_moves_for_a_million_steps() {
    let mut gantry = alone(AxisSimulation {
        coulomb_n: 15.0,
        static_n: 25.0,
        integral_time_s: 1e12,
        position_start_m: 0.02,
        ..axis()
    });
    // Force = kv kp e = w0^2 m e: 24.9 N here.
    let error_m = 24.9 / (20.0 * (TAU * 15.0_f64).powi(2));
    for _ in 0..1_000_000 {
        gantry.step(&position(0.02 + error_m), STEP_S);
    }
    assert_eq!(gantry.encoder_m(0).to_bits(), 0.02_f64.to_bits());
    assert_eq!(gantry.encoder_velocity_m_s(0), 0.0);
    assert!((gantry.force_n(0) - 24.9).abs() < 1e-3, "{}", gantry.force_n(0));
    for _ in 0..100 {
        gantry.step(&position(0.02 + error_m * 1.01), STEP_S);
    }
    assert!(gantry.encoder_m(0) > 0.02, "25.1 N break it loose");
}

#[test]
fn a_sliding_axis_stops_where_friction_says_and_sticks() {
    // m v^2 / 2 = F s with plain Coulomb friction: 20 kg at 0.1 m/s against 10 N rest after 10 mm.
    let friction = Friction { coulomb_n: 10.0, static_n: 10.0, stribeck_m_s: 0.002 };
    let mechanics =
        Mechanics { carriage_kg: 20.0, mode_kg: 0.0, mode_rad_s: 1.0, mode_damping: 0.0 };
    let step = ExactStep::new(&mechanics, STEP_S);
    let mut z = [0.0, 0.1, 0.0, 0.0];
    let mut turned = false;
    for _ in 0..20_000 {
        z = friction.step(&step, &z, 0.0, 0.0);
        turned |= z[1] < 0.0;
    }
    assert!(!turned, "friction never reverses");
    assert_eq!(z[1], 0.0);
    assert!((z[0] - 0.01).abs() < 1e-6, "{}", z[0]);
}

#[test]
fn friction_never_adds_energy() {
    // A carriage whose mode rings hard enough to shake it loose, without motor force.
    let friction = Friction { coulomb_n: 60.0, static_n: 100.0, stribeck_m_s: 0.002 };
    let mechanics =
        Mechanics { carriage_kg: 120.0, mode_kg: 30.0, mode_rad_s: TAU * 20.0, mode_damping: 0.0 };
    let step = ExactStep::new(&mechanics, STEP_S);
    let energy = |z: &State| {
        let stiffness = 30.0 * (TAU * 20.0_f64).powi(2);
        0.5 * (120.0 * z[1] * z[1] + 30.0 * (z[1] + z[3]).powi(2) + stiffness * z[2] * z[2])
    };
    let mut z: State = [0.0, 0.0, 3e-3, 0.0];
    let first = energy(&z);
    let mut before = first;
    for _ in 0..40_000 {
        z = friction.step(&step, &z, 0.0, 0.0);
        let now = energy(&z);
        assert!(now <= before * (1.0 + 1e-12), "{before} J became {now} J");
        before = now;
    }
    // An undamped mode rings on at the amplitude that just does not break the carriage loose.
    let held = 0.5 * 100.0_f64.powi(2) / (30.0 * (TAU * 20.0_f64).powi(2));
    assert!((0.5 * held..1.1 * held).contains(&before), "{first} J fell to {before} J, not {held}");
}

#[test]
fn the_mode_decays_by_its_logarithmic_decrement_and_the_encoder_does_not_see_it() {
    let mut gantry = alone(AxisSimulation {
        mass_kg: 150.0,
        mode_mass_kg: 30.0,
        mode_damping: 0.1,
        position_start_m: 0.04,
        ..axis()
    });
    gantry.deflect(0, 1e-4);
    let mut peaks = Vec::new();
    let mut window = [0.0_f64; 3];
    for _ in 0..4000 {
        gantry.step(&[Demand::Off], STEP_S);
        let tool = gantry.tool_m(0) - 0.04;
        window = [window[1], window[2], tool];
        if window[1] > window[0] && window[1] >= window[2] && window[1] > 0.0 {
            peaks.push(window[1]);
        }
    }
    assert_eq!(gantry.encoder_m(0).to_bits(), 0.04_f64.to_bits(), "the brake holds");
    let wanted = TAU * 0.1 / (1.0_f64 - 0.01).sqrt();
    assert!(peaks.len() >= 6, "{peaks:?}");
    for pair in peaks.windows(2).take(5) {
        let decrement = (pair[0] / pair[1]).ln();
        assert!((decrement / wanted - 1.0).abs() < 0.01, "{decrement} against {wanted}");
    }
}

#[test]
fn the_tool_sees_the_wrong_angle_and_the_encoder_does_not() {
    let simulation = Simulation { orthogonality_rad: 0.0025, ..Simulation::default() };
    let first = AxisSimulation { position_start_m: 0.04, ..axis() };
    let second = AxisSimulation { position_start_m: 0.02, ..axis() };
    let gantry = Gantry::new(&[first, second, axis()], &simulation);
    assert_eq!(gantry.n_axes(), 3);
    assert!((gantry.tool_m(0) - (0.04 + 0.0025 * 0.02)).abs() < 1e-15);
    assert!((gantry.tool_m(1) - 0.02).abs() < 1e-15);
    assert!((gantry.encoder_m(0) - 0.04).abs() < 1e-15);
}

#[test]
fn off_brakes_a_moving_axis_and_holds_it() {
    let mut gantry = alone(axis());
    for _ in 0..4000 {
        gantry.step(&[Demand::Velocity { velocity_m_s: 0.1 }], STEP_S);
    }
    let mut steps = 0;
    while gantry.encoder_velocity_m_s(0) != 0.0 {
        gantry.step(&[], STEP_S);
        steps += 1;
        assert!(steps < 100, "2000 N stop 20 kg at 0.1 m/s in 1 ms");
    }
    let rest = gantry.encoder_m(0);
    for _ in 0..1000 {
        gantry.step(&[Demand::Off], STEP_S);
    }
    assert_eq!(gantry.encoder_m(0).to_bits(), rest.to_bits());
    assert_eq!(gantry.force_n(0), 0.0);
}

#[test]
fn the_force_limit_does_not_wind_the_integral_up() {
    let mut gantry = alone(AxisSimulation { force_max_n: 20.0, integral_time_s: 0.1, ..axis() });
    let mut highest = 0.0_f64;
    for _ in 0..40_000 {
        gantry.step(&position(0.05), STEP_S);
        assert!(gantry.force_n(0).abs() <= 20.0);
        highest = highest.max(gantry.encoder_m(0));
    }
    assert!((gantry.encoder_m(0) - 0.05).abs() < 1e-6);
    // 1 m/s2 of acceleration against a loop of 15 Hz must overshoot, but not without bound.
    assert!(highest < 0.1, "{highest}");
}

#[test]
fn a_demand_that_is_not_a_number_gives_no_force() {
    let mut gantry = alone(axis());
    gantry.step(&position(f64::NAN), STEP_S);
    assert_eq!(gantry.force_n(0), 0.0);
    gantry.step(&position(0.001), STEP_S);
    assert!(gantry.force_n(0) > 0.0 && gantry.encoder_m(0).is_finite());
}

#[test]
fn the_same_inputs_give_the_same_bits_and_another_seed_does_not() {
    let run = |seed: u64| {
        let simulation = Simulation {
            encoder_noise_m: 1e-7,
            seed,
            orthogonality_rad: 1e-3,
            ..Simulation::default()
        };
        let noisy = AxisSimulation { coulomb_n: 15.0, static_n: 25.0, mode_mass_kg: 3.0, ..axis() };
        let mut gantry = Gantry::new(&[noisy, noisy], &simulation);
        let mut bits = Vec::new();
        for n in 0..5000_u32 {
            let target = 0.01 * (f64::from(n) * 1e-3).sin();
            let demand = Demand::Position { position_m: target, velocity_m_s: 0.0 };
            gantry.step(&[demand, demand], STEP_S);
            bits.extend([gantry.encoder_m(0).to_bits(), gantry.tool_m(0).to_bits()]);
        }
        bits
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_step_of_two_axes_is_quick() {
    let heavy = AxisSimulation {
        mass_kg: 150.0,
        mode_mass_kg: 30.0,
        coulomb_n: 60.0,
        static_n: 100.0,
        ..axis()
    };
    let mut gantry = Gantry::new(&[heavy, heavy], &Simulation::default());
    let n_steps = 200_000;
    let start = std::time::Instant::now();
    for n in 0..n_steps {
        let target = 1e-3 * (f64::from(n % 1000) * 1e-3);
        let demand = Demand::Position { position_m: target, velocity_m_s: 0.0 };
        gantry.step(&[demand, demand], STEP_S);
    }
    let per_step = start.elapsed().as_secs_f64() / f64::from(n_steps);
    println!("{:.0} ns a step of two axes, tool at {}", per_step * 1e9, gantry.tool_m(0));
    assert!(per_step < 2e-6, "{per_step} s: over ten times what an idle machine takes");
}
