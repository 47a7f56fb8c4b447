//! Part programs and shapes in a real cell: planned, refused in one line, and run in lock-step.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::Cell;
use ilc_rt::design::Plan;
use ilc_rt::record::EndStatus;
use ilc_rt::trajectory::kind::{Key, PathKind};
use ilc_tests::campaign::run;
use ilc_tests::{Scratch, example, example_text};

/// The first example with another `[program]`.
fn cell_text(program: &str) -> String {
    let text = example_text("01_gantry.toml");
    let (begin, end) = (text.find("[program]").unwrap(), text.find("[learning]").unwrap());
    format!("{}{program}\n{}", &text[..begin], &text[end..])
}

fn cell_with(program: &str) -> Result<Plan, String> {
    let cell = Cell::parse(&cell_text(program), "cell.toml").map_err(|error| error.to_string())?;
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
    // The middle of the corner arcs and of the notch, to within the blend's rounding.
    let along = 0.02 * std::f64::consts::FRAC_1_SQRT_2;
    for (x, y) in [(0.06 + along, 0.02 - along), (0.06 + along, 0.04 + along), (0.04, 0.05)] {
        assert!(nearest(x, y) < 1e-4, "{x} {y}: {}", nearest(x, y));
    }
    let last = &plan.reference_m[plan.reference_m.len() - 2..];
    assert!(last.iter().all(|value| value.abs() < 1e-12), "{last:?}");
}

/// Returns the `[program]` of an example without one of its keys or tables.
fn without(example: &str, key: Key) -> String {
    let name = key.name();
    let word = name.trim_matches(['[', ']']).rsplit(['.', ' ']).next().unwrap();
    let (table, list) = (format!("[program.{word}]"), format!("{word} = "));
    let (mut inside, mut text) = (false, "[program]\n".to_owned());
    for line in example.lines() {
        if line.starts_with('[') {
            inside = line == table;
        }
        if !inside && !line.starts_with(&list) {
            text = text + line + "\n";
        }
    }
    assert!(text.len() < "[program]\n".len() + example.len(), "{name} is not in {example:?}");
    text
}

#[test]
fn every_kind_of_path_is_planned() {
    let folder = Scratch::new();
    for kind in PathKind::ALL {
        let (entry, name) = (kind.entry(), kind.name());
        let file = folder.file(&format!("{name}.toml"));
        std::fs::write(&file, cell_text(&format!("[program]\n{}", entry.example))).unwrap();
        std::fs::write(folder.file("example.txt"), entry.example_file).unwrap();
        let cell = Cell::load(&file).unwrap();
        assert_eq!(cell.program.kind, *kind);
        let plan = Plan::new(&cell, None, true).unwrap();
        assert!(plan.n_samples() > 500, "{name}");
        // What it does not read is refused, and what it needs is asked for.
        for (key, is_given) in cell.program.given() {
            assert!(!is_given || entry.reads.contains(&key), "{name} {key:?}");
        }
        for needed in entry.needs {
            let line = cell_with(&without(entry.example, *needed)).unwrap_err();
            assert!(line.contains("= missing: ") && line.contains("needed by this kind"), "{line}");
        }
    }
}

#[test]
fn an_earlier_name_is_refused_with_the_new_one() {
    let program = "[program]\nkind = \"butterfly\"\nfeed_m_s = 0.02\nstart_m = [0.04, 0.04]\n\
                   curvature_acceleration_m_s2 = 0.02";
    let line = cell_with(program).unwrap_err();
    assert!(line.contains("curvature_acceleration_m_s2 = 0.02"), "{line}");
    assert!(line.contains("it is now called curvature_acceleration_max_m_s2"), "{line}");
}

