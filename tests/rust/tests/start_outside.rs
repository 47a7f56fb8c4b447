//! An axis outside its limits when its drive is enabled is refused, and nothing moves; limits are
//! kept by braking ahead of them, never by a jump.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::campaign;
use ilc_rt::config::{Cell, InputKind};
use ilc_rt::record::EndStatus;
use ilc_rt::servo::{PhaseName, StopReason};
use ilc_tests::campaign::{in_process, options};
use ilc_tests::rig::Rig;
use ilc_tests::{MODES, Scratch, example_text, short};

/// Returns the short cell with an axis at a given position.
fn standing(name: &str, axis: usize, start_m: f64) -> Cell {
    let mut cell = short(name);
    cell.axes[axis].simulation.position_start_m = start_m;
    cell
}

#[test]
fn an_axis_outside_its_limits_is_refused_and_nothing_moves() {
    for name in MODES {
        for (axis, start_m) in [(0, 0.15), (1, 0.15), (0, -0.3), (1, -0.021), (1, 20.0)] {
            for lockstep in [true, false] {
                let cell = standing(name, axis, start_m);
                let mut rig = if lockstep { Rig::new(&cell, 2) } else { Rig::on_clock(&cell, 2) };
                rig.tick_to_end();
                let Some(StopReason::OutsideLimits { axis: told, position_m }) = rig.reason else {
                    panic!("{name} {axis} {start_m}: {:?}", rig.reason);
                };
                assert_eq!(told, axis);
                assert!((position_m - start_m).abs() < 1e-8);
                let line = rig.tap.line();
                for number in 0..2 {
                    let plant_m = line.plant_m(number);
                    assert!(plant_m.iter().all(|m| m.to_bits() == plant_m[0].to_bits()));
                    // Neither drive was enabled, nor commanded to a position other than its own.
                    let spec = &cell.axes[number];
                    #[expect(clippy::cast_possible_truncation, reason = "a place in counts")]
                    let at = (plant_m[0] * spec.counts_per_m).round() as i32;
                    for row in line.rows() {
                        assert_eq!(row.controlword[number] & 0x0F, 0, "{name}");
                        let target = row.target_counts[number];
                        match spec.interface.targeted() {
                            InputKind::Position => assert!(target == at || target == 0, "{target}"),
                            InputKind::Velocity => assert_eq!(target, 0),
                            InputKind::Torque => assert_eq!(row.torque[number], 0),
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn the_refusal_is_one_sentence_with_place_and_limits() {
    for (unit, reason) in [
        ("m", "axis y is at 0.15 m, outside -0.02 to 0.1 m"),
        ("rad", "axis y is at 0.15 rad, outside -0.02 to 0.1 rad"),
    ] {
        let mut cell = standing(MODES[0], 1, 0.15);
        if unit == "rad" {
            cell.axes[1].unit = ilc_rt::config::AxisUnit::Rad;
        }
        let scratch = Scratch::new();
        let options = options(scratch.file("library.db"), 2);
        let outcome = campaign::run(&cell, &options, in_process(&cell), None, &mut |_| {}).unwrap();
        assert_eq!(outcome.status, EndStatus::Fault);
        assert!(outcome.reason.starts_with(reason), "{}", outcome.reason);
        assert!(outcome.runs.is_empty());
    }
}

#[test]
fn an_axis_at_its_limit_or_a_little_beyond_is_brought_back_gently() {
    for name in MODES {
        for start_m in [0.1, 0.1 + 1e-4, -0.02, -0.02 - 1e-4] {
            let cell = standing(name, 0, start_m);
            let mut rig = Rig::new(&cell, 1);
            rig.tick_until(|rig| rig.phase.0 == PhaseName::Running);
            assert_eq!(rig.reason, None);
            let dt_s = cell.cycle_s();
            let plant_m = rig.tap.line().plant_m(0);
            let inside = plant_m[plant_m.len() - 1];
            assert!(inside < 0.1 && inside > -0.02);
            // Never faster than a jerk-limited return.
            for triple in plant_m.windows(3) {
                let a = (triple[2] - 2.0 * triple[1] + triple[0]) / (dt_s * dt_s);
                assert!(a.abs() < 2.0 * cell.axes[0].limits.acceleration_max_m_s2, "{name} {a}");
            }
        }
    }
}

#[test]
fn a_start_that_is_no_number_is_refused_where_it_is_written() {
    for bad in ["nan", "inf", "-inf", "1e9"] {
        let text = example_text(MODES[0]).replacen(
            "position_start_m = 0.04",
            &format!("position_start_m = {bad}"),
            1,
        );
        let refused = Cell::parse(&text, "cell.toml").unwrap_err().to_string();
        assert!(refused.contains("position_start_m"), "{refused}");
    }
}

/// A learned input that pushes an axis beyond its limit is held there without a jump, and released
/// without one.
#[test]
fn a_sum_beyond_the_limits_brakes_ahead_of_them() {
    for name in MODES {
        let mut cell = short(name);
        // The program goes to 80 mm; the limit lies where the learned input exceeds it.
        cell.axes[0].limits.position_max_m = 0.0805;
        (cell.learning.input_max_m, cell.learning.input_max_m_s) = (0.005, 0.05);
        let mut rig = Rig::new(&cell, 1);
        let n_samples = rig.n_samples;
        let size = match cell.axes[0].interface.targeted() {
            InputKind::Position => 0.004,
            InputKind::Velocity => 0.05,
            InputKind::Torque => 190.0,
        };
        let table = (0..2 * n_samples).map(|i| {
            let turn = (i / 2) as f64 / n_samples as f64 * std::f64::consts::TAU;
            if i % 2 == 0 { size * 0.5 * (1.0 - turn.cos()) } else { 0.0 }
        });
        rig.mail.send_table(1, table.collect()).unwrap();
        rig.tick_to_end();
        assert_eq!(rig.reason, None, "{name}");
        let line = rig.tap.line();
        let (spec, dt_s) = (&cell.axes[0], cell.cycle_s());
        let plant_m = line.plant_m(0);
        let farthest = plant_m.iter().fold(f64::MIN, |most, m| most.max(*m));
        assert!(farthest <= 0.0805 + 2e-4, "{name}: {farthest}");
        if spec.interface.targets_position() {
            let target: Vec<f64> = line
                .rows()
                .filter(|row| row.controlword[0] == 0x0F)
                .map(|row| f64::from(row.target_counts[0]) / spec.counts_per_m)
                .collect();
            let top = target.iter().fold(f64::MIN, |most, m| most.max(*m));
            assert!(top <= 0.0805 + 1e-8 && top > 0.0804, "{name}: the limit was not met: {top}");
            for triple in target[3..].windows(3) {
                let a = (triple[2] - 2.0 * triple[1] + triple[0]) / (dt_s * dt_s);
                let most = 1.3 * spec.limits.acceleration_max_m_s2 + 0.1;
                assert!(a.abs() <= most, "{name}: {a} m/s2");
            }
        }
    }
}
