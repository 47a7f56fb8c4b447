//! Predictions before the first run: the nominal model of learning, the error of a run without
//! learning, and convergence of the law.

use super::error::DesignError;
use super::plan::model;
use crate::config::{Cell, mode};
use crate::learning::analysis::{divergence, overreach};
use crate::learning::{Law, LearningError};
use crate::model::StateSpace;

/// Returns the model from the learned input of all axes to their positions.
///
/// # Errors
/// [`DesignError`] if the cell's parameters give no model.
pub fn learning_model(cell: &Cell) -> Result<StateSpace, DesignError> {
    model(cell)
}

/// Returns the predicted error of a run without learning: set point minus response.
///
/// csp: `e = d - P d`, `d` being the distance from the start. csv: `e = d - P (kv d + kf d/dt d)`.
///
/// # Shapes
/// - `reference_m` and the result: `n_samples` x `n_axes`, time first
/// # Errors
/// [`DesignError::Model`] if the cell's parameters give no model.
pub fn first_error(cell: &Cell, reference_m: &[f64]) -> Result<Vec<f64>, DesignError> {
    let n_axes = cell.n_axes();
    let way = |k: usize, axis: usize| reference_m[k * n_axes + axis] - reference_m[axis];
    let n_samples = reference_m.len() / n_axes.max(1);
    let mut drive = vec![0.0; reference_m.len()];
    for (i, axis) in cell.axes.iter().enumerate() {
        let design = mode::of(axis.interface);
        for k in 0..n_samples {
            let ahead = way((k + 1).min(n_samples - 1), i);
            let velocity_m_s = (ahead - way(k, i)) / cell.cycle_s();
            drive[k * n_axes + i] = design.feed(axis, way(k, i), velocity_m_s);
        }
    }
    let response = learning_model(cell)?
        .simulate(&drive, None)
        .map_err(|source| DesignError::Model { file: file(cell), source })?;
    Ok(response.iter().enumerate().map(|(i, y)| way(i / n_axes, i % n_axes) - y).collect())
}

/// Refuses a law that is predicted to diverge on the cell's model, unless the cell allows it;
/// returns the verdict as a sentence, and warnings: of an error that will rise before it falls, and
/// of a Q-filter whose cut-off is above the critical frequency.
pub(super) fn judge(
    law: &mut dyn Law,
    cell: &Cell,
    n_samples: usize,
) -> Result<(String, Vec<String>), DesignError> {
    let model = learning_model(cell)?;
    let refused = |source| DesignError::Learning { file: file(cell), source };
    let verdict = divergence(law, &model, n_samples).map_err(refused)?;
    let mut warnings = Vec::new();
    if let Some(verdict) = &verdict {
        if !verdict.converges && !cell.learning.allow_divergent {
            let why = verdict.why.clone();
            return Err(refused(LearningError::Divergent { why }));
        }
        if !verdict.converges || verdict.rises {
            warnings.push(format!(
                "[learning]: the error will not fall in every run: {}, growth up to {:.3}",
                verdict.why, verdict.transient_growth
            ));
        }
    }
    if let Some(found) = overreach(law, &model, n_samples).map_err(refused)? {
        warnings.push(format!("[learning]: {found}"));
    }
    law.reset();
    Ok((verdict.map_or_else(String::new, |verdict| verdict.why), warnings))
}

fn file(cell: &Cell) -> String {
    cell.file.display().to_string()
}
