//! What is allowed in `[learning]`, its laws, and what goes round them.

use super::checker::Checker;
use crate::config::{
    Cell, ConfigError, ContourSection, Interface, LawName, Measure, NormOptimalSection,
};

/// Ranges of the learning; those of the other laws' tables too, so that a slip shows at once.
pub(super) fn check(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let l = &cell.learning;
    if let Some(ratio) = l.rollback_ratio {
        v.that(
            l.gate.is_none(),
            "[learning] rollback_ratio",
            &ratio,
            "not with [learning.gate], whose growth and patience decide instead; remove one of them",
        )?;
    }
    norm_optimal(cell, &l.norm_optimal, v)?;
    low_pass(cell, v, "pd", Some(l.pd.cutoff_hz))?;
    constrained(cell, v)?;
    low_pass(cell, v, "adjoint", l.adjoint.cutoff_hz)?;
    low_pass(cell, v, "model_inverse", Some(l.model_inverse.cutoff_hz))?;
    error_feedforward(cell, v)?;
    v.that(
        l.law != LawName::None || (l.ladder.is_none() && l.gate.is_none()),
        "[learning] law",
        &"none",
        "a law, as [learning.ladder] and [learning.gate] go round one; remove them",
    )?;
    v.that(
        l.law == LawName::None || l.measure == Measure::Encoder || cell.tcp_encoder.is_some(),
        "[learning] measure",
        &"tcp",
        "\"encoder\", as there is no [tcp_encoder]",
    )
}

fn low_pass(
    cell: &Cell,
    v: &Checker,
    table: &str,
    cutoff_hz: Option<f64>,
) -> Result<(), ConfigError> {
    let nyquist_hz = 0.5 / cell.cycle_s();
    let key = format!("[learning.{table}] cutoff_hz");
    v.range_if(&key, cutoff_hz, 1e-3 * nyquist_hz, 0.95 * nyquist_hz)
}

fn norm_optimal(cell: &Cell, n: &NormOptimalSection, v: &Checker) -> Result<(), ConfigError> {
    let nyquist_hz = 0.5 / cell.cycle_s();
    let key = "[learning.norm_optimal] smoothing_hz";
    v.range(key, n.smoothing_hz, 1e-3 * nyquist_hz, 0.95 * nyquist_hz)?;
    if let Some(section) = &n.contour {
        contour(cell, section, v)?;
    }
    let mut before_s = 0.0;
    for (number, phase) in n.phases.iter().enumerate() {
        let key = |name: &str| format!("[[learning.norm_optimal.phase]] {} {name}", number + 1);
        v.that(
            phase.from_s >= before_s,
            &key("from_s"),
            &phase.from_s,
            &format!("at least {before_s}, where the phase before ends"),
        )?;
        v.that(
            phase.to_s >= phase.from_s + cell.cycle_s(),
            &key("to_s"),
            &phase.to_s,
            &format!("at least one cycle after from_s = {}", phase.from_s),
        )?;
        before_s = phase.to_s;
        v.that(
            phase.contour.is_none() || n.contour.is_some(),
            &key("contour"),
            &"given",
            "only with [learning.norm_optimal.contour]",
        )?;
    }
    Ok(())
}

fn contour(cell: &Cell, c: &ContourSection, v: &Checker) -> Result<(), ConfigError> {
    let key = "[learning.norm_optimal.contour] axes";
    for (place, name) in c.axes.iter().enumerate() {
        v.that(
            cell.axes.iter().any(|axis| axis.name == *name) && !c.axes[..place].contains(name),
            key,
            name,
            "names of axes of this cell, each once",
        )?;
    }
    let count = if c.axes.is_empty() { cell.n_axes() } else { c.axes.len() };
    v.that(
        (2..=3).contains(&count),
        key,
        &format!("{:?}", c.axes),
        "the 2 or 3 axes that make the path (all axes if none is named)",
    )
}

fn constrained(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let c = &cell.learning.constrained;
    // What the axes are allowed is the most that their set points are.
    let least = |limit: fn(&crate::config::Limits) -> f64| {
        let csp = cell.axes.iter().filter(|axis| axis.interface == Interface::Csp);
        csp.map(|axis| limit(&axis.limits)).fold(f64::INFINITY, f64::min)
    };
    for (name, bound, low, highest) in [
        ("velocity_max_m_s", c.velocity_max_m_s, 1e-6, least(|limits| limits.velocity_max_m_s)),
        (
            "acceleration_max_m_s2",
            c.acceleration_max_m_s2,
            1e-4,
            least(|limits| limits.acceleration_max_m_s2),
        ),
    ] {
        let key = format!("[learning.constrained] {name}");
        v.that(
            bound.is_none() || highest.is_finite(),
            &key,
            &"given",
            "only with csp axes: a csv axis has no corrected set point; remove it",
        )?;
        v.range_if(&key, bound, low, highest)?;
    }
    let positive = cell.learning.law != LawName::Constrained || inputs_allowed(cell);
    v.that(positive, "[learning] law", &"constrained", INPUT_NEEDED)
}

/// What is told where a law needs room for its input.
const INPUT_NEEDED: &str = "needs input_max_m (csp axes) and input_max_m_s (csv axes) above 0";

fn inputs_allowed(cell: &Cell) -> bool {
    cell.axes.iter().all(|axis| match axis.interface {
        Interface::Csp => cell.learning.input_max_m > 0.0,
        Interface::Csv => cell.learning.input_max_m_s > 0.0,
    })
}

fn error_feedforward(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let e = &cell.learning.error_feedforward;
    low_pass(cell, v, "error_feedforward", Some(e.cutoff_hz))?;
    if cell.learning.law != LawName::ErrorFeedforward {
        return Ok(());
    }
    // The law adds to the output of a controller that goes on acting on the error itself.
    for axis in &cell.axes {
        v.that(
            axis.interface == Interface::Csv,
            "[learning] law",
            &"error_feedforward",
            &format!(
                "only with interface = \"csv\" on every axis, as it adds to the output of the position \
                 loop here; axis {} has its position loop in the drive",
                axis.name
            ),
        )?;
    }
    v.that(inputs_allowed(cell), "[learning] law", &"error_feedforward", INPUT_NEEDED)
}
