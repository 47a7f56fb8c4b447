//! Invalid cell descriptions: each is refused in one line that names file, key, value and the
//! allowed values; none causes a panic.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::Cell;
use ilc_rt::design::Plan;
use ilc_rt::fieldbus::transport::Address;
use ilc_tests::{INPUTS, example_text};
use proptest::prelude::{any, prop, proptest};

const FILE: &str = "cell.toml";

/// Returns the refusal of a cell before anything moves, as in a campaign.
fn refusal(text: &str) -> Option<String> {
    let cell = match Cell::parse(text, FILE) {
        Ok(cell) => cell,
        Err(error) => return Some(error.to_string()),
    };
    let plan = match Plan::new(&cell, None, true) {
        Ok(plan) => plan,
        Err(error) => return Some(error.to_string()),
    };
    plan.law(&cell).err().map(|error| error.to_string())
}

/// The first example with one piece of its text replaced.
fn edited(from: &str, to: &str) -> String {
    let text = example_text(INPUTS[0]);
    assert!(text.contains(from), "{from:?} is not in the example any more");
    text.replacen(from, to, 1)
}

#[test]
fn the_examples_are_not_refused() {
    for name in INPUTS {
        assert_eq!(refusal(&example_text(name)), None, "{name}");
    }
}

#[test]
fn a_law_that_will_not_converge_is_refused_unless_it_is_allowed() {
    let pd = "law = \"pd\"";
    let tuned = |numbers: &str| {
        format!("{}\n[learning.pd]\n{numbers}\n", edited("law = \"norm_optimal\"", pd))
    };
    for sound in ["", "kp = 0.5\nlead_samples = 8", "kp = 0.3\ncutoff_hz = 5.0"] {
        assert_eq!(refusal(&tuned(sound)), None, "{sound}");
    }
    let eager = tuned("kp = 5.0\ncutoff_hz = 100.0");
    let line = refusal(&eager).unwrap();
    for part in [FILE, "[learning]", "will not converge", "allow_divergent = true"] {
        assert!(line.contains(part), "{line}");
    }
    let allowed = eager.replacen(pd, "law = \"pd\"\nallow_divergent = true", 1);
    assert_eq!(refusal(&allowed), None);
}

/// A piece of the first example, its replacement, and parts of the line that refuses it.
type Edit = (&'static str, &'static str, &'static [&'static str]);

/// Syntax: keys, types, sections.
const WRITTEN: &[Edit] = &[
    ("cycle_us = 2000", "cycle_ms = 2", &[":6:", "cycle_ms = 2", "unknown field", "`cycle_us`"]),
    ("damping = 1.0", "dampnig = 1.0", &["[axis.model] dampnig", "unknown field", "`damping`"]),
    ("cycle_us = 2000", "", &["[cell]", "missing field `cycle_us`"]),
    ("cycle_us = 2000", "cycle_us = 2000.5", &["[cell] cycle_us = 2000.5", "expected u32"]),
    ("cycle_us = 2000", "cycle_us = \"2 ms\"", &["cycle_us = \"2 ms\"", "expected u32"]),
    ("cycle_us = 2000", "cycle_us = -2000", &["cycle_us = -2000", "expected u32"]),
    ("node = 1\n", "node = 300\n", &["node = 300", "expected u8"]),
    ("\"csp\"", "\"pp\"", &["[[axis]] interface = \"pp\"", "`csp`", "`csv`"]),
    ("\"blend\"", "\"round\"", &["[program] corner", "`exact_stop`", "`blend`"]),
    ("\"norm_optimal\"", "\"magic\"", &["[learning] law", "`norm_optimal`", "`pd`", "`none`"]),
    ("measure = \"tcp\"", "measure = \"eye\"", &["[learning] measure", "`encoder`", "`tcp`"]),
    ("[bus]", "[buss]", &["[buss]", "unknown field `buss`"]),
    ("name = \"gantry\"", "name = ", &["[cell] name"]),
    ("start_m = [0.08, 0.0]", "start_m = [0.08, \"a\"]", &["[program] start_m"]),
];

