//! `[learning]` of a cell description: values out of range, contradictions and unknown keys are
//! refused in one line; a diverging law does not start, and a law that learns beyond its critical
//! frequency causes a warning.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::config::{Cell, LawName, Learning};
use ilc_rt::design::{Plan, Prepared};
use ilc_rt::learning::law::LawTables;
use ilc_tests::example_text;

const FILE: &str = "cell.toml";
const SERIES: &str = "01_gantry.toml";
const PARALLEL: &str = "02_parallel.toml";

/// Returns an example with a different `[learning]`.
fn text(example: &str, learning: &str) -> String {
    let text = example_text(example);
    let end = text.find("[learning]").unwrap();
    format!("{}[learning]\n{learning}\n", &text[..end])
}

/// Returns the preparation of a cell before anything moves, as in a campaign.
fn prepared(text: &str) -> Result<Prepared, String> {
    let cell = Cell::parse(text, FILE).map_err(|error| error.to_string())?;
    let plan = Plan::new(&cell, None, true).map_err(|error| error.to_string())?;
    plan.law(&cell).map_err(|error| error.to_string())
}

/// An example, its learning, and parts of the line that refuses it.
type Refusal = (&'static str, &'static str, &'static [&'static str]);

/// Unknown keys and names, and wrong types.
const WRITTEN: &[Refusal] = &[
    (SERIES, "law = \"adjiont\"", &["law = \"adjiont\"", "`adjoint`", "`error_feedforward`"]),
    (SERIES, "[learning.gate]\ntolerance = 1.0", &["[learning.gate] tolerance", "`tolerance_m`"]),
    (SERIES, "[learning.gate]\nmeasure = \"mean\"", &["measure = \"mean\"", "`rms`", "`max`"]),
    (SERIES, "[learning.ladder]\nrepeat = 3", &["[learning.ladder] repeat", "`repeats`"]),
    (SERIES, "[learning.adjoint]\nalpha = 3", &["[learning.adjoint] alpha", "`gain`"]),
    (SERIES, "[learning.model_inverse]\nkp = 3", &["[learning.model_inverse] kp", "`cutoff_hz`"]),
    (SERIES, "[learning.error_feedforward]\ngain = 3", &["gain = 3", "`gain_per_s`"]),
    (SERIES, "[learning.constrained]\ninput_max = 3", &["input_max = 3", "`step_max_m`"]),
    (
        SERIES,
        "[learning.norm_optimal]\ncontour = { wieght = 1.0 }",
        &["[learning.norm_optimal] contour", "`weight`", "`along`"],
    ),
    (
        SERIES,
        "[[learning.norm_optimal.phase]]\nfrom_s = 0.1",
        &["[[learning.norm_optimal.phase]]", "missing field `to_s`"],
    ),
    (
        SERIES,
        "[[learning.norm_optimal.phase]]\nfrom_s = 0.1\nto_s = 0.2\nrate = 1.0",
        &["rate = 1.0", "unknown field", "`contour`"],
    ),
];

