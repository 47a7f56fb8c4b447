//! Fuzzing of files: cells, part programs, tables of set points, libraries.

use std::fmt::Write as _;

use ilc_rt::campaign;
use ilc_rt::campaign::replay::replay_read;
use ilc_rt::config::data_sheet::{DataSheet, import, section};
use ilc_rt::config::{Cell, Mode};
use ilc_rt::design::Plan;
use ilc_rt::library::Library;
use ilc_rt::recording::Reader;
use ilc_tests::campaign::{in_process, options};
use ilc_tests::{Scratch, example_path, example_text, short};

use crate::driver::fuzz;

const EXAMPLES: [&str; 3] = ["01_gantry.toml", "02_parallel.toml", "04_gcode.toml"];

fn is_one_line(said: &str) {
    let shown = said.chars().all(|letter| !letter.is_control());
    assert!(!said.is_empty() && shown, "{said:?}");
}

#[test]
fn a_cell_is_read_or_refused_in_one_line() {
    let seeds = EXAMPLES.map(|name| example_text(name).into_bytes());
    fuzz("cell", &seeds, 2_000, |input| {
        let text = String::from_utf8_lossy(input);
        match Cell::parse(&text, "cell.toml") {
            Ok(cell) => assert!(cell.n_axes() >= 1),
            Err(error) => is_one_line(&error.to_string()),
        }
    });
}

/// Plans a cell whose program is the given file; a planned program respects the limits of every
/// axis.
fn plan(kind: &str, name: &str, input: &[u8]) {
    let scratch = Scratch::new();
    let text = example_text("04_gcode.toml")
        .replace("kind = \"gcode\"", &format!("kind = \"{kind}\""))
        .replace("04_gcode.ngc", name);
    std::fs::write(scratch.file(name), input).unwrap();
    std::fs::write(scratch.file("cell.toml"), text).unwrap();
    let planned = Cell::load(&scratch.file("cell.toml"))
        .map_err(|error| error.to_string())
        .and_then(|cell| {
            let plan = Plan::new(&cell, None, true).map_err(|error| error.to_string())?;
            Ok((cell, plan))
        });
    let (cell, plan) = match planned {
        Ok(planned) => planned,
        Err(said) => return is_one_line(&said),
    };
    let (n, dt_s) = (cell.n_axes(), cell.cycle_s());
    for (axis, spec) in cell.axes.iter().enumerate() {
        let limits = &spec.limits;
        let at: Vec<f64> = plan.reference_m.iter().skip(axis).step_by(n).copied().collect();
        assert!(at.iter().all(|p| p.is_finite()), "axis {axis}");
        assert!(
            at.iter()
                .all(|p| (limits.position_min_m - 1e-9..=limits.position_max_m + 1e-9).contains(p)),
            "axis {axis} leaves its limits"
        );
        for step in at.windows(2) {
            let speed = (step[1] - step[0]).abs() / dt_s;
            assert!(speed <= limits.velocity_max_m_s * (1.0 + 1e-6), "axis {axis}: {speed} m/s");
        }
        for three in at.windows(3) {
            let rate = (three[2] - 2.0 * three[1] + three[0]).abs() / (dt_s * dt_s);
            let most = limits.acceleration_max_m_s2 * (1.0 + 1e-6) + 1e-6;
            assert!(rate <= most, "axis {axis}: {rate} m/s2");
        }
    }
}

#[test]
fn a_part_program_is_planned_within_limits_or_refused_in_one_line() {
    let shipped = std::fs::read(example_path("04_gcode.ngc")).unwrap();
    let seeds = [
        shipped,
        b"G21 G90 G17\nG1 X10 Y5 F1200\nG3 X0 Y5 I-5 J0\nG4 P0.1\nG0 X0 Y0\nM30\n".to_vec(),
        b"%\nG20 G91\nG1 X0.5 F30 (in)\nG2 X0.1 Y0.1 R0.1\n; end\nM2\n%\n".to_vec(),
        b"\xEF\xBB\xBFG1 X5 F600 (M\xFCnchen)\r\nG1 Y5\r\n".to_vec(),
    ];
    fuzz("gcode", &seeds, 500, |input| plan("gcode", "part.ngc", input));
}