/// Numbers out of their ranges.
const RANGES: &[Edit] = &[
    ("name = \"gantry\"", "name = \"a b\"", &["[cell] name = a b", "letters, digits"]),
    ("cycle_us = 2000", "cycle_us = 50", &["[cell] cycle_us = 50", "allowed 100 to 100000"]),
    (
        "step_us = 250 ",
        "step_us = 300 ",
        &["[simulation] step_us = 300", "divisor of [cell] cycle_us"],
    ),
    ("step_us = 250 ", "step_us = 0 ", &["[simulation] step_us = 0"]),
    ("node = 1\n", "node = 0\n", &["[[axis]] x node = 0", "1 to 127"]),
    ("node = 2\n", "node = 1\n", &["[[axis]] y node = 1", "[[axis]] x node has it already"]),
    ("node = 10\n", "node = 2\n", &["[tcp_encoder] node = 2", "[[axis]] y node has it"]),
    ("velocity_max_m_s = 0.5", "velocity_max_m_s = nan", &["velocity_max_m_s = NaN", "allowed"]),
    ("feed_m_s = 0.1", "feed_m_s = inf", &["[program] feed_m_s = inf", "allowed"]),
    ("feed_m_s = 0.1", "feed_m_s = -0.1", &["[program] feed_m_s = -0.1", "allowed"]),
    (
        "position_min_m = -0.02",
        "position_min_m = 0.2",
        &["position_max_m = 0.1", "above limits.position_min_m"],
    ),
    ("counts_per_m = 1e8", "counts_per_m = 0.0", &["[[axis]] x: counts_per_m = 0", "allowed 1"]),
    ("counts_per_m = 1e8", "counts_per_m = 1e11", &["counts_per_m = 100000000000", "allowed 1"]),
    (
        "position_max_m = 0.10",
        "position_max_m = 100.0",
        &["[[axis]] x: counts_per_m", "must fit 32 bits"],
    ),
    (
        "velocity_max_m_s = 0.5",
        "velocity_max_m_s = 50.0",
        &["limits.velocity_max_m_s = 50", "must fit 32 bits"],
    ),
    (
        "mode_mass_kg = 30.0",
        "mode_mass_kg = 150.0",
        &["simulation.mode_mass_kg = 150", "allowed 0 to 135"],
    ),
    (
        "position_start_m = 0.04",
        "position_start_m = 22.0",
        &["simulation.position_start_m = 22", "allowed -21.47483647 to 21.47483647"],
    ),
    ("q = 1.0", "q = -1.0", &["[learning.norm_optimal] q = -1", "allowed 0"]),
    ("input_max_m = 0.005", "input_max_m = nan", &["[learning] input_max_m = NaN", "allowed"]),
];

/// Contradictions between values.
const CONTRADICTIONS: &[Edit] = &[
    (
        "to_m = [0.06, 0.06]",
        "to_m = [0.06, 0.6]",
        &["[[program.segment]] 2 to_m = 0.6", "axis y reaches -0.02 to 0.1"],
    ),
    (
        "to_m = [0.06, 0.06]",
        "to_m = [0.06]",
        &["[[program.segment]] 2 to_m = [0.06]", "2 coordinates"],
    ),
    (
        "start_m = [0.08, 0.0]",
        "start_m = [0.8, 0.0]",
        &["[program] start_m = 0.8", "axis x reaches"],
    ),
    (
        "damping = 1.0\n",
        "damping = 1.0\nvelocity_bandwidth_hz = 30.0\n",
        &["model.velocity_bandwidth_hz = 30", "not used by this interface"],
    ),
    (
        "interface = \"csp\"",
        "interface = \"csv\"",
        &["[[axis]] x: model.velocity_bandwidth_hz = missing", "needed by this interface"],
    ),
    ("natural_frequency_hz = 15.0", "", &["[[axis]] x: model.natural_frequency_hz = missing"]),
    ("blend_s = 0.04", "blend_s = 0.001", &["[program] blend_s = 0.001", "allowed 0.002"]),
];

/// Refusals by planner, bus and law.
const PLANS: &[Edit] = &[
    (
        "feed_m_s = 0.1",
        "feed_m_s = 0.9",
        &["[program] (axis 2 is y)", "22.5", "limit 8 m/s^2", "largest admissible feed 0.32 m/s"],
    ),
    (
        "blend_s = 0.04",
        "blend_s = 0.004",
        &["[program] (axis 2 is y)", "limit 1000 m/s^3", "blend window 0.014 s"],
    ),
    (
        "address = \"udp:239.74.163.2\"",
        "address = \"can:can0\"\nbitrate_bit_s = 125000",
        &["[bus] load_max", "80"],
    ),
    ("q = 1.0", "q = 0.0", &["[learning]"]),
];