/// Numbers out of their ranges.
const RANGES: &[Refusal] = &[
    (SERIES, "rollback_ratio = 0.9", &["[learning] rollback_ratio = 0.9", "allowed 1 to 1000"]),
    (SERIES, "input_max_m_s = -1.0", &["[learning] input_max_m_s = -1", "allowed 0 to 10"]),
    (SERIES, "[learning.norm_optimal]\nrate = -1.0", &["[learning.norm_optimal] rate = -1"]),
    (
        SERIES,
        "[learning.norm_optimal]\nsmoothing_hz = 300.0",
        &["[learning.norm_optimal] smoothing_hz = 300", "to 237.5"],
    ),
    (
        SERIES,
        "[learning.norm_optimal.contour]\nweight = -1.0",
        &["[learning.norm_optimal.contour] weight = -1", "allowed 0"],
    ),
    (
        SERIES,
        "[learning.norm_optimal.contour]\nalong = nan",
        &["[learning.norm_optimal.contour] along = NaN", "allowed 0"],
    ),
    (
        SERIES,
        "[[learning.norm_optimal.phase]]\nfrom_s = -0.1\nto_s = 0.2",
        &["[[learning.norm_optimal.phase]] 1 from_s = -0.1", "allowed 0"],
    ),
    (
        SERIES,
        "[[learning.norm_optimal.phase]]\nfrom_s = 0.1\nto_s = 0.2\ns = -2.0",
        &["[[learning.norm_optimal.phase]] 1 s = -2", "allowed 0"],
    ),
    (
        SERIES,
        "[[learning.norm_optimal.phase]]\nfrom_s = 90.0\nto_s = 91.0\nq = 2.0",
        &["[[learning.norm_optimal.phase]] 1 from_s = 90", "as long as a run is"],
    ),
    (SERIES, "[learning.pd]\nkp = 2e3", &["[learning.pd] kp = 2000", "allowed -1000 to 1000"]),
    (SERIES, "[learning.pd]\nlead_samples = 1001", &["[learning.pd] lead_samples = 1001"]),
    (SERIES, "[learning.pd]\norder = 13", &["[learning.pd] order = 13", "allowed 1 to 12"]),
    (SERIES, "[learning.pd]\ncutoff_hz = 240.0", &["[learning.pd] cutoff_hz = 240", "to 237.5"]),
    (SERIES, "[learning.constrained]\nq = -1.0", &["[learning.constrained] q = -1"]),
    (
        SERIES,
        "[learning.constrained]\nstep_max_m = 0.0",
        &["[learning.constrained] step_max_m = 0"],
    ),
    (SERIES, "[learning.constrained]\nstep_max_m_s = 11.0", &["step_max_m_s = 11", "to 10"]),
    (SERIES, "[learning.constrained]\nchange_max_m = 2.0", &["change_max_m = 2", "to 1"]),
    (SERIES, "[learning.constrained]\nchange_max_m_s = -1.0", &["change_max_m_s = -1", "to 10"]),
    (
        SERIES,
        "[learning.constrained]\nvelocity_max_m_s = 0.6",
        &["[learning.constrained] velocity_max_m_s = 0.6", "to 0.5"],
    ),
    (
        SERIES,
        "[learning.constrained]\nacceleration_max_m_s2 = 9.0",
        &["[learning.constrained] acceleration_max_m_s2 = 9", "to 8"],
    ),
    (SERIES, "[learning.adjoint]\ngain = 0.0", &["[learning.adjoint] gain = 0", "allowed"]),
    (SERIES, "[learning.adjoint]\norder = 0", &["[learning.adjoint] order = 0", "allowed 1 to 12"]),
    (SERIES, "[learning.adjoint]\ncutoff_hz = 0.1", &["[learning.adjoint] cutoff_hz = 0.1"]),
    (
        SERIES,
        "[learning.model_inverse]\ngain = 2.0",
        &["[learning.model_inverse] gain = 2", "above 0 and below 2"],
    ),
    (SERIES, "[learning.model_inverse]\norder = 13", &["[learning.model_inverse] order = 13"]),
    (
        SERIES,
        "[learning.model_inverse]\ncutoff_hz = inf",
        &["[learning.model_inverse] cutoff_hz = inf"],
    ),
    (SERIES, "[learning.error_feedforward]\ngain_per_s = 0.0", &["gain_per_s = 0", "to 10000"]),
    (SERIES, "[learning.error_feedforward]\nlead_samples = 1001", &["lead_samples = 1001"]),
    (
        SERIES,
        "[learning.error_feedforward]\norder = 0",
        &["[learning.error_feedforward] order = 0"],
    ),
    (SERIES, "[learning.error_feedforward]\ncutoff_hz = 0.0", &["cutoff_hz = 0", "allowed 0.25"]),
    (SERIES, "[learning.ladder]\nrepeats = 0", &["[learning.ladder] repeats = 0", "allowed 1"]),
    (SERIES, "[learning.ladder]\nslow = 1.1", &["[learning.ladder] slow = 1.1", "to 1"]),
    (SERIES, "[learning.ladder]\nincrease = 0.9", &["[learning.ladder] increase = 0.9"]),
    (SERIES, "[learning.ladder]\nlowest = 0.0", &["[learning.ladder] lowest = 0", "to 1"]),
    (SERIES, "[learning.ladder]\nhighest = 0.5", &["[learning.ladder] highest = 0.5", "allowed 1"]),
    (SERIES, "[learning.gate]\ntolerance_m = -1.0", &["[learning.gate] tolerance_m = -1"]),
    (SERIES, "[learning.gate]\nresume = 0.5", &["[learning.gate] resume = 0.5", "allowed 1"]),
    (SERIES, "[learning.gate]\ngrowth = 0.5", &["[learning.gate] growth = 0.5", "allowed 1"]),
    (SERIES, "[learning.gate]\npatience = 0", &["[learning.gate] patience = 0", "allowed 1"]),
];

