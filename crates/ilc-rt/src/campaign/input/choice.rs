//! Choice of the run whose input is used again.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::error::InputError;
use super::task::Task;
use crate::config::Cell;
use crate::design::Plan;
use crate::library::{Library, LibraryError, Row};
use crate::record::{Figures, fingerprint};

/// Law in the records of runs with a frozen input: they have no law.
pub(in crate::campaign) const FROZEN: &str = "frozen";
/// Law in the records of experiments, whose input is an excitation.
pub(super) const EXCITATION: &str = "excitation";

/// Run of the library to take an input from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// The run with the smallest error.
    #[default]
    Best,
    /// The newest run that was not rolled back, and did not only measure.
    Last,
    /// The run of this key.
    Id(i64),
}

impl FromStr for Source {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "best" => Ok(Self::Best),
            "last" => Ok(Self::Last),
            _ => text
                .parse()
                .ok()
                .filter(|id| *id > 0)
                .map(Self::Id)
                .ok_or_else(|| "allowed: best, last, or the id of a run".to_owned()),
        }
    }
}

/// Provenance of an input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Campaign of the run.
    pub campaign: String,
    /// Number of the run in its campaign.
    pub index: u32,
    /// Law that learned it.
    pub law: String,
    /// Parameters of the law.
    pub law_parameters: String,
    /// Fingerprint of the campaign.
    pub fingerprint: String,
    /// SHA-256 of the run.
    pub run_digest: String,
    /// RMS error over all axes with this input: the reference for a drift.
    pub error: f64,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "run {} of campaign {}", self.index, self.campaign)
    }
}

/// An input to use again.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// Its task.
    pub task: Task,
    /// Its provenance.
    pub origin: Origin,
    /// Learned input, `n_samples * n_axes`.
    pub input: Vec<f64>,
}

impl Chosen {
    /// Returns the provenance as JSON: the parameters of a law in the records of frozen runs.
    pub(in crate::campaign) fn parameters(&self) -> String {
        let input = serde_json::json!(self.input).to_string();
        serde_json::json!({ "origin": self.origin, "input": fingerprint(&input) }).to_string()
    }
}

/// Chooses the input of a run of the library; `is_disturbed` excludes runs that are no evidence.
///
/// Of `best` and `last`, runs of the same fingerprint precede others of the same task: a law with
/// other weights, or without a model, is no reason not to use an input.
///
/// # Errors
/// [`InputError`] if no run fits; [`LibraryError`] if the library cannot be read.
pub fn choose(
    library: &Library,
    path: &str,
    source: Source,
    (cell, plan): (&Cell, &Plan),
    is_disturbed: impl Fn(&Figures) -> bool,
) -> Result<Result<Chosen, InputError>, LibraryError> {
    let task = Task::new(cell, plan);
    let place = |row: &Row| format!("library {path}: run {}", row.id);
    let is_same = |row: &Row| {
        plan.fingerprint_with(cell, &row.meta.law, &row.meta.law_parameters) == row.meta.fingerprint
    };
    let id = if let Source::Id(id) = source {
        id
    } else {
        let mut rows = library.list(None)?;
        rows.retain(|row| row.meta.cell == plan.meta.cell);
        rows.retain(|row| ![FROZEN, EXCITATION].contains(&row.meta.law.as_str()));
        rows.retain(|row| !is_disturbed(&row.record.figures));
        rows.retain(|row| !row.record.figures.only_measures());
        let newest = rows.last().map(|row| task.require_row(row, &place(row)));
        rows.retain(|row| task.require_row(row, "").is_ok());
        let same: Vec<Row> = rows.iter().filter(|row| is_same(row)).cloned().collect();
        let rows = if same.is_empty() { rows } else { same };
        let error = |row: &Row| row.record.figures.judged_by();
        let chosen = match source {
            // Of equals the newer: the last of the smallest.
            Source::Best => rows.iter().rev().min_by(|a, b| error(a).total_cmp(&error(b))),
            _ => rows.iter().rev().find(|row| !row.record.figures.rolled_back),
        };
        let Some(row) = chosen else {
            let nearest = match newest {
                Some(Err(difference)) => format!("; {difference}"),
                _ => String::new(),
            };
            return Ok(Err(InputError::NoRun { path: path.to_owned(), nearest }));
        };
        row.id
    };
    let row = library.load(id)?;
    let place = place(&row);
    if let Err(difference) = task.require_row(&row, &place) {
        return Ok(Err(difference));
    }
    if !is_same(&row) {
        tracing::info!(
            "{place} was made with other limits, models or weights than the cell has now; its input \
             is used as it is"
        );
    }
    let origin = Origin {
        campaign: row.meta.campaign,
        index: row.record.index,
        law: row.meta.law,
        law_parameters: row.meta.law_parameters,
        fingerprint: row.meta.fingerprint,
        run_digest: row.digest,
        error: row.record.figures.judged_by(),
    };
    Ok(task.require_bounds(&row.record.input, &plan.input_bounds(), &place).map(|()| Chosen {
        task,
        origin,
        input: row.record.input,
    }))
}
