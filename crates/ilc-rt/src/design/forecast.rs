//! Predictions before the first run: the nominal model of learning, the error of a run without
//! learning, and convergence of the law.

use super::error::DesignError;
use super::plan::{model, refused, weighed_model};
use crate::config::Cell;
use crate::config::mode::{self, AxisProgram, Effort};
use crate::learning::analysis::{divergence, overreach};
use crate::learning::{Law, LearningError};
use crate::model::{ModelError, StateSpace};

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
/// cst: `e = d - P F(d)`, `F` being the force of the cascade for an axis that does not move. The
/// feed-forwards of velocity and torque are added.
///
/// # Shapes
/// - `reference_m` and the result: `n_samples` x `n_axes`, time first
/// # Errors
/// [`DesignError::Model`] if the cell's parameters give no model.
pub fn first_error(cell: &Cell, reference_m: &[f64]) -> Result<Vec<f64>, DesignError> {
    let n_axes = cell.n_axes();
    let mut error_m = vec![0.0; reference_m.len()];
    for (i, axis) in cell.axes.iter().enumerate() {
        let program = AxisProgram::new(reference_m, n_axes, i, cell.cycle_s());
        let response_m = mode::program_response(axis, axis, &program)
            .map_err(|source| DesignError::Model { file: file(cell), source })?;
        let left_m = program.way_m.iter().zip(response_m).map(|(way, moved)| way - moved);
        error_m.iter_mut().skip(i).step_by(n_axes).zip(left_m).for_each(|(e, left)| *e = left);
    }
    Ok(error_m)
}

/// Returns an axis that differs from its model, for trials of weights: its model from the learned input, in the
/// unit of the weights, and its response to the program without learning.
///
/// `frequency` and `damping` are factors, as for [`mode::ModeDesign::perturbed`]; `delay` counts cycles in
/// addition to those of its model.
///
/// # Shapes
/// - `reference_m`: `n_samples` x `n_axes`, time first; the response: `n_samples`, relative to the start
/// # Errors
/// [`DesignError::Model`] if the perturbed parameters give no model.
pub fn perturbed_axis(
    cell: &Cell,
    reference_m: &[f64],
    index: usize,
    [frequency, damping]: [f64; 2],
    delay: i64,
) -> Result<(StateSpace, Vec<f64>), DesignError> {
    let axis = &cell.axes[index];
    let mut plant = mode::of(axis.interface).perturbed(axis, frequency, damping);
    if let Some(model) = &mut plant.model {
        let delayed = (i64::from(model.delay_samples) + delay).max(0);
        model.delay_samples = u32::try_from(delayed).unwrap_or(u32::MAX);
    }
    let program = AxisProgram::new(reference_m, cell.n_axes(), index, cell.cycle_s());
    let whole = || -> Result<_, ModelError> {
        let model = mode::weighed_model(axis, &plant, cell.cycle_s())?;
        Ok((model, mode::program_response(axis, &plant, &program)?))
    };
    whole().map_err(|source| DesignError::Model { file: file(cell), source })
}

/// Refuses a bound of learned torques that the lag of an axis exceeds: no run would be much better than
/// the first.
pub(super) fn check_effort(cell: &Cell, reference_m: &[f64]) -> Result<(), DesignError> {
    let most_n = cell.learning.input_max_n;
    for (index, axis) in cell.axes.iter().enumerate() {
        let program = AxisProgram::new(reference_m, cell.n_axes(), index, cell.cycle_s());
        let effort = mode::effort(axis, &program)
            .map_err(|source| DesignError::Model { file: file(cell), source })?;
        let Some(Effort { peak_n, lag_s, lead_s }) = effort.filter(|e| e.peak_n > most_n) else {
            continue;
        };
        let allowed = format!(
            "at least {peak_n:.0} for axis {}: by its model it is {:.2} ms behind the program, and its loops work \
             against a torque that removes that; velocity feed-forward of 1 with feedforward.lead_s = {lead_s:.6} \
             removes it",
            axis.name,
            1e3 * lag_s
        );
        return Err(refused(cell, "[learning] input_max_n", &most_n, &allowed).into());
    }
    Ok(())
}

/// Refuses a law that is predicted to diverge on the cell's model, unless the cell allows it;
/// returns the verdict as a sentence, and warnings: of an error that will rise before it falls, and
/// of a Q-filter whose cut-off is above the critical frequency.
pub(super) fn judge(
    law: &mut dyn Law,
    cell: &Cell,
    n_samples: usize,
) -> Result<(String, Vec<String>), DesignError> {
    let model = weighed_model(cell)?;
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