/// Contradictions between values.
const CONTRADICTIONS: &[Refusal] = &[
    (
        SERIES,
        "rollback_ratio = 1.5\n[learning.gate]\ntolerance_m = 1e-5",
        &["[learning] rollback_ratio = 1.5", "[learning.gate]", "remove one"],
    ),
    (SERIES, "law = \"none\"\n[learning.gate]", &["[learning] law = none", "[learning.gate]"]),
    (SERIES, "law = \"none\"\n[learning.ladder]", &["[learning] law = none", "[learning.ladder]"]),
    (
        SERIES,
        "law = \"error_feedforward\"",
        &["[learning] law = error_feedforward", "\"csv\" on every axis", "axis x"],
    ),
    (
        PARALLEL,
        "law = \"error_feedforward\"\ninput_max_m_s = 0.0",
        &["[learning] law = error_feedforward", "input_max_m_s", "above 0"],
    ),
    (
        SERIES,
        "law = \"constrained\"\ninput_max_m = 0.0",
        &["[learning] law = constrained", "input_max_m", "above 0"],
    ),
    (
        PARALLEL,
        "[learning.constrained]\nvelocity_max_m_s = 0.1",
        &["[learning.constrained] velocity_max_m_s = given", "only with csp axes"],
    ),
    (
        SERIES,
        "[learning.norm_optimal.contour]\naxes = [\"x\", \"z\"]",
        &["[learning.norm_optimal.contour] axes = z", "axes of this cell"],
    ),
    (
        SERIES,
        "[learning.norm_optimal.contour]\naxes = [\"x\", \"x\"]",
        &["[learning.norm_optimal.contour] axes = x", "each once"],
    ),
    (
        SERIES,
        "[learning.norm_optimal.contour]\naxes = [\"x\"]",
        &["[learning.norm_optimal.contour] axes", "2 or 3 axes"],
    ),
    (
        SERIES,
        "[[learning.norm_optimal.phase]]\nfrom_s = 0.2\nto_s = 0.2",
        &["[[learning.norm_optimal.phase]] 1 to_s = 0.2", "after from_s = 0.2"],
    ),
    (
        SERIES,
        "[[learning.norm_optimal.phase]]\nfrom_s = 0.2\nto_s = 0.4\n\
         [[learning.norm_optimal.phase]]\nfrom_s = 0.3\nto_s = 0.5",
        &["[[learning.norm_optimal.phase]] 2 from_s = 0.3", "at least 0.4"],
    ),
    (
        SERIES,
        "[[learning.norm_optimal.phase]]\nfrom_s = 0.2\nto_s = 0.4\ncontour = 1.0",
        &["[[learning.norm_optimal.phase]] 1 contour = given", "[learning.norm_optimal.contour]"],
    ),
    (
        SERIES,
        "law = \"adjoint\"\n[learning.adjoint]\ngain = 1e6",
        &["[learning]", "gain = 1000000", "less than"],
    ),
];

