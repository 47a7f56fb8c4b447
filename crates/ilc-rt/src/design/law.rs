//! From `[learning]` to the law of a campaign; refuses a diverging one before anything moves.
//!
//! `plan` returns its results.

use super::error::DesignError;
use super::forecast;
use super::plan::weighed_model;
use crate::config::{Cell, ConfigError, InputKind, mode};
use crate::learning::gate::Gate;
use crate::learning::ladder::Ladder;
use crate::learning::law::{BuildError, LawContext, LawTables};
use crate::learning::{Law, LearningError, Scaled};

/// A law that may start.
#[expect(missing_debug_implementations, reason = "laws need not have one")]
pub struct Prepared {
    /// The law; `None` for no learning.
    pub law: Option<Box<dyn Law>>,
    /// Verdict of the analysis, as a sentence; empty if there is none.
    pub verdict: String,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}

/// Creates the law that the cell names, with its wrappers, and analyses it.
pub(super) fn prepare(cell: &Cell, reference_m: &[f64]) -> Result<Prepared, DesignError> {
    let n_samples = reference_m.len() / cell.n_axes();
    let Some(law) = build_law(cell, reference_m)? else {
        return Ok(Prepared { law: None, verdict: String::new(), warnings: Vec::new() });
    };
    forecast::check_effort(cell, reference_m)?;
    let mut law = wrap_law(law, cell).map_err(|source| refused(cell, source.into()))?;
    let (verdict, warnings) = forecast::judge(law.as_mut(), cell, n_samples)?;
    let scale: Vec<f64> = cell.axes.iter().map(mode::scale_of).collect();
    if cell.axes.iter().any(|axis| axis.input_kind() == InputKind::Torque) {
        law = Box::new(Scaled::new(law, scale).map_err(|source| refused(cell, source.into()))?);
    }
    Ok(Prepared { law: Some(law), verdict, warnings })
}

fn refused(cell: &Cell, source: BuildError) -> DesignError {
    let file = cell.file.display().to_string();
    match source {
        BuildError::Refused(violation) => ConfigError::value(&file, &violation).into(),
        BuildError::Learning(source) => DesignError::Learning { file, source },
    }
}

fn build_law(cell: &Cell, reference_m: &[f64]) -> Result<Option<Box<dyn Law>>, DesignError> {
    let Some(parameters) = cell.learning.parameters(cell.learning.law) else {
        return Ok(None);
    };
    let model = weighed_model(cell)?;
    let mut for_laws = cell.for_laws();
    for (axis, own) in for_laws.axes.iter_mut().zip(&cell.axes) {
        axis.input_max *= mode::scale_of(own);
    }
    let context = LawContext { cell: &for_laws, model: &model, reference_m };
    parameters.build(&context).map(Some).map_err(|source| refused(cell, source))
}

/// Wraps the law in its ladder, and both in the gate: the gate judges every run, and the input that
/// it keeps or restores is not scaled by the ladder's gain.
fn wrap_law(law: Box<dyn Law>, cell: &Cell) -> Result<Box<dyn Law>, LearningError> {
    let mut law = law;
    let mut runs_a_step = 1;
    if let Some(ladder) = cell.learning.ladder {
        law = Box::new(Ladder::new(law, ladder)?);
        runs_a_step = ladder.repeats;
    }
    if let Some(gate) = cell.learning.gate {
        law = Box::new(Gate::new(law, gate.rule(cell.n_axes(), runs_a_step))?);
    }
    Ok(law)
}