#[test]
fn a_rotary_axis_is_refused_in_its_own_unit() {
    let program = "[program]\nfeed_m_s = 0.1\nstart_m = [0.0, 0.0]\ncorner = \"blend\"\n\
                   segment = [{ to_m = [0.05, 0.05] }, { to_m = [0.05, 0.0] }]\n";
    let text = cell_text(program).replace("name = \"y\"", "name = \"y\"\nunit = \"rad\"");
    let slow = |text: &str, axis: usize| {
        let mut cell = Cell::parse(text, "cell.toml").unwrap();
        cell.axes[axis].limits.acceleration_max_m_s2 = 0.1;
        Plan::new(&cell, None, true).unwrap_err().to_string()
    };
    let line = slow(&text, 1);
    assert!(line.contains("(axis 2 is y): axis 2: acceleration reaches"), "{line}");
    assert!(line.contains(" rad/s^2, limit 0.1 rad/s^2: largest admissible feed"), "{line}");
    assert!(line.contains(" m/s (every feed times"), "the feed is that of the linear axis: {line}");
    assert!(slow(&text, 0).contains(" m/s^2, limit 0.1 m/s^2"), "the other axis is linear");
    let both = text.replace("name = \"x\"", "name = \"x\"\nunit = \"rad\"");
    assert!(slow(&both, 0).contains(" rad/s (every feed times"), "a path of angles");
}