#[test]
fn each_refusal_names_file_key_value_and_what_is_allowed() {
    let mut wrong = Vec::new();
    for (example, learning, parts) in [WRITTEN, RANGES, CONTRADICTIONS].concat() {
        let Err(line) = prepared(&text(example, learning)) else {
            wrong.push(format!("not refused: {learning}"));
            continue;
        };
        let missing: Vec<_> = parts.iter().filter(|part| !line.contains(**part)).collect();
        if !line.starts_with(FILE) || line.contains('\n') || !missing.is_empty() {
            wrong.push(format!("{learning}\n    {line}\n    lacks {missing:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_law_says_before_the_start_what_it_will_do() {
    let tables = Learning::default();
    for law in LawName::ALL {
        let parameters = tables.parameters(*law).unwrap();
        for example in parameters.examples() {
            let cell = if example.is_parallel { PARALLEL } else { SERIES };
            let both = "[learning.gate]\n[learning.ladder]\nrepeats = 3";
            for around in ["", "[learning.gate]", "[learning.ladder]", both] {
                let learning = format!("{}\n{around}", example.learning);
                let found = prepared(&text(cell, &learning));
                if parameters.measures() && around.contains("ladder") {
                    let line = found.err().unwrap();
                    assert!(line.contains("learns from every run"), "{line}");
                    continue;
                }
                let found = found.unwrap_or_else(|line| panic!("{cell} {learning}: {line}"));
                assert!(!found.verdict.is_empty(), "{cell} {learning}");
            }
        }
    }
    assert!(prepared(&text(SERIES, "law = \"none\"")).unwrap().law.is_none());
}

#[test]
fn bounds_are_said_to_be_left_out_of_the_forecast() {
    let found =
        prepared(&text(SERIES, "law = \"constrained\"\n[learning.constrained]\nrate = 6.0"))
            .unwrap();
    assert!(found.verdict.contains("without its bounds"), "{}", found.verdict);
}

/// A law, parameters with which it diverges, and parameters with which it converges.
const DIVERGING: [(&str, &str, &str); 4] = [
    (SERIES, "pd", "kp = 5.0\ncutoff_hz = 100.0"),
    (PARALLEL, "pd", "kp = 500.0\ncutoff_hz = 50.0"),
    (SERIES, "adjoint", "gain = 5.0\ncutoff_hz = 20.0"),
    (PARALLEL, "error_feedforward", "gain_per_s = 500.0\ncutoff_hz = 50.0"),
];

#[test]
fn a_law_that_would_diverge_does_not_start_whatever_goes_round_it() {
    for (example, law, numbers) in DIVERGING {
        for around in ["", "[learning.ladder]\nrepeats = 4", "[learning.gate]\ntolerance_m = 1.0"] {
            let table = format!("[learning.{law}]\n{numbers}\n{around}");
            let line = prepared(&text(example, &format!("law = \"{law}\"\n{table}"))).err();
            let line = line.unwrap_or_else(|| panic!("{example} {law} {around} is not refused"));
            for part in [FILE, "[learning]", "will not converge", "allow_divergent = true"] {
                assert!(line.contains(part), "{law}: {line}");
            }
            let allowed = format!("law = \"{law}\"\nallow_divergent = true\n{table}");
            let found = prepared(&text(example, &allowed)).unwrap();
            assert!(!found.warnings.is_empty(), "{law} starts without a word");
        }
    }
}

#[test]
fn a_low_pass_above_the_critical_frequency_starts_with_a_warning_that_names_both() {
    let pd = |numbers: &str| {
        prepared(&text(SERIES, &format!("law = \"pd\"\n[learning.pd]\n{numbers}"))).unwrap()
    };
    let about_cutoff = |found: &Prepared| {
        let lines = found.warnings.iter().filter(|line| line.contains("low-pass begins"));
        lines.cloned().collect::<Vec<_>>()
    };
    // The axes lag by 90 degrees near 15 Hz, where a lead of ten samples compensates for it.
    let sound = pd("kp = 0.3\nlead_samples = 10\ncutoff_hz = 4.0");
    assert!(about_cutoff(&sound).is_empty(), "{:?}", sound.warnings);
    let far = pd("kp = 0.3\nlead_samples = 1\ncutoff_hz = 12.0");
    let told = about_cutoff(&far);
    assert_eq!(told.len(), 1, "{:?}", far.warnings);
    assert!(told[0].contains("begins at 12.000 Hz") && !told[0].contains('\n'), "{}", told[0]);
    let critical_hz: f64 =
        told[0].split("from ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((1.0..12.0).contains(&critical_hz), "{}", told[0]);
    // Just below the reported critical frequency there is no warning.
    let below = format!("kp = 0.3\nlead_samples = 1\ncutoff_hz = {}", 0.99 * critical_hz);
    assert!(about_cutoff(&pd(&below)).is_empty());
}
