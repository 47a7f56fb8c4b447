//! Programs as tables of set points, in a cell of nine rotary axes: run, learned and refused.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fmt::Write as _;

use ilc_rt::config::Cell;
use ilc_rt::design::Plan;
use ilc_rt::record::EndStatus;
use ilc_tests::Scratch;
use ilc_tests::campaign::run;

const N_AXES: usize = 9;

/// Nine rotary drives, `a1` to `a9`, on a bus.
fn cell_text(bus: &str, cycle_us: u32, jerk_max: f64) -> String {
    let mut text =
        format!("[cell]\nname = \"nine\"\ncycle_us = {cycle_us}\n[bus]\naddress = \"{bus}\"\n");
    for axis in 1..=N_AXES {
        writeln!(
            text,
            "[[axis]]\nname = \"a{axis}\"\nnode = {axis}\ninterface = \"csp\"\nunit = \"rad\"\n\
             counts_per_m = 1e6\n[axis.limits]\nposition_min_m = -1.0\nposition_max_m = 1.0\n\
             velocity_max_m_s = 4.0\nacceleration_max_m_s2 = 100.0\njerk_max_m_s3 = {jerk_max}\n\
             following_error_max_m = 0.5\n[axis.model]\nnatural_frequency_hz = 6.0\ndamping = 0.6\n\
             delay_samples = 1\n[axis.simulation]\nmass_kg = 0.002\nnatural_frequency_hz = 6.0\n\
             damping = 0.6\nforce_max_n = 5.0"
        )
        .unwrap();
    }
    text + "[program]\nkind = \"table\"\nfile = \"points.csv\"\nfeed_m_s = 0.5\n\
            start_m = [0, 0, 0, 0, 0, 0, 0, 0, 0]\n[learning]\nmeasure = \"encoder\"\n\
            input_max_m = 0.5\n[learning.norm_optimal]\nrate = 0.5\n"
}

/// Each axis moves to its own number times 0.02 rad and back, along a squared raised cosine.
fn points() -> String {
    let mut text = String::from("# a move of its own for each\n");
    let names: Vec<String> = (1..=N_AXES).map(|axis| format!("a{axis}")).collect();
    text.push_str(&(names.join(",") + "\n"));
    for k in 0..=160_u32 {
        let share = (0.5 * (1.0 - (std::f64::consts::TAU * f64::from(k) / 160.0).cos())).powi(2);
        let row: Vec<String> =
            (1..=N_AXES).map(|axis| (0.02 * axis as f64 * share).to_string()).collect();
        text.push_str(&(row.join(",") + "\n"));
    }
    text
}

fn load(folder: &Scratch, cell: &str, points: &str) -> Cell {
    std::fs::write(folder.file("cell.toml"), cell).unwrap();
    std::fs::write(folder.file("points.csv"), points).unwrap();
    Cell::load(&folder.file("cell.toml")).unwrap()
}

fn refusal(cell: &str, points: &str) -> String {
    let folder = Scratch::new();
    let cell = load(&folder, cell, points);
    Plan::new(&cell, None, true).unwrap_err().to_string()
}

#[test]
fn nine_axes_learn_their_table_in_lock_step() {
    let folder = Scratch::new();
    let cell = load(&folder, &cell_text("loopback:", 5000, 4000.0), &points());
    let plan = Plan::new(&cell, None, true).unwrap();
    // 0.1 s of 5 ms.
    let dwell = 20;
    assert_eq!(plan.n_samples(), 161 + dwell + 2 * dwell);
    assert!(plan.meta.input_units.iter().all(|unit| unit == "rad"));
    let middle = &plan.reference_m[(dwell + 80) * N_AXES..][..N_AXES];
    for (axis, reached) in (1_u32..).zip(middle) {
        assert!((reached - 0.02 * f64::from(axis)).abs() < 1e-15, "axis {axis}: {reached}");
    }
    let kept = run(&cell, 5, None);
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    let rms: Vec<f64> = kept.outcome.runs.iter().map(|(_, f)| f.tracking_rms_m).collect();
    assert!(rms[4] < 0.05 * rms[0], "{rms:?}");
    // Joints have no contour in space.
    assert!(kept.outcome.runs.iter().all(|(_, f)| f.contour_inf_m.is_none()));
}

#[test]
fn a_table_is_refused_with_its_line_or_row() {
    let cell = cell_text("loopback:", 5000, 4000.0);
    let swapped = points().replacen("a1,a2", "a2,a1", 1);
    let line = refusal(&cell, &swapped);
    assert!(line.contains("points.csv: line 2: a2: ") && line.contains("a1, a2, a3"), "{line}");
    let late = points().replacen("\n0,0,", "\n0.1,0,", 1);
    let line = refusal(&cell, &late);
    assert!(line.contains("line 3: axis a1 begins at 0.1") && line.contains("start_m"), "{line}");
    let line = refusal(&cell_text("loopback:", 5000, 10.0), &points());
    assert!(line.contains("cell.toml: [program] (axis 8 is a8): row 5: axis 8"), "{line}");
    assert!(line.contains("jerk") && line.contains("limit 10 rad/s^3"), "{line}");
    let line = refusal(&cell.replace("points.csv", "gone.csv"), &points());
    assert!(line.contains("gone.csv: cannot be read") && line.contains("set points"), "{line}");
}

#[test]
fn nine_axes_fit_a_can_bus_at_200_hz_and_not_at_500() {
    let folder = Scratch::new();
    let cell = load(&folder, &cell_text("can:can0", 5000, 4000.0), &points());
    let bus = Plan::new(&cell, None, false).unwrap().traffic.remove(0);
    assert!((bus.load.ratio() - 3835.0 / 5000.0).abs() < 1e-12 && !bus.small, "{bus:?}");
    let line = refusal(&cell_text("can:can0", 2000, 1e6), &points());
    assert!(line.contains("[bus] load_max") && line.contains("2260 us at worst"), "{line}");
}

#[test]
fn thirteen_axes_are_refused() {
    let text = cell_text("loopback:", 5000, 4000.0);
    let (begin, end) = (text.find("[[axis]]").unwrap(), text.find("[program]").unwrap());
    let more = text[begin..end].replace("name = \"a", "name = \"b").replace("node = ", "node = 1");
    let text = format!("{}{}{}", &text[..end], &more, &text[end..]);
    let line = Cell::parse(&text, "cell.toml").unwrap_err().to_string();
    assert!(line.contains("[[axis]] count = 18: 1 to 12 axes"), "{line}");
}