#[test]
fn a_butterfly_is_learned_in_lock_step() {
    let program = "[program]\nkind = \"butterfly\"\nstart_m = [0.04, 0.04]\nfeed_m_s = 0.02\n\
                   curvature_acceleration_max_m_s2 = 0.2\n\n";
    let kept = run(&Cell::parse(&cell_text(program), "butterfly.toml").unwrap(), 4, None);
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

/// Largest differences of the set points per cycle, with rest before and after.
fn peaks(reference_m: &[f64], n_axes: usize, cycle_s: f64) -> [f64; 3] {
    let mut peaks = [0.0_f64; 3];
    for axis in 0..n_axes {
        let column: Vec<f64> = reference_m.iter().skip(axis).step_by(n_axes).copied().collect();
        let (first, last) = (column[0], column[column.len() - 1]);
        let mut values = [vec![first; 3], column, vec![last; 3]].concat();
        for peak in &mut peaks {
            values = values.windows(2).map(|pair| (pair[1] - pair[0]) / cycle_s).collect();
            *peak = values.iter().fold(*peak, |most, value| most.max(value.abs()));
        }
    }
    peaks
}

#[test]
fn a_spline_that_turns_back_comes_to_rest_where_it_does() {
    let plan = cell_with(
        "[program]\nkind = \"spline\"\nfeed_m_s = 0.1\nstart_m = [0.0, 0.0]\nsegment = [\
         { to_m = [0.05, 0.0] }, { to_m = [0.02, 0.0] }, { to_m = [0.08, 0.0] }]",
    )
    .unwrap();
    let [v, a, j] = peaks(&plan.reference_m, 2, 0.002);
    assert!(v <= 0.1 + 1e-9 && a <= 8.0 + 1e-6 && j <= 1000.0 + 1e-3, "{v} {a} {j}");
    let end = &plan.reference_m[plan.reference_m.len() - 2..];
    assert!((end[0] - 0.08).abs() < 1e-9, "{end:?}");
}

#[test]
fn with_exact_stops_a_feed_beyond_the_limits_is_refused() {
    let program = |feed: f64| {
        format!(
            "[program]\nfeed_m_s = {feed}\nstart_m = [0.0, 0.0]\ncorner = \"exact_stop\"\n\
             segment = [{{ to_m = [0.03, 0.04] }}]"
        )
    };
    let line = cell_with(&program(1.0)).unwrap_err();
    // 0.8 of it is y's share, whose limit is 0.5 m/s.
    assert!(line.contains("(axis 2 is y)") && line.contains("velocity reaches 0.8"), "{line}");
    assert!(line.contains("largest admissible feed 0.625 m/s"), "{line}");
    assert!(cell_with(&program(0.625)).is_ok());
}

/// Returns the plan of the G-code example with another part program.
fn part_program(text: impl AsRef<[u8]>) -> Result<Plan, String> {
    let folder = Scratch::new();
    std::fs::write(folder.file("cell.toml"), example_text("04_gcode.toml")).unwrap();
    std::fs::write(folder.file("04_gcode.ngc"), text).unwrap();
    let cell = Cell::load(&folder.file("cell.toml")).map_err(|error| error.to_string())?;
    Plan::new(&cell, None, true).map_err(|error| error.to_string())
}

#[test]
fn words_are_read_in_every_spelling_and_encoding() {
    for text in [
        &b"G20.\nG1 X1 F60\n"[..],
        b"\xef\xbb\xbfg 2 0\r\nG01 x +1.0 F60\r\n",
        b"G1 (sp\xe4t) X25.4\n",
        b"%\nG91. (\xb5m)\nG1 X12.7 F600\nX 12. 7\n%\nsome text (",
    ] {
        let plan = part_program(text).unwrap();
        let end = plan.reference_m[plan.reference_m.len() - 2];
        assert!((end - 0.0254).abs() < 1e-9, "{end}");
    }
    let line = part_program("G1 X5 F600 (oops\nG1 Y5\nG1 X10 (ok)\n").unwrap_err();
    assert!(line.contains("04_gcode.ngc: line 1: (oops: a comment ends with )"), "{line}");
}

#[test]
fn only_regular_files_of_a_bounded_size_in_the_folder_of_the_cell_are_read() {
    let folder = Scratch::new();
    let refusal = |name: &str| {
        let text = example_text("04_gcode.toml").replace("04_gcode.ngc", name);
        std::fs::write(folder.file("cell.toml"), text).unwrap();
        let planned = Cell::load(&folder.file("cell.toml"))
            .map_err(|error| error.to_string())
            .and_then(|cell| Plan::new(&cell, None, true).map_err(|error| error.to_string()));
        let line = planned.unwrap_err();
        assert!(!line.contains(char::is_control), "{line:?}");
        line
    };
    let made = std::process::Command::new("mkfifo").arg(folder.file("pipe")).status().unwrap();
    assert!(made.success());
    assert!(refusal("pipe").contains("not a regular file"));
    std::fs::create_dir(folder.file("folder")).unwrap();
    assert!(refusal("folder").contains("not a regular file"));
    std::os::unix::fs::symlink("/dev/zero", folder.file("zero")).unwrap();
    assert!(refusal("zero").contains("a link leads out of it"));
    std::os::unix::fs::symlink(folder.file("loop"), folder.file("loop")).unwrap();
    assert!(refusal("loop").contains("cannot be read"));
    for outside in ["/etc/hostname", "../x.ngc", "folder/../x.ngc"] {
        assert!(refusal(outside).contains("must be in the folder"), "{outside}");
    }
    assert!(refusal("a\\u001bb.ngc").contains("without control characters"));
    let large = std::fs::File::create(folder.file("large.ngc")).unwrap();
    large.set_len(17 << 20).unwrap();
    assert!(refusal("large.ngc").contains("more than 16777216 bytes"));
    std::fs::write(folder.file("folder/below.ngc"), "G1 X10\n").unwrap();
    let text = example_text("04_gcode.toml").replace("04_gcode.ngc", "folder/below.ngc");
    std::fs::write(folder.file("cell.toml"), text).unwrap();
    let cell = Cell::load(&folder.file("cell.toml")).unwrap();
    assert!(Plan::new(&cell, None, true).is_ok());
}

#[test]
fn a_cell_is_a_regular_file_of_a_bounded_size_in_utf_8() {
    let folder = Scratch::new();
    let refusal = |name: &str| Cell::load(&folder.file(name)).unwrap_err().to_string();
    let made = std::process::Command::new("mkfifo").arg(folder.file("pipe")).status().unwrap();
    assert!(made.success());
    assert!(refusal("pipe").contains("not a regular file"));
    std::os::unix::fs::symlink("/dev/zero", folder.file("zero")).unwrap();
    assert!(refusal("zero").contains("not a regular file"));
    assert!(refusal(".").contains("not a regular file"));
    std::fs::File::create(folder.file("large")).unwrap().set_len(17 << 20).unwrap();
    assert!(refusal("large").contains("more than 16777216 bytes"));
    std::fs::write(folder.file("latin"), b"# a\n# \xb5\n").unwrap();
    assert!(refusal("latin").contains("line 2 is not UTF-8"));
    for deep in
        ["a = ".to_owned() + &"[".repeat(100_000), "[a".to_owned() + &".a".repeat(100_000) + "]"]
    {
        std::fs::write(folder.file("deep"), deep).unwrap();
        assert!(!refusal("deep").is_empty());
    }
    let bom = b"\xef\xbb\xbf".iter().copied().chain(example_text("01_gantry.toml").into_bytes());
    std::fs::write(folder.file("bom"), bom.collect::<Vec<u8>>()).unwrap();
    assert!(Cell::load(&folder.file("bom")).is_ok());
}
