//! Contradictions within `[learning]`, its laws, and their wrappers.

use super::checker::Checker;
use crate::config::{Cell, ConfigError, LawName, Measure, mode};
use crate::learning::law::{LawAxis, LawCell, LawParameters, LawTables};

/// Checks for contradictions, also in the tables of other laws, so that a slip shows at once.
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
    let for_laws = cell.for_laws();
    for law in LawName::ALL {
        if let Some(parameters) = l.parameters(*law) {
            v.allow(parameters.check(&for_laws))?;
        }
    }
    if let Some(parameters) = l.parameters(l.law) {
        v.allow(parameters.requires(&for_laws))?;
        if let Some(core) = parameters.core().and_then(|core| l.parameters(core)) {
            v.allow(core.requires(&for_laws))?;
        }
    }
    v.that(
        l.ladder.is_none() || !l.parameters(l.law).is_some_and(LawParameters::measures),
        "[learning] law",
        &l.law.as_str(),
        "a law that learns from every run, as [learning.ladder] scales its inputs; remove the ladder",
    )?;
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

impl Cell {
    /// Returns the part of the cell that laws use.
    pub fn for_laws(&self) -> LawCell<'_> {
        LawCell {
            axes: self
                .axes
                .iter()
                .map(|axis| LawAxis {
                    name: &axis.name,
                    input: axis.input_kind(),
                    input_max: mode::bound_of(axis.input_kind(), &self.learning),
                    position_min: axis.limits.position_min_m,
                    position_max: axis.limits.position_max_m,
                    velocity_max: axis.limits.velocity_max_m_s,
                    acceleration_max: axis.limits.acceleration_max_m_s2,
                })
                .collect(),
            cycle_s: self.cycle_s(),
            tables: &self.learning,
        }
    }
}
