//! Fingerprint by which a campaign can be resumed: a digest of cell, program, measurement, law and
//! parameters, stored with every run. `plan` computes it, `campaign` compares it.

use serde_json::json;

use crate::config::{Axis, Cell, InputKind};
use crate::record::{Meta, fingerprint};

/// Returns the digest of the canonical JSON of everything that determines what a law learns; `law`
/// and `parameters` are those of the law in use.
pub(super) fn of(cell: &Cell, meta: &Meta, law: &str, parameters: &str) -> String {
    let axes: Vec<_> = cell
        .axes
        .iter()
        .map(|axis| {
            let mut described = json!({
                "name": axis.name,
                "interface": axis.interface,
                "limits": axis.limits,
                "model": axis.model,
                "position_loop": axis.position_loop,
            });
            // Later keys only where they are used: campaigns of before they existed can be resumed.
            for (key, value) in [
                ("input", json!(axis.input)),
                ("force", json!(axis.force)),
                ("cascade", json!(axis.cascade)),
                ("feedforward", json!(axis.feedforward)),
                ("input_max_n", json!(learned_torque_max_n(cell, axis))),
            ] {
                if !value.is_null() {
                    described[key] = value;
                }
            }
            described
        })
        .collect();
    let whole = json!({
        "cell": meta.cell,
        "axes": axes,
        "program": meta.program,
        "cycle_us": cell.cell.cycle_us,
        "measure": meta.measure,
        "law": law,
        "parameters": parameters,
        "input_max_m": cell.learning.input_max_m,
        "input_max_m_s": cell.learning.input_max_m_s,
        // For time-varying weights, the law's own parameters do not contain every number.
        "learning": is_named(cell, law).then(|| cell.learning.law_json()),
    });
    fingerprint(&whole.to_string())
}

fn learned_torque_max_n(cell: &Cell, axis: &Axis) -> Option<f64> {
    (axis.input_kind() == InputKind::Torque).then_some(cell.learning.input_max_n)
}

fn is_named(cell: &Cell, law: &str) -> bool {
    law == cell.learning.law.as_str()
}

/// Returns the digest of versions up to 0.1, made of `Debug` texts: for their libraries only.
///
/// A struct whose fields change must be written out here in its old form; the test below has
/// digests of those versions.
pub(super) fn legacy(cell: &Cell, meta: &Meta, law: &str, parameters: &str) -> String {
    let axes: Vec<_> = cell
        .axes
        .iter()
        .map(|a| {
            let model = a.model.unwrap_or_default();
            format!("{:?}", (&a.name, a.interface, a.limits, model, a.position_loop))
        })
        .collect();
    let learning = &cell.learning;
    let law_text = || {
        let tables = format!(
            "({:?}, {}, {:?}, {:?})",
            learning.law,
            learning.table_debug(),
            learning.ladder,
            learning.gate
        );
        [("ContourParameters", "ContourSection"), ("PhaseParameters", "PhaseSection")]
            .iter()
            .chain(&[("LadderRule", "LadderSection"), ("GateParameters", "GateSection")])
            .chain(&[("Parameters {", "Section {")])
            .fold(tables, |text, (now, then)| text.replace(now, then))
    };
    let parameters = [
        ("\"lead_samples\":", "\"lead\":"),
        ("\"gain_per_s\":", "\"gain\":"),
        ("\"input_max\":", "\"limit\":"),
    ]
    .iter()
    .fold(parameters.to_owned(), |text, (now, then)| text.replace(now, then));
    let whole = format!(
        "{:?}",
        (
            &meta.cell,
            axes,
            &meta.program,
            cell.cell.cycle_us,
            &meta.measure,
            law,
            &*parameters,
            learning.input_max_m,
            learning.input_max_m_s,
            is_named(cell, law).then(law_text),
        )
    );
    fingerprint(&whole)
}
