//! Part programs and shapes in a real cell: planned, refused in one line, and run in lock-step.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::Cell;
use ilc_rt::record::EndStatus;
use ilc_rt::supervisor::Plan;
use ilc_tests::campaign::run;
use ilc_tests::{Scratch, example, example_text};

/// The first example with another `[program]`.
fn cell_with(program: &str) -> Result<Plan, String> {
    let text = example_text("01_gantry.toml");
    let (begin, end) = (text.find("[program]").unwrap(), text.find("[learning]").unwrap());
    let text = format!("{}{program}\n{}", &text[..begin], &text[end..]);
    let cell = Cell::parse(&text, "cell.toml").map_err(|error| error.to_string())?;
    Plan::new(&cell, None, true).map_err(|error| error.to_string())
}

#[test]
fn a_part_program_with_arcs_is_learned_in_lock_step() {
    let cell = example("04_gcode.toml");
    let kept = run(&cell, 5, None);
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    assert!(kept.contour_fall(4) > 0.5, "{:?}", kept.contour_m());
}

#[test]
fn a_part_program_goes_where_it_says() {
    let cell = example("04_gcode.toml");
    let plan = Plan::new(&cell, None, true).unwrap();
    let nearest = |x: f64, y: f64| {
        plan.reference_m.chunks(2).map(|p| (p[0] - x).hypot(p[1] - y)).fold(f64::INFINITY, f64::min)
    };
    // The middle of the corner arcs and of the notch, to what the blend rounds off.
    let along = 0.02 * std::f64::consts::FRAC_1_SQRT_2;
    for (x, y) in [(0.06 + along, 0.02 - along), (0.06 + along, 0.04 + along), (0.04, 0.05)] {
        assert!(nearest(x, y) < 1e-4, "{x} {y}: {}", nearest(x, y));
    }
    let last = &plan.reference_m[plan.reference_m.len() - 2..];
    assert!(last.iter().all(|value| value.abs() < 1e-12), "{last:?}");
}

#[test]
fn every_kind_of_path_is_planned() {
    let common = "[program]\nfeed_m_s = 0.02\n";
    for program in [
        "kind = \"butterfly\"\nstart_m = [0.04, 0.04]\ncurvature_acceleration_m_s2 = 0.02",
        "kind = \"spiral\"\nstart_m = [0.04, 0.04]\n[program.spiral]\npitch_m = 0.004\nturns = 3.0",
        "kind = \"raster\"\nstart_m = [0.0, 0.0]\n[program.raster]\nwidth_m = 0.02\npitch_m = 0.005\n\
         rows = 3\nthere_and_back = true",
        "kind = \"spline\"\nstart_m = [0.0, 0.0]\nsegment = [{ to_m = [0.03, 0.01] }, \
         { to_m = [0.05, 0.05] }, { to_m = [0.0, 0.04] }]",
        "kind = \"modulated\"\nstart_m = [0.0, 0.0]\nsegment = [{ to_m = [0.05, 0.0] }]\n\
         [program.modulated]\namplitude_m = 0.0005\nfrequency_hz = 3.0",
        "start_m = [0.02, 0.0]\nsegment = [{ to_m = [0.0, 0.02], center_m = [0.0, 0.0], dwell_s = 0.1 }]",
    ] {
        let plan = cell_with(&format!("{common}{program}")).unwrap();
        assert!(plan.n_samples() > 500, "{program}");
    }
}

#[test]
fn a_butterfly_is_learned_in_lock_step() {
    let text = example_text("01_gantry.toml");
    let (begin, end) = (text.find("[program]").unwrap(), text.find("[learning]").unwrap());
    let program = "[program]\nkind = \"butterfly\"\nstart_m = [0.04, 0.04]\nfeed_m_s = 0.02\n\
                   curvature_acceleration_m_s2 = 0.2\n\n";
    let text = format!("{}{program}{}", &text[..begin], &text[end..]);
    let kept = run(&Cell::parse(&text, "butterfly.toml").unwrap(), 4, None);
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    assert!(kept.contour_fall(3) > 0.3, "{:?}", kept.contour_m());
}

#[test]
fn refusals_name_file_place_and_what_is_allowed() {
    let common = "[program]\nfeed_m_s = 0.02\nstart_m = [0.0, 0.0]\n";
    for (program, parts) in [
        ("kind = \"gcode\"", vec!["[program] file", "missing"]),
        ("kind = \"spiral\"", vec!["[program.spiral]", "missing"]),
        ("kind = \"cube\"", vec!["[program] kind", "`butterfly`", "`gcode`"]),
        ("kind = \"butterfly\"\nfile = \"a.ngc\"", vec!["[program] file", "not used"]),
        (
            "kind = \"butterfly\"\n[program.butterfly]\nscale_m = 0.02",
            vec!["[program]", "axis", "it reaches"],
        ),
        ("kind = \"gcode\"\nfile = \"not-there.ngc\"", vec!["not-there.ngc", "cannot be read"]),
    ] {
        let line = cell_with(&format!("{common}{program}")).err().unwrap_or_default();
        for part in parts {
            assert!(line.contains(part), "{part:?} in {line:?}");
        }
    }
}

#[test]
fn a_bad_part_program_is_refused_with_its_line() {
    let folder = Scratch::new();
    let text = example_text("04_gcode.toml");
    std::fs::write(folder.file("cell.toml"), text).unwrap();
    std::fs::write(folder.file("04_gcode.ngc"), "G1 X10\nG33 X2\n").unwrap();
    let cell = Cell::load(&folder.file("cell.toml")).unwrap();
    let line = Plan::new(&cell, None, true).unwrap_err().to_string();
    assert!(line.contains("04_gcode.ngc: line 2: G33: allowed G0 G1"), "{line}");
}
