//! Parameters of a law from a run of another program of the same machine.

use super::choice::{EXCITATION, FROZEN, Source};
use super::error::InputError;
use super::task::Task;
use crate::config::Cell;
use crate::design::Plan;
use crate::learning::Law;
use crate::library::{Library, LibraryError, Row};
use crate::record::Figures;

/// Gives a law the parameters that a run of the library shows, and returns the input of its first run.
///
/// `last` is the newest run of the law on this machine that was not rolled back, `best` that with the smallest
/// error in its campaign: errors of different programs cannot be compared. `is_disturbed` excludes runs that are
/// no evidence.
///
/// # Errors
/// [`InputError`] if no run fits, the law has no such parameters, or they give an input beyond the bounds of the
/// cell; [`LibraryError`] if the library cannot be read.
pub fn take_over(
    library: &Library,
    path: &str,
    source: Source,
    (cell, plan): (&Cell, &Plan),
    law: Option<&mut (dyn Law + 'static)>,
    is_disturbed: impl Fn(&Figures) -> bool,
) -> Result<Result<Option<Vec<f64>>, InputError>, LibraryError> {
    let name = plan.meta.law.clone();
    let Some(law) = law else { return Ok(Err(InputError::Unparametric { law: name })) };
    let task = Task::new(cell, plan);
    let place = |row: &Row| format!("library {path}: run {}", row.id);
    let id = if let Source::Id(id) = source {
        id
    } else {
        let mut rows = library.list(None)?;
        rows.retain(|row| row.meta.cell == plan.meta.cell && row.meta.law == name);
        rows.retain(|row| !is_disturbed(&row.record.figures));
        let newest = rows.last().map(|row| task.require_machine(row, &place(row)));
        rows.retain(|row| task.require_machine(row, "").is_ok());
        rows.retain(|row| source == Source::Best || !row.record.figures.rolled_back);
        let campaign = rows.last().map(|row| row.meta.campaign.clone());
        let error = |row: &&Row| row.record.figures.judged_by();
        let chosen = match source {
            Source::Best => rows
                .iter()
                .rev()
                .filter(|row| Some(&row.meta.campaign) == campaign.as_ref())
                .min_by(|a, b| error(a).total_cmp(&error(b))),
            _ => rows.last(),
        };
        let Some(row) = chosen else {
            let nearest = match newest {
                Some(Err(difference)) => format!("; {difference}"),
                _ => String::new(),
            };
            let path = path.to_owned();
            return Ok(Err(InputError::NoParameters { path, law: name, nearest }));
        };
        row.id
    };
    let row = library.load(id)?;
    let place = place(&row);
    if let Err(difference) = task.require_machine(&row, &place) {
        return Ok(Err(difference));
    }
    if [FROZEN, EXCITATION].contains(&row.meta.law.as_str()) {
        let (path, nearest) = (path.to_owned(), format!("; {place} has law \"{}\"", row.meta.law));
        return Ok(Err(InputError::NoParameters { path, law: name, nearest }));
    }
    // The run was stored whole, so that its signals have one row per sample.
    let reference_m = &row.record.reference_m;
    let input = match law.take_over(reference_m, &row.record.input) {
        Ok(false) => return Ok(Err(InputError::Unparametric { law: name })),
        Ok(true) => law.first_input(),
        Err(source) => Err(source),
    };
    let input = match input {
        Ok(input) => input,
        Err(source) => {
            let source = Box::new(source);
            return Ok(Err(InputError::Refused { place, law: name, source }));
        }
    };
    let (index, campaign) = (row.record.index, &row.meta.campaign);
    tracing::info!("the law begins with the parameters of run {index} of campaign {campaign}");
    let Some(input) = input else { return Ok(Ok(None)) };
    let bounds = plan.input_bounds();
    let place = format!("parameters of {place}");
    Ok(task.require_bounds(&input, &bounds, &place).map(|()| Some(input)))
}
