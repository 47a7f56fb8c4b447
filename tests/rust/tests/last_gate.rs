//! Limits of every mode at the last gate: whatever a table of learned inputs holds, what is sent stays within
//! them, and does not step.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::{Cell, InputKind, mode};
use ilc_tests::rig::{Rig, Row};
use ilc_tests::{INPUTS, short};

/// The sum of program and learned input bends no more than a multiple of the jerk limit allows.
fn check_jerk(cell: &Cell, rig: &Rig) {
    // A set point within all other limits may bend more: a table begins with its own value.
    const LEARNED_SHARE: f64 = 4.0;
    const LEARNED_JERK: f64 = 8.0;
    let dt_s = cell.cycle_s();
    let line = rig.tap.line();
    let rows: Vec<_> = line.rows().collect();
    for (axis, spec) in cell.axes.iter().enumerate() {
        let most = LEARNED_JERK * spec.limits.jerk_max_m_s3;
        if spec.interface.targets_position() {
            let rounding = 4.0 / spec.counts_per_m / dt_s.powi(3);
            let held = |rows: &&[Row]| rows.iter().all(|row| row.controlword[axis] == 0x0F);
            for four in rows.windows(4).filter(held) {
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| f64::from(four[k].target_counts[axis]));
                let jerk = ((d - a) - 3.0 * (c - b)) / spec.counts_per_m / dt_s.powi(3);
                assert!(
                    jerk.abs() <= 1.01 * LEARNED_SHARE * most + rounding,
                    "{}: {jerk} m/s3",
                    cell.cell.name
                );
            }
        }
        if spec.input_kind() == InputKind::Velocity {
            for three in rig.samples.windows(3).filter(|three| three.iter().all(|s| s.at.is_some()))
            {
                let [a, b, c] = [0, 1, 2].map(|k| three[k].input[axis]);
                let jerk = (c - 2.0 * b + a) / (dt_s * dt_s);
                assert!(jerk.abs() <= 1.2 * most, "{}: {jerk} m/s3 learned", cell.cell.name);
            }
        }
    }
}

#[test]
fn an_absurd_table_is_bounded_and_never_steps() {
    for name in INPUTS {
        let cell = short(name);
        for wild in [1e300, 1.0] {
            let mut rig = Rig::new(&cell, 1);
            let n_samples = rig.n_samples;
            let table = (0..2 * n_samples).map(|i| if i / 2 % 7 < 3 { wild } else { -wild });
            rig.mail.send_table(1, table.collect()).unwrap();
            rig.tick_to_end();
            let most = mode::bound_of(cell.axes[0].input_kind(), &cell.learning);
            for pair in rig.samples.windows(2) {
                for axis in 0..2 {
                    let (a, b) = (pair[0].input[axis], pair[1].input[axis]);
                    let step_max = match cell.axes[axis].input_kind() {
                        InputKind::Position => 0.5 * cell.cycle_s(),
                        InputKind::Velocity => 8.0 * cell.cycle_s(),
                        InputKind::Torque => {
                            cell.axes[axis].force.unwrap().mass_kg * 1000.0 * cell.cycle_s()
                        }
                    };
                    assert!(b.abs() <= most && (b - a).abs() <= step_max * (1.0 + 1e-9));
                }
            }
            check_jerk(&cell, &rig);
            let line = rig.tap.line();
            let rows: Vec<_> = line.rows().collect();
            for (axis, spec) in cell.axes.iter().enumerate() {
                let limits = &spec.limits;
                if spec.interface.targets_torque() {
                    let force = spec.force.unwrap();
                    let max = force.max_n() / force.rated_n * 1e3;
                    assert!(
                        rows.iter().all(|row| f64::from(row.torque[axis]).abs() <= max),
                        "{name}"
                    );
                    let plant_m = line.plant_m(axis);
                    let top = plant_m.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
                    assert!(top <= 1.15 * limits.velocity_max_m_s * cell.cycle_s(), "{name} {top}");
                    continue;
                }
                let counts_max = match spec.interface.targeted() {
                    InputKind::Position => {
                        limits.velocity_max_m_s * cell.cycle_s() * spec.counts_per_m
                    }
                    InputKind::Velocity | InputKind::Torque => {
                        limits.velocity_max_m_s * spec.counts_per_m
                    }
                };
                for pair in rows.windows(2).filter(|pair| pair[0].controlword[axis] == 0x0F) {
                    let now = pair[1].target_counts[axis];
                    let moved = match spec.interface.targeted() {
                        InputKind::Position => now - pair[0].target_counts[axis],
                        InputKind::Velocity | InputKind::Torque => now,
                    };
                    assert!(f64::from(moved).abs() <= counts_max + 1.01, "{name} {moved}");
                }
            }
        }
    }
}
