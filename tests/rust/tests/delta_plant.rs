//! A campaign on the delta mechanism: three coupled axes, learned by each one's own model.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::{Axis, AxisUnit, Cell, SimulationChange, check};
use ilc_rt::record::EndStatus;
use ilc_sim::plant::{Delta, Demand, Plant as _};
use ilc_tests::campaign::run;
use ilc_tests::example;

fn rms_m(cell: &Cell, runs: u32) -> (Vec<f64>, Vec<String>) {
    let kept = run(cell, runs, None);
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    (kept.outcome.runs.iter().map(|(_, figures)| figures.tracking_rms_m).collect(), kept.digests)
}

#[test]
fn the_error_of_coupled_cranks_falls_and_repeats_bit_for_bit() {
    let cell = example("09_delta.toml");
    let (first, digests) = rms_m(&cell, 8);
    assert!(first[7] < 0.2 * first[0], "{first:?}");
    assert_eq!(rms_m(&cell, 8).1, digests);
}

/// Adds two more mechanisms, with the program of the first one.
fn three(mut cell: Cell) -> Cell {
    for number in 1..3_u8 {
        for axis in cell.axes.clone().into_iter().take(3) {
            let name = format!("{}{number}", axis.name);
            cell.axes.push(Axis { name, node: axis.node + 10 * number, ..axis });
        }
    }
    cell.program.start_m = cell.program.start_m.repeat(3);
    // Along a path that is longer by this.
    cell.program.feed_m_s *= 3.0_f64.sqrt();
    for segment in &mut cell.program.segments {
        segment.to_m = segment.to_m.repeat(3);
    }
    cell
}

#[test]
fn three_mechanisms_learn_beside_each_other() {
    let cell = three(example("09_delta.toml"));
    check(&cell).unwrap();
    let errors = |cell: &Cell| -> Vec<Vec<f64>> {
        let runs = run(cell, 4, None).outcome.runs;
        runs.into_iter().map(|(_, figures)| figures.axes_tracking_rms_m).collect()
    };
    let (all, alone) = (errors(&cell), errors(&example("09_delta.toml")));
    for (all, alone) in all.iter().zip(&alone) {
        assert_eq!(all.len(), 9);
        for (axis, error_rad) in all.iter().enumerate() {
            // Alike but for the noise of the encoders.
            assert!((error_rad / alone[axis % 3] - 1.0).abs() < 0.1, "axis {axis}: {error_rad}");
        }
    }
    assert!(all[3].iter().zip(&all[0]).all(|(last, first)| last < &(0.5 * first)), "{all:?}");
}

#[test]
fn a_crank_that_moves_alone_pulls_at_the_others() {
    let mut cell = example("09_delta.toml");
    // Only the first one moves.
    for segment in &mut cell.program.segments {
        segment.to_m[1..].fill(0.5);
    }
    for (segment, to_rad) in cell.program.segments.iter_mut().zip([0.9, 0.4, 0.7, 0.5]) {
        segment.to_m[0] = to_rad;
    }
    let others = |platform_kg: f64| {
        let mut cell = cell.clone();
        cell.simulation.delta.as_mut().unwrap().platform_kg = platform_kg;
        let kept = run(&cell, 1, None);
        let error = &kept.outcome.runs[0].1.axes_tracking_inf_m;
        assert!(error[0] > 0.01, "{error:?}");
        error[1].max(error[2])
    };
    let (coupled, apart) = (others(0.5), others(0.0));
    assert!(coupled > 1e-3 && coupled > 10.0 * apart, "{coupled} {apart} rad");
}

#[test]
fn a_payload_is_on_the_platform() {
    let mut cell = example("09_delta.toml");
    let delta = cell.simulation.delta.unwrap();
    let held = |cell: &Cell| {
        let mut plant = Delta::from_cell(cell, &delta, 0).unwrap();
        let hold = Demand::Position { position_m: 0.4, velocity_m_s: 0.0 };
        for _ in 0..8000 {
            plant.step(&[hold; 3], 250e-6);
        }
        plant.force_n(0)
    };
    let alone = held(&cell);
    cell.simulation.changes = vec![SimulationChange {
        after_s: 0.0,
        over_s: 0.0,
        axis: None,
        temperature_k: None,
        payload_kg: Some(0.5),
        force_n: None,
        digital_inputs: None,
        torque_off: None,
    }];
    check(&cell).unwrap();
    let laden = held(&cell);
    assert!(alone > 0.05 && (laden / alone - 2.0).abs() < 0.3, "{alone} {laden} N m");
}

#[test]
fn what_a_delta_does_not_have_is_refused() {
    let refused = |change: &dyn Fn(&mut Cell), says: &str| {
        let mut cell = example("09_delta.toml");
        change(&mut cell);
        let refusal = check(&cell).unwrap_err().to_string();
        assert!(refusal.contains(says), "{refusal}");
    };
    refused(
        &|cell| cell.axes[0].simulation.cogging_n = 1.0,
        "simulation.cogging_n = 1: 0 with [simulation.delta]",
    );
    refused(&|cell| cell.axes[1].unit = AxisUnit::M, "unit = m: \"rad\" with [simulation.delta]");
    refused(
        &|cell| cell.simulation.delta.as_mut().unwrap().rod_m = 0.02,
        "rod_m = 0.02: a mechanism that can move from position_start_m",
    );
    refused(&|cell| cell.simulation.delta.as_mut().unwrap().crank_m = -1.0, "crank_m");
}