#[test]
fn a_table_is_taken_within_limits_or_refused_in_one_line() {
    let mut rows = String::from("x,y\n");
    for k in 0..400_u32 {
        let at_m = 0.01 * (1.0 - (std::f64::consts::TAU * f64::from(k) / 399.0).cos());
        writeln!(rows, "{at_m:.9},{:.9}", 0.5 * at_m).unwrap();
    }
    let seeds = [
        rows.clone().into_bytes(),
        rows.replace("x,y\n", "# a table\n").into_bytes(),
        [b"\xEF\xBB\xBF".as_slice(), rows.as_bytes()].concat(),
        b"0,0\n0,0\n0.0,0.0 # rest\n".to_vec(),
    ];
    fuzz("table", &seeds, 500, |input| plan("table", "points.csv", input));
}

#[test]
fn a_library_is_read_or_refused_in_one_line() {
    let scratch = Scratch::new();
    let file = scratch.file("library.db");
    let cell = short(EXAMPLES[0]);
    let ran = ilc_rt::campaign::run(
        &cell,
        &options(file.clone(), 2),
        in_process(&cell),
        None,
        &mut |_| {},
    );
    ran.unwrap();
    let seeds = [std::fs::read(&file).unwrap(), b"SQLite format 3\0".to_vec(), Vec::new()];
    let tried = scratch.file("tried.db");
    fuzz("library", &seeds, 300, |input| {
        for leftover in ["tried.db-wal", "tried.db-shm", "tried.db-journal"] {
            let _ = std::fs::remove_file(scratch.file(leftover));
        }
        std::fs::write(&tried, input).unwrap();
        let read = Library::open(&tried).and_then(|library| {
            for row in library.list(None)?.into_iter().take(50) {
                assert_eq!(library.load(row.id)?.id, row.id);
            }
            Ok(())
        });
        if let Err(error) = read {
            is_one_line(&error.to_string());
        }
    });
}

#[test]
fn a_data_sheet_is_read_or_refused_in_one_line() {
    let cell = short("01_gantry.toml");
    let machine = ilc_tests::campaign::machine(&cell);
    let dictionary = machine.dictionary(ilc_tests::rig::node(1)).unwrap();
    let seed = ilc_sim::eds::write(dictionary, "drive").into_bytes();
    fuzz("data_sheet", &[seed], 300, |input| {
        for node in [None, Some(127)] {
            let read = DataSheet::parse(input, "servo.eds", node);
            match read.and_then(|sheet| import(&sheet, Mode::Csp)) {
                Ok(found) => assert!(section(&found).contains("[axis.drive]")),
                Err(error) => is_one_line(&error.to_string()),
            }
        }
    });
}

/// A short recording without checksums, so that what is changed in it is read.
fn recording() -> Vec<u8> {
    let cell = short("01_gantry.toml");
    let scratch = Scratch::new();
    let path = scratch.file("short.mcap");
    let mut options = options(scratch.file("library.db"), 1);
    options.session.record = Some(path.clone());
    // Stopped at once: a few ticks.
    options.session.stop.store(2, std::sync::atomic::Ordering::Relaxed);
    campaign::run(&cell, &options, in_process(&cell), None, &mut |_| {}).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let mut at = 8;
    while at + 9 < bytes.len() - 8 {
        let n_bytes = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
        let end = at + 9 + usize::try_from(n_bytes).unwrap();
        match bytes[at] {
            0x06 => bytes[at + 9 + 24..at + 9 + 28].fill(0),
            0x09 => bytes[end - 4..end].fill(0),
            _ => {}
        }
        at = end;
    }
    bytes
}

#[test]
fn a_recording_is_replayed_or_refused_in_one_line() {
    let seed = recording();
    let path = std::path::Path::new("fuzzed.mcap");
    let whole = replay_read(Reader::new(&seed[..], path), path).unwrap();
    assert!(whole.difference.is_none() && whole.cycles > 1, "{whole:?}");
    fuzz("recording", &[seed], 500, |input| match replay_read(Reader::new(input, path), path) {
        Ok(replayed) => assert!(replayed.cycles <= whole.cycles + 1000),
        Err(error) => is_one_line(&error.to_string()),
    });
}
