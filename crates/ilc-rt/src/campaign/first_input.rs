//! Input of the first run of a new campaign: that of the law, from its parameters or from the runs it
//! remembers, or of the parameters of another program.

use super::error::CampaignError;
use super::input::{Task, take_over};
use super::options::Options;
use super::rollback::RollbackPolicy;
use crate::config::Cell;
use crate::design::{DesignError, Plan};
use crate::learning::Law;
use crate::library::Library;
use crate::record::Figures;

/// Returns the input that a law begins with; `None` for zero.
///
/// # Errors
/// [`CampaignError::Input`] if no run of the library fits, or parameters demand an input beyond the
/// bounds of the cell; [`CampaignError::Library`]; [`CampaignError::Design`] if the law refuses.
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
    let Some(law) = law else { return Ok(None) };
    let refused = |source| {
        let file = cell.file.display().to_string();
        DesignError::Learning { file, source }
    };
    let Some(input) = law.first_input().map_err(refused)? else { return Ok(None) };
    // What a law learned is limited by the loop, as after any run; parameters are a person's.
    if law.n_disturbances().is_none() {
        let bounds = plan.input_bounds();
        Task::new(cell, plan).require_bounds(&input, &bounds, "the parameters of the law")?;
    }
    Ok(Some(input))
}
