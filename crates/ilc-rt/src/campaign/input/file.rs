//! A learned input as a file: one JSON object with its task, its provenance and a digest of both.

use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::choice::{Chosen, Origin};
use super::error::InputError;
use super::task::Task;
use crate::config::{Cell, read_file};
use crate::design::Plan;
use crate::record::{TEXT_MAX, fingerprint, printable};

/// Largest file: a minute of six axes at 4 kHz takes half of it.
const FILE_BYTES_MAX: u64 = 64 << 20;
/// Mark of these files, with the version of their format.
const FORMAT: &str = "ilc-rt learned input 1";

/// Content of a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    format: String,
    task: Task,
    origin: Origin,
    /// Digest of everything else.
    digest: String,
    /// Learned input, one row per sample.
    input: Vec<Vec<f64>>,
}

impl Content {
    fn own_digest(&self) -> String {
        fingerprint(
            &serde_json::json!([self.format, self.task, self.origin, self.input]).to_string(),
        )
    }
}

/// Writes an input to a file; an existing one is replaced as a whole.
///
/// # Errors
/// [`InputError::Unusable`] if it cannot be written, or would be too large to be read.
pub fn save(chosen: &Chosen, n_axes: usize, path: &Path) -> Result<(), InputError> {
    let mut content = Content {
        format: FORMAT.to_owned(),
        task: chosen.task.clone(),
        origin: chosen.origin.clone(),
        digest: String::new(),
        input: chosen.input.chunks(n_axes.max(1)).map(<[f64]>::to_vec).collect(),
    };
    content.digest = content.own_digest();
    let text = serde_json::to_string(&content).map_err(|error| unusable(path, &error))? + "\n";
    if text.len() as u64 > FILE_BYTES_MAX {
        return Err(unusable(path, &format!("more than {FILE_BYTES_MAX} bytes would be needed")));
    }
    if path.symlink_metadata().is_ok_and(|found| !found.is_file()) {
        return Err(unusable(path, &"not a regular file"));
    }
    // Beside the file first: a full disk leaves the old one as it was.
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = std::fs::File::create_new(&part).and_then(|mut file| {
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        std::fs::rename(&part, path)
    });
    written.map_err(|error| {
        let _ = std::fs::remove_file(&part);
        unusable(path, &error)
    })
}

/// Loads the input of a file for a planned cell.
///
/// # Errors
/// [`InputError`] for another kind of file, one that is damaged, or belongs to another task; for an
/// input beyond the bounds of the cell.
pub fn load(path: &Path, cell: &Cell, plan: &Plan) -> Result<Chosen, InputError> {
    let bytes = read_file(path, FILE_BYTES_MAX).map_err(|reason| unusable(path, &reason))?;
    let content: Content =
        serde_json::from_slice(&bytes).map_err(|error| unusable(path, &error))?;
    if content.format != FORMAT {
        let found = printable(&content.format, TEXT_MAX);
        return Err(unusable(path, &format!("its format is \"{found}\", not \"{FORMAT}\"")));
    }
    let place = place(path);
    if content.own_digest() != content.digest {
        return Err(InputError::Damaged { path: place });
    }
    let task = Task::new(cell, plan);
    content.task.require(&task, &place)?;
    let n_axes = cell.n_axes();
    if let Some(row) = content.input.iter().find(|row| row.len() != n_axes) {
        return Err(unusable(path, &format!("a row of {} numbers, not {n_axes}", row.len())));
    }
    if !content.origin.error.is_finite() || content.origin.error < 0.0 {
        return Err(unusable(path, &format!("its error is {}", content.origin.error)));
    }
    let input: Vec<f64> = content.input.into_iter().flatten().collect();
    task.require_bounds(&input, &plan.input_bounds(), &place)?;
    Ok(Chosen { task, origin: content.origin, input })
}

fn place(path: &Path) -> String {
    printable(&path.display().to_string(), TEXT_MAX)
}

fn unusable(path: &Path, reason: &dyn std::fmt::Display) -> InputError {
    InputError::Unusable { path: place(path), reason: printable(&reason.to_string(), TEXT_MAX) }
}
