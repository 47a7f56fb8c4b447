//! Input of the first run of a new campaign, of a law with parameters: its own, or those of another program.

use super::error::CampaignError;
use super::input::{Task, take_over};
use super::options::Options;
use super::rollback::RollbackPolicy;
use crate::config::Cell;
use crate::design::Plan;
use crate::learning::Law;
use crate::library::Library;
use crate::record::Figures;

/// Returns the input that a law begins with; `None` for zero.
///
/// # Errors
/// [`CampaignError::Input`] if no run of the library fits, or the input is beyond the bounds of the cell;
/// [`CampaignError::Library`].
pub(super) fn first_input(
    library: &Library,
    options: &Options,
    (cell, plan): (&Cell, &Plan),
    law: Option<&mut (dyn Law + 'static)>,
    policy: &RollbackPolicy,
) -> Result<Option<Vec<f64>>, CampaignError> {
    if let Some(source) = options.parameters_from {
        let path = options.session.library.display().to_string();
        let is_disturbed = |figures: &Figures| policy.is_disturbed(figures);
        return Ok(take_over(library, &path, source, (cell, plan), law, is_disturbed)??);
    }
    let Some(input) = law.and_then(|law| law.first_input()) else { return Ok(None) };
    let bounds = plan.input_bounds();
    Task::new(cell, plan).require_bounds(&input, &bounds, "the parameters of the law")?;
    Ok(Some(input))
}