#[test]
fn each_refusal_names_file_key_value_and_what_is_allowed() {
    let mut wrong = Vec::new();
    for (from, to, parts) in [WRITTEN, RANGES, CONTRADICTIONS, PLANS].concat() {
        let Some(line) = refusal(&edited(from, to)) else {
            wrong.push(format!("not refused: {to}"));
            continue;
        };
        let missing: Vec<_> = parts.iter().filter(|part| !line.contains(**part)).collect();
        if !line.starts_with(FILE) || line.contains('\n') || !missing.is_empty() {
            wrong.push(format!("{to}\n    {line}\n    lacks {missing:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn whole_sections_that_are_missing_are_named() {
    let without = |name: &str, from: &str, to: &str| {
        let text = example_text(name);
        let (begin, end) = (text.find(from).unwrap(), text.find(to).unwrap());
        refusal(&format!("{}{}", &text[..begin], &text[end..])).unwrap_or_default()
    };
    let table: [(&str, &str, &str, &[&str]); 6] = [
        (
            INPUTS[0],
            "[tcp_encoder]",
            "[simulation]",
            &["[learning] measure = tcp", "\"encoder\"", "no [tcp_encoder]"],
        ),
        (INPUTS[0], "[[program.segment]]", "[learning]", &["[[program.segment]]"]),
        (INPUTS[0], "[program]", "[learning]", &["program"]),
        (INPUTS[0], "[bus]", "[[axis]]", &["missing field `bus`"]),
        (INPUTS[0], "[[axis]]", "[tcp_encoder]", &["axis"]),
        (
            INPUTS[1],
            "[axis.position_loop]",
            "[axis.model]",
            &["[[axis]] x: position_loop = missing", "gain_per_s"],
        ),
    ];
    for (name, from, to, parts) in table {
        let line = without(name, from, to);
        for part in parts {
            assert!(line.contains(part), "{part:?} in {line:?} without {from}");
        }
        assert!(line.starts_with(FILE) && !line.contains('\n'), "{line}");
    }
}

#[test]
fn no_segments_at_all() {
    let text = example_text(INPUTS[0]);
    let (begin, end) =
        (text.find("[[program.segment]]").unwrap(), text.find("[learning]").unwrap());
    let text = format!("{}segment = []\n{}", &text[..begin], &text[end..]);
    let line = refusal(&text).unwrap();
    assert!(line.contains("[[program.segment]]") && line.contains("at least one"), "{line}");
}

#[test]
fn a_program_that_would_take_for_ever_is_refused_before_it_fills_the_memory() {
    let line = refusal(&edited("feed_m_s = 0.1", "feed_m_s = 1e-6")).unwrap();
    assert!(line.starts_with(FILE) && line.contains("[program]"), "{line}");
}

proptest! {
    #![proptest_config(ilc_cases::cases(600))]

    #[test]
    fn random_edits_never_panic(
        example in 0..INPUTS.len(),
        edits in prop::collection::vec((0..5_u8, any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let mut lines: Vec<Vec<u8>> =
            example_text(INPUTS[example]).lines().map(|line| line.as_bytes().to_vec()).collect();
        for (kind, at, byte) in edits {
            let place = at.index(lines.len());
            let other = usize::from(byte) % lines.len();
            match kind {
                0 => drop(lines.remove(place)),
                1 => lines.insert(place, lines[other].clone()),
                2 => lines.swap(place, other),
                3 if !lines[place].is_empty() => {
                    let column = usize::from(byte) % lines[place].len();
                    // Mostly bytes that a number or a key could consist of.
                    lines[place][column] = b"0123456789-+.eEnaif\"[]=#\n \xC3"[usize::from(byte) % 26];
                }
                _ => {
                    let column = usize::from(byte) % (lines[place].len() + 1);
                    lines[place].insert(column, byte);
                }
            }
        }
        let text = String::from_utf8_lossy(&lines.join(&b'\n')).into_owned();
        if let Some(line) = refusal(&text) {
            assert!(line.starts_with(FILE) && !line.contains('\n'), "{line:?}");
        } else {
            // An address is checked when it is opened.
            let cell = Cell::parse(&text, FILE).unwrap();
            let _ = cell.bus.address.parse::<Address>();
        }
    }
}
