//! Learned inputs of every quantity that a mode has: each example cell learns, its model tells the
//! error of the first run, and its commands carry the input where it belongs.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::{Cell, InputKind, Mode, mode};
use ilc_rt::design::{self, Plan};
use ilc_rt::record::EndStatus;
use ilc_rt::servo::PhaseName;
use ilc_tests::campaign::run;
use ilc_tests::rig::Rig;
use ilc_tests::{INPUTS, MODES, example, example_text, short};

/// Example, mode, quantity, and the share of the contour error that ten runs take away.
const CELLS: [(&str, Mode, InputKind, f64); 4] = [
    ("10_cst.toml", Mode::Cst, InputKind::Torque, 0.8),
    ("11_csp_torque.toml", Mode::Csp, InputKind::Torque, 0.7),
    ("12_csp_velocity.toml", Mode::Csp, InputKind::Velocity, 0.8),
    ("13_csv_torque.toml", Mode::Csv, InputKind::Torque, 0.7),
];

#[test]
fn every_mode_has_an_example_with_each_of_its_inputs() {
    let kind = |name: &str| {
        let axis = &example(name).axes[0];
        (axis.interface, axis.input_kind())
    };
    let (modes, inputs) = (MODES.map(kind), INPUTS.map(kind));
    for mode in Mode::ALL {
        assert!(modes.contains(&(mode, mode.targeted())), "{mode}: no example in MODES");
        for input in mode.inputs() {
            let name = input.name();
            assert!(inputs.contains(&(mode, *input)), "{mode}, {name}: no example in INPUTS");
        }
    }
}

#[test]
fn every_input_learns() {
    for (name, interface, input, fall) in CELLS {
        let cell = example(name);
        assert_eq!((cell.axes[0].interface, cell.axes[0].input_kind()), (interface, input));
        let kept = run(&cell, 10, None);
        let microns: Vec<String> =
            kept.contour_m().iter().map(|contour| format!("{:.0}", contour * 1e6)).collect();
        println!("{name}: contour um: {}", microns.join(" "));
        assert_eq!(kept.outcome.status, EndStatus::Completed, "{name}: {}", kept.outcome.reason);
        assert!(kept.contour_fall(9) >= fall, "{name}: {}", microns.join(" "));
        assert!(kept.outcome.runs.iter().all(|(_, figures)| !figures.rolled_back), "{name}");
    }
}

#[test]
fn two_campaigns_of_every_input_are_the_same_bit_by_bit() {
    for (name, ..) in CELLS {
        let cell = example(name);
        assert_eq!(run(&cell, 2, None).digests, run(&cell, 2, None).digests, "{name}");
    }
}

/// Without friction and without the mode the model is the plant, but for sampling and quantisation.
fn linear(name: &str) -> Cell {
    let mut cell = example(name);
    for axis in &mut cell.axes {
        let simulation = &mut axis.simulation;
        (simulation.coulomb_n, simulation.static_n, simulation.mode_mass_kg) = (0.0, 0.0, 0.0);
        if let Some(force) = &mut axis.force {
            force.coulomb_n = 0.0;
            simulation.integral_time_s = force.integral_time_s.unwrap_or(1e3);
        } else {
            simulation.integral_time_s = 1e3;
        }
        axis.model.as_mut().unwrap().delay_samples = 1;
    }
    cell.simulation.orthogonality_rad = 0.0;
    cell
}

/// A pulse of the learned input moves the simulated axis as the nominal model says.
#[test]
fn the_model_of_every_input_is_that_of_the_simulated_axis() {
    for (name, _, input, _) in CELLS {
        let cell = linear(name);
        let size = match input {
            InputKind::Position => 1e-3,
            InputKind::Velocity => 0.02,
            InputKind::Torque => 30.0,
        };
        let moved = |size: f64| -> Vec<f64> {
            let mut rig = Rig::new(&cell, 1);
            let n_samples = rig.n_samples;
            rig.mail.send_table(1, pulse(n_samples, size)).unwrap();
            rig.tick_until(|rig| !rig.ended.is_empty());
            let run = rig.samples.iter().filter(|sample| sample.at.is_some());
            run.map(|sample| sample.encoder_m[1]).collect()
        };
        let (with, without) = (moved(size), moved(0.0));
        let found: Vec<f64> =
            with.iter().zip(&without).map(|(with, without)| with - without).collect();
        let model = mode::learned_model(&cell.axes[1], cell.cycle_s()).unwrap();
        let input: Vec<f64> = pulse(with.len(), size).iter().skip(1).step_by(2).copied().collect();
        let expected = model.simulate(&input, None).unwrap();
        let largest = expected.iter().fold(0.0_f64, |max, y| max.max(y.abs()));
        let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{name}: {worst} of {largest} m");
        assert!(largest > 1e-5 && worst < 0.1 * largest, "{name}: {worst} of {largest} m");
    }
}

/// A raised cosine on axis 1, a second after the start of the run.
fn pulse(n_samples: usize, size: f64) -> Box<[f64]> {
    (0..2 * n_samples)
        .map(|i| {
            let turn = ((i / 2) as f64 - 200.0) / 300.0;
            let inside = i % 2 == 1 && (0.0..1.0).contains(&turn);
            if inside { 0.5 * size * (1.0 - (turn * std::f64::consts::TAU).cos()) } else { 0.0 }
        })
        .collect()
}

#[test]
fn the_first_error_is_predicted_with_its_feed_forwards() {
    for name in ["10_cst.toml", "12_csp_velocity.toml", "13_csv_torque.toml"] {
        let cell = linear(name);
        let mut rig = Rig::new(&cell, 1);
        rig.tick_until(|rig| !rig.ended.is_empty());
        let run: Vec<_> = rig.samples.iter().filter(|sample| sample.at.is_some()).collect();
        let reference: Vec<f64> =
            run.iter().flat_map(|sample| sample.reference_m[..2].to_vec()).collect();
        let expected = design::first_error(&cell, &reference).unwrap();
        let largest = expected.iter().fold(0.0_f64, |max, e| max.max(e.abs()));
        let mut worst = 0.0_f64;
        for (sample, expected) in run.iter().zip(expected.chunks_exact(2)) {
            let error = sample.reference_m[1] - sample.encoder_m[1];
            worst = worst.max((error - expected[1]).abs());
        }
        println!("{name}: {worst} of {largest} m");
        assert!(worst < 0.25 * largest + 2e-5, "{name}: {worst} of {largest} m");
    }
}

/// An axis that gets its force for the first time does not move: reference, integral and force are 0.
#[test]
fn torque_control_begins_without_a_bump() {
    let mut rig = Rig::new(&short("10_cst.toml"), 1);
    rig.tick_until(|rig| rig.phase.0 == PhaseName::Returning);
    let line = rig.tap.line();
    for axis in 0..2 {
        let plant_m = line.plant_m(axis);
        let moved = plant_m.iter().map(|m| (m - plant_m[0]).abs()).fold(0.0, f64::max);
        assert!(moved <= 1e-9, "axis {axis} moved {moved} m while its drive was enabled");
        assert!(line.rows().all(|row| row.torque[axis] == 0));
    }
}

/// An integral cancels a steady torque: an axis that lags behind the program cannot learn that, and says so.
#[test]
fn a_torque_that_works_against_a_lag_is_refused_with_what_removes_it() {
    let refusal = |name: &str, changes: &[(&str, &str)]| {
        let mut text = example_text(name);
        for (from, to) in changes {
            assert!(text.contains(from), "{name} {from}");
            text = text.replace(from, to);
        }
        let cell = Cell::parse(&text, "cell.toml").unwrap();
        let plan = Plan::new(&cell, None, true).unwrap();
        plan.law(&cell).err().map(|error| error.to_string())
    };
    for (name, changes, lag, lead) in [
        // 2 d / w0, and a cycle.
        (
            "11_csp_torque.toml",
            &[("velocity = 1.0", "velocity = 0.0"), ("lead_s = 0.002", "lead_s = 0.0")][..],
            "23.2",
            "lead_s = 0.0020",
        ),
        ("11_csp_torque.toml", &[("lead_s = 0.002", "lead_s = 0.0")], "2.0", "lead_s = 0.0020"),
        (
            "13_csv_torque.toml",
            &[("velocity_feedforward = 1.0", "velocity_feedforward = 0.0")],
            "21.2",
            "lead_s = -0.0010",
        ),
    ] {
        let line = refusal(name, changes).unwrap();
        for part in ["[learning] input_max_n = ", "axis x", &format!("is {lag}"), lead] {
            assert!(line.contains(part), "{part:?} in {line}");
        }
        assert!(!line.contains('\n'), "{line}");
        assert_eq!(refusal(name, &[]), None);
    }
}

#[test]
fn what_contradicts_a_mode_is_refused_in_one_line() {
    let cases = [
        (
            "10_cst.toml",
            "interface = \"cst\"",
            "interface = \"cst\"\ninput = \"velocity\"",
            "input",
        ),
        (
            "10_cst.toml",
            "[axis.cascade]",
            "[axis.position_loop]\ngain_per_s = 1.0\n[axis.cascade]",
            "position_loop",
        ),
        ("11_csp_torque.toml", "rated_n = 1500.0", "rated_n = 0.0", "rated_n"),
        (
            "11_csp_torque.toml",
            "mass_kg = 150.0\nintegral",
            "mass_kg = 150.0\nmax_n = 1e6\nintegral",
            "force.max_n",
        ),
        (
            "01_gantry.toml",
            "[axis.limits]",
            "[axis.feedforward]\nacceleration = 1.0\n[axis.limits]",
            "force",
        ),
        (
            "01_gantry.toml",
            "[axis.limits]",
            "[axis.cascade]\nposition_gain_per_s = 1.0\nvelocity_gain_n_s_m = 1.0\n[axis.limits]",
            "cascade",
        ),
        (
            "02_parallel.toml",
            "[axis.limits]",
            "[axis.feedforward]\nvelocity = 1.0\n[axis.limits]",
            "feedforward.velocity",
        ),
        (
            "02_parallel.toml",
            "interface = \"csv\"\n",
            "interface = \"csv\"\ninput = \"position\"\n",
            "input",
        ),
    ];
    for (name, from, to, key) in cases {
        let text = example_text(name);
        assert!(text.contains(from), "{name} {from}");
        let refused =
            Cell::parse(&text.replacen(from, to, 1), "cell.toml").unwrap_err().to_string();
        assert!(refused.contains(key) && !refused.contains('\n'), "{refused}");
    }
}
